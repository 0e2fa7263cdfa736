"""Rotations in float64, vectorised over leading axes.

Quaternions are x, y, z, w; q and -q are the same rotation. Rotation vectors are axis times angle, rad. The order of
products is that of matrices: ``R(compose(a, b)) = R(a) R(b)``. NaN, or a quaternion of length 0 or infinity, gives NaN.

Source: J. Sola, J. Deray, D. Atchuthan, A micro Lie theory for state estimation in robotics (2018), appendix B.
"""

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

_SMALL_ANGLE_RAD = 1e-3
"""Below this angle power series are used; their first neglected term is below 6e-16 relative (exp) or 3e-21 (log)."""


def normalise(orientations_xyzw: Float64) -> Float64:
    """Return quaternions (..., 4) scaled to unit length."""
    norms = np.linalg.norm(orientations_xyzw, axis=-1, keepdims=True)
    unit: Float64 = orientations_xyzw / np.where((norms > 0) & np.isfinite(norms), norms, np.nan)
    return unit


def compose(left_xyzw: Float64, right_xyzw: Float64) -> Float64:
    """Return the Hamilton product ``left * right`` of quaternions: the rotation ``right`` followed by ``left``.

    Parameters
    ----------
    left_xyzw, right_xyzw
        (..., 4); their leading axes broadcast.

    Returns
    -------
    ndarray of float64
        (..., 4), of unit length if both factors are.
    """
    x0, y0, z0, w0 = (left_xyzw[..., i] for i in range(4))  # by components: np.cross is slower than the whole product
    x1, y1, z1, w1 = (right_xyzw[..., i] for i in range(4))
    x = w0 * x1 + w1 * x0 + (y0 * z1 - z0 * y1)
    product = np.empty((*np.shape(x), 4))  # np.stack takes as long as all multiplications
    product[..., 0] = x
    product[..., 1] = w0 * y1 + w1 * y0 + (z0 * x1 - x0 * z1)
    product[..., 2] = w0 * z1 + w1 * z0 + (x0 * y1 - y0 * x1)
    product[..., 3] = w0 * w1 - (x0 * x1 + y0 * y1 + z0 * z1)
    return product


def inverse(orientations_xyzw: Float64) -> Float64:
    """Return the inverse of unit quaternions (..., 4)."""
    conjugate: Float64 = orientations_xyzw * np.array([-1.0, -1.0, -1.0, 1.0])
    return conjugate


def exp_quaternion(rotation_vectors_rad: Float64) -> Float64:
    """Return the unit quaternions (..., 4) of rotation vectors (..., 3)."""
    angle_rad = np.linalg.norm(rotation_vectors_rad, axis=-1, keepdims=True)
    half = 0.5 * angle_rad
    # sin(a/2) / a, by its series 1/2 - a^2/48 near 0.
    quotient = np.sin(half) / np.where(angle_rad == 0, 1.0, angle_rad)
    ratio = np.where(angle_rad < _SMALL_ANGLE_RAD, 0.5 - angle_rad**2 / 48, quotient)
    return np.concatenate((ratio * rotation_vectors_rad, np.cos(half)), axis=-1)


def log_quaternion(orientations_xyzw: Float64) -> Float64:
    """Return rotation vectors (..., 3) of at most pi in length, of quaternions (..., 4) of any nonzero length.

    The angle is ``2 atan2(|v|, w)``. It is accurate to rounding for tiny rotations and near pi; arccos of the trace
    loses all digits there.
    """
    x, y, z, w = (orientations_xyzw[..., i] for i in range(4))
    # Log(q) = 2 atan2(|v|, |w|) v / |v|, v being (x, y, z).
    sine, cosine = np.sqrt(x * x + y * y + z * z), np.abs(w)
    ratio = 2.0 * np.arctan2(sine, cosine) / np.where(sine > 0, sine, np.nan)
    small = sine < 0.5 * _SMALL_ANGLE_RAD * cosine
    if np.any(small):
        safe_w = np.where(small, cosine, 1.0)
        tangent_squared = (np.where(small, sine, 0.0) / safe_w) ** 2
        # 2 atan(t) / s with t = s/w: 2/w (1 - t^2/3 + t^4/5).
        series = 2.0 / safe_w * (1.0 - tangent_squared / 3 + tangent_squared**2 / 5)
        ratio = np.where(small, series, ratio)
    # q and -q are the same rotation: the one with w >= 0 has an angle of at most pi.
    vectors: Float64 = np.where(w < 0, -ratio, ratio)[..., None] * orientations_xyzw[..., :3]
    return vectors


def matrices_from_quaternions(orientations_xyzw: Float64) -> Float64:
    """Return rotation matrices (..., 3, 3) of quaternions (..., 4) of any nonzero length."""
    return _matrices_of_units(normalise(orientations_xyzw))


def _matrices_of_units(units_xyzw: Float64) -> Float64:
    x, y, z, w = (units_xyzw[..., i] for i in range(4))
    R = np.empty((*np.shape(x), 3, 3))
    # R(q) of a unit quaternion (appendix B of the source above).
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    return R


def quaternions_from_matrices(R: Float64) -> Float64:
    """Return unit quaternions (..., 4), w not negative, of rotation matrices (..., 3, 3).

    The symmetric matrix of products ``4 q q^T`` is linear in R. Its column with the largest diagonal element is q
    times a number of size 2 or more, so that no rotation loses digits (S. W. Shepperd, J. Guidance and Control 1 (1978)
    223).
    """
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    xw, yw, zw = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    # 4 q q^T, its rows and columns in the order x, y, z, w.
    products = np.array(
        [
            [1 + xx - yy - zz, xy, xz, xw],
            [xy, 1 - xx + yy - zz, yz, yw],
            [xz, yz, 1 - xx - yy + zz, zw],
            [xw, yw, zw, 1 + xx + yy + zz],
        ]
    )
    products = np.moveaxis(products, (0, 1), (-2, -1))
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    column = np.take_along_axis(products, largest[..., None, None], axis=-1)[..., 0]
    return normalise(np.where(column[..., 3:] < 0, -column, column))


def angles_from_quaternions(orientations_xyzw: Float64) -> Float64:
    """Return yaw, pitch and roll (..., 3), rad, of quaternions (..., 4) of any nonzero length.

    ``R = R_z(yaw) R_y(pitch) R_x(roll)``, with pitch from -90 to 90 deg. At either end yaw and roll are not determined.
    """
    R = matrices_from_quaternions(orientations_xyzw)
    yaw, roll = np.arctan2(R[..., 1, 0], R[..., 0, 0]), np.arctan2(R[..., 2, 1], R[..., 2, 2])
    pitch = np.arctan2(-R[..., 2, 0], np.hypot(R[..., 0, 0], R[..., 1, 0]))
    return np.stack((yaw, pitch, roll), axis=-1)


def quaternions_from_angles(angles_rad: Float64) -> Float64:
    """Return unit quaternions (..., 4) of yaw, pitch and roll (..., 3), rad: ``q_z(yaw) q_y(pitch) q_x(roll)``."""
    axes = np.eye(3)[::-1]  # z, y, x
    of_yaw, of_pitch, of_roll = (exp_quaternion(angles_rad[..., i, None] * axes[i]) for i in range(3))
    return compose(compose(of_yaw, of_pitch), of_roll)


def exp(rotation_vectors_rad: Float64) -> Float64:
    """Return rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    return _matrices_of_units(exp_quaternion(rotation_vectors_rad))


def log(R: Float64) -> Float64:
    """Return rotation vectors (..., 3) of at most pi in length, of rotation matrices (..., 3, 3)."""
    return log_quaternion(quaternions_from_matrices(R))


def cross_matrices(vectors: Float64) -> Float64:
    """Return the skew-symmetric matrices (..., 3, 3) of vectors (..., 3): ``cross_matrices(a) @ b = a x b``."""
    x, y, z = (vectors[..., i] for i in range(3))
    crosses = np.zeros((*np.shape(x), 3, 3))
    crosses[..., 0, 1], crosses[..., 0, 2], crosses[..., 1, 2] = -z, y, -x
    crosses[..., 1, 0], crosses[..., 2, 0], crosses[..., 2, 1] = z, -y, x
    return crosses

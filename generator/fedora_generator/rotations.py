"""Rotations of the generator: Euler angles, quaternions and the exponential map, vectorised over rows.

Quaternions are x, y, z, w. Euler angles are intrinsic Z-Y-X: ``R = Rz(yaw) Ry(pitch) Rx(roll)``. The body's Y axis
points left, so a positive pitch lowers the nose and a positive roll lowers the right wing.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def quaternions_from_zyx(yaw_rad: Floats, pitch_rad: Floats, roll_rad: Floats) -> Floats:
    """Quaternions (n, 4), body to world, of Euler angles (n,), rad; smooth angles give a sign that never jumps.

    Source: J. Diebel, Representing Attitude (2006), Euler angle sequence (3, 2, 1), taken from body to world.
    """
    sin_yaw, cos_yaw = np.sin(yaw_rad / 2), np.cos(yaw_rad / 2)
    sin_pitch, cos_pitch = np.sin(pitch_rad / 2), np.cos(pitch_rad / 2)
    sin_roll, cos_roll = np.sin(roll_rad / 2), np.cos(roll_rad / 2)
    return np.stack(
        [
            cos_yaw * cos_pitch * sin_roll - sin_yaw * sin_pitch * cos_roll,
            cos_yaw * sin_pitch * cos_roll + sin_yaw * cos_pitch * sin_roll,
            sin_yaw * cos_pitch * cos_roll - cos_yaw * sin_pitch * sin_roll,
            cos_yaw * cos_pitch * cos_roll + sin_yaw * sin_pitch * sin_roll,
        ],
        axis=-1,
    )


def matrices_from_quaternions(orientations_xyzw: Floats) -> Floats:
    """Rotation matrices (n, 3, 3) of unit quaternions (n, 4).

    Source: J. Diebel, Representing Attitude (2006), unit quaternion to rotation matrix, here from body to world.
    """
    x, y, z, w = np.moveaxis(orientations_xyzw, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def multiply_quaternions(left_xyzw: Floats, right_xyzw: Floats) -> Floats:
    """Hamilton product (n, 4): ``R(left * right) = R(left) R(right)``."""
    left_vector, left_w = left_xyzw[..., :3], left_xyzw[..., 3:]
    right_vector, right_w = right_xyzw[..., :3], right_xyzw[..., 3:]
    vector = left_w * right_vector + right_w * left_vector + np.cross(left_vector, right_vector)
    scalar = left_w * right_w - np.sum(left_vector * right_vector, axis=-1, keepdims=True)
    return np.concatenate([vector, scalar], axis=-1)


def quaternions_from_rotation_vectors(rotation_vectors_rad: Floats) -> Floats:
    """Exponential map (n, 3) -> (n, 4): axis times angle, rad, to unit quaternion, exact down to zero angle.

    Source: J. Sola, Quaternion Kinematics for the Error-State Kalman Filter (2017), the exponential map.
    """
    angle_rad = np.linalg.norm(rotation_vectors_rad, axis=-1, keepdims=True)
    # sin(angle / 2) / angle, written with numpy's sinc(x) = sin(pi x) / (pi x), whose limit at zero is exact.
    factor = 0.5 * np.sinc(angle_rad / (2 * np.pi))
    return np.concatenate([factor * rotation_vectors_rad, np.cos(angle_rad / 2)], axis=-1)


def normalise_quaternions(orientations_xyzw: Floats) -> Floats:
    """Scale quaternions (n, 4) to unit length, to rounding."""
    norms: Floats = np.linalg.norm(orientations_xyzw, axis=-1, keepdims=True)
    return orientations_xyzw / norms


def body_rates_from_zyx(pitch_rad: Floats, roll_rad: Floats, zyx_rates_rad_s: Floats) -> Floats:
    """Angular velocity in the body frame (n, 3), rad/s, from angles (n,), rad, and rates (n, 3) of yaw, pitch and roll.

    Source: J. Diebel, Representing Attitude (2006), Euler angle rates of the sequence (3, 2, 1) to body rates.
    """
    yaw_rate, pitch_rate, roll_rate = np.moveaxis(zyx_rates_rad_s, -1, 0)
    sin_roll, cos_roll = np.sin(roll_rad), np.cos(roll_rad)
    forward_yaw_rate = yaw_rate * np.cos(pitch_rad)
    return np.stack(
        [
            roll_rate - yaw_rate * np.sin(pitch_rad),
            pitch_rate * cos_roll + forward_yaw_rate * sin_roll,
            forward_yaw_rate * cos_roll - pitch_rate * sin_roll,
        ],
        axis=-1,
    )

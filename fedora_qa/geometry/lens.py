"""Distortion of lenses: slopes of rays to slopes on the image plane, and back.

A ray has the slopes ``(x, y) = (X / Z, Y / Z)`` in the optical frame (Z forward, X right, Y down). The lens images it
at the slopes ``(x_d, y_d)``, and K at the pixel ``K (x_d, y_d, 1)``. With r^2 = x^2 + y^2 and theta = atan r:

- ``radtan``: ``x_d = x g + 2 p1 x y + p2 (r^2 + 2 x^2)``, ``y_d = y g + p1 (r^2 + 2 y^2) + 2 p2 x y`` with the gain
  ``g = 1 + k1 r^2 + k2 r^4 + k3 r^6`` (D. C. Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32
  (1966) 444; coefficients k1, k2, p1, p2, k3 as in OpenCV's ``projectPoints``);
- ``equidistant``: ``(x_d, y_d) = (x, y) theta_d / r`` with ``theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6
  + k4 theta^8)`` (J. Kannala, S. S. Brandt, IEEE Trans. PAMI 28 (2006) 1335, eq. 6; OpenCV's ``fisheye``).

Both are one-to-one up to the radius where ``d r_d / d r`` first is zero, and only there are they a model of a lens.
Rays beyond it are not imaged: functions of arrays return NaN for them.
"""

import functools
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.sequence.declared import Lens

Float64 = NDArray[np.float64]

PINHOLE, RADTAN, EQUIDISTANT = 0, 1, 2
"""Codes of models in compiled loops."""

_CODES: Final = {"radtan": RADTAN, "equidistant": EQUIDISTANT}

TOLERANCE: Final = 1e-13
"""Largest difference of the slopes of an inverted ray from the given ones: 1e-10 px at a focal length of 1000 px."""

_BISECTIONS: Final = 12
"""Halvings of the radius: each gives a bit, and Newton's method doubles their number with each step."""

_NEWTON_STEPS: Final = 40
"""Most steps of Newton's method: three far from the largest radius of a lens, more where its derivative vanishes."""


class CompiledLens(NamedTuple):
    """A lens for compiled loops.

    Attributes
    ----------
    model
        Code of the model; ``PINHOLE`` where there is no distortion.
    coefficients
        (5,) in OpenCV's order, those that the model has not are 0.
    largest_radius
        Radius r of the ray up to which the model is one-to-one; infinite where it is so everywhere.
    """

    model: int
    coefficients: Float64
    largest_radius: float


@functools.lru_cache(maxsize=32)
def compiled(lens: Lens | None) -> CompiledLens:
    """Return a lens for compiled loops; None is a pinhole.

    The last results are kept: the domain of a lens is found by roots of a polynomial, and each fit of flow needs it.
    """
    if lens is None:
        return CompiledLens(PINHOLE, np.zeros(5), np.inf)
    coefficients = np.zeros(5)
    coefficients[: len(lens.coefficients)] = lens.coefficients
    return CompiledLens(_CODES[lens.model], coefficients, largest_radius(lens))


def largest_radius(lens: Lens) -> float:
    """Return the slope of the rays up to which a lens is one-to-one; infinite where it is so everywhere.

    Tangential terms, which are small where a lens is usable, do not count.
    """
    k = lens.coefficients
    radial = (k[0], k[1], *k[4:5]) if lens.model == "radtan" else k
    # d r_d / d r = 1 + 3 k1 q + 5 k2 q^2 + ... with q = r^2, or theta^2 for the equidistant model.
    slope = [1.0, *((2 * i + 3) * each for i, each in enumerate(radial))]
    roots = np.polynomial.polynomial.polyroots(np.trim_zeros(slope, "b"))
    real = roots.real[(np.abs(roots.imag) <= 1e-12 * np.abs(roots)) & (roots.real > 0)]
    limit = float(np.sqrt(real.min())) if len(real) else np.inf
    if lens.model == "radtan":
        return limit
    return float(np.tan(limit)) if limit < np.pi / 2 else np.inf


def distorted(lens: Lens | None, x: NDArray[Any], y: NDArray[Any]) -> tuple[Float64, Float64]:
    """Return the slopes on the image plane of rays.

    Parameters
    ----------
    lens
        None is a pinhole, which returns its arguments.
    x, y
        Slopes X / Z and Y / Z of rays, arrays that broadcast against each other.

    Returns
    -------
    x_d, y_d
        Of their common shape; NaN where the lens does not image the ray.
    """
    if lens is None:
        return x, y
    return _over(_distorted_points, lens, x, y)


def undistorted(lens: Lens | None, x_d: NDArray[Any], y_d: NDArray[Any]) -> tuple[Float64, Float64]:
    """Return the slopes of the rays that a lens images at slopes on the image plane, to ``TOLERANCE``.

    Parameters
    ----------
    lens
        None is a pinhole, which returns its arguments.
    x_d, y_d
        Slopes on the image plane, arrays that broadcast against each other.

    Returns
    -------
    x, y
        Of their common shape; NaN where no ray is imaged.
    """
    if lens is None:
        return x_d, y_d
    return _over(_undistorted_points, lens, x_d, y_d)


def distortion_slopes(lens: Lens | None, x: NDArray[Any], y: NDArray[Any]) -> Float64:
    """Return the derivatives (..., 2, 2) of the slopes on the image plane (x_d, y_d) by those of rays (x, y)."""
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    slopes = np.empty((x.size, 4))
    _slopes_of_points(compiled(lens), np.ravel(x), np.ravel(y), slopes)
    return slopes.reshape(*x.shape, 2, 2)


def rays_of_pixels(K: Float64, lens: Lens | None, columns: NDArray[Any], rows: NDArray[Any]) -> tuple[Float64, Float64]:
    """Return the slopes X / Z and Y / Z of the rays of pixels.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    lens
        Of the camera; None for a pinhole.
    columns, rows
        Positions in the image, px, arrays that broadcast against each other.

    Returns
    -------
    x, y
        NaN where no ray is imaged.
    """
    # The ray K^-1 (column, row, 1), K with skew K01, before the lens.
    y = (rows - K[1, 2]) / K[1, 1]
    x = (columns - K[0, 2] - K[0, 1] * y) / K[0, 0]
    return undistorted(lens, x, y)


def pixels_of_rays(K: Float64, lens: Lens | None, x: NDArray[Any], y: NDArray[Any]) -> tuple[Float64, Float64]:
    """Return columns and rows, px, of rays of the slopes x and y; NaN where the lens does not image the ray."""
    x_d, y_d = distorted(lens, x, y)
    return K[0, 0] * x_d + K[0, 1] * y_d + K[0, 2], K[1, 1] * y_d + K[1, 2]


def border_pixels(width: int, height: int) -> tuple[Float64, Float64]:
    """Return columns and rows (n,), px, of the pixels on the border of an image.

    A lens maps the inside of an image to the inside of its border's rays: what is linear in the rays is extreme there.
    """
    across, down = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)
    columns = (across, across, np.zeros(height), np.full(height, width - 1.0))
    rows = (np.zeros(width), np.full(width, height - 1.0), down, down)
    return np.concatenate(columns), np.concatenate(rows)


def _over(loop: Any, lens: Lens, x: NDArray[Any], y: NDArray[Any]) -> tuple[Float64, Float64]:
    """Return both results of a compiled loop over points."""
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    results = np.empty((2, x.size))
    loop(compiled(lens), np.ravel(x), np.ravel(y), results)
    return results[0].reshape(x.shape), results[1].reshape(x.shape)


@njit(cache=True, error_model="numpy")
def distort(lens: CompiledLens, x: float, y: float) -> tuple[float, float]:
    """Return the slopes on the image plane of one ray, also beyond the domain of the lens.

    Parameters
    ----------
    lens
        Model and coefficients.
    x, y
        Slopes of the ray.
    """
    a, b, c, d, e = (
        lens.coefficients[0], lens.coefficients[1], lens.coefficients[2], lens.coefficients[3], lens.coefficients[4],
    )  # fmt: skip
    square = x * x + y * y
    if lens.model == RADTAN:
        gain = 1.0 + square * (a + square * (b + square * e))
        return (
            x * gain + 2.0 * c * x * y + d * (square + 2.0 * x * x),
            y * gain + c * (square + 2.0 * y * y) + 2.0 * d * x * y,
        )
    if lens.model == EQUIDISTANT:
        radius = np.sqrt(square)
        theta = np.arctan(radius)
        gain = _theta_d(a, b, c, d, theta) / radius if radius > 0.0 else 1.0
        return x * gain, y * gain
    return x, y


@njit(cache=True, error_model="numpy")
def imaged_at(K: Float64, lens: CompiledLens, X: float, Y: float, Z: float) -> tuple[float, float]:
    """Return the column and row, px, at which a point is imaged; NaN behind the camera and where the lens images none.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    lens
        Of the camera.
    X, Y, Z
        Of the point in the camera frame, m.
    """
    x, y = X / Z, Y / Z
    if not Z > 0.0 or not np.sqrt(x * x + y * y) <= lens.largest_radius:
        return np.nan, np.nan
    x_d, y_d = distort(lens, x, y)
    return K[0, 0] * x_d + K[0, 1] * y_d + K[0, 2], K[1, 1] * y_d + K[1, 2]


@njit(cache=True, error_model="numpy")
def distort_slopes(lens: CompiledLens, x: float, y: float) -> tuple[float, float, float, float]:
    """Return d x_d / d x, d x_d / d y, d y_d / d x and d y_d / d y of one ray.

    Parameters
    ----------
    lens
        Model and coefficients.
    x, y
        Slopes of the ray.
    """
    a, b, c, d, e = (
        lens.coefficients[0], lens.coefficients[1], lens.coefficients[2], lens.coefficients[3], lens.coefficients[4],
    )  # fmt: skip
    square = x * x + y * y
    if lens.model == RADTAN:
        gain = 1.0 + square * (a + square * (b + square * e))
        by_square = a + square * (2.0 * b + square * 3.0 * e)  # d gain / d r^2
        mixed = 2.0 * x * y * by_square + 2.0 * c * x + 2.0 * d * y
        return (
            gain + 2.0 * x * x * by_square + 2.0 * c * y + 6.0 * d * x,
            mixed,
            mixed,
            gain + 2.0 * y * y * by_square + 6.0 * c * y + 2.0 * d * x,
        )
    if lens.model == EQUIDISTANT:
        radius = np.sqrt(square)
        if radius == 0.0:
            return 1.0, 0.0, 0.0, 1.0
        theta = np.arctan(radius)
        q = theta * theta
        gain = _theta_d(a, b, c, d, theta) / radius
        # d theta_d / d r = (1 + 3 k1 theta^2 + ...) / (1 + r^2): along the ray; across it the gain itself.
        along = (1.0 + q * (3.0 * a + q * (5.0 * b + q * (7.0 * c + q * 9.0 * d)))) / (1.0 + square)
        cos, sin = x / radius, y / radius
        mixed = (along - gain) * cos * sin
        return along * cos * cos + gain * sin * sin, mixed, mixed, along * sin * sin + gain * cos * cos
    return 1.0, 0.0, 0.0, 1.0


@njit(cache=True, error_model="numpy")
def _theta_d(a: float, b: float, c: float, d: float, theta: float) -> float:
    q = theta * theta
    return theta * (1.0 + q * (a + q * (b + q * (c + q * d))))


@njit(cache=True, error_model="numpy")
def _radius_d(lens: CompiledLens, radius: float) -> float:
    """Return the radius on the image plane of a ray's radius, without tangential terms."""
    k = lens.coefficients
    if lens.model == RADTAN:
        square = radius * radius
        return float(radius * (1.0 + square * (k[0] + square * (k[1] + square * k[4]))))
    return float(_theta_d(k[0], k[1], k[2], k[3], np.arctan(radius)))


@njit(cache=True, error_model="numpy")
def undistort(lens: CompiledLens, x_d: float, y_d: float) -> tuple[float, float]:
    """Return the slopes of the ray that is imaged at slopes on the image plane; NaN where there is none.

    The radius is bisected in the domain of the lens, where it increases; Newton's method then adds the tangential
    terms.

    Parameters
    ----------
    lens
        Model, coefficients and domain.
    x_d, y_d
        Slopes on the image plane.
    """
    radius_d = np.sqrt(x_d * x_d + y_d * y_d)
    if lens.model == PINHOLE or radius_d == 0.0:
        return x_d, y_d
    if not radius_d < np.inf:
        return np.nan, np.nan
    below, above = 0.0, min(2.0 * radius_d, lens.largest_radius)
    while _radius_d(lens, above) < radius_d:
        if above >= min(lens.largest_radius, 1e6):
            # Tangential terms may still reach a little beyond the largest radius: Newton's method decides.
            break
        above = min(2.0 * above, lens.largest_radius)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (below + above)
        if _radius_d(lens, middle) < radius_d:
            below = middle
        else:
            above = middle
    x, y = x_d * (below / radius_d), y_d * (below / radius_d)
    for _ in range(_NEWTON_STEPS):
        to_x, to_y = distort(lens, x, y)
        off_x, off_y = x_d - to_x, y_d - to_y
        if max(abs(off_x), abs(off_y)) <= TOLERANCE * max(1.0, radius_d):
            return (x, y) if np.sqrt(x * x + y * y) <= lens.largest_radius else (np.nan, np.nan)
        xx, xy, yx, yy = distort_slopes(lens, x, y)
        determinant = xx * yy - xy * yx
        # Newton: (x, y) += J^-1 off.
        x += (yy * off_x - xy * off_y) / determinant
        y += (xx * off_y - yx * off_x) / determinant
    return np.nan, np.nan


@njit(cache=True, error_model="numpy")
def _distorted_points(lens: CompiledLens, x: Float64, y: Float64, results: Float64) -> None:
    for i in range(len(x)):
        results[0, i], results[1, i] = distort(lens, x[i], y[i])
        if not np.sqrt(x[i] * x[i] + y[i] * y[i]) <= lens.largest_radius:
            results[0, i], results[1, i] = np.nan, np.nan


@njit(cache=True, error_model="numpy")
def _undistorted_points(lens: CompiledLens, x: Float64, y: Float64, results: Float64) -> None:
    for i in range(len(x)):
        results[0, i], results[1, i] = undistort(lens, x[i], y[i])


@njit(cache=True, error_model="numpy")
def _slopes_of_points(lens: CompiledLens, x: Float64, y: Float64, slopes: Float64) -> None:
    for i in range(len(x)):
        slopes[i, 0], slopes[i, 1], slopes[i, 2], slopes[i, 3] = distort_slopes(lens, x[i], y[i])

"""Cameras: intrinsics, distorted lens, mounting on the body, and pose in the world."""

import math
from dataclasses import dataclass
from functools import cache
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight
from fedora_qa.conventions import EVENT_TO_RGB_WIDTH, HORIZONTAL_FIELD_OF_VIEW_DEG, R_BODY_OPTICAL, US_PER_S

Floats = NDArray[np.float64]

DistortionModel = Literal["none", "radtan", "equidistant"]

COEFFICIENTS: Final = {"none": (0,), "radtan": (4, 5), "equidistant": (4,)}
"""Numbers of coefficients: k1, k2, p1, p2 and perhaps k3; or k1 to k4."""

_STEPS: Final = 50
_CONVERGED: Final = 1e-14
"""Slope; 1e-11 px."""


@dataclass(frozen=True, slots=True)
class Lens:
    """A lens that images a ray of slopes (X/Z, Y/Z), optical frame, at other slopes; in front of them stands K."""

    model: DistortionModel
    coefficients: tuple[float, ...]

    def imaged(self, slopes: Floats) -> Floats:
        """Slopes (..., 2) on the image plane of rays (..., 2)."""
        x, y = np.moveaxis(slopes, -1, 0)
        gain, _ = self._gain(x * x + y * y)
        if self.model == "equidistant":
            return np.asarray(slopes * gain[..., None])
        p1, p2 = self.coefficients[2:4]
        square = x * x + y * y
        # Brown's decentering: (2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y)
        bent = np.stack(
            [2 * p1 * x * y + p2 * (square + 2 * x * x), p1 * (square + 2 * y * y) + 2 * p2 * x * y], axis=-1
        )
        return np.asarray(slopes * gain[..., None] + bent)

    def derivatives(self, slopes: Floats) -> Floats:
        """Return the derivatives (..., 2, 2) of ``imaged``: rows are the image's slopes, columns the ray's."""
        x, y = np.moveaxis(slopes, -1, 0)
        gain, by_square = self._gain(x * x + y * y)
        # d (s g(|s|^2)) / d s = g 1 + 2 g' s s^T
        outer = slopes[..., :, None] * slopes[..., None, :]
        total = gain[..., None, None] * np.eye(2) + 2 * by_square[..., None, None] * outer
        if self.model == "radtan":
            p1, p2 = self.coefficients[2:4]
            mixed = 2 * p1 * x + 2 * p2 * y
            total += np.stack([2 * p1 * y + 6 * p2 * x, mixed, mixed, 6 * p1 * y + 2 * p2 * x], axis=-1).reshape(
                total.shape
            )
        return np.asarray(total)

    def rays_of(self, imaged: Floats) -> Floats:
        """Slopes (..., 2) of the rays that are imaged at slopes (..., 2), by Newton's method from the axis outwards.

        Raises
        ------
        SceneError
            No ray is imaged at one of them: the distortion folds over before.
        """
        # The image is filled from its centre in steps, so that each start is near and on the right side of a fold.
        rays = np.zeros_like(imaged)
        for share in np.linspace(0.1, 1.0, 10):
            for _ in range(_STEPS):
                off = share * imaged - self.imaged(rays)
                step = np.linalg.solve(self.derivatives(rays), off[..., None])[..., 0]
                rays = rays + step
                if np.abs(off).max() < _CONVERGED:
                    break
        # Beyond a fold the derivative, which is symmetric, has a negative eigenvalue, or two.
        folded = np.linalg.eigvalsh(self.derivatives(rays))[..., 0] <= 0
        if folded.any() or not np.abs(self.imaged(rays) - imaged).max() < 1e3 * _CONVERGED:
            raise SceneError(
                f"Expected a distortion that is one-to-one over the image, got {self.model} {list(self.coefficients)}; "
                "use smaller coefficients"
            )
        return rays

    def _gain(self, square: Floats) -> tuple[Floats, Floats]:
        """Radial gain of rays by their squared slope r^2, and its derivative by r^2."""
        if self.model == "radtan":
            k1, k2, k3 = (*self.coefficients[:2], *self.coefficients[4:], 0.0)[:3]
            return 1 + k1 * square + k2 * square**2 + k3 * square**3, k1 + 2 * k2 * square + 3 * k3 * square**2
        # theta_d(atan r) / r; on the axis 1 + (k1 - 1/3) r^2, by the series of the arc tangent.
        k1, k2, k3, k4 = self.coefficients
        radius = np.sqrt(np.maximum(square, 1e-12))
        theta = np.arctan(radius)
        angle_d = theta + k1 * theta**3 + k2 * theta**5 + k3 * theta**7 + k4 * theta**9
        slope = (1 + 3 * k1 * theta**2 + 5 * k2 * theta**4 + 7 * k3 * theta**6 + 9 * k4 * theta**8) / (1 + radius**2)
        near = square < 1e-8
        gain = np.where(near, 1 + (k1 - 1 / 3) * square, angle_d / radius)
        return gain, np.where(near, k1 - 1 / 3, (slope - angle_d / radius) / (2 * radius**2))


@cache
def pixel_maps(lens: Lens, width: int, height: int, intrinsics: tuple[float, float, float, float]) -> Floats:
    """Where the pixels of a distorted camera lie in the image of a pinhole of the same K, to first order about each.

    Parameters
    ----------
    width, height
        Of its image, px.
    intrinsics
        fx, fy, cx, cy, px.

    Returns
    -------
    maps
        (height, width, 3, 3): at a pixel's own centre exactly, around it by the derivative, ``map @ (column, row, 1)``
        is the place (column, row, 1) in the pinhole's image. A line of that image, times the map, is the same line in
        the distorted one.
    """
    fx, fy, cx, cy = intrinsics
    focal_px, centre_px = np.array([fx, fy]), np.array([cx, cy])
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float64)
    slopes = lens.rays_of((pixels - centre_px) / focal_px)
    maps = np.zeros((height, width, 3, 3))
    # d place / d pixel = F (d imaged / d ray)^-1 F^-1 with F = diag(fx, fy).
    maps[..., :2, :2] = focal_px[:, None] * np.linalg.inv(lens.derivatives(slopes)) / focal_px
    places = slopes * focal_px + centre_px
    maps[..., :2, 2] = places - np.einsum("hwij,hwj->hwi", maps[..., :2, :2], pixels)
    maps[..., 2, 2] = 1.0
    maps.flags.writeable = False
    return maps


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraOptions:
    """The colour and depth camera; the event camera shares its centre and field of view, at 640/1440 of its size.

    ``position_body_m`` is the optical centre in the body frame; ``pitch_deg`` tilts the view down when positive.
    ``distortion`` are the coefficients of ``distortion_model``, in OpenCV's order, of the lens of all three.
    """

    width: int = 1440
    height: int = 1080
    position_body_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pitch_deg: float = 0.0
    distortion_model: DistortionModel = "none"
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        counts = COEFFICIENTS[self.distortion_model]
        if len(self.distortion) not in counts:
            raise ValueError(
                f"Expected {' or '.join(map(str, counts))} numbers in distortion with the model "
                f"{self.distortion_model!r}, got {len(self.distortion)}"
            )
        if min(self.width, self.height) < 1:
            raise ValueError(f"Expected a camera of at least 1x1 pixels, got {self.width}x{self.height}")


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera; integer pixel coordinates are pixel centres."""

    width: int
    height: int
    K: Floats
    """(3, 3) intrinsics, px"""
    T_body_camera: Floats
    """(4, 4), ``p_body = T_body_camera p_optical``"""
    lens: Lens | None = None
    """None for a pinhole"""

    @property
    def pixel_maps(self) -> Floats:
        """Where the pixels of a distorted camera lie in the image of a pinhole: (height, width, 3, 3), read-only."""
        if self.lens is None:
            raise ValueError("Expected a distorted camera, got a pinhole; its pixels are their own places")
        intrinsics = (float(self.K[0, 0]), float(self.K[1, 1]), float(self.K[0, 2]), float(self.K[1, 2]))
        return pixel_maps(self.lens, self.width, self.height, intrinsics)

    def pose_at(self, flight: Flight, time_us: int) -> Floats:
        """``T_world_camera`` (4, 4) at one instant."""
        pose: Floats = self.poses_at(flight, np.array([time_us]))[0]
        return pose

    def poses_at(self, flight: Flight, times_us: NDArray[np.int64]) -> Floats:
        """``T_world_camera`` (n, 4, 4) at int64 microseconds of the flight's clock, free of noise."""
        return self.poses_between(flight, times_us / US_PER_S)

    def poses_between(self, flight: Flight, times_s: Floats) -> Floats:
        """``T_world_camera`` (n, 4, 4) at any seconds of the flight's clock, free of noise."""
        states = flight.states_at(times_s)
        T_world_body = np.tile(np.eye(4), (len(times_s), 1, 1))
        T_world_body[:, :3, :3] = states.R_world_body
        T_world_body[:, :3, 3] = states.positions_world_m
        return T_world_body @ self.T_body_camera


def colour_camera(options: CameraOptions) -> Camera:
    """Camera of the RGB and depth frames."""
    return _camera(options.width, options.height, options)


def event_camera(options: CameraOptions) -> Camera:
    """Camera of the events: 640/1440 of the colour camera's size, rounded to whole pixels."""
    width, height = (round(EVENT_TO_RGB_WIDTH * size) for size in (options.width, options.height))
    if min(width, height) < 1:
        raise SceneError(
            f"Expected a size that leaves the event camera a pixel, got {options.width}x{options.height}; "
            "use at least 2x2"
        )
    return _camera(width, height, options)


def _camera(width: int, height: int, options: CameraOptions) -> Camera:
    focal_px = width / (2 * math.tan(math.radians(HORIZONTAL_FIELD_OF_VIEW_DEG / 2)))
    K = np.array([[focal_px, 0.0, (width - 1) / 2], [0.0, focal_px, (height - 1) / 2], [0.0, 0.0, 1.0]])
    cos, sin = math.cos(math.radians(options.pitch_deg)), math.sin(math.radians(options.pitch_deg))
    R_pitch = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])  # about body Y (left): nose down
    T_body_camera = np.eye(4)
    T_body_camera[:3, :3] = R_pitch @ np.array(R_BODY_OPTICAL)
    T_body_camera[:3, 3] = options.position_body_m
    lens = Lens(options.distortion_model, options.distortion) if options.distortion_model != "none" else None
    return Camera(width, height, K, T_body_camera, lens)

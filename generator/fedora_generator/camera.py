"""Cameras: intrinsics, lens, mounting on the body, and pose in the world."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight
from fedora_generator.lens import COEFFICIENTS, DistortionModel, Lens, pixel_maps
from fedora_qa.conventions import EVENT_TO_RGB_WIDTH, HORIZONTAL_FIELD_OF_VIEW_DEG, R_BODY_OPTICAL, US_PER_S

Floats = NDArray[np.float64]


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

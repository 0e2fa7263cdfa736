"""What a file declares about itself, as typed values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

Float64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole camera: integer pixel coordinates are pixel centres.

    Attributes
    ----------
    K
        (3, 3) intrinsics, px.
    T_body_camera
        (4, 4), ``p_body = T_body_camera p_optical``, metres.
    """

    width: int
    height: int
    K: Float64
    T_body_camera: Float64
    exposure_us: float = 0.0
    model: str = "pinhole"


@dataclass(frozen=True, slots=True)
class EventModel:
    """The declared event sensor. Thresholds in nat (``log``) or DN (``linear``)."""

    model: Literal["log", "linear"]
    threshold_on: float
    threshold_off: float
    log_eps_dn: float = 0.0
    packet_interval_us: int = 0
    threshold_sigma: float = 0.0
    leak_rate_hz: float = 0.0
    shot_rate_hz: float = 0.0
    bandwidth_hz: float = 0.0
    refractory_us: float = 0.0
    hot_pixels: tuple[tuple[int, int], ...] = ()
    hot_pixel_rate_hz: float = 0.0
    initial_phase: str = "uniform"
    """``zero``: the first reference is the signal at the first frame."""


@dataclass(frozen=True, slots=True)
class ImuModel:
    """The declared IMU: noise densities, bias walks, gravity, and how samples are taken."""

    gyro_noise_density: float = 0.0
    accel_noise_density: float = 0.0
    gyro_bias_walk: float = 0.0
    accel_bias_walk: float = 0.0
    gravity: float = STANDARD_GRAVITY_M_S2
    sampling: Literal["instant", "interval_mean"] = "instant"


@dataclass(frozen=True, slots=True)
class PoseModel:
    """The declared pose noise: metres per axis (world), radians per axis (body)."""

    position_sigma_m: float = 0.0
    rotation_sigma_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class DeclarationProblem:
    """Something in the metadata that cannot be used as it stands."""

    owner: str
    name: str
    message: str
    cause: str


@dataclass(frozen=True, slots=True)
class Declared:
    """All declarations that could be read; what is absent or unusable is None or missing, and named in ``problems``."""

    cameras: Mapping[str, Camera] = field(default_factory=dict)
    events: EventModel | None = None
    imu: ImuModel | None = None
    pose: PoseModel | None = None
    flow_model: Literal["rigid", "scene"] | None = None
    depth_range_m: tuple[float, float] | None = None
    transfer: Literal["linear", "srgb", "gamma2.2"] = "linear"
    profile: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    """The ``units`` label of each dataset that has one, by canonical key."""
    problems: tuple[DeclarationProblem, ...] = ()

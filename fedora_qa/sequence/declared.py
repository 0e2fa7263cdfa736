"""Declarations of a file, as typed values."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

Float64 = NDArray[np.float64]

_ATTRIBUTE_NAMES: Final = {
    "position_sigma_m": "position_sigma",
    "rotation_sigma_rad": "rotation_sigma",
    "model": "camera_model",
}
"""Attributes whose names differ from those of the fields; ``model`` only of cameras."""


@dataclass(frozen=True, slots=True)
class Lens:
    """The declared distortion of a camera; ``geometry/lens.py`` has its equations.

    Attributes
    ----------
    model
        ``radtan`` (radial-tangential) or ``equidistant``.
    coefficients
        In OpenCV's order: k1, k2, p1, p2 and perhaps k3 (``radtan``), or k1, k2, k3, k4 (``equidistant``).
    """

    model: Literal["radtan", "equidistant"]
    coefficients: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera: integer pixel coordinates are pixel centres.

    Attributes
    ----------
    width, height
        Of the images, px.
    K
        (3, 3) intrinsics, px.
    T_body_camera
        (4, 4), ``p_body = T_body_camera p_optical``, m; optical frame Z forward, X right, Y down.
    exposure_us
        Exposure time, us.
    model
        Camera model as declared; checks project with ``pinhole`` alone, through its lens.
    lens
        Distortion; None where there is none.
    """

    width: int
    height: int
    K: Float64
    T_body_camera: Float64
    exposure_us: float = 0.0
    model: str = "pinhole"
    lens: Lens | None = None


@dataclass(frozen=True, slots=True)
class EventModel:
    """The declared event sensor.

    Attributes
    ----------
    model
        Response model.
    threshold_on, threshold_off
        Contrast thresholds of brighter and of darker events, nat (``log``) or DN (``linear``).
    log_eps_dn
        Added to luma before the logarithm, DN.
    linear_below_dn
        T of the lin-log response: below, L is linear in luma. DN; 0 for none, as any value that is not above 1.
    packet_interval_us
        Interval of packets, us; 0 for none.
    threshold_sigma
        Standard deviation of the thresholds over the pixels, in their unit.
    leak_rate_hz, shot_rate_hz
        Rates of leak events and of shot noise events of a pixel, Hz.
    bandwidth_hz
        Cut-off of the low-pass of a pixel, Hz; 0 for none.
    refractory_us
        Refractory period of a pixel, us.
    hot_pixels, hot_pixel_rate_hz
        (column, row) of hot pixels, and their rate, Hz.
    initial_phase
        ``zero``: the first reference is the signal at the first frame.
    """

    model: Literal["log", "linear"]
    threshold_on: float
    threshold_off: float
    log_eps_dn: float = 0.0
    linear_below_dn: float = 0.0
    packet_interval_us: int = 0
    threshold_sigma: float = 0.0
    leak_rate_hz: float = 0.0
    shot_rate_hz: float = 0.0
    bandwidth_hz: float = 0.0
    refractory_us: float = 0.0
    hot_pixels: tuple[tuple[int, int], ...] = ()
    hot_pixel_rate_hz: float = 0.0
    initial_phase: str = "uniform"

    @property
    def is_lin_log(self) -> bool:
        """Whether the response is linear in the dark, and logarithmic in light."""
        return self.model == "log" and self.linear_below_dn > 1.0


@dataclass(frozen=True, slots=True)
class ImuModel:
    """The declared IMU.

    Attributes
    ----------
    gyro_noise_density, accel_noise_density
        Noise densities, rad/s/sqrt(Hz) and m/s^2/sqrt(Hz).
    gyro_bias_walk, accel_bias_walk
        Random walks of the biases, rad/s^2/sqrt(Hz) and m/s^3/sqrt(Hz).
    gravity
        Magnitude of gravity, m/s^2.
    sampling
        Whether a sample is the value at its timestamp, or the mean over the interval before it.
    """

    gyro_noise_density: float = 0.0
    accel_noise_density: float = 0.0
    gyro_bias_walk: float = 0.0
    accel_bias_walk: float = 0.0
    gravity: float = STANDARD_GRAVITY_M_S2
    sampling: Literal["instant", "interval_mean"] = "instant"


@dataclass(frozen=True, slots=True)
class PoseModel:
    """The declared pose noise.

    Attributes
    ----------
    position_sigma_m
        Standard deviation of each coordinate in the world, m.
    rotation_sigma_rad
        Standard deviation of a rotation about each axis of the body, rad.
    """

    position_sigma_m: float = 0.0
    rotation_sigma_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class StereoPair:
    """What the matrix by which disparity is read as depth states of its two cameras.

    Attributes
    ----------
    focal_px
        Focal length of both, px.
    baseline_m
        Distance between their centres, m.
    declared_baseline_m
        The same by the mounting of the second camera, m; None where nobody declares it.
    focal_rounding_px, baseline_rounding_m, declared_rounding_m
        By how much each may differ from what was meant, by the decimal places in which it is stored.
    """

    focal_px: float
    baseline_m: float
    declared_baseline_m: float | None = None
    focal_rounding_px: float = 0.0
    baseline_rounding_m: float = 0.0
    declared_rounding_m: float = 0.0


@dataclass(frozen=True, slots=True)
class DeclarationProblem:
    """A part of the metadata that cannot be used as stored.

    Attributes
    ----------
    owner
        Path of the object of the metadata.
    name
        Name of the attribute; empty for the object as a whole.
    message
        A sentence.
    cause
        As in ``fedora_qa.causes``.
    impossible
        Whether it is a number that nothing can have: below zero, NaN, or a range that ends before it begins.
    usable
        Whether its meaning is plain, so that it was read in spite of its form.
    stream
        The stream that the cause concerns: a declaration may contradict the layout of a stream.
    """

    owner: str
    name: str
    message: str
    cause: str
    impossible: bool = False
    usable: bool = False
    stream: str = "metadata"


@dataclass(frozen=True, slots=True)
class Declared:
    """All declarations that could be read; others are None or missing, and named in ``problems``.

    Attributes
    ----------
    cameras
        By name: ``rgb``, ``depth``, ``events``.
    events
        The event sensor.
    imu, pose
        The IMU, and the noise of the poses.
    imu_lever_body_m
        (3,) where the IMU sits in the body, m.
    has_vertical
        Whether Z of the world points up.
    flow_model
        ``rigid`` where nothing moves by itself, ``scene`` where objects may.
    depth_range_m
        Nearest and farthest valid depth, m.
    transfer
        Transfer curve of the colour frames.
    rectify_map_px
        (H, W, 2): where the view of the depth camera has each pixel of the event camera, px; None: nobody states it.
    stereo
        The pair of cameras that disparity is between; None where depth is not read from it.
    profile
        The profile that the file keeps.
    sequence, world, illumination
        Names of the sequence, of its world, and of the light.
    kind
        Whether the sequence is recorded by sensors or synthetic; None: not stated.
    units
        The ``units`` label of each dataset that has one, by canonical key.
    problems
        Declarations that are absent or unusable.
    """

    cameras: Mapping[str, Camera] = field(default_factory=dict)
    events: EventModel | None = None
    imu: ImuModel | None = None
    pose: PoseModel | None = None
    imu_lever_body_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    has_vertical: bool = True
    flow_model: Literal["rigid", "scene"] | None = None
    depth_range_m: tuple[float, float] | None = None
    transfer: Literal["linear", "srgb", "gamma2.2"] = "linear"
    rectify_map_px: NDArray[np.float32] | None = None
    stereo: StereoPair | None = None
    profile: str | None = None
    sequence: str = ""
    world: str = ""
    illumination: str = ""
    kind: Literal["recorded", "synthetic"] | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    problems: tuple[DeclarationProblem, ...] = ()


def declared_attributes(declared: Declared) -> dict[tuple[str, str], Any]:
    """Return every declaration by the object of the layout that carries it, and its name; None: nobody makes it."""
    values: dict[tuple[str, str], Any] = {}
    for owner, model in (("events", declared.events), ("imu", declared.imu), ("pose", declared.pose)):
        for each in fields(model) if model is not None else ():
            name = _ATTRIBUTE_NAMES.get(each.name, each.name) if owner == "pose" else each.name
            values[f"metadata/{owner}", name] = getattr(model, each.name)
    for camera_name, camera in declared.cameras.items():
        owner = f"metadata/cameras/{camera_name}"
        for each in fields(camera):
            if each.name != "lens":
                values[owner, _ATTRIBUTE_NAMES.get(each.name, each.name)] = getattr(camera, each.name)
        values[owner, "distortion_model"] = camera.lens.model if camera.lens else None
        values[owner, "distortion"] = camera.lens.coefficients if camera.lens else None
    values["path/rgb", "transfer"] = declared.transfer
    values["metadata/flow", "model"] = declared.flow_model
    for name in ("profile", "sequence", "world", "illumination", "kind"):
        values["", name] = getattr(declared, name)
    return values

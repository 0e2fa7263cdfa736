"""Which faults, sequences and efforts the trade of time against detection is measured with."""

from dataclasses import dataclass
from typing import Final

EFFORTS: Final = ("quick", "standard", "full")
BUDGETS: Final = ("5s", "8s", "12s", "20s")
"""As the option ``--budget`` takes them, of one process, its start among them."""

SAMPLED: Final = {
    "frames": ("rgb",),
    "depth": ("depth",),
    "events": ("events",),
    "flow": ("flow/10hz", "flow/25hz", "flow/50hz"),
}
"""Streams of which an effort sees what lies in its windows."""

TIMES_LIMIT: Final = (1.0, 2.0, 4.0)
"""Sizes of faults, in units of what ``full`` states as the least that it sees in the file."""

Size = tuple[int, int]

SIZE: Final = (180, 136)
LARGER: Final = (540, 405)
"""Pixels of the sequences that faults are planted in, and of one whose cost is measured beside theirs."""

DURATION_S: Final = 20.0
BASES: Final = 4
STEP_S: Final = 8.0
"""Sequences of a scene, and from the start of one to that of the next; flights meet their world after 45 s or so."""


@dataclass(frozen=True, slots=True)
class Traded:
    """A fault, and the measurement whose ``least_detectable`` is its limit.

    Attributes
    ----------
    scene, stream, cause, unit
        Where it is planted, and what.
    check, measurement
        Whose limit it is: the smallest of all measurements of the check whose name ends so.
    """

    scene: str
    stream: str
    cause: str
    unit: str
    check: str
    measurement: str

    @property
    def name(self) -> str:
        """As ``stream:cause``."""
        return f"{self.stream}:{self.cause}"


TRADED: Final = (
    Traded("park-day", "events", "time_offset", "ms", "event_response.timing", "time_offset"),
    Traded("park-day", "events", "clock_rate", "ppm", "event_response.timing", "clock_rate"),
    Traded("park-day", "events", "threshold_misdeclared", "percent", "event_response.threshold", "threshold_on"),
    Traded("park-day", "flow", "flow_gain", "percent", "flow_photometric.residual", " gain"),
    Traded("park-day", "flow", "intrinsics_focal", "percent", "flow_photometric.residual", " focal"),
    Traded("park-day", "flow", "extrinsic_rotation", "deg", "flow_photometric.residual", " mounting_pitch"),
    Traded("park-day", "pose", "teleport", "m", "pose.continuity", "position_jump"),
    Traded("park-noisy", "imu", "time_offset", "ms", "imu.timing", "time_offset"),
    Traded("park-noisy", "imu", "clock_rate", "ppm", "imu.timing", "clock_rate"),
    Traded("park-noisy", "imu", "gyro_bias", "rad/s", "imu.rotation", "bias_x"),
    Traded("park-noisy", "imu", "accel_bias", "m/s^2", "imu.translation", "bias_x"),
    Traded("park-noisy", "pose", "teleport", "m", "pose.continuity", "position_jump"),
)
"""A dozen causes in depth: of a whole stream and of one instant, of events, flow, IMU and pose."""

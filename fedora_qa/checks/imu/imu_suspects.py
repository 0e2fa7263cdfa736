"""Which causes would explain that a parameter of the fit of IMU against pose is off."""

from collections.abc import Callable
from math import hypot, sqrt
from typing import Final

from fedora_qa.checks.protocol import Suspect
from fedora_qa.estimators.fitting.grouped_fit import Fitted, group_of
from fedora_qa.views.inertial_agreement import Kind
from fedora_qa.views.timing_cues import TimingCues

_ENOUGH: Final = 0.5
_MS, _PPM = 1e3, 1e6

_ROUNDED_S: Final = 1e-6 / sqrt(12.0)
"""Files stamp in whole microseconds: all stamps of an even clock are rounded by the same part of one."""


def suspects_for(kind: Kind, name: str, found: Fitted, share: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    """Return the causes behind a parameter that is off: its own, and those of groups that explain the data as well.

    Weights are shares of what can be explained at all that the group explains alone, times the ``share`` that this
    component has in its group's vector: the largest component tells the size of the fault. A group that leaves more
    than this one is less likely. Where either of two streams could be to blame, the ``clues`` decide.
    """
    group = group_of(name)
    own = found.explained.get(group, 0.9)
    own_weight = (0.5 + 0.5 * share) * max(0.5, own)
    own_causes = _CAUSES[kind, group](found.value, found.standard_error, own_weight, timing_cues)
    others = [
        Suspect(suspect.cause, suspect.stream, suspect.weight)
        for other, explained in found.explained.items()
        if other != group and explained > _ENOUGH
        for suspect in _CAUSES[kind, other](0.0, 0.0, 0.9 * explained * _likelihood(explained, own), timing_cues)
    ]
    return (*own_causes, *others)


def _likelihood(explained: float, own: float) -> float:
    """Return how likely a group is, against one that explains the share ``own``, by what both leave; 1 at most.

    With an unknown size of the noise the likelihood of ``n`` samples goes as the squares that are left to the power
    ``-n / 2``. What a model leaves is alike in neighbouring samples: all count as one, the fewest there can be.
    """
    return sqrt(max(1.0 - own, 0.0) / (1.0 - explained)) if explained < own else 1.0


def _time_offset(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    """Blame either: two clocks alone cannot tell which of them is late, nor what of a delay is written in stamps."""
    error = hypot(error, _ROUNDED_S)
    return (
        Suspect("time_offset", "imu", timing_cues.imu_late * weight, _MS * value, "ms", _MS * error),
        Suspect("time_offset", "pose", timing_cues.pose_late * weight, -_MS * value, "ms", _MS * error),
    )


def _clock_rate(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    return (Suspect("clock_rate", "imu", weight, _PPM * value, "ppm", _PPM * error),)


def _pose_clock_rate(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    return (Suspect("clock_rate", "pose", weight, _PPM * value, "ppm", _PPM * error),)


def _gyro_bias(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    return (Suspect("gyro_bias", "imu", weight, value, "rad/s", error),)


def _accel_bias(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    return (Suspect("accel_bias", "imu", weight, value, "m/s^2", error),)


def _turned(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    """Blame another convention, or an exchange of axes, of which a turn is but a part: forces tell it then."""
    return (
        Suspect("frame_convention", "imu", weight),
        Suspect("axes_swapped", "imu", 0.8 * weight),
        Suspect("frame_convention", "pose", 0.8 * weight),
    )


def _gain(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    return (Suspect("unknown", "imu", weight, 100.0 * value, "percent", 100.0 * error),)


def _gravity(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    """Blame the sensor, or the declaration: which of the two values is a usual one tells."""
    sensor, declaration = timing_cues.of_gravity(value, error)
    return (
        Suspect("gravity_magnitude", "imu", sensor * weight, value, "m/s^2", error),
        Suspect("gravity_magnitude", "metadata", 0.95 * declaration * weight, -value, "m/s^2", error),
    )


def _slope(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    """Blame a world that is not level, or a sensor: rarer than its bias, which level flight cannot tell from them."""
    return (Suspect("frame_convention", "pose", 0.8 * weight), Suspect("frame_convention", "imu", 0.75 * weight))


def _lever(value: float, error: float, weight: float, timing_cues: TimingCues) -> tuple[Suspect, ...]:
    """Blame the unit for being off the body's origin, or the poses for being off it the other way."""
    return (
        Suspect("lever_arm", "imu", weight, value, "m", error),
        Suspect("lever_arm", "pose", weight, -value, "m", error),
    )


_CAUSES: Final[dict[tuple[Kind, str], Callable[[float, float, float, TimingCues], tuple[Suspect, ...]]]] = {
    ("rotation", "time_offset"): _time_offset,
    ("rotation", "clock_rate"): _clock_rate,
    ("rotation", "pose_clock_rate"): _pose_clock_rate,
    ("rotation", "bias"): _gyro_bias,
    ("rotation", "tilt"): _turned,
    ("rotation", "scale"): _gain,
    ("translation", "time_offset"): _time_offset,
    ("translation", "clock_rate"): _clock_rate,
    ("translation", "pose_clock_rate"): _pose_clock_rate,
    ("translation", "bias"): _accel_bias,
    ("translation", "gravity"): _gravity,
    ("translation", "slope"): _slope,
    ("translation", "lever"): _lever,
}

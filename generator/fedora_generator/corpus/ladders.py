"""How large a planted fault is: ladders around the smallest detectable size, and spread magnitudes.

The nominal sizes are what a second of a small sequence (270x200) can show, as the checks state it of a clean one, to
within a factor of three or so. They order the rungs and set what a manifest expects to be ``observable``; a study of
detection measures the limits themselves. Noise of the pose hides motion by orders of magnitude, so what is held against
the pose has two nominal sizes; where there is no noise, the rounding of timestamps and values sets the limit.

Trials for a study of detection are many magnitudes of a fault, in many different sequences. Magnitudes and starts
follow the golden ratio's multiples modulo 1, the sequence that is most evenly spread for every number of terms: with
more trials or sequences, a corpus keeps those that it has.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_generator.faults.table import USUAL_FACTORS
from fedora_generator.scene import Scene
from fedora_qa.causes import INDEX_MAPS

STEP: Final = 3.0
"""From rung to rung; half a decade, near enough, so that five rungs span two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ladder:
    """Magnitudes of one fault, mildest first.

    Attributes
    ----------
    nominal
        The middle rung; None where the fault has no size.
    unit
        Unit of the magnitudes; empty for the fault's own.
    whole
        Only whole numbers, of at least 1.
    most
        The largest magnitude that makes sense.
    fixed
        A single rung, whatever the number requested.
    smaller_is_worse
        The fault grows as the magnitude falls.
    hidden
        Not detectable: the file stays a legal one, or noise hides all sizes that make sense.
    """

    nominal: float | None = None
    unit: str = ""
    whole: bool = False
    most: float = math.inf
    fixed: bool = False
    smaller_is_worse: bool = False
    hidden: bool = False

    @property
    def has_range(self) -> bool:
        """Whether the fault has more than one size."""
        return self.nominal is not None and not self.fixed

    def at(self, factor: float, digits: int = 3) -> float | None:
        """Return the magnitude of so many times the nominal one, as far as the fault allows; None without a size."""
        if self.nominal is None or self.fixed:
            return self.nominal
        return self._stated(min(self.nominal * factor, self.most), digits)

    def rungs(self, count: int) -> tuple[float | None, ...]:
        """Return ``count`` magnitudes from mild to severe around the nominal one, or fewer where some are the same."""
        if self.nominal is None or self.fixed:
            return (self.nominal,)
        sizes = [self.nominal * STEP ** (rung - (count - 1) // 2) for rung in range(count)]
        distinct = {self._stated(min(size, self.most)) for size in sizes}
        return tuple(sorted(distinct, reverse=self.smaller_is_worse))

    def is_observable(self, magnitude: float | None, share: float = 1.0) -> bool:
        """Whether a good tool should detect a fault of this size, where the sequence has texture and motion.

        The detection limit of a fault in a ``share`` of the pixels or of the time is larger by 1 / sqrt(share), like
        the standard error of a mean over so many fewer samples. A fault without a ladder is detectable in any share.
        """
        if self.hidden:
            return False
        if magnitude is None or self.nominal is None or self.fixed:
            return True
        if self.smaller_is_worse:
            return magnitude <= self.nominal * math.sqrt(share)
        return magnitude >= self.nominal / math.sqrt(share)

    def _stated(self, size: float, digits: int = 3) -> float:
        return float(max(1, round(size))) if self.whole else float(f"{size:.{digits}g}")


def depends_on_pose_noise(cause: str, stream: str) -> bool:
    """Whether noise of the pose moves the nominal size by orders of magnitude."""
    return (cause, stream) in _UNDER_POSE_NOISE


def ladder_of(cause: str, stream: str, *, noisy_pose: bool = False) -> Ladder:
    """Return the ladder of a fault.

    Parameters
    ----------
    noisy_pose
        Whether the pose of the sequence has noise.
    """
    if (cause, stream) in USUAL_FACTORS:
        return Ladder(nominal=USUAL_FACTORS[cause, stream], unit="1", fixed=True)
    if noisy_pose and (cause, stream) in _UNDER_POSE_NOISE:
        return _UNDER_POSE_NOISE[cause, stream]
    return _OF_PAIR.get((cause, stream), _OF_CAUSE.get(cause, _SIZELESS))


_SIZELESS: Final = Ladder()
_COUNT: Final = Ladder(nominal=1, whole=True)

_OF_CAUSE: Final[Mapping[str, Ladder]] = MappingProxyType(
    {
        "time_offset": Ladder(nominal=2.0, unit="ms"),
        "time_jitter": Ladder(nominal=1.0, unit="ms"),
        "clock_rate": Ladder(nominal=20.0, unit="ppm"),
        # 0.7 and its thirds and triples divide no sampling interval: every rung moves timestamps.
        "quantised_time": Ladder(nominal=0.7, unit="ms"),
        "quantised_values": Ladder(nominal=1.0, unit="percent"),
        "dropped_samples": _COUNT,
        "duplicated_samples": _COUNT,
        "unsorted": Ladder(nominal=2, whole=True),
        "frozen_frames": _COUNT,
        "swapped_frames": _COUNT,
        "nan_in_stream": _COUNT,
        "index_off_by_one": _COUNT,
        "spatial_offset": _COUNT,
        "dead_region": Ladder(nominal=5, unit="px", whole=True),
        "hot_pixels": _COUNT,
        "threshold_misdeclared": Ladder(nominal=20.0, unit="percent"),
        "noise_misdeclared": Ladder(nominal=50.0, unit="percent"),
        "gyro_bias": Ladder(nominal=3e-7, unit="rad/s"),
        "accel_bias": Ladder(nominal=5e-5, unit="m/s^2"),
        "gravity_magnitude": Ladder(nominal=5e-5, unit="m/s^2"),
        "lever_arm": Ladder(nominal=2e-4, unit="m"),
        "quaternion_not_unit": Ladder(nominal=1e-6, unit="1"),
        "teleport": Ladder(nominal=1e-5, unit="m"),
        "interpolated_pose": Ladder(nominal=50.0, unit="Hz", most=100.0, smaller_is_worse=True),
        "flow_gain": Ladder(nominal=0.01, unit="percent"),
        "flow_unit": Ladder(nominal=1.0, unit="1", fixed=True),
        "flow_interval_shifted": Ladder(nominal=1, fixed=True),
        "intrinsics_focal": Ladder(nominal=0.01, unit="percent"),
        "intrinsics_centre": Ladder(nominal=0.02, unit="px"),
        "extrinsic_rotation": Ladder(nominal=5e-3, unit="deg"),
        "exposure_or_gamma": Ladder(nominal=3.0, unit="percent"),
        "vignetting": Ladder(nominal=4.0, unit="percent", most=90.0),
        "truncated": Ladder(nominal=10.0, unit="percent", most=90.0),
        "corrupt_chunk": Ladder(nominal=1, fixed=True),
    }
)

_OF_PAIR: Final[Mapping[tuple[str, str], Ladder]] = MappingProxyType(
    {
        # Timestamps are whole microseconds; a flow interval that begins at no depth frame is detected at once.
        **{("time_offset", stream): Ladder(nominal=3e-3, unit="ms") for stream in ("imu", "pose", "flow", "depth")},
        ("clock_rate", "events"): Ladder(nominal=1e4, unit="ppm"),
        ("quantised_time", "events"): Ladder(nominal=0.1, unit="ms"),
        ("quantised_time", "rgb"): Ladder(nominal=7.0, unit="ms"),
        ("quantised_time", "depth"): Ladder(nominal=7.0, unit="ms"),
        ("quantised_time", "flow"): Ladder(nominal=7.0, unit="ms"),
        ("dropped_samples", "events"): Ladder(nominal=1.0, unit="ms"),
        ("duplicated_samples", "events"): Ladder(nominal=1.0, unit="ms"),
        ("nan_in_stream", "metadata"): Ladder(nominal=1, fixed=True),
        ("noise_misdeclared", "imu"): Ladder(nominal=25.0, unit="percent"),
        ("lever_arm", "metadata"): Ladder(nominal=1e-3, unit="m"),
        # A map may be absent: unlike for other streams, nothing in the metadata declares one.
        **{("missing_stream", stream): Ladder(hidden=True) for stream in INDEX_MAPS},
        ("truncated", "file"): Ladder(nominal=1.0, unit="percent", most=90.0),
    }
)

_UNDER_POSE_NOISE: Final[Mapping[tuple[str, str], Ladder]] = MappingProxyType(
    {
        ("time_offset", "imu"): Ladder(nominal=30.0, unit="ms"),
        ("time_offset", "pose"): Ladder(nominal=30.0, unit="ms"),
        ("gyro_bias", "imu"): Ladder(nominal=0.01, unit="rad/s"),
        ("accel_bias", "imu"): Ladder(nominal=0.3, unit="m/s^2"),
        ("gravity_magnitude", "imu"): Ladder(nominal=0.3, unit="m/s^2"),
        ("gravity_magnitude", "metadata"): Ladder(nominal=0.3, unit="m/s^2"),
        ("lever_arm", "imu"): Ladder(nominal=2.0, unit="m"),
        ("lever_arm", "pose"): Ladder(nominal=2.0, unit="m"),
        ("teleport", "pose"): Ladder(nominal=0.05, unit="m"),
        # A small error of the pose rotates and stretches flow as these faults do; only frames distinguish them.
        ("flow_gain", "flow"): Ladder(nominal=0.3, unit="percent"),
        ("intrinsics_focal", "flow"): Ladder(nominal=0.3, unit="percent"),
        ("intrinsics_focal", "metadata"): Ladder(nominal=0.3, unit="percent"),
        ("intrinsics_centre", "flow"): Ladder(nominal=0.4, unit="px"),
        ("intrinsics_centre", "metadata"): Ladder(nominal=3.0, unit="px"),
        ("extrinsic_rotation", "flow"): Ladder(nominal=0.1, unit="deg"),
        ("extrinsic_rotation", "metadata"): Ladder(nominal=10.0, unit="deg", hidden=True),
        ("lever_arm", "metadata"): Ladder(nominal=1.0, unit="m", hidden=True),
    }
)


SPAN: Final = 9.0
"""Magnitudes are drawn from a ninth of the nominal one to nine times it: two rungs of a ladder either way."""

SINGLE_SIZE_DIVISOR: Final = 4
"""A fault of a single size gets a fourth of the trials, as they differ by sequence alone."""

START_SPAN_S: Final = 40.0
"""Seconds of a flight over which starts are spread; some flights hit a solid after three quarters of a minute."""

_GOLDEN: Final = (math.sqrt(5) - 1) / 2


def trials_of(ladder: Ladder, most: int) -> int:
    """Return the number of trials of a fault; ``most`` is that of a fault with a range of sizes."""
    return most if ladder.has_range else -(-most // SINGLE_SIZE_DIVISOR)


def magnitude_of(ladder: Ladder, trial: int, beginning: float) -> float | None:
    """Return the magnitude of a trial, uniform in its logarithm.

    Parameters
    ----------
    ladder
        Magnitudes of the fault.
    trial
        Number of the trial.
    beginning
        0 to 1, different between faults.
    """
    return ladder.at(SPAN ** (2 * _golden_fraction(trial, beginning) - 1))


def random_magnitude_of(ladder: Ladder, random: np.random.Generator) -> float | None:
    """Return a magnitude drawn uniformly in its logarithm from the same range, to six digits where it is no number."""
    return ladder.at(SPAN ** random.uniform(-1.0, 1.0), digits=6)


def random_interval_s(random: np.random.Generator, duration_s: float) -> tuple[float, float]:
    """Return start and stop of an interval of a fifth to four fifths of a sequence, anywhere in it, to the us."""
    length_s = random.uniform(0.2, 0.8) * duration_s
    start_s = random.uniform(0.0, duration_s - length_s)
    return round(start_s, 6), round(start_s + length_s, 6)


def random_region(random: np.random.Generator, width: int, height: int) -> tuple[int, int, int, int]:
    """Return a rectangle whose sides are a quarter to three quarters of those of the image, anywhere in it."""
    across, down = (round(random.uniform(0.25, 0.75) * side) for side in (width, height))
    left, top = int(random.integers(width - across, endpoint=True)), int(random.integers(height - down, endpoint=True))
    return left, top, left + across, top + down


def start_of(scene: Scene, seed: int, duration_s: float) -> float:
    """Return where in its flight a sequence begins, in seconds and to the millisecond; it follows from the seed."""
    return round(scene.start_s + start_span_s(scene, duration_s) * _golden_fraction(seed, 0.0), 3)


def start_span_s(scene: Scene, duration_s: float) -> float:
    """Return the seconds over which starts are spread: fewer than usual where the flight ends earlier."""
    if scene.remaining_s is None:
        return START_SPAN_S
    return max(0.0, min(START_SPAN_S, scene.remaining_s - duration_s))


def _golden_fraction(number: int, beginning: float) -> float:
    return (beginning + number * _GOLDEN) % 1.0

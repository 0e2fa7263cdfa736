"""Cues, from other streams, to which of IMU and pose a deviation belongs."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US, STANDARD_GRAVITY_M_S2
from fedora_qa.diagnosis.support import support
from fedora_qa.sequence.facts import Facts

Int64 = NDArray[np.int64]

USUAL_GRAVITIES_M_S2: Final = (9.8, 9.806, 9.8066, STANDARD_GRAVITY_M_S2, 9.807, 9.81)
"""Magnitudes of gravity that simulators and datasets use, m/s^2."""

_USUAL_SIGMAS: Final = 3.0
"""Standard errors within which a measured gravity is a usual one."""

_EXACT_M_S2: Final = 1e-9
"""Largest difference of a declared gravity from a usual one, m/s^2: rounding of float64 only."""

_IN_PLACE, _OUT_OF_PLACE = 0.9, 0.75
"""Shares of coincidences: one clock is correct and the other has an offset where the share of the one is at least the
first number, and that of the other at most the second."""


@dataclass(frozen=True, slots=True)
class TimingCues:
    """Likelihoods of the timestamps, up to a common factor, under an offset of either clock.

    Attributes
    ----------
    imu_offset, pose_offset
        Likelihood if the clock of the IMU, or that of the poses, has the offset.
    """

    imu_offset: float = 1.0
    pose_offset: float = 1.0


def timing_cues_of(facts: Facts) -> TimingCues:
    """Compare the timestamps of IMU and poses with those of all other streams.

    Simulators and good recorders have one grid for all timestamps: the timestamps of frames are also timestamps of IMU
    and poses. After a random offset of a whole number of microseconds, a clock is on the grid with a probability of 1
    us over its period.
    """
    if "imu" not in facts.clocks or "pose" not in facts.clocks:
        return TimingCues()
    imu_ns, pose_ns = (facts.clocks[stream].times_ns for stream in ("imu", "pose"))
    # For each cue the shares to which IMU and pose are in place: frames, beginnings, grid.
    cues: list[tuple[float, float]] = []
    frame_clocks = [clock for stream, clock in facts.clocks.items() if stream not in ("imu", "pose")]
    frames_ns = [clock.times_ns for clock in frame_clocks if clock.usable]
    if frames_ns and len(imu_ns) and len(pose_ns):
        all_ns = np.concatenate(frames_ns)
        cues.append((_share_among(all_ns, imu_ns), _share_among(all_ns, pose_ns)))
        # Streams begin together; one with an offset begins at another time.
        firsts_ns = np.array([times_ns[0] for times_ns in frames_ns])
        cues.append((float(np.mean(firsts_ns == imu_ns[0])), float(np.mean(firsts_ns == pose_ns[0]))))
    cues.append((_on_own_grid(facts, imu_ns), _on_own_grid(facts, pose_ns)))
    for imu_share, pose_share in cues:
        # The IMU is on the grid and the poses are not: the poses have the offset, or the IMU has it and is on the grid
        # by chance.
        if imu_share >= _IN_PLACE and pose_share <= _OUT_OF_PLACE:
            return TimingCues(imu_offset=_chance_of_coincidence(imu_ns))
        if pose_share >= _IN_PLACE and imu_share <= _OUT_OF_PLACE:
            return TimingCues(pose_offset=_chance_of_coincidence(pose_ns))
    return TimingCues()


def gravity_likelihoods(declared_m_s2: float, excess_m_s2: float, error_m_s2: float) -> tuple[float, float]:
    """Return the likelihoods of a deviating gravity under a fault of the sensor, and under a wrong declaration.

    Under a fault of the sensor the declaration is correct, and mostly a usual number. Under a wrong declaration the
    measured gravity is mostly a usual number, within its error.

    Parameters
    ----------
    declared_m_s2
        Declared gravity, m/s^2.
    excess_m_s2
        Measured less declared gravity, m/s^2.
    error_m_s2
        Its standard error, m/s^2.

    Returns
    -------
    sensor
        Likelihood under a fault of the sensor: 1, or less for an unusual number.
    declaration
        Likelihood under a wrong declaration, likewise.
    """
    unusual = support("imu.unusual_gravity")
    sensor = 1.0 if _is_usual(declared_m_s2, _EXACT_M_S2) else unusual
    declaration = 1.0 if _is_usual(declared_m_s2 + excess_m_s2, _USUAL_SIGMAS * error_m_s2) else unusual
    return sensor, declaration


def _share_among(times_ns: Int64, timestamps_ns: Int64) -> float:
    """Return the share of instants, within the span of the timestamps, that equal one of the timestamps."""
    within = times_ns[(times_ns >= timestamps_ns[0]) & (times_ns <= timestamps_ns[-1])]
    if not len(within):
        return 0.0
    # By bisection where timestamps are in order, which is the rule.
    in_order = not np.any(np.diff(timestamps_ns) < 0)
    # The search has no index beyond the end: ``within`` does not exceed the last timestamp.
    coincident = (
        timestamps_ns[np.searchsorted(timestamps_ns, within)] == within if in_order else np.isin(within, timestamps_ns)
    )
    return float(np.mean(coincident))


def _on_own_grid(facts: Facts, timestamps_ns: Int64) -> float:
    """Return whether the timestamps of the stream are multiples of its period: 1 if so, else 0."""
    if len(timestamps_ns) < 2:
        return 0.0
    # The median, because a gap would move the mean of the steps.
    period_us = float(np.median(np.diff(timestamps_ns))) / NS_PER_US
    return float(period_us > 1 and facts.to_file_us(float(timestamps_ns[0])) % period_us == 0)


def _chance_of_coincidence(timestamps_ns: Int64) -> float:
    """Return the probability that a clock with an offset of whole microseconds is on the grid: 1 us over its period."""
    return NS_PER_US / max(float(np.median(np.diff(timestamps_ns))), NS_PER_US) if len(timestamps_ns) > 1 else 1.0


def _is_usual(gravity_m_s2: float, within_m_s2: float) -> bool:
    return min(abs(gravity_m_s2 - usual) for usual in USUAL_GRAVITIES_M_S2) <= within_m_s2

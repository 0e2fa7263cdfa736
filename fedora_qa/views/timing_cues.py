"""What a file shows beside IMU and pose that tells which of the two a deviation belongs to."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US, STANDARD_GRAVITY_M_S2
from fedora_qa.sequence.declared import ImuModel
from fedora_qa.sequence.facts import Facts

Int64 = NDArray[np.int64]

USUAL_GRAVITIES_M_S2: Final = (9.8, 9.806, 9.8066, STANDARD_GRAVITY_M_S2, 9.807, 9.81)
"""What simulators and datasets set and declare."""

_UNUSUAL: Final = 0.1
"""Share of honest files with another gravity: that of a place, or of another planet. A guess; only its order counts."""

_SURE: Final = 3.0
_EXACT: Final = 1e-9
_IN_PLACE, _OUT_OF_PLACE = 0.9, 0.75


@dataclass(frozen=True, slots=True)
class TimingCues:
    """Likelihoods, up to a common factor, of what the file shows under each of two rival causes.

    Attributes
    ----------
    imu_late, pose_late
        That the stamps of the one or the other were moved.
    gravity_m_s2
        As declared.
    """

    imu_late: float = 1.0
    pose_late: float = 1.0
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2

    def of_gravity(self, excess_m_s2: float, error_m_s2: float) -> tuple[float, float]:
        """Return the likelihoods that the sensor, and that the declaration, is what deviates.

        If the sensor deviates the declaration is honest, and mostly a usual number; if the declaration does, what was
        measured is, as far as its error tells.
        """
        sensor = 1.0 if _is_usual(self.gravity_m_s2, _EXACT) else _UNUSUAL
        declaration = 1.0 if _is_usual(self.gravity_m_s2 + excess_m_s2, _SURE * error_m_s2) else _UNUSUAL
        return sensor, declaration


def timing_cues_of(facts: Facts) -> TimingCues:
    """Look for clues in the stamps of all streams and in what is declared.

    A simulator, and a good recorder, stamps on one grid: frames fall on stamps of IMU and pose. A clock that was moved
    by a whole number of microseconds at random is still in place with a chance of one in its period.
    """
    gravity = (facts.declared.imu or ImuModel()).gravity
    if "imu" not in facts.clocks or "pose" not in facts.clocks:
        return TimingCues(gravity_m_s2=gravity)
    imu_ns, pose_ns = (facts.clocks[stream].times_ns for stream in ("imu", "pose"))
    for imu_share, pose_share in _shares_in_place(facts, imu_ns, pose_ns):
        if imu_share >= _IN_PLACE and pose_share <= _OUT_OF_PLACE:
            return TimingCues(imu_late=_by_chance(imu_ns), gravity_m_s2=gravity)
        if pose_share >= _IN_PLACE and imu_share <= _OUT_OF_PLACE:
            return TimingCues(pose_late=_by_chance(pose_ns), gravity_m_s2=gravity)
    return TimingCues(gravity_m_s2=gravity)


def _shares_in_place(facts: Facts, imu_ns: Int64, pose_ns: Int64) -> Iterator[tuple[float, float]]:
    """Yield, clue by clue, how far IMU and pose are in place: of frames on their stamps, of beginnings, of the grid."""
    others = {stream: clock for stream, clock in facts.clocks.items() if stream not in ("imu", "pose")}
    others_ns = [clock.times_ns for clock in others.values() if clock.usable]
    if others_ns and len(imu_ns) and len(pose_ns):
        frames_ns = np.concatenate(others_ns)
        yield _share_among(frames_ns, imu_ns), _share_among(frames_ns, pose_ns)
        firsts_ns = np.array([times_ns[0] for times_ns in others_ns])
        yield float(np.mean(firsts_ns == imu_ns[0])), float(np.mean(firsts_ns == pose_ns[0]))
    yield _on_own_grid(facts, imu_ns), _on_own_grid(facts, pose_ns)


def _share_among(times_ns: Int64, timestamps_ns: Int64) -> float:
    within = times_ns[(times_ns >= timestamps_ns[0]) & (times_ns <= timestamps_ns[-1])]
    if not len(within):
        return 0.0
    in_order = not np.any(np.diff(timestamps_ns) < 0)
    there = (
        timestamps_ns[np.searchsorted(timestamps_ns, within)] == within if in_order else np.isin(within, timestamps_ns)
    )
    return float(np.mean(there))


def _on_own_grid(facts: Facts, timestamps_ns: Int64) -> float:
    """Return whether the file stamps the stream at multiples of its period."""
    if len(timestamps_ns) < 2:
        return 0.0
    period_us = float(np.median(np.diff(timestamps_ns))) / NS_PER_US
    return float(period_us > 1 and facts.to_file_us(float(timestamps_ns[0])) % period_us == 0)


def _by_chance(timestamps_ns: Int64) -> float:
    return NS_PER_US / max(float(np.median(np.diff(timestamps_ns))), NS_PER_US) if len(timestamps_ns) > 1 else 1.0


def _is_usual(gravity_m_s2: float, within_m_s2: float) -> bool:
    return min(abs(gravity_m_s2 - usual) for usual in USUAL_GRAVITIES_M_S2) <= within_m_s2

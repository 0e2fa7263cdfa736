"""Whose clock an offset between events and frames is of."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.facts import Facts

_EITHER: Final = (0.9, 0.8)
"""Weights of an offset of the events and of the frames where nothing tells them apart."""


def whose_offset(offset_ms: float, facts: Facts) -> tuple[float, float]:
    """Return the weights of an offset of the events, and of the frames: do those keep in step with depth and flow?

    A renderer draws colour, depth and flow at common times. Frames that leave them by the offset are moved themselves,
    and frames that still meet them were not.
    """
    clocks = [facts.clocks[stream] for stream in ("depth", *facts.flow_streams) if stream in facts.clocks]
    common_ns = np.unique(np.concatenate([clock.times_ns for clock in clocks])) if clocks else np.zeros(0, np.int64)
    frames_ns = facts.clocks["rgb"].times_ns
    if len(common_ns) < 2 or not len(frames_ns):
        return _EITHER
    near_ns = abs(offset_ms) * 1e6 / 4
    as_timestamped = _median_distance(frames_ns, common_ns) < near_ns
    moved_back = _median_distance(frames_ns + round(1e6 * offset_ms), common_ns) < near_ns
    if as_timestamped == moved_back:
        return _EITHER
    return _EITHER[::-1] if moved_back else (_EITHER[0], _EITHER[1] / 2)


def _median_distance(times_ns: NDArray[np.int64], grid_ns: NDArray[np.int64]) -> float:
    """Return the median distance of stamps from the nearest of a sorted grid of two or more."""
    after = np.clip(np.searchsorted(grid_ns, times_ns), 1, len(grid_ns) - 1)
    return float(np.median(np.minimum(np.abs(times_ns - grid_ns[after - 1]), np.abs(grid_ns[after] - times_ns))))

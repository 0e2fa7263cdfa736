"""Samples of a motion that lie on straight lines between every so many-th: they were interpolated from a lower rate."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.imu.local_motion import Curve, divided_differences

Float64 = NDArray[np.float64]
Indices = NDArray[np.intp]

_FEWEST_PERIODS: Final = 16


@dataclass(frozen=True, slots=True)
class Interpolation:
    """How unevenly the curvature of a motion is spread over every so many-th sample.

    ``evenness`` is the median curvature between these samples over that at them: near 1 for any smooth or noisy
    motion, near 0 where samples were interpolated linearly from every ``stride``-th.
    """

    evenness: float
    stride: int


def find_interpolation(times_ns: NDArray[np.int64], curve: Curve, *, resolution: float) -> Interpolation | None:
    """Look for samples on straight lines between every 2nd to 20th; None where there is no curvature to compare.

    ``resolution`` is the rounding of a sample: curvature within a hundred times that says nothing.
    """
    bends = np.linalg.norm(divided_differences(times_ns, curve, 2), axis=-1)
    order = np.argsort(bends, kind="stable")
    ranked = bends[order]
    found = []
    for stride in range(2, min(20, len(bends) // _FEWEST_PERIODS) + 1):
        phases = (order % stride).astype(np.uint8)
        by_phase, counts = np.argsort(phases, kind="stable"), np.bincount(phases)
        for ranks in np.split(by_phase, np.cumsum(counts)[:-1]):
            kinks = _middle(ranked[ranks[_middles(len(ranks))]])
            if kinks > 100.0 * resolution:
                found.append(Interpolation(_middle(ranked[_others(ranks, len(bends))]) / kinks, stride))
    return min(found, key=lambda one: (round(one.evenness, 2), one.stride), default=None)


def _middles(count: int) -> list[int]:
    """Return the places whose mean is the median of so many numbers in order."""
    return [(count - 1) // 2, count // 2]


def _middle(pair: Float64) -> float:
    return float(pair[0] + pair[1]) / 2


def _others(ranks: Indices, count: int) -> Indices:
    """Return the ranks, among ``count``, of the middles of all that are not in ``ranks`` (in order)."""
    wanted = np.array(_middles(count - len(ranks)))
    return wanted + np.searchsorted(ranks - np.arange(len(ranks)), wanted, side="right")

"""What events must conserve: the signal less what its events sum to stays within the thresholds, for ever.

An ideal pixel keeps ``-C- < L - ref < C+``, and ``ref`` moves by C+ and C- only. So over any times, however far apart,
``E = L - C+ P + C- M`` varies by less than C+ + C-. Each frame bounds L at its time; the pixel violates the law where
the largest lower bound of E exceeds the smallest upper bound by C+ + C- or more. Where the reference is the signal at
the first frame, E is nothing there, and stays within the thresholds of it: -C- < E < C+.

Signals are int64 multiples of 2^-40 nat, so that neighbouring stretches join exactly in any order.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.event_kernels import bound_excursions

Int64 = NDArray[np.int64]

UNITS_PER_NAT: Final = 2.0**40
_FARTHEST: Final = 2**61


@dataclass(frozen=True, slots=True)
class Excursions:
    """Bounds of E for every pixel over some consecutive frames.

    Attributes
    ----------
    first_frame, last_frame
        Both included.
    total
        (h, w) what the events between the first and the last frame sum to.
    highest, lowest
        (2, h, w) the largest lower bound and the smallest upper bound of E, counted from the first frame, and the frame
        of each.
    start
        (2, h, w) lower and upper bound of E at the first frame.
    """

    first_frame: int
    last_frame: int
    total: Int64
    highest: Int64
    lowest: Int64
    start: Int64

    def then(self, later: "Excursions") -> "Excursions":
        """Join with the stretch that begins at this one's last frame. Exact, hence associative."""
        highest, lowest = later.highest.copy(), later.lowest.copy()
        for bounds in (highest, lowest):
            bounds[0] -= self.total
        return Excursions(
            self.first_frame,
            later.last_frame,
            self.total + later.total,
            np.where(highest[0] > self.highest[0], highest, self.highest),
            np.where(lowest[0] < self.lowest[0], lowest, self.lowest),
            self.start,
        )

    def excess(self) -> NDArray[np.float64]:
        """Return by how much (h, w) E has surely varied, nat; negative where nothing is sure."""
        span: NDArray[np.float64] = (self.highest[0].astype(np.float64) - self.lowest[0]) / UNITS_PER_NAT
        return span

    def departure(self, threshold_on: float, threshold_off: float) -> NDArray[np.float64]:
        """Return how far (h, w) E has surely gone beyond the thresholds around its start, nat; mostly negative."""
        rise = (self.highest[0].astype(np.float64) - self.start[1]) / UNITS_PER_NAT - threshold_on
        fall = (self.start[0].astype(np.float64) - self.lowest[0]) / UNITS_PER_NAT - threshold_off
        farthest: NDArray[np.float64] = np.maximum(rise, fall)
        return farthest


def bound(
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    counts: NDArray[np.int32],
    drift: NDArray[np.float64],
    *,
    threshold_on: float,
    threshold_off: float,
    frames: Int64,
) -> Excursions:
    """Return the excursions over consecutive frames.

    Parameters
    ----------
    lower, upper
        (n, h, w) bounds of the signal at each frame, nat; not finite where nothing is known.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    drift
        (n - 1,) nat that the signal appears to gain between frames besides (leak).
    frames
        (n,) numbers of the frames.
    """
    highest, lowest = np.zeros((2, 2, *lower.shape[1:]), np.int64)
    highest[0], lowest[0] = -_FARTHEST, _FARTHEST
    on, off = (round(threshold * UNITS_PER_NAT) for threshold in (threshold_on, threshold_off))
    moved = np.rint(drift * UNITS_PER_NAT).astype(np.int64)
    total = bound_excursions(lower, upper, counts, UNITS_PER_NAT, on, off, moved, frames, highest, lowest)
    known = np.isfinite(lower[0]) & np.isfinite(upper[0])
    ends = [np.where(known, end, 0.0) * UNITS_PER_NAT for end in (lower[0], upper[0])]
    start = np.stack([
        np.where(known, np.floor(ends[0]).astype(np.int64), -_FARTHEST),
        np.where(known, np.ceil(ends[1]).astype(np.int64), _FARTHEST),
    ])  # fmt: skip
    return Excursions(int(frames[0]), int(frames[-1]), total, highest, lowest, start)

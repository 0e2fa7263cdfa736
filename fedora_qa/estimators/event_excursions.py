"""What events must conserve: the signal less what its events sum to stays within the thresholds, for ever.

An ideal pixel keeps ``-C- < L - ref < C+``, and ``ref`` moves by C+ and C- only. So over any times, however far apart,
``E = L - C+ P + C- M`` varies by less than C+ + C-. Each frame bounds L at its time; the pixel violates the law where
the largest lower bound of E exceeds the smallest upper bound by C+ + C- or more. Where the reference is the signal at
the first frame, E is nothing there, and stays within the thresholds of it: -C- < E < C+.

Signals are int64 multiples of 2^-40 nat, so that neighbouring stretches join exactly in any order.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.event_excursion_kernels import bound_excursions, join_bounds

Int64 = NDArray[np.int64]

UNITS_PER_NAT: Final = 2.0**40
EVERY_FRAME: Final = (np.inf, 0.0)
"""The rule that believes every frame."""


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
        (2, h, w) lower and upper bound of E at frame 0; (2, 0, 0) of a stretch that begins later, where no reference is
        declared.
    """

    first_frame: int
    last_frame: int
    total: Int64
    highest: Int64
    lowest: Int64
    start: Int64

    def then(self, later: "Excursions") -> "Excursions":
        """Join with the stretch that begins at this one's last frame. Exact, hence associative."""
        highest, lowest = np.empty_like(self.highest), np.empty_like(self.lowest)
        join_bounds(self.total, self.highest, later.highest, 1, highest)
        join_bounds(self.total, self.lowest, later.lowest, -1, lowest)
        total = self.total + later.total
        return Excursions(self.first_frame, later.last_frame, total, highest, lowest, self.start)

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
    light: NDArray[np.floating],
    error: NDArray[np.floating],
    counts: NDArray[np.int32],
    drift: NDArray[np.float64],
    *,
    threshold_on: float,
    threshold_off: float,
    frames: Int64,
    dark: float = 0.0,
    uneven: Sequence[tuple[float, float]] = (EVERY_FRAME,),
) -> tuple[Excursions, ...]:
    """Return the excursions over consecutive frames, by each rule which frames to believe.

    Parameters
    ----------
    light, error
        (n, h, w) light at each frame and what it may be off by; infinite where nothing is known. The signal is the
        logarithm of the light and ``dark``.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    drift
        (n - 1,) nat that the signal appears to gain between frames besides (leak).
    frames
        (n,) numbers of the frames.
    uneven
        The rules: errors not below the first and the second times the light tell nothing.
    """
    steps = (round(threshold_off * UNITS_PER_NAT), round(threshold_on * UNITS_PER_NAT))
    moved = np.rint(drift * UNITS_PER_NAT).astype(np.int64)
    rules, shape = np.array(uneven, np.float64), light.shape[1:]

    def followed(count: int) -> tuple[Int64, Int64, Int64]:
        """Return totals (h, w) and bounds (k, 2, h, w) over the first frames."""
        total, (highest, lowest) = np.empty(shape, np.int64), np.empty((2, len(rules), 2, *shape), np.int64)
        seen = light[:count], error[:count], counts[: count - 1]
        bound_excursions(
            *seen, dark, steps, moved[: count - 1], frames[:count], rules, UNITS_PER_NAT, total, highest, lowest
        )
        return total, highest, lowest

    total, highest, lowest = followed(len(light))
    start = np.empty((len(rules), 2, 0, 0), np.int64)
    if frames[0] == 0:
        _, first_highest, first_lowest = followed(1)
        start = np.stack([first_highest[:, 0], first_lowest[:, 0]], axis=1)
    ends = int(frames[0]), int(frames[-1])
    return tuple(Excursions(*ends, total, *each) for each in zip(highest, lowest, start, strict=True))

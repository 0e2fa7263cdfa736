"""What events must conserve: the signal less what its events sum to stays within the thresholds, for ever.

An ideal pixel keeps ``-C- < L - ref < C+``, and ``ref`` moves by C+ and C- only. So over any times, however far apart,
``E = L - C+ P + C- M`` varies by less than C+ + C-. Each frame bounds L at its time; the pixel violates the law where
the largest lower bound of E exceeds the smallest upper bound by C+ + C- or more. Where the reference is the signal at
the first frame, E is nothing there, and stays within the thresholds of it: -C- < E < C+.

Signals are int64 multiples of 2^-40 nat, so that neighbouring stretches join exactly in any order.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.excursion_kernels import FARTHEST, follow_excursions

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]

UNITS_PER_NAT: Final = 2.0**40
EVERY_FRAME: Final = (np.inf, 0.0)
"""The rule that believes every frame."""


@dataclass(frozen=True, slots=True)
class Law:
    """What an ideal pixel does, and which frames are believed.

    Attributes
    ----------
    threshold_on, threshold_off
        What a brighter and a darker event stand for, nat.
    dark
        The signal is the logarithm of the light and this.
    uneven
        Rules: errors not below the first and the second times the light tell nothing.
    """

    threshold_on: float
    threshold_off: float
    dark: float = 0.0
    uneven: tuple[tuple[float, float], ...] = (EVERY_FRAME,)


@dataclass(slots=True)
class Excursions:
    """Bounds of E for every pixel over some consecutive frames, by each of the k rules of a law.

    Attributes
    ----------
    first_frame, last_frame
        Both included.
    total
        (h, w) what the events between the first and the last frame sum to.
    highest, lowest
        (k, h, w) the largest lower bound and the smallest upper bound of E, counted from the first frame.
    highest_at, lowest_at
        (h, w) the frames of the first rule's.
    start
        (2, h, w) light and its error at frame 0; (2, 0, 0) of a stretch that begins later, where no reference is
        declared.
    """

    law: Law
    first_frame: int
    last_frame: int
    total: Int64
    highest: Int64
    lowest: Int64
    highest_at: Int32
    lowest_at: Int32
    start: NDArray[np.floating[Any]]

    def follow(
        self,
        light: NDArray[np.floating],
        error: NDArray[np.floating],
        counts: Int32,
        drift: Float64,
        frames: Int64,
    ) -> None:
        """Go on, in place, over frames of which the first is this one's last; arguments as those of ``bound``."""
        self._take(light, error, counts, drift, frames, begun=True)
        self.last_frame = int(frames[-1])

    def then(self, later: "Excursions") -> "Excursions":
        """Join with the stretch that begins at this one's last frame. Exact, hence associative."""
        highest = np.where(later.highest > -FARTHEST, later.highest - self.total, -FARTHEST)
        lowest = np.where(later.lowest < FARTHEST, later.lowest - self.total, FARTHEST)
        # Of equal ones the earlier.
        highest_at = np.where(highest[0] > self.highest[0], later.highest_at, self.highest_at)
        lowest_at = np.where(lowest[0] < self.lowest[0], later.lowest_at, self.lowest_at)
        np.maximum(highest, self.highest, out=highest)
        np.minimum(lowest, self.lowest, out=lowest)
        ends, total = (self.first_frame, later.last_frame), self.total + later.total
        return Excursions(self.law, *ends, total, highest, lowest, highest_at, lowest_at, self.start)

    def excess(self, rule: int = 0) -> Float64:
        """Return by how much (h, w) E has surely varied, nat; negative where nothing is sure."""
        span: Float64 = (self.highest[rule].astype(np.float64) - self.lowest[rule]) / UNITS_PER_NAT
        return span

    def departure(self, rule: int = 0) -> Float64:
        """Return how far (h, w) E has surely gone beyond the thresholds around its start, nat; mostly negative."""
        light, error = self.start[:, np.newaxis]
        none, first = np.zeros((0, 2, *light.shape[1:]), np.int32), np.zeros(1, np.int64)
        start = bound(light, error, none, np.zeros(0), replace(self.law, uneven=(self.law.uneven[rule],)), first)
        rise = (self.highest[rule].astype(np.float64) - start.lowest[0]) / UNITS_PER_NAT - self.law.threshold_on
        fall = (start.highest[0].astype(np.float64) - self.lowest[rule]) / UNITS_PER_NAT - self.law.threshold_off
        farthest: Float64 = np.maximum(rise, fall)
        return farthest

    def _take(
        self,
        light: NDArray[np.floating],
        error: NDArray[np.floating],
        counts: Int32,
        drift: Float64,
        frames: Int64,
        *,
        begun: bool,
    ) -> None:
        law = self.law
        follow_excursions(
            light,
            error,
            counts,
            law.dark,
            (round(law.threshold_off * UNITS_PER_NAT), round(law.threshold_on * UNITS_PER_NAT)),
            np.rint(drift * UNITS_PER_NAT).astype(np.int64),
            frames.astype(np.int32),
            np.array(law.uneven, np.float64),
            UNITS_PER_NAT,
            begun,
            self.total,
            self.highest,
            self.lowest,
            self.highest_at,
            self.lowest_at,
        )


def bound(
    light: NDArray[np.floating],
    error: NDArray[np.floating],
    counts: Int32,
    drift: Float64,
    law: Law,
    frames: Int64,
) -> Excursions:
    """Return the excursions over consecutive frames.

    Parameters
    ----------
    light, error
        (n, h, w) light at each frame and what it may be off by; infinite where nothing is known.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    drift
        (n - 1,) nat that the signal appears to gain between frames besides (leak).
    frames
        (n,) numbers of the frames.
    """
    shape, rules = light.shape[1:], len(law.uneven)
    start = np.stack([light[0], error[0]]) if frames[0] == 0 else np.empty((2, 0, 0), light.dtype)
    found = Excursions(
        law,
        int(frames[0]),
        int(frames[-1]),
        np.zeros(shape, np.int64),
        np.full((rules, *shape), -FARTHEST),
        np.full((rules, *shape), FARTHEST),
        np.zeros(shape, np.int32),
        np.zeros(shape, np.int32),
        start,
    )
    found._take(light, error, counts, drift, frames, begun=False)
    return found

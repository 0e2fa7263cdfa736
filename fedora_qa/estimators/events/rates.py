"""Pixels that fire more than their neighbourhood."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.row_kernels import EVENT, FIRST, LAST, RUN, tally_events

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]

_RING: Final = 2
"""Neighbours lie up to so many pixels away along each axis: 24 of them."""

_MIDDLE, _THIRD = 12, 3
"""Ranks from the largest of 24 neighbours: the 12th (13th from below), taken as their median, and the third."""


@dataclass(frozen=True, slots=True)
class PixelCounts:
    """Events and runs of every pixel; whole numbers, so that joining is exact.

    ``packed`` (h, w) has the layout of ``tally_events``.
    """

    packed: Int64

    @classmethod
    def of_nothing(cls, shape: tuple[int, int]) -> "PixelCounts":
        """Return the counts of a sensor (rows, columns) that has not fired."""
        return cls(np.zeros(shape, np.int64))

    @property
    def events(self) -> Int64:
        """Events (h, w), whatever their polarity."""
        return (self.packed & (RUN - 1)) // EVENT

    @property
    def runs(self) -> Int64:
        """Sequences of events of one polarity (h, w); one more than there are reversals."""
        return self.packed // RUN

    @property
    def first(self) -> Int64:
        """Polarity (h, w) of the first event, -1 where there is none."""
        return np.where(self.packed == 0, -1, self.packed & FIRST)

    @property
    def last(self) -> Int64:
        """Polarity (h, w) of the last event, -1 where there is none."""
        return np.where(self.packed == 0, -1, (self.packed & LAST) // LAST)

    def add(self, x: NDArray[np.uint16], y: NDArray[np.uint16], p: NDArray[np.uint8]) -> None:
        """Count the events that come next, in place."""
        tally_events(x, y, p, self.packed)

    def then(self, later: "PixelCounts") -> "PixelCounts":
        """Join with what comes later: a run that goes on over the border is one."""
        goes_on = (self.last == later.first) & (self.packed > 0)
        # First polarity of the earlier part, last of the later one; a run that spans the border counts once.
        both = self.packed - (self.packed & LAST) + later.packed - (later.packed & FIRST) - goes_on * RUN
        return PixelCounts(np.where(self.packed == 0, later.packed, np.where(later.packed == 0, self.packed, both)))


@dataclass(frozen=True, slots=True)
class NeighbourExcess:
    """Events of pixels beside those of their neighbours, (h, w) each.

    Attributes
    ----------
    events
        Events above the third largest of the 24 neighbours, so that two bad pixels side by side do not hide each other.
    swings
        Events by which a correct pixel may exceed its neighbours: one for each swing of the scene.
    error
        Standard deviation of the excess: Poisson, of the swings as well, and the spread of the neighbours.
    median
        Of the neighbours.
    """

    events: Float64
    swings: Float64
    error: Float64
    median: Float64

    @property
    def z(self) -> Float64:
        """What is in excess of swings, in standard deviations (h, w)."""
        return (self.events - self.swings) / self.error


def neighbour_excess(counts: PixelCounts) -> NeighbourExcess:
    """Compare every pixel with its 24 neighbours.

    What moves over a sensor moves over the neighbours as well; edges and textures make neighbours differ, and the
    distance of their third largest from their median (1.1 standard deviations of a normal distribution) measures by
    how much.

    Where a scene swings to and fro, neighbours differ alike in every swing, and that does not average out. Let a swing
    change the signal by A thresholds, and the signal be r thresholds beyond its reference where it turns, 0 <= r < 1:
    floor(A - r) events follow. Of two pixels with the same A, one gives at most one event a swing more than the other,
    and if A is just above 1, one fires in every swing and the other never does. So one event of each run of
    equal polarity is no excess, for as many runs as the scene has swings. These are counted where neighbours bear each
    other out: the largest number of runs that a pixel and three of its neighbours have all reached. A hot pixel alone
    adds nothing to it, however often its polarity alternates, and one of a single polarity has one run. Which swings
    pass the threshold, and which pass it twice, is chance: so many events vary by Poisson's error at most.

    Parameters
    ----------
    counts
        Events and runs of every pixel of the sensor, three rows and columns at least.

    Returns
    -------
    NeighbourExcess
        Arrays (h, w), in events.
    """
    events, runs = counts.events, counts.runs
    high, median = _ranked(events, _MIDDLE)
    borne_out = np.minimum(runs, _ranked(runs, _THIRD)[0])
    swings = np.minimum(runs, borne_out.max(initial=0.0)).astype(np.float64)
    # Poisson variances of the third largest and of the swings, the spread of the neighbours, and one event.
    error = np.sqrt(high + (high - median) ** 2 + swings + 1.0)
    return NeighbourExcess(events - high, swings, error, median)


def _ranked(counts: Int64, depth: int) -> tuple[Float64, Float64]:
    """Return the third largest neighbours' count (h, w) and the ``depth``-th largest; borders mirror the image."""
    third, deepest = np.empty((2, *counts.shape), np.int32)
    rank_neighbours(np.pad(counts.astype(np.int32), _RING, mode="reflect"), third, deepest, depth)
    return third.astype(np.float64), deepest.astype(np.float64)


@njit(cache=True)
def rank_neighbours(around: Int32, third: Int32, deepest: Int32, depth: int) -> None:
    """Write the third largest and the ``depth``-th largest of the 24 neighbours of every pixel, (h, w) each.

    ``around`` (h + 4, w + 4) holds the counts with two pixels more on each side. ``depth`` is 3 at least.
    """
    # A row at a time: each neighbour takes its place among the largest so far, which pass a smaller one on.
    height, width = third.shape
    largest, passed_on = np.empty((depth, width), np.int32), np.empty(width, np.int32)
    for row in range(height):
        largest[:] = np.iinfo(np.int32).min
        for down in range(2 * _RING + 1):
            for right in range(2 * _RING + 1):
                if down == _RING and right == _RING:
                    continue
                passed_on[:] = around[row + down, right : right + width]
                for place in range(depth):
                    _pass_on(largest[place], passed_on)
        third[row], deepest[row] = largest[2], largest[depth - 1]


@njit(cache=True)
def _pass_on(largest: Int32, passed_on: Int32) -> None:
    """Keep the larger of two rows (w,), element by element, and pass the smaller one on."""
    for column in range(len(largest)):
        kept, other = largest[column], passed_on[column]
        largest[column], passed_on[column] = max(kept, other), min(kept, other)

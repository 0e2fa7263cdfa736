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
"""Largest distance of neighbours along each axis, px: a pixel has 24 neighbours."""

_MIDDLE, _THIRD = 12, 3
"""Ranks of the 24 neighbours, counted from the largest: the 12th (13th from the smallest), which serves as their
median, and the third."""


@dataclass(frozen=True, slots=True)
class PixelCounts:
    """Numbers of events and runs of every pixel. They are integers, so that joining is exact.

    Attributes
    ----------
    packed
        (h, w) one number for each pixel, in the layout of ``tally_events``.
    """

    packed: Int64

    @classmethod
    def of_nothing(cls, shape: tuple[int, int]) -> "PixelCounts":
        """Return the counts of a sensor of ``shape`` (rows, columns) without events."""
        return cls(np.zeros(shape, np.int64))

    @property
    def events(self) -> Int64:
        """Number of events (h, w) of both polarities."""
        return (self.packed & (RUN - 1)) // EVENT

    @property
    def runs(self) -> Int64:
        """Number of runs (h, w): successive events of one polarity. It is one more than the number of reversals."""
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
        """Count the events that come next, in place.

        Parameters
        ----------
        x, y
            (m,) columns and rows, px; all events lie on the sensor.
        p
            (m,) polarities in the order of time: 1 brighter, 0 darker.
        """
        tally_events(x, y, p, self.packed)

    def then(self, later: "PixelCounts") -> "PixelCounts":
        """Join with the counts of later events; a run that continues over the border counts once."""
        goes_on = (self.last == later.first) & (self.packed > 0)
        # First polarity of the earlier part, last of the later one; a run that spans the border counts once.
        both = self.packed - (self.packed & LAST) + later.packed - (later.packed & FIRST) - goes_on * RUN
        return PixelCounts(np.where(self.packed == 0, later.packed, np.where(later.packed == 0, self.packed, both)))


@dataclass(frozen=True, slots=True)
class NeighbourExcess:
    """Events of pixels compared with those of their 24 neighbours.

    Attributes
    ----------
    events
        (h, w) events less those of the neighbour with the third largest number, so that neighbouring hot pixels do not
        hide each other.
    swings
        (h, w) events by which a correct pixel can exceed its neighbours: one for each swing of the scene.
    error
        (h, w) standard deviation of the excess: Poisson errors of the neighbour and of the swings, and the scatter of
        the neighbours.
    median
        (h, w) median number of events of the neighbours.
    """

    events: Float64
    swings: Float64
    error: Float64
    median: Float64

    @property
    def z(self) -> Float64:
        """Excess (h, w) over the neighbours and the swings, in standard deviations."""
        return (self.events - self.swings) / self.error


def neighbour_excess(counts: PixelCounts) -> NeighbourExcess:
    """Compare every pixel with its 24 neighbours.

    An image that moves over a pixel moves over its neighbours as well. Edges and textures cause differences between
    neighbours. Their size is the distance of the third largest neighbour from the median (1.1 standard deviations of a
    normal distribution).

    Where a scene swings to and fro, neighbours differ equally in every swing, and the differences do not average out.
    Let a swing change the signal by A thresholds, and let the signal be r thresholds beyond its reference where it
    turns, 0 <= r < 1: then floor(A - r) events follow. Of two pixels with the same A, one gives at most one event more
    in each swing than the other; if A is just above 1, one pixel fires in every swing and the other never. Therefore
    one event of each run of equal polarity is no excess, for as many runs as the scene has swings. The number of swings
    is the largest number of runs that a pixel and three of its neighbours have all reached. A single hot pixel does not
    increase this number, even if its polarity alternates; a hot pixel of one polarity has one run. Chance decides in
    which swings the signal passes the threshold once or twice, so that the number of these events varies at most by the
    Poisson error.

    Parameters
    ----------
    counts
        Events and runs of every pixel of the sensor, which has at least three rows and columns.

    Returns
    -------
    NeighbourExcess
        Arrays (h, w), in events.
    """
    events, runs = counts.events, counts.runs
    high, median = _ranked(events, _MIDDLE)
    borne_out = np.minimum(runs, _ranked(runs, _THIRD)[0])
    swings = np.minimum(runs, borne_out.max(initial=0.0)).astype(np.float64)
    # error^2 = high + (high - median)^2 + swings + 1: Poisson variances of the third largest and of the swings, the
    # scatter of the neighbours, and one event.
    error = np.sqrt(high + (high - median) ** 2 + swings + 1.0)
    return NeighbourExcess(events - high, swings, error, median)


def _ranked(counts: Int64, depth: int) -> tuple[Float64, Float64]:
    """Return the third and the ``depth``-th largest count (h, w) of the neighbours; borders mirror the image."""
    third, deepest = np.empty((2, *counts.shape), np.int32)
    rank_neighbours(np.pad(counts.astype(np.int32), _RING, mode="reflect"), third, deepest, depth)
    return third.astype(np.float64), deepest.astype(np.float64)


@njit(cache=True)
def rank_neighbours(around: Int32, third: Int32, deepest: Int32, depth: int) -> None:
    """Find the third largest and the ``depth``-th largest count of the 24 neighbours of every pixel.

    Parameters
    ----------
    around
        (h + 4, w + 4) counts, with two more pixels on each side.
    third, deepest
        (h, w) receive the third largest and the ``depth``-th largest count.
    depth
        Rank, counted from the largest; 3 at least.
    """
    # For a row of pixels at a time: each neighbour is inserted among the largest so far, which are in order.
    height, width = third.shape
    largest, passed_on = np.empty((depth, width), np.int32), np.empty(width, np.int32)
    for row in range(height):
        largest[:] = np.iinfo(np.int32).min
        for down in range(2 * _RING + 1):
            for right in range(2 * _RING + 1):
                if down == _RING and right == _RING:
                    continue
                for i in range(width):
                    passed_on[i] = around[row + down, right + i]
                for place in range(depth):
                    _pass_on(largest[place], passed_on)
        for i in range(width):
            third[row, i], deepest[row, i] = largest[2, i], largest[depth - 1, i]


@njit(cache=True)
def _pass_on(largest: Int32, passed_on: Int32) -> None:
    """Keep the larger of two rows (w,), element by element, and pass the smaller one on."""
    for column in range(len(largest)):
        kept, other = largest[column], passed_on[column]
        largest[column], passed_on[column] = max(kept, other), min(kept, other)

"""How frames and events change together over time, by tiles of the image: moments of each interval between frames.

Moments are sums of 1, d, e, d d, e e and d e over blocks of pixels, with the change d of the frames and the change e
that follows from the events in between (``orientation``). d - e is 0 but for what a pixel has not yet fired for.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

UNRELATED: Final = 0.3
"""Largest correlation of unrelated changes, relative to the median: those of another scene scatter about 0 by a tenth
or so."""

_PRESENT: Final = 0.1
"""Least sum of squares of the events' changes, relative to the median, for events to be there at all."""

FEWEST_INTERVALS: Final = 3
"""Least number of successive intervals for a while: two lie beside one wrong frame."""

_BY_CHANCE: Final = 1e-3
"""Largest probability that a tile has no event in so many successive intervals by chance, of all runs of all tiles."""

_DUE: Final = 30.0
"""Least number of events that are due in an interval while a tile has none: of half as many none comes with the
probability 3e-7. Fewer may all be due later, as changes within a threshold add up first."""

_QUIETEST: Final = 4
"""The tiles with the fewest events, as one in so many."""

_AS_MUCH: Final = 0.5
"""Least ratio of the common change in the quietest tiles to that of all: events that are lost leave a change in
proportion to the events."""


def longest_unrelated(dd: Float64, ee: Float64, de: Float64) -> int:
    """Return the length of the longest run of intervals in which frames and events change without correlation.

    Parameters
    ----------
    dd, ee, de
        (n,) sums of squares of the frames' change d and of the events' change e, and of d e, in the order of time.

    Returns
    -------
    int
        0 where most intervals have no correlation, so that none stands out.
    """
    if not len(dd):
        return 0
    correlations = de / np.sqrt(np.maximum(dd * ee, 1e-300))
    usual = float(np.median(correlations))
    # Without events nothing is unrelated: they are missing.
    are_there = (dd > 0) & (ee > _PRESENT * float(np.median(ee)))
    return _longest_run((np.abs(correlations) < UNRELATED * usual) & are_there)[1] if usual > 0 else 0


def common_change(moments: Float64) -> float:
    """Return the largest change of all tiles together that their events do not contain; 0 where tiles differ.

    Light that changes makes events. Frames that change as a whole without any were exposed otherwise, and then tiles
    with few events change as much as those with many.

    Parameters
    ----------
    moments
        (k, t, 6) of k intervals and t tiles.

    Returns
    -------
    float
        Change since the first frame, in units of the signal.
    """
    usable = moments[:, moments[..., 0].sum(axis=0) > 0]
    if not usable.size:
        return 0.0
    counts, d, e, _, ee, _ = np.moveaxis(usable, -1, 0)
    since_start = np.cumsum((d - e) / np.maximum(counts, 1.0), axis=0)
    middle = np.median(since_start, axis=1)
    largest = int(np.argmax(np.abs(middle)))
    by_tile, change = since_start[largest], float(middle[largest])
    quietest = np.argsort(ee.sum(axis=0) / counts.sum(axis=0))[: max(len(by_tile) // _QUIETEST, 1)]
    is_common = np.all(by_tile * change > 0) and abs(float(np.median(by_tile[quietest]))) > _AS_MUCH * abs(change)
    return change if is_common else 0.0


def silent_tiles(moments: Float64) -> Bool:
    """Return the tiles that have no event for a while in which they change as usual, and others have events.

    Parameters
    ----------
    moments
        (k, t, 6) of k intervals and t tiles.

    Returns
    -------
    ndarray of bool
        (t,) none where events are missing everywhere, or nowhere.
    """
    intervals, tiles = moments.shape[:2]
    silent = np.zeros(tiles, np.bool_)
    changes, of_events, products = np.moveaxis(moments[..., 3:], -1, 0)
    fires = of_events > 0
    if not fires.any():
        return silent
    # The square of a single event in a block is the least there is.
    of_one = float(of_events[fires].min())
    runs = [_longest_run(~fires[:, tile]) for tile in range(tiles)]
    for tile, (first, length) in enumerate(runs):
        beside = np.ones(intervals, np.bool_)
        beside[first : first + length] = False
        if length < FEWEST_INTERVALS or not np.any(beside):
            continue
        # Intervals without events are rarer beside the run: of k runs of n intervals that are as rare, one occurs with
        # the probability k p^n.
        is_chance = intervals * tiles * float(np.mean(~fires[beside, tile])) ** length > _BY_CHANCE
        # Beside the run events follow the changes of the frames, with the square of the correlation of their squares;
        # those of noise and of another sequence do not.
        of_frames, all_events = changes[beside, tile].sum(), of_events[beside, tile].sum()
        explained = products[beside, tile].sum() ** 2 / max(of_frames * all_events, 1e-300)
        ratio = explained * all_events / max(of_frames, 1e-300)
        is_due = ratio * float(np.median(changes[~beside, tile])) > _DUE * of_one
        silent[tile] = is_due and not is_chance
    if not silent.any():
        return silent
    # The time that most silent tiles share.
    covered = np.zeros(intervals, np.int64)
    for tile in np.flatnonzero(silent).tolist():
        begin, length = runs[tile]
        covered[begin : begin + length] += 1
    together = covered > np.count_nonzero(silent) / 2
    if np.count_nonzero(together) < FEWEST_INTERVALS:
        return np.zeros(tiles, np.bool_)
    live = ~silent & (fires[together].mean(axis=0) > 1 / 2)
    return silent if live.any() else np.zeros(tiles, np.bool_)


def _longest_run(marked: Bool) -> tuple[int, int]:
    """Return the first of the longest run of marked intervals, and its length."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], marked, [False])).astype(np.int8)))
    firsts, lengths = edges[::2], edges[1::2] - edges[::2]
    if not len(lengths):
        return 0, 0
    longest = int(np.argmax(lengths))
    return int(firsts[longest]), int(lengths[longest])

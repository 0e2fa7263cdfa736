"""Conservation of events of a sensor whose reference is the last value (model ``linear``).

While a pixel gives no event, its value stays within [ref - C-, ref + C+]. Over a run without events it therefore varies
by at most C+ + C-. Each brighter event raises the reference by at least C+ + 1, because thresholds are strict and
values whole. P brighter events without a darker one between two frames therefore raise the value by at least
P (C+ + 1) - C+ - C-. There is no upper bound: one event can come from a step of any size. Where the first reference is
the value at the first frame, the first run stays within the thresholds around that value.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Bool = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class EventFreeRuns:
    """Runs without events of every pixel over consecutive frames.

    Attributes
    ----------
    first_frame, last_frame
        Numbers of the first and the last frame, both included.
    head, tail
        (2, h, w) largest lower and smallest upper bound of the value, DN, in the first run and in the last run.
    quiet
        (h, w) True where there is no event: head and tail are one run.
    broken
        (h, w) True where a law was violated within the frames.
    limit
        C+ + C-: the largest variation of the value in a run, DN.
    start
        (2, h, w) lower and upper bound of the value at the first frame, DN.
    """

    first_frame: int
    last_frame: int
    head: Float64
    tail: Float64
    quiet: Bool
    broken: Bool
    limit: float
    start: Float64

    def departure(self, threshold_on: float, threshold_off: float) -> Float64:
        """Return the least distance of the first run beyond the thresholds around its start.

        Parameters
        ----------
        threshold_on, threshold_off
            C+ and C-, DN, both positive.

        Returns
        -------
        Float64
            (h, w) in DN; negative where the run may stay within the thresholds.
        """
        rise = self.head[0] - self.start[1] - threshold_on
        fall = self.start[0] - self.head[1] - threshold_off
        farthest: Float64 = np.maximum(rise, fall)
        return farthest

    def excess(self) -> Float64:
        """Return the least variation (h, w) of the value in the first run, DN; negative where it may be constant."""
        variation: Float64 = self.head[0] - self.head[1]
        return variation

    def then(self, later: "EventFreeRuns") -> "EventFreeRuns":
        """Join with the runs that begin at the last frame of these. The result is exact, hence associative."""
        # The last run of the earlier frames and the first run of the later ones are one run.
        across = _tighter(self.tail, later.head)
        return EventFreeRuns(
            self.first_frame,
            later.last_frame,
            np.where(self.quiet, across, self.head),
            np.where(later.quiet, across, later.tail),
            self.quiet & later.quiet,
            self.broken | later.broken | (across[0] - across[1] > self.limit),
            self.limit,
            self.start,
        )


def follow_runs(
    lower: Float64,
    upper: Float64,
    counts: NDArray[np.int32],
    *,
    threshold_on: float,
    threshold_off: float,
    spread: float = 0.0,
    frames: NDArray[np.int64],
) -> EventFreeRuns:
    """Return the runs over consecutive frames.

    Parameters
    ----------
    lower, upper
        (n, h, w) bounds of the value at each frame, DN; infinite where the value is not known.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    threshold_on, threshold_off
        C+ and C-, DN, both positive.
    spread
        Largest deviation of a pixel's thresholds from C+ and C-, DN.
    frames
        (n,) numbers of the frames.

    Returns
    -------
    EventFreeRuns
        Of each pixel (h, w), from the first frame to the last.
    """
    # A value within [ref - C-, ref + C+] varies by at most C+ + C-.
    limit = threshold_on + threshold_off + 2 * spread
    quiet = np.ones(lower.shape[1:], np.bool_)
    bounds = np.stack([lower, upper], axis=1)
    numbers = frames.tolist()
    runs = EventFreeRuns(numbers[0], numbers[0], bounds[0], bounds[0], quiet, ~quiet, limit, bounds[0])
    for i in range(len(counts)):
        off, on = counts[i]
        silent = (on == 0) & (off == 0)
        step = _tighter(bounds[i], bounds[i + 1])
        rise, fall = bounds[i + 1, 1] - bounds[i, 0], bounds[i, 1] - bounds[i + 1, 0]
        # A run without events varies by at most C+ + C-; P events of one sign by at least P (C + 1) - C+ - C-.
        broken = silent & (step[0] - step[1] > limit)
        broken |= (on > 0) & (off == 0) & (rise < on * (threshold_on - spread + 1) - limit)
        broken |= (off > 0) & (on == 0) & (fall < off * (threshold_off - spread + 1) - limit)
        # With events between two frames, each of the two frames bounds a different run.
        head, tail = np.where(silent, step, bounds[i]), np.where(silent, step, bounds[i + 1])
        runs = runs.then(EventFreeRuns(numbers[i], numbers[i + 1], head, tail, silent, broken, limit, bounds[i]))
    return runs


def _tighter(earlier: Float64, later: Float64) -> Float64:
    """Return the tighter of two pairs of bounds (2, h, w): the larger lower and the smaller upper one."""
    return np.stack([np.maximum(earlier[0], later[0]), np.minimum(earlier[1], later[1])])

"""Change of the level of each pixel between two frames, from the events before and after each frame.

At the time of an event the level is known: it equals the reference that the sensor then keeps. Between two events it is
not, and a sum of events ends with the last one. The level that this sum stands for lags behind the true one, in the
direction of the motion.

The level at a frame follows from the last event before it and the first event after it. Let f be the share of the time
between both that has passed, U the threshold of the polarity of the last event and D that of the next one.

- *Same polarity*: the level passes from 0 to D, and the straight line f D is its mean.
- *Other polarity*: the level first rises by o further (the excursion; "falls" where the last event was a darker one),
  and then returns by o + D. No event bounds o but 0 <= o < U. At constant speed the path has the length 2 o + D, and
  the level is min(p, 2 o - p), p = f (2 o + D).
  Levels are uniform relative to thresholds, so that o is uniform. The mean over o is::

      f (U + D) - f D r / U      where r = f D / (1 - 2 f) < U and f < 1/2
      U (1 - f) - f D            elsewhere

  With r the least o at which the level still rises. The line, -f D, leaves the excursion out (o = 0). The mean
  excursion lies between 0 and twice U / 2, so that the distance between both bounds what another distribution of o
  changes, to first order.

Where there are no events before a frame, or none after it, the reference stands for the level. It lags. To leave such
pixels out selects those that fire again soon, in which the motion leads to an error of the opposite sign.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.pixels import PixelEvents

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class LevelChanges:
    """Changes of the level between two frames.

    Attributes
    ----------
    mean
        (h, w) mean change over the excursions of the level between events, in the unit of the thresholds.
    line
        (h, w) change without excursions.
    is_known
        (h, w) True where there are events before and after both frames; elsewhere the reference stands for the level at
        one of them, or at both.
    """

    mean: Float64
    line: Float64
    is_known: Bool


def level_changes(
    events: PixelEvents, shape: tuple[int, int], frame_times_ns: tuple[int, int], thresholds: tuple[float, float]
) -> LevelChanges:
    """Return the changes of the level between two frames.

    Parameters
    ----------
    events
        Events by pixel, also some before the first frame and some after the second one.
    shape
        Rows and columns of the sensor.
    frame_times_ns
        Times of the earlier and of the later frame, ns.
    thresholds
        Change of the level by a darker and by a brighter event, both positive.

    Returns
    -------
    LevelChanges
        In the unit of the thresholds.
    """
    mean, line = np.zeros(shape[0] * shape[1]), np.zeros(shape[0] * shape[1])
    is_known = np.zeros(len(mean), np.bool_)
    write_level_changes(events.starts, events.timestamped, frame_times_ns, thresholds, mean, line, is_known)
    return LevelChanges(mean.reshape(shape), line.reshape(shape), is_known.reshape(shape))


@njit(cache=True)
def mean_level(share: float, turned: bool, last: float, following: float) -> float:
    """Return the mean level between two events, relative to that at the first of them.

    Parameters
    ----------
    share
        Share of the time between both events that has passed, 0 to 1.
    turned
        Whether their polarities differ.
    last, following
        Thresholds of the polarities of the first and of the second event, both positive.

    Returns
    -------
    float
        Positive in the direction of the first event.
    """
    if not turned:
        return share * following
    # r = f D / (1 - 2 f), the least excursion at which the level still rises.
    if share < 0.5 and share * following < last * (1 - 2 * share):
        least = share * following / (1 - 2 * share)
        return share * (last + following) - share * following * least / last
    return last * (1 - share) - share * following


@njit(cache=True)
def write_level_changes(
    starts: Int32,
    timestamped: Int64,
    frame_times: tuple[int, int],
    thresholds: tuple[float, float],
    mean: Float64,
    line: Float64,
    is_known: Bool,
) -> None:
    """Write the fields of ``LevelChanges`` for h * w pixels.

    Parameters
    ----------
    starts, timestamped
        (h * w + 1,) and (m,) events by pixel, as in ``PixelEvents``.
    frame_times
        Times of the earlier and of the later frame, ns.
    thresholds
        Change of the level by a darker and by a brighter event, both positive.
    mean, line, is_known
        (h * w,) receive the changes and where they are known.
    """
    for pixel in range(len(mean)):
        begin, stop = np.int64(starts[pixel]), np.int64(starts[pixel + 1])
        # The first event after each frame; 2 t + p > 2 frame + 1 exactly if t > frame, for both polarities.
        after = begin
        while after < stop and timestamped[after] <= 2 * frame_times[0] + 1:
            after += 1
        after_later, level = after, 0.0
        while after_later < stop and timestamped[after_later] <= 2 * frame_times[1] + 1:
            level += thresholds[1] if timestamped[after_later] & 1 else -thresholds[0]
            after_later += 1
        mean_change, line_change = level, level
        for i, frame, sign in ((after, frame_times[0], -1.0), (after_later, frame_times[1], 1.0)):
            if not begin < i < stop:
                continue
            last, following = timestamped[i - 1], timestamped[i]
            share = (frame - (last >> 1)) / ((following >> 1) - (last >> 1))
            turned = (last & 1) != (following & 1)
            direction = 1.0 if last & 1 else -1.0
            threshold = thresholds[following & 1]
            mean_change += sign * direction * mean_level(share, turned, thresholds[last & 1], threshold)
            line_change += sign * direction * share * (-threshold if turned else threshold)
        mean[pixel], line[pixel] = mean_change, line_change
        is_known[pixel] = after != begin and after_later != stop

"""Silences of the whole sensor, and their probability by the rate of events around them.

A silence is compared with the counts in bins of the same length beside it. If the rate of a stream itself fluctuates,
the counts follow a gamma-Poisson distribution. With mean m and a relative variance 1/r of the rate, the probability of
an empty bin is (1 + m / r)^-r (Greenwood and Yule 1920). The bins give 1/r: the variance of the rate between bins plus
the variance of their mean. If motion stops and starts again, the bins beside the silence are empty or uneven as well,
so that the silence is probable. A lost packet does not change the bins beside it.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri_exp

Int64 = NDArray[np.int64]

BINS: Final = 16
"""Number of bins on each side of a silence."""
# Least number of bins of a side that is used.
_FEWEST_BINS: Final = 4
_LONGEST: Final = 32
"""Largest number of silences of a segment that are examined; they are the longest ones."""


@dataclass(frozen=True, slots=True)
class EventSilence:
    """A segment of time without events.

    Attributes
    ----------
    start_ns, stop_ns
        Timestamps of the last event before the segment and of the first event after it, ns from the origin.
    length_ns
        Time that is certainly empty, ns: the distance of the timestamps less one tick.
    expected
        Number of events expected in this time by the rate of the bins beside it.
    z
        Deviate of a standard normal distribution with the same tail probability; 0 at least.
    """

    start_ns: int
    stop_ns: int
    length_ns: int
    expected: float
    z: float


def least_probable_silence(
    times_ns: Int64, start_ns: int, stop_ns: int, tick_ns: int, begins_ns: int | None = None
) -> tuple[EventSilence | None, int]:
    """Return the least probable silence that ends in [start, stop), and the number of silences that end there.

    Parameters
    ----------
    times_ns
        (n,) sorted timestamps of events, ns: all events between the ends, and events beyond both ends for the bins.
    start_ns, stop_ns
        Half-open interval in which the silences end, ns.
    tick_ns
        Step of the timestamps, ns.
    begins_ns
        Timestamp of the first event of the file, ns; None where it has no effect. At the beginning all pixels are at
        their references and fire little. A silence counts only where at least ``_FEWEST_BINS`` of its lengths lie
        between the first event and the silence.

    Returns
    -------
    silence
        None where no silence has enough bins beside it.
    count
        Number of distances between successive different timestamps.
    """
    longest_ns, ends_ns = np.zeros(_LONGEST, np.int64), np.zeros(_LONGEST, np.int64)
    first, stop = np.searchsorted(times_ns, [start_ns, stop_ns])
    count, silences = longest_silences(times_ns[max(first - 1, 0) : stop], start_ns, stop_ns, longest_ns, ends_ns)
    from_ns, upto_ns = start_ns, stop_ns
    if len(times_ns):
        # Events are complete between the ends, and beyond them as far as ``times_ns`` extends.
        from_ns, upto_ns = min(start_ns, int(times_ns[0])), max(stop_ns, int(times_ns[-1]))
    # An event lies within the tick before its timestamp: between timestamps one tick apart no time is certainly empty.
    informative = longest_ns[:count] > tick_ns
    if begins_ns is not None:
        informative &= ends_ns[:count] - longest_ns[:count] - _FEWEST_BINS * (longest_ns[:count] - tick_ns) >= begins_ns
    after_ns, before_ns = ends_ns[:count][informative], (ends_ns - longest_ns)[:count][informative]
    # Bins of the length of each silence, on its left and on its right, (2, k, bins).
    steps_ns = np.arange(BINS + 1) * (after_ns - before_ns - tick_ns)[:, np.newaxis]
    left_ns, right_ns = before_ns[:, np.newaxis] - steps_ns[:, ::-1], after_ns[:, np.newaxis] - tick_ns + steps_ns
    counts = np.diff(np.searchsorted(times_ns, np.stack([left_ns, right_ns]), side="right"))
    inside = np.stack([left_ns[:, :-1] >= from_ns, right_ns[:, 1:] <= upto_ns])
    bins = inside.sum(axis=2)
    means = (counts * inside).sum(axis=2) / np.maximum(bins, 1)
    variances = ((counts - means[..., np.newaxis]) ** 2 * inside).sum(axis=2) / np.maximum(bins - 1, 1)
    # The variance is at least that of Poisson, m: a smaller one by chance would give the rate a negative variance.
    positive = means > 0
    mean, variance = np.where(positive, means, 1.0), np.where(positive, np.maximum(variances, means), 1.0)
    # 1/r = (v - m + v / bins) / m^2: variance of the rate between bins, without that of Poisson, plus that of the mean.
    uncertainty = (variance - mean + variance / np.maximum(bins, 1)) / mean**2
    # log P(empty bin) = -r log(1 + m / r) (Greenwood and Yule 1920).
    log_chances = np.where(positive, -np.log1p(mean * uncertainty) / uncertainty, 0.0)
    log_chances = np.where(bins >= _FEWEST_BINS, log_chances, -np.inf)
    # The side by which the silence is more probable counts; -inf where neither side has enough bins.
    likeliest, sides = np.argmax(log_chances, axis=0), np.arange(len(before_ns))
    chance, expected = log_chances[likeliest, sides], means[likeliest, sides]
    z = np.where(np.isfinite(chance), np.maximum(-ndtri_exp(chance), 0.0), -np.inf)
    if not np.isfinite(z).any():
        return None, silences
    worst = int(np.argmax(z))
    start, stop = int(before_ns[worst]), int(after_ns[worst])
    return EventSilence(start, stop, stop - start - tick_ns, float(expected[worst]), float(z[worst])), silences


@njit(cache=True)
def longest_silences(t: Int64, start: int, stop: int, lengths: Int64, ends: Int64) -> tuple[int, int]:
    """Find the longest distances between successive timestamps whose later timestamp lies in [start, stop).

    Parameters
    ----------
    t
        (n,) sorted timestamps, ns.
    start, stop
        Half-open interval, ns.
    lengths, ends
        (m,) receive the distances, longest first, and the later timestamps, ns. Of equal distances the earlier comes
        first.

    Returns
    -------
    tuple[int, int]
        Number of distances that were written, and number of all distances above 0.
    """
    count, silences = 0, 0
    for i in range(1, len(t)):
        length = t[i] - t[i - 1]
        if length <= 0 or t[i] < start or t[i] >= stop:
            continue
        silences += 1
        if count == len(lengths) and length <= lengths[count - 1]:
            continue
        count = min(count + 1, len(lengths))
        # Insertion sort: shorter distances move back by one place, and the shortest one is dropped.
        place = count - 1
        while place > 0 and lengths[place - 1] < length:
            lengths[place], ends[place] = lengths[place - 1], ends[place - 1]
            place -= 1
        lengths[place], ends[place] = length, t[i]
    return count, silences

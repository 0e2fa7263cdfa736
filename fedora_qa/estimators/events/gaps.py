"""Whether a silence of the whole sensor is one that its own neighbourhood makes possible.

A silence of length w is compared with the counts in bins of the same length beside it. Bins of a stream whose rate
itself fluctuates hold gamma-Poisson counts; with mean m and a rate known to the relative variance 1/r, the chance of an
empty bin is (1 + m / r)^-r (Greenwood and Yule 1920). r comes from the bins: the variance of the rate from bin to bin
plus that of their mean. Motion that stops and starts again empties the bins beside the silence as well, or makes them
uneven, and so excuses it; a packet that was lost does neither.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri_exp

Int64 = NDArray[np.int64]

_BINS: Final = 16
"""Bins on each side."""
_FEWEST_BINS: Final = 4
_LONGEST: Final = 32
"""Silences of a segment that are examined, longest first."""


@dataclass(frozen=True, slots=True)
class EventSilence:
    """A segment of time without events.

    Attributes
    ----------
    start_ns, stop_ns
        The timestamps of the events on both sides.
    length_ns
        Time that is surely empty: the distance of the timestamps less one tick.
    expected
        Events expected there by the rate of the neighbourhood.
    z
        Deviate of a standard normal distribution of the same tail probability.
    """

    start_ns: int
    stop_ns: int
    length_ns: int
    expected: float
    z: float


def least_probable_silence(
    times_ns: Int64, start_ns: int, stop_ns: int, tick_ns: int, begins_ns: int | None = None
) -> tuple[EventSilence | None, int]:
    """Return the most improbable silence that ends in [start, stop), and how many silences end there.

    Parameters
    ----------
    times_ns
        (n,) sorted; reaches beyond both ends, so that neighbours are measured. Between the ends it is complete.
    start_ns, stop_ns
        Half-open interval in which the silences end.
    tick_ns
        Step of the timestamps.
    begins_ns
        First event of the file; None where it has no effect. All references are reached at first: a silence so
        soon after it that fewer than ``_FEWEST_BINS`` of its lengths lie before it may be of a sensor that begins to
        fire.

    Returns
    -------
    silence
        None where no silence has a neighbourhood.
    count
        Of distances between different timestamps.
    """
    longest_ns, ends_ns = np.zeros(_LONGEST, np.int64), np.zeros(_LONGEST, np.int64)
    first, stop = np.searchsorted(times_ns, [start_ns, stop_ns])
    count, silences = longest_silences(times_ns[max(first - 1, 0) : stop], start_ns, stop_ns, longest_ns, ends_ns)
    from_ns, upto_ns = start_ns, stop_ns
    if len(times_ns):
        # Between the ends the events are complete; beyond them only as far as ``times_ns`` reaches.
        from_ns, upto_ns = min(start_ns, int(times_ns[0])), max(stop_ns, int(times_ns[-1]))
    # An event lies within the tick before its timestamp: between timestamps a tick apart no time is surely empty.
    informative = longest_ns[:count] > tick_ns
    if begins_ns is not None:
        informative &= ends_ns[:count] - longest_ns[:count] - _FEWEST_BINS * (longest_ns[:count] - tick_ns) >= begins_ns
    after_ns, before_ns = ends_ns[:count][informative], (ends_ns - longest_ns)[:count][informative]
    # Bins of the length of each silence, on its left and on its right, (2, k, bins).
    steps_ns = np.arange(_BINS + 1) * (after_ns - before_ns - tick_ns)[:, np.newaxis]
    left_ns, right_ns = before_ns[:, np.newaxis] - steps_ns[:, ::-1], after_ns[:, np.newaxis] - tick_ns + steps_ns
    counts = np.diff(np.searchsorted(times_ns, np.stack([left_ns, right_ns]), side="right"))
    inside = np.stack([left_ns[:, :-1] >= from_ns, right_ns[:, 1:] <= upto_ns])
    bins = inside.sum(axis=2)
    means = (counts * inside).sum(axis=2) / np.maximum(bins, 1)
    variances = ((counts - means[..., np.newaxis]) ** 2 * inside).sum(axis=2) / np.maximum(bins - 1, 1)
    # The variance is at least Poisson's, m: a smaller one, by chance, would make that of the rate negative.
    positive = means > 0
    mean, variance = np.where(positive, means, 1.0), np.where(positive, np.maximum(variances, means), 1.0)
    # 1/r: variance of the rate from bin to bin, without Poisson's, plus that of the mean of the bins.
    uncertainty = (variance - mean + variance / np.maximum(bins, 1)) / mean**2
    # Chance that a bin beside such bins holds nothing: (1 + m / r)^-r, Greenwood and Yule 1920.
    log_chances = np.where(positive, -np.log1p(mean * uncertainty) / uncertainty, 0.0)
    log_chances = np.where(bins >= _FEWEST_BINS, log_chances, -np.inf)
    # The side that makes a silence more probable counts; none where no side lies inside the interval.
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
    """Write the longest distances of successive timestamps of which the later lies in [start, stop), longest first.

    Of equal ones the earlier. Return how many were written to ``lengths`` and ``ends`` (m,), the later timestamps, and
    how many there are; equal timestamps have no distance. All in ns.
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
        # Insertion sort: shorter ones move back by one place, and the shortest falls out.
        place = count - 1
        while place > 0 and lengths[place - 1] < length:
            lengths[place], ends[place] = lengths[place - 1], ends[place - 1]
            place -= 1
        lengths[place], ends[place] = length, t[i]
    return count, silences

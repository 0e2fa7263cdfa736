"""Whether a silence of the whole sensor is one that its own neighbourhood makes possible.

A silence of length w is held against the counts in bins of the same length beside it. Bins of a stream whose rate
itself fluctuates hold gamma-Poisson counts; with mean m and a rate known to the relative variance 1/r, the chance of an
empty bin is (1 + m / r)^-r (Greenwood and Yule 1920). r comes from the bins: the variance of the rate from bin to bin
plus that of their mean. Motion that stops and starts again empties the bins beside the silence as well, or makes them
uneven, and so excuses it; a packet that was lost does neither.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.estimators.events.timestamp_kernels import longest_silences

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

BINS: Final = 16
"""Bins on each side."""
FEWEST_BINS: Final = 4
_LONGEST: Final = 32
"""Silences of a stretch that are examined, longest first."""


@dataclass(frozen=True, slots=True)
class Silence:
    """A stretch without events.

    Attributes
    ----------
    start_ns, stop_ns
        The stamps of the events on both sides.
    length_ns
        Time that is surely empty: a tick less than the distance of the stamps.
    expected
        Events that the neighbourhood would have put there.
    z
        How improbable it is, as the deviate of a normal distribution.
    """

    start_ns: int
    stop_ns: int
    length_ns: int
    expected: float
    z: float


def strangest_silence(
    times_ns: Int64, start_ns: int, stop_ns: int, tick_ns: int, begins_ns: int | None = None
) -> tuple[Silence | None, int]:
    """Return the most improbable silence that ends in [start, stop), and how many silences end there.

    ``times_ns`` is sorted and reaches beyond both ends, so that neighbours are known. Between the ends all is known.
    ``begins_ns`` is the first event of the file: all references are reached at first, and a silence so soon after that
    it has less than ``FEWEST_BINS`` of its lengths before it is not told from a sensor that begins to fire.
    """
    longest_ns, ends_ns = np.zeros(_LONGEST, np.int64), np.zeros(_LONGEST, np.int64)
    first, stop = np.searchsorted(times_ns, [start_ns, stop_ns])
    count, silences = longest_silences(times_ns[max(first - 1, 0) : stop], start_ns, stop_ns, longest_ns, ends_ns)
    known = (min(start_ns, int(times_ns[0])), max(stop_ns, int(times_ns[-1]))) if len(times_ns) else (start_ns, stop_ns)
    told = longest_ns[:count] > tick_ns
    if begins_ns is not None:
        told &= ends_ns[:count] - longest_ns[:count] - FEWEST_BINS * (longest_ns[:count] - tick_ns) >= begins_ns
    after_ns, before_ns = ends_ns[:count][told], (ends_ns - longest_ns)[:count][told]
    z, expected = _examined(times_ns, known, before_ns, after_ns, tick_ns)
    if not np.isfinite(z).any():
        return None, silences
    worst = int(np.argmax(z))
    start, stop = int(before_ns[worst]), int(after_ns[worst])
    return Silence(start, stop, stop - start - tick_ns, float(expected[worst]), float(z[worst])), silences


def _examined(
    times_ns: Int64, known_ns: tuple[int, int], before_ns: Int64, after_ns: Int64, tick_ns: int
) -> tuple[Float64, Float64]:
    """Hold silences (k,) against both sides; return z (k,), -inf where neither is known, and the events due (k,).

    The side that makes a silence more probable counts.
    """
    steps_ns = np.arange(BINS + 1) * (after_ns - before_ns - tick_ns)[:, np.newaxis]
    left_ns, right_ns = before_ns[:, np.newaxis] - steps_ns[:, ::-1], after_ns[:, np.newaxis] - tick_ns + steps_ns
    counts = np.diff(np.searchsorted(times_ns, np.stack([left_ns, right_ns]), side="right"))
    known = np.stack([left_ns[:, :-1] >= known_ns[0], right_ns[:, 1:] <= known_ns[1]])
    bins = known.sum(axis=2)
    means = (counts * known).sum(axis=2) / np.maximum(bins, 1)
    squares = ((counts - means[..., np.newaxis]) ** 2 * known).sum(axis=2) / np.maximum(bins - 1, 1)
    chances = np.where(bins >= FEWEST_BINS, _log_chance_of_none(means, squares, bins), -np.inf)
    likeliest, sides = np.argmax(chances, axis=0), np.arange(len(before_ns))
    chance, expected = chances[likeliest, sides], means[likeliest, sides]
    return np.where(np.isfinite(chance), np.maximum(-ndtri_exp(chance), 0.0), -np.inf), expected


def _log_chance_of_none(means: Float64, variances: Float64, bins: Int64) -> Float64:
    """Return the logarithms of the chance that a bin beside such bins holds nothing."""
    some = means > 0
    mean, variance = np.where(some, means, 1.0), np.where(some, np.maximum(variances, means), 1.0)
    uncertainty = (variance - mean + variance / np.maximum(bins, 1)) / mean**2
    chances: Float64 = np.where(some, -np.log1p(mean * uncertainty) / uncertainty, 0.0)
    return chances

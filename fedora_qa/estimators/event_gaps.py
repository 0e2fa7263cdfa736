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

from fedora_qa.estimators.event_stamp_kernels import longest_silences

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
    count, silences = longest_silences(times_ns, start_ns, stop_ns, longest_ns, ends_ns)
    known = (min(start_ns, int(times_ns[0])), max(stop_ns, int(times_ns[-1]))) if len(times_ns) else (start_ns, stop_ns)
    found = [
        _examine(times_ns, known, after_ns - length_ns, after_ns, length_ns - tick_ns)
        for after_ns, length_ns in zip(ends_ns[:count].tolist(), longest_ns[:count].tolist(), strict=True)
        if length_ns > tick_ns
        and (begins_ns is None or after_ns - length_ns - FEWEST_BINS * (length_ns - tick_ns) >= begins_ns)
    ]
    told = [silence for silence in found if silence is not None]
    return max(told, key=lambda silence: silence.z, default=None), silences


def _examine(
    times_ns: Int64, known_ns: tuple[int, int], before_ns: int, after_ns: int, length_ns: int
) -> Silence | None:
    """Hold one silence against both sides; the side that makes it more probable counts."""
    tick_ns = after_ns - before_ns - length_ns
    steps = np.arange(BINS + 1) * length_ns
    left = before_ns - steps[::-1]
    right = after_ns - tick_ns + steps
    sides = [
        np.diff(np.searchsorted(times_ns, edges, side="right"))
        for edges in (left[left >= known_ns[0]], right[right <= known_ns[1]])
        if len(edges) > FEWEST_BINS
    ]
    if not sides:
        return None
    chances = [_log_chance_of_none(counts) for counts in sides]
    likeliest = int(np.argmax(chances))
    z = max(-float(ndtri_exp(chances[likeliest])), 0.0)
    return Silence(before_ns, after_ns, length_ns, float(sides[likeliest].mean()), z)


def _log_chance_of_none(counts: Int64) -> float:
    """Return the logarithm of the chance that a bin beside these holds nothing."""
    mean = float(counts.mean())
    if mean == 0.0:
        return 0.0
    variance = max(float(counts.var(ddof=1)), mean)
    uncertainty = (variance - mean + variance / len(counts)) / mean**2
    return float(-np.log1p(mean * uncertainty) / uncertainty)

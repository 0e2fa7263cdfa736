"""Histograms of values whose range is not known beforehand, counted exactly in any order.

Each octave is cut into 64 bins of equal width, which are the leading bits of a float32: its exponent and the first six
bits of its fraction. Such bins nest in wider bins of equal width, so that a histogram with at most 128 of those can be
made at the end without dividing a single count.
"""

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int64 = NDArray[np.int64]

_FRACTION_BITS: Final = 6
_LEAST_EXPONENT, _GREATEST_EXPONENT = -10, 20
_BINS: Final = ((_GREATEST_EXPONENT - _LEAST_EXPONENT + 1) << _FRACTION_BITS) + 1
_MOST_BINS: Final = 2 << _FRACTION_BITS
_FINE_PER_WIDE: Final = 4
_FLOAT32_FRACTION_BITS, _FLOAT32_BIAS = 23, 127
_OUTSIDE: Final = 1e-3
"""Largest share of the values beyond the histogram, so that a few large ones do not widen the bins of the rest."""


def no_values() -> Int64:
    """Return the counts (bins,) of no values."""
    return np.zeros(_BINS, np.int64)


def count_values(values: NDArray[Any]) -> Int64:
    """Count the finite values that are not negative; those below 2^-10 in the first bin, from 2^21 on in the last."""
    single_precision = np.array(values, dtype=np.float32, order="C").ravel() + np.float32(0)  # no minus zero
    first = (_FLOAT32_BIAS + _LEAST_EXPONENT) << _FRACTION_BITS
    counts = no_values()
    _count_bits(single_precision.view(np.int32), _FLOAT32_FRACTION_BITS - _FRACTION_BITS, first - 1, counts)
    return counts


@njit(cache=True)
def _count_bits(bits: NDArray[np.int32], shift: int, before: int, counts: Int64) -> None:
    """Count numbers of single precision by their leading bits; negative ones, infinity and NaN not at all."""
    infinity, last = np.int32(0x7F800000), len(counts) - 1
    for value in bits:
        # Floats that are not negative are ordered as their bits (IEEE 754). A set sign bit makes the integer negative;
        # NaN lies above infinity.
        if 0 <= value < infinity:
            counts[min(max((value >> shift) - before, 0), last)] += 1


def added(parts: Iterable[Int64]) -> Int64:
    """Return the sum of the counts of all parts."""
    total = no_values()
    for part in parts:
        total = total + part
    return total


def add_counts(total: dict[str, Int64], part: Mapping[str, Int64]) -> None:
    """Add the counts of each quantity to a total."""
    for quantity, counts in part.items():
        total[quantity] = total[quantity] + counts if quantity in total else counts


def histogram(counts: Int64) -> tuple[NDArray[np.float64], Int64, int]:
    """Return edges (b + 1,) of equal bins from 0 on, counts (b,), and the number of values beyond.

    The bins are as narrow as possible with at most 0.1% of the values beyond 128 bins.
    """
    total = int(counts.sum())
    starts = _bin_starts()
    for exponent in range(_LEAST_EXPONENT, _GREATEST_EXPONENT - _FRACTION_BITS + 1):
        width = 2.0**exponent
        within = starts < _MOST_BINS * width
        beyond = total - int(counts[within].sum())
        if beyond <= _OUTSIDE * total:
            break
    equal = np.zeros(_MOST_BINS, np.int64)
    np.add.at(equal, (starts[within] / width).astype(np.int64), counts[within])
    filled = np.flatnonzero(equal)
    bins = int(filled[-1]) + 1 if len(filled) else 1
    edges: NDArray[np.float64] = np.arange(bins + 1) * np.float64(width)
    return edges, equal[:bins], beyond


def octave_counts(counts: Int64) -> Int64:
    """Return counts (..., bins) in bins four times as wide: 16 of equal width an octave, between ``octave_edges``."""
    wider = counts[..., 1:].reshape(*counts.shape[:-1], -1, _FINE_PER_WIDE).sum(axis=-1)
    return np.concatenate([counts[..., :1], wider], axis=-1)


def octave_edges() -> NDArray[np.float64]:
    """Return the edges of the wide bins. The last edge is 2^21; the last bin also holds larger values."""
    starts = _bin_starts()
    return np.concatenate([starts[:1], starts[1::_FINE_PER_WIDE], [2.0 ** (_GREATEST_EXPONENT + 1)]])


def _bin_starts() -> NDArray[np.float64]:
    """Return where each fine bin begins."""
    exponents = np.arange(_LEAST_EXPONENT, _GREATEST_EXPONENT + 1)[:, None]
    fractions = 1 + np.arange(1 << _FRACTION_BITS) / (1 << _FRACTION_BITS)
    return np.concatenate([[0.0], (2.0**exponents * fractions).ravel()])

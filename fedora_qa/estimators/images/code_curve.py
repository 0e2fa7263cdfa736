"""A power law that was applied to values of 8 bits after they had been rounded.

``rint(255 (k / 255)^e)`` of the codes k omits codes where the curve is steep: in the dark for an exponent below 1, near
white for one above 1. Which codes are omitted depends on the exponent alone. In a histogram of many values, a code
without any value between frequent ones is no chance event, and that just the codes of one exponent are absent is less
likely still: of n codes, h or more of the m that an exponent omits are among the k absent ones with a hypergeometric
probability.
"""

from math import comb
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.images.gain import CODES
from fedora_qa.estimators.images.transfer import WHITE_DN

Bools = NDArray[np.bool_]
Float64 = NDArray[np.float64]

_FREQUENT: Final = 50
"""Least number of values of a code by those of its neighbours: it is then absent by chance once in e^50 (Poisson)."""

_FEWEST_CODES: Final = 40
_FEWEST_ABSENT: Final = 5
"""Least number of frequent codes, and of absent ones among them."""

_EXPONENTS: Final = np.geomspace(0.2, 5.0, 3001)
_FINE: Final = np.linspace(-1.0, 1.0, 201)
"""Exponents that are tried, in steps of 0.1%; then others within a step of the best, a hundredth of a step apart."""

_STEP: Final = float(_EXPONENTS[1] / _EXPONENTS[0] - 1)

_LEAST_AGREEMENT: Final = 0.95
"""Least share of the codes that are absent, or omitted, which are both: some codes are rarer than their neighbours."""

_CHANCE: Final = 1e-9
"""Largest probability of that agreement by chance, for all exponents that are tried together."""


def exponent_after_rounding(counts: NDArray[np.integer]) -> float | None:
    """Return the exponent of the power law through which values went after they had been rounded.

    Parameters
    ----------
    counts
        (256,) number of values of each code. The ends, 0 and 255, stay as they are under any exponent.

    Returns
    -------
    float or None
        None where the codes are those of no exponent.
    """
    values = np.asarray(counts, dtype=np.float64)
    occupied = np.flatnonzero(values)
    if len(occupied) < 2:
        return None
    codes = np.arange(CODES)
    above = np.clip(np.searchsorted(occupied, codes, "right"), 1, len(occupied) - 1)
    below_code, above_code = occupied[above - 1], occupied[above]
    # Between two occupied codes values are shared by all codes up to the upper one.
    shared = np.minimum(values[below_code], values[above_code]) / np.maximum(above_code - below_code, 1)
    inside = (codes > occupied[0]) & (codes < occupied[-1])
    absent = inside & (values == 0) & (shared >= _FREQUENT)
    compared = absent | (inside & (values >= _FREQUENT))
    if np.count_nonzero(compared) < _FEWEST_CODES or np.count_nonzero(absent) < _FEWEST_ABSENT:
        return None
    best = _likeliest(_EXPONENTS, absent, compared)
    best = _likeliest(best * (1 + _STEP * _FINE), absent, compared)
    omitted = _omitted(np.array([best]))[0] & compared
    both, either = np.count_nonzero(omitted & absent), np.count_nonzero(omitted | absent)
    if both < _LEAST_AGREEMENT * either:
        return None
    n, m, k = (int(np.count_nonzero(mask)) for mask in (compared, omitted, absent))
    # Hypergeometric: of the C(n, k) sets of k absent codes, those which share h codes or more with the m omitted ones.
    agreeing = sum(comb(m, h) * comb(n - m, k - h) for h in range(int(both), min(m, k) + 1))
    chance = agreeing / comb(n, k) * (len(_EXPONENTS) * len(_FINE))
    return best if chance < _CHANCE else None


def _likeliest(exponents: Float64, absent: Bools, compared: Bools) -> float:
    """Return the exponent (of n) whose omitted codes differ least from the absent ones, the middle of several."""
    differing = np.count_nonzero((_omitted(exponents) != absent) & compared, axis=1)
    least = np.flatnonzero(differing == differing.min())
    return float(exponents[least[len(least) // 2]])


def _omitted(exponents: Float64) -> Bools:
    """Return which codes (n, 256) no code reaches under each of the exponents (n,)."""
    reached = np.rint(WHITE_DN * (np.arange(CODES) / WHITE_DN) ** exponents[:, np.newaxis]).astype(np.intp)
    omitted = np.ones((len(exponents), CODES), dtype=np.bool_)
    omitted[np.arange(len(exponents))[:, np.newaxis], reached] = False
    return omitted

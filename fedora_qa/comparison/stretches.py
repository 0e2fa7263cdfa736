"""Cut a sequence into segments of time that can count as independent of each other.

Neighbouring frames of a flight are correlated, so that a thousand frames are not a thousand samples. The correlation
time is estimated, and the sequence is cut into segments several times as long (batch means: Law and Kelton, *Simulation
Modeling and Analysis*, 9.5.3).
"""

from itertools import pairwise
from math import sqrt
from typing import Final

import numpy as np

from fedora_qa.comparison.histograms import Float64, Int64, shares_of

_LENGTH: Final = 4.0
"""Length of a segment in correlation times. Where the correlation falls as exp(-t / T), whose correlation time is 2 T,
the means of neighbouring segments of length L are correlated by T / (2 (L - T)): by 0.07 for L = 8 T."""

_MOST: Final = 16
"""Longer segments are better than more of them: 16 against 16 can be relabelled in 6e8 ways."""

_QUARTILES: Final = (0.25, 0.5, 0.75)


def independent_stretches(counts: Int64) -> Int64:
    """Merge blocks of time into segments of 4 correlation times or more.

    Parameters
    ----------
    counts
        (b, n) counts in n bins of blocks in the order of time; blocks without any are left out.

    Returns
    -------
    Int64
        (s, n) counts of the segments, 16 at most.
    """
    counts = counts[counts.sum(axis=1) > 0]
    number = max(1, min(_MOST, int(len(counts) / (_LENGTH * correlation_time(counts)))))
    edges = np.linspace(0, len(counts), number + 1).round().astype(int)
    return np.stack([counts[start:stop].sum(axis=0) for start, stop in pairwise(edges)])


def correlation_time(counts: Int64) -> float:
    """Return the correlation time of blocks (b, n), in blocks: 1 or a little more for independent ones.

    It is the sum of the correlations at all lags. Its standard error is added, because a short sequence underestimates
    slow changes. Of three series, the shares of values below each quartile of all, the longest time counts.
    """
    if len(counts) < 2:
        return 1.0
    below = np.cumsum(shares_of(counts.sum(axis=0)))
    places = np.minimum(np.searchsorted(below, _QUARTILES), len(below) - 1)
    # One series for each quartile: the share of a block's values that lie below it.
    series = np.cumsum(shares_of(counts), axis=1)[:, places]
    return max(_summed_correlations(series[:, k]) for k in range(len(places)))


def _summed_correlations(series: Float64) -> float:
    """Sum the correlations at all lags up to where their pairs stop being positive (Geyer 1992), and add the error.

    Summed up to lag M of N samples, the relative error is sqrt(2 (2 M + 1) / N) (Sokal 1989, *Monte Carlo methods in
    statistical mechanics*, 3.19).
    """
    centred = series - series.mean()
    count = len(centred)
    # N times the autocovariances at the lags 0 to N - 1.
    products = np.correlate(centred, centred, "full")[count - 1 :]
    # Shares lie between 0 and 1: a variance below (1e-12)^2 is the rounding of a constant series.
    if not products[0] > 1e-24 * count:
        return 1.0
    correlations = products / products[0]
    # 1 + 2 (rho_1 + rho_2 + ...) = -1 + 2 (sum over pairs of lags 2 j, 2 j + 1), because rho_0 = 1.
    total, last = -1.0, 0
    for lag in range(0, count - 1, 2):
        pair = float(correlations[lag] + correlations[lag + 1])
        if pair <= 0:
            break
        total, last = total + 2 * pair, lag + 1
    # Relative error sqrt(2 (2 M + 1) / N) of Sokal 1989, 3.19 (docstring), with M = last.
    return max(total, 1.0) * (1 + sqrt(2 * (2 * last + 1) / count))

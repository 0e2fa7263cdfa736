"""White noise of the samples of a smooth motion, from divided differences of neighbours.

What remains of the motion is bounded: a filter of a lower degree passes more of it, and the difference of the two is
the bound.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import comb, hypot, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.imu.sampled_curves import SampledCurve, VectorSamples, divided_differences

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

_MOST_BLOCKS: Final = 200
"""Blocks of differences between which a part with other noise begins and ends: 20,000 parts."""

_FEWEST_BLOCKS: Final = 3
"""A part, and what lies beside it, of a block each at least."""

_SIGMAS: Final = 5.0
"""Standard errors by which noise at a distance exceeds that of neighbours where it is not white: of a few distances in
a million files white noise exceeds them once."""

_QUANTILE: Final = 0.9

_QUANTILE_SIGMAS: Final = 1.644854

_MEDIAN_SIGMAS: Final = 0.674490
"""Quantile of absolute differences that gives sigma, and its value for unit normal noise. Jumps in one tenth of the
differences move the estimate little."""

_QUANTILE_COST: Final = 1.25
"""Ratio of the standard errors of sigma from this quantile and from the mean square, for normal values."""


@dataclass(frozen=True, slots=True)
class NoiseLevel:
    """Standard deviation of white noise on each axis of each sample.

    Attributes
    ----------
    sigma, standard_error
        As measured, and its standard error for white noise, in the unit of the curve.
    motion
        Part of sigma that the motion may have added, in the same unit.
    count
        Number of differences that sigma is estimated from, of three axes each.
    """

    sigma: float
    standard_error: float
    motion: float
    count: int


@dataclass(frozen=True, slots=True)
class NoisyPart:
    """Rows of samples whose noise is larger than that of all others.

    Attributes
    ----------
    rows
        First row, and the one behind the last; None: to the end.
    ratio
        Noise of these rows over that of the others.
    """

    rows: tuple[int, int | None]
    ratio: float


def noise_level(times_ns: Int64, curve: SampledCurve, *, order: int) -> NoiseLevel | None:
    """Return the standard deviation of white noise, from divided differences scaled to unit noise gain.

    Sigma comes from the 90% quantile, so that a few jumps do not raise it. The part of the motion is the decrease of
    sigma when the order rises by two.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.
    order
        Of the differences; those of a polynomial of lower degree are zero.

    Returns
    -------
    NoiseLevel or None
        In the unit of the curve; None where there are too few samples.
    """
    differences = divided_differences(times_ns, curve, order)
    higher = divided_differences(times_ns, curve, order + 2)
    if len(differences) < order or len(higher) < order:
        return None
    sigma = _sigma(differences)
    # Neighbouring differences are correlated. For even timestamps and the order d, the variance of their mean square is
    # sum_j (C(2d, d + j) / C(2d, d))^2 = C(4d, 2d) / C(2d, d)^2 times that of independent ones (Vandermonde's
    # identity).
    correlation = comb(4 * order, 2 * order) / comb(2 * order, order) ** 2
    return NoiseLevel(
        sigma=sigma,
        standard_error=sigma * _QUANTILE_COST * float(np.sqrt(correlation / (2 * differences.size))),
        motion=max(0.0, sigma - _sigma(higher)),
        count=len(differences),
    )


def noise_evenness(times_ns: Int64, curve: SampledCurve, *, order: int) -> float:
    """Return the standard deviation of noise by the median of differences over that by their 90% quantile.

    It is 1 for white normal noise, and near 0 where what disturbs the samples does so at times, as jumps do. Samples
    before the first disturbance and behind the last are left out: noise may begin and end.

    Parameters
    ----------
    times_ns, curve, order
        As of ``noise_level``.

    Returns
    -------
    float
        0 to about 1; 1 where there are too few samples, or where nothing is left of them.
    """
    differences = divided_differences(times_ns, curve, order)
    of_tenth = _sigma(differences)
    disturbed = np.flatnonzero(np.abs(differences).max(axis=-1, initial=0.0) > of_tenth)
    if len(differences) < order or not of_tenth > 0 or not len(disturbed):
        return 1.0
    between = np.abs(differences[disturbed[0] : disturbed[-1] + 1])
    return float(np.median(between)) / _MEDIAN_SIGMAS / of_tenth


def slow_noise(
    times_ns: Int64, curve_of: Callable[[slice], SampledCurve], *, order: int, declared: float
) -> float | None:
    """Return the noise of samples far apart, where that of neighbours is smaller: it has passed a filter.

    White noise is the same for every sample as for every n-th one. A mean over n samples takes the fast noise, and
    leaves ``1 / sqrt(n)`` of each sample, which every n-th one shows.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve_of
        The samples of some rows.
    order
        Of the differences, as of ``noise_level``.
    declared
        Standard deviation of the noise before the filter.

    Returns
    -------
    float or None
        At the largest distance at which it exceeds that of neighbours, in the unit of the curve; None where noise is
        white, or less at every distance than half of what a mean over it leaves of the declared one.
    """
    of_all = noise_level(times_ns, curve_of(slice(None)), order=order)
    if of_all is None or not of_all.sigma > 0:
        return None
    relative_error, far_apart, stride = of_all.standard_error / of_all.sigma, None, 2
    while len(times_ns) // stride > 2 * order:
        rows = [slice(first, None, stride) for first in range(stride)]
        levels = [noise_level(times_ns[part], curve_of(part), order=order) for part in rows]
        sigmas = [level.sigma - level.motion for level in levels if level is not None]
        sigma = float(np.mean(sigmas)) if sigmas else 0.0
        # The phases have about as many differences together as all samples, and so the same relative error.
        error = relative_error * hypot(sigma, of_all.sigma)
        if sigma - of_all.sigma > _SIGMAS * error and sigma > declared / (2.0 * sqrt(stride)):
            far_apart = sigma
        stride *= 2
    return far_apart


def noisiest_part(times_ns: Int64, curve: VectorSamples, *, order: int) -> NoisyPart | None:
    """Return the part of the samples whose noise differs most from that of all others by one factor, and is larger.

    The noise of a block is the median of its differences, so that a step of the samples where the part begins counts
    little. Edges of the part are where samples change most, within a block of the best edges of blocks.

    Parameters
    ----------
    times_ns, curve, order
        As of ``noise_level``.

    Returns
    -------
    NoisyPart or None
        None where there are too few samples, or where samples without any noise are among them.
    """
    differences = np.abs(divided_differences(times_ns, curve, order))
    # A difference of order d reads d + 1 samples: a block holds at least one of its own samples alone.
    size = max(order + 2, -(-len(differences) // _MOST_BLOCKS))
    count = len(differences) // size
    # Runs with a gap are left out: rows of differences are then not those of samples.
    if count < _FEWEST_BLOCKS or len(differences) != len(times_ns) - order:
        return None
    sigmas = np.median(differences[: count * size].reshape(count, -1), axis=1) / _MEDIAN_SIGMAS
    if not np.all(sigmas > 0):
        return None
    levels = np.log(sigmas)
    sums = np.r_[0.0, np.cumsum(levels - levels.mean())]
    firsts, lasts = np.triu_indices(count + 1, 1)
    within = lasts - firsts < count
    firsts, lasts = firsts[within], lasts[within]
    blocks, excess = lasts - firsts, sums[lasts] - sums[firsts]
    # Two levels remove this of the squares about one: S^2 (1 / k + 1 / (n - k)), for k of n blocks with the sum S.
    removed = np.where(excess > 0, excess**2 * (1.0 / blocks + 1.0 / (count - blocks)), 0.0)
    best = int(np.argmax(removed))
    first, last = int(firsts[best]), int(lasts[best])
    ratio = float(np.exp(np.median(levels[first:last]) - np.median(np.r_[levels[:first], levels[last:]])))
    changes = np.linalg.norm(curve.lagged_differences(1), axis=-1)

    def edge(block: int) -> int:
        """Return the row at which the part begins or ends: the one before which samples change most nearby."""
        row = block * size + order // 2
        nearby = slice(max(row - size, 0), row + size)
        return nearby.start + int(np.argmax(changes[nearby])) + 1

    return NoisyPart(
        rows=(edge(first) if first else 0, edge(last) if last < count else None),
        ratio=ratio,
    )


def _sigma(values: Float64) -> float:
    """Return the standard deviation of normal values from the 90% quantile of their absolute values."""
    return float(np.quantile(np.abs(values), _QUANTILE)) / _QUANTILE_SIGMAS if values.size else 0.0

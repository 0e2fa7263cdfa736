"""White noise, jumps, repeats and straight lines among samples of a smooth motion, from each sample's neighbours.

All estimates use short linear filters that are exactly zero for polynomials up to a degree. A smooth motion therefore
vanishes at any speed, for even and for uneven timestamps. What remains of the motion is bounded: the same filter of a
lower degree passes more of it, and the difference of the two is the bound.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import comb
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_qa.geometry import so3

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Indices = NDArray[np.intp]

_WIDEST_STEP: Final = 1.5
"""Stencils with a step wider than this many median steps are left out, as samples are missing there."""

_NS_PER_US: Final = 1_000

_QUANTILE: Final = 0.9
_QUANTILE_SIGMAS: Final = 1.644854
_MEDIAN_SIGMAS: Final = 0.674490
"""Quantile of absolute differences that gives sigma, and its value for unit normal noise. Jumps in one tenth of the
differences move the estimate little."""

_QUANTILE_COST: Final = 1.25
"""Ratio of the standard errors of sigma from this quantile and from the mean square, for normal values."""

_BEYOND_NOISE_SIGMAS: Final = 5.0
"""Difference of filters of two degrees, in standard errors, above which the motion causes it and not noise."""

_TYPICAL_SHARE: Final = 0.1
"""Share of a typical change. A body that moves by more next to a repeat does not come to rest there."""

_ROUNDINGS: Final = 16.0
"""Units of rounding by which neighbours of a steady motion may differ. The rotation of a vector takes fifteen
operations (nine products, six sums), each of which errs by at most half a unit, in either neighbour."""

FEWEST_HELD: Final = 16
"""Least number of repeats of a component that is held: a filter or a bus that gives a value twice holds it for fewer
samples. The value is not derived."""

_LOG_CHANCE: Final = float(np.log(1e-9))
"""Logarithm of the probability of six standard deviations (normal, one side)."""

_LARGE_CHANGE: Final = 0.9
"""Quantile of the changes of a component above which one is large: that of a component that comes to rest is among the
smallest."""

_LONE: Final = 20.0
"""Medians of the distance of a sample from the middle of its neighbours above which it lies off. The length of normal
noise of three axes exceeds four medians in one of 1e9 samples; a motion is left."""

_ROWS_OF_TWO: Final = 6
"""Most rows in succession that two lone samples beside each other disturb: a motion is longer."""

_FEWEST_PERIODS: Final = 16
"""Least number of knots for a median of the curvature at them."""

_LARGEST_STRIDE: Final = 20
"""Largest distance of knots that is tried, in samples."""
_CURVATURE_ROUNDINGS: Final = 100.0
"""Units of rounding that the curvature at knots must exceed: below it both medians result from rounding alone."""


class SampledCurve(Protocol):
    """Samples (N) of a motion, given by vectors from one sample to another."""

    def relative_vectors(self, stencils: Indices, centre: int) -> Float64:
        """Return the vectors of samples relative to one sample of each stencil.

        Parameters
        ----------
        stencils
            (n, m) indices of samples.
        centre
            Column of ``stencils`` that holds the reference sample.

        Returns
        -------
        ndarray of float64
            (n, m, 3) in the unit of the curve.
        """
        ...

    def lagged_differences(self, lag: int) -> Float64:
        """Return the vectors (N - lag, 3) from each sample to the one ``lag`` after it.

        The vectors in the reverse direction are minus these.
        """
        ...


@dataclass(frozen=True, slots=True)
class VectorSamples:
    """Samples of a vector space, such as positions.

    Attributes
    ----------
    values
        (N, 3) of any unit.
    """

    values: Float64

    def relative_vectors(self, stencils: Indices, centre: int) -> Float64:
        """Return the differences of samples from one sample of each stencil.

        Parameters
        ----------
        stencils, centre
            As of ``SampledCurve.relative_vectors``.

        Returns
        -------
        ndarray of float64
            (n, m, 3) in the unit of the values.
        """
        return self.values[stencils] - self.values[stencils[:, centre, None]]

    def lagged_differences(self, lag: int) -> Float64:
        """Return the differences (N - lag, 3) of each sample ``lag`` after another."""
        return self.values[lag:] - self.values[:-lag]


@dataclass(frozen=True, slots=True)
class OrientationSamples:
    """Samples of an orientation.

    Attributes
    ----------
    orientations_xyzw
        (N, 4) quaternions x, y, z, w, of any nonzero length.
    """

    orientations_xyzw: Float64
    _differences: dict[int, Float64] = field(default_factory=dict, compare=False, repr=False)

    def relative_vectors(self, stencils: Indices, centre: int) -> Float64:
        """Return the rotation vectors ``Log(q_centre^-1 q)`` of samples, in the frame of the centre.

        Parameters
        ----------
        stencils, centre
            As of ``SampledCurve.relative_vectors``.

        Returns
        -------
        ndarray of float64
            (n, m, 3) rad.
        """
        q = self.orientations_xyzw
        return so3.log_quaternion(so3.compose(so3.inverse(q[stencils[:, centre]])[:, None], q[stencils]))

    def lagged_differences(self, lag: int) -> Float64:
        """Return the rotation vectors ``Log(q_i^-1 q_i+lag)`` (N - lag, 3), rad; computed once for each lag."""
        if lag not in self._differences:
            q = self.orientations_xyzw
            self._differences[lag] = so3.log_quaternion(so3.compose(so3.inverse(q[:-lag]), q[lag:]))
        return self._differences[lag]


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
class StepEstimates:
    """Estimated jumps between neighbouring samples.

    Attributes
    ----------
    before
        (n,) index of the sample before each estimated jump.
    sizes
        (n, 3) jump of all later samples, on each axis, in the unit of the curve.
    gains
        (n,) standard deviation of a size for white noise of standard deviation 1.
    motion
        (n,) part of a size on any axis that the motion may have added, in the unit of the curve.
    reach
        Number of samples on either side of a jump that its size is estimated from.
    """

    before: Indices
    sizes: Float64
    gains: Float64
    motion: Float64
    reach: int


@dataclass(frozen=True, slots=True)
class CurvatureEvenness:
    """Ratio of the curvature of a motion between every ``stride``-th sample to that at these samples.

    Attributes
    ----------
    evenness
        Median curvature between these samples over the median at them. Near 1 for any smooth or noisy motion, near
        0 where samples were interpolated linearly from every ``stride``-th.
    stride
        Distance of these samples, in samples.
    """

    evenness: float
    stride: int


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

    It is 1 for white normal noise, and near 0 where what disturbs the samples does so at times, as jumps do.

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
    if len(differences) < order or not of_tenth > 0:
        return 1.0
    return float(np.median(np.abs(differences))) / _MEDIAN_SIGMAS / of_tenth


def find_steps(times_ns: Int64, curve: SampledCurve, *, half_width: int, degree: int, sigma: float) -> StepEstimates:
    """Estimate the jump between each sample and the next with the matched filter of a step.

    The estimate is the least-squares fit of a polynomial plus a step. The same fit with a degree less by two passes
    more of the motion. Where the two differ by more than noise explains, anywhere within reach of the filter, the
    difference bounds the part of the motion.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.
    half_width
        Number of samples on either side that a size is estimated from.
    degree
        Of the polynomial.
    sigma
        Standard deviation of white noise of a sample, in the unit of the curve.

    Returns
    -------
    StepEstimates
        One for each pair of neighbours with ``half_width`` samples on either side and no gap among them.
    """
    size, centre = 2 * half_width, half_width - 1
    if _are_evenly_spaced(times_ns, size):
        before = np.arange(len(times_ns) - size + 1) + centre
        patterns, pattern_of_row = _offsets_us(times_ns[None, :size]), np.zeros(len(before), dtype=np.intp)
        weights, lower_weights = _step_weights(patterns, degree), _step_weights(patterns, degree - 2)
        sizes, lower_sizes = _weighted_neighbours(curve, np.concatenate((weights, lower_weights)), centre, len(before))
    else:
        stencils = _stencils(times_ns, size)
        before, vectors = stencils[:, centre], curve.relative_vectors(stencils, centre)
        patterns, pattern_of_row = _patterns(times_ns, stencils)
        weights, lower_weights = _step_weights(patterns, degree), _step_weights(patterns, degree - 2)
        sizes = np.einsum("nm,nmi->ni", weights[pattern_of_row], vectors)
        lower_sizes = np.einsum("nm,nmi->ni", lower_weights[pattern_of_row], vectors)
    # The gain of a linear filter for white noise is the length of its weights.
    gains = np.linalg.norm(weights, axis=-1)[pattern_of_row]
    difference_gains = np.linalg.norm(weights - lower_weights, axis=-1)[pattern_of_row]
    motion = np.abs(sizes - lower_sizes).max(axis=-1, initial=0.0)
    beyond_noise = np.where(motion > _BEYOND_NOISE_SIGMAS * sigma * difference_gains, motion, 0.0)
    from scipy.ndimage import maximum_filter1d  # noqa: PLC0415 - slow to load, and only poses and the IMU need it

    nearby = maximum_filter1d(beyond_noise, 2 * half_width + 1, mode="nearest") if len(before) else beyond_noise
    return StepEstimates(before, sizes, gains, nearby, half_width)


def most_precise_steps(candidates: Sequence[StepEstimates], sigma: float) -> StepEstimates:
    """Return the candidate with the least error: 90th percentile of six standard errors plus the part of the motion.

    Parameters
    ----------
    candidates
        Steps estimated with different filters; at least one.
    sigma
        Standard deviation of white noise of a sample, in the unit of the curve.

    Returns
    -------
    StepEstimates
        One of the candidates. A candidate without any step is returned only if all have none.
    """

    def error(steps: StepEstimates) -> float:
        return float(np.quantile(steps.motion + 6.0 * sigma * steps.gains, 0.9)) if len(steps.before) else np.inf

    return min(candidates, key=error)


def divided_differences(times_ns: Int64, curve: SampledCurve, order: int) -> Float64:
    """Return the divided differences of an order, scaled so that unit white noise gives unit noise.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.
    order
        Of the differences; each is a weighted sum of ``order + 1`` neighbouring samples.

    Returns
    -------
    ndarray of float64
        (n, 3) in the unit of the curve. Runs of neighbours with a step wider than 1.5 median steps are left out.
    """
    centre = order // 2
    if _are_evenly_spaced(times_ns, order + 1):
        weights = _difference_weights(_offsets_us(times_ns[None, : order + 1]))
        even: Float64 = _weighted_neighbours(curve, weights, centre, len(times_ns) - order)[0]
        return even
    stencils = _stencils(times_ns, order + 1)
    patterns, pattern_of_row = _patterns(times_ns, stencils)
    differences: Float64 = np.einsum(
        "nm,nmi->ni", _difference_weights(patterns)[pattern_of_row], curve.relative_vectors(stencils, centre)
    )
    return differences


def repeated_samples(*samples: Float64, roundings: Sequence[float]) -> Indices:
    """Return the indices of samples that exactly repeat the one before, in every array, while the body moves.

    A body that comes to rest slows down before. Therefore a run of repeats counts only where the change next to it,
    before or after, is at least a tenth of a typical one, and larger than rounding makes of a steady motion. Where all
    samples repeat, none counts.

    Parameters
    ----------
    samples
        Arrays (N, k) of the same N samples.
    roundings
        Unit of rounding of each array, in its unit.

    Returns
    -------
    ndarray of intp
        (n,) ascending.
    """
    changes = [np.abs(np.diff(values, axis=0)).max(axis=-1, initial=0.0) for values in samples]
    repeats = np.all([change == 0 for change in changes], axis=0)
    if not len(repeats) or repeats.all() or not repeats.any():
        return np.empty(0, dtype=np.intp)
    moves = np.zeros(len(repeats), dtype=np.bool_)
    for change, rounding in zip(changes, roundings, strict=True):
        if np.any(change > 0):
            typical = float(np.median(change[change > 0]))
            moves |= change >= max(_TYPICAL_SHARE * typical, _ROUNDINGS * rounding)
    starts = np.flatnonzero(repeats & ~np.insert(repeats[:-1], 0, False))
    stops = np.flatnonzero(repeats & ~np.append(repeats[1:], False)) + 1
    padded = np.concatenate(([False], moves, [False]))  # padded[i] is the change before change i
    runs = [np.arange(a, b) + 1 for a, b in zip(starts, stops, strict=True) if padded[a] or padded[b + 1]]
    return np.concatenate(runs) if runs else np.empty(0, dtype=np.intp)


def longest_hold(values: Float64, *, rounding: float) -> slice:
    """Return the longest run of equal samples of one component that chance and rest do not explain.

    Coarse values repeat by chance. With the share p of repeats in the rest of the samples, one of n runs has r repeats
    with a probability of n p^r at most. A component comes to rest, and leaves it, by changes that grow from 0: a hold
    begins or ends with a change that is large among all changes of the component. A sensor at its limit repeats its
    largest or smallest value, which is not 0.

    Parameters
    ----------
    values
        (N,) of one component.
    rounding
        Unit of rounding of a value, in its unit.

    Returns
    -------
    slice
        Of the samples of the run, which all have one value; empty where there is none.
    """
    none = slice(0, 0)
    if len(values) < FEWEST_HELD or not np.isfinite(values).all():
        return none
    changes = np.abs(np.diff(values))
    repeats = changes == 0
    starts = np.flatnonzero(repeats & ~np.insert(repeats[:-1], 0, False))
    stops = np.flatnonzero(repeats & ~np.append(repeats[1:], False)) + 1
    if not len(starts) or repeats.all():
        return none
    longest = int(np.argmax(stops - starts))
    start, stop = int(starts[longest]), int(stops[longest])
    held, others = stop - start, len(repeats) - (stop - start)
    # At least one repeat is reckoned with: a share of 0 of few samples is no probability of 0.
    share = max(int(repeats.sum()) - held, 1) / max(others, 1)
    if held < FEWEST_HELD or np.log(len(values)) + held * np.log(min(share, 1.0)) > _LOG_CHANCE:
        return none
    value = float(values[start])
    if value and value in (values.min(), values.max()):
        return none
    # Changes into the run and out of it; the sequence may begin or end with it.
    beside = [float(changes[i]) for i in (start - 1, stop) if 0 <= i < len(changes)]
    large = float(np.quantile(changes[changes > 0], _LARGE_CHANGE))
    return slice(start, stop + 1) if max(beside) > max(large, _ROUNDINGS * rounding) else none


def lone_samples(times_ns: Int64, curve: SampledCurve) -> tuple[Indices, Float64]:
    """Return the samples that lie off the motion of their neighbours one by one, and their distances from it.

    The second difference at a sample that lies off by d is -2 d, and d at both neighbours. Of noise, and of a motion
    that speeds up for a while, second differences are large in many rows, or in runs of them.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.

    Returns
    -------
    rows : (n,) array
        Of the samples that lie off; empty where there are none, or any beside another.
    distances : (n,) array
        From the middle of the two neighbours, in the unit of the curve.
    """
    stencils = _stencils(times_ns, 3)
    none: Indices = np.empty(0, dtype=np.intp)
    if len(stencils) < _FEWEST_PERIODS:
        return none, np.empty(0)
    vectors = curve.relative_vectors(stencils, 1)
    distances = np.linalg.norm(vectors[:, 0] + vectors[:, 2], axis=1) / 2
    # Half of all rows are quiet even where a fifth of the samples lie off. At most half exceed the median.
    off = distances > _LONE * max(float(np.median(distances)), np.finfo(np.float64).tiny)
    starts = np.flatnonzero(np.diff(np.r_[0, off.astype(np.int8)]) == 1)
    stops = np.flatnonzero(np.diff(np.r_[off.astype(np.int8), 0]) == -1) + 1
    if not len(starts) or np.any(stops - starts > _ROWS_OF_TWO):
        return none, np.empty(0)
    # The largest row of each run is that of the sample: its neighbours show half of the distance.
    largest = np.array(
        [start + int(np.argmax(distances[start:stop])) for start, stop in zip(starts, stops, strict=True)]
    )
    neighbours = np.clip(largest[:, None] + [-1, 1], 0, len(off) - 1)
    lone = largest[off[neighbours].all(axis=1)]
    return stencils[lone, 1], distances[lone]


def find_interpolation(times_ns: Int64, curve: SampledCurve, *, resolution: float) -> CurvatureEvenness | None:
    """Return the stride of 2 to 20 for which samples lie most nearly on straight lines between every stride-th sample.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.
    resolution
        Rounding of a sample, in the unit of the curve. Strides whose curvature at knots is below a hundred times
        this are left out.

    Returns
    -------
    CurvatureEvenness or None
        The least even one, for equal evenness that of the smallest stride; None where there is no curvature to
        compare.
    """
    bends = np.linalg.norm(divided_differences(times_ns, curve, 2), axis=-1)
    order = np.argsort(bends, kind="stable")
    ranked = bends[order]
    candidates = []
    for stride in range(2, min(_LARGEST_STRIDE, len(bends) // _FEWEST_PERIODS) + 1):
        # The bends are sorted once. The members of a phase, in order of rank, have their median in the middle.
        phases = (order % stride).astype(np.uint8)
        by_phase, counts = np.argsort(phases, kind="stable"), np.bincount(phases)
        for ranks in np.split(by_phase, np.cumsum(counts)[:-1]):
            at_knots = _mean_of_two(ranked[ranks[_median_ranks(len(ranks))]])
            if at_knots > _CURVATURE_ROUNDINGS * resolution:
                # Median of the bends that are not in ``ranks``: its rank among these, plus the members of ``ranks``
                # below it.
                among_rest = np.array(_median_ranks(len(bends) - len(ranks)))
                of_rest = among_rest + np.searchsorted(ranks - np.arange(len(ranks)), among_rest, side="right")
                candidates.append(CurvatureEvenness(_mean_of_two(ranked[of_rest]) / at_knots, stride))
    return min(candidates, key=lambda candidate: (round(candidate.evenness, 2), candidate.stride), default=None)


def _median_ranks(count: int) -> list[int]:
    """Return the ranks of the two of ``count`` sorted numbers whose mean is the median."""
    return [(count - 1) // 2, count // 2]


def _mean_of_two(pair: Float64) -> float:
    return float(pair[0] + pair[1]) / 2


def _step_weights(offsets_us: Int64, degree: int) -> Float64:
    """Return the weights (n, m) that give the size of a step in the middle, fitted together with a polynomial."""
    count, samples = offsets_us.shape
    middle = (offsets_us[:, samples // 2 - 1, None] + offsets_us[:, samples // 2, None]) / 2
    scaled = (offsets_us - middle) / max(1.0, float(np.abs(offsets_us).max(initial=1)))
    step = np.broadcast_to(np.arange(samples) >= samples // 2, (count, samples)).astype(np.float64)
    design = np.concatenate((scaled[..., None] ** np.arange(degree + 1), step[..., None]), axis=-1)
    # The last row of the pseudoinverse is the linear estimate of the last unknown, the step.
    weights: Float64 = np.linalg.pinv(design).astype(np.float64)[:, -1, :]
    return weights


def _are_evenly_spaced(times_ns: Int64, size: int) -> bool:
    """Return whether all steps are equal, so that all runs of ``size`` neighbours have the same weights.

    Steps below a microsecond are left to ``_stencils``, which has no run of such.
    """
    steps_ns = np.diff(times_ns)
    return len(times_ns) >= size and _NS_PER_US <= int(steps_ns.min()) == int(steps_ns.max())


def _weighted_neighbours(curve: SampledCurve, weights: Float64, centre: int, count: int) -> Float64:
    """Return the sums (k, n, 3), weighted by (k, m), over the first n = ``count`` runs of m neighbours.

    Samples are taken relative to the one in column ``centre`` of each run.
    """
    sums = np.zeros((len(weights), count, 3))
    for column, weight in enumerate(weights.T):
        lag = column - centre
        if lag:
            first, sign = (centre, 1.0) if lag > 0 else (column, -1.0)
            sums += (sign * weight)[:, None, None] * curve.lagged_differences(abs(lag))[first : first + count]
    return sums


def _difference_weights(offsets_us: Int64) -> Float64:
    """Return the weights (n, m) of divided differences, 1 / prod_j (t_i - t_j), of unit length."""
    reach = np.maximum(offsets_us.max(axis=-1, keepdims=True), 1) / 2  # keeps products near 1
    offsets = offsets_us / reach
    weights = np.ones_like(offsets)
    for node in range(offsets.shape[-1]):
        gaps = offsets[:, node, None] - offsets
        gaps[:, node] = 1.0
        weights[:, node] = 1.0 / np.prod(gaps, axis=-1)
    unit: Float64 = weights / np.linalg.norm(weights, axis=-1, keepdims=True)
    return unit


def _stencils(times_ns: Int64, size: int) -> Indices:
    """Return indices (n, size) of runs of neighbours that have no gap among them and differ by microseconds."""
    count = len(times_ns) - size + 1
    if count < 1:
        return np.empty((0, size), dtype=np.intp)
    stencils: Indices = np.arange(count)[:, None] + np.arange(size)
    steps_ns = np.diff(times_ns)
    # Offsets count in whole microseconds: two times within one would be the same.
    usable = (steps_ns >= _NS_PER_US) & (steps_ns <= _WIDEST_STEP * float(np.median(steps_ns)))
    continuous: Indices = stencils[usable[stencils[:, :-1]].all(axis=1)]
    return continuous


def _patterns(times_ns: Int64, stencils: Indices) -> tuple[Int64, Indices]:
    """Return the distinct patterns of offsets (p, m), whole microseconds, and the index of the pattern (n,).

    ``stencils`` are (n, m) indices of samples.
    """
    offsets_us = _offsets_us(times_ns[stencils])
    if len(offsets_us) and np.array_equal(offsets_us.min(axis=0), offsets_us.max(axis=0)):
        return offsets_us[:1], np.zeros(len(stencils), dtype=np.intp)
    patterns, pattern_of_row = np.unique(offsets_us, axis=0, return_inverse=True)
    return patterns, pattern_of_row.reshape(-1)


def _offsets_us(times_ns: Int64) -> Int64:
    """Return the offsets (n, m) of timestamps (n, m) from the first of each row, in whole microseconds."""
    offsets_us: Int64 = (times_ns - times_ns[:, :1] + _NS_PER_US // 2) // _NS_PER_US
    return offsets_us


def _sigma(values: Float64) -> float:
    """Return the standard deviation of normal values from the 90% quantile of their absolute values."""
    return float(np.quantile(np.abs(values), _QUANTILE)) / _QUANTILE_SIGMAS if values.size else 0.0

"""Summary of a comparison of IMU and poses: parameters, residuals, worst row, and a bias of a part.

A bias of the sensor in a part of a sequence follows from the residuals of IMU and poses. With the jacobian J of the
residuals r by a bias, and their weights W, a bias of some rows is ``A^-1 b`` and removes ``b^T A^-1 b`` of their
weighted squares, where ``A = sum J^T W J`` and ``b = sum J^T W r``. Sums over a part are differences of sums from the
first row on, so that many parts are compared at once: the part whose bias removes most is the likeliest. Rows that the
bias does not affect add to A and not to b, so that a part that is too long removes less.

Another gain of a part is placed in the same way, by the jacobian of the gain.

A row at an edge of the part is affected in proportion to the time of it that lies within, which gives the edges between
rows. The errors of neighbouring rows are taken as independent; in noise of the poses ``noisy_part`` places the part.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.grouped_fit import GroupedFit, ParameterEstimate
from fedora_qa.estimators.fitting.robust import SensitivityRange, sensitivity_range
from fedora_qa.estimators.imu.bias_walk import BRIDGE_SQUARES
from fedora_qa.estimators.imu.noisy_part import PartialBias, noisy_part
from fedora_qa.estimators.imu.samples import ComparisonRows

Float64 = NDArray[np.float64]

_EDGES: Final = 64
"""Number of edges between which all parts are compared; then either edge is moved row by row."""

_ROUNDS: Final = 3
"""Number of times that both edges are moved: each time the other edge is nearer to its place."""

_PARTLY: Final = 2
"""Number of rows at either edge that the bias may affect partly."""

_FEWEST_ROWS_OF_PART: Final = 6
"""Least number of rows within the part: those at its edges, and some that are affected in full."""

_LEAST_ELSEWHERE: Final = 0.1
"""Least share of rows outside the part: a bias of nearly all rows is one of the whole sequence."""

_LEAST_EXPLAINED: Final = 0.9
"""Least share of the squares that the bias must explain: of two motions that differ, half a swing is a bias as well, of
which it explains a half or so."""

_SINGULAR: Final = 1e-12
"""Share of the total information that is added to each part's, so that it can be inverted without motion."""

FEWEST_ROWS: Final = 8
OUTLIER: Final = 8.0
"""Deviation in standard deviations above which a row is left out of the fit."""

_FEWEST_SEGMENTS: Final = 3
_SIMILAR_SCORE: Final = 0.7
"""Share of the largest score above which segments count as deviating by about as much."""

_LEAST_OUTSIDE: Final = 0.1
"""Least share of rows outside a disturbance that makes it local."""

_COURSE_POINTS: Final = 1000
"""Most points of the course of residuals."""


@dataclass(frozen=True, slots=True)
class PartialGain:
    """Another gain of the sensor within a part of the sequence.

    Attributes
    ----------
    gain
        Measured over true value.
    start_s, stop_s, explained, left_within
        As of ``PartialBias``.
    """

    gain: float
    start_s: float
    stop_s: float
    explained: float
    left_within: float


@dataclass(frozen=True, slots=True)
class BiasDrift:
    """A bias of the sensor that changes evenly from the first sample to the last.

    Attributes
    ----------
    first, last
        (3,) at either end, along the axes of the sensor, in its unit.
    explained
        Share of the weighted squares beyond noise that it removes, 0 to 1.
    """

    first: tuple[float, ...]
    last: tuple[float, ...]
    explained: float


def partial_bias(
    segments: Sequence[ComparisonRows], *, centre: float, left_by_whole: float = inf
) -> PartialBias | None:
    """Return the part of the sequence whose bias removes most of the residuals.

    Parameters
    ----------
    segments
        Rows of the samples as declared, in the order of time.
    centre
        Time from that of a row to the middle of what it compares, in spans of the row.
    left_by_whole
        Weighted squares of the residuals that parameters of the whole sequence leave.

    Returns
    -------
    PartialBias or None
        None where the likeliest part is the whole sequence, has too few rows, or leaves more than little, or as much as
        parameters of the whole sequence do.
    """
    part = _likeliest_part(segments, [rows.bias_jacobians for rows in segments], centre, left_by_whole)
    if part is None:
        return None
    bias, start_s, stop_s, explained, left = part
    return PartialBias((float(bias[0]), float(bias[1]), float(bias[2])), start_s, stop_s, explained, left)


def partial_gain(
    segments: Sequence[ComparisonRows], *, column: int, centre: float, left_by_whole: float = inf
) -> PartialGain | None:
    """Return the part of the sequence in which another gain of the sensor removes most of the residuals.

    Parameters
    ----------
    segments, centre, left_by_whole
        As of ``partial_bias``.
    column
        Of the jacobians, the derivative by the gain.

    Returns
    -------
    PartialGain or None
        None where ``partial_bias`` would be None, or where the rates have another sign.
    """
    part = _likeliest_part(segments, [rows.jacobians[..., [column]] for rows in segments], centre, left_by_whole)
    if part is None or part[0][0] >= 1.0:
        return None
    (share,), start_s, stop_s, explained, left = part
    # Jacobians are those of measured samples: with w' = k w, residuals are (k - 1) w = (1 - 1 / k) w'.
    return PartialGain(1.0 / (1.0 - float(share)), start_s, stop_s, explained, left)


def _likeliest_part(
    segments: Sequence[ComparisonRows], derivatives: Sequence[Float64], centre: float, left_by_whole: float
) -> tuple[Float64, float, float, float, float] | None:
    """Return the values of some parameters in the part where they remove most, and what a ``PartialBias`` has besides.

    ``derivatives`` are those of the residuals of each segment, (n, 3, P), by these parameters.
    """
    residuals = np.concatenate([rows.residuals / rows.sigmas for rows in segments])
    jacobians = np.concatenate(
        [of_rows / rows.sigmas[..., np.newaxis] for rows, of_rows in zip(segments, derivatives, strict=True)]
    )
    spans_s = np.concatenate([rows.spans_s for rows in segments])
    middles_s = np.concatenate([rows.times_s for rows in segments]) + centre * spans_s
    count = len(residuals)
    # Sums over the rows before each edge: (n + 1, P, P) and (n + 1, P).
    information = _sums_before(np.einsum("nij,nik->njk", jacobians, jacobians))
    projection = _sums_before(np.einsum("nij,ni->nj", jacobians, residuals))
    floor = _SINGULAR * float(np.trace(information[-1])) * np.eye(jacobians.shape[-1])

    def values(first: NDArray[np.intp], last: NDArray[np.intp]) -> Float64:
        sums = projection[last] - projection[first]
        solved = np.linalg.solve(information[last] - information[first] + floor, sums[..., np.newaxis])
        return np.asarray(solved[..., 0], dtype=np.float64)

    def removed(first: NDArray[np.intp], last: NDArray[np.intp]) -> Float64:
        squares: Float64 = np.einsum("ni,ni->n", projection[last] - projection[first], values(first, last))
        return squares

    if count < _FEWEST_ROWS_OF_PART or not floor.any():
        return None
    edges = np.unique(np.linspace(0, count, min(count, _EDGES) + 1).astype(np.intp))
    firsts, lasts = (edges[numbers] for numbers in np.triu_indices(len(edges), 1))
    best = int(np.argmax(removed(firsts, lasts)))
    first, last, reach = int(firsts[best]), int(lasts[best]), -(-count // _EDGES)
    for _ in range(_ROUNDS):
        near = np.arange(max(first - reach, 0), min(first + reach, last - 1) + 1)
        first = int(near[np.argmax(removed(near, np.full(len(near), last)))])
        near = np.arange(max(last - reach, first + 1), min(last + reach, count) + 1)
        last = int(near[np.argmax(removed(np.full(len(near), first), near))])
    if last - first < _FEWEST_ROWS_OF_PART or count - (last - first) < _LEAST_ELSEWHERE * count:
        return None
    squares = float(removed(np.array([first]), np.array([last]))[0])
    # Below the noise, whatever a part explains counts as all there is: then what the whole leaves decides.
    if float(np.sum(residuals**2)) - squares >= left_by_whole:
        return None
    value = values(np.array([first + _PARTLY]), np.array([last - _PARTLY]))[0]
    # Noise alone has squares of one a residual, or less where errors are bounds: it is measured outside of the part.
    outside = np.concatenate([residuals[:first], residuals[last:]])
    noise = min(float(np.mean(outside**2)), 1.0) * residuals.size
    explained = squares / max(float(np.sum(residuals**2)) - noise, squares)
    if explained < _LEAST_EXPLAINED:
        return None
    # Share of each row that the fault affects.
    predicted = jacobians @ value
    lengths = np.maximum(np.sum(predicted**2, axis=1), np.finfo(np.float64).tiny)
    shares = np.clip(np.sum(residuals * predicted, axis=1) / lengths, 0.0, 1.0)
    step_s = float(np.median(spans_s))
    start_s, stop_s = -inf, inf
    # From the middle of a row that is affected in full, back by the shares of the two rows on either side of the edge.
    if first >= _PARTLY:
        start_s = float(
            middles_s[first + _PARTLY] - step_s / 2 - step_s * shares[first - _PARTLY : first + _PARTLY].sum()
        )
    if last + _PARTLY <= count:
        stop_s = float(
            middles_s[last - _PARTLY - 1] + step_s / 2 + step_s * shares[last - _PARTLY : last + _PARTLY].sum()
        )
    within = slice(first + _PARTLY, last - _PARTLY)
    left = float(np.sum((residuals - predicted)[within] ** 2) / np.sum(residuals[within] ** 2))
    return value, start_s, stop_s, explained, left


def bias_drift(segments: Sequence[ComparisonRows]) -> BiasDrift | None:
    """Return the bias that changes evenly with time and removes nearly all of the residuals.

    Parameters
    ----------
    segments
        Rows of the samples as declared, in the order of time.

    Returns
    -------
    BiasDrift or None
        None where it leaves more than little, or a bias without a drift removes as much.
    """
    residuals = np.concatenate([rows.residuals / rows.sigmas for rows in segments])
    jacobians = np.concatenate([rows.bias_jacobians / rows.sigmas[..., np.newaxis] for rows in segments])
    times_s = np.concatenate([rows.times_s for rows in segments])
    if len(residuals) < _FEWEST_ROWS_OF_PART or times_s[-1] <= times_s[0]:
        return None
    # b(t) = (1 - s) b_first + s b_last, s from 0 to 1.
    share = ((times_s - times_s[0]) / (times_s[-1] - times_s[0]))[:, np.newaxis, np.newaxis]
    total = float(np.sum(residuals**2))
    targets = residuals.ravel()
    drifting = np.concatenate([(1 - share) * jacobians, share * jacobians], axis=2).reshape(-1, 6)
    solved = np.linalg.lstsq(drifting, targets, rcond=None)[0]
    constant = np.linalg.lstsq(jacobians.reshape(-1, 3), targets, rcond=None)[0]
    left = float(np.sum((targets - drifting @ solved) ** 2))
    left_by_constant = float(np.sum((targets - jacobians.reshape(-1, 3) @ constant) ** 2))
    # Noise alone leaves a square of one a residual, which no bias removes; of less than as much again nothing is said.
    beyond_noise = total - targets.size
    if beyond_noise < targets.size or total - left < _LEAST_EXPLAINED * beyond_noise:
        return None
    if total - left_by_constant >= _LEAST_EXPLAINED * beyond_noise:
        return None
    first, last = (tuple(float(value) for value in part) for part in (solved[:3], solved[3:]))
    return BiasDrift(first, last, min((total - left) / beyond_noise, 1.0))


def _sums_before(values: Float64) -> Float64:
    """Return the sums (n + 1, ...) of the values (n, ...) before each of them, and of all."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])


@dataclass(frozen=True, slots=True)
class WorstRow:
    """The row with the largest residual in units of its standard deviation, on its worst axis.

    Attributes
    ----------
    time_s
        Of the row, s.
    value, sigma
        Residual and its expected standard deviation on that axis, rad or m/s.
    model_error
        Largest error of the integration and of a mean error of rounding on any axis of the row, in the same unit.
    sensitivity
        Range over the rows and axes of the comparison, in the same unit.
    """

    time_s: float
    value: float
    sigma: float
    model_error: float
    sensitivity: SensitivityRange | None


@dataclass(frozen=True, slots=True)
class LocalDeviation:
    """The segment in which a parameter differs most from its value in the whole sequence.

    Attributes
    ----------
    start_s, stop_s
        First and last row of the segment, s.
    value
        Of the parameter in the segment, in the unit of the parameter.
    deviation, standard_error, model_error
        Difference from the value in the whole sequence, its standard error, and the error of the integration in it.
    tests
        Number of segments that were compared.
    sensitivity
        Range over these segments, in the unit of the parameter.
    """

    start_s: float
    stop_s: float
    value: float
    deviation: float
    standard_error: float
    model_error: float
    tests: int
    sensitivity: SensitivityRange | None


@dataclass(frozen=True, slots=True)
class InertialFit:
    """The fit of a comparison of IMU and poses. Residuals are in rad (rotation) or m/s (translation).

    Attributes
    ----------
    parameters
        By name.
    settled
        Whether the free parameters converged. If not, the two streams disagree in a way that these parameters do
        not describe, and the residuals are those of the samples as declared.
    misfit
        Root mean square of whitened residuals with all parameters fitted, each in units of its expected sigma.
    rms, expected_rms, rms_error
        Root mean square of the residuals after the free parameters: measured, expected of noise, and standard error
        of the measured one.
    model_rms
        Root mean square of the estimated error of the integration and of a mean error of rounding.
    smoothness
        Correlation of neighbouring residuals: not positive for noise, near 1 for another motion.
    rows, outliers
        Number of comparisons, and number of those that were left out of the fit as outliers.
    worst
        Of all rows, after the free parameters.
    local_deviations
        By name, the segment in which each parameter differs most from its value in the whole sequence; empty where
        there are fewer than three segments.
    disturbed
        First and last instant, s, at which the streams as declared differ by more than all noise, if they agree
        outside; None where they agree everywhere or nowhere.
    noisy_part
        First and last instant, s, of the part whose bias leaves what noise explains, where no single row exceeds all
        noise; infinite where it reaches an end of the sequence, None without one.
    course
        (n, 2) instant, s, and length of the residual of the samples as declared, without any parameter: the longest
        of each of n <= 1000 runs of rows.
    partial_bias
        The part of the sequence whose bias removes most of the residuals as declared; None where that is the whole
        sequence.
    partial_gain
        The part in which another gain removes nearly all of the residuals, and leaves less within it than any bias of
        a part, which has three numbers in place of one; None where there is none.
    bias_drift
        The bias that changes evenly and removes nearly all of them; None where none does, or a constant one does.
    """

    parameters: Mapping[str, ParameterEstimate]
    settled: bool
    misfit: float
    rms: float
    expected_rms: float
    rms_error: float
    model_rms: float
    smoothness: float
    rows: int
    outliers: int
    worst: WorstRow
    local_deviations: Mapping[str, LocalDeviation]
    disturbed: tuple[float, float] | None
    noisy_part: tuple[float, float] | None
    course: Float64
    partial_bias: PartialBias | None
    partial_gain: PartialGain | None
    bias_drift: BiasDrift | None


def summarise(
    fit: GroupedFit,
    segments: list[ComparisonRows],
    kept: list[NDArray[np.bool_]],
    linearised_at: Float64,
    disturbed: tuple[float, float] | None,
    declared: list[ComparisonRows],
    *,
    settled: bool,
    centre: float = 0.0,
) -> InertialFit:
    """Return the summary of a fit.

    Residuals are those of the rows less the free parameters beyond ``linearised_at``, and less the biases between the
    ends of each segment where these are unknowns.

    Parameters
    ----------
    fit
        Of the segments.
    segments, kept
        Rows of each segment, and which of them (n,) were fitted.
    linearised_at
        (P,) sizes of the parameters that were removed from the samples before.
    disturbed, settled
        As of ``InertialFit``.
    declared
        Rows of the samples as declared, for the course and a bias of a part.
    centre
        As of ``partial_bias``.

    Returns
    -------
    InertialFit
        Of the rows of all segments; ``rms`` counts fitted rows only.
    """
    free = fit.values_of_free()
    residuals = remaining_residuals(fit, segments, kept, free, linearised_at)
    sigmas = np.concatenate([rows.sigmas_between_ends[keep] for rows, keep in zip(segments, kept, strict=True)])
    squares = np.concatenate([np.square(r[keep]) for r, keep in zip(residuals, kept, strict=True)])
    expected = float(np.sqrt(np.mean(np.square(sigmas))))
    rms = float(np.sqrt(np.mean(squares)))
    # Standard error of the rms of Gaussian rows whose neighbours have the correlation -1/2 or -2/3. Squares of
    # neighbours have the square of that as correlation, so that the variance of their mean is at most
    # 1 + 2 (4/9 + 1/36) = 1.94 times that of independent ones.
    bridge_variances = [rows.bridge_variances[keep] for rows, keep in zip(segments, kept, strict=True)]
    weights = (np.square(sigmas) - np.concatenate(bridge_variances)) / np.mean(np.square(sigmas))
    # Over a segment the squares of a bridge have a sum with the mean V and the variance 2 0.4 V^2. Both variances are
    # 2 |C|^2 with Frobenius' norm of a part of the covariance, of which the norm of the sum is at most the sum.
    walked = np.sqrt(2 * BRIDGE_SQUARES * sum(np.sum(of_rows.sum(axis=0) ** 2) for of_rows in bridge_variances))
    rms_error = float(expected * np.sqrt(1.94 * np.mean(np.square(weights)) / (2 * sigmas.size)))
    rms_error += float(walked / sigmas.size / (2 * expected))
    # smoothness = sum of r_i r_i+1 / sum of r_i^2, over all segments and axes. Rows that were left out part neighbours.
    products = 0.0
    for rows, of_segment in zip(segments, residuals, strict=True):
        are_neighbours = np.diff(rows.poses) == 1
        products += float(np.sum((of_segment[1:] * of_segment[:-1])[are_neighbours]))
    total = sum(float(np.sum(np.square(rows))) for rows in residuals)
    all_model_errors = np.concatenate([rows.error_bounds.max(axis=1) for rows in segments])
    row_sensitivity = sensitivity_range(
        np.concatenate([rows.sigmas_between_ends for rows in segments]), all_model_errors[:, np.newaxis]
    )
    # The worst row deviates most in units of its sigma, on its worst axis.
    worst_rows = []
    for rows, of_segment in zip(segments, residuals, strict=True):
        sigmas_of_rows = rows.sigmas_between_ends
        row, axis = np.unravel_index(np.argmax(np.abs(of_segment) / sigmas_of_rows), of_segment.shape)
        worst_rows.append(
            WorstRow(
                time_s=float(rows.times_s[row]),
                value=float(of_segment[row, axis]),
                sigma=float(sigmas_of_rows[row, axis]),
                model_error=float(rows.error_bounds[row].max()),
                sensitivity=row_sensitivity,
            )
        )
    # The segment in which each parameter differs most. Of segments that differ by about as much, the one with the
    # largest value is taken.
    used = [rows for rows, keep in zip(segments, kept, strict=True) if np.any(keep)]
    local_deviations: dict[str, LocalDeviation] = {}
    for column, name in enumerate(fit.parameters.names if len(used) >= _FEWEST_SEGMENTS else ()):
        local = fit.local(name)
        scores = np.abs(local.deviations) / local.standard_errors
        similar = scores >= _SIMILAR_SCORE * scores.max()
        worst = int(np.argmax(np.where(similar, np.abs(free[column] + local.deviations), -1.0)))
        local_deviations[name] = LocalDeviation(
            start_s=float(used[worst].times_s[0]),
            stop_s=float(used[worst].times_s[-1]),
            value=float(free[column] + local.deviations[worst]),
            deviation=float(local.deviations[worst]),
            standard_error=float(local.standard_errors[worst]),
            model_error=float(local.model_errors[worst]),
            tests=len(used),
            sensitivity=sensitivity_range(local.standard_errors, local.model_errors),
        )
    # The course holds the longest residual of each run of rows. Runs have equal lengths; the first ones may be longer
    # by one row.
    times_s = np.concatenate([rows.times_s for rows in declared])
    lengths = np.linalg.norm(np.concatenate([rows.residuals for rows in declared]), axis=1)
    count = min(len(lengths), _COURSE_POINTS)
    runs, numbers = np.arange(count), np.arange(len(lengths))
    starts = runs * (len(lengths) // count) + np.minimum(runs, len(lengths) % count)
    is_longest = lengths == np.repeat(np.maximum.reduceat(lengths, starts), np.diff(starts, append=len(lengths)))
    longest = np.minimum.reduceat(np.where(is_longest, numbers, len(numbers)), starts)
    # Near its limit a parameter is measured and not freed: all of them count.
    all_values = fit.values_of_all() - linearised_at
    left_by_whole = [rows.residuals - rows.jacobians @ all_values for rows in segments]
    left = sum(float(np.sum(np.square(r / rows.sigmas))) for rows, r in zip(segments, left_by_whole, strict=True))
    bias, gain = partial_bias(declared, centre=centre, left_by_whole=left), None
    if "scale" in fit.parameters.names:
        column = fit.parameters.names.index("scale")
        gain = partial_gain(declared, column=column, centre=centre, left_by_whole=left)
        if gain is not None and bias is not None and gain.left_within >= bias.left_within:
            gain = None
    in_noise = None
    if bias is None and gain is None and sum(map(len, declared)) == sum(map(len, segments)):
        in_noise = noisy_part(declared, left_by_whole, centre=centre, parameters=len(all_values))
        if in_noise is not None and in_noise.explained >= _LEAST_EXPLAINED:
            bias = in_noise
    return InertialFit(
        parameters=fit.estimates,
        settled=settled,
        misfit=fit.misfit,
        rms=rms,
        expected_rms=expected,
        rms_error=rms_error,
        model_rms=float(np.sqrt(np.mean(np.square(np.concatenate([rows.error_bounds for rows in segments]))))),
        smoothness=products / total if total > 0 else 0.0,
        rows=sum(map(len, segments)),
        outliers=sum(int(np.count_nonzero(~keep)) for keep in kept),
        worst=max(worst_rows, key=lambda row: abs(row.value) / row.sigma),
        local_deviations=local_deviations,
        disturbed=disturbed,
        noisy_part=None if in_noise is None else (in_noise.start_s, in_noise.stop_s),
        course=np.stack([times_s[longest], lengths[longest]], axis=1),
        partial_bias=None if gain is not None else bias,
        partial_gain=gain,
        bias_drift=bias_drift(declared),
    )


def remaining_residuals(
    fit: GroupedFit,
    segments: Sequence[ComparisonRows],
    kept: Sequence[NDArray[np.bool_]],
    values: Float64,
    linearised_at: Float64,
) -> list[Float64]:
    """Return the residuals (n, 3) of each segment less parameters, and less the walking bias that fits best.

    Parameters
    ----------
    fit
        Of the rows that were kept.
    segments, kept, linearised_at
        As of ``summarise``.
    values
        (P,) parameters.
    """
    residuals = [rows.residuals - rows.jacobians @ (values - linearised_at) for rows in segments]
    # Segments of which no row was kept have no biases.
    fitted = [number for number, keep in enumerate(kept) if np.any(keep)]
    for number, biases in zip(fitted, fit.nuisances(values), strict=True):
        if len(biases):
            residuals[number] -= segments[number].end_jacobians @ biases
    return residuals


def disturbed_interval(segments: list[ComparisonRows]) -> tuple[float, float] | None:
    """Return the first and the last instant, s, at which residuals as declared exceed all noise.

    The result is None where there is no such instant, or where too few rows outside that interval agree.
    """
    times_s = np.concatenate([rows.times_s for rows in segments])
    outlying = np.concatenate(
        [(np.abs(rows.residuals) > OUTLIER * rows.sigmas + rows.error_bounds).any(axis=1) for rows in segments]
    )
    if not outlying.any():
        return None
    start_s, stop_s = float(times_s[outlying][0]), float(times_s[outlying][-1])
    outside = np.count_nonzero((times_s < start_s) | (times_s > stop_s))
    return (start_s, stop_s) if outside >= max(FEWEST_ROWS, _LEAST_OUTSIDE * len(times_s)) else None

"""Fit IMU against poses over a whole sequence, by segments.

The fit is repeated where the timestamps have to be corrected.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.grouped_fit import FitParameters, GroupedFit
from fedora_qa.estimators.fitting.normal_equations import (
    BlockEquations,
    MarkovNoise,
    block_equations,
    markov_squares,
)
from fedora_qa.estimators.fitting.robust import NORMAL_QUARTILE
from fedora_qa.estimators.imu.bias_walk import SegmentWalk
from fedora_qa.estimators.imu.preintegration import (
    ROTATION_PARAMETERS,
    rotation_effects,
    rotation_residuals,
    rotation_rows,
    without_rotation_faults,
)
from fedora_qa.estimators.imu.samples import ComparisonRows, InertialNoise, InertialSamples, RowEffects, segments_of
from fedora_qa.estimators.imu.specific_force import (
    TRANSLATION_PARAMETERS,
    translation_effects,
    translation_residuals,
    translation_rows,
    with_orientations,
    without_translation_faults,
)
from fedora_qa.estimators.imu.summary import (
    FEWEST_ROWS,
    OUTLIER,
    InertialFit,
    disturbed_interval,
    remaining_residuals,
    summarise,
)

Float64 = NDArray[np.float64]

_MARGIN_S: Final = 0.1
"""Length of time beyond the ends of a segment from which samples are used: splines and interpolation no longer depend
on their end conditions there."""

_MOST_ITERATIONS: Final = 12
_CAPTURE_RANGE: Final = 0.5
"""Share of the largest conceivable value of a parameter above which the first fit is returned."""

_LEAST_WALK_S: Final = 1e-3
"""Time that is added to the variance of each walk, s, so that the prior of very short segments can be inverted."""

_MOST_OUTLIERS: Final = 0.1
"""Largest share of outliers. Where more rows lie far out, the model is wrong, and no row is left out."""


@dataclass(frozen=True, slots=True)
class InertialComparison:
    """One way to compare IMU and poses.

    Attributes
    ----------
    rows_of, effects_of
        Make the rows of samples under declared noise, and the parts of the rows that noise of the samples changes.
    residuals_of
        Makes the residuals (n, 3) of the rows and their covariance bands (3, u + 1, n) alone.
    prepared
        Adds to samples an intermediate result that several of these functions need.
    parameters
        The fitted parameters, P of them.
    without
        Removes faults of the sizes of the parameters (P,) from samples.
    nonlinear
        (P,) which parameters ``without`` removes; residuals are linear in all others.
    centre
        Time from that of a row to the middle of what it compares, in spans of the row.
    holds_means
        Whether a bias acts on a row by its mean over the span; else by a weighted mean over twice the span.
    """

    rows_of: Callable[[InertialSamples, InertialNoise], ComparisonRows]
    effects_of: Callable[[InertialSamples, InertialNoise], RowEffects]
    residuals_of: Callable[[InertialSamples, InertialNoise], tuple[Float64, Float64]]
    prepared: Callable[[InertialSamples], InertialSamples]
    parameters: FitParameters
    without: Callable[[InertialSamples, Float64], InertialSamples]
    nonlinear: tuple[bool, ...]
    centre: float
    holds_means: bool


ROTATION: Final = InertialComparison(
    rows_of=rotation_rows,
    effects_of=rotation_effects,
    residuals_of=rotation_residuals,
    prepared=lambda samples: samples,
    parameters=ROTATION_PARAMETERS,
    without=without_rotation_faults,
    nonlinear=(*[True] * 3, *[False] * 3, *[True] * 4),
    centre=0.5,
    holds_means=True,
)
TRANSLATION: Final = InertialComparison(
    rows_of=translation_rows,
    effects_of=translation_effects,
    residuals_of=translation_residuals,
    prepared=with_orientations,
    parameters=TRANSLATION_PARAMETERS,
    without=without_translation_faults,
    nonlinear=(*[True] * 3, *[False] * 9),
    centre=0.0,
    holds_means=False,
)


def fit_inertial(
    samples: InertialSamples, noise: InertialNoise, comparison: InertialComparison, *, bias_walk: float
) -> InertialFit | None:
    """Fit the parameters of a comparison to a whole sequence.

    Free parameters in which the residuals are not linear are removed from the samples, and all parameters are fitted
    again, until they converge (Gauss-Newton). Where they do not converge, the first fit is returned; its residuals are
    then large.

    Two streams that differ in a way that no parameter describes (smoothed poses, another motion) leave residuals that
    nearly collinear parameters, such as gravity, biases and lever arm in steady flight, fit with values of any size.
    Where a free parameter is not determined (``ParameterEstimate.determined``), the group that was freed last, which
    explains least, is barred, and the fit is repeated. What it had absorbed then stands in the residuals.

    Parameters
    ----------
    comparison
        ``ROTATION`` or ``TRANSLATION``.
    bias_walk
        Declared random walk of the bias of the sensor from zero, rad/s^2/sqrt(Hz) or m/s^3/sqrt(Hz). If it is above 0,
        the biases at both ends of each segment are unknowns, and what the walk does between them is noise of the rows.

    Returns
    -------
    InertialFit or None
        None where there are too few rows.
    """
    barred: tuple[str, ...] = ()
    settled = True
    while True:
        fit, free = _converged(samples, noise, comparison, bias_walk, barred)
        if fit is None:
            return None
        # Without a group a fit may converge that did not: it describes the two streams no better.
        settled &= fit.settled
        if all(parameter.determined for parameter in fit.parameters.values() if parameter.free):
            return replace(fit, settled=settled)
        barred = (*barred, free[-1])


def _converged(
    samples: InertialSamples,
    noise: InertialNoise,
    comparison: InertialComparison,
    bias_walk: float,
    barred: tuple[str, ...],
) -> tuple[InertialFit | None, tuple[str, ...]]:
    """Return the fit that converged, or else the first, and its freed groups in their order; none of them is barred."""
    first: InertialFit | None = None
    first_free: tuple[str, ...] = ()
    disturbed: tuple[float, float] | None = None
    declared: list[ComparisonRows] = []
    linearised_at = np.zeros(len(comparison.parameters.names))
    for _ in range(_MOST_ITERATIONS):
        segments = _segments(comparison.without(samples, linearised_at), noise, comparison, bias_walk)
        if sum(map(len, segments)) < max(FEWEST_ROWS, 0 if first is None else first.rows // 2):
            return first, first_free
        fit, kept = _robust_fit(segments, comparison.parameters, linearised_at, barred)
        # Only parameters in which the residuals are not linear have to be removed from the samples.
        free = np.where(comparison.nonlinear, fit.values_of_free(), 0.0)
        if first is None:
            disturbed, declared = disturbed_interval(segments), segments
        fitted = fit.estimates
        errors = np.array([fitted[name].standard_error for name in fit.parameters.names])
        # Converged: no parameter moves by more than a hundredth of its error.
        if np.all(np.abs(free - linearised_at) <= 0.01 * errors):
            return (
                summarise(
                    fit, segments, kept, linearised_at, disturbed, declared, settled=True, centre=comparison.centre
                ),
                fit.free,
            )
        if first is None:
            free_values = fit.values_of_free()
            first = summarise(
                fit, segments, kept, free_values, disturbed, declared, settled=False, centre=comparison.centre
            )
            first_free = fit.free
        if np.any(np.abs(free) > _CAPTURE_RANGE * np.array(comparison.parameters.largest)):
            return first, first_free
        linearised_at = free
    return first, first_free


def _segments(
    samples: InertialSamples, noise: InertialNoise, comparison: InertialComparison, bias_walk: float
) -> list[ComparisonRows]:
    """Return the rows of each segment of time that has enough rows."""
    times_s = samples.pose_times_s
    segments = []
    for segment in segments_of(times_s, noise.shortest_segment_s):
        first_s, last_s = times_s[segment.start], times_s[segment.stop - 1]
        nearby = samples.between(first_s - _MARGIN_S, last_s + _MARGIN_S)
        # Each row belongs to a pose.
        if min(len(nearby.imu_times_s), len(nearby.pose_times_s)) < FEWEST_ROWS:
            continue
        nearby = comparison.prepared(nearby)
        rows = with_scatter(comparison.rows_of(nearby, noise), nearby, noise, comparison.effects_of)
        rows = rows.select((rows.times_s >= first_s) & (rows.times_s <= last_s))
        if len(rows) < FEWEST_ROWS:
            continue
        if bias_walk > 0:
            middles_s, (before_s, after_s) = rows.times_s + comparison.centre * rows.spans_s, rows.spans_s[[0, -1]] / 2
            lengths_s = rows.spans_s if comparison.holds_means else np.zeros(len(rows))
            walk = SegmentWalk(bias_walk, middles_s, middles_s[0] - before_s, middles_s[-1] + after_s, lengths_s)
            rows = replace(rows, walk=walk)
        segments.append(rows)
    return segments


def with_scatter(
    rows: ComparisonRows,
    samples: InertialSamples,
    noise: InertialNoise,
    effects_of: Callable[[InertialSamples, InertialNoise], RowEffects],
) -> ComparisonRows:
    """Return the rows with the part of their residuals and jacobians that the noise of the IMU causes.

    The regressor of a gain is the motion as the gyro measures it, and its noise is also in the residual (errors in
    variables). Where nothing moves, the regressor is noise alone, and the fitted gain is arbitrary. With J = J0 + j of
    noise j, and residuals r0 + n, the expected score ``J^T C^-1 r`` is biased by ``E[j^T C^-1 n]``, and the information
    ``J^T C^-1 J`` is too large by ``E[j^T C^-1 j]``.

    Both biases are measured. Two halves of the samples, the even and the odd ones, hold the same motion with
    independent noise of twice the variance. Half the difference of their results holds no motion and has the noise of
    the result of all samples: ``dJ = (J_even - J_odd)/2`` and ``dr = (r_even - r_odd)/2`` have the covariances of j and
    n. Hence ``dJ^T C^-1 dr`` and ``dJ^T C^-1 dJ`` estimate the two biases without bias, for noise of any size.
    Subtracting the first one equals multiplying the regressors of either half by the residuals of the other, (J_even
    r_odd + J_odd r_even)/2. For exact samples the differences are the error of the integration, of fourth order, and
    vanish in the product.

    Parameters
    ----------
    rows
        The rows of the samples.
    samples
        Samples of both streams.
    effects_of
        Makes residuals and jacobians of samples.

    Returns
    -------
    ComparisonRows
        With ``scatter``. The rows are unchanged where no noise of the IMU is declared, or where the halves do not
        give all rows, as at the ends of very few samples.

    Sources
    -------
    First principles; for errors in variables W. Fuller, Measurement Error Models, Wiley 1987, sections 1.2, 2.2.
    """
    if noise.smoothing_s == 0:
        return rows
    even, odd = (effects_of(half, noise) for half in halves(samples))
    if not (np.isin(rows.poses, even.poses).all() and np.isin(rows.poses, odd.poses).all()):
        return rows
    in_even, in_odd = (np.isin(half.poses, rows.poses) for half in (even, odd))
    scatter = replace(
        rows,
        residuals=(even.residuals[in_even] - odd.residuals[in_odd]) / 2,
        jacobians=(even.jacobians[in_even] - odd.jacobians[in_odd]) / 2,
        model_errors=np.zeros_like(rows.model_errors),
    )
    return replace(rows, scatter=scatter)


def halves(samples: InertialSamples) -> tuple[InertialSamples, InertialSamples]:
    """Return the samples with the even ones of the IMU only, and with the odd ones only.

    Both halves keep the first and the last sample of the IMU, so that the span stays the same.
    """
    last = len(samples.imu_times_s) - 1
    even, odd = (
        np.unique(np.concatenate(([0], np.arange(first, last, 2), [last])).astype(np.intp)) for first in (0, 1)
    )
    return samples.with_imu_samples(even), samples.with_imu_samples(odd)


def _robust_fit(
    segments: list[ComparisonRows],
    parameters: FitParameters,
    linearised_at: Float64,
    barred: tuple[str, ...],
) -> tuple[GroupedFit, list[NDArray[np.bool_]]]:
    """Fit all rows, then fit without the outliers of the fit of all parameters; return the fit and the rows kept."""
    kept = [np.ones(len(rows), dtype=np.bool_) for rows in segments]
    fit = _fit(segments, kept, parameters, linearised_at, barred)
    for _ in range(3):
        remaining = remaining_residuals(fit, segments, kept, fit.values_of_all(), linearised_at)
        # The largest of the three residuals of each row, in units of its sigma.
        deviations = [
            (np.abs(residuals) / rows.sigmas_between_ends).max(axis=-1)
            for rows, residuals in zip(segments, remaining, strict=True)
        ]
        # sigma = median / 0.674 for normal values. The median is robust against outliers.
        scale = max(1.0, float(np.median(np.concatenate(deviations))) / NORMAL_QUARTILE)
        clean = [deviation <= OUTLIER * scale for deviation in deviations]
        outliers = sum(int(np.count_nonzero(~rows)) for rows in clean)
        if outliers > _MOST_OUTLIERS * sum(map(len, clean)) or all(map(np.array_equal, clean, kept)):
            break
        kept = clean
        fit = _fit(segments, kept, parameters, linearised_at, barred)
    return fit, kept


def _fit(
    segments: list[ComparisonRows],
    kept: list[NDArray[np.bool_]],
    parameters: FitParameters,
    linearised_at: Float64,
    barred: tuple[str, ...],
) -> GroupedFit:
    """Fit the rows that are kept, with biases at the ends of each segment if they walk; barred groups stay 0."""
    used = [rows.select(keep) for rows, keep in zip(segments, kept, strict=True) if np.any(keep)]
    walks = [rows.walk for rows in used if rows.walk is not None]
    walk_covariance: Float64 | None = None
    if walks:
        # Covariance (2 B, 2 B) of the biases at the ends of segments. Wiener process: E[b(s) b(t)] = walk^2 min(s, t).
        ends_s = np.maximum([end_s for walk in walks for end_s in (walk.start_s, walk.stop_s)], 0.0)
        shared_s = np.minimum(ends_s[:, None], ends_s)
        walk_covariance = walks[0].density ** 2 * (shared_s + _LEAST_WALK_S * np.eye(len(ends_s)))
    scatters = [_scatter_equations(rows, parameters) for rows in used]
    biases = np.array([rows.rounding_bias for rows in used])
    return GroupedFit(
        [_equations(rows, rows) for rows in used],
        parameters,
        linearised_at,
        walk_covariance,
        [block for block in scatters if block is not None] if None not in scatters else None,
        barred,
        biases if biases.any() else None,
    )


def _scatter_equations(rows: ComparisonRows, parameters: FitParameters) -> BlockEquations | None:
    """Return the equations of what noise of the samples alone gives; None without such noise."""
    if rows.walk is None:
        return None if rows.scatter is None else _equations(rows.scatter, rows)
    silent = replace(rows, residuals=np.zeros_like(rows.residuals), jacobians=np.zeros_like(rows.jacobians))
    block = _equations(silent if rows.scatter is None else rows.scatter, rows)
    if "scale" in parameters.groups:
        # A gain acts on the walking bias of the samples, too. Its regressor contains the change A b of the residual by
        # the bridge b: E[(A b)^T C^-1 A b] is in the score and in the information.
        (gain,) = parameters.groups["scale"]
        squares = markov_squares(rows.covariance_bands, _bridge(rows, rows.walk))
        block.normal[gain, gain] += squares
        block.right[gain] += squares
    return block


def _equations(rows: ComparisonRows, noise: ComparisonRows) -> BlockEquations:
    """Return the equations of rows with the unknown biases and the noise of ``noise``, which are the same rows."""
    if noise.walk is None:
        return block_equations(rows.residuals, rows.jacobians, rows.covariance_bands, rows.model_errors)
    jacobians, bridge = np.concatenate((rows.jacobians, noise.end_jacobians), axis=-1), _bridge(noise, noise.walk)
    return block_equations(rows.residuals, jacobians, rows.covariance_bands, rows.model_errors, bridge)


def _bridge(rows: ComparisonRows, walk: SegmentWalk) -> MarkovNoise:
    return MarkovNoise(rows.bias_jacobians, walk.bridge_information, rows.by_bias(walk.mean_deficits))

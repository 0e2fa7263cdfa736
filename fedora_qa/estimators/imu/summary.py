"""Summary of a comparison of IMU and poses: parameters, residuals, the worst row, local deviations."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.grouped_fit import GroupedFit, ParameterEstimate
from fedora_qa.estimators.fitting.sensitivity import SensitivityRange, sensitivity_range
from fedora_qa.estimators.imu.partial_bias import BiasDrift, PartialBias, bias_drift, partial_bias
from fedora_qa.estimators.imu.samples import ComparisonRows

Float64 = NDArray[np.float64]

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
    course
        (n, 2) instant, s, and length of the residual of the samples as declared, without any parameter: the longest
        of each of n <= 1000 runs of rows.
    partial_bias
        The part of the sequence whose bias removes most of the residuals as declared; None where that is the whole
        sequence.
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
    course: Float64
    partial_bias: PartialBias | None
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

    Residuals are those of the rows less the free parameters beyond ``linearised_at``.

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
    values = free - linearised_at
    residuals = [rows.residuals - rows.jacobians @ values for rows in segments]
    sigmas = np.concatenate([rows.sigmas[keep] for rows, keep in zip(segments, kept, strict=True)])
    squares = np.concatenate([np.square(r[keep]) for r, keep in zip(residuals, kept, strict=True)])
    expected = float(np.sqrt(np.mean(np.square(sigmas))))
    rms = float(np.sqrt(np.mean(squares)))
    # Standard error of the rms of Gaussian rows whose neighbours have the correlation -1/2 or -2/3. Squares of
    # neighbours have the square of that as correlation, so that the variance of their mean is at most
    # 1 + 2 (4/9 + 1/36) = 1.94 times that of independent ones.
    weights = np.square(sigmas) / np.mean(np.square(sigmas))
    rms_error = float(expected * np.sqrt(1.94 * np.mean(np.square(weights)) / (2 * sigmas.size)))
    # smoothness = sum of r_i r_i+1 / sum of r_i^2, over all segments and axes. Rows that were left out part neighbours.
    products = 0.0
    for rows, of_segment in zip(segments, residuals, strict=True):
        are_neighbours = np.diff(rows.poses) == 1
        products += float(np.sum((of_segment[1:] * of_segment[:-1])[are_neighbours]))
    total = sum(float(np.sum(np.square(rows))) for rows in residuals)
    all_model_errors = np.concatenate([rows.error_bounds.max(axis=1) for rows in segments])
    row_sensitivity = sensitivity_range(
        np.concatenate([rows.sigmas for rows in segments]), all_model_errors[:, np.newaxis]
    )
    # The worst row deviates most in units of its sigma, on its worst axis.
    worst_rows = []
    for rows, of_segment in zip(segments, residuals, strict=True):
        row, axis = np.unravel_index(np.argmax(np.abs(of_segment) / rows.sigmas), of_segment.shape)
        worst_rows.append(
            WorstRow(
                time_s=float(rows.times_s[row]),
                value=float(of_segment[row, axis]),
                sigma=float(rows.sigmas[row, axis]),
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
    return InertialFit(
        parameters=fit.fitted(),
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
        course=np.stack([times_s[longest], lengths[longest]], axis=1),
        partial_bias=partial_bias(declared, centre=centre),
        bias_drift=bias_drift(declared),
    )


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

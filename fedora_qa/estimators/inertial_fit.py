"""Fit IMU against poses over a whole sequence: stretch by stretch, iterated where the stamps have to move."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.grouped_fit import Fitted, GroupedFit, Parameters, block_equations
from fedora_qa.estimators.inertial_samples import InertialNoise, InertialSamples, Rows, blocks_of
from fedora_qa.estimators.preintegration import ROTATION_PARAMETERS, rotation_rows, without_rotation_faults
from fedora_qa.estimators.specific_force import TRANSLATION_PARAMETERS, translation_rows, without_translation_faults

Float64 = NDArray[np.float64]

_MARGIN_S: Final = 0.1
"""Samples beyond a stretch's ends: splines and interpolation forget their ends within it."""

_FEWEST_ROWS: Final = 8
_MOST_ITERATIONS: Final = 12
_REACH: Final = 0.5
"""Share of its largest conceivable value beyond which a parameter is no longer followed."""

_LEAST_OUTSIDE: Final = 0.1
"""Share of the rows that must agree for a disturbance to be called local."""

_LEAST_WALK_S: Final = 1e-3
"""Keeps the prior of stretches of hardly any length invertible."""

_COURSE_POINTS: Final = 1000
_OUTLIER: Final = 8.0
_MOST_OUTLIERS: Final = 0.1
"""Where more rows than this share lie far out, it is the model that is wrong, and none is left out."""


@dataclass(frozen=True, slots=True)
class WorstRow:
    """The row that fits least: its value on its worst axis, the sigma it should have, its known error."""

    time_s: float
    value: float
    sigma: float
    model_error: float


@dataclass(frozen=True, slots=True)
class InertialFit:
    """What the comparison of IMU and poses shows.

    Attributes
    ----------
    parameters
        By name.
    settled
        Whether the freed parameters settled. If not the two streams disagree in another way than these parameters
        describe, and residuals are stated with none of them taken out.
    misfit
        Root mean square of whitened residuals with all parameters fitted, each in units of its expected sigma.
    rms, expected_rms, rms_error
        Of the residuals after the freed parameters: measured, expected of noise, and the standard error of the former.
    model_rms
        Root mean square of the known error of the model.
    smoothness
        Correlation of neighbouring residuals: that of noise is not positive, that of another motion is near 1.
    rows, outliers
        How many comparisons were made, and how many lie so far out that they were left out of the fit.
    worst
        Of all rows, after the freed parameters.
    disturbed
        From the first to the last instant, s, at which the streams as declared differ beyond all noise, if they agree
        outside; None where they agree throughout, or nowhere.
    course
        (n, 2) instant in s and length of the residual, after the freed parameters: the longest of each of at most 1000
        runs of rows.
    """

    parameters: Mapping[str, Fitted]
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
    disturbed: tuple[float, float] | None
    course: Float64


@dataclass(frozen=True, slots=True)
class Comparison:
    """One way to compare IMU and poses.

    Attributes
    ----------
    rows_of
        Makes the residuals.
    parameters
        What may be wrong.
    without
        Takes parameters (P,) out of samples.
    nonlinear
        (P,) which parameters ``without`` takes out; residuals are linear in all others.
    """

    rows_of: Callable[[InertialSamples, InertialNoise], Rows]
    parameters: Parameters
    without: Callable[[InertialSamples, Float64], InertialSamples]
    nonlinear: tuple[bool, ...]


ROTATION: Final = Comparison(
    rotation_rows, ROTATION_PARAMETERS, without_rotation_faults, (*[True] * 3, *[False] * 3, *[True] * 4)
)
TRANSLATION: Final = Comparison(
    translation_rows, TRANSLATION_PARAMETERS, without_translation_faults, (*[True] * 3, *[False] * 9)
)


def fit_inertial(
    samples: InertialSamples, noise: InertialNoise, comparison: Comparison, *, bias_walk: float
) -> InertialFit | None:
    """Fit the comparison's parameters; None where there are too few rows.

    Freed parameters in which the residuals are not linear are taken out of the samples and all is fitted again, until
    they settle (Gauss-Newton); where they do not, the first fit stands: its residuals tell. A declared ``bias_walk``
    gives each stretch a bias of its own: a random walk from zero.
    """
    first: InertialFit | None = None
    disturbed: tuple[float, float] | None = None
    at = np.zeros(len(comparison.parameters.names))
    for _ in range(_MOST_ITERATIONS):
        stretches = _stretches(comparison.without(samples, at), noise, comparison.rows_of)
        if sum(map(len, stretches)) < max(_FEWEST_ROWS, 0 if first is None else first.rows // 2):
            return first
        fit, kept = _robust_fit(stretches, comparison.parameters, at, bias_walk)
        moved = np.where(comparison.nonlinear, fit.values_of_free(), 0.0)
        if first is None:
            disturbed = _disturbed(stretches)
            first = _summarise(fit, stretches, kept, fit.values_of_free(), disturbed, settled=False)
        if _settled(moved - at, fit):
            return _summarise(fit, stretches, kept, at, disturbed, settled=True)
        if np.any(np.abs(moved) > _REACH * np.array(comparison.parameters.largest)):
            return first
        at = moved
    return first


def _stretches(
    samples: InertialSamples, noise: InertialNoise, rows_of: Callable[[InertialSamples, InertialNoise], Rows]
) -> list[Rows]:
    times_s = samples.pose_times_s
    found = []
    for block in blocks_of(times_s, noise.shortest_stretch_s):
        first_s, last_s = times_s[block.start], times_s[block.stop - 1]
        near = samples.between(first_s - _MARGIN_S, last_s + _MARGIN_S)
        if len(near.imu_times_s) < _FEWEST_ROWS or len(near.pose_times_s) < 3:
            continue
        rows = rows_of(near, noise)
        rows = rows.select((rows.times_s >= first_s) & (rows.times_s <= last_s))
        if len(rows) >= _FEWEST_ROWS:
            found.append(rows)
    return found


def _robust_fit(
    stretches: list[Rows], parameters: Parameters, at: Float64, bias_walk: float
) -> tuple[GroupedFit, list[NDArray[np.bool_]]]:
    """Fit all rows, then without those that lie far out of the fit of all parameters."""
    kept = [np.ones(len(rows), dtype=np.bool_) for rows in stretches]
    fit = _fit(stretches, kept, parameters, at, bias_walk)
    for _ in range(3):
        deviations = [_deviations(rows, fit.values_of_all() - at) for rows in stretches]
        scale = max(1.0, float(np.median(np.concatenate(deviations))) / 0.6745)
        clean = [deviation <= _OUTLIER * scale for deviation in deviations]
        out = sum(int(np.count_nonzero(~rows)) for rows in clean)
        if out > _MOST_OUTLIERS * sum(map(len, clean)) or all(map(np.array_equal, clean, kept)):
            break
        kept = clean
        fit = _fit(stretches, kept, parameters, at, bias_walk)
    return fit, kept


def _fit(
    stretches: list[Rows], kept: list[NDArray[np.bool_]], parameters: Parameters, at: Float64, bias_walk: float
) -> GroupedFit:
    chosen = [rows.select(keep) for rows, keep in zip(stretches, kept, strict=True) if np.any(keep)]
    walks = bias_walk > 0
    equations = [
        block_equations(
            rows.residuals,
            np.concatenate((rows.jacobians, rows.bias_jacobians), axis=-1) if walks else rows.jacobians,
            rows.covariance_bands,
            rows.model_errors,
        )
        for rows in chosen
    ]
    return GroupedFit(equations, parameters, at, _walk_covariance(chosen, bias_walk) if walks else None)


def _walk_covariance(stretches: list[Rows], bias_walk: float) -> Float64:
    """Covariance (B, B) of what a random walk from zero adds to stretches.

    Between stretches that is the walk's own, the time to the middle of the earlier one. The mean over a stretch of
    length L varies by L/6 less than its middle does; the walk strays from that mean by L/6 in the mean square. Both
    disturb a fit, and together they are the time to the middle.
    """
    middles_s = np.maximum([rows.times_s.mean() for rows in stretches], 0.0)
    shared_s = np.minimum(middles_s[:, None], middles_s)
    covariance: Float64 = bias_walk**2 * (shared_s + _LEAST_WALK_S * np.eye(len(stretches)))
    return covariance


def _deviations(rows: Rows, values: Float64) -> Float64:
    """Return (n,) the largest of the three residuals of each row, in units of its sigma."""
    left = rows.residuals - rows.jacobians @ values
    largest: Float64 = (np.abs(left) / rows.sigmas).max(axis=-1)
    return largest


def _settled(step: Float64, fit: GroupedFit) -> bool:
    fitted = fit.fitted()
    errors = np.array([fitted[name].standard_error for name in fit.parameters.names])
    return bool(np.all(np.abs(step) <= 0.01 * errors))


def _summarise(
    fit: GroupedFit,
    stretches: list[Rows],
    kept: list[NDArray[np.bool_]],
    at: Float64,
    disturbed: tuple[float, float] | None,
    *,
    settled: bool,
) -> InertialFit:
    """Describe the fit; residuals are those of the freed parameters beyond ``at``."""
    values = fit.values_of_free() - at
    left = [rows.residuals - rows.jacobians @ values for rows in stretches]
    sigmas = np.concatenate([rows.sigmas[keep] for rows, keep in zip(stretches, kept, strict=True)])
    squares = np.concatenate([np.square(r[keep]) for r, keep in zip(left, kept, strict=True)])
    expected = float(np.sqrt(np.mean(np.square(sigmas))))
    rms = float(np.sqrt(np.mean(squares)))
    return InertialFit(
        parameters=fit.fitted(),
        settled=settled,
        misfit=fit.misfit,
        rms=rms,
        expected_rms=expected,
        rms_error=_error_of_rms(expected, sigmas),
        model_rms=float(np.sqrt(np.mean(np.square(np.concatenate([rows.model_errors for rows in stretches]))))),
        smoothness=_smoothness(left),
        rows=sum(map(len, stretches)),
        outliers=sum(int(np.count_nonzero(~keep)) for keep in kept),
        worst=_worst(stretches, left),
        disturbed=disturbed,
        course=_course(stretches, left),
    )


def _error_of_rms(expected: float, sigmas: Float64) -> float:
    """Return the standard error of an honest rms: of Gaussian rows whose neighbours correlate by -1/2 or -2/3.

    Squares of neighbours correlate by the square of that: the variance of their mean is at most 1 + 2 (4/9 + 1/36)
    times that of independent ones.
    """
    weights = np.square(sigmas) / np.mean(np.square(sigmas))
    return float(expected * np.sqrt(1.94 * np.mean(np.square(weights)) / (2 * sigmas.size)))


def _disturbed(stretches: list[Rows]) -> tuple[float, float] | None:
    times_s = np.concatenate([rows.times_s for rows in stretches])
    far = np.concatenate(
        [
            (np.abs(rows.residuals) > _OUTLIER * rows.sigmas + np.abs(rows.model_errors)).any(axis=1)
            for rows in stretches
        ]
    )
    if not far.any():
        return None
    start_s, stop_s = float(times_s[far][0]), float(times_s[far][-1])
    outside = np.count_nonzero((times_s < start_s) | (times_s > stop_s))
    return (start_s, stop_s) if outside >= max(_FEWEST_ROWS, _LEAST_OUTSIDE * len(times_s)) else None


def _smoothness(left: list[Float64]) -> float:
    products = sum(float(np.sum(residuals[1:] * residuals[:-1])) for residuals in left)
    squares = sum(float(np.sum(np.square(residuals))) for residuals in left)
    return products / squares if squares > 0 else 0.0


def _course(stretches: list[Rows], left: list[Float64]) -> Float64:
    times_s = np.concatenate([rows.times_s for rows in stretches])
    lengths = np.linalg.norm(np.concatenate(left), axis=1)
    runs = np.array_split(np.arange(len(lengths)), min(len(lengths), _COURSE_POINTS))
    longest = [run[np.argmax(lengths[run])] for run in runs]
    return np.stack([times_s[longest], lengths[longest]], axis=1)


def _worst(stretches: list[Rows], left: list[Float64]) -> WorstRow:
    found = []
    for rows, residuals in zip(stretches, left, strict=True):
        row, axis = np.unravel_index(np.argmax(np.abs(residuals) / rows.sigmas), residuals.shape)
        found.append(
            WorstRow(
                time_s=float(rows.times_s[row]),
                value=float(residuals[row, axis]),
                sigma=float(rows.sigmas[row, axis]),
                model_error=float(np.abs(rows.model_errors[row]).max()),
            )
        )
    return max(found, key=lambda row: abs(row.value) / row.sigma)

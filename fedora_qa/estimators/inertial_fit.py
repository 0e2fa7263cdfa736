"""Fit IMU against poses over a whole sequence: stretch by stretch, iterated where the stamps have to move."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.grouped_fit import BlockEquations, Fitted, GroupedFit, Parameters, block_equations
from fedora_qa.estimators.inertial_samples import InertialNoise, InertialSamples, Rows, blocks_of

Float64 = NDArray[np.float64]
RowsOf = Callable[[InertialSamples, InertialNoise], Rows]

_MARGIN_S: Final = 0.1
"""Samples beyond a stretch's ends: splines and interpolation forget their ends within it."""

_FEWEST_ROWS: Final = 8
_MOST_ITERATIONS: Final = 8
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
    free
        Names of the groups that were freed, the one that explains most first.
    misfit
        Root mean square of whitened residuals with all parameters fitted, each in units of its expected sigma.
    rms, expected_rms, rms_error
        Of the residuals after the freed parameters, per square root of what the noise model allows: the measured, the
        expected, and the standard error of the measured.
    model_rms
        Root mean square of the known error of the model.
    rows, outliers
        How many comparisons were made, and how many lie so far out that they were left out of the fit.
    worst
        Of all rows, after the freed parameters.
    """

    parameters: Mapping[str, Fitted]
    free: tuple[str, ...]
    misfit: float
    rms: float
    expected_rms: float
    rms_error: float
    model_rms: float
    rows: int
    outliers: int
    worst: WorstRow


def fit_inertial(
    samples: InertialSamples, noise: InertialNoise, rows_of: RowsOf, parameters: Parameters, bias_walk: float
) -> InertialFit | None:
    """Fit ``parameters`` to the rows that ``rows_of`` makes; None where there are too few.

    Freed time offsets and drifts are taken out of the stamps and all is fitted again, until they settle (Gauss-Newton).
    A declared ``bias_walk`` lets the bias of each stretch be its own, with the variance a walk from zero has by then.
    """
    at = np.zeros(len(parameters.names))
    for _ in range(_MOST_ITERATIONS):
        stretches = _stretches(samples.with_imu_earlier(*at[:2]), noise, rows_of)
        if sum(len(rows) for rows in stretches) < _FEWEST_ROWS:
            return None
        fit, kept = _robust_fit(stretches, parameters, at, bias_walk)
        moved = np.where(np.arange(len(at)) < 2, fit.values_of_free(), 0.0)
        settled = _settled(moved - at, fit.fitted(), parameters)
        if settled:
            break
        at = moved
    return _summarise(fit, stretches, kept, at)


def _stretches(samples: InertialSamples, noise: InertialNoise, rows_of: RowsOf) -> list[Rows]:
    times_s = samples.pose_times_s
    found = []
    for block in blocks_of(times_s):
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
    fit = GroupedFit(_equations(stretches, kept, bias_walk), parameters, at)
    for _ in range(3):
        deviations = [_deviations(rows, fit.values_of_all() - at) for rows in stretches]
        scale = max(1.0, float(np.median(np.concatenate(deviations))) / 0.6745)
        clean = [deviation <= _OUTLIER * scale for deviation in deviations]
        out = sum(int(np.count_nonzero(~rows)) for rows in clean)
        if out > _MOST_OUTLIERS * sum(map(len, clean)) or all(map(np.array_equal, clean, kept)):
            break
        kept = clean
        fit = GroupedFit(_equations(stretches, kept, bias_walk), parameters, at)
    return fit, kept


def _equations(stretches: list[Rows], kept: list[NDArray[np.bool_]], bias_walk: float) -> list[BlockEquations]:
    chosen = [rows.select(keep) for rows, keep in zip(stretches, kept, strict=True) if np.any(keep)]
    return [
        block_equations(
            rows.residuals,
            rows.jacobians,
            rows.covariance_bands,
            rows.model_errors,
            nuisances=rows.bias_jacobians if bias_walk > 0 else None,
            nuisance_variance=bias_walk**2 * max(float(rows.times_s[-1]), 1e-3),
        )
        for rows in chosen
    ]


def _deviations(rows: Rows, values: Float64) -> Float64:
    """Return (n,) the largest of the three residuals of each row, in units of its sigma."""
    left = rows.residuals - rows.jacobians @ values
    largest: Float64 = np.abs(left).max(axis=-1) / rows.sigmas
    return largest


def _settled(step: Float64, fitted: Mapping[str, Fitted], parameters: Parameters) -> bool:
    errors = [fitted[name].standard_error for name in parameters.names[:2]]
    return all(abs(step[i]) <= 0.01 * error for i, error in enumerate(errors))


def _summarise(fit: GroupedFit, stretches: list[Rows], kept: list[NDArray[np.bool_]], at: Float64) -> InertialFit:
    values = fit.values_of_free() - at
    left = [rows.residuals - rows.jacobians @ values for rows in stretches]
    sigmas = np.concatenate([rows.sigmas[keep] for rows, keep in zip(stretches, kept, strict=True)])
    spans_s = np.concatenate([rows.spans_s[keep] for rows, keep in zip(stretches, kept, strict=True)])
    squares = [np.mean(np.square(r[keep]), axis=-1) for r, keep in zip(left, kept, strict=True)]
    every = np.concatenate(squares)
    expected = float(np.sqrt(np.mean(np.square(sigmas))))
    rms = float(np.sqrt(np.mean(every)))
    del spans_s
    return InertialFit(
        parameters=fit.fitted(),
        free=fit.free,
        misfit=fit.misfit,
        rms=rms,
        expected_rms=expected,
        rms_error=_error_of_rms(every, squares, expected, sigmas),
        model_rms=float(np.sqrt(np.mean(np.square(np.concatenate([rows.model_errors for rows in stretches]))))),
        rows=sum(map(len, stretches)),
        outliers=sum(int(np.count_nonzero(~keep)) for keep in kept),
        worst=_worst(stretches, left),
    )


def _error_of_rms(every: Float64, by_stretch: list[Float64], expected: float, sigmas: Float64) -> float:
    """Return the standard error of an honest rms: of Gaussian rows whose neighbours correlate by -1/2 or -2/3.

    Squares of neighbours correlate by the square of that: the variance of their mean is at most 1 + 2 (4/9 + 1/36)
    times that of independent ones.
    """
    weights = np.square(sigmas) / np.mean(np.square(sigmas))
    formal = expected * np.sqrt(1.94 * np.mean(weights**2) / (6 * len(every)))
    del by_stretch
    return float(formal)


def _worst(stretches: list[Rows], left: list[Float64]) -> WorstRow:
    found = []
    for rows, residuals in zip(stretches, left, strict=True):
        row, axis = np.unravel_index(np.argmax(np.abs(residuals) / rows.sigmas[:, None]), residuals.shape)
        found.append(
            WorstRow(
                time_s=float(rows.times_s[row]),
                value=float(residuals[row, axis]),
                sigma=float(rows.sigmas[row]),
                model_error=float(np.abs(rows.model_errors[row]).max()),
            )
        )
    return max(found, key=lambda row: abs(row.value) / row.sigma)

"""What the comparison of IMU and poses shows: the fit summed up, and where it is worst, uneven, or disturbed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.grouped_fit import FittedParameter, GroupedFit
from fedora_qa.estimators.imu.samples import Rows

Float64 = NDArray[np.float64]

FEWEST_ROWS: Final = 8
OUTLIER: Final = 8.0
"""Standard deviations beyond which a row is left out of the fit."""

_FEWEST_STRETCHES: Final = 3
_ALIKE: Final = 0.7
"""Share of the largest score from which on stretches deviate alike."""

_LEAST_OUTSIDE: Final = 0.1
"""Share of the rows that must agree for a disturbance to be called local."""

_COURSE_POINTS: Final = 1000


@dataclass(frozen=True, slots=True)
class WorstRow:
    """The row that fits least: its value on its worst axis, the sigma it should have, its known error."""

    time_s: float
    value: float
    sigma: float
    model_error: float


@dataclass(frozen=True, slots=True)
class LocalDeviation:
    """The stretch in which a parameter differs most from its value in the whole sequence.

    Attributes
    ----------
    start_s, stop_s
        Of the stretch.
    value
        Of the parameter there.
    deviation, standard_error, model_error
        From its value in the whole sequence.
    tests
        Of how many stretches it is the worst.
    """

    start_s: float
    stop_s: float
    value: float
    deviation: float
    standard_error: float
    model_error: float
    tests: int


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
    uneven
        By name, where each parameter differs most from itself; none where there is but one stretch.
    disturbed
        From the first to the last instant, s, at which the streams as declared differ beyond all noise, if they agree
        outside; None where they agree throughout, or nowhere.
    course
        (n, 2) instant in s and length of the residual, after the freed parameters: the longest of each of at most 1000
        runs of rows.
    """

    parameters: Mapping[str, FittedParameter]
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


def summarise(
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
        local_deviations=_local_deviations(fit, stretches, kept),
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


def _local_deviations(
    fit: GroupedFit, stretches: list[Rows], kept: list[NDArray[np.bool_]]
) -> dict[str, LocalDeviation]:
    """Return where each parameter differs most; of stretches that differ alike, where it is largest."""
    used = [rows for rows, keep in zip(stretches, kept, strict=True) if np.any(keep)]
    found: dict[str, LocalDeviation] = {}
    if len(used) < _FEWEST_STRETCHES:
        return found
    values = fit.values_of_free()
    for column, name in enumerate(fit.parameters.names):
        local = fit.local(name)
        scores = np.abs(local.deviations) / local.standard_errors
        alike = scores >= _ALIKE * scores.max()
        worst = int(np.argmax(np.where(alike, np.abs(values[column] + local.deviations), -1.0)))
        found[name] = LocalDeviation(
            start_s=float(used[worst].times_s[0]),
            stop_s=float(used[worst].times_s[-1]),
            value=float(values[column] + local.deviations[worst]),
            deviation=float(local.deviations[worst]),
            standard_error=float(local.standard_errors[worst]),
            model_error=float(local.model_errors[worst]),
            tests=len(used),
        )
    return found


def disturbed_span(stretches: list[Rows]) -> tuple[float, float] | None:
    """Return from when to when, s, rows as declared lie beyond all noise, if enough agree outside; else None."""
    times_s = np.concatenate([rows.times_s for rows in stretches])
    far = np.concatenate(
        [(np.abs(rows.residuals) > OUTLIER * rows.sigmas + np.abs(rows.model_errors)).any(axis=1) for rows in stretches]
    )
    if not far.any():
        return None
    start_s, stop_s = float(times_s[far][0]), float(times_s[far][-1])
    outside = np.count_nonzero((times_s < start_s) | (times_s > stop_s))
    return (start_s, stop_s) if outside >= max(FEWEST_ROWS, _LEAST_OUTSIDE * len(times_s)) else None


def _smoothness(left: list[Float64]) -> float:
    products = sum(float(np.sum(residuals[1:] * residuals[:-1])) for residuals in left)
    squares = sum(float(np.sum(np.square(residuals))) for residuals in left)
    return products / squares if squares > 0 else 0.0


def _course(stretches: list[Rows], left: list[Float64]) -> Float64:
    times_s = np.concatenate([rows.times_s for rows in stretches])
    lengths = np.linalg.norm(np.concatenate(left), axis=1)
    starts = _starts_of_runs(len(lengths))
    rows = np.arange(len(lengths))
    is_longest = lengths == np.repeat(np.maximum.reduceat(lengths, starts), np.diff(starts, append=len(lengths)))
    longest = np.minimum.reduceat(np.where(is_longest, rows, len(rows)), starts)
    return np.stack([times_s[longest], lengths[longest]], axis=1)


def _starts_of_runs(count: int) -> NDArray[np.intp]:
    """Cut rows into at most 1000 runs that are as long as one another, or by one longer, those first."""
    runs = min(count, _COURSE_POINTS)
    numbers = np.arange(runs)
    return numbers * (count // runs) + np.minimum(numbers, count % runs)


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

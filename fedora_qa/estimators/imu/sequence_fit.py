"""Fit IMU against poses over a whole sequence: stretch by stretch, iterated where the stamps have to move."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.grouped_fit import GroupedFit, Parameters
from fedora_qa.estimators.fitting.normal_equations import BlockEquations, block_equations
from fedora_qa.estimators.fitting.robust import NORMAL_QUARTILE
from fedora_qa.estimators.imu.preintegration import (
    ROTATION_PARAMETERS,
    rotation_effects,
    rotation_rows,
    without_rotation_faults,
)
from fedora_qa.estimators.imu.samples import Effects, InertialNoise, InertialSamples, Rows, blocks_of
from fedora_qa.estimators.imu.specific_force import (
    TRANSLATION_PARAMETERS,
    translation_effects,
    translation_rows,
    with_orientations,
    without_translation_faults,
)
from fedora_qa.estimators.imu.split_samples import with_scatter
from fedora_qa.estimators.imu.summary import FEWEST_ROWS, OUTLIER, InertialFit, disturbed_span, summarise

Float64 = NDArray[np.float64]

_MARGIN_S: Final = 0.1
"""Samples beyond a stretch's ends: splines and interpolation forget their ends within it."""

_MOST_ITERATIONS: Final = 12
_REACH: Final = 0.5
"""Share of its largest conceivable value beyond which a parameter is no longer followed."""

_LEAST_WALK_S: Final = 1e-3
"""Keeps the prior of stretches of hardly any length invertible."""

_MOST_OUTLIERS: Final = 0.1
"""Where more rows than this share lie far out, it is the model that is wrong, and none is left out."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """One way to compare IMU and poses.

    Attributes
    ----------
    rows_of, effects_of
        Make the rows, and of them what the noise of the samples disturbs.
    prepared
        Adds to samples what several of these want.
    parameters
        What may be wrong.
    without
        Takes parameters (P,) out of samples.
    nonlinear
        (P,) which parameters ``without`` takes out; residuals are linear in all others.
    """

    rows_of: Callable[[InertialSamples, InertialNoise], Rows]
    effects_of: Callable[[InertialSamples, InertialNoise], Effects]
    prepared: Callable[[InertialSamples], InertialSamples]
    parameters: Parameters
    without: Callable[[InertialSamples, Float64], InertialSamples]
    nonlinear: tuple[bool, ...]


ROTATION: Final = Comparison(
    rows_of=rotation_rows,
    effects_of=rotation_effects,
    prepared=lambda samples: samples,
    parameters=ROTATION_PARAMETERS,
    without=without_rotation_faults,
    nonlinear=(*[True] * 3, *[False] * 3, *[True] * 4),
)
TRANSLATION: Final = Comparison(
    rows_of=translation_rows,
    effects_of=translation_effects,
    prepared=with_orientations,
    parameters=TRANSLATION_PARAMETERS,
    without=without_translation_faults,
    nonlinear=(*[True] * 3, *[False] * 9),
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
        stretches = _stretches(comparison.without(samples, at), noise, comparison)
        if sum(map(len, stretches)) < max(FEWEST_ROWS, 0 if first is None else first.rows // 2):
            return first
        fit, kept = _robust_fit(stretches, comparison.parameters, at, bias_walk)
        moved = np.where(comparison.nonlinear, fit.values_of_free(), 0.0)
        if first is None:
            disturbed = disturbed_span(stretches)
        if _settled(moved - at, fit):
            return summarise(fit, stretches, kept, at, disturbed, settled=True)
        if first is None:
            first = summarise(fit, stretches, kept, fit.values_of_free(), disturbed, settled=False)
        if np.any(np.abs(moved) > _REACH * np.array(comparison.parameters.largest)):
            return first
        at = moved
    return first


def _stretches(samples: InertialSamples, noise: InertialNoise, comparison: Comparison) -> list[Rows]:
    times_s = samples.pose_times_s
    found = []
    for block in blocks_of(times_s, noise.shortest_stretch_s):
        first_s, last_s = times_s[block.start], times_s[block.stop - 1]
        near = samples.between(first_s - _MARGIN_S, last_s + _MARGIN_S)
        if len(near.imu_times_s) < FEWEST_ROWS or len(near.pose_times_s) < 3:
            continue
        near = comparison.prepared(near)
        rows = with_scatter(comparison.rows_of(near, noise), near, noise, comparison.effects_of)
        rows = rows.select((rows.times_s >= first_s) & (rows.times_s <= last_s))
        if len(rows) >= FEWEST_ROWS:
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
        scale = max(1.0, float(np.median(np.concatenate(deviations))) / NORMAL_QUARTILE)
        clean = [deviation <= OUTLIER * scale for deviation in deviations]
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
    scatters = [rows.scatter for rows in chosen if rows.scatter is not None]
    return GroupedFit(
        [_equations(rows, walks) for rows in chosen],
        parameters,
        at,
        _walk_covariance(chosen, bias_walk) if walks else None,
        [_equations(rows, walks) for rows in scatters] if len(scatters) == len(chosen) else None,
    )


def _equations(rows: Rows, walks: bool) -> BlockEquations:
    jacobians = np.concatenate((rows.jacobians, rows.bias_jacobians), axis=-1) if walks else rows.jacobians
    return block_equations(rows.residuals, jacobians, rows.covariance_bands, rows.model_errors)


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

"""From the fits of all fields of one rate to its mean residual flow, its gain, and its geometric templates."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.group_scatter import student_factor
from fedora_qa.estimators.flow.field_fit import (
    CENTRE,
    FOCAL,
    GAIN,
    GEOMETRIC,
    MEAN,
    MOUNTING,
    OF_THE_FLOW,
    beyond_chance,
    gain_of_true,
    lock_in,
    robust_errors,
)
from fedora_qa.estimators.flow.motion_fit import Evidence, sum_of

Float64 = NDArray[np.float64]

_BIAS_PX: Final = 0.005
"""Largest amplitude of the bias by aliases and interpolation, which follows the sine of 2 pi times the flow.

`field_fit.lock_in` derives the law. The amplitude is (energy at 2 pi - w over that at w) / w, averaged with the
weight w^2 E(w) exp(-w^2) of the smoothed image. For a box-shaped pixel and amplitudes that fall as 1/frequency, as at
edges, the ratio is (w / (2 pi - w))^4: 0.0013 px at 1 rad/px, 0.0008 px on average. Interpolation by the spline adds at
most 0.0005 px (see its test). 0.005 px also covers images with more energy at high frequencies. For white noise, which
no scene is, the amplitude would be 0.03 px.
"""

_LEAST_COMMON_GAIN: Final = 0.005
"""Largest common gain of all fields that is not taken for a fault of all fields."""

_GAIN_ERROR: Final = 0.05
"""Relative error of a gain by the linearisation and by the finite differences of the derivative."""


@dataclass(frozen=True, slots=True)
class TemplateSizes:
    """Sizes of templates, fitted to all fields of a rate.

    Attributes
    ----------
    sizes, errors
        (p,) in the units of the templates, and their standard errors.
    biases
        (p,) bounds of the bias by aliases and interpolation.
    """

    sizes: Float64
    errors: Float64
    biases: Float64

    def scaled(self, factor: float) -> "TemplateSizes":
        """Return the sizes in another unit, of which one old unit is ``factor``."""
        return TemplateSizes(factor * self.sizes, factor * self.errors, factor * self.biases)


@dataclass(frozen=True, slots=True)
class RateFit:
    """The common fit of all fields of one rate.

    Attributes
    ----------
    mean
        Mean residual flow (u, v), px.
    gain
        Gain of the stored on the true flow; 1 is 100%.
    geometric
        The templates of ``GEOMETRIC``, in their units; None where depth or motion is missing.
    """

    mean: TemplateSizes
    gain: TemplateSizes
    geometric: TemplateSizes | None


def error_scales(spreads: Sequence[float], freedoms: Sequence[int]) -> list[float]:
    """Return the factors on the formal errors of each field, from the scatter of its tiles.

    The common factor is the median over fields, which a few deviating fields do not change. Fields may differ: two
    equal frames leave no residual at all, a fast rotation a large one. Where a field scatters by more than the median
    explains, its own scatter is used.

    Parameters
    ----------
    spreads, freedoms
        For each field, of ``FieldFit``: mean square of the deviations of its tiles in units of their formal errors,
        and its degrees of freedom, 0 where there is no fit.

    Returns
    -------
    list of float
        One factor for each field; 1 if no field has a fit.
    """
    fitted = [(spread, freedom) for spread, freedom in zip(spreads, freedoms, strict=True) if freedom > 0]
    if not fitted:
        return [1.0] * len(spreads)
    # The median of a chi-square of f degrees of freedom over f is (1 - 2 / 9 f)^3 (Wilson and Hilferty, 1931).
    usual = float(np.median([spread / (1 - 2 / (9 * freedom)) ** 3 for spread, freedom in fitted]))
    common_scale = student_factor(sum(freedom for _, freedom in fitted)) * float(np.sqrt(usual))
    return [
        max(common_scale, student_factor(freedom) * float(np.sqrt(spread)))
        if freedom > 0 and spread > usual * beyond_chance(freedom)
        else common_scale
        for spread, freedom in zip(spreads, freedoms, strict=True)
    ]


def fit_rate(evidences: Sequence[Evidence], scales: Sequence[float]) -> RateFit:
    """Return the fit of the templates of one rate to its fields, of which there is at least one.

    Mean and gain are each fitted alone, and so is each geometric template: a fault changes one of them, not all at
    once.

    Parameters
    ----------
    evidences
        Normal equations of each field.
    scales
        Factor on the formal errors of each field, see ``error_scales``.

    Returns
    -------
    RateFit
        With a bound of the bias by aliases beside each size.
    """
    total = sum_of(evidences)

    def fitted(columns: slice) -> TemplateSizes:
        matrix = total.matrix[columns, columns]
        # A ridge keeps the matrix invertible for templates that are zero in all fields.
        matrix = matrix + np.eye(len(matrix)) * (1e-12 * np.trace(matrix) + 1e-12)
        sizes = np.linalg.solve(matrix, total.vector[columns])
        # Fields are the blocks of the empirical error.
        scores = np.array([field.vector[columns] - field.matrix[columns, columns] @ sizes for field in evidences])
        scatter = np.sum(
            [scale**2 * field.matrix[columns, columns] for field, scale in zip(evidences, scales, strict=True)], axis=0
        )
        return TemplateSizes(sizes, robust_errors(matrix, scatter, scores), _BIAS_PX * lock_in(total, columns))

    gain = fitted(GAIN)
    gain_on_true, slope = gain_of_true(float(gain.sizes[0]))
    alone = [fitted(slice(column, column + 1)) for column in range(GEOMETRIC.start, GEOMETRIC.stop)]
    geometric = TemplateSizes(
        np.concatenate([template.sizes for template in alone]),
        np.concatenate([template.errors for template in alone]),
        np.concatenate([template.biases for template in alone]),
    )
    return RateFit(
        mean=fitted(MEAN),
        # G = g / (1 - g): error and bias scale with dG/dg = 1 / (1 - g)^2.
        gain=TemplateSizes(np.array([gain_on_true]), slope * gain.errors, slope * gain.biases),
        geometric=geometric if total.matrix[GEOMETRIC, GEOMETRIC].any() else None,
    )


def gain_on_true_flow(total: Evidence) -> tuple[float, float, float]:
    """Return a gain on the true flow, its standard error, and the share of the squares that it explains.

    The error is the formal one and that of the linearisation.
    """
    gain, explained_share = total.explained_by(GAIN)
    formal_error = max(float(total.matrix[GAIN, GAIN][0, 0]), 1e-300) ** -0.5
    gain_on_true, slope = gain_of_true(float(gain[0]))
    error = float(np.hypot(slope * formal_error, _GAIN_ERROR * gain_on_true))
    return gain_on_true, error, explained_share


def have_common_gain(evidences: Sequence[Evidence]) -> bool:
    """Return whether most fields have a common gain, so that single frames are not its cause.

    For fewer than two fields the result is False.
    """
    # Least squares of one template: vector over matrix, the share g of the stored flow.
    gains = np.array([field.vector[GAIN][0] / max(field.matrix[GAIN, GAIN][0, 0], 1e-300) for field in evidences])
    if len(gains) < 2:
        return False
    median_gain = float(np.median(gains))
    # 1.5 MAD is the standard deviation of normal values; the standard error of a median is 1.25 times that of a mean.
    error = 1.5 * float(np.median(np.abs(gains - median_gain))) * 1.25 / float(np.sqrt(len(gains)))
    return abs(median_gain) > max(_LEAST_COMMON_GAIN, 5 * error)


def own_mean_share(evidences: Sequence[Evidence]) -> float:
    """Return the share, 0 to 1, of the squares explained by the flow's templates that needs a mean of each field.

    The part that fields have in common is left out: one fault of all fields explains it, namely the fault that explains
    most. Independent noise of the poses gives each field a mean of its own.
    """
    if not evidences:
        return 0.0
    by_own_means = sum(field.explained_by(MEAN)[1] * field.total for field in evidences)
    total = sum_of(evidences)
    in_common = max(total.explained_by(fault)[1] for fault in (MEAN, GAIN, FOCAL, CENTRE, MOUNTING)) * total.total
    by_flow_templates = sum(field.explained_by(OF_THE_FLOW)[1] * field.total for field in evidences)
    return max(by_own_means - in_common, 0.0) / by_flow_templates if by_flow_templates > 0 else 0.0

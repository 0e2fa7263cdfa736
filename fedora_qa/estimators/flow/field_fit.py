"""Residual flow of a field from its tiles, and of all fields of a rate: mean, gain, shift and geometric templates."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.fitting.tails import chi_squared_beyond, student_factor
from fedora_qa.estimators.flow.parameter_templates import Evidence, sum_of

Float64 = NDArray[np.float64]

MEAN: Final = slice(0, 2)
GAIN: Final = slice(2, 3)
SHIFT: Final = slice(3, 5)
OF_THE_FLOW: Final = slice(0, 5)
"""Templates of the residual flow of a tile that follow from the flow alone: constant u and v; the flow; its slopes
along columns and rows."""

LOCKING: Final = slice(5, 7)
"""The sine of 2 pi u, and of 2 pi v: bias by aliases and interpolation, see `lock_in`."""

FOCAL: Final = slice(7, 8)
CENTRE: Final = slice(8, 10)
MOUNTING: Final = slice(10, 13)
TIME: Final = slice(13, 14)
GEOMETRIC: Final = slice(7, 15)
"""Templates that follow from depth and the motion of the camera: percent, px, degrees about the axes of the camera,
percent of the interval, degrees of relative roll. Zero where depth or motion is missing."""

_HUBER: Final = 2.0
_ITERATIONS: Final = 5
_SMALLEST_TRUE: Final = 1e-3
"""Share of the stored flow below which the true flow counts as zero."""

_UNLIKELY: Final = 0.01
"""Probability with which a correct value exceeds ``_beyond_chance``."""

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
class FieldFit:
    """The common fit of the tiles of one field.

    Attributes
    ----------
    mean_px, mean_error_px
        (2,) robust weighted mean of the residual flow of the tiles, and its formal standard error, px.
    spread
        Weighted mean square of the deviations of the tiles in units of their errors: about 1 where these errors are
        right.
    freedom
        Degrees of freedom of ``spread``.
    evidence
        Normal equations of the templates, robustly weighted.
    deviations
        (n,) distance of each tile from the mean in units of its standard error.
    """

    mean_px: Float64
    mean_error_px: Float64
    spread: float
    freedom: int
    evidence: Evidence
    deviations: Float64


def templates_of_flow(flows_px: Float64, slopes: Float64, sines: Float64, geometric: Float64 | None) -> Float64:
    """Return the templates of the residual flow of tiles.

    Parameters
    ----------
    flows_px
        (n, 2) mean flow of each tile, px.
    slopes
        (n, 2, 2) derivative of component i along columns (``[:, i, 0]``) and rows (``[:, i, 1]``), px/px.
    sines
        (n, 2) mean of sin(2 pi flow).
    geometric
        (n, 2, 8) the columns of ``GEOMETRIC``; None where depth or motion is missing, which gives zeros.

    Returns
    -------
    ndarray of float64
        (n, 2, 15) px per unit of each template.
    """
    count = len(flows_px)
    locking = sines[:, :, None] * np.eye(2)
    geometric_templates = np.zeros((count, 2, 8)) if geometric is None else geometric
    constant = np.broadcast_to(np.eye(2), (count, 2, 2))
    return np.concatenate((constant, flows_px[:, :, None], slopes, locking, geometric_templates), axis=2)


def fit_field(errors_px: Float64, covariances_px2: Float64, templates: Float64) -> FieldFit:
    """Return the mean residual flow of the tiles of a field, and the normal equations of their templates.

    Tiles far from the mean have lower weight (Huber).

    Parameters
    ----------
    errors_px, covariances_px2
        (n, 2) px and (n, 2, 2) px^2: residual flow of tiles and its covariance, n > 1.
    templates
        (n, 2, m), of ``templates_of_flow``.

    Returns
    -------
    FieldFit
        With formal errors; the scatter of the tiles is given beside them.
    """
    errors_px, covariances_px2 = np.ascontiguousarray(errors_px), np.ascontiguousarray(covariances_px2)
    mean_px, matrix, information, deviations = robust_mean(errors_px, covariances_px2, _HUBER, _ITERATIONS)
    # Huber's weight, min(1, c / |deviation|) (P. J. Huber, Ann. Math. Stat. 35 (1964) 73).
    weights = np.minimum(1.0, _HUBER / np.maximum(deviations, 1e-12))
    freedom = errors_px.size - len(mean_px)
    evidence = normal_equations(errors_px, information, np.ascontiguousarray(templates))
    return FieldFit(
        mean_px=mean_px,
        mean_error_px=np.sqrt(np.diag(np.linalg.inv(matrix))),
        spread=float(weights @ deviations**2) / freedom,
        freedom=freedom,
        evidence=Evidence(*evidence, count=errors_px.size),
        deviations=deviations,
    )


def _beyond_chance(freedom: float) -> float:
    """Return the value that the mean square of ``freedom`` deviations of unit variance exceeds with probability 1%."""
    return chi_squared_beyond(_UNLIKELY, freedom) / freedom


def robust_errors(matrix: Float64, scatter: Float64, scores: Float64) -> Float64:
    """Return the standard errors of ``matrix^-1 sum(scores)``: formal ones, or empirical ones where the blocks differ.

    If the errors of the tiles are right, k - p times the ratio of the empirical to the formal variance is chi-square
    with k - p degrees of freedom, for k blocks and p parameters. Where the ratio exceeds its 99% quantile, the blocks
    have errors of their own. The empirical error is then returned, widened for few blocks.

    Parameters
    ----------
    matrix
        (p, p) normal matrix of all blocks.
    scatter
        (p, p) covariance of the sum of the scores as estimated from the tiles: the sum of the matrices of the
        blocks, each times how far its tiles scatter (R. T. Birge, Phys. Rev. 40 (1932) 207).
    scores
        (k, p) one row for each independent block; the empirical covariance is the sandwich over them.

    Returns
    -------
    ndarray of float64
        (p,) in the units of the parameters.
    """
    blocks, parameters = scores.shape
    freedom = blocks - parameters
    formal = np.linalg.inv(matrix)
    variances: Float64 = np.diag(formal @ scatter @ formal)
    if freedom >= 1:
        # Sandwich A^-1 (sum of s s^T) A^-1, times k / (k - p) as p parameters were fitted to the k blocks.
        empirical = np.diag(formal @ (scores.T @ scores) @ formal) * blocks / freedom
        largest = _beyond_chance(freedom)
        variances = np.where(empirical > largest * variances, student_factor(freedom) ** 2 * empirical, variances)
    return np.sqrt(variances)


def gain_of_true(share_of_stored: float) -> tuple[float, float]:
    """Return the gain on the true flow of an error that is a share of the stored flow, and the derivative of the gain.

    For the share g, stored = (1 + G) true and error = G true give the gain G = g / (1 - g) and dG/dg = 1 / (1 - g)^2.
    """
    rest = 1.0 - share_of_stored
    # At g = 1 the true flow is zero and has no gain: 1 - g is kept away from 0.
    rest = rest if abs(rest) > _SMALLEST_TRUE else np.copysign(_SMALLEST_TRUE, rest)
    return share_of_stored / rest, rest**-2


def lock_in(total: Evidence, columns: slice) -> Float64:
    """Return a bound on the change of fitted sizes by a bias of 1 px times sin(2 pi flow).

    A frequency w of the image and its alias, which sampling maps onto w from w - 2 pi, differ in phase by 2 pi d when
    the scene moves by d. Least squares then errs by (energy of the alias over that of the image) / w times sin(2 pi d).
    The error is zero where the image moves by whole pixels, and zero on average over many fractions of a pixel.
    Interpolation between pixels errs by the same law. (In particle image velocimetry this is peak locking: J.
    Westerweel, Meas. Sci. Technol. 8 (1997) 1379.)

    Parameters
    ----------
    total
        Normal equations of all templates of ``templates_of_flow``.
    columns
        The p templates that are fitted together.

    Returns
    -------
    ndarray of float64
        (p,) not negative, in the units of the sizes, for an amplitude of 1 px of u and of v.
    """
    matrix = total.matrix[columns, columns]
    # Sizes that least squares fits to a residual of sin(2 pi u), and of sin(2 pi v).
    response = np.linalg.lstsq(matrix, total.matrix[columns, LOCKING], rcond=1e-12)[0]
    # The signs of both biases are unknown, so that their sizes are added.
    moved: Float64 = np.abs(response).sum(axis=1)
    return moved


@njit(cache=True)
def robust_mean(
    errors_px: Float64, covariances_px2: Float64, most: float, iterations: int
) -> tuple[Float64, Float64, Float64, Float64]:
    """Return the weighted mean of errors with Huber's weights.

    Parameters
    ----------
    errors_px, covariances_px2
        (n, 2) px and (n, 2, 2) px^2.
    most
        Deviation in standard errors above which an error has lower weight.
    iterations
        How often weights and mean are computed in turn, starting from the median; at least 1.

    Returns
    -------
    mean_px, matrix, information, deviations
        (2,) px; (2, 2) information of the mean, 1/px^2; (n, 3) weighted information of each error, 1/px^2: elements
        uu, uv, vv; (n,) deviations in standard errors, from the mean before the last iteration.
    """
    count = len(errors_px)
    stated, weighted = np.empty((count, 3)), np.empty((count, 3))
    for i in range(count):
        of_u, of_v, both = covariances_px2[i, 0, 0], covariances_px2[i, 1, 1], covariances_px2[i, 0, 1]
        # C^-1 of a 2 x 2 matrix: adjugate over determinant.
        determinant = of_u * of_v - both * both
        stated[i, 0], stated[i, 1], stated[i, 2] = of_v / determinant, -both / determinant, of_u / determinant
    mean_px = np.array([median_of(errors_px[:, 0].copy()), median_of(errors_px[:, 1].copy())])
    deviations, matrix = np.zeros(count), np.zeros((2, 2))
    for _ in range(iterations):
        uu = uv = vv = to_u = to_v = 0.0
        for i in range(count):
            u, v = errors_px[i, 0] - mean_px[0], errors_px[i, 1] - mean_px[1]
            # Squared Mahalanobis distance e^T C^-1 e; only rounding makes it negative.
            square = stated[i, 0] * u * u + 2 * stated[i, 1] * u * v + stated[i, 2] * v * v
            deviations[i] = np.sqrt(max(square, 0.0))
            weight = min(1.0, most / max(deviations[i], 1e-12))
            for k in range(3):
                weighted[i, k] = weight * stated[i, k]
            uu += weighted[i, 0]
            uv += weighted[i, 1]
            vv += weighted[i, 2]
            to_u += weighted[i, 0] * errors_px[i, 0] + weighted[i, 1] * errors_px[i, 1]
            to_v += weighted[i, 1] * errors_px[i, 0] + weighted[i, 2] * errors_px[i, 1]
        matrix[0, 0], matrix[0, 1], matrix[1, 0], matrix[1, 1] = uu, uv, uv, vv
        determinant = uu * vv - uv * uv
        # Cramer's rule for (sum of w C^-1) mean = sum of w C^-1 e.
        mean_px[0], mean_px[1] = (vv * to_u - uv * to_v) / determinant, (uu * to_v - uv * to_u) / determinant
    return mean_px, matrix, weighted, deviations


@njit(cache=True)
def normal_equations(errors_px: Float64, information: Float64, templates: Float64) -> tuple[Float64, Float64, float]:
    """Return the normal equations of templates against errors.

    Parameters
    ----------
    errors_px
        (n, 2) px.
    information
        (n, 3) of each error, 1/px^2: elements uu, uv, vv.
    templates
        (n, 2, m) px per unit of each template.

    Returns
    -------
    matrix, vector, total
        (m, m) sum of T^T C^-1 T; (m,) sum of T^T C^-1 e; sum of e^T C^-1 e.
    """
    size = templates.shape[2]
    matrix, vector, total = np.zeros((size, size)), np.zeros(size), 0.0
    for i in range(len(errors_px)):
        uu, uv, vv = information[i, 0], information[i, 1], information[i, 2]
        of_u, of_v, u, v = templates[i, 0], templates[i, 1], errors_px[i, 0], errors_px[i, 1]
        by_u, by_v = uu * u + uv * v, uv * u + vv * v
        total += u * by_u + v * by_v
        for a in range(size):
            vector[a] += of_u[a] * by_u + of_v[a] * by_v
            along_u, along_v, line = uu * of_u[a] + uv * of_v[a], uv * of_u[a] + vv * of_v[a], matrix[a]
            for b in range(size):
                line[b] += along_u * of_u[b] + along_v * of_v[b]
    return matrix, vector, total


@dataclass(frozen=True, slots=True)
class TemplateSizes:
    """Sizes of templates, fitted to all fields of a rate.

    Attributes
    ----------
    sizes, errors
        (p,) in the units of the templates, and their standard errors.
    biases
        (p,) bounds of the bias by aliases and interpolation.
    effects_px
        (p,) root mean square change of the flow by one unit of each template, px.
    """

    sizes: Float64
    errors: Float64
    biases: Float64
    effects_px: Float64

    def scaled(self, factor: float) -> "TemplateSizes":
        """Return the sizes in another unit, of which one old unit is ``factor``."""
        return TemplateSizes(factor * self.sizes, factor * self.errors, factor * self.biases, self.effects_px / factor)


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
        if freedom > 0 and spread > usual * _beyond_chance(freedom)
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
        # The information on a template T is I = sum w |T|^2, and that on the mean is sum w for u and for v: 2 I / trace
        # is the mean square of |T|, px^2.
        squares_px2 = (
            2 * np.diag(total.matrix[columns, columns]) / max(float(np.trace(total.matrix[MEAN, MEAN])), 1e-300)
        )
        return TemplateSizes(
            sizes, robust_errors(matrix, scatter, scores), _BIAS_PX * lock_in(total, columns), np.sqrt(squares_px2)
        )

    gain = fitted(GAIN)
    gain_on_true, slope = gain_of_true(float(gain.sizes[0]))
    alone = [fitted(slice(column, column + 1)) for column in range(GEOMETRIC.start, GEOMETRIC.stop)]
    geometric = TemplateSizes(
        np.concatenate([template.sizes for template in alone]),
        np.concatenate([template.errors for template in alone]),
        np.concatenate([template.biases for template in alone]),
        np.concatenate([template.effects_px for template in alone]),
    )
    return RateFit(
        mean=fitted(MEAN),
        # G = g / (1 - g): error and bias scale with dG/dg = 1 / (1 - g)^2.
        # A gain of 1 changes the flow by the true flow, |stored| |1 - g|.
        gain=TemplateSizes(
            np.array([gain_on_true]), slope * gain.errors, slope * gain.biases, gain.effects_px * slope**-0.5
        ),
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

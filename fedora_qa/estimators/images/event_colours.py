"""Colours of frames regressed on events: channel weights, their order, and the transfer exponent.

Between two frame times at which the events of a pixel bracket its level (``events/levels.py``), the change of its
signal S is given without rounding. With linear channels c_k of weights w_k, Y = sum of w_k c_k, and S = ln(Y + eps) or
S = Y::

    C+ dP - C- dM + delta d(C+ rate+ - C- rate-) = dS = sum of beta_k D_k,     D_k = dc_k dS/dY,     beta_k = a w_k

dS/dY is the secant between both frames, so that D is exact for the assumed weights and nearly exact for others. The
scale a is that of the thresholds; the weights are the beta over their sum. If frames are read with a wrong exponent, c
to the power 1 + g with white fixed, this adds to first order::

    a g dH,     H = S'(Y) sum of w_k c_k ln(c_k / 255)

For S = ln Y that is almost dS itself (exactly so where pixels are grey): there a stands for the exponent. Events are
regressed on frames, since the errors of the frames are the larger ones and are common to D and dS. In the reverse
regression, these errors would bias the weights towards values at which they cancel.

The order of the channels follows from where the fitted weights lie on the line from the order R, G, B to another one.
Weights w with error E under the right order m0, and m under another, are separated best along one line (R. A. Fisher,
"The use of multiple measurements in taxonomic problems", Annals of Eugenics 7 (1936)). With d = m - m0 and the
covariance T of E,

    s = d' T^-1 (w - m0) / d' T^-1 d

is 0 in the right order, 1 in the other, and has the least variance of all such measures. T holds the formal covariance
and the bounds of the biases, as if these were random. The weights have the sum 1, so that two of them are free.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.events.footprint import Footprints
from fedora_qa.estimators.fitting.huber_regression import huber_regression_weights
from fedora_qa.estimators.images.luma import WHITE_DN

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

CHANNELS: Final = (0, 1, 2)
EXPONENT: Final = 3
DELAY: Final = 4
"""The columns of the regression: D of the three channels, dH, and the change of the rate of the events."""

PARAMETERS: Final = 5

CONTRASTS: Final = np.array([[1.0, 0.0, -1.0], [-1.0, 1.0, 0.0], [0.0, 1.0, -1.0]])
"""Differences of two weights (rows, of the three channels)."""

_EXPONENT_FITTED: Final = 4
"""Index of the exponent among the coefficients that are fitted."""

_OF_WEIGHTS: Final = [0, 1, 2, 5, 6, 7]
"""Places of weights and contrasts among the derived values; scale and exponent lie between them."""

_LEAST_DN: Final = 1e-3
_SINGULAR: Final = 1e-9
"""Least eigenvalue of the scaled normal matrix. Below it columns are collinear and coefficients are not determined."""

WRONG_ORDERS: Final = tuple(order for order in map("".join, permutations("RGB")) if order != "RGB")

LEVEL_BIAS: Final = 0.01
"""Bias of a difference of weights by errors of the level between events: not derived, but measured.

With closed-form frames and events, the true levels give the weights to 0.0002. Levels interpolated between events
change differences of weights by up to 0.006, beyond the difference of linear and cubic interpolation.
"""

_FREE: Final = np.array([[1.0, 0.0, -1.0], [-0.5, 1.0, -0.5]])
"""The two free coordinates of weights: the first less the third, the second less the mean of both."""


@dataclass(frozen=True, slots=True)
class ColourBlocks:
    """Robust normal equations of b blocks of samples, with Huber's weights W.

    Attributes
    ----------
    matrices
        (b, 5, 5) X' W X.
    vectors
        (b, 5) X' W y.
    squares
        (b,) y' W y.
    weights
        (b,) sum of the weights.
    curve_slopes
        (b,) weighted sum of the change of H by a change of all channels, see ``curve_slopes``.
    noise
        (b, 3) weighted sum of the variances of the columns of the channels by noise of single channels.
    """

    matrices: Float64
    vectors: Float64
    squares: Float64
    weights: Float64
    curve_slopes: Float64
    noise: Float64

    def __len__(self) -> int:
        return len(self.weights)


@dataclass(frozen=True, slots=True)
class ColourEstimate:
    """An estimate with its error.

    Attributes
    ----------
    value, standard_error
        Without unit; NaN and infinite where the value is not determined.
    bound
        Bound of the bias of the model.
    """

    value: float
    standard_error: float
    bound: float

    def widened(self, other: "ColourEstimate") -> "ColourEstimate":
        """Return this estimate with its bound enlarged by its difference from that of another method."""
        difference = abs(self.value - other.value)
        return replace(self, bound=self.bound + (difference if np.isfinite(difference) else 0.0))


@dataclass(frozen=True, slots=True)
class ChannelWeightErrors:
    """Joint errors of the three weights.

    Attributes
    ----------
    formal
        (3, 3) formal covariance.
    between_blocks
        (3, 3) covariance by the jackknife over blocks.
    biases
        (k, 3) biases of the weights, one row for each of k causes.
    """

    formal: Float64
    between_blocks: Float64
    biases: Float64


@dataclass(frozen=True, slots=True)
class ColourFit:
    """The fit of weights, scale and exponent.

    Attributes
    ----------
    weights
        Of each channel, of sum 1.
    contrasts
        First less third, second less first, second less third weight: an exchange of channels changes these most.
    scale
        Sum of the coefficients: 1 where thresholds and curve are as declared.
    exponent
        Power to which linear values would have to be raised; 1 where it was not fitted.
    weight_errors
        Of the weights together.
    variance
        Of the residual of a sample, in the unit of S squared.
    unexplained
        Sum of squares of the residuals over that of the events, 0 to 1.
    """

    weights: tuple[ColourEstimate, ColourEstimate, ColourEstimate]
    contrasts: tuple[ColourEstimate, ColourEstimate, ColourEstimate]
    scale: ColourEstimate
    exponent: ColourEstimate
    weight_errors: ChannelWeightErrors
    variance: float
    unexplained: float

    def widened(self, other: "ColourFit") -> "ColourFit":
        """Return this fit with all bounds enlarged by its differences from another fit."""
        pairs = list(zip(self.weights, other.weights, strict=True))
        weights = tuple(weight.widened(other_weight) for weight, other_weight in pairs)
        contrasts = tuple(a.widened(b) for a, b in zip(self.contrasts, other.contrasts, strict=True))
        differences = np.array([weight.value - other_weight.value for weight, other_weight in pairs])
        biases = np.vstack([self.weight_errors.biases, np.nan_to_num(differences)])
        return replace(
            self,
            weight_errors=replace(self.weight_errors, biases=biases),
            weights=(weights[0], weights[1], weights[2]),
            contrasts=(contrasts[0], contrasts[1], contrasts[2]),
            scale=self.scale.widened(other.scale),
            exponent=self.exponent.widened(other.exponent),
        )


def colour_columns(earlier_dn: Float64, later_dn: Float64, model: Literal["log", "linear"], eps_dn: float) -> Float64:
    """Return the columns of the regression without the delay.

    Parameters
    ----------
    earlier_dn, later_dn
        (m, 3) linear R, G, B at two times, DN.
    model, eps_dn
        As declared: S is ln(Y + eps) or Y; eps in DN.

    Returns
    -------
    ndarray of float64
        (m, 4): D of the three channels, and dH, in the unit of S.
    """
    weights = np.array(LUMA_WEIGHTS_RGB)
    # sum of w_k c_k ln(c_k / 255)
    bent = [(weights * dn * np.log(np.maximum(dn, _LEAST_DN) / WHITE_DN)).sum(axis=1) for dn in (earlier_dn, later_dn)]
    change = later_dn - earlier_dn
    if model == "linear":
        return np.column_stack([change, bent[1] - bent[0]])
    bent_log = [
        each / np.maximum(dn @ weights + eps_dn, _LEAST_DN)
        for each, dn in zip(bent, (earlier_dn, later_dn), strict=True)
    ]
    secants = signal_secants(earlier_dn, later_dn, model, eps_dn)
    return np.column_stack([change * secants[:, np.newaxis], bent_log[1] - bent_log[0]])


def signal_secants(earlier_dn: Float64, later_dn: Float64, model: Literal["log", "linear"], eps_dn: float) -> Float64:
    """Return the secants dS/dY (m,) between both times, unit of S over DN; parameters as of ``colour_columns``."""
    if model == "linear":
        return np.ones(len(earlier_dn))
    weights = np.array(LUMA_WEIGHTS_RGB)
    first, last = (np.maximum(dn @ weights + eps_dn, _LEAST_DN) for dn in (earlier_dn, later_dn))
    # The secant (ln last - ln first) / (last - first) = artanh(x) / (x mean), by its series where both are close.
    mean = 0.5 * (first + last)
    x = (last - first) / (2 * mean)
    not_small = np.where(np.abs(x) < 1e-3, 1.0, x)
    secants: Float64 = np.where(np.abs(x) < 1e-3, 1 + x**2 / 3, np.arctanh(not_small * (1 - 1e-12)) / not_small) / mean
    return secants


def curve_slopes(earlier_dn: Float64, later_dn: Float64) -> Float64:
    """Return the change of H by a small change of 1 DN of all channels, for the model S = Y, on the mean of two times.

    Parameters
    ----------
    earlier_dn, later_dn
        (m, 3) linear R, G, B at two times, DN.

    Returns
    -------
    ndarray of float64
        (m,) dimensionless.
    """
    weights, both_dn = np.array(LUMA_WEIGHTS_RGB), np.stack([earlier_dn, later_dn])
    # d/dc of sum of w_k c_k ln(c_k / 255) = sum of w_k (1 + ln(c_k / 255)), and the weights have the sum 1.
    slopes: Float64 = (1 + np.log(np.maximum(both_dn, _LEAST_DN) / WHITE_DN) @ weights).mean(axis=0)
    return slopes


def colour_blocks(
    columns: Float64,
    events: Float64,
    slopes: Float64,
    noise: Float64,
    block_of_sample: NDArray[np.intp],
    blocks: int,
) -> ColourBlocks:
    """Return normal equations of events on columns, summed by block, with Huber's weights.

    Parameters
    ----------
    columns
        (m, 5), those of ``CHANNELS``, ``EXPONENT`` and ``DELAY``.
    events
        (m,) sum of the events of each sample, in the unit of S.
    slopes
        (m,) of ``curve_slopes``.
    noise
        (m, 3) variances of the columns of the channels by noise of single channels.
    block_of_sample
        (m,) index of the block of each sample.
    blocks
        Number of blocks.

    Returns
    -------
    ColourBlocks
        Of all blocks; zero for those without samples.
    """
    weights = huber_regression_weights(columns, events)
    sums = ColourBlocks(
        matrices=np.zeros((blocks, PARAMETERS, PARAMETERS)),
        vectors=np.zeros((blocks, PARAMETERS)),
        squares=np.zeros(blocks),
        weights=np.zeros(blocks),
        curve_slopes=np.zeros(blocks),
        noise=np.zeros((blocks, len(CHANNELS))),
    )
    for block in range(blocks):
        chosen = block_of_sample == block
        X, y, w = columns[chosen], events[chosen], weights[chosen]
        sums.matrices[block], sums.vectors[block] = (X * w[:, np.newaxis]).T @ X, (X * w[:, np.newaxis]).T @ y
        sums.squares[block], sums.weights[block] = w @ y**2, w.sum()
        sums.curve_slopes[block] = w @ slopes[chosen]
        sums.noise[block] = w @ noise[chosen]
    return sums


def concatenate_colours(sums: Sequence[ColourBlocks]) -> ColourBlocks:
    """Return all blocks in order, without those that have no samples."""
    fields = [np.concatenate([getattr(blocks, name) for blocks in sums]) for name in ColourBlocks.__slots__]
    joined = ColourBlocks(*fields)
    present = joined.weights > 0
    return ColourBlocks(*(values[present] for values in fields))


def fit_colours(blocks: ColourBlocks, *, with_exponent: bool, frame_variance: float = np.inf) -> ColourFit:
    """Return the fit of weights and scale, and of the exponent if asked for.

    Standard errors are the larger of the formal ones and the spread between blocks (delete-one jackknife). They are
    infinite where a value is not determined.

    Errors e of the frames that are common to all channels, mostly of footprints, change all columns together, by u e.
    They attenuate the coefficients by (X'X)^-1 u n var(e) (u . beta). The residual of the events bounds (u . beta)^2
    var(e), and so does ``frame_variance``.

    Errors of single channels attenuate them by (X'X)^-1 N beta, with N the diagonal sum of their variances (W. Fuller,
    Measurement Error Models, 1987, section 2.2). beta = (X'X - N)^-1 X'y is free of it, but N is an upper bound: the
    distance between both is a bound. Where X'X - N is not positive definite, the channels differ by no more than noise:
    weights are not determined, and the attenuation of scale and exponent is that to first order.

    Parameters
    ----------
    blocks
        Of all windows; at least one.
    with_exponent
        Whether dH is a column.
    frame_variance
        Residual variance of another fit of the same frames, in the unit of S squared.

    Returns
    -------
    ColourFit
        With the bound of the attenuation beside each value.
    """
    columns = np.array([*CHANNELS, DELAY, EXPONENT] if with_exponent else [*CHANNELS, DELAY])
    matrices, vectors = blocks.matrices[:, columns[:, np.newaxis], columns], blocks.vectors[:, columns]
    matrix, vector = matrices.sum(axis=0), vectors.sum(axis=0)
    inverse = _inverse(matrix)
    coefficients = inverse @ vector
    values, slopes = _derived(coefficients), _slopes(coefficients)
    total, count = float(blocks.squares.sum()), float(blocks.weights.sum())
    residual = max(total - float(vector @ coefficients), 0.0)
    variance = residual / max(count - len(columns), 1.0)
    # Formal covariance J s^2 (X'X)^-1 J' of the values that are derived from the coefficients.
    formal = variance * slopes @ inverse @ slopes.T
    # Jackknife covariance (n - 1) / n sum of (t_i - t)(t_i - t)', t_i without block i, t of all blocks (Efron and Stein
    # 1981).
    left_out = np.array([_derived(_inverse(matrix - m) @ (vector - v)) for m, v in zip(matrices, vectors, strict=True)])
    deviations = left_out - values
    between: Float64 = (len(matrices) - 1) / len(matrices) * deviations.T @ deviations
    errors = np.sqrt(np.fmax(np.maximum(np.diag(formal), 0.0), np.diag(between)))
    # u: change of each column by an error of 1 in all channels; of dH, on the mean of the samples.
    common = np.zeros(len(matrix))
    common[:3] = 1.0
    if with_exponent:
        common[_EXPONENT_FITTED] = float(blocks.curve_slopes.sum()) / max(count, 1e-300)
    bias = slopes @ inverse @ common * min(variance, frame_variance) * count / (common @ coefficients)
    noise = np.zeros(len(matrix))
    noise[:3] = blocks.noise.sum(axis=0)
    by_noise = _derived(_inverse(matrix - np.diag(noise)) @ vector) - values
    if not np.isfinite(by_noise).all():
        by_noise = slopes @ inverse @ (noise * coefficients)
        errors[_OF_WEIGHTS], formal[:3, :3] = np.inf, np.nan
    bounds = np.abs(bias) + np.abs(by_noise)
    estimates = [
        ColourEstimate(float(value), float(error), float(bound))
        if np.isfinite(error)
        else ColourEstimate(float("nan"), np.inf, 0.0)
        for value, error, bound in zip(values, errors, bounds, strict=True)
    ]
    return ColourFit(
        weights=(estimates[0], estimates[1], estimates[2]),
        contrasts=(estimates[5], estimates[6], estimates[7]),
        scale=estimates[3],
        exponent=estimates[4],
        weight_errors=ChannelWeightErrors(formal[:3, :3], between[:3, :3], np.stack([bias[:3], by_noise[:3]])),
        variance=variance,
        unexplained=residual / total if total > 0 else 1.0,
    )


def _inverse(matrix: Float64) -> Float64:
    """Return the inverse of a normal matrix (p, p); NaN where its columns are collinear."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    # With a unit diagonal the limit does not depend on the units of the columns.
    scaled = matrix / np.outer(scale, scale)
    if not np.linalg.eigvalsh(scaled)[0] > _SINGULAR:
        return np.full_like(matrix, np.nan)
    inverse: Float64 = np.linalg.inv(scaled) / np.outer(scale, scale)
    return inverse


def _derived(coefficients: Float64) -> Float64:
    """Return weights, scale, exponent and contrasts (8,); the coefficient of dH is the scale times g."""
    scale = coefficients[:3].sum()
    bent = coefficients[_EXPONENT_FITTED] / scale if len(coefficients) > _EXPONENT_FITTED else 0.0
    weights = coefficients[:3] / scale
    return np.concatenate([weights, [scale, 1.0 + bent], CONTRASTS @ weights])


def _slopes(coefficients: Float64) -> Float64:
    """Return the derivatives (8, p) of ``_derived`` by each coefficient."""
    scale = coefficients[:3].sum()
    slopes = np.zeros((8, len(coefficients)))
    # w_k = beta_k / a gives dw_k / dbeta_j = (delta_kj - w_k) / a.
    slopes[:3, :3] = np.eye(3) / scale - coefficients[:3, np.newaxis] / scale**2
    slopes[3, :3] = 1.0
    if len(coefficients) > _EXPONENT_FITTED:
        slopes[4, :3], slopes[4, _EXPONENT_FITTED] = -coefficients[_EXPONENT_FITTED] / scale**2, 1.0 / scale
    slopes[5:] = CONTRASTS @ slopes[:3]
    return slopes


class SeparableTaps(NamedTuple):
    """Weights of n pixels of the event camera, along rows and along columns of the frame.

    Attributes
    ----------
    first_rows, first_columns
        (n,) first row, and first column, of the frame with a weight.
    row_weights, column_weights
        (n, k) weights of successive rows, and of successive columns.
    """

    first_rows: Int64
    row_weights: Float64
    first_columns: Int64
    column_weights: Float64


def edge_aware_colours(
    footprints: Footprints, rgb: NDArray[np.uint8], linear_dn: Float64, pixels: NDArray[Any]
) -> Float64:
    """Return the mean colour of a frame over the footprints of a few pixels, by the edge-aware reconstruction.

    Parameters
    ----------
    footprints
        Separable in rows and columns; about four by four weights of a pixel are not zero.
    rgb
        (H, W, 3) codes of a frame.
    linear_dn
        (256,) linear value of each code, DN.
    pixels
        (m,) row * width + column in the event camera.

    Returns
    -------
    ndarray of float64
        (m, 3) linear R, G, B, DN, not negative.
    """
    rows, columns = footprints.rows.edge_aware, footprints.columns.edge_aware
    of_rows, of_columns = np.divmod(np.asarray(pixels, dtype=np.int64), len(columns.first))
    means = np.empty((len(pixels), 3))
    taps = SeparableTaps(rows.first, rows.weights, columns.first, columns.weights)
    _average(rgb, linear_dn, of_rows, of_columns, taps, means)
    return np.maximum(means, 0.0)


@njit(cache=True)
def _average(
    rgb: NDArray[np.uint8], linear_dn: Float64, rows: Int64, columns: Int64, taps: SeparableTaps, means: Float64
) -> None:
    """Write the mean colours (m, 3), DN, over the footprints of the pixels at rows (m,) and columns (m,)."""
    for i in range(len(rows)):
        row, column = rows[i], columns[i]
        red = green = blue = 0.0
        for a in range(taps.row_weights.shape[1]):
            line = rgb[taps.first_rows[row] + a]
            for b in range(taps.column_weights.shape[1]):
                weight = taps.row_weights[row, a] * taps.column_weights[column, b]
                pixel = line[taps.first_columns[column] + b]
                red += weight * linear_dn[pixel[0]]
                green += weight * linear_dn[pixel[1]]
                blue += weight * linear_dn[pixel[2]]
        means[i, 0], means[i, 1], means[i, 2] = red, green, blue


def weights_in(order: str) -> Float64:
    """Return the weights (3,) of the stored channels if they are stored in an order such as "BGR"."""
    luma = dict(zip("RGB", LUMA_WEIGHTS_RGB, strict=True))
    return np.array([luma[channel] for channel in order])


def towards(fit: ColourFit, order: str) -> ColourEstimate:
    """Return the position of the fitted weights between the order R, G, B (0) and another order (1).

    The standard error is the larger of the formal one and the spread between blocks. The bound is the sum of the sizes
    of the biases.

    Parameters
    ----------
    fit
        Of the colours on events.
    order
        One of ``WRONG_ORDERS``.

    Returns
    -------
    ColourEstimate
        Without unit; NaN with an infinite standard error where a covariance is unknown.
    """
    precision, difference = _precision(fit), _FREE @ (weights_in(order) - weights_in("RGB"))
    if precision is None:
        return ColourEstimate(float("nan"), float("inf"), 0.0)
    # s = d' T^-1 (w - m0) / d' T^-1 d; ``line`` (3,) is the factor of the three weights.
    along = precision @ difference
    line: Float64 = (along / (along @ difference)) @ _FREE
    errors = fit.weight_errors
    variance = max(float(line @ errors.formal @ line), float(line @ errors.between_blocks @ line))
    # The signs of the biases are unknown, so that their sizes are added.
    bound = float(np.abs(errors.biases @ line).sum()) + LEVEL_BIAS * float(np.ptp(line))
    return ColourEstimate(float(line @ (_weights(fit) - weights_in("RGB"))), float(np.sqrt(variance)), bound)


def nearest_order(fit: ColourFit) -> str:
    """Return the order of channels whose weights are nearest to the fitted ones, in units of their errors."""
    precision = _precision(fit)
    if precision is None:
        return "RGB"

    def distance(order: str) -> float:
        # Squared Mahalanobis distance (w - m)' T^-1 (w - m).
        difference = _FREE @ (_weights(fit) - weights_in(order))
        return float(difference @ precision @ difference)

    return min(("RGB", *WRONG_ORDERS), key=distance)


def _precision(fit: ColourFit) -> Float64 | None:
    """Return the inverse covariance (2, 2) of the free coordinates, biases included; None where one is unknown."""
    errors = fit.weight_errors
    # A variance LEVEL_BIAS^2 / 2 of each weight gives LEVEL_BIAS^2 for a difference of two.
    covariance = _FREE @ (errors.formal + errors.biases.T @ errors.biases + LEVEL_BIAS**2 / 2 * np.eye(3)) @ _FREE.T
    return np.asarray(np.linalg.inv(covariance)) if np.isfinite(covariance).all() else None


def _weights(fit: ColourFit) -> Float64:
    return np.array([weight.value for weight in fit.weights])

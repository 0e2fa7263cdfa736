"""What events say of the colours of frames: weights of the channels, and the exponent of the transfer curve.

Between two frame times at which the events of a pixel tell its level (``event_levels``), the change of its signal S is
known without rounding. With linear channels c_k of weights w_k, Y = sum of w_k c_k, and S = ln(Y + eps) or S = Y::

    C+ dP - C- dM + delta d(C+ rate+ - C- rate-) = dS = sum of beta_k D_k,     D_k = dc_k dS/dY,     beta_k = a w_k

dS/dY being the secant between both frames, so that D is exact for the weights that are assumed and nearly so for
others. The scale a is that of the thresholds; weights are the beta over their sum. Frames read by a wrong exponent,
c to the power 1 + g with white fixed, add to first order::

    a g dH,     H = S'(Y) sum of w_k c_k ln(c_k / 255)

For S = ln Y that is almost dS itself (entirely so where pixels are grey): there a stands for the exponent. Frames
explain and events are explained, since errors of the frames are the larger ones, and common to D and dS: regressed the
other way round, weights would drift to wherever these errors cancel.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.events.footprint import Footprints
from fedora_qa.estimators.fitting.huber import huber_weights
from fedora_qa.estimators.images.transfer import WHITE_DN

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

CHANNELS: Final = (0, 1, 2)
EXPONENT: Final = 3
DELAY: Final = 4
"""The columns of the regression: D of the three channels, dH, and the change of the events' rate."""

PARAMETERS: Final = 5

CONTRASTS: Final = np.array([[1.0, 0.0, -1.0], [-1.0, 1.0, 0.0], [0.0, 1.0, -1.0]])
"""Differences of two weights (rows, of the three channels)."""

_BENT: Final = 4
"""Where the exponent stands among the coefficients that are fitted."""

_LEAST_DN: Final = 1e-3
_SINGULAR: Final = 1e-9
"""Share of a column that must be its own for its coefficient to be known at all."""


@dataclass(frozen=True, slots=True)
class ColourBlocks:
    """Robust normal equations of blocks of samples: X'WX (b, 5, 5), X'Wy (b, 5), y'Wy (b,), sum of weights (b,)."""

    matrices: Float64
    vectors: Float64
    squares: Float64
    weights: Float64

    def __len__(self) -> int:
        return len(self.weights)


@dataclass(frozen=True, slots=True)
class ColourEstimate:
    """A value, its standard error, and a bound on the bias that the model is known to have."""

    value: float
    standard_error: float
    bound: float

    def widened(self, other: "ColourEstimate") -> "ColourEstimate":
        """Return this estimate, its bound wider by how far another way to reckon moves it."""
        moved = abs(self.value - other.value)
        return replace(self, bound=self.bound + (moved if np.isfinite(moved) else 0.0))


@dataclass(frozen=True, slots=True)
class ChannelWeightErrors:
    """How the weights may err together: covariances (3, 3), formal and by the jackknife over blocks; biases (k, 3)."""

    formal: Float64
    between_blocks: Float64
    biases: Float64


@dataclass(frozen=True, slots=True)
class ColourFit:
    """What the events say.

    Attributes
    ----------
    weights
        Of each channel, of sum 1.
    contrasts
        First less third, second less first, second less third weight: those that an exchange of channels changes most.
    scale
        Sum of the coefficients: 1 where thresholds and curve are as declared.
    exponent
        By which linear values would have to be taken; 1 where it was not fitted.
    weight_errors
        Of the weights together.
    variance, unexplained
        Of a sample's residual, in the unit of S squared; as a share of the events' variance.
    """

    weights: tuple[ColourEstimate, ColourEstimate, ColourEstimate]
    contrasts: tuple[ColourEstimate, ColourEstimate, ColourEstimate]
    scale: ColourEstimate
    exponent: ColourEstimate
    weight_errors: ChannelWeightErrors
    variance: float
    unexplained: float

    def widened(self, other: "ColourFit") -> "ColourFit":
        """Return this fit, all bounds wider by how far ``other`` lies away."""
        weights = tuple(mine.widened(its) for mine, its in zip(self.weights, other.weights, strict=True))
        contrasts = tuple(mine.widened(its) for mine, its in zip(self.contrasts, other.contrasts, strict=True))
        moved = np.array([mine.value - its.value for mine, its in zip(self.weights, other.weights, strict=True)])
        biases = np.vstack([self.weight_errors.biases, np.nan_to_num(moved)])
        return replace(
            self,
            weight_errors=replace(self.weight_errors, biases=biases),
            weights=(weights[0], weights[1], weights[2]),
            contrasts=(contrasts[0], contrasts[1], contrasts[2]),
            scale=self.scale.widened(other.scale),
            exponent=self.exponent.widened(other.exponent),
        )


def colour_columns(earlier_dn: Float64, later_dn: Float64, model: Literal["log", "linear"], eps_dn: float) -> Float64:
    """Return the columns (m, 4), D of the channels and dH, of linear colours (m, 3) in DN at two times."""
    weights = np.array(LUMA_WEIGHTS_RGB)
    luma = [colours @ weights + eps_dn for colours in (earlier_dn, later_dn)]
    bent = [(weights * dn * np.log(np.maximum(dn, _LEAST_DN) / WHITE_DN)).sum(axis=1) for dn in (earlier_dn, later_dn)]
    change = later_dn - earlier_dn
    if model == "linear":
        return np.column_stack([change, bent[1] - bent[0]])
    first, last = (np.maximum(values, _LEAST_DN) for values in luma)
    secant = _log_secant(first, last)
    return np.column_stack([change * secant[:, np.newaxis], bent[1] / last - bent[0] / first])


def _log_secant(first: Float64, last: Float64) -> Float64:
    """Return (ln last - ln first) / (last - first), by its series where they are close: 1 / mean (1 + x^2 / 3)."""
    mean = 0.5 * (first + last)
    x = (last - first) / (2 * mean)
    safe = np.where(np.abs(x) < 1e-3, 1.0, x)
    secant: Float64 = np.where(np.abs(x) < 1e-3, 1 + x**2 / 3, np.arctanh(safe * (1 - 1e-12)) / safe) / mean
    return secant


def colour_blocks(columns: Float64, events: Float64, block_of_sample: NDArray[np.intp], blocks: int) -> ColourBlocks:
    """Return normal equations of ``events`` (m,) on ``columns`` (m, 5), summed by block, under Huber's weights."""
    weights = huber_weights(columns, events)
    sums = ColourBlocks(
        np.zeros((blocks, PARAMETERS, PARAMETERS)), np.zeros((blocks, PARAMETERS)), np.zeros(blocks), np.zeros(blocks)
    )
    for block in range(blocks):
        chosen = block_of_sample == block
        X, y, w = columns[chosen], events[chosen], weights[chosen]
        sums.matrices[block], sums.vectors[block] = (X * w[:, np.newaxis]).T @ X, (X * w[:, np.newaxis]).T @ y
        sums.squares[block], sums.weights[block] = w @ y**2, w.sum()
    return sums


def concatenate_colours(blocks: Sequence[ColourBlocks]) -> ColourBlocks:
    """Return all blocks in order, those without samples left out."""
    together = [np.concatenate([getattr(one, name) for one in blocks]) for name in ColourBlocks.__slots__]
    present = together[-1] > 0
    return ColourBlocks(*(part[present] for part in together))


def fit_colours(blocks: ColourBlocks, *, with_exponent: bool, frame_variance: float = np.inf) -> ColourFit:
    """Fit weights and scale, and the exponent where asked for.

    Standard errors are the larger of the formal ones and the spread between blocks (delete-one jackknife); infinite
    where a number is not known at all.

    Errors e of the frames that are common to all channels (of footprints, mostly) move all columns together, by u e,
    and attenuate the coefficients by (X'X)^-1 u n var(e) (u . beta). What is left of the events bounds (u . beta)^2
    var(e), and so does ``frame_variance``, which is what another reading of the same frames leaves.
    """
    columns = np.array([*CHANNELS, DELAY, EXPONENT] if with_exponent else [*CHANNELS, DELAY])
    matrices, vectors = blocks.matrices[:, columns[:, np.newaxis], columns], blocks.vectors[:, columns]
    matrix, vector = matrices.sum(axis=0), vectors.sum(axis=0)
    inverse = _inverse(matrix)
    coefficients = inverse @ vector
    values, slopes = _derived(coefficients), _slopes(coefficients)
    total, count = float(blocks.squares.sum()), float(blocks.weights.sum())
    left = max(total - float(vector @ coefficients), 0.0)
    variance = left / max(count - len(columns), 1.0)
    formal, between = variance * slopes @ inverse @ slopes.T, _jackknife(matrices, vectors, values)
    errors = np.sqrt(np.fmax(np.maximum(np.diag(formal), 0.0), np.diag(between)))
    common = _common_error(matrix)
    bias = slopes @ inverse @ common * min(variance, frame_variance) * count / (common @ coefficients)
    bounds = np.abs(bias)
    found = [
        ColourEstimate(float(value), float(error), float(bound))
        if np.isfinite(error)
        else ColourEstimate(float("nan"), np.inf, 0.0)
        for value, error, bound in zip(values, errors, bounds, strict=True)
    ]
    of_weights = ChannelWeightErrors(formal[:3, :3], between[:3, :3], bias[np.newaxis, :3])
    share = left / total if total > 0 else 1.0
    weights, contrasts = (found[0], found[1], found[2]), (found[5], found[6], found[7])
    return ColourFit(weights, contrasts, found[3], found[4], of_weights, variance, share)


def _common_error(matrix: Float64) -> Float64:
    """Return by how much each column moves with an error of 1 in all channels; dH as it does with true changes."""
    weights = np.array(LUMA_WEIGHTS_RGB)
    common = np.zeros(len(matrix))
    common[:3] = 1.0
    if len(matrix) > _BENT:
        common[_BENT] = weights @ matrix[:3, _BENT] / max(float(weights @ matrix[:3, :3] @ weights), 1e-300)
    return common


def _jackknife(matrices: Float64, vectors: Float64, values: Float64) -> Float64:
    """Return the covariance (8, 8) that leaving each block out in turn tells."""
    matrix, vector, count = matrices.sum(axis=0), vectors.sum(axis=0), len(matrices)
    left_out = np.array([_derived(_inverse(matrix - m) @ (vector - v)) for m, v in zip(matrices, vectors, strict=True)])
    apart = left_out - values
    covariance: Float64 = (count - 1) / count * apart.T @ apart
    return covariance


def _inverse(matrix: Float64) -> Float64:
    """Return the inverse; NaN where columns are collinear."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale)
    if not np.linalg.eigvalsh(scaled)[0] > _SINGULAR:
        return np.full_like(matrix, np.nan)
    inverse: Float64 = np.linalg.inv(scaled) / np.outer(scale, scale)
    return inverse


def _derived(coefficients: Float64) -> Float64:
    """Return weights, scale, exponent and contrasts (8,): g enters the events as scale times g."""
    scale = coefficients[:3].sum()
    bent = coefficients[_BENT] / scale if len(coefficients) > _BENT else 0.0
    weights = coefficients[:3] / scale
    return np.concatenate([weights, [scale, 1.0 + bent], CONTRASTS @ weights])


def _slopes(coefficients: Float64) -> Float64:
    """Return how `_derived` changes (8, p) with each coefficient."""
    scale = coefficients[:3].sum()
    slopes = np.zeros((8, len(coefficients)))
    slopes[:3, :3] = np.eye(3) / scale - coefficients[:3, np.newaxis] / scale**2
    slopes[3, :3] = 1.0
    if len(coefficients) > _BENT:
        slopes[4, :3], slopes[4, _BENT] = -coefficients[_BENT] / scale**2, 1.0 / scale
    slopes[5:] = CONTRASTS @ slopes[:3]
    return slopes


def edge_aware_colours(prints: Footprints, rgb: NDArray[np.uint8], linear_dn: Float64, pixels: NDArray[Any]) -> Float64:
    """Return linear R, G, B (m, 3) over the footprints of pixels (m,), by the sharp reconstruction, in DN.

    Parameters
    ----------
    rgb
        (H, W, 3) codes of a frame.
    linear_dn
        (256,) what each code stands for.
    pixels
        row * width + column in the event camera.
    """
    rows, columns = prints.rows.sharp, prints.columns.sharp
    at_rows, at_columns = np.divmod(np.asarray(pixels, dtype=np.int64), len(columns.first))
    means = np.empty((len(pixels), 3))
    _average(rgb, linear_dn, at_rows, at_columns, rows.first, rows.weights, columns.first, columns.weights, means)
    return np.maximum(means, 0.0)


@njit(cache=True)
def _average(
    rgb: NDArray[np.uint8],
    linear_dn: Float64,
    at_rows: Int64,
    at_columns: Int64,
    first_rows: Int64,
    row_weights: Float64,
    first_columns: Int64,
    column_weights: Float64,
    means: Float64,
) -> None:
    for i in range(len(at_rows)):
        row, column = at_rows[i], at_columns[i]
        red = green = blue = 0.0
        for a in range(row_weights.shape[1]):
            line = rgb[first_rows[row] + a]
            for b in range(column_weights.shape[1]):
                weight = row_weights[row, a] * column_weights[column, b]
                pixel = line[first_columns[column] + b]
                red += weight * linear_dn[pixel[0]]
                green += weight * linear_dn[pixel[1]]
                blue += weight * linear_dn[pixel[2]]
        means[i, 0], means[i, 1], means[i, 2] = red, green, blue

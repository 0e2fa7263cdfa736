"""Vignetting: how the brightness of one surface point changes with its position in the image.

A surface that scatters light alike to all sides has one radiance L, wherever it is viewed from. A lens that loses light
towards the corners gives I = g L exp(-a s). Here s = (r / r_corner)^2, r is the tangent of the angle to the optical
axis, and g is the exposure of the frame. Two frames that show the same point at s1 and s2 then have

    y = ln(I2 / I1) = ln(g2 / g1) + a (s1 - s2),

which is linear in one constant a of the camera and one constant ln(g2 / g1) of the pair of frames. The loss in the
corner is 1 - exp(-a). If the true fall-off is 1 - b r^2, the fitted loss differs from b by some hundredths of b.

I is the sum of luma over the pixels of a small cell, so that noise, rounding and detail that the pixels do not resolve
average out before the logarithm is taken. The logarithm of a sum with a relative variance v is too small by v / 2
(second order). In y only the difference of both frames' biases remains, and |E y| <= (v1 + v2) / 2 = sigma^2 / 2 with
the variance sigma^2 of y.

The error of a has three estimates, of which the largest counts. The first is formal: cells are independent. The second
and third are sandwiches (H. White, Econometrica 48 (1980) 817), var a = sum u^2 / N^2 with the information N and the
score u that a part of the image leaves in one pair of frames, in all pairs together, or the whole image in one pair. A
surface that shines errs in its part for many pairs; a shadow that moves errs in one pair.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import expm1
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.huber_regression import huber_regression_weights
from fedora_qa.estimators.fitting.robust import robust_sigma
from fedora_qa.estimators.fitting.tails import shared_errors

Float64 = NDArray[np.float64]

PARTS: Final = (4, 6)
"""Rows and columns of the parts of the image whose scatter gives the standard error."""

FEWEST_CELLS: Final = 40
"""Cells below which a pair of frames is left out: the scale of fewer residuals is uncertain by more than a sixth."""


@dataclass(frozen=True, slots=True)
class CellRatios:
    """Brightness of the same surfaces in two frames, by cells of some pixels.

    Attributes
    ----------
    log_ratios
        (n,) ln of the later brightness over the earlier one.
    inward
        (n,) s1 - s2, with s the squared distance from the principal point as a share of that of the corner: positive
        where the surface moves towards the principal point.
    rounding_variances
        (n,) variance of ``log_ratios`` by rounding to 8 bits, of pixels with independent errors.
    darkening_dn
        (n,) DN by which a small fall-off a = 1 darkens a cell: its brightness times s, the mean of both frames.
    parts
        (n,) number of the part of the image, row by row.
    """

    log_ratios: Float64
    inward: Float64
    rounding_variances: Float64
    darkening_dn: Float64
    parts: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class PairEquations:
    """Normal equations of a from one pair of frames. The constant of the pair is eliminated.

    Attributes
    ----------
    information
        (p,) by parts, sum of w (x - mean x)^2 with x = s1 - s2 and w = Huber's weight over sigma^2. The variance
        sigma^2 of a cell is that of the scatter of all cells and that of its own rounding together.
    score
        (p,) by parts, sum of w (x - mean x) (y - mean y).
    bias
        Bound of the summed score by the logarithm of noisy sums: the sum of w |x - mean x| sigma^2 / 2.
    darkening_dn
        Sum of w (x - mean x)^2 times the DN by which a = 1 darkens a cell.
    """

    information: Float64
    score: Float64
    bias: float
    darkening_dn: float


@dataclass(frozen=True, slots=True)
class VignettingFit:
    """Fall-off of the brightness, a of ``exp(-a s)``.

    Attributes
    ----------
    a
        -ln of the brightness in the corner over that at the optical axis.
    standard_error, model_error_bound
        Of ``a``.
    step
        Value of a that darkens the cells by one DN on average: a smaller fall-off of rounded values may change no code.
    """

    a: float
    standard_error: float
    model_error_bound: float
    step: float

    @property
    def loss_percent(self) -> float:
        """Loss of the darker of corner and centre, percent of the brighter; negative where the centre is darker."""
        return float(np.copysign(-100 * expm1(-abs(self.a)), self.a))


def pair_equations(cells: CellRatios) -> PairEquations | None:
    """Return the normal equations of one pair of frames.

    Parameters
    ----------
    cells
        Of the pair.

    Returns
    -------
    PairEquations or None
        None where the pair has too few cells, or where all of them move alike.
    """
    x, y = cells.inward, cells.log_ratios
    if len(y) < FEWEST_CELLS or not np.ptp(x) > 0:
        return None
    X = np.stack((np.ones_like(x), x), axis=-1)
    huber = huber_regression_weights(X, y)
    theta = np.linalg.lstsq(np.sqrt(huber)[:, None] * X, np.sqrt(huber) * y, rcond=None)[0]
    # Surfaces of one colour keep their rounding error, so that their residuals may be 0.
    variance = float(robust_sigma(y - X @ theta, 0.0)) ** 2 + cells.rounding_variances
    w = huber / variance
    # Weighted least squares of y = c + a x, both sides about their weighted means.
    dx, dy = x - np.average(x, weights=w), y - np.average(y, weights=w)
    count = PARTS[0] * PARTS[1]
    return PairEquations(
        np.asarray(np.bincount(cells.parts, w * dx * dx, count), np.float64),
        np.asarray(np.bincount(cells.parts, w * dx * dy, count), np.float64),
        float(np.sum(w * np.abs(dx) * variance)) / 2,
        float(np.sum(w * dx * dx * cells.darkening_dn)),
    )


def fit_vignetting(pairs: Sequence[PairEquations]) -> VignettingFit | None:
    """Return the fall-off that fits all pairs of frames.

    Parameters
    ----------
    pairs
        In the order of time.

    Returns
    -------
    VignettingFit or None
        None without any pair.
    """
    if not pairs:
        return None
    information, score = np.stack([p.information for p in pairs]), np.stack([p.score for p in pairs])
    total = float(information.sum())
    a = float(score.sum()) / total
    # Score that the fit leaves in each part of each pair (pairs, parts).
    left = score - a * information
    occupied = information > 0
    by_part, parts = _sandwich(left[occupied], total)
    error = total**-0.5  # the inverse of the information is the formal variance
    for group in (left.sum(axis=1), left.sum(axis=0)[occupied.any(axis=0)]):
        by_group, groups = _sandwich(group, total)
        error = max(error, float(shared_errors(by_part, parts, by_group, groups)))
    darkening_dn = sum(p.darkening_dn for p in pairs) / total
    return VignettingFit(a, error, sum(p.bias for p in pairs) / total, 1.0 / darkening_dn)


def _sandwich(scores: Float64, total: float) -> tuple[float, int]:
    """Return the standard error of a by scores (n,) that groups leave, and n."""
    n = len(scores)
    # The fit makes the scores sum to zero, so that n - 1 of them are free.
    return float(np.sqrt(np.sum(scores**2) * n / max(n - 1, 1))) / total, n

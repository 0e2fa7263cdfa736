"""Position of the fitted weights of channels on the line from the order R, G, B to another order of the channels.

Weights w with error E under the right order m0, and m under another, are separated best along one line (R. A. Fisher,
"The use of multiple measurements in taxonomic problems", Annals of Eugenics 7 (1936)). With d = m - m0 and the
covariance T of E,

    s = d' T^-1 (w - m0) / d' T^-1 d

is 0 in the right order, 1 in the other, and has the least variance of all such measures. T holds the formal covariance
and the bounds of the biases, as if these were random. The weights have the sum 1, so that two of them are free.
"""

from itertools import permutations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.images.event_colours import ColourEstimate, ColourFit

Float64 = NDArray[np.float64]

WRONG_ORDERS: Final = tuple(order for order in map("".join, permutations("RGB")) if order != "RGB")

LEVEL_BIAS: Final = 0.01
"""Bias of a difference of weights by errors of the level between events: not derived, but measured.

With closed-form frames and events, the true levels give the weights to 0.0002. Levels interpolated between events
change
differences of weights by up to 0.006, beyond the difference of linear and cubic interpolation.
"""

_FREE: Final = np.array([[1.0, 0.0, -1.0], [-0.5, 1.0, -0.5]])
"""The two free coordinates of weights: the first less the third, the second less the mean of both."""


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

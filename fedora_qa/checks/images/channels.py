"""Colours against events: the order of the channels."""

from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np

from fedora_qa.checks.images.event_colours import ColourCheck, ColourResponse
from fedora_qa.checks.protocol import Statistic
from fedora_qa.estimators.images.event_colours import WRONG_ORDERS, nearest_order, towards
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts

DETECTED_AT: Final = 7.0
"""Standard errors at which a deviation is nearly always detected, beyond twice the bias; judgement applies its own
limit."""

EXCHANGED: Final = "BGR"
"""The usual wrong order, and the hardest to detect: red and blue have the nearest weights."""


@dataclass(frozen=True, slots=True)
class NearestChannelOrder(Feature):
    """Order of channels whose weights are nearest to the fitted ones.

    Attributes
    ----------
    order
        Three of the letters R, G, B; nearest relative to the errors.
    """

    order: str


class ImagesChannels(ColourCheck):
    """Are the channels of the frames R, G and B, in this order?

    For each of the five wrong orders, the position of the fitted weights of the channels between the correct order (0)
    and that wrong order (1).

    Why it matters
    --------------
    BGR frames look like frames. A network that was trained on them has wrong colours on other data, and luma is wrong
    by the difference of the weights of red (0.3) and blue (0.11).

    How
    ---
    Events measure the luma 0.299 R + 0.587 G + 0.114 B of linear values. The change by events is taken between two
    frame times at which the pixel's own events determine its level. It is regressed on the changes of the three
    channels, with the time offset as a nuisance parameter (``fedora_qa/estimators/images/event_colours.py``). The
    coefficients over their sum are the weights. The line that separates a wrong order from the correct one with the
    smallest error is Fisher's discriminant, with the covariance of the weights. It uses all three weights, which halves
    the error of a difference of two. The nearest order is named.

    Noise model
    -----------
    The standard error is the larger of the formal one and the jackknife over quarters of the image and windows. The
    model error bound is the sum of four biases of the weights: attenuation by errors of the frames that all channels
    share (bounded by the residual); attenuation by noise of single channels, of the variance that no combination of the
    other channels explains in small patches (``fedora_qa/estimators/images/channel_noise.py``); the error of the level
    between events (cubics against straight lines); and 0.01 in a difference of weights, measured with closed-form
    frames and events, where interpolated levels change it by up to 0.006.

    Cannot detect
    -------------
    The order in a scene with little colour or little motion, which is reported as not_observable. Frames that do not
    belong to the events (``event_response.orientation``). Constant exposure, and gains of single channels below a
    third.

    Sources
    -------
    R. A. Fisher, "The use of multiple measurements in taxonomic problems", Annals of Eugenics 7 (1936); B. Efron, C.
    Stein, "The jackknife estimate of variance", Annals of Statistics 9 (1981); ITU-R BT.601 for the weights.
    """

    name = "images.channels"

    def state(self, response: ColourResponse, declared: EventModel, facts: Facts) -> tuple[Statistic, ...]:
        """Return the position of the fitted weights between the declared order and each wrong one."""
        fit, nearest = response.fit, nearest_order(response.fit)
        weights = ", ".join(f"{weight.value:.2f}" for weight in fit.weights)
        estimates = [(order, towards(fit, order)) for order in WRONG_ORDERS]
        return tuple(
            Statistic(
                name=f"towards_{order}",
                value=estimate.value,
                unit="1",
                standard_error=estimate.standard_error,
                model_error_bound=estimate.bound,
                side="upper",
                # 1 is the whole way from the right order to the wrong one.
                statement=f"By the events, the channels have the weights {weights}: {estimate.value:.2f} +/- "
                f"{hypot(estimate.standard_error, estimate.bound):.2g} of the way "
                f"from R, G, B to {order}. The nearest order is {nearest}.",
                code="images.channels.order",
                where=Where(stream="rgb"),
                features=(NearestChannelOrder(nearest),),
            )
            for order, estimate in estimates
        )

    def why_blind(self, response: ColourResponse) -> str:
        """Return that an exchange of red and blue could not be detected; empty where it could."""
        estimate = towards(response.fit, EXCHANGED)
        if not np.isfinite(estimate.standard_error):
            return "the channels of the frames differ by no more than their noise"
        # A bias may hide an exchange, and another one may look like an exchange: twice the bound (DETECTED_AT).
        least = 2 * estimate.bound + DETECTED_AT * estimate.standard_error
        return "" if least <= 1 else f"too little colour: the detection limit is {least:.2f} of a red-blue exchange"

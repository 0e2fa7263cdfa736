"""Colours against events: the order of the channels."""

from math import hypot
from typing import Final

from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.estimators.images.channel_orders import WRONG_ORDERS, nearest_order, towards
from fedora_qa.estimators.images.event_colours import ColourFit, Estimate
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.event_colours import ColourAnswer, ColourCheck

SURELY: Final = 7.0
"""Standard errors at which a deviation would surely be seen, beyond a bias that may hide it and one that may feign it;
judgement draws its own line."""

EXCHANGED: Final = "BGR"
"""The usual wrong order, and the hardest to tell: red and blue have the nearest weights."""


class ImagesChannels(ColourCheck):
    """Are the channels of the frames R, G and B, in this order?

    How far the weights that events give to the three channels lie on the way from R, G, B to each of the five wrong
    orders: 0 in the right order, 1 in the wrong one.

    Why it matters
    --------------
    BGR frames look like frames. A network that was trained on them sees blue skin elsewhere, and their luma is wrong
    by the difference of 0.3 and 0.11 of red and blue.

    How
    ---
    Events carry the luma 0.299 R + 0.587 G + 0.114 B of linear values. At frame times where a pixel's own events tell
    its level, what the events say between two such times is regressed on the changes of the three channels, with the
    time offset as a nuisance (``fedora_qa/estimators/images/event_colours.py``). Coefficients over their sum are the
    weights. The line that tells a wrong order from the right one with the least error is Fisher's, with the covariance
    of the weights (``fedora_qa/estimators/images/channel_orders.py``): it uses all three weights, which halves the
    error against a difference of two. The nearest order is named.

    Noise model
    -----------
    Standard errors are the larger of the formal one and the jackknife over quarters of the image and windows. The
    allowance adds up what is known to bias the weights: attenuation by errors of the frames that are common to all
    channels (bounded by the residual), what events do not tell of the level between them (cubics against straight
    lines), and 0.01 in a difference of weights, seen with closed-form frames and events, where levels read between
    events move it by up to 0.006.

    Cannot see
    ----------
    The order in a scene of little colour or little motion, where it says so. Frames that do not belong to the events
    at all: ``event_response.orientation``. Constant exposure, and gains of single channels below a third.

    Sources
    -------
    R. A. Fisher, "The use of multiple measurements in taxonomic problems", Annals of Eugenics 7 (1936); B. Efron, C.
    Stein, "The jackknife estimate of variance", Annals of Statistics 9 (1981); ITU-R BT.601 for the weights.
    """

    name = "images.channels"

    def state(self, found: ColourAnswer, declared: EventModel, facts: Facts) -> tuple[Statistic, ...]:
        """State how far the weights lie towards each wrong order."""
        nearest = nearest_order(found.fit)
        return tuple(_one(towards(found.fit, order), order, found.fit, nearest) for order in WRONG_ORDERS)

    def why_blind(self, found: ColourAnswer) -> str:
        """Where red and blue exchanged could not be seen, the order is not known."""
        estimate = towards(found.fit, EXCHANGED)
        least = 2 * estimate.bound + SURELY * estimate.standard_error
        return "" if least <= 1 else f"too little colour: {least:.2f} of an exchange of red and blue would be seen"


def _one(estimate: Estimate, order: str, fit: ColourFit, nearest: str) -> Statistic:
    error = hypot(estimate.standard_error, estimate.bound)
    weights = ", ".join(f"{weight.value:.2f}" for weight in fit.weights)
    return Statistic(
        name=f"towards_{order}",
        value=estimate.value,
        unit="1",
        standard_error=estimate.standard_error,
        model_error_bound=estimate.bound,
        side="upper",
        material=1.0,
        statement=f"In what events see the channels weigh {weights}, {estimate.value:.2f} +/- {error:.2g} of the way "
        f"from R, G, B to {order}. They are best read as {nearest}.",
        code="images.channels.order",
        where=Where(stream="rgb"),
        suspects=(Suspect("channel_order", "rgb", 0.1 if nearest == "RGB" else 0.95), *_WHATEVER_SPOILS_LEVELS),
    )


_WHATEVER_SPOILS_LEVELS: Final = (
    *(Suspect(cause, "events", 0.2) for cause in ("spatial_offset", "time_offset", "threshold_misdeclared",
                                                  "event_model_misdeclared", "other_sequence", "mirrored")),
    Suspect("exposure_or_gamma", "rgb", 0.4),
    *(Suspect(cause, "rgb", 0.2) for cause in ("spatial_offset", "time_offset", "other_sequence",
                                               "mirrored", "swapped_frames", "frozen_frames")),
)  # fmt: skip
"""Faults that other checks name better."""

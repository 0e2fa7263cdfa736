"""Colours against events: the order of the channels."""

from itertools import permutations
from math import hypot
from typing import Final

import numpy as np

from fedora_qa.checks.images.colours import ColourAnswer, ColourCheck
from fedora_qa.checks.protocol import Measured, Suspect
from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.image_levels import CONTRASTS, ColourFit, Estimate
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel

CONTRAST_NAMES: Final = ("first_less_third", "second_less_first", "second_less_third")
CHANNELS: Final = ("RB", "GR", "GB")
"""What the contrasts of ``image_levels`` are where channels are in order."""


LEVEL_BIAS: Final = 0.02
"""What errors of the level between events do to a difference of weights: not derived, but seen.

With closed-form frames and events, where the true levels give the weights to 0.0002, levels read between events move
differences by up to 0.015, many times their standard error. It is a tenth of the least change that matters.
"""

SURELY: Final = 7.0
"""Standard errors at which a deviation would surely be seen; judgement draws its own line."""


class Channels(ColourCheck):
    """Are the channels of the frames R, G and B, in this order?

    Events carry the luma 0.299 R + 0.587 G + 0.114 B of linear values. At frame times where a pixel's own events tell
    its level, what the events say between two such times is regressed on the changes of the three channels, with the
    time offset as a nuisance (``image_levels``). The weights of the channels are the
    coefficients over their sum, which is the threshold's. Judged are the signs of the three differences of two weights,
    all positive where channels are in order: in any wrong order one is negative. Their size is not judged: errors of
    frames and levels that follow the image stretch them, 1.5 times in a second and 2.2 times in half a second of one
    clean scene of little colour. The order that comes nearest to the weights is named.

    Standard errors are the larger of the formal and the spread between quarters of the image and windows. The allowance
    bounds how errors of the frames, common to the channels, attenuate the coefficients, and what events do not tell of
    the level between them (cubics against straight lines). A scene without colours cannot
    tell: the least that it would show then exceeds the change of sign.
    """

    name = "images.channels"

    def state(self, found: ColourAnswer, declared: EventModel) -> tuple[Measured, ...]:
        """State the weight of each stored channel."""
        order = nearest_order(found.fit)
        return tuple(self._one(i, contrast, found.fit, order) for i, contrast in enumerate(found.fit.contrasts))

    def why_blind(self, found: ColourAnswer) -> str:
        """Red and blue are the nearest weights: where their exchange cannot be seen, the order is not known."""
        contrast, exchanged = found.fit.contrasts[0], 2 * float(CONTRASTS[0] @ LUMA_WEIGHTS_RGB)
        least = _allowance(contrast, exchanged / 2) + SURELY * contrast.standard_error
        if least <= exchanged:
            return ""
        return (
            f"too little colour: red and blue exchanged change R - B by {exchanged:.2f}, and {least:.2f} would be seen"
        )

    def _one(self, number: int, contrast: Estimate, fit: ColourFit, order: str) -> Measured:
        expected = float(CONTRASTS[number] @ LUMA_WEIGHTS_RGB)
        error = hypot(contrast.standard_error, contrast.bound)
        weights = ", ".join(f"{weight.value:.2f}" for weight in fit.weights)
        return Measured(
            name=f"weight_of_{CONTRAST_NAMES[number]}_channel",
            value=contrast.value,
            unit="1",
            standard_error=contrast.standard_error,
            expected=expected,
            allowance=_allowance(contrast, expected),
            side="lower",
            matters=2 * expected,
            statement=f"In what events see the channels weigh {weights}, so that {' - '.join(CHANNELS[number])} would "
            f"be {contrast.value:.2f} +/- {error:.2g}, and {expected:.2f} is due. They are best read as {order}.",
            code="images.channels.order",
            where=Where(stream="rgb"),
            suspects=(Suspect("channel_order", "rgb", 0.1 if order == "RGB" else 0.95), *_WHATEVER_SPOILS_LEVELS),
        )


def _allowance(contrast: Estimate, expected: float) -> float:
    """Return by how much a difference of weights may lie below what is due: down to none at least."""
    return max(expected, LEVEL_BIAS + contrast.bound)


def nearest_order(fit: ColourFit) -> str:
    """Return the order of channels whose weights come nearest to those that were found, for their errors."""
    found = np.array([weight.value for weight in fit.weights])
    errors = np.array([hypot(weight.standard_error, weight.bound) for weight in fit.weights])
    luma = dict(zip("RGB", LUMA_WEIGHTS_RGB, strict=True))

    def distance(order: str) -> float:
        return float(np.sum(((found - [luma[name] for name in order]) / np.maximum(errors, 1e-12)) ** 2))

    return min(("".join(order) for order in permutations("RGB")), key=distance)


_WHATEVER_SPOILS_LEVELS: Final = (
    *(Suspect(cause, "events", 0.2) for cause in ("spatial_offset", "time_offset", "threshold_misdeclared",
                                                  "event_model_misdeclared", "other_sequence", "mirrored")),
    Suspect("exposure_or_gamma", "rgb", 0.4),
    *(Suspect(cause, "rgb", 0.2) for cause in ("spatial_offset", "time_offset", "other_sequence",
                                               "mirrored", "swapped_frames", "frozen_frames")),
)  # fmt: skip
"""Faults that other checks name better."""

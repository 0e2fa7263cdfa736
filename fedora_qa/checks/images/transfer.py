"""Colours against events: the transfer curve."""

from math import hypot
from typing import Final

from fedora_qa.checks.images.colours import ColourAnswer, ColourCheck
from fedora_qa.checks.protocol import Measured, Suspect
from fedora_qa.estimators.image_levels import Estimate
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel

MATTERS: Final = 1.0
"""What the mildest curve of a display, a power of about 2, bends."""

THRESHOLD_OR_CURVE: Final = 0.25
"""In the log model a threshold that is wrong by so much passes for one; another check says it better."""

EXPONENTS_OF_DISPLAYS: Final = (1.7, 2.6)
"""What sRGB (2.4 at white, 1 in the dark, 2.2 on the whole) and gamma 2.2 look like."""


class Transfer(ColourCheck):
    """Are the values of the frames linear in radiance, once the declared transfer is undone?

    What events say between two frame times at which they tell a pixel's level is regressed on the change of the frames
    (as in images.channels). The value is the exponent by which linear values would have to be taken: 1, or about 2.2
    where codes for a display are declared as linear (0.45: linear values declared as such codes).

    A sensor of grey values tells it whatever its threshold is: an exponent bends the frames' steps by their level. In
    the log model an exponent multiplies every step alike and cannot be told from the threshold; there the declared
    thresholds are taken for true, and deviations under 25% are left to event_response.threshold. Constant exposure is
    not seen by the log model at all, and looks like a threshold to the other.

    Standard errors and allowances are those of images.channels.
    """

    name = "images.transfer"

    def state(self, found: ColourAnswer, declared: EventModel) -> tuple[Measured, ...]:
        """State the exponent."""
        by_level = declared.model == "linear"
        exponent, allowance = (found.fit.exponent, 0.0) if by_level else (found.fit.scale, THRESHOLD_OR_CURVE)
        error = hypot(exponent.standard_error, exponent.bound)
        condition = "" if by_level else ", if the thresholds are as declared"
        return (
            Measured(
                name="exponent" if by_level else "exponent_at_declared_thresholds",
                value=exponent.value,
                unit="1",
                standard_error=exponent.standard_error,
                expected=1.0,
                allowance=exponent.bound + allowance,
                matters=MATTERS,
                statement=f"Frames would have to be taken to the power {exponent.value:.2f} +/- {error:.2g} to be what "
                f"events see{condition}; they are best read as {found.best_curve}.",
                code="images.transfer.exponent",
                where=Where(stream="rgb"),
                suspects=_suspects(exponent, by_level),
            ),
        )


def _suspects(exponent: Estimate, by_level: bool) -> tuple[Suspect, ...]:
    low, high = EXPONENTS_OF_DISPLAYS
    of_a_display = low <= exponent.value <= high or 1 / high <= exponent.value <= 1 / low
    bent = of_a_display or by_level
    return (
        Suspect("exposure_or_gamma", "rgb", 0.95 if bent else 0.3),
        *(() if bent else (Suspect("threshold_misdeclared", "events", 0.8),)),
        Suspect("event_model_misdeclared", "events", 0.5),
        *(Suspect(cause, "events", 0.2) for cause in ("spatial_offset", "time_offset", "polarity_inverted",
                                                      "dropped_samples", "duplicated_samples", "other_sequence")),
        *(Suspect(cause, "rgb", 0.2) for cause in ("spatial_offset", "time_offset", "channel_order",
                                                   "swapped_frames", "frozen_frames", "other_sequence")),
    )  # fmt: skip

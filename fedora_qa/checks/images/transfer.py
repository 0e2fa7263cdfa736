"""Colours against events: the transfer curve."""

from math import hypot
from typing import Final

from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.estimators.images.event_colours import Estimate
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.event_colours import ColourAnswer, ColourCheck

MATTERS: Final = 0.5
"""Half of what the mildest curve of a display, a power of about 2, bends."""

LEVEL_BIAS: Final = 0.04
"""What errors of the level between events take off the exponent: not derived, but seen.

Clean files of all scenes give 0.963 to 0.992, whatever the model; closed-form frames and events give 1.002 to 1.006.
"""

EXPOSURE_BIAS: Final = 0.05
EXPOSURE_OF_BIAS_US: Final = 5_000.0
"""A frame exposed for 5 ms takes 5% off the contrast; the loss grows with the square of the time."""

EXPONENTS_OF_DISPLAYS: Final = (1.7, 2.6)
"""What sRGB (2.4 at white, 1 in the dark, 2.2 on the whole) and gamma 2.2 look like."""


class ImagesTransfer(ColourCheck):
    """Are the values of the frames linear in radiance, once the declared transfer is undone?

    The exponent by which the values would have to be taken to be what events see: 1, or about 2.2 where codes for a
    display are declared as linear (0.45: linear values declared as such codes).

    Why it matters
    --------------
    Everything that compares brightness, thresholds of events first of all, is off by the exponent: a contrast of 0.2
    nat reads 0.09 in codes of gamma 2.2.

    How
    ---
    What events say between two frame times at which they tell a pixel's level is regressed on the change of the
    frames, as in ``images.channels``. A sensor of grey values (the linear model) tells the exponent whatever its
    threshold is: an exponent bends the frames' steps by their level. In the log model an exponent multiplies every
    step alike and cannot be told from the threshold; there the declared thresholds are taken for true. The known
    curves are tried in turn, and the one that leaves the least residual is named.

    Noise model
    -----------
    Standard errors are the larger of the formal one and the jackknife over quarters of the image and windows. The
    allowance adds up: attenuation by errors of the frames, bounded by the residual; what events do not tell of the
    level between them (cubics against straight lines); 0.04, the most that clean files of all scenes lie below 1; six
    times the squared relative spread of thresholds that is declared, and 5% at 5 ms of exposure.

    Cannot see
    ----------
    Constant exposure: nothing to the log model, and a threshold to the other. In the log model an exponent from a
    wrong threshold: whoever deviates by less than a display's curve is suspected of the threshold, which
    ``event_response.threshold`` says better. Scenes of little motion or texture, where it says so.

    Sources
    -------
    IEC 61966-2-1 (sRGB); first principles, ``fedora_qa/estimators/images/event_colours.py``. The allowances for
    declared effects are those of ``event_response.threshold``.
    """

    name = "images.transfer"

    def state(self, found: ColourAnswer, declared: EventModel, facts: Facts) -> tuple[Statistic, ...]:
        """State the exponent."""
        by_level = declared.model == "linear"
        exponent = found.fit.exponent if by_level else found.fit.scale
        error = hypot(exponent.standard_error, exponent.bound)
        condition = "" if by_level else ", if the thresholds are as declared"
        return (
            Statistic(
                name="exponent" if by_level else "exponent_at_declared_thresholds",
                value=exponent.value,
                unit="1",
                standard_error=exponent.standard_error,
                expected=1.0,
                model_error_bound=exponent.bound + LEVEL_BIAS + _of_declared_effects(declared, facts),
                material=MATTERS,
                statement=f"Frames would have to be taken to the power {exponent.value:.2f} +/- {error:.2g} to be what "
                f"events see{condition}; they are best read as {found.best_curve}.",
                code="images.transfer.exponent",
                where=Where(stream="rgb"),
                suspects=_suspects(exponent, by_level),
            ),
        )


def _of_declared_effects(declared: EventModel, facts: Facts) -> float:
    """Return by how much a declared spread of thresholds and exposure move the exponent.

    Pixels of low threshold fire more, so that the mean step is less by up to six times the squared relative spread.
    """
    spread = declared.threshold_sigma / min(declared.threshold_on, declared.threshold_off)
    exposure_us = facts.declared.cameras["rgb"].exposure_us
    return 6 * spread**2 + EXPOSURE_BIAS * (exposure_us / EXPOSURE_OF_BIAS_US) ** 2


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

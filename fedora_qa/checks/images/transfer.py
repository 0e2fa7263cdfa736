"""Colours against events: the transfer curve."""

from dataclasses import dataclass
from math import hypot
from typing import Final

from fedora_qa.checks.images.event_colours import ColourCheck, ColourResponse
from fedora_qa.checks.protocol import Statistic
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts

LEVEL_BIAS: Final = 0.04
"""Bias of the exponent by errors of the level between events: not derived, but measured.

Correct files of all scenes give 0.963 to 0.992 with either model; closed-form frames and events give 1.002 to 1.006.
"""

EXPOSURE_BIAS: Final = 0.05
EXPOSURE_OF_BIAS_US: Final = 5_000.0
"""An exposure of 5 ms reduces the contrast by 5%; the loss grows with the square of the time."""


@dataclass(frozen=True, slots=True)
class CodesBent(Feature):
    """Codes are absent as under a power law that was applied to rounded values.

    Attributes
    ----------
    exponent
        Of the power law.
    """

    exponent: float


class ImagesTransfer(ColourCheck):
    """Are the values of the frames linear in radiance after the declared transfer is inverted?

    The exponent to which the frames' values must be raised to agree with the events: 1 in a correct file, about 2.2
    where display codes are declared as linear, 0.45 where linear values are declared as display codes.

    Why it matters
    --------------
    Every comparison of brightness, above all thresholds of events, is wrong by the exponent: a contrast of 0.2 nat is
    0.09 in codes of gamma 2.2.

    How
    ---
    The change by events between two frame times at which they determine the level of a pixel is regressed on the change
    of the frames, as in ``images.channels``. A sensor of grey values (the linear model) determines the exponent for any
    threshold: the exponent changes the frames' steps as a function of their level. In the log model an exponent
    multiplies every step by the same factor and cannot be separated from the threshold: the declared thresholds are
    assumed to be correct. The known transfer curves are fitted in turn, and the one with the smallest residual is
    named. A power law that was applied after values had been rounded to 8 bits leaves codes out, which show
    its exponent: it is then no threshold (``fedora_qa/estimators/images/gain.py``).

    Noise model
    -----------
    The standard error is the larger of the formal one and the jackknife over quarters of the image and windows. The
    model error bound is the sum of: attenuation by errors of the frames, bounded by the residual; the error of the
    level between events (cubics against straight lines); 0.04, the largest deviation below 1 in clean files of all
    scenes; six times the squared relative spread of declared thresholds; 5% for an exposure of 5 ms, proportional to
    the square of the exposure.

    Cannot detect
    -------------
    Constant exposure: it has no effect in the log model, and that of a threshold in the linear one. In the log model,
    an exponent before rounding is not separated from a wrong threshold: a deviation smaller than that of a display's
    curve is attributed to the threshold, which ``event_response.threshold`` measures better. Scenes with little motion
    or texture, which are reported as not_observable.

    Sources
    -------
    IEC 61966-2-1 (sRGB); first principles, ``fedora_qa/estimators/images/event_colours.py``. The bounds for declared
    effects are those of ``event_response.threshold``.
    """

    name = "images.transfer"

    def state(self, response: ColourResponse, declared: EventModel, facts: Facts) -> tuple[Statistic, ...]:
        """Return the exponent with which the frames' values agree with the level of the events."""
        by_level = declared.model == "linear"
        # The linear model gives the exponent by the level of each step; in the log model it scales all steps alike.
        exponent = response.fit.exponent if by_level else response.fit.scale
        error = hypot(exponent.standard_error, exponent.bound)
        # Pixels of low threshold have more events: the mean step is smaller by up to six times the squared relative
        # spread.
        spread = declared.threshold_sigma / min(declared.threshold_on, declared.threshold_off)
        exposure_us = facts.declared.cameras["rgb"].exposure_us
        of_declared_effects = 6 * spread**2 + EXPOSURE_BIAS * (exposure_us / EXPOSURE_OF_BIAS_US) ** 2
        bent = () if response.exponent_of_codes is None else (CodesBent(response.exponent_of_codes),)
        condition = "" if by_level else ", if the thresholds are as declared"
        return (
            Statistic(
                name="exponent" if by_level else "exponent_at_declared_thresholds",
                value=exponent.value,
                unit="1",
                standard_error=exponent.standard_error,
                expected=1.0,
                model_error_bound=exponent.bound + LEVEL_BIAS + of_declared_effects,
                statement=f"Values of frames agree with the events when raised to the power {exponent.value:.2f} +/- "
                f"{error:.2g}{condition}; the best transfer curve is {response.best_curve}.",
                code="images.transfer.exponent",
                where=Where(stream="rgb"),
                features=bent,
            ),
        )

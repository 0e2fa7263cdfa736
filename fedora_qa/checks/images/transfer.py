"""Colours against events: the transfer curve."""

from math import hypot
from typing import Final

from fedora_qa.checks.images.event_colours import ColourCheck, ColourResponse
from fedora_qa.checks.protocol import Statistic
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

    def state(self, response: ColourResponse, declared: EventModel, facts: Facts) -> tuple[Statistic, ...]:
        """Return the exponent with which the frames' values follow the level of the events.

        Parameters
        ----------
        response
            Fit of the file.
        declared
            The event sensor.
        facts
            Of the file.
        """
        by_level = declared.model == "linear"
        # The linear model gives the exponent by the level of each step; in the log model it scales all steps alike.
        exponent = response.fit.exponent if by_level else response.fit.scale
        error = hypot(exponent.standard_error, exponent.bound)
        # Pixels of low threshold have more events: the mean step is smaller by up to six times the squared relative
        # spread.
        spread = declared.threshold_sigma / min(declared.threshold_on, declared.threshold_off)
        exposure_us = facts.declared.cameras["rgb"].exposure_us
        of_declared_effects = 6 * spread**2 + EXPOSURE_BIAS * (exposure_us / EXPOSURE_OF_BIAS_US) ** 2
        condition = "" if by_level else ", if the thresholds are as declared"
        return (
            Statistic(
                name="exponent" if by_level else "exponent_at_declared_thresholds",
                value=exponent.value,
                unit="1",
                standard_error=exponent.standard_error,
                expected=1.0,
                model_error_bound=exponent.bound + LEVEL_BIAS + of_declared_effects,
                statement=f"Frames would have to be taken to the power {exponent.value:.2f} +/- {error:.2g} to be what "
                f"events see{condition}; they are best read as {response.best_curve}.",
                code="images.transfer.exponent",
                where=Where(stream="rgb"),
            ),
        )

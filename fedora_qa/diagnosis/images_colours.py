"""Hypotheses for frames whose colours are not what events measure: the order of channels, the transfer curve."""

from typing import Final

from fedora_qa.checks.images.channels import NearestChannelOrder
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

EXPONENTS_OF_DISPLAYS: Final = (1.7, 2.6)
"""What sRGB (2.4 at white, 1 in the dark, 2.2 on the whole) and gamma 2.2 look like."""


def propose_channels(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Propose another order of channels, and whatever spoils levels."""
    nearest = next(feature for feature in alarm.statistic.features if isinstance(feature, NearestChannelOrder))
    order = "order_where_declared_is_nearest" if nearest.order == "RGB" else "order_where_another_is_nearest"
    spoils = support("images.fault_spoils_weights")
    return (
        Hypothesis("channel_order", "rgb", support(f"images.{order}")),
        *(Hypothesis(cause, "events", spoils) for cause in ("spatial_offset", "time_offset", "threshold_misdeclared",
                                                            "event_model_misdeclared", "other_sequence", "mirrored")),
        Hypothesis("exposure_or_gamma", "rgb", support("images.transfer_spoils_weights")),
        *(Hypothesis(cause, "rgb", spoils) for cause in ("spatial_offset", "time_offset", "other_sequence",
                                                         "mirrored", "swapped_frames", "frozen_frames")),
    )  # fmt: skip


def propose_transfer(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Propose another transfer curve; where its exponent is confounded with the threshold, that as well."""
    exponent, (low, high) = alarm.statistic.value, EXPONENTS_OF_DISPLAYS
    # Either direction of the curve: linear light encoded for a display (1 / 2.2), or such codes taken as linear (2.2).
    of_a_display = low <= exponent <= high or 1 / high <= exponent <= 1 / low
    # In the linear model an exponent bends steps by their level, which no threshold does.
    bent = of_a_display or alarm.statistic.name == "exponent"
    spoils = support("images.fault_spoils_exponent")
    transfer = "transfer_of_a_display" if bent else "transfer_of_no_display"
    return (
        Hypothesis("exposure_or_gamma", "rgb", support(f"images.{transfer}")),
        *(() if bent else (Hypothesis("threshold_misdeclared", "events", support("images.threshold_as_exponent")),)),
        Hypothesis("event_model_misdeclared", "events", support("images.model_spoils_exponent")),
        *(Hypothesis(cause, "events", spoils) for cause in ("spatial_offset", "time_offset", "polarity_inverted",
                                                            "dropped_samples", "duplicated_samples", "other_sequence")),
        *(Hypothesis(cause, "rgb", spoils) for cause in ("spatial_offset", "time_offset", "channel_order",
                                                         "swapped_frames", "frozen_frames", "other_sequence")),
    )  # fmt: skip

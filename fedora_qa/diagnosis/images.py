"""Hypotheses for colour frames: repeats, order, exposure, the order of channels, the transfer curve, vignetting."""

from typing import Final

import numpy as np

from fedora_qa.checks.images.channels import NearestChannelOrder
from fedora_qa.checks.images.exposure import BrightnessJump, CodesMultiplied
from fedora_qa.checks.images.order import ALLOWED, OutOfOrderIntervals
from fedora_qa.checks.images.transfer import CodesBent
from fedora_qa.checks.images.vignetting import CornerLoss
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis, only_feature, support
from fedora_qa.diagnosis.measured_sizes import frames_lost_before
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

_FLOW_RIVALS_OF_ORDER: Final = (
    "swapped_frames",
    "frozen_frames",
    "flow_interval_shifted",
    "flow_gain",
    "flow_sign",
    "flow_unit",
    "other_sequence",
)
"""Causes in the flow: a wrong flow in single intervals deviates from correct frames as a correct flow deviates from
exchanged frames."""

EXPONENTS_OF_DISPLAYS: Final = (1.7, 2.6)
"""Range of fitted exponents of sRGB (2.4 at white, 1 in the dark, 2.2 on average) and of gamma 2.2."""


def propose_repeats(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for frames that repeat an earlier one bit for bit."""
    count = alarm.statistic.value
    return (
        Hypothesis("frozen_frames", "rgb", support("images.repeats_frozen"), count, "samples", 0.0),
        Hypothesis("time_offset", "rgb", support("images.repeats_late")),
        Hypothesis("duplicated_samples", "rgb", support("images.repeats_duplicated"), count, "samples", 0.0),
    )


def propose_order(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for frames, or parts of frames, that the flow does not map onto the next frame."""
    intervals = only_feature(alarm.statistic.features, OutOfOrderIntervals)
    of_order = hypotheses_of_order(intervals)
    _, lost = frames_lost_before(alarm, facts)
    if not lost and intervals.displaced is None:
        return of_order
    period_ms = float(np.median(np.diff(facts.clocks["rgb"].times_ns))) / NS_PER_MS
    if intervals.displaced is not None:
        late_ms = intervals.displaced.frames * period_ms
        return (
            # Whole frames are counted: the number has no error.
            Hypothesis("time_offset", "rgb", support("images.order_for_a_while"), late_ms, "ms", 0.0),
            *of_order,
        )
    # All frames behind the loss are early by the frames that are missing.
    return (
        Hypothesis("time_offset", "rgb", support("images.order_renumbered"), -lost[0] * period_ms, "ms"),
        Hypothesis("dropped_samples", "rgb", support("images.order_lost"), float(lost[0]), "samples"),
        *of_order,
    )


def hypotheses_of_order(intervals: OutOfOrderIntervals) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for intervals out of order.

    An exchange of frames reverses the motion: frames exchanged over a distance d leave d + 2 intervals out of order. A
    frozen frame stops the motion in one interval. Where no frame was moved to another place and back, the image itself
    was moved (in one interval) or mirrored (in many intervals).
    """
    ratios = intervals.relative_ratios
    # Displacement over that of the flow: 1 in order, 0 for a frame that stands still, negative in reversed order.
    turned = any(ratio < -ALLOWED for ratio in ratios)
    stopped = sum(abs(ratio) < ALLOWED for ratio in ratios)
    # Frames that are d apart leave d + 2 intervals out of order (docstring).
    exchanged_by = float(max(len(ratios) - 2, 1)) if turned else None
    # Share of the intervals that exchanged frames explain; the rest is a change of the image itself.
    displaced = {True: 1.0, False: 0.0, None: support("images.order_return_unmeasured")}[intervals.frames_return]
    swapped, frozen = displaced * turned, displaced * (stopped > 0 and not turned)
    moved, rival = 1 - displaced, support("images.order_other")
    run = "isolated" if intervals.isolated else "lasting"
    return (
        Hypothesis("spatial_offset", "rgb", moved * support(f"images.order_moved_{run}")),
        Hypothesis("mirrored", "rgb", moved * support(f"images.order_turned_{run}")),
        Hypothesis(
            "swapped_frames",
            "rgb",
            max(support("images.order_displaced") * swapped, support("images.order_least")),
            exchanged_by,
            "samples",
        ),
        Hypothesis(
            "frozen_frames",
            "rgb",
            max(support("images.order_displaced") * frozen, support("images.order_least")),
            float(max(stopped, 1)),
            "samples",
        ),
        Hypothesis("dropped_samples", "rgb", rival),
        Hypothesis("duplicated_samples", "rgb", rival),
        *(Hypothesis(cause, "flow", rival) for cause in _FLOW_RIVALS_OF_ORDER),
        # The check compares frames by the flow: whatever else is wrong with it for a while puts them off as well.
        Hypothesis(ANY_CAUSE, "flow", rival),
        Hypothesis("other_sequence", "rgb", rival),
    )


def propose_exposure(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for blank frames, for a jump of brightness, and for a gain after rounding."""
    match alarm.finding.code:
        case "images.exposure.blank":
            return (
                Hypothesis("exposure_or_gamma", "rgb", support("images.blank_exposure")),
                Hypothesis("dropped_samples", "rgb", support("images.blank_dropped")),
            )
        case "images.exposure.jump":
            jump = only_feature(alarm.statistic.features, BrightnessJump)
            size = jump.percent, "percent", jump.standard_error_percent
            if jump.corner_percent is not None:
                # Darker corners are a loss, of either sign: the jump may be the begin of it or the end.
                loss_percent = abs(jump.corner_percent)
                return (
                    Hypothesis("vignetting", "rgb", support("images.corner_vignetting"), loss_percent, "percent"),
                    Hypothesis("exposure_or_gamma", "rgb", support("images.corner_jump_exposure"), *size),
                )
            return (
                Hypothesis("exposure_or_gamma", "rgb", support("images.jump_exposure"), *size),
                Hypothesis("channel_order", "rgb", support("images.jump_channel_order")),
                *(
                    Hypothesis(cause, "rgb", support("images.jump_other_frame"))
                    for cause in ("other_sequence", "swapped_frames", "frozen_frames")
                ),
            )
        case _:
            gain = only_feature(alarm.statistic.features, CodesMultiplied)
            # Rounded codes bound the gain from both sides: half of that range stands for its standard error.
            size = gain.percent, "percent", gain.half_range_percent
            return (Hypothesis("exposure_or_gamma", "rgb", support("images.codes_exposure"), *size),)


def propose_channels(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return another order of channels as a cause, and causes of wrong levels."""
    nearest = only_feature(alarm.statistic.features, NearestChannelOrder)
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


def is_of_a_display(exponent: float, error: float = 0.0) -> bool:
    """Whether an exponent is that of a display's curve, in either direction, within an error.

    Linear light encoded for a display gives 1 / 2.2, such codes taken as linear 2.2.
    """
    low, high = EXPONENTS_OF_DISPLAYS
    return any(lower - error <= exponent <= upper + error for lower, upper in ((low, high), (1 / high, 1 / low)))


def propose_transfer(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return another transfer curve as a cause, and the threshold where it has the effect of the fitted exponent."""
    of_a_display = is_of_a_display(alarm.statistic.value)
    # In the linear model an exponent changes steps by their level; a threshold does not. Nor does it leave codes out.
    by_codes = any(isinstance(feature, CodesBent) for feature in alarm.statistic.features)
    bent = of_a_display or by_codes or alarm.statistic.name == "exponent"
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


def propose_vignetting(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return vignetting as a cause, and frames that do not show the surfaces to which the flow leads."""
    loss = only_feature(alarm.statistic.features, CornerLoss)
    size = loss.percent, "percent", loss.standard_error_percent
    mismatch = support("images.corner_mismatch")
    return (
        Hypothesis("vignetting", "rgb", support("images.corner_vignetting"), *size),
        *(Hypothesis(cause, "rgb", mismatch) for cause in ("spatial_offset", "time_offset", "other_sequence",
                                                           "mirrored", "swapped_frames", "frozen_frames")),
        *(Hypothesis(cause, "flow", mismatch) for cause in ("flow_gain", "flow_sign", "flow_unit", "axes_swapped",
                                                            "mirrored", "time_offset", "other_sequence")),
    )  # fmt: skip

"""Causes that alarms of colour frames point to."""

from typing import TypeVar

from fedora_qa.checks.images.exposure import BrightnessJump, CodesMultiplied
from fedora_qa.checks.images.order import ALLOWED, OutOfOrderIntervals
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

_RGB = "rgb"

_FLOW_RIVALS_OF_ORDER = (
    "swapped_frames",
    "frozen_frames",
    "flow_interval_shifted",
    "flow_gain",
    "flow_sign",
    "flow_unit",
    "other_sequence",
)
"""Flow that is wrong in single intervals is contradicted by frames in order as frames out of order are."""

FeatureType = TypeVar("FeatureType", bound=Feature)


def propose_repeats(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for frames that repeat an earlier one bit for bit."""
    count = alarm.statistic.value
    return (
        Hypothesis("frozen_frames", _RGB, support("images.repeats_frozen"), count, "samples", 0.0),
        Hypothesis("duplicated_samples", _RGB, support("images.repeats_duplicated"), count, "samples", 0.0),
    )


def propose_order(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for frames, or parts of them, that do not lie where the flow carries them."""
    return hypotheses_of_order(_feature(alarm, OutOfOrderIntervals))


def hypotheses_of_order(intervals: OutOfOrderIntervals) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for intervals out of order.

    Exchanged frames turn a motion round: frames that are d apart leave d + 2 intervals out of order. Frozen ones stop
    it, once for each. Where no frame left its place and returned to it, the image itself was moved, for one interval,
    or turned, for many.
    """
    ratios = intervals.relative_ratios
    # Displacement over that of the flow: 1 in order, 0 for a frame that stands still, negative in reversed order.
    turned = any(ratio < -ALLOWED for ratio in ratios)
    stopped = sum(abs(ratio) < ALLOWED for ratio in ratios)
    # Frames that are d apart leave d + 2 intervals out of order (docstring).
    exchanged_by = float(max(len(ratios) - 2, 1)) if turned else None
    # How far frames out of their places explain the intervals; the rest is a change of the image itself.
    displaced = {True: 1.0, False: 0.0, None: support("images.order_return_unmeasured")}[intervals.frames_return]
    swapped, frozen = displaced * turned, displaced * (stopped > 0 and not turned)
    moved, rival = 1 - displaced, support("images.order_other")
    run = "isolated" if intervals.isolated else "lasting"
    return (
        Hypothesis("spatial_offset", _RGB, moved * support(f"images.order_moved_{run}")),
        Hypothesis("mirrored", _RGB, moved * support(f"images.order_turned_{run}")),
        Hypothesis(
            "swapped_frames",
            _RGB,
            max(support("images.order_displaced") * swapped, support("images.order_least")),
            exchanged_by,
            "samples",
        ),
        Hypothesis(
            "frozen_frames",
            _RGB,
            max(support("images.order_displaced") * frozen, support("images.order_least")),
            float(max(stopped, 1)),
            "samples",
        ),
        Hypothesis("dropped_samples", _RGB, rival),
        Hypothesis("duplicated_samples", _RGB, rival),
        *(Hypothesis(cause, "flow", rival) for cause in _FLOW_RIVALS_OF_ORDER),
        Hypothesis("other_sequence", _RGB, rival),
    )


def propose_exposure(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for blank frames, for a jump of brightness, and for a gain after rounding."""
    match alarm.finding.code:
        case "images.exposure.blank":
            return (
                Hypothesis("exposure_or_gamma", _RGB, support("images.blank_exposure")),
                Hypothesis("dropped_samples", _RGB, support("images.blank_dropped")),
            )
        case "images.exposure.jump":
            jump = _feature(alarm, BrightnessJump)
            size = jump.percent, "percent", jump.standard_error_percent
            return (
                Hypothesis("exposure_or_gamma", _RGB, support("images.jump_exposure"), *size),
                Hypothesis("channel_order", _RGB, support("images.jump_channel_order")),
                *(
                    Hypothesis(cause, _RGB, support("images.jump_other_frame"))
                    for cause in ("other_sequence", "swapped_frames", "frozen_frames")
                ),
            )
        case _:
            gain = _feature(alarm, CodesMultiplied)
            # Rounded codes bound the gain from both sides: half of that range stands for its standard error.
            size = gain.percent, "percent", gain.half_range_percent
            return (Hypothesis("exposure_or_gamma", _RGB, support("images.codes_exposure"), *size),)


def _feature(alarm: Alarm, kind: type[FeatureType]) -> FeatureType:
    """Return the feature of a type that a statistic of the check always has."""
    return next(feature for feature in alarm.statistic.features if isinstance(feature, kind))

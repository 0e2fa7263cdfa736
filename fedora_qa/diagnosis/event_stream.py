"""Hypotheses for alarms of the checks of the event stream."""

from math import sqrt
from types import MappingProxyType
from typing import Final

from fedora_qa.checks.event_stream.bounds import EventExtent
from fedora_qa.checks.event_stream.duplicates import RepeatedEvents
from fedora_qa.checks.event_stream.gaps import EventsStampedTogether, ExpectedEvents, SilenceAtEnd
from fedora_qa.checks.event_stream.rates import HotPixelCount, MovedHotPixels
from fedora_qa.diagnosis.clocks import hypotheses_of_reset
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis, only_feature, support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.clock_resets import ClockReset

_RARE: Final = 1e-3
"""Largest share of events that repeat another by chance: jitter leaves most of them a microsecond of their own."""

_BY_CHANCE: Final = 3
"""Largest number of repeats by a hot pixel: of a pixel with 200 Hz, 0.2 of a thousand events have the microsecond of
another."""

_CAUSE_OF_MOVE: Final = MappingProxyType(
    {"mirrored": "mirrored", "transposed": "axes_swapped", "shifted": "spatial_offset"}
)
"""The fault that moves all events, and so the events of declared hot pixels, by a transform."""


def propose_bounds(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of events off the sensor, or of undefined polarities."""
    statistic = alarm.statistic
    if alarm.finding.code == "event_stream.bounds.polarity":
        supported = support("event_stream.polarity_undefined")
        return (Hypothesis("nan_in_stream", "events", supported, statistic.value, "samples"),)
    fits = any(feature.fits_exchanged for feature in statistic.features if isinstance(feature, EventExtent))
    exchanged = "event_stream.exchanged_columns" if fits else "event_stream.exchanged_columns_do_not_fit"
    return (
        Hypothesis("axes_swapped", "events", support(exchanged)),
        Hypothesis("intrinsics_centre", "metadata", support("event_stream.outside_by_centre")),
        Hypothesis("wrong_shape", "metadata", support("event_stream.outside_by_shape")),
    )


def propose_duplicates(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of repeated events: a packet that was written twice, or a hot pixel, jitter or rounding."""
    repeated = only_feature(alarm.statistic.features, RepeatedEvents)
    repeats = repeated.count
    if alarm.finding.code == "event_stream.duplicates.packet":
        supported = support("event_stream.doubled_ticks")
        return (Hypothesis("duplicated_samples", "events", supported, float(repeats), "samples"),)
    if 2 * repeated.at_crowds > repeats:
        # Whoever writes an event twice crowds no other pixel into its timestamp.
        return (
            Hypothesis("quantised_time", "events", support("event_stream.repeats_at_crowds")),
            Hypothesis(
                "duplicated_samples",
                "events",
                support("event_stream.repeats_of_crowds_doubled"),
                float(repeats),
                "samples",
            ),
        )
    few = repeats <= _BY_CHANCE
    rare = facts.events is not None and repeats <= _RARE * facts.events.count
    by_jitter = "event_stream.rare_repeats_of_jitter" if rare else "event_stream.repeats_of_jitter"
    by_hot_pixels = "event_stream.few_repeats_of_hot_pixels" if few else "event_stream.repeats_of_hot_pixels"
    return (
        Hypothesis("duplicated_samples", "events", support("event_stream.repeats"), float(repeats), "samples"),
        Hypothesis("hot_pixels", "events", support(by_hot_pixels)),
        Hypothesis("time_jitter", "events", support(by_jitter)),
        Hypothesis("quantised_time", "events", support("event_stream.repeats_of_rounding")),
    )


def propose_gaps(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of an interval without events: lost events, or a clock that was set, or one time for all.

    Where events were sorted after their clock had been set for a while, no step back is left: the offset of that while
    is seen by events that do not add up (``event_conservation``), which lost events seldom mimic.
    """
    features = alarm.statistic.features
    at_end = [feature for feature in features if isinstance(feature, SilenceAtEnd)]
    if at_end:
        percent = 100 * at_end[0].silent_ratio
        return (Hypothesis("truncated", "events", support("event_stream.silent_end"), percent, "percent"),)
    lost = only_feature(features, ExpectedEvents).count
    resets = [feature for feature in features if isinstance(feature, ClockReset)]
    together = [feature for feature in features if isinstance(feature, EventsStampedTogether)]
    if together:
        supported = support("event_stream.silence_of_packet")
    else:
        supported = support("event_stream.silence_of_reset" if resets else "event_stream.silence")
    packets = (
        Hypothesis("quantised_time", "events", support("event_stream.stamped_together"), packet.step_ms, "ms")
        for packet in together
    )
    # The number of lost events has the Poisson error of the expected number.
    dropped = Hypothesis("dropped_samples", "events", supported, float(lost), "samples", sqrt(lost))
    of_resets = (hypothesis for reset in resets for hypothesis in hypotheses_of_reset(reset))
    # A clock that was set has the length of the silence, up to the mean interval between events.
    length_ms = alarm.statistic.value
    of_step = support("event_stream.silence_of_step")
    step = () if resets else (Hypothesis("time_offset", "events", of_step, length_ms, "ms", length_ms / max(lost, 1)),)
    return *packets, *of_resets, dropped, *step


def propose_rates(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of high rates of pixels: hot pixels, or declared ones that a move of all events displaced.

    Silent columns and rows are of a declared size that is too large.
    """
    statistic = alarm.statistic
    if alarm.finding.code == "event_stream.rates.silent_border":
        return (Hypothesis("wrong_shape", "metadata", support("event_stream.silent_border")),)
    moves = tuple(
        Hypothesis(
            _CAUSE_OF_MOVE[feature.transform],
            "events",
            support("event_stream.moved_hot_pixels"),
            # Only a shift has a size, px to the right; a mirror image and exchanged axes have none.
            feature.right_px,
            "px" if feature.transform == "shifted" else "",
        )
        for feature in statistic.features
        if isinstance(feature, MovedHotPixels)
    )
    if alarm.finding.code == "event_stream.rates.declared_hot_pixels":
        supported = support("event_stream.declared_hot_rate_of_moved" if moves else "event_stream.declared_hot_rate")
        percent = 100 * (statistic.value / statistic.expected - 1)
        declared = Hypothesis("noise_misdeclared", "events", supported, percent, "percent")
        if moves or percent > 0:
            return *moves, declared
        # Whatever loses or moves events takes those of hot pixels as well.
        return declared, Hypothesis(ANY_CAUSE, "events", support("event_stream.silenced_hot_pixels"))
    supported = support("event_stream.hot_pixels_that_moved" if moves else "event_stream.hot_pixels")
    count = only_feature(statistic.features, HotPixelCount).count
    return *moves, Hypothesis("hot_pixels", "events", supported, float(count), "pixels")

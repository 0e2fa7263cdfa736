"""Hypotheses for flow at pixels without a valid value, and for flow on intervals that no frames have."""

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.checks.flow_geometry.interval_timestamps import (
    FlowRatesCounted,
    IntervalLengths,
    IntervalOrder,
    IntervalsOffFrames,
    TimestampPattern,
)
from fedora_qa.checks.flow_geometry.validity import WrongFlowValues
from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.diagnosis.flow import DISPLACEMENTS, spreads_over
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import flow_rate_hz, is_flow_stream
from fedora_qa.sequence.facts import Facts

_CAUSE_OF_PATTERN: Final = MappingProxyType(
    {"constant": "time_offset", "drift": "clock_rate", "grid": "quantised_time", "unit": "time_unit"}
)
_THOUSANDS: Final = (1e-6, 1e-3, 1e3, 1e6)
_SAME_LENGTH: Final = 0.02


def propose_validity(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for wrong pixels, or for wrong intervals of one rate."""
    features = alarm.statistic.features
    values = next((feature for feature in features if isinstance(feature, WrongFlowValues)), None)
    if values is not None:
        flow = spreads_over(
            alarm.finding.where.stream or "flow", {stream: stream in values.streams for stream in facts.flow_streams}
        )
        rule = alarm.finding.code.rpartition(".")[2]
        encoding_of_depth = support("flow_geometry.encoding_of_depth")
        causes: tuple[tuple[str, str, float], ...]
        if rule == "infinite":
            causes = (("invalid_encoding", "flow", support("flow_geometry.infinite_flow")),)
        elif values.unfounded and values.missing:  # values without depth, and depth without values
            causes = DISPLACEMENTS
        elif rule == "missing":
            causes = (("nan_in_stream", "flow", support("flow_geometry.missing_flow")),
                      ("invalid_encoding", "depth", encoding_of_depth))  # fmt: skip
        # More than half of the unfounded values belong to points behind the camera: the motion exceeds the depth.
        elif 2 * values.behind > values.unfounded:
            blamed = "pose" if values.deep else "depth"
            causes = (("unit_mm_m", blamed, support("flow_geometry.points_behind_camera")),
                      (ANY_CAUSE, blamed, support("flow_geometry.any_fault_behind_camera")))  # fmt: skip
        else:
            causes = (("invalid_encoding", "flow", support("flow_geometry.encoding_of_flow")),
                      ("invalid_encoding", "depth", encoding_of_depth))  # fmt: skip
            if 2 * values.alike <= values.unfounded:  # flow that varies, so it was generated from a depth
                factor = support("flow_geometry.encoding_of_varied_flow")
                causes = (("nan_in_stream", "depth", support("flow_geometry.lost_depth")),
                          *((cause, stream, factor * weight) for cause, stream, weight in causes))  # fmt: skip
        return tuple(
            Hypothesis(cause, flow if stream == "flow" else stream, weight) for cause, stream, weight in causes
        )
    counted = next((feature for feature in features if isinstance(feature, FlowRatesCounted)), None)
    if counted is None:
        return ()
    hypotheses = _of_the_intervals(alarm.finding.where.stream or "flow", features, facts)
    if not all(counted.counted.values()):
        return hypotheses
    # Every rate has such intervals: one fault of the flow as a whole.
    return tuple(replace(h, stream="flow") if stream_family(h.stream) == "flow" else h for h in hypotheses)


def _of_the_intervals(stream: str, features: Sequence[Feature], facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of moved timestamps, after those of missing, doubled, exchanged or wrongly long intervals."""
    # Pattern of the differences of timestamps from frames; colour frames decide which stream deviates.
    of_frames: list[Hypothesis] = []
    relation = next((feature for feature in features if isinstance(feature, IntervalsOffFrames)), None)
    if relation is not None and relation.beyond_all_frames:
        of_frames = [
            Hypothesis("truncated", "depth", support("flow_geometry.depth_ends_early")),
            Hypothesis("time_offset", stream, support("flow_geometry.offset_beyond_frames")),
        ]
    elif relation is not None:
        if relation.at_missing_frame:
            of_frames.append(Hypothesis("dropped_samples", "depth", support("flow_geometry.frames_missing")))
        # Flow with the timestamps of colour frames is correct. Without them flow is suspected first: it has fewer
        # timestamps.
        flow_is_suspected = not relation.at_missing_frame and not relation.on_colour_frames
        for pattern in features:
            if (
                isinstance(pattern, TimestampPattern)
                and pattern.removed_share > 0
                and not _is_own_beat(pattern, stream)
            ):
                which = "suspected" if flow_is_suspected is (pattern.stream != "depth") else "other"
                weight = support(f"flow_geometry.pattern_of_{which}_stream") * pattern.removed_share
                cause = _CAUSE_OF_PATTERN[pattern.pattern]
                unit = CAUSES[cause].unit
                of_frames.append(Hypothesis(cause, pattern.stream, weight, pattern.magnitude, unit))
    # Missing, doubled, exchanged or wrongly long intervals.
    for feature in features:
        if isinstance(feature, IntervalOrder):
            counts = {
                "dropped_samples": feature.gaps,
                "duplicated_samples": feature.overlaps,
                "unsorted": (feature.moved + 1) // 2,  # an exchange moves two rows
            }
            total, disorder = max(sum(counts.values()), 1), support("flow_geometry.disordered_intervals")
            hypotheses = [
                Hypothesis(of_count, stream, disorder * count / total, float(count), "samples")
                for of_count, count in counts.items()
                if count
            ]
            return (*sorted(hypotheses, key=lambda hypothesis: -hypothesis.support), *of_frames)
        if isinstance(feature, IntervalLengths):
            length_ns = feature.median_ns
            # ``flow/<n>hz`` has intervals of 1 / n s: the name of a stream states the length of its intervals.
            rates_hz = map(flow_rate_hz, facts.flow_streams)
            if any(abs(length_ns - NS_PER_S / rate) < _SAME_LENGTH * length_ns for rate in rates_hz):
                mixed = Hypothesis("flow_rate_mixed", stream, support("flow_geometry.length_of_another_rate"))
                return (mixed, *of_frames)
            # Measured length of an interval over the length that the stream's name states.
            lengths = length_ns * flow_rate_hz(stream) / NS_PER_S
            is_unit = lengths > 0 and any(abs(lengths / factor - 1) < _SAME_LENGTH for factor in _THOUSANDS)
            row = "length_in_another_unit" if is_unit else "length_of_no_unit"
            return (
                Hypothesis("time_unit", stream, support(f"flow_geometry.{row}")),
                *of_frames,
                Hypothesis("dropped_samples", stream, support("flow_geometry.length_beside_missing")),
            )
    return tuple(of_frames)


def _is_own_beat(pattern: TimestampPattern, stream: str) -> bool:
    """Whether a grid of flow is the length of its intervals: those that abut keep to it however late they are."""
    of_flow = pattern.pattern == "grid" and stream_family(pattern.stream) == "flow"
    if not of_flow or not is_flow_stream(stream):
        return False
    return NS_PER_MS * pattern.magnitude > (1.0 - _SAME_LENGTH) * NS_PER_S / flow_rate_hz(stream)

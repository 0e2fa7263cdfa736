"""Hypotheses for events that do not agree with the frames: orientation, model, threshold, clock, alignment, frames.

Hypotheses for events that violate the law of conservation stand in ``event_conservation``.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.clocks.resolution import distance_of_instants_us
from fedora_qa.checks.event_response.alignment import CameraErrorFits, EventShift
from fedora_qa.checks.event_response.frames import ChangeAnomalies
from fedora_qa.checks.event_response.jitter import TimestampScatter
from fedora_qa.checks.event_response.orientation import EventSymmetry
from fedora_qa.checks.event_response.threshold import DomainPreference, EventStepSize
from fedora_qa.checks.event_response.timing import DelayCourses, DelayedSegment, OffsetSize
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.diagnosis.clock_grids import places_of_clocks
from fedora_qa.diagnosis.clock_units import units_of_brief_events
from fedora_qa.diagnosis.declared_intrinsics import hypotheses_of_centres, odd_intrinsics
from fedora_qa.diagnosis.hypothesis import Hypothesis, only_feature, support, weakened
from fedora_qa.diagnosis.measured_sizes import length_with_error, rgb_px_per_event_px
from fedora_qa.estimators.clocks.regular_clock import fit_regular_clock, rounding_grid_ns
from fedora_qa.estimators.events.shift_field import FOCAL_MODELS, ShiftFieldFit, ShiftFieldModel
from fedora_qa.faults.fault import signed_length
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.clock_resets import ClockReset, clock_reset
from fedora_qa.views.event_clock_offset import ClockOffset
from fedora_qa.views.level_samples import CAPTURE_RANGE_S

_REVERSED_BELOW: Final = -0.5
"""Ratio of fitted to expected step below which steps have the opposite sign, with at least half the contrast."""

_DOMAIN_PREFERRED: Final = 3.0
"""Standard errors by which the other domain must fit better to become a hypothesis (after an alarm only)."""

_HALF_TURN: Final = -1.0
"""Trace of the rotation of the image's axes below which it is nearer to a half turn than to a quarter turn."""

_FEWEST_UNRELATED: Final = 3
"""Least number of successive intervals without correlation for another sequence: two lie beside one wrong frame."""

_EVENTS: Final = support("event_response.clock_of_events")
_FRAMES: Final = support("event_response.clock_of_frames")

_NO_COURSES: Final = DelayCourses(
    support("event_response.course_constant"),
    support("event_response.course_drift"),
    support("event_response.course_segment"),
    reaches_end=False,
)
"""Support of the courses of the delay where they were not compared."""


def propose_orientation(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm of ``event_response.orientation``, best supported first."""
    if alarm.finding.code in ("event_response.orientation.unrelated", "event_response.orientation.other"):
        if facts.events is None or not facts.events.count:
            return (Hypothesis("missing_stream", "events", support("event_response.orientation.no_events")),)
        if not alarm.statistic.features:
            if of_unit := hypotheses_of_brief_events(facts):
                return of_unit
            # No orientation correlates; ``event_response.timing`` searches for an offset.
            return (
                Hypothesis("other_sequence", "events", support("event_response.orientation.other_events")),
                Hypothesis("other_sequence", "rgb", support("event_response.orientation.other_frames")),
                Hypothesis("time_offset", "events", support("event_response.orientation.events_offset")),
                Hypothesis("time_offset", "rgb", support("event_response.orientation.frames_offset")),
                Hypothesis("time_unit", "events", support("event_response.orientation.time_unit")),
                *(hypotheses_of_centres(facts) if odd_intrinsics(facts) else ()),
            )
    (symmetry,) = (feature for feature in alarm.statistic.features if isinstance(feature, EventSymmetry))
    hypotheses = hypotheses_of_symmetry(symmetry)
    if symmetry.mirrored_columns and symmetry.mirrored_rows and _are_mounted_upside_down(facts):
        # The declared half turn is what the events lack: turned events would need a turned sensor as well.
        return tuple(weakened(hypotheses, support("event_response.orientation.beside_a_half_turn")))
    return hypotheses


def hypotheses_of_brief_events(facts: Facts) -> tuple[Hypothesis, ...]:
    """Return another unit as the cause where all events lie within a small part of the other streams; else nothing."""
    units = units_of_brief_events(facts)[:1]
    return tuple(Hypothesis("time_unit", "events", support("event_response.brief"), unit.factor, "1") for unit in units)


def _are_mounted_upside_down(facts: Facts) -> bool:
    """Whether the declared cameras of colour and events are turned by half about their optical axis."""
    cameras = facts.declared.cameras
    if not {"rgb", "events"} <= cameras.keys():
        return False
    # Axes x and y of the image point the other way: the trace of their rotation is -2.
    relative = cameras["rgb"].T_body_camera[:3, :3].T @ cameras["events"].T_body_camera[:3, :3]
    return float(relative[0, 0] + relative[1, 1]) < _HALF_TURN


def hypotheses_of_symmetry(symmetry: EventSymmetry) -> tuple[Hypothesis, ...]:
    """Return the causes for a symmetry under which events agree with the frames."""
    mirrored = symmetry.mirrored_columns or symmetry.mirrored_rows
    causes = (
        ("polarity_inverted", symmetry.inverted),
        ("axes_swapped", symmetry.swapped_axes),
        ("mirrored", mirrored),
    )
    weight = support("event_response.orientation.symmetry")
    names = [cause for cause, applies in causes if applies]
    of_events = tuple(Hypothesis(cause, "events", weight, is_joint=len(names) > 1) for cause in names)
    if not mirrored or symmetry.swapped_axes:
        return of_events
    # Mirrored frames have the effect of mirrored events; axes of frames are not exchanged, as both sides differ.
    return (*of_events, Hypothesis("mirrored", "rgb", support("event_response.orientation.mirrored_frames")))


def propose_model(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the other model as a cause, and frames whose transfer curve turns one domain into the other."""
    return (
        Hypothesis("event_model_misdeclared", "events", support("event_response.model_of_other_domain")),
        Hypothesis("exposure_or_gamma", "rgb", support("event_response.transfer_of_other_domain")),
    )


def propose_threshold(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return a misdeclared threshold as a cause, with its size, and other causes of a wrong step of events."""
    step = only_feature(alarm.statistic.features, EventStepSize)
    domains = only_feature(alarm.statistic.features, DomainPreference)
    ratio = step.fitted / step.expected
    if ratio < _REVERSED_BELOW:
        return (Hypothesis("polarity_inverted", "events", support("event_response.polarity_of_reversed_steps")),)
    threshold, model, transfer = (
        ("threshold_where_other_model_fits", "model_where_other_model_fits", "transfer_spoils_thresholds")
        if domains.log_residual_ratio > _DOMAIN_PREFERRED * domains.standard_error
        else (
            "threshold_where_declared_model_fits",
            "model_where_declared_model_fits",
            "transfer_where_declared_model_fits",
        )
    )
    # Beyond the capture range of the fit, an offset biases the thresholds.
    offset, offset_rgb = (
        ("gross_offset_spoils_thresholds", "gross_offset_of_frames_spoils_thresholds")
        if abs(step.delay_s) > CAPTURE_RANGE_S
        else ("small_offset_spoils_thresholds", "small_offset_spoils_thresholds")
    )
    # The declared threshold over the true one, less 1; its error by the derivative of 1 / fitted.
    percent = 100 * (step.expected / step.fitted - 1) if ratio > 0 else None
    uncertainty = 100 * step.expected / step.fitted**2 * step.error if ratio > 0 else None
    of_threshold = support(f"event_response.{threshold}")
    return (
        Hypothesis("threshold_misdeclared", "events", of_threshold, percent, "percent", uncertainty),
        Hypothesis("event_model_misdeclared", "events", support(f"event_response.{model}")),
        Hypothesis("time_offset", "events", support(f"event_response.{offset}")),
        Hypothesis("time_offset", "rgb", support(f"event_response.{offset_rgb}")),
        Hypothesis("exposure_or_gamma", "rgb", support(f"event_response.{transfer}")),
        Hypothesis("dropped_samples", "events", support("event_response.lost_events_spoil_thresholds")),
        Hypothesis("duplicated_samples", "events", support("event_response.lost_events_spoil_thresholds")),
        *_of_rounded_frames(0.0, facts, "rounded_frames_spoil_thresholds"),
    )


def propose_timing(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return an offset and a rate of either clock, each supported by the course of the delay over time."""
    statistic, rule = alarm.statistic, alarm.finding.code.rpartition(".")[2]
    wrong_model = Hypothesis("event_model_misdeclared", "events", support("event_response.model_spoils_delays"))
    if rule == "region":
        # All pixels have one clock: only a move of events delays a part of the image.
        of_region = support("event_response.offset_of_region")
        offset = Hypothesis("time_offset", "events", of_region, statistic.value, "ms", statistic.standard_error)
        return offset, wrong_model
    compared = next((feature for feature in statistic.features if isinstance(feature, DelayCourses)), None)
    courses = _NO_COURSES if compared is None else with_clock_reset(compared, clock_reset(facts.events))
    part = next((feature for feature in statistic.features if isinstance(feature, DelayedSegment)), None)
    if rule == "stretch":
        # The part that is compared with the rest may be the one that is right.
        size_ms = statistic.value if part is None else part.offset_ms
        error_ms: float | None = statistic.standard_error if part is None else part.error_ms
        return (
            *offset_hypotheses(size_ms, error_ms, facts, courses.segment),
            *_of_rounded_frames(size_ms, facts, "delays_of_rounded_frames"),
            Hypothesis("clock_rate", "events", _EVENTS * courses.drift),
            Hypothesis("clock_rate", "rgb", _FRAMES * courses.drift),
            wrong_model,
        )
    estimate = only_feature(statistic.features, ClockOffset)
    if rule == "rate":
        return (
            *_rates(estimate, 1.0 - courses.segment),
            Hypothesis("time_offset", "events", _EVENTS * courses.segment),
            Hypothesis("time_offset", "rgb", _FRAMES * courses.segment),
            wrong_model,
        )
    size = only_feature(statistic.features, OffsetSize)
    # The mean offset of a file is that of the fault only where all events have the offset.
    of_file = courses.constant > courses.segment
    offset_ms = statistic.value - statistic.expected if of_file or part is None else part.offset_ms
    error_ms = size.error_ms if of_file or part is None else part.error_ms
    is_sized = size.of_all_pixels and (of_file or part is not None)
    return (
        *offset_hypotheses(offset_ms, error_ms if is_sized else None, facts, courses.constant + courses.segment),
        *_rates(estimate, courses.drift),
        *_of_rounded_frames(statistic.value - statistic.expected, facts, "delays_of_rounded_frames"),
        *_of_rounded_events(statistic.value - statistic.expected, facts),
        wrong_model,
        # Events of a shifted image come before or after the edge by the shift over its speed.
        *hypotheses_of_centres(facts),
    )


def propose_jitter(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return jitter of the timestamps with its size, and events that are noise."""
    scatter = only_feature(alarm.statistic.features, TimestampScatter)
    # A lower bound has no error.
    size = (None, None) if scatter.saturated else (scatter.sigma_ms, scatter.error_ms)
    of_jitter = support("event_response.scatter_of_stamps")
    return (
        Hypothesis("time_jitter", "events", of_jitter, size[0], "ms", size[1]),
        Hypothesis("noise_misdeclared", "events", support("event_response.scatter_of_noise")),
    )


def with_clock_reset(courses: DelayCourses, reset: ClockReset | None) -> DelayCourses:
    """Return the courses of the delay with part of the support of a segment moved to drift, by a clock reset.

    Without a step forwards, a segment that reaches an end of the measured delays has an offset, so its support stays.
    Any other segment without such a step can only be due to a clock that runs fast.

    Parameters
    ----------
    courses
        Supports of a constant delay, of drift, and of a segment.
    reset
        Of the events' clock; None where there is none.

    Returns
    -------
    DelayCourses
        The sum of the supports is unchanged.
    """
    if reset is None or (reset.forwards is None and courses.reaches_end):
        return courses
    gains, offset = reset.drift_agreement, reset.offset_agreement
    moved = courses.segment * gains / (gains + offset) if gains > 0 else 0.0
    return replace(courses, drift=courses.drift + moved, segment=courses.segment - moved)


def whose_offset(offset_ms: float, facts: Facts) -> tuple[float, float]:
    """Return the support of a clock offset of the events, and of one of the frames.

    A renderer draws colour, depth and flow at common times. If the frames meet these times only after the offset is
    subtracted, the frames have the offset; if they meet them as stored, the frames have none.
    The reasons for the numbers stand in ``support.toml``, under ``event_response``.

    Parameters
    ----------
    offset_ms
        Clock offset of the events against the frames, ms; positive where events are too late.
    facts
        With the clocks of colour, depth and flow.

    Returns
    -------
    of_events
        Support of an offset of the events.
    of_frames
        Support of an offset of the frames, of the opposite sign.
    """
    either = _EVENTS, _FRAMES
    clocks = [facts.clocks[stream] for stream in ("depth", *facts.flow_streams) if stream in facts.clocks]
    common_ns = np.unique(np.concatenate([clock.times_ns for clock in clocks])) if clocks else np.zeros(0, np.int64)
    frames_ns = facts.clocks["rgb"].times_ns
    if len(common_ns) < 2 or not len(frames_ns):
        return either
    # 1e6 ns per ms. A quarter of the offset separates timestamps with the offset from those without.
    near_ns = abs(offset_ms) * 1e6 / 4
    as_timestamped = _median_distance(frames_ns, common_ns) < near_ns
    moved_back = _median_distance(frames_ns + round(1e6 * offset_ms), common_ns) < near_ns
    # Frames meet the common times with and without the offset, or in neither case: these times do not decide, but all
    # clocks do where colour left the grid of the others, alone or with depth.
    if as_timestamped == moved_back:
        return either[::-1] if places_of_clocks(facts)["rgb"].place == "out" else either
    return either[::-1] if moved_back else (_EVENTS, support("event_response.clock_of_frames_in_step"))


def _median_distance(times_ns: NDArray[np.int64], grid_ns: NDArray[np.int64]) -> float:
    """Return the median distance of timestamps from the nearest of a sorted grid of two or more."""
    # The neighbours ``after - 1`` and ``after`` exist for timestamps beyond the ends of the grid as well.
    after = np.clip(np.searchsorted(grid_ns, times_ns), 1, len(grid_ns) - 1)
    return float(np.median(np.minimum(np.abs(times_ns - grid_ns[after - 1]), np.abs(grid_ns[after] - times_ns))))


def offset_hypotheses(
    offset_ms: float, error_ms: float | None, facts: Facts, explained: float = 1.0
) -> tuple[Hypothesis, ...]:
    """Return an offset of the events and one of the frames, with their size where its error is known."""
    of_events, of_frames = (explained * of_clock for of_clock in whose_offset(offset_ms, facts))
    if error_ms is None:
        return Hypothesis("time_offset", "events", of_events), Hypothesis("time_offset", "rgb", of_frames)
    return (
        Hypothesis("time_offset", "events", of_events, offset_ms, "ms", error_ms),
        # Only the difference of two clocks is measured: events too late are frames too early.
        Hypothesis("time_offset", "rgb", of_frames, -offset_ms, "ms", error_ms),
    )


def _of_rounded_frames(offset_ms: float, facts: Facts, row: str) -> tuple[Hypothesis, ...]:
    """Return rounded timestamps of the frames where their grid is coarser than an offset; none elsewhere."""
    clock = facts.clocks.get("rgb")
    if clock is None or not clock.usable:
        return ()
    times_ns = clock.times_ns[clock.advancing]
    fit = fit_regular_clock(times_ns)
    # Ticks of a timer may be no whole number of microseconds.
    grid_ns = max(0 if fit is None else fit.grid_ns, rounding_grid_ns(times_ns, resolution_ns=NS_PER_US))
    if grid_ns <= max(abs(offset_ms) * NS_PER_MS, NS_PER_MS):
        return ()
    return (Hypothesis("quantised_time", "rgb", support(f"event_response.{row}"), grid_ns / NS_PER_MS, "ms"),)


def _of_rounded_events(offset_ms: float, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return rounded timestamps of the events where different ones are farther apart than an offset; none elsewhere."""
    grid_us = 0.0 if facts.events is None else facts.events.grid_ns / NS_PER_US
    apart_ms = max(grid_us, distance_of_instants_us(facts)) * NS_PER_US / NS_PER_MS
    if apart_ms <= max(abs(offset_ms), 1.0):
        return ()
    return (Hypothesis("quantised_time", "events", support("event_response.delays_of_rounded_events"), apart_ms, "ms"),)


def _rates(estimate: ClockOffset, explained: float) -> tuple[Hypothesis, ...]:
    """Return a clock rate of the events and one of the frames, with their size."""
    # From s/s to ppm. Statistical error and bound of the model error add in squares.
    ppm, error = 1e6 * estimate.rate, 1e6 * hypot(estimate.rate_error, estimate.rate_bound)
    return (
        Hypothesis("clock_rate", "events", _EVENTS * explained, ppm, "ppm", error),
        Hypothesis("clock_rate", "rgb", _FRAMES * explained, -ppm, "ppm", error),
    )


def propose_interpolation(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return interpolation between frames: nothing else places events by the times of the frames."""
    return (Hypothesis("interpolated_frames", "events", support("event_response.lines_of_frames")),)


def propose_alignment(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm of ``event_response.alignment``, best supported first."""
    statistic, rule = alarm.statistic, alarm.finding.code.rpartition(".")[2]
    fits = {fit.model: fit for each in statistic.features if isinstance(each, CameraErrorFits) for fit in each.fits}
    cameras = _errors_of_cameras(fits)
    # Late events are shifted by the motion of the image. That of a camera that turns or nears has the field of an error
    # of a camera, and trials decide.
    others = (
        Hypothesis("time_offset", "events", _of_alignment("events_time_offset")),
        Hypothesis("time_offset", "rgb", _of_alignment("frames_time_offset")),
        Hypothesis("clock_rate", "events", _of_alignment("clock_rate")),
        Hypothesis("event_model_misdeclared", "events", _of_alignment("event_model")),
    )
    if rule in ("scale", "roll"):
        return (*cameras, *others)
    shift = only_feature(statistic.features, EventShift)
    size_px, error_px = length_with_error((shift.right_px, shift.down_px), shift.errors_px)
    # The image of frames moves the other way, in pixels of its own.
    gain = rgb_px_per_event_px(facts)
    if rule == "shift":
        # Tiles that are shifted by as much as all others are those of an image that was moved.
        of_shift = fits["shift"].explained if "shift" in fits else 1.0
        centre = Hypothesis("intrinsics_centre", "metadata", of_shift * _of_alignment("intrinsics_centre"))
        return (
            *cameras,
            Hypothesis("spatial_offset", "events", of_shift * _of_alignment("events_offset"), size_px, "px", error_px),
            Hypothesis("spatial_offset", "rgb", of_shift * _of_alignment("frames_offset"), -gain * size_px, "px",
                       gain * error_px),
            *others,
            *(hypotheses_of_centres(facts) or (centre,)),
        )  # fmt: skip
    of_frames: tuple[Hypothesis, ...] = ()
    if rule == "stretch":
        cameras = ()
        # A deviation of a region is due to events; one of a segment of time may be due to frames.
        of_frames = (
            Hypothesis("spatial_offset", "rgb", _of_alignment("part_frames_offset")),
            Hypothesis("swapped_frames", "rgb", _of_alignment("part_swapped_frames")),
            Hypothesis("frozen_frames", "rgb", _of_alignment("part_frozen_frames")),
        )
    # A tile that follows an error of a camera was not moved alone.
    rest = 1.0 - max((hypothesis.support for hypothesis in cameras), default=0.0)
    return (
        *cameras,
        Hypothesis("spatial_offset", "events", rest * _of_alignment("part_events_offset"), size_px, "px", error_px),
        *of_frames,
        Hypothesis("event_model_misdeclared", "events", _of_alignment("part_event_model")),
        Hypothesis("time_offset", "events", _of_alignment("part_events_time_offset")),
        Hypothesis("clock_rate", "events", _of_alignment("part_clock_rate")),
    )


def _errors_of_cameras(fits: Mapping[ShiftFieldModel, ShiftFieldFit]) -> tuple[Hypothesis, ...]:
    """Return a focal length and a rotation of a camera, each supported by what it explains beyond one shift."""
    focal = [fits[model] for model in FOCAL_MODELS if model in fits]
    hypotheses: list[Hypothesis] = []
    if focal:
        best = max(focal, key=lambda fit: fit.beyond_shift)
        gain = max(best.focal_gains, key=abs)
        # The focal length of the events is too large by less than 0 where their image is wider: f' = f / (1 + gain).
        percent = 100 * (1 / (1 + gain) - 1)
        of_focal = best.beyond_shift * _of_alignment("focal_length")
        hypotheses.append(Hypothesis("intrinsics_focal", "metadata", of_focal, percent, "percent"))
    if "rotation" in fits:
        rotation = fits["rotation"]
        angle_deg = signed_length(tuple(float(angle) for angle in np.rad2deg(rotation.parameters)))
        of_rotation = rotation.beyond_shift * _of_alignment("rotation")
        hypotheses.append(Hypothesis("extrinsic_rotation", "metadata", of_rotation, angle_deg, "deg"))
    return tuple(hypotheses)


def propose_frames(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm of ``event_response.frames``, best supported first."""
    (anomalies,) = (feature for feature in alarm.statistic.features if isinstance(feature, ChangeAnomalies))
    # A repeated frame causes an interval without any change; exchanged frames cause changes of the opposite sign.
    frozen = "frames.unchanged" if anomalies.unchanged else "frames.no_unchanged"
    swapped = "frames.reversed" if anomalies.reversed and not anomalies.unchanged else "frames.no_reversed"
    # Frames of another scene change from one to the next, as events do, and not with them.
    unrelated: tuple[Hypothesis, ...] = ()
    if anomalies.unrelated >= _FEWEST_UNRELATED:
        unrelated = (
            Hypothesis("other_sequence", "rgb", support("event_response.frames.unrelated_frames")),
            Hypothesis("other_sequence", "events", support("event_response.frames.unrelated_events")),
        )
    # At least one frame is wrong, as its interval caused the alarm.
    return (
        *unrelated,
        Hypothesis(
            "frozen_frames", "rgb", support(f"event_response.{frozen}"), float(max(anomalies.unchanged, 1)), "samples"
        ),
        Hypothesis(
            "swapped_frames", "rgb", support(f"event_response.{swapped}"), float(max(anomalies.reversed, 1)), "samples"
        ),
        Hypothesis("duplicated_samples", "events", support("event_response.frames.duplicated_events")),
        Hypothesis("dropped_samples", "events", support("event_response.frames.dropped_events")),
    )


def _of_alignment(row: str) -> float:
    return support(f"event_response.alignment.{row}")

"""The faults that a trial undoes for a cause: mechanisms of ``fedora_qa.faults`` with sizes from the measurements."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import copysign, inf, isclose, isfinite, log
from types import MappingProxyType
from typing import Final, Literal, get_args

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.clocks.span import StreamEnds
from fedora_qa.checks.event_response.timing import DelayedSegment
from fedora_qa.checks.flow_geometry.interval_timestamps import TimestampPattern
from fedora_qa.checks.images.order import OutOfOrderIntervals
from fedora_qa.checks.images.transfer import CodesBent
from fedora_qa.checks.index_maps.frame_to_event import WrongEntries
from fedora_qa.checks.integrity.finite import OutOfRange
from fedora_qa.conventions import FRD_FROM_FLU, MS_PER_S, NED_FROM_ENU, NS_PER_MS, NS_PER_US, SAME_AXES
from fedora_qa.diagnosis.clock_units import factors_of_span, unit_by_factor
from fedora_qa.diagnosis.clocks import contradict_timestamps, delay_of, is_right_elsewhere
from fedora_qa.diagnosis.declared_cameras import inverted_mountings, mountings_of_other_bodies
from fedora_qa.diagnosis.depth import frames_between
from fedora_qa.diagnosis.fitted_cause import Faults, FittedCause
from fedora_qa.diagnosis.flow import CAUSES_OF_TRANSFORM, fractions_of_px
from fedora_qa.diagnosis.image_parts import fewest_fields_off, part_of_images, part_of_time
from fedora_qa.diagnosis.images import is_of_a_display
from fedora_qa.diagnosis.length_units import ratio_of_units
from fedora_qa.diagnosis.measured_sizes import Results, deviation, frames_lost_before, measured, rgb_px_per_event_px
from fedora_qa.diagnosis.proposed_camera_faults import (
    fitted_vector,
    focal_length,
    mounting,
    mounting_lever_arm,
    principal_point,
)
from fedora_qa.diagnosis.proposed_motion_faults import (
    accel_bias,
    angle_unit,
    component_orders,
    displaced_positions,
    gravity_magnitude,
    gyro_bias,
    inertial_conventions,
    inverted_quaternions,
    lever_arm,
    missing_gravity,
    reversed_gravity,
    vector_axes,
)
from fedora_qa.estimators.clocks.regular_clock import (
    DisplacedSegment,
    SlewedSegment,
    clock_steps,
    displaced_part,
    slewed_part,
)
from fedora_qa.faults import (
    axes,
    clocks,
    declarations,
    flow,
    images,
    index_maps,
    motion,
    mountings,
    pixels,
    row_order,
    units,
)
from fedora_qa.faults.fault import RowRange, value_keys
from fedora_qa.faults.image_part import ImagePart
from fedora_qa.faults.table import faults_of
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.sequence.facts import Facts, StrayEvents
from fedora_qa.views.flow_axes import FLOW_AXES
from fedora_qa.views.flow_conventions import ConventionTrial

_FOLLOWS: Final = 0.98
"""Least share of a deviation that a factor for each axis removes to be tried: where it is the cause it leaves rounding,
and two factors that fit another cause would clear more of it than one."""


_ORDERS: Final = ("BGR", "RBG", "GRB", "GBR", "BRG")


_OF_PIXELS: Final = frozenset(
    {
        "spatial_offset", "mirrored", "axes_swapped", "frame_convention", "unit_mm_m", "flow_unit", "flow_sign",
        "flow_gain", "flow_interval_shifted", "intrinsics_focal", "intrinsics_centre", "extrinsic_rotation",
        "depth_ray_not_z", "invalid_encoding",
    }
)  # fmt: skip
"""Causes that alter the values of pixels, and may hold in a part of the image."""

_MOST_ORDERS: Final = 2
"""Orders of channels that are tried: those towards which the colours lie nearest."""


_UNIT_TOLERANCE: Final = 0.02
"""Largest relative difference of a fitted factor from that of a unit: units next to each other differ by more."""


_WITHIN: Final = 3.0
"""Standard errors within which a factor is that of a fit: one of a thousand is outside on either side."""


_ROUNDINGS: Final = 2
"""Largest change of the difference of two timestamps by rounding, in units of the timestamps: half a unit for each
timestamp, and the rounding of the period."""


def faults_for(
    cause: str, stream: str, magnitude: float | None, alarms: Sequence[Alarm], results: Results, facts: Facts
) -> Faults:
    """Yield the faults to undo for a cause; none where it has no inverse, or where no measurement gives the size.

    Parameters
    ----------
    cause, stream
        As in ``fedora_qa.causes``.
    magnitude
        Fitted size in the unit of the cause; None where none was fitted.
    alarms, results, facts
        As of ``FittedCause``.
    """
    if is_testable(cause, stream, magnitude):
        size = magnitude if magnitude is not None and isfinite(magnitude) else 0.0
        fit = FittedCause(cause, stream, size, alarms, results, facts)
        part = part_of_images(alarms, stream) if cause in _OF_PIXELS else None
        for fault in _PROPOSALS[cause](fit):
            # What lies beside the part agrees: a fault of the whole image is ruled out.
            yield fault if part is None else ImagePart(fault, part)


_WHOLE_PX: Final = 0.1
"""Largest distance of a fitted shift from whole pixels at which these are tried. A trial more costs little."""


_WHOLE_FRAMES: Final = 0.05
"""Largest relative difference of a fitted offset from whole frames at which these are tried. The value is not derived;
a trial more costs little."""


def is_testable(cause: str, stream: str, magnitude: float | None) -> bool:
    """Whether a cause can be undone: its fault has an inverse, and its size was fitted where it needs one."""
    sized = magnitude is not None and isfinite(magnitude) and magnitude != 0
    return cause in _PROPOSALS and bool(faults_of(cause, stream)) and (sized or cause not in _SIZED)


def _displaced_part(fit: FittedCause) -> DisplacedSegment | None:
    """Return the part of an otherwise exact clock whose timestamps were displaced; None without one."""
    clock = fit.facts.clocks.get(fit.stream)
    if clock is None or _slewed_part(fit) is not None:
        return None
    return displaced_part(clock.times_ns, resolution_ns=NS_PER_US)


def _slewed_part(fit: FittedCause) -> SlewedSegment | None:
    """Return the part in which an otherwise exact clock was slewed; None without one."""
    clock = fit.facts.clocks.get(fit.stream)
    return None if clock is None else slewed_part(clock.times_ns, resolution_ns=NS_PER_US)


def _parts_of_depth(fit: FittedCause) -> list[RowRange]:
    """Return the frames in which depth may have a fault for a while: those between the pairs of frames that deviate.

    Under noise of the poses that hides the pairs they are those at which fields of flow begin that deviate.
    """
    clock = fit.facts.clocks.get("depth")
    count = 0 if clock is None else len(clock.times_ns)
    # No pair shows whether a fault ends with the last frame, or which of two first frames has it.
    of_pairs = dict.fromkeys(part for alarm in fit.alarms if (part := frames_between(alarm)))
    parts = [(0 if first == 1 else first, None if last == count - 1 else last) for first, last in of_pairs]
    while_ns = None if parts else part_of_time(fit.alarms, "depth", fit.facts)
    if clock is not None and while_ns is not None:
        first, last = (int(np.searchsorted(clock.times_ns, time_ns)) for time_ns in while_ns)
        # No field begins at the last frame.
        parts = [(first, None if last >= count - 2 else last + 1)]
    return [part for part in parts if part != (0, None)]


def _displaced_frames(fit: FittedCause) -> list[RowRange]:
    """Return the colour frames that follow each other in the place of others."""
    runs = (feature.displaced for alarm in fit.alarms for feature in alarm.statistic.features
             if isinstance(feature, OutOfOrderIntervals))  # fmt: skip
    return list(dict.fromkeys((each.first, each.stop) for each in runs if each is not None))


def _delayed_frames(fit: FittedCause) -> Faults:
    """Yield frames that hold the values of others, where the offset is one of whole frames."""
    parts = {"depth": _parts_of_depth, "rgb": _displaced_frames}.get(fit.stream, lambda _: [])(fit)
    clock = fit.facts.clocks.get(fit.stream)
    if clock is None or not parts:
        return
    steps_ns = np.diff(clock.times_ns[clock.advancing])
    if not len(steps_ns):
        return
    period_ms = float(np.median(steps_ns)) / NS_PER_MS
    frames = round(fit.size / period_ms)
    if frames and isclose(frames * period_ms, fit.size, rel_tol=_WHOLE_FRAMES):
        for part in parts:
            yield row_order.DelayedFrames(frames, frames * period_ms, part, fit.stream)


def _exchanged_frames(fit: FittedCause) -> Faults:
    """Yield the frames at both ends of what is out of order as exchanged; then all neighbours in pairs."""
    streams = fit.facts.flow_streams if fit.stream == "flow" else (fit.stream,)
    clock = max(
        (fit.facts.clocks[s] for s in streams if s in fit.facts.clocks), key=lambda c: len(c.times_ns), default=None
    )
    if clock is None:
        return
    count, pairs = len(clock.times_ns), list[tuple[int, int]]()
    for place in (a.finding.where for a in fit.alarms if a.finding.code == "images.order.share"):
        if fit.stream == "rgb" and place.start_us is not None and place.stop_us is not None:
            first, last = (fit.facts.from_file_us(us) for us in (place.start_us, place.stop_us))
            pairs.append((int(np.searchsorted(clock.times_ns, first)), int(np.searchsorted(clock.times_ns, last))))
    while_ns = None if fit.stream in ("rgb", "flow") else part_of_time(fit.alarms, fit.stream, fit.facts)
    if while_ns is not None:
        first, last = while_ns
        pairs.append((int(np.searchsorted(clock.times_ns, first)), int(np.searchsorted(clock.times_ns, last))))
    for first, last in dict.fromkeys(pairs):
        if first < last < count:
            yield row_order.SwappedFrames(fit.stream, ((first, last),))
    # Two makers of frames that take turns, and were collected in the other order.
    yield row_order.SwappedFrames(fit.stream, tuple((row, row + 1) for row in range(0, count - 1, 2)))
    if 2 * fewest_fields_off(fit.alarms, fit.stream) > count:
        yield row_order.SwappedFrames(fit.stream, tuple((row, row + 1) for row in range(1, count - 1, 2)))


def _clock_shift(fit: FittedCause) -> Faults:
    if any(isinstance(feature, StrayEvents) for alarm in fit.alarms for feature in alarm.statistic.features):
        return  # which time single events had is unknown, and all others have theirs
    yield from _delayed_frames(fit)
    yield from _event_clock_steps(fit)
    steps = list(_clock_steps(fit))
    yield from steps
    part = None if steps else _displaced_part(fit)
    if part is not None and not part.drift and abs(part.offset_ns) > _ROUNDINGS * NS_PER_US:
        # An offset of the whole clock would displace the timestamps that are correct. One of two roundings is as well a
        # drift of the part.
        yield clocks.ClockShift(fit.stream, part.offset_ns, (part.first, part.last + 1))
    if fit.stream == "rgb":
        for frame, lost in (frames_lost_before(alarm, fit.facts) for alarm in fit.alarms):
            period_ns = float(np.median(np.diff(fit.facts.clocks["rgb"].times_ns))) if lost else 0.0
            for count in lost:
                yield clocks.ClockShift("rgb", -count * period_ns, (frame, None))
    yield from _varying_shift(fit)
    offset_ns = fit.size * NS_PER_MS
    yield clocks.ClockShift(fit.stream, offset_ns)
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    depth = fit.facts.clocks.get("depth")
    if depth is not None and any(isinstance(feature, TimestampPattern) for feature in features):
        # The offset from the nearest frame is known up to the step of the frames.
        steps_ns = np.diff(depth.times_ns[depth.advancing])
        if len(steps_ns):
            yield clocks.ClockShift(fit.stream, offset_ns - copysign(float(np.median(steps_ns)), offset_ns))


def _clock_steps(fit: FittedCause) -> Faults:
    """Yield the steps of a sampled clock: rows behind one are late, or those before it are early.

    A step of whole periods is the gap that lost samples leave. It is a step of the clock only if a finding beside the
    gap contradicts the timestamps, because nothing else contradicts those beside lost samples.
    """
    clock = fit.facts.clocks.get(fit.stream)
    if clock is None or _slewed_part(fit) is not None:
        return
    steps = clock_steps(clock.times_ns, resolution_ns=NS_PER_US)
    codes = {alarm.finding.code for alarm in fit.alarms}
    if not steps or ("clocks.gaps.jump" not in codes and not contradict_timestamps(codes, fit.family)):
        return
    first, *others = steps
    if not others:
        yield clocks.ClockShift(fit.stream, first.offset_ns, (first.row, None))
        yield clocks.ClockShift(fit.stream, -first.offset_ns, (0, first.row))
    elif abs(first.offset_ns + others[0].offset_ns) <= 2 * _ROUNDINGS * NS_PER_US:
        # Set, and set back.
        yield clocks.ClockShift(fit.stream, first.offset_ns, (first.row, others[0].row))


def _event_clock_steps(fit: FittedCause) -> Faults:
    """Yield the steps of the clock of the events: by an interval without events, then as the delay over time has them.

    Lost events leave such an interval as well, and no delay.
    """
    codes = {alarm.finding.code for alarm in fit.alarms}
    if fit.stream != "events" or not contradict_timestamps(codes, "events"):
        return
    for alarm in fit.alarms:
        place = alarm.finding.where
        if alarm.finding.code == "event_stream.gaps.silence" and None not in (place.start_us, place.stop_us):
            last_ns, next_ns = (fit.facts.from_file_us(us or 0.0) for us in (place.start_us, place.stop_us))
            length_ns = round(alarm.statistic.value * NS_PER_MS)
            # Events behind are late, so that the next one belongs where the silence began; or those before are early.
            yield clocks.ClockShift("events", length_ns, while_ns=(next_ns - length_ns, None))
            yield clocks.ClockShift("events", -length_ns, while_ns=(None, last_ns + length_ns + 1))
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    for part in dict.fromkeys(feature for feature in features if isinstance(feature, DelayedSegment)):
        yield clocks.ClockShift("events", part.offset_ms * NS_PER_MS, while_ns=(part.begin_ns, part.end_ns))


def _varying_shift(fit: FittedCause) -> Faults:
    """Yield the regular clock of a stream whose timestamps are late by times of their own, as those of a recorder."""
    if (delay := delay_of(fit.stream, fit.facts)) is not None:
        yield clocks.ClockShift(fit.stream, delay.offset_ns, regular_ns=(delay.start_ns, delay.period_ns))


def _clock_rate(fit: FittedCause) -> Faults:
    slewed = _slewed_part(fit)
    if slewed is not None:
        # Undone in the whole file, the rate would displace the timestamps before and after.
        yield clocks.ClockRate(fit.stream, 1e6 * slewed.drift, slewed.start_ns, duration_ns=slewed.duration_ns)
    part = _displaced_part(fit)
    if part is not None and part.drift:
        times_ns = fit.facts.clocks[fit.stream].times_ns
        # The clock leaves its line before rounding shows it: where the line through the offsets of the part is 0.
        beginning_ns = times_ns[(part.first + part.last) // 2] - part.offset_ns / part.drift
        start_ns = round(float(np.clip(beginning_ns, times_ns[0], times_ns[part.first])))
        rows = int(np.searchsorted(times_ns[: part.first], start_ns)), part.last + 1
        yield clocks.ClockRate(fit.stream, 1e6 * part.drift, start_ns, rows)
    clock = fit.facts.clocks.get(fit.stream)
    first_ns = last_ns = 0
    if fit.stream == "events" and fit.facts.events is not None:
        first_ns, last_ns = fit.facts.events.first_ns, fit.facts.events.last_ns
    elif clock is not None and len(clock.times_ns):
        first_ns, last_ns = int(clock.times_ns[0]), int(clock.times_ns[-1])
    # A clock is set at its first timestamp, or its mean error is taken out.
    yield clocks.ClockRate(fit.stream, fit.size, first_ns)
    yield clocks.ClockRate(fit.stream, fit.size, (first_ns + last_ns) // 2)


def _time_units(fit: FittedCause) -> Faults:
    factors: dict[float, clocks.TimeUnit] = {}
    for alarm in fit.alarms:
        stream = alarm.finding.where.stream or ""
        for ends in (feature for feature in alarm.statistic.features if isinstance(feature, StreamEnds)):
            if stream in (fit.stream, *fit.facts.flow_streams) and stream_family(stream) == fit.family:
                for factor in factors_of_span(stream, ends, fit.facts):
                    own = unit_by_factor(stream, factor, ends, fit.facts)
                    factors.setdefault(factor, own if stream == fit.stream else clocks.TimeUnit(fit.stream, factor))
    yield factors.pop(fit.size, clocks.TimeUnit(fit.stream, fit.size))
    yield from factors.values()


def _index_shift(fit: FittedCause) -> Faults:
    if events := round(fit.size):
        of_map = [alarm for alarm in fit.alarms if alarm.finding.where.stream == fit.stream]
        for entries in (feature for alarm in of_map for feature in alarm.statistic.features):
            # Where all maps are wrong alike, the events were changed behind them.
            if (
                isinstance(entries, WrongEntries)
                and entries.begins_within
                and is_right_elsewhere(fit.stream, entries, fit.facts)
            ):
                yield index_maps.IndexShift(fit.stream, events, entries.rows)
        yield index_maps.IndexShift(fit.stream, events)


def _exchanged_axes(fit: FittedCause) -> Faults:
    if fit.family in ("events", "flow"):
        yield pixels.SwappedPixelAxes(fit.stream)
    elif fit.stream == "metadata":
        yield axes.RectificationAxes()
        yield axes.RectificationAxes("pixels")
    else:
        yield from vector_axes(fit)


def _other_axes(fit: FittedCause) -> Faults:
    if fit.family == "flow":
        yield from _axes_of_flow(fit)
    elif fit.stream == "metadata":
        yield from inverted_mountings(fit.facts)
        yield from mountings_of_other_bodies(fit.facts)
        yield mountings.CameraAxes()
        yield mountings.InvertedMounting()
    else:
        yield from vector_axes(fit)
        # What the IMU states of the whole file leaves no other convention of attitudes.
        if fit.stream == "pose" and not any(rows is None for _, rows in inertial_conventions(fit)):
            yield motion.AngleOrder()
            yield motion.AngleOrder(were_taken_so=True)
            yield axes.VectorAxes(fit.stream, NED_FROM_ENU, FRD_FROM_FLU)
            yield axes.VectorAxes(fit.stream, NED_FROM_ENU)
            yield axes.VectorAxes(fit.stream, SAME_AXES, FRD_FROM_FLU)


def _axes_of_flow(fit: FittedCause) -> Faults:
    """Yield the conventions of u and v, of which one transform removes most of a field first."""
    removed = dict.fromkeys((name for name in FLOW_AXES if CAUSES_OF_TRANSFORM[name] == ("frame_convention",)), 0.0)
    for feature in (feature for alarm in fit.alarms for feature in alarm.statistic.features):
        if isinstance(feature, ConventionTrial):
            # Of two conventions at once the transform of the vectors is one.
            name = feature.transform.removesuffix("_in_another_unit")
            if name in removed:
                removed[name] = max(removed[name], feature.removed_share)
    for name in sorted(removed, key=lambda name: -removed[name]):
        # The transform leads from the stored vectors to the correct ones: those are written by its transpose.
        (u_of_u, u_of_v), (v_of_u, v_of_v) = FLOW_AXES[name].matrix.T.tolist()
        yield axes.VectorAxes(fit.stream, ((u_of_u, u_of_v, 0.0), (v_of_u, v_of_v, 0.0), (0.0, 0.0, 1.0)))


def _mirroring(fit: FittedCause) -> Faults:
    yield pixels.Mirroring(fit.stream, "horizontal")
    yield pixels.Mirroring(fit.stream, "vertical")
    yield pixels.Mirroring(fit.stream, "both")


def _pixel_shift(fit: FittedCause) -> Faults:
    if shift_px := fitted_vector(fit):
        whole_px = tuple(map(round, shift_px))
        # A shift by whole pixels is undone without a loss, which resampling never is.
        if any(whole_px) and all(isclose(c, w, abs_tol=_WHOLE_PX) for c, w in zip(shift_px, whole_px, strict=True)):
            yield pixels.PixelShift(fit.stream, *whole_px)
        yield pixels.PixelShift(fit.stream, *shift_px)
        return
    sizes = [fit.facts.layout.bindings[key].shape[1:3] for key in value_keys(fit.facts, fit.stream)]
    # Images that are shifted further share too little: findings vanish with the pixels that had them.
    within_px = max((max(size) for size in sizes if len(size) > 1), default=inf) / 2
    for shift in _measured_shifts(fit):
        if max(abs(shift.columns_px), abs(shift.rows_px)) <= within_px:
            yield shift


def _measured_shifts(fit: FittedCause) -> Iterator[pixels.PixelShift]:
    checks = {"events": "event_response.alignment", "rgb": "event_response.alignment", "depth": "alignment.depth"}
    result = fit.results.get(checks.get(fit.family, ""))
    # Alignment measures the shift of events against the colour frames, and that of the colour frames against depth.
    gain = {"rgb": -rgb_px_per_event_px(fit.facts), "depth": -1.0}.get(fit.family, 1.0)
    right_px, down_px = (gain * deviation(result, f"shift_{way}") for way in ("right", "down"))
    right, down, along = round(right_px), round(down_px), round(fit.size)
    # A component within its limit may be that of an axis along which few edges lie.
    beyond_right, beyond_down = (
        round(gain * deviation(result, f"shift_{way}", beyond_limit=True)) for way in ("right", "down")
    )
    # A shift larger than what the check searches saturates: the fitted size is tried too, along either axis.
    for columns, rows in dict.fromkeys(((beyond_right, beyond_down), (right, down), (along, 0), (0, along))):
        if columns or rows:
            yield pixels.PixelShift(fit.stream, columns, rows)
    if fit.stream == "rgb" and max(abs(right_px - right), abs(down_px - down)) > _WHOLE_PX:
        yield pixels.PixelShift(fit.stream, right_px, down_px)


def _lever_arm(fit: FittedCause) -> Faults:
    yield from mounting_lever_arm(fit) if fit.stream == "metadata" else lever_arm(fit)


def _thresholds(fit: FittedCause) -> Faults:
    result = fit.results.get("event_response.threshold")
    # Measured: 100 (fitted / declared - 1). The cause: declared over true, less 1.
    ratios = [1 + deviation(result, f"threshold_{sign}") / 100 for sign in ("on", "off")]
    if min(ratios) <= 0:
        return  # no threshold has that sign
    on, off = (100 * (1 / ratio - 1) for ratio in ratios)
    if on or off:
        yield declarations.ThresholdMisdeclared(on, off)


def _length_unit(fit: FittedCause) -> Faults:
    if fit.stream not in ("depth", "pose"):
        return
    stream: Literal["depth", "pose"] = "depth" if fit.stream == "depth" else "pose"
    exact = ratio_of_units(fit.size)
    if exact is None:
        # No unit: a scale, which is one of all lengths. All pairs of frames measure it better than one field of flow.
        measured_factor = _factor_within_range(fit.results) if stream == "depth" else None
        yield units.LengthUnit(stream, measured_factor or fit.size)
        return
    # The ratio is exact, and its fit is not: depths that end at the declared range would leave it by the error.
    for factor in dict.fromkeys((exact, fit.size)):
        for feature in (feature for alarm in fit.alarms for feature in alarm.statistic.features):
            if stream == "depth" and isinstance(feature, OutOfRange) and feature.rescaled_rows is not None:
                # Divided in the whole file, correct frames would be in the other unit.
                yield units.LengthUnit(stream, factor, feature.rescaled_rows)
        if stream == "depth":
            for part in _parts_of_depth(fit):
                yield units.LengthUnit(stream, factor, part)
        yield units.LengthUnit(stream, factor)


def _factor_within_range(results: Results) -> float | None:
    """Return the factor of all depths that ``depth.scale`` measures; None where it measures none.

    Of the factors within the error of the fit it is the nearest one with which the depths lie in the declared range.
    """
    scale = measured(results.get("depth.scale"), "scale")
    if scale is None or scale.value is None or scale.value <= 0 or not scale.exceeds_limit:
        return None
    nearest, farthest = (measured(results.get("depth.range"), end) for end in ("nearest", "farthest"))
    factor = scale.value
    # low <= stored depth / factor <= high
    if nearest is not None and nearest.value is not None and nearest.expected:
        factor = min(factor, nearest.value / nearest.expected)
    if farthest is not None and farthest.value is not None and farthest.expected:
        factor = max(factor, farthest.value / farthest.expected)
    error = _WITHIN * (scale.standard_error or 0.0)
    return factor if abs(factor - scale.value) <= error else scale.value


def _flow_units(fit: FittedCause) -> Faults:
    if any(abs(fit.size * MS_PER_S / flow_rate_hz(rate) - 1) < _UNIT_TOLERANCE for rate in fit.facts.flow_streams):
        yield units.FlowUnit(fit.stream, "px/ms")
    if fit.size > 1:
        if fractions := fractions_of_px(fit.size, _UNIT_TOLERANCE):
            yield units.FlowUnit(fit.stream, "fractions", fractions)
        yield units.FlowUnit(fit.stream, "px/s")
        return
    period_s = units.frame_period_s(fit.facts)
    # The size is the period of the frames over the length of an interval, or the length itself.
    per_frame = any(abs(fit.size / (period_s * flow_rate_hz(rate)) - 1) < _UNIT_TOLERANCE
                    for rate in fit.facts.flow_streams if period_s)  # fmt: skip

    def ratio(unit: units.FlowUnitName) -> float:
        """Return how many times the size is that of a unit of length, or the reverse."""
        length_px = units.length_of_flow_px(fit.facts, unit)
        return abs(log(fit.size * length_px[0])) if length_px and fit.size > 0 else inf

    lengths = sorted(units.LENGTHS, key=ratio)
    if per_frame:
        yield units.FlowUnit(fit.stream, "px per frame")
    of_length = ratio(lengths[0]) < _UNIT_TOLERANCE
    smaller: tuple[units.FlowUnitName, ...] = (*lengths, "px s") if of_length else ("px s", *lengths)
    for unit in smaller:
        yield units.FlowUnit(fit.stream, unit)


def _flow_gain(fit: FittedCause) -> Faults:
    by_axis = [
        feature
        for alarm in fit.alarms
        for feature in alarm.statistic.features
        if isinstance(feature, ConventionTrial) and feature.transform == "scaled_by_axis"
    ]
    # Of all fields that were tried the one that follows the factors most closely states them.
    best = max(by_axis, key=lambda trial: trial.removed_share, default=None)
    if best is not None and best.removed_share > _FOLLOWS:
        u_percent, v_percent = best.components
        yield units.FlowGain(fit.stream, u_percent, v_percent=v_percent)
    yield units.FlowGain(fit.stream, fit.size)


def _flow_interval(fit: FittedCause) -> Faults:
    while_ns = part_of_time(fit.alarms, fit.stream, fit.facts)
    is_of_part = while_ns is not None or part_of_images(fit.alarms, fit.stream) is not None
    for intervals in (round(fit.size),) if round(fit.size) else (1, -1):
        # Of a part, findings vanish with the values that are lost at its end: most values must be left. Two fields of
        # one rate alone, each of which follows the motion of the other, are exchanged.
        fewest = 2 * abs(intervals) + (fit.stream != "flow")
        if is_of_part and fewest_fields_off(fit.alarms, fit.stream) < fewest:
            continue
        if while_ns is not None:
            yield flow.FlowIntervalShift(fit.stream, intervals, while_ns)
        yield flow.FlowIntervalShift(fit.stream, intervals)


def _rays(fit: FittedCause) -> Faults:
    """Yield the exponent of the sign that is measured first: -1 where z was divided by the length of the ray."""
    inverse = deviation(fit.results.get("depth.projection"), "ray_exponent") < 0
    for part in _parts_of_depth(fit):
        yield images.RayLength(-1.0 if inverse else 1.0, part)
    yield images.RayLength(-1.0 if inverse else 1.0)
    yield images.RayLength(1.0 if inverse else -1.0)


def _channel_order(fit: FittedCause) -> Faults:
    result = fit.results.get("images.channels")
    nearest = sorted(_ORDERS, key=lambda order: -deviation(result, f"towards_{order}"))
    for order in nearest[:_MOST_ORDERS]:
        yield images.ChannelOrder(order)


def _curves(fit: FittedCause) -> Faults:
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    for bent in (feature for feature in features if isinstance(feature, CodesBent)):
        yield images.PowerCurve(bent.exponent)
    measurements = (measured(fit.results.get("images.transfer"), name)
                    for name in ("exponent", "exponent_at_declared_thresholds"))  # fmt: skip
    fitted = [each for each in measurements if each is not None and each.value is not None and each.value > 0]
    # A curve of a display has no number to fit: where the exponent may be its own it comes first. Codes that get darker
    # are displayed ones that are not declared so; those that get brighter were decoded once too often.
    declared = fit.facts.declared.transfer
    displays = [transfer for transfer in get_args(images.Transfer) if transfer != "linear"]
    misdeclared = [images.TransferMisdeclared(actual, declared) for actual in get_args(images.Transfer)
                   if actual != declared]  # fmt: skip
    powers = [images.PowerCurve(1.0 / each.value) for each in fitted if each.value]
    if any(each.value < 1 and is_of_a_display(each.value, each.limit or 0.0) for each in fitted if each.value):
        yield from (images.DecodedTwice(transfer) for transfer in displays)
    yield from powers
    yield from misdeclared


_PROPOSALS: Final[Mapping[str, Callable[[FittedCause], Faults]]] = MappingProxyType(
    {
        "time_offset": _clock_shift,
        "clock_rate": _clock_rate,
        "time_unit": _time_units,
        "duplicated_samples": lambda fit: iter([row_order.DuplicatedSamples(fit.stream)]),
        "swapped_frames": _exchanged_frames,
        "unsorted": lambda fit: iter([row_order.Unsorted(fit.stream, 0, 0)]),
        "index_off_by_one": _index_shift,
        "index_side": lambda fit: iter([index_maps.IndexSide(fit.stream)]),
        "polarity_inverted": lambda _: iter([pixels.PolarityInversion()]),
        "axes_swapped": _exchanged_axes,
        "frame_convention": _other_axes,
        "mirrored": _mirroring,
        "spatial_offset": _pixel_shift,
        "threshold_misdeclared": _thresholds,
        "event_model_misdeclared": lambda _: iter([declarations.EventModelMisdeclared()]),
        "unit_mm_m": _length_unit,
        "unit_deg_rad": angle_unit,
        "flow_unit": _flow_units,
        "flow_sign": lambda fit: iter([units.FlowSign(fit.stream)]),
        "flow_gain": _flow_gain,
        "flow_interval_shifted": _flow_interval,
        "intrinsics_focal": focal_length,
        "intrinsics_centre": principal_point,
        "extrinsic_rotation": mounting,
        "quaternion_inverted": inverted_quaternions,
        "quaternion_order": component_orders,
        "quaternion_not_unit": lambda fit: iter([motion.QuaternionLength(fit.size)]),
        "gravity_missing": missing_gravity,
        "gravity_sign": reversed_gravity,
        "gravity_magnitude": gravity_magnitude,
        "gyro_bias": gyro_bias,
        "accel_bias": accel_bias,
        "teleport": displaced_positions,
        "lever_arm": _lever_arm,
        "channel_order": _channel_order,
        "exposure_or_gamma": _curves,
        "vignetting": lambda fit: iter([images.Vignetting(fit.size)]),
        "depth_ray_not_z": _rays,
        "invalid_encoding": lambda fit: iter([images.InvalidCode(fit.stream)]),
    }
)
"""Faults to undo, by cause; causes that are absent have no inverse, or need rows that no check states."""


_SIZED: Final = frozenset(
    {"time_offset", "clock_rate", "time_unit", "unit_mm_m", "unit_deg_rad", "flow_unit", "flow_gain",
     "intrinsics_focal", "intrinsics_centre", "extrinsic_rotation", "quaternion_not_unit", "gravity_magnitude",
     "vignetting"}
)  # fmt: skip
"""Causes that are undone with the fitted size only."""

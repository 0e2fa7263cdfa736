"""The faults that a trial undoes for a cause: mechanisms of ``fedora_qa.faults`` with sizes from the measurements."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import copysign, hypot, inf, isclose, isfinite, isinf, log
from types import MappingProxyType
from typing import Any, Final, get_args

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.event_response.alignment import CameraErrorFits
from fedora_qa.checks.flow_geometry.interval_timestamps import TimestampPattern
from fedora_qa.checks.images.transfer import CodesBent
from fedora_qa.checks.index_maps.frame_to_event import WrongEntries
from fedora_qa.checks.integrity.finite import OutOfRange
from fedora_qa.checks.pose.continuity import DisplacedPositions
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.diagnosis.clocks import is_right_elsewhere
from fedora_qa.diagnosis.declared_cameras import (
    film_focal_lengths,
    mounting_units,
    odd_centres,
    odd_mounting,
    opposite_focal_lengths,
    other_sizes,
    other_views,
    transposed,
)
from fedora_qa.diagnosis.depth import frames_between
from fedora_qa.diagnosis.flow import fractions_of_px
from fedora_qa.diagnosis.imu import HALF_TURN
from fedora_qa.diagnosis.measured_sizes import (
    Results,
    deviation,
    flow_vector,
    frames_lost_before,
    measured,
    rgb_px_per_event_px,
    vector,
)
from fedora_qa.estimators.clocks.regular_clock import DisplacedSegment, SlewedSegment, displaced_part, slewed_part
from fedora_qa.estimators.events.shift_field import FOCAL_MODELS, ROTATION_MODELS, ShiftFieldFit, ShiftFieldModel
from fedora_qa.estimators.imu.conventions import InertialConvention, signed_permutations
from fedora_qa.faults import (
    axes,
    cameras,
    clocks,
    declarations,
    flow,
    images,
    index_maps,
    motion,
    pixels,
    row_order,
    units,
)
from fedora_qa.faults.fault import Matrix3, ReversibleFault, RowRange, Vector3
from fedora_qa.faults.table import faults_of
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_comparison import FlowParameterFit
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.inertial_agreement import BiasOfPart, DriftingBias, InertialConventionTrial, MotionKind
from fedora_qa.views.sample_defects import LoneSamples

Faults = Iterator[ReversibleFault]

_FOLLOWS: Final = 0.98
"""Least share of a deviation that a factor for each axis removes to be tried: where it is the cause it leaves rounding,
and two factors that fit another cause would clear more of it than one."""

_ORDERS: Final = ("BGR", "RBG", "GRB", "GBR", "BRG")
_MOST_ORDERS: Final = 2
"""Orders of channels that are tried: those towards which the colours lie nearest."""

_LENGTH_UNITS: Final = (10.0, 100.0, 1000.0, 0.3048, 0.9144, 1609.344, 1852.0)
"""Ratios of units of length that occur."""

_UNIT_TOLERANCE: Final = 0.02
"""Largest relative difference of a fitted factor from that of a unit: units next to each other differ by more."""

_ROUNDINGS: Final = 2
"""Largest change of the difference of two timestamps by rounding, in units of the timestamps: half a unit for each
timestamp, and the rounding of the period."""

_NED_FROM_ENU: Final[Matrix3] = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
_FRD_FROM_FLU: Final[Matrix3] = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
_LEFT: Final[Matrix3] = ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_UPWARDS: Final[Matrix3] = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
_SAME: Final[Matrix3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class FittedCause:
    """A cause in a stream with its fitted size, and what else was measured of the file.

    Attributes
    ----------
    cause, stream
        As in ``fedora_qa.causes``.
    size
        In the unit of the cause; 0 where none was fitted.
    alarms
        Of the file, with the features of their statistics.
    results
        Of the file, by check: their measurements give components of vectors that exceed no limit.
    facts
        Of the file.
    """

    cause: str
    stream: str
    size: float
    alarms: Sequence[Alarm]
    results: Results
    facts: Facts

    @property
    def family(self) -> str:
        """The stream; ``flow`` for every rate."""
        return stream_family(self.stream)


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
        yield from _PROPOSALS[cause](FittedCause(cause, stream, size, alarms, results, facts))


_SATURATES: Final = 1.5
"""Least ratio of a fitted size to the length of a measured vector for the vector not to be a measurement of it: a shift
of 1 px may be fitted as 1.5 px. The value is not derived."""


_WHOLE_PX: Final = 0.1
"""Largest distance of a fitted shift from whole pixels at which these are tried. A trial more costs little."""


_WHOLE_FRAMES: Final = 0.05
"""Largest relative difference of a fitted offset from whole frames at which these are tried. The value is not derived;
a trial more costs little."""


def is_testable(cause: str, stream: str, magnitude: float | None) -> bool:
    """Whether a cause can be undone: its fault has an inverse, and its size was fitted where it needs one."""
    sized = magnitude is not None and isfinite(magnitude) and magnitude != 0
    return cause in _PROPOSALS and bool(faults_of(cause, stream)) and (sized or cause not in _SIZED)


def is_length_unit(factor: float) -> bool:
    """Whether a factor is the ratio of two units of length."""
    ratios = (ratio for unit in _LENGTH_UNITS for ratio in (unit, 1 / unit))
    return any(abs(factor / ratio - 1) <= _UNIT_TOLERANCE for ratio in ratios)


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
    """Return the frames in which depth may have a fault for a while: those between the pairs of frames that deviate."""
    parts = dict.fromkeys(part for alarm in fit.alarms if (part := frames_between(alarm)))
    count = len(fit.facts.clocks["depth"].times_ns) if "depth" in fit.facts.clocks else 0
    # No pair shows whether a fault ends with the last frame, or which of two first frames has it.
    ends = [(0 if first == 1 else first, None if last == count - 1 else last) for first, last in parts]
    return [part for part in ends if part != (0, None)]


def _delayed_frames(fit: FittedCause) -> Faults:
    """Yield depth frames that hold the values of others, where the offset is one of whole frames."""
    depth = fit.facts.clocks.get("depth")
    steps_ns = np.diff(depth.times_ns[depth.advancing]) if depth is not None else np.zeros(0)
    if fit.stream != "depth" or not len(steps_ns):
        return
    period_ms = float(np.median(steps_ns)) / NS_PER_MS
    frames = round(fit.size / period_ms)
    if frames and isclose(frames * period_ms, fit.size, rel_tol=_WHOLE_FRAMES):
        for part in _parts_of_depth(fit):
            yield row_order.DelayedFrames(frames, frames * period_ms, part)


def _clock_shift(fit: FittedCause) -> Faults:
    yield from _delayed_frames(fit)
    part = _displaced_part(fit)
    if part is not None and not part.drift and abs(part.offset_ns) > _ROUNDINGS * NS_PER_US:
        # An offset of the whole clock would displace the timestamps that are correct. One of two roundings is as well a
        # drift of the part.
        yield clocks.ClockShift(fit.stream, part.offset_ns, (part.first, part.last + 1))
    if fit.stream == "rgb":
        for frame, lost in (frames_lost_before(alarm, fit.facts) for alarm in fit.alarms):
            period_ns = float(np.median(np.diff(fit.facts.clocks["rgb"].times_ns))) if lost else 0.0
            for count in lost:
                yield clocks.ClockShift("rgb", -count * period_ns, (frame, None))
    offset_ns = fit.size * NS_PER_MS
    yield clocks.ClockShift(fit.stream, offset_ns)
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    depth = fit.facts.clocks.get("depth")
    if depth is not None and any(isinstance(feature, TimestampPattern) for feature in features):
        # The offset from the nearest frame is known up to the step of the frames.
        steps_ns = np.diff(depth.times_ns[depth.advancing])
        if len(steps_ns):
            yield clocks.ClockShift(fit.stream, offset_ns - copysign(float(np.median(steps_ns)), offset_ns))


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
        yield from _vector_axes(fit)


def _other_axes(fit: FittedCause) -> Faults:
    if fit.family == "flow":
        yield axes.VectorAxes(fit.stream, _UPWARDS)
        yield axes.VectorAxes(fit.stream, _LEFT)
    elif fit.stream == "metadata":
        yield axes.CameraAxes()
    else:
        yield from _vector_axes(fit)
        # What the IMU states of the whole file leaves no other convention of attitudes.
        if fit.stream == "pose" and not any(rows is None for _, rows in _inertial_conventions(fit)):
            yield motion.AngleOrder()
            yield axes.VectorAxes(fit.stream, _NED_FROM_ENU, _FRD_FROM_FLU)
            yield axes.VectorAxes(fit.stream, _NED_FROM_ENU)
            yield axes.VectorAxes(fit.stream, _SAME, _FRD_FROM_FLU)


def _vector_axes(fit: FittedCause) -> Faults:
    cause: Any = fit.cause
    of_vertical = [feature.convention for feature, _ in _inertial_conventions(fit) if feature.kind == "translation"]
    for feature, rows in _inertial_conventions(fit):
        convention = feature.convention
        if fit.stream == "pose" and feature.kind == "rotation" and any(map(convention.turns_as, of_vertical)):
            # Rates state neither the handedness of the axes nor the vertical, which specific forces have stated.
            continue
        sensor, world = _matrix(convention.sensor_axes), _matrix(convention.world_axes)
        if any(sign < 0 for sign in convention.angle_signs):
            if fit.stream == "pose":
                yield motion.AngleSense(convention.angle_signs, world)
        elif fit.stream == "imu":
            yield axes.VectorAxes(fit.stream, sensor, cause=cause, rows=rows)
        else:
            # The IMU measures P v for v in the body of the poses: R' = R P, so that the axes of the body are P^T.
            body = _matrix(tuple(zip(*sensor, strict=True)))
            if world != _SAME:
                # Of positions alone.
                yield axes.VectorAxes(fit.stream, world, body, cause=cause, rows=rows)
                yield axes.VectorAxes(fit.stream, world, turns_orientations=False, cause=cause, rows=rows)
            elif (with_vertical := (_world_of(convention, body), body)) != (_SAME, _SAME):
                yield axes.VectorAxes(fit.stream, *with_vertical, cause=cause, rows=rows)


def _world_of(convention: InertialConvention, body: Matrix3) -> Matrix3:
    """Return axes of the world with the vertical of a convention, of the handedness of the axes of the body.

    Which of its horizontal axes points north has no influence on what the streams measure.
    """
    up = np.array(convention.up) * (-1 if convention.gravity == "reversed" else 1)
    right_handed = np.linalg.det(body) > 0
    worlds = (_matrix(candidate) for candidate in signed_permutations())
    possible = [
        world
        for world in worlds
        if np.array_equal(np.array(world)[:, 2], up) and (np.linalg.det(world) > 0) == right_handed
    ]
    # Of four the one nearest to the axes of the format.
    return max(possible, key=lambda world: float(np.trace(world)))


def _inertial_conventions(fit: FittedCause) -> Iterator[tuple[InertialConventionTrial, RowRange | None]]:
    """Yield the conventions under which IMU and poses agree, with the rows of the part in which they do."""
    # Specific forces determine the axes of the world as well, and the handedness: the vertical is theirs.
    for alarm in sorted(fit.alarms, key=lambda alarm: alarm.finding.code.startswith("imu.rotation")):
        where = alarm.finding.where
        for feature in alarm.statistic.features:
            if not isinstance(feature, InertialConventionTrial):
                continue
            if feature.interval_s is None or where.start_us is None or where.stop_us is None:
                yield feature, None
                continue
            # Values outside of the place of the finding follow the declared convention.
            ends_ns = [NS_PER_US * (end_us - fit.facts.origin_us) for end_us in (where.start_us, where.stop_us)]
            first, last = np.searchsorted(fit.facts.clocks[fit.stream].times_ns, ends_ns)
            yield feature, (int(first), int(last))


def _angle_unit(fit: FittedCause) -> Faults:
    for feature, rows in _inertial_conventions(fit):
        if rows is not None and feature.convention.rate_unit != 1.0:
            yield units.AngleUnit(feature.convention.rate_unit, rows)
    yield units.AngleUnit(fit.size)


def _component_orders(fit: FittedCause) -> Faults:
    """Yield w first, and before it the order of components that were put first twice where rates have its axes."""
    if any(each.convention.sensor_axes == HALF_TURN for each, rows in _inertial_conventions(fit) if rows is None):
        yield motion.QuaternionOrder((2, 3, 0, 1))
    yield motion.QuaternionOrder()


def _matrix(rows: Sequence[Sequence[float]]) -> Matrix3:
    first, second, third = ((float(x), float(y), float(z)) for x, y, z in rows)
    return first, second, third


def _mirroring(fit: FittedCause) -> Faults:
    yield pixels.Mirroring(fit.stream, "horizontal")
    yield pixels.Mirroring(fit.stream, "vertical")
    yield pixels.Mirroring(fit.stream, "both")


def _pixel_shift(fit: FittedCause) -> Faults:
    if shift_px := _fitted_vector(fit):
        whole_px = tuple(map(round, shift_px))
        # A shift by whole pixels is undone without a loss, which resampling never is.
        if any(whole_px) and all(isclose(c, w, abs_tol=_WHOLE_PX) for c, w in zip(shift_px, whole_px, strict=True)):
            yield pixels.PixelShift(fit.stream, *whole_px)
        yield pixels.PixelShift(fit.stream, *shift_px)
        return
    checks = {"events": "event_response.alignment", "rgb": "event_response.alignment", "depth": "alignment.depth"}
    result = fit.results.get(checks.get(fit.family, ""))
    # Alignment measures the shift of events, or of the depth camera, against the colour frames.
    gain = -rgb_px_per_event_px(fit.facts) if fit.stream == "rgb" else 1.0
    right_px, down_px = (gain * deviation(result, f"shift_{way}") for way in ("right", "down"))
    right, down, along = round(right_px), round(down_px), round(fit.size)
    # A shift larger than what the check searches saturates: the fitted size is tried too, along either axis.
    for columns, rows in dict.fromkeys(((right, down), (along, 0), (0, along))):
        if columns or rows:
            yield pixels.PixelShift(fit.stream, columns, rows)
    if fit.stream == "rgb" and max(abs(right_px - right), abs(down_px - down)) > _WHOLE_PX:
        yield pixels.PixelShift(fit.stream, right_px, down_px)


def _thresholds(fit: FittedCause) -> Faults:
    result = fit.results.get("event_response.threshold")
    # Measured: 100 (fitted / declared - 1). The cause: declared over true, less 1.
    on, off = (100 * (1 / (1 + deviation(result, f"threshold_{sign}") / 100) - 1) for sign in ("on", "off"))
    if on or off:
        yield declarations.ThresholdMisdeclared(on, off)


def _length_unit(fit: FittedCause) -> Faults:
    if fit.stream in ("depth", "pose") and is_length_unit(fit.size):
        for feature in (feature for alarm in fit.alarms for feature in alarm.statistic.features):
            if fit.stream == "depth" and isinstance(feature, OutOfRange) and feature.rescaled_rows is not None:
                # Divided in the whole file, correct frames would be in the other unit.
                yield units.LengthUnit("depth", fit.size, feature.rescaled_rows)
        if fit.stream == "depth":
            for part in _parts_of_depth(fit):
                yield units.LengthUnit("depth", fit.size, part)
        yield units.LengthUnit("depth" if fit.stream == "depth" else "pose", fit.size)


def _flow_units(fit: FittedCause) -> Faults:
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
    for intervals in (round(fit.size),) if round(fit.size) else (1, -1):
        yield flow.FlowIntervalShift(fit.stream, intervals)


def _suspected_cameras(fit: FittedCause) -> Sequence[str | None]:
    """Return the declared cameras that may be wrong, most suspected first; None stands for all of them.

    Depth, its flow and the poses agree where the depth camera is declared correctly, and colour and events agree where
    the other two are: which of the two holds states which camera is odd.
    """
    if fit.stream != "metadata":
        return (None,)
    subjects = {alarm.finding.code.split(".")[0] for alarm in fit.alarms}
    depth_agrees = not subjects & {"flow_geometry", "depth"}
    others_agree = "event_response" not in subjects
    if depth_agrees:
        return tuple(camera for camera in fit.facts.declared.cameras if camera != "depth")
    return ("depth", None) if others_agree else (None, *fit.facts.declared.cameras)


def _camera_errors(fit: FittedCause, models: Collection[ShiftFieldModel]) -> Iterator[ShiftFieldFit]:
    """Yield the errors of a camera that the shifts of events follow, those that explain most first."""
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    fits = {each: None for feature in features if isinstance(feature, CameraErrorFits) for each in feature.fits}
    if fit.stream == "metadata":
        yield from sorted((each for each in fits if each.model in models), key=lambda each: -each.beyond_shift)


def _focal_length(fit: FittedCause) -> Faults:
    if fit.stream == "metadata":
        yield from opposite_focal_lengths(fit.facts)
        yield from film_focal_lengths(fit.facts)
        yield from other_sizes(fit.facts)
        yield from other_views(fit.facts)
    for best in islice(_camera_errors(fit, FOCAL_MODELS), 1):
        # Events whose image is wider by k: f' = f / (1 + k) of the event camera, or f' = f (1 + k) of that of colour.
        wider = [1 + gain for gain in best.focal_gains]
        for name, along in (("events", [1 / gain for gain in wider]), ("rgb", wider)):
            columns_percent, rows_percent = (100 * (factor - 1) for factor in along)
            yield cameras.FocalLength("metadata", columns_percent, name, rows_percent)
    for camera in _suspected_cameras(fit):
        yield cameras.FocalLength(fit.stream, fit.size, camera)


def _principal_point(fit: FittedCause) -> Faults:
    if fit.stream == "metadata":
        if (by_transposing := transposed(fit.facts)).from_centre_px:
            yield by_transposing
        yield from odd_centres(fit.facts)
    u, v = _fitted_vector(fit) or flow_vector("centre", ("u", "v"), fit.stream, fit.results)
    along_axes = ((fit.size, 0.0), (0.0, fit.size))
    for camera in _suspected_cameras(fit):
        for columns_px, rows_px in ((u, v),) if _has_that_size((u, v), fit.size) else along_axes:
            yield cameras.PrincipalPointShift(fit.stream, columns_px, rows_px, camera)


def _mounting(fit: FittedCause) -> Faults:
    if fit.stream == "metadata" and (odd := odd_mounting(fit.facts)) is not None:
        yield odd
    for best in _camera_errors(fit, ROTATION_MODELS):
        # Events lie where the rotation moves the rays: R' = R Exp(w) of the event camera, or its inverse of colour.
        x_deg, y_deg, z_deg = (float(angle) for angle in np.rad2deg(best.parameters))
        yield cameras.MountingRotation("metadata", (x_deg, y_deg, z_deg), "events")
        yield cameras.MountingRotation("metadata", (-x_deg, -y_deg, -z_deg), "rgb")
    names = ("pitch", "yaw", "roll")
    pitch, yaw, roll = _fitted_vector(fit) or flow_vector("mounting", names, fit.stream, fit.results)
    about_axes = ((fit.size, 0.0, 0.0), (0.0, fit.size, 0.0), (0.0, 0.0, fit.size))
    for camera in _suspected_cameras(fit):
        for rotation_deg in ((pitch, yaw, roll),) if _has_that_size((pitch, yaw, roll), fit.size) else about_axes:
            yield cameras.MountingRotation(fit.stream, rotation_deg, camera)


def _fitted_vector(fit: FittedCause) -> tuple[float, ...]:
    """Return the error of flow against depth and poses of which the fitted size is the norm; () if it is of none."""
    for feature in (feature for alarm in fit.alarms for feature in alarm.statistic.features):
        if (
            isinstance(feature, FlowParameterFit)
            and feature.parameter == fit.cause
            and isclose(abs(feature.value), abs(fit.size))
        ):
            # The declared camera lacks what the camera of the flow has in excess.
            sign = copysign(1.0, feature.value * fit.size)
            return tuple(sign * component for component in feature.components)
    return ()


def _has_that_size(vector: Sequence[float], size: float) -> bool:
    """Whether a measured vector is long enough for a fitted size; else another check fitted it, along one axis."""
    return _SATURATES * hypot(*vector) >= abs(size)


def _gravity(fit: FittedCause) -> Faults:
    if fit.stream == "imu":
        yield motion.GravityError("gravity_magnitude", fit.size)
    else:
        yield declarations.GravityMisdeclared(fit.size)


def _gyro_bias(fit: FittedCause) -> Faults:
    for part, rows in _biases_of_parts(fit, "rotation"):
        yield motion.GyroBias(part, rows)
    if not _drifts(fit, "rotation") and (bias := vector("bias", fit.results.get("imu.rotation"))):
        yield motion.GyroBias(bias)


def _accel_bias(fit: FittedCause) -> Faults:
    for part, rows in _biases_of_parts(fit, "translation"):
        yield motion.AccelBias(part, rows)
    if not _drifts(fit, "translation") and (bias := vector("bias", fit.results.get("imu.translation"))):
        yield motion.AccelBias(bias)


def _drifts(fit: FittedCause, kind: MotionKind) -> bool:
    """Whether a bias drifts, so that none that is constant undoes it."""
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    return any(isinstance(feature, DriftingBias) and feature.kind == kind for feature in features)


def _biases_of_parts(fit: FittedCause, kind: MotionKind) -> Iterator[tuple[Vector3, RowRange]]:
    """Yield the biases of parts of the IMU, with the rows of these parts."""
    times_ns = fit.facts.clocks["imu"].times_ns
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    for part in dict.fromkeys(feature for feature in features if isinstance(feature, BiasOfPart)):
        if part.kind == kind:
            first, last = np.searchsorted(times_ns, (part.start_ns, part.stop_ns))
            yield part.bias, (int(first), None if isinf(part.stop_ns) else int(last))


def _displacements(fit: FittedCause) -> Faults:
    """Yield the displacement of positions from a jump to the one that undoes it."""
    times_ns = fit.facts.clocks["pose"].times_ns
    features = [feature for alarm in fit.alarms for feature in alarm.statistic.features]
    if any(isinstance(feature, LoneSamples) for feature in features):
        return  # of many jumps, the largest two are not those of one displacement
    for displaced in dict.fromkeys(feature for feature in features if isinstance(feature, DisplacedPositions)):
        first, last = np.searchsorted(times_ns, (displaced.start_ns, displaced.stop_ns))
        rows = int(first), None if isinf(displaced.stop_ns) else int(last)
        yield motion.Teleport(displaced.displacement_m, rows)


def _lever_arm(fit: FittedCause) -> Faults:
    arm = vector("lever", fit.results.get("imu.translation"))
    if fit.stream == "pose" and arm:
        # The arm of the IMU from the point of the poses is measured: that of the point of the poses is its opposite.
        yield motion.PoseLeverArm((-arm[0], -arm[1], -arm[2]))
    if fit.stream == "metadata":
        yield from mounting_units(fit.facts)


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
    for name in ("exponent", "exponent_at_declared_thresholds"):
        measurement = measured(fit.results.get("images.transfer"), name)
        if measurement is not None and measurement.value is not None and measurement.value > 0:
            yield images.PowerCurve(1.0 / measurement.value)
    declared = fit.facts.declared.transfer
    for actual in get_args(images.Transfer):
        if actual != declared:
            yield images.TransferMisdeclared(actual, declared)


_PROPOSALS: Final[Mapping[str, Callable[[FittedCause], Faults]]] = MappingProxyType(
    {
        "time_offset": _clock_shift,
        "clock_rate": _clock_rate,
        "time_unit": lambda fit: iter([clocks.TimeUnit(fit.stream, fit.size)]),
        "duplicated_samples": lambda fit: iter([row_order.DuplicatedSamples(fit.stream)]),
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
        "unit_deg_rad": _angle_unit,
        "flow_unit": _flow_units,
        "flow_sign": lambda fit: iter([units.FlowSign(fit.stream)]),
        "flow_gain": _flow_gain,
        "flow_interval_shifted": _flow_interval,
        "intrinsics_focal": _focal_length,
        "intrinsics_centre": _principal_point,
        "extrinsic_rotation": _mounting,
        "quaternion_inverted": lambda _: iter([motion.QuaternionInversion(), motion.PoseInversion()]),
        "quaternion_order": _component_orders,
        "quaternion_not_unit": lambda fit: iter([motion.QuaternionLength(fit.size)]),
        "gravity_missing": lambda _: iter([motion.GravityError("gravity_missing"), motion.GravityAlongBody()]),
        "gravity_sign": lambda _: iter([motion.GravityError("gravity_sign"), motion.ForceSign()]),
        "gravity_magnitude": _gravity,
        "gyro_bias": _gyro_bias,
        "accel_bias": _accel_bias,
        "teleport": _displacements,
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

"""The faults that a trial undoes for a cause: mechanisms of ``fedora_qa.faults`` with sizes from the measurements."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf, isclose, isfinite, log
from types import MappingProxyType
from typing import Final, Literal, get_args

from fedora_qa.checks.images.transfer import CodesBent
from fedora_qa.checks.index_maps.frame_to_event import WrongEntries
from fedora_qa.checks.integrity.finite import OutOfRange
from fedora_qa.conventions import FRD_FROM_FLU, MS_PER_S, NED_FROM_ENU, SAME_AXES
from fedora_qa.diagnosis.clocks import is_right_elsewhere
from fedora_qa.diagnosis.declared_mountings import inverted_mountings, mountings_of_other_bodies
from fedora_qa.diagnosis.fitted_cause import Faults, FittedCause
from fedora_qa.diagnosis.flow import CAUSES_OF_TRANSFORM, fractions_of_px
from fedora_qa.diagnosis.image_parts import fewest_fields_off, part_of_images, part_of_time
from fedora_qa.diagnosis.images import is_of_a_display
from fedora_qa.diagnosis.length_units import ratio_of_units
from fedora_qa.diagnosis.measured_sizes import Results, deviation, measured, rgb_px_per_event_px
from fedora_qa.diagnosis.proposed_camera_faults import (
    fitted_vector,
    focal_length,
    mounting,
    mounting_lever_arm,
    principal_point,
)
from fedora_qa.diagnosis.proposed_clock_faults import (
    clock_rate,
    clock_shift,
    exchanged_frames,
    parts_of_depth,
    time_units,
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
    length_units_of_parts,
    lever_arm,
    missing_gravity,
    reversed_gravity,
    vector_axes,
)
from fedora_qa.faults import (
    axes,
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
from fedora_qa.faults.fault import ReversibleFault, value_keys
from fedora_qa.faults.image_part import ImagePart, PixelRegion
from fedora_qa.faults.table import faults_of
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.sequence.facts import Facts
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
            if part is not None and _empties(fault, part, facts):
                continue
            # What lies beside the part agrees: a fault of the whole image is ruled out.
            yield fault if part is None else ImagePart(fault, part)


def _empties(fault: ReversibleFault, part: PixelRegion, facts: Facts) -> bool:
    """Whether undoing a fault within a part of the image leaves less than half of it: findings vanish with its pixels.

    Mirroring about the middle of the image is mirroring about the middle of the part, and a shift by the rest.
    """
    left, top, right, bottom = part
    columns_px, rows_px = 0.0, 0.0
    if isinstance(fault, pixels.PixelShift):
        columns_px, rows_px = fault.columns_px, fault.rows_px
    elif isinstance(fault, pixels.Mirroring):
        height, width = facts.layout.bindings[value_keys(facts, fault.stream)[0]].shape[1:3]
        columns_px = 0 if fault.direction == "vertical" else width - (left + right)
        rows_px = 0 if fault.direction == "horizontal" else height - (top + bottom)
    return 2 * abs(columns_px) > right - left or 2 * abs(rows_px) > bottom - top


_WHOLE_PX: Final = 0.1
"""Largest distance of a fitted shift from whole pixels at which these are tried. A trial more costs little."""


def is_testable(cause: str, stream: str, magnitude: float | None) -> bool:
    """Whether a cause can be undone: its fault has an inverse, and its size was fitted where it needs one."""
    sized = magnitude is not None and isfinite(magnitude) and magnitude != 0
    return cause in _PROPOSALS and bool(faults_of(cause, stream)) and (sized or cause not in _SIZED)


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
    if stream == "pose":
        yield from length_units_of_parts(fit)
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
            for part in parts_of_depth(fit):
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
    for part in parts_of_depth(fit):
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
        "time_offset": clock_shift,
        "clock_rate": clock_rate,
        "time_unit": time_units,
        "duplicated_samples": lambda fit: iter([row_order.DuplicatedSamples(fit.stream)]),
        "swapped_frames": exchanged_frames,
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

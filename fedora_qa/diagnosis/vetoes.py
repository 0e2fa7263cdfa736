"""What contradicts a cause: a measurement that is in order, or a clock that lies on the grid of the others."""

from collections.abc import Mapping, Sequence
from math import hypot, sqrt
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.event_response.conservation import Violations
from fedora_qa.checks.images.order import ALLOWED, OutOfOrderIntervals
from fedora_qa.checks.pose.continuity import PoseJump
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.diagnosis.clock_grids import ClockPlace
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.measured_sizes import (
    Results,
    begin_and_end_with_frames,
    deviation,
    flow_offset_ms,
    measured,
)
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Measurement, Result
from fedora_qa.views.flow_conventions import ConventionTrial

_EVENTS, _INERTIAL = "event_response.timing", "imu.timing"
_OF_MOTION: Final = ("imu", "pose")

_NEXT_TO_NOTHING: Final = 0.1
"""Largest change of a frame, relative to that by events, for one that repeats. The value is not derived: half the
threshold gives 0.5."""

_SEVERAL: Final = 3
"""Least number of intervals without a displacement for frames that stand still: a frame that is out of place by one
leaves one, and two may lie beside wrong flow."""

_TELEPORT: Final = ("teleport", "pose")

_REPEATS: Final = ("frozen_frames", "pose")

_UNIT_OF_POSES: Final = ("unit_mm_m", "pose")

_RAYS: Final = ("depth_ray_not_z", "depth")

_NOISE_OF_POSES: Final = ("noise_misdeclared", "pose")

_MEASURED: Final[Mapping[tuple[str, str], tuple[str, str]]] = MappingProxyType(
    {
        ("time_offset", "events"): (_EVENTS, "time_offset"),
        ("time_offset", "rgb"): (_EVENTS, "time_offset"),
        ("time_offset", "imu"): (_INERTIAL, "time_offset"),
        ("time_offset", "pose"): (_INERTIAL, "time_offset"),
        ("clock_rate", "events"): (_EVENTS, "clock_rate"),
        ("clock_rate", "rgb"): (_EVENTS, "clock_rate"),
        ("clock_rate", "imu"): (_INERTIAL, "clock_rate"),
        ("clock_rate", "pose"): (_INERTIAL, "pose_clock_rate"),
        _TELEPORT: ("pose.continuity", "position_jump"),
    }
)
"""Check and measurement of the size of a cause, in its unit, by cause and stream."""

_MEASURED_AGAINST: Final[Mapping[str, str]] = MappingProxyType(
    {"events": "rgb", "rgb": "events", "imu": "pose", "pose": "imu"}
)
"""The stream against which the offset of another is measured: where one device has both, both are off alike."""

_OF_FLOW: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "flow_gain": ("gain",),
        "intrinsics_focal": ("focal",),
        "intrinsics_centre": ("centre_u", "centre_v"),
        "extrinsic_rotation": ("mounting_pitch", "mounting_yaw", "mounting_roll"),
    }
)
"""Components of the size of a fault of flow that the frames measure for each rate, in the unit of the cause."""

_OF_CAMERA: Final = frozenset({"intrinsics_focal", "intrinsics_centre", "extrinsic_rotation"})
"""Faults of the camera with which flow was made: where depth and poses give the same flow, it is the declared one."""

_IN_ORDER: Final[Mapping[tuple[str, str], tuple[str, ...]]] = MappingProxyType(
    {
        ("exposure_or_gamma", "rgb"): ("images.exposure", "images.transfer", "event_response.threshold"),
        ("threshold_misdeclared", "events"): ("event_response.threshold",),
        ("event_model_misdeclared", "events"): ("event_response.model",),
        # Vignetting of a part of the file is a jump where it begins.
        ("vignetting", "rgb"): ("images.vignetting", "images.exposure"),
        _RAYS: ("depth.projection",),
        # Depths that agree with the path, and lie where they are declared to lie, have the unit of the path.
        ("unit_mm_m", "depth"): ("depth.scale", "depth.range", "depth.consistency"),
        ("unit_mm_m", "pose"): ("depth.scale", "depth.range", "depth.consistency"),
        # Repeats are counted bit by bit, and straight lines leave no curvature.
        _REPEATS: ("pose.continuity",),
        ("interpolated_pose", "pose"): ("pose.continuity",),
        ("quaternion_not_unit", "pose"): ("pose.orientation",),
    }
)
"""Checks that measure a cause of the whole file: where all of them pass, it is not the cause, whatever its undoing may
clear by chance."""

_CORRELATED: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "events": ("event_response.orientation",),
        "rgb": ("event_response.orientation", "flow_photometric.residual"),
        "depth": ("depth.consistency", "alignment.depth"),
        "flow": ("flow_photometric.residual", "flow_geometry.endpoint"),
        "imu": ("imu.timing",),
        "pose": ("imu.timing", "depth.consistency"),
    }
)
"""Checks that correlate a stream with others: where one of them passes, the stream is of the same sequence."""

_EXACT: Final = 0.98
"""Removed share from which a transform is all of a deviation."""

COMPARED_BY_FLOW: Final = frozenset({"flow", "rgb"})
"""Streams whose faults flow of a part of the motion resembles."""

_ATTITUDE_CONVENTIONS: Final = frozenset({"quaternion_order", "quaternion_inverted", "frame_convention"})
"""Causes by which attitudes are those of another body."""

_TURNS_ALIKE_PERCENT: Final = 10.0
"""Largest error of the gain of the gyro, with its limit, at which IMU and poses are of one flight. The gain against an
unrelated motion is 0, and the limit, in which the residual counts, is as large as the error. An unrelated motion for a
share of the time has that share of both."""

_GAIN_OF_ANOTHER_PERCENT: Final = 50.0
"""Largest limit of the gain of the gyro at which one within it is no chance. The value is not derived: the parameters
fit any two flights of a second in noise, with gains that were off by -66, 144 and 182 percent."""

_SAME_OFFSET: Final = 0.1
"""Largest relative difference of an offset of flow from the one on which its rates agree. The value is not derived:
motion that does not change evenly curves the template of time, and three rates of a file with 54 ms stated 52 to 55."""

_SAME_ARM: Final = 0.02
"""Largest relative difference of two lengths of one lever arm, of which flow and the IMU state one each. The value is
not derived: the fit of flow has an error, and of an arm that is none the length is that of its noise."""

_CORRELATED_FROM: Final = 3.1
"""Standard errors of a positive correlation by which an unrelated stream exceeds 0 with a probability of 0.001."""

_OWN: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType({"pose": ("pose.orientation", "pose.continuity")})
"""Checks of a stream by itself that another sequence does not fail: where they fail, the stream does not correlate with
others for that reason."""


def contradicts(
    cause: str,
    stream: str,
    magnitude: float | None,
    results: Results,
    places: Mapping[str, ClockPlace],
    *,
    of_two_bodies: bool = False,
) -> bool:
    """Whether a measurement that is in order contradicts a cause.

    Parameters
    ----------
    cause, stream, magnitude
        The cause, with its fitted size; None where it has none.
    results
        Of the file, by check, judged by the limits alone.
    places
        Of the clocks.
    of_two_bodies
        Whether rates and forces of the IMU agree with poses of two bodies, and so with none.
    """
    family = stream_family(stream)
    if cause == "other_sequence":
        return _is_of_this_sequence(family, magnitude, results, of_two_bodies=of_two_bodies)
    offset_ms = magnitude if cause == "time_offset" else None
    is_off_grid = cause in ("time_offset", "clock_rate") and family in places and places[family].excludes(offset_ms)
    # Flow of another time under timestamps that are right is late, whatever grid these lie on.
    is_off_grid &= not (family == "flow" and offset_ms is not None and _is_offset_of_flow(offset_ms, results))
    # Where the clocks of both lie on the grid, values of one of them are those of another time.
    of_motion = cause == "time_offset" and family in _OF_MOTION and _failed(results.get(_INERTIAL))
    is_off_grid &= not (of_motion and all(name in places and places[name].place == "in" for name in _OF_MOTION))
    # Samples that were lost, and the rest numbered anew, lie on the grid and end early: they have a rate of their own.
    is_renumbered = family in _OF_MOTION and _failed(results.get("imu.translation"))
    is_off_grid &= not (cause == "clock_rate" and is_renumbered and _ends_early(results.get("clocks.span"), family))
    # Attitudes of a part jump at its edges, and turn with depth in the rest.
    of_a_part = _has_finding(results.get("pose.continuity"), "pose.continuity.rotation")
    of_another_body = family == "pose" and cause in _ATTITUDE_CONVENTIONS and _turns_with_depth(results)
    is_of_another_body = of_another_body and not of_a_part
    # An offset that leaves a correlation is within reach of ``event_response.timing``, which states its size.
    is_unsized = cause in ("time_offset", "time_unit") and magnitude is None and family in ("rgb", "events")
    is_within_reach = is_unsized and _events_follow(results)
    of_frames = cause == "time_offset" and family in ("events", "rgb")
    is_rounding = of_frames and _is_rounding(magnitude, results)
    is_no_arm = cause == "lever_arm" and _contradicts_arm(family, magnitude, results)
    # Events on lines from frame to frame have the time of the frames.
    is_clock = cause in ("time_offset", "clock_rate") and family in ("events", "rgb")
    is_of_frames = is_clock and begin_and_end_with_frames(results)
    is_no_threshold = cause == "threshold_misdeclared" and _changes_sign(results.get("event_response.threshold"))
    is_own_camera = family == "flow" and cause in _OF_CAMERA and _passed(results.get("flow_geometry.endpoint"))
    of_noise = (cause, family) == _NOISE_OF_POSES
    is_no_noise = of_noise and _follows_declared_noise(magnitude, results.get("flow_geometry.endpoint"))
    # Events of noise are anywhere: they weaken a correlation, and displace none.
    is_displaced = (cause, family) == ("noise_misdeclared", "events") and _has_finding(
        results.get("event_response.alignment"), "event_response.alignment.shift"
    )
    of_clocks = is_off_grid or is_within_reach or is_rounding or is_of_frames
    if is_displaced or of_clocks or is_of_another_body or is_no_threshold or is_no_arm or is_own_camera or is_no_noise:
        return True
    # A gain that was measured of single frames, or of the events of a part, changes the whole by less.
    is_of_part = cause in ("exposure_or_gamma", "threshold_misdeclared") and magnitude is not None
    if cause == "threshold_misdeclared" and _repeats(results.get("event_response.frames")):
        # Beside a frame that repeats, events change what the frames do not: no part has another threshold.
        is_of_part = False
    if (cause, family) == _UNIT_OF_POSES and _has_finding(results.get("pose.continuity"), "pose.continuity.position"):
        # The unit of a part jumps at its edges, between which few depths compare: those of the rest have the unit.
        is_of_part = True
    if (cause, family) in _IN_ORDER and not is_of_part:
        # Poses that move by less than a step of their values repeat.
        is_of_steps = (cause, family) == _REPEATS and _is_coarse(results.get("integrity.resolution"), family)
        # Rays of a part of the file, or of the image, alter the exponent of the whole by little.
        of_pairs = results.get("depth.consistency")
        if (cause, family) == _RAYS and (_begins_within(of_pairs) or _has_finding(of_pairs, "depth.consistency.tile")):
            return False
        return is_of_steps or all(_passed(results.get(check)) for check in _IN_ORDER[cause, family])
    if family == "flow" and cause in _OF_FLOW and magnitude is not None:
        return _frames_contradict(cause, stream, magnitude, results.get("flow_photometric.residual"))
    # Few events of another time leave what is measured of all as it is.
    are_strays = _has_finding(results.get("clocks.span"), "clocks.span.far") and family == "events"
    # Nor does an offset of a part, into which the clock jumps or is set back, or at whose ends frames are out of order.
    jumps = cause == "time_offset" and (
        _jumps(results.get("clocks.gaps"), family)
        or _steps_back(results.get("clocks.order"), family)
        or (family == "rgb" and _failed(results.get("images.order")))
    )
    is_open = are_strays or jumps or (cause == "time_offset" and _left_together(family, results, places))
    if (cause, family) in _MEASURED and magnitude is not None and not is_open:
        check, name = _MEASURED[cause, family]
        result = results.get(check)
        measurement = measured(result, name)
        if measurement is None or measurement.limit is None or not _passed(result):
            return False
        is_jump = (cause, family) == _TELEPORT
        # A fault larger than the limit would have exceeded it.
        return abs(magnitude) > (_largest_jump_that_passes(measurement) if is_jump else measurement.limit)
    return False


def _left_together(family: str, results: Results, places: Mapping[str, ClockPlace]) -> bool:
    """Whether the clock of a stream is out of place although that against which it is measured has its time.

    An offset of one stream against another states nothing of one that both have, such as IMU and poses of an autopilot:
    others show it, by the grid of their timestamps or by their ends.
    """
    pair = {family, _MEASURED_AGAINST.get(family, family)}
    is_out = any(name in places and places[name].place == "out" for name in pair)
    return is_out or pair <= _streams_with_other_ends(results.get("clocks.span"))


def disturbs_too_few(hypothesis: Hypothesis, alarm: Alarm, results: Results) -> bool:
    """Whether a cause of a known size disturbs fewer pixels than contradict the frames.

    A doubled event disturbs one pixel. Where none has the timestamp of another, doubled events may have other
    timestamps, and their number is unknown.

    Parameters
    ----------
    hypothesis
        The cause, for the finding of the alarm.
    alarm
        With the violations of conservation, or without.
    results
        Of the file, by check.
    """
    violations = [feature for feature in alarm.statistic.features if isinstance(feature, Violations)]
    repeats = measured(results.get("event_stream.duplicates"), "repeats")
    if (hypothesis.cause, hypothesis.stream) != ("duplicated_samples", "events") or not violations:
        return False
    return repeats is not None and bool(repeats.value) and 2 * (repeats.value or 0.0) < violations[0].pixels


def _is_of_this_sequence(family: str, magnitude: float | None, results: Results, *, of_two_bodies: bool) -> bool:
    """Whether a stream correlates with others, or deviates for a reason that another sequence has not."""
    of_frames = family in ("rgb", "events")
    of_a_while = magnitude is not None and _follow_beside(magnitude, results.get("event_response.orientation"))
    # A whole that correlates says nothing of a while in which single changes do not.
    while_apart = of_frames and (of_a_while or _failed(results.get("event_response.frames")))
    correlates = any(_passed(results.get(check)) for check in _CORRELATED.get(family, ()) if not while_apart)
    if family in ("imu", "pose"):
        correlates |= _turns_alike(results.get("imu.rotation")) or (not of_two_bodies and _agrees_otherwise(results))
    if family == "flow":
        correlates |= flow_offset_ms(results) is not None
    if family == "rgb" and of_a_while:
        # Of a share of the time: flow warps every frame, events correlate on the whole.
        correlates = _passed(results.get("flow_photometric.residual"))
    if family == "depth" and magnitude is not None:
        # Edges of the whole lie where those of the frames do, whatever a while of it holds.
        correlates = _passed(results.get("depth.consistency"))
    if family == "events" and magnitude is None:
        # Events of another sequence lie at no edges, wherever they are looked for. Frames that the flow contradicts as
        # well are the odd ones.
        at_edges = results.get("alignment.events")
        correlates |= _passed(at_edges) or _failed(at_edges)
        correlates |= _has_finding(results.get("flow_photometric.residual"), "flow_photometric.residual.unmatched")
    if of_frames and not while_apart:
        correlates |= _events_follow(results)
        # Events without a sign follow no frames, of whatever sequence.
        correlates |= _has_finding(results.get("event_stream.bounds"), "event_stream.bounds.one_polarity")
    disturbed = any(_failed(results.get(check)) for check in _OWN.get(family, ()))
    return correlates or disturbed or _steps_back(results.get("clocks.order"), family)


def _is_offset_of_flow(offset_ms: float, results: Results) -> bool:
    """Whether an offset is the one on which the rates of flow agree, as the frames measure them."""
    agreed = flow_offset_ms(results)
    return agreed is not None and abs(offset_ms - agreed[0]) < _SAME_OFFSET * abs(agreed[0])


def is_flow_of_a_part(alarms: Sequence[Alarm]) -> bool:
    """Whether flow follows a part of the motion of depth and poses, and nothing else explains how it deviates.

    Flow of the turning alone, or of the way alone, is exactly a sum of both with other factors. No other fault of flow,
    or of the frames with which it is compared, is: a gain has one factor for both, and leaves nothing either.

    Parameters
    ----------
    alarms
        Of the file, with the convention trials of ``flow_geometry.endpoint``.
    """
    shares: dict[tuple[str, str], list[float]] = {}
    for alarm in alarms:
        if alarm.finding.code.startswith("flow_geometry.endpoint."):
            for trial in alarm.statistic.features:
                if isinstance(trial, ConventionTrial) and trial.stream == "flow":
                    for rate in ("", trial.rate):
                        shares.setdefault((rate, trial.transform), []).append(trial.removed_share)
    explain = {key for key, removed in shares.items() if np.mean(removed) > _EXACT}
    # A gain may be the factor of a unit in one rate: what else explains a rate explains it.
    return ("", "parts_of_motion") in explain and {transform for _, transform in explain} == {"parts_of_motion"}


def stand_still(alarms: Sequence[Alarm]) -> bool:
    """Whether colour frames, or a part of them, stand still in several intervals, and are never displaced backwards.

    Exchanged frames have the displacements 1 + d and 1 - d of their distance d, of which none is 0.

    Parameters
    ----------
    alarms
        Of the file, with the intervals of ``images.order``.
    """
    intervals = [f for alarm in alarms for f in alarm.statistic.features if isinstance(f, OutOfOrderIntervals)]
    ratios = [ratio for feature in intervals for ratio in feature.relative_ratios]
    stopped = sum(abs(ratio) < ALLOWED for ratio in ratios)
    return stopped >= _SEVERAL and not any(ratio < -ALLOWED for ratio in ratios)


def no_pose_repeats(alarms: Sequence[Alarm], results: Results) -> bool:
    """Whether no pose repeats the one before, and positions or orientations alone do not at a jump either.

    Repeats are counted bit by bit. A jump without them is none of a stream that stands still and goes on later.

    Parameters
    ----------
    alarms
        Of the file, with the jumps of ``pose.continuity``.
    results
        Of the file, by check.
    """
    repeats = measured(results.get("pose.continuity"), "frozen")
    jumps = [f for alarm in alarms for f in alarm.statistic.features if isinstance(f, PoseJump)]
    return repeats is not None and repeats.value == 0 and not any(jump.beside_repeated_samples for jump in jumps)


def _contradicts_arm(family: str, magnitude_m: float | None, results: Results) -> bool:
    """Whether the arm that is measured between the IMU and the poses contradicts a lever arm.

    One that flow or depth state is of the cameras where it is longer than that arm can be, and of the poses where it
    has the length of that arm.
    """
    result = results.get("imu.translation")
    axes = [measured(result, f"lever_{axis}") for axis in "xyz"]
    limits_m = [axis.limit for axis in axes if axis is not None and axis.limit is not None]
    if not magnitude_m or len(limits_m) < len(axes):
        return False
    arm_m = [deviation(result, f"lever_{axis}") for axis in "xyz"]
    if family in _OF_MOTION:
        return abs(magnitude_m) > hypot(*(abs(part) + limit for part, limit in zip(arm_m, limits_m, strict=True)))
    return family == "metadata" and abs(hypot(*arm_m) - abs(magnitude_m)) < _SAME_ARM * abs(magnitude_m)


def _follows_declared_noise(off_percent: float | None, result: Result | None) -> bool:
    """Whether flow asks for corrections of the poses as large as their declared noise, by limits that decide it.

    Depth that disagrees with the poses by more is then wrong itself.

    Parameters
    ----------
    off_percent
        100 (declared / true - 1).
    result
        Of ``flow_geometry.endpoint``, which states true / declared for each rate.
    """
    ratios = [m for m in (result.measurements if result is not None else ()) if m.name.endswith(" pose_correction")]
    limits = [ratio.limit for ratio in ratios if ratio.limit is not None and not ratio.exceeds_limit]
    if off_percent is None or off_percent <= -100.0 or not limits or len(limits) < len(ratios):
        return False
    return abs(1 / (1 + off_percent / 100) - 1) > min(limits)


def _largest_jump_that_passes(measurement: Measurement) -> float:
    """Return the length of the largest jump that may not exceed a limit of its components.

    The limit is that of the place of the largest deviation. A jump may lie where the motion hides it best, and have
    equal components along all three axes.
    """
    limits = (measurement.limit, measurement.least_detectable, *(measurement.least_detectable_range or ()))
    largest: float = sqrt(3.0) * max(limit for limit in limits if limit is not None)
    return largest


def _is_rounding(offset_ms: float | None, results: Results) -> bool:
    """Whether the grid on which frames or events were stamped is coarser than an offset.

    Those between two ticks are late by half a tick where they are stamped with the next one, and early by as much where
    they are stamped with the one before.
    """
    grids = (measured(results.get("clocks.resolution"), f"{stream}.grid") for stream in ("rgb", "events"))
    # Declared packets are no rounding.
    coarser_us = (grid.value for grid in grids if grid is not None and grid.value is not None and grid.exceeds_limit)
    coarsest_us = max(coarser_us, default=0.0)
    return offset_ms is not None and abs(offset_ms) < coarsest_us * NS_PER_US / NS_PER_MS


def _turns_with_depth(results: Results) -> bool:
    """Whether depth frames turn as the poses do, while the gyro does not.

    Attitudes of another body would turn the points of depth about other axes. Another world turns neither the depth
    frames nor the gyro against the poses: it moves gravity alone. Frames that are compared beside noise of the poses
    leave room for it.
    """
    depth = results.get("depth.consistency")
    beside_noise = measured(depth, "pose_correction") is not None
    return _passed(depth) and not beside_noise and _failed(results.get("imu.rotation"))


def _events_follow(results: Results) -> bool:
    """Whether events follow the frames in part, in another orientation or at a shift."""
    orientation = results.get("event_response.orientation")
    correlation = measured(orientation, "correlation")
    # A shift is stated only where events and frames correlate at it, which so few changes may do by chance that the
    # whole shows nothing.
    is_seen = correlation is not None and correlation.value is not None and correlation.value > 0
    is_shifted = is_seen and _failed(results.get("event_response.alignment"))
    return is_shifted or _changes_alike(orientation)


def _changes_alike(result: Result | None) -> bool:
    """Whether events follow the frames in part, as declared, or under another symmetry of the image and of the sign.

    Events of another sequence have a correlation of 0 with its error, and under the best of all symmetries reach no
    half of the expected one.
    """
    declared, advantage = measured(result, "correlation"), measured(result, "advantage_of_another_orientation")
    if declared is None or declared.value is None or not declared.standard_error or declared.expected is None:
        return False
    best = declared.value + (advantage.value or 0.0 if advantage is not None else 0.0)
    return declared.value > _CORRELATED_FROM * declared.standard_error or best > declared.expected / 2


def _follow_beside(share_percent: float, result: Result | None) -> bool:
    """Whether events follow the frames beside a share of the time, by at least half of what the rest would give."""
    declared = measured(result, "correlation")
    if declared is None or declared.value is None or declared.expected is None:
        return True
    return declared.value > declared.expected * (1 - share_percent / 100) / 2


def _turns_alike(result: Result | None) -> bool:
    """Whether the gyro turns as the poses do, however much its bias, its axes or its gain deviate.

    Noise of the poses widens the limit of the gain. Two short flights may then be fitted within noise, with any gain;
    those of one flight leave noise alone and have a gain within its limit.
    """
    gain = measured(result, "scale")
    if gain is None or gain.value is None or gain.limit is None:
        return False
    left = [measured(result, name) for name in ("rotation_residual", "worst_rotation")]
    is_noise = all(each is not None and not each.exceeds_limit for each in left)
    is_of_one = is_noise and abs(gain.value) <= gain.limit < _GAIN_OF_ANOTHER_PERCENT
    return abs(gain.value) + gain.limit < _TURNS_ALIKE_PERCENT or is_of_one


def _agrees_otherwise(results: Results) -> bool:
    """Whether IMU and poses of the whole file agree under another convention, as no two motions do."""
    findings = (finding for check in ("imu.rotation", "imu.translation") if (result := results.get(check))
                for finding in result.findings)  # fmt: skip
    return any(finding.code.endswith(".disagreement") and finding.where.start_us is None for finding in findings)


def _frames_contradict(cause: str, stream: str, magnitude: float, result: Result | None) -> bool:
    """Whether the frames follow a flow, or any rate of it, more closely than the fault would let them."""
    if result is None or not _passed(result):
        return False
    for rate in dict.fromkeys(m.name.partition(" ")[0] for m in result.measurements):
        if stream not in ("flow", rate):
            continue
        limits = [m.limit for name in _OF_FLOW[cause] if (m := measured(result, f"{rate} {name}")) is not None]
        sizes = [limit for limit in limits if limit is not None]
        # A vector as long as that exceeds the limit of a component at least.
        if len(sizes) == len(_OF_FLOW[cause]) and abs(magnitude) > hypot(*sizes):
            return True
    return False


def _changes_sign(result: Result | None) -> bool:
    """Whether the step of an event has the opposite sign of its threshold: what fits another cause may have."""
    return any(deviation(result, f"threshold_{sign}") <= -100.0 for sign in ("on", "off"))


def _has_finding(result: Result | None, code: str) -> bool:
    return result is not None and any(finding.code == code for finding in result.findings)


def _streams_with_other_ends(result: Result | None) -> set[str]:
    """Return the streams that begin late and end early, or the reverse."""
    ends: dict[str, set[str]] = {"clocks.span.begins_late": set(), "clocks.span.ends_early": set()}
    for finding in result.findings if result is not None else ():
        if finding.code in ends:
            ends[finding.code].update(stream_family(place.stream or "") for place in finding.all_places)
    return set.intersection(*ends.values())


def _ends_early(result: Result | None, family: str) -> bool:
    return result is not None and any(
        finding.code == "clocks.span.ends_early" and stream_family(place.stream or "") == family
        for finding in result.findings
        for place in finding.all_places
    )


def _jumps(result: Result | None, family: str) -> bool:
    """Whether the clock of a stream has steps of no whole number of periods, while all others keep the period."""
    return result is not None and any(
        finding.code == "clocks.gaps.jump" and stream_family(place.stream or "") == family
        for finding in result.findings
        for place in finding.all_places
    )


def _repeats(result: Result | None) -> bool:
    """Whether a frame changes by next to nothing of what the events around it change."""
    return _failed(result) and abs(deviation(result, "change_shown") + 1.0) < _NEXT_TO_NOTHING


def _steps_back(result: Result | None, family: str) -> bool:
    """Whether the clock of a stream steps back: what lies behind it correlates with nothing, of whatever sequence."""
    return result is not None and any(
        finding.code == "clocks.order.backward_steps" and stream_family(finding.where.stream or "") == family
        for finding in result.findings
    )


def _is_coarse(result: Result | None, family: str) -> bool:
    """Whether values of a stream are stored in steps whose rounding is material."""
    return result is not None and any(
        stream_family(place.stream or "") == family for finding in result.findings for place in finding.all_places
    )


def _begins_within(result: Result | None) -> bool:
    """Whether what a check finds begins behind the first row, with which a fault of the whole file begins."""
    return result is not None and any(
        finding.where.index_start is not None and finding.where.index_start > 0 for finding in result.findings
    )


def _failed(result: Result | None) -> bool:
    return result is not None and result.outcome == "failed"


def _passed(result: Result | None) -> bool:
    return result is not None and result.outcome == "passed"

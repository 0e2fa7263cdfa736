"""Measurements that contradict a cause: what a check measured and found in order is not the fault."""

from collections.abc import Mapping
from math import hypot, sqrt
from types import MappingProxyType
from typing import Final

from fedora_qa.causes import stream_family
from fedora_qa.diagnosis.coincidence import ClockPlace
from fedora_qa.diagnosis.measured_sizes import Results, measured
from fedora_qa.record.types import Measurement, Result

_EVENTS, _INERTIAL = "event_response.timing", "imu.timing"
_TELEPORT: Final = ("teleport", "pose")

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

_OF_FLOW: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "flow_gain": ("gain",),
        "intrinsics_focal": ("focal",),
        "intrinsics_centre": ("centre_u", "centre_v"),
        "extrinsic_rotation": ("mounting_pitch", "mounting_yaw", "mounting_roll"),
    }
)
"""Components of the size of a fault of flow that the frames measure for each rate, in the unit of the cause."""

_IN_ORDER: Final[Mapping[tuple[str, str], tuple[str, ...]]] = MappingProxyType(
    {
        ("exposure_or_gamma", "rgb"): ("images.exposure", "images.transfer", "event_response.threshold"),
        ("threshold_misdeclared", "events"): ("event_response.threshold",),
        ("event_model_misdeclared", "events"): ("event_response.model",),
        # Vignetting of a part of the file is a jump where it begins.
        ("vignetting", "rgb"): ("images.vignetting", "images.exposure"),
        ("depth_ray_not_z", "depth"): ("depth.projection",),
        # Repeats are counted bit by bit, and straight lines leave no curvature.
        ("frozen_frames", "pose"): ("pose.continuity",),
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


_ATTITUDE_CONVENTIONS: Final = frozenset({"quaternion_order", "quaternion_inverted", "frame_convention"})
"""Causes by which attitudes are those of another body."""

_OWN: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType({"pose": ("pose.orientation", "pose.continuity")})
"""Checks of a stream by itself that another sequence does not fail: where they fail, the stream does not correlate with
others for that reason."""


def contradicts(
    cause: str, stream: str, magnitude: float | None, results: Results, places: Mapping[str, ClockPlace]
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
    """
    family = stream_family(stream)
    if cause == "other_sequence":
        # A whole that correlates says nothing of a while in which single changes do not.
        while_apart = family in ("rgb", "events") and _failed(results.get("event_response.frames"))
        correlates = any(_passed(results.get(check)) for check in _CORRELATED.get(family, ()) if not while_apart)
        disturbed = any(_failed(results.get(check)) for check in _OWN.get(family, ()))
        return correlates or disturbed or _steps_back(results.get("clocks.order"), family)
    if cause in ("time_offset", "clock_rate") and family in places:
        offset_ms = magnitude if cause == "time_offset" else None
        if places[family].excludes(offset_ms):
            return True
    if family == "pose" and cause in _ATTITUDE_CONVENTIONS and _turns_with_depth(results):
        return True
    if (cause, family) in _IN_ORDER:
        return all(_passed(results.get(check)) for check in _IN_ORDER[cause, family])
    if family == "flow" and cause in _OF_FLOW and magnitude is not None:
        return _frames_contradict(cause, stream, magnitude, results.get("flow_photometric.residual"))
    if (cause, family) in _MEASURED and magnitude is not None:
        check, name = _MEASURED[cause, family]
        result = results.get(check)
        measurement = measured(result, name)
        if measurement is None or measurement.limit is None or not _passed(result):
            return False
        is_jump = (cause, family) == _TELEPORT
        # A fault larger than the limit would have exceeded it.
        return abs(magnitude) > (_largest_jump_that_passes(measurement) if is_jump else measurement.limit)
    return False


def _largest_jump_that_passes(measurement: Measurement) -> float:
    """Return the length of the largest jump that may not exceed a limit of its components.

    The limit is that of the place of the largest deviation. A jump may lie where the motion hides it best, and have
    equal components along all three axes.
    """
    limits = (measurement.limit, measurement.least_detectable, *(measurement.least_detectable_range or ()))
    largest: float = sqrt(3.0) * max(limit for limit in limits if limit is not None)
    return largest


def _turns_with_depth(results: Results) -> bool:
    """Whether depth frames turn as the poses do, while the gyro does not.

    Attitudes of another body would turn the points of depth about other axes. Another world turns neither the depth
    frames nor the gyro against the poses: it moves gravity alone.
    """
    return _passed(results.get("depth.consistency")) and _failed(results.get("imu.rotation"))


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


def _steps_back(result: Result | None, family: str) -> bool:
    """Whether the clock of a stream steps back: what lies behind it correlates with nothing, of whatever sequence."""
    return result is not None and any(
        finding.code == "clocks.order.backward_steps" and stream_family(finding.where.stream or "") == family
        for finding in result.findings
    )


def _failed(result: Result | None) -> bool:
    return result is not None and result.outcome == "failed"


def _passed(result: Result | None) -> bool:
    return result is not None and result.outcome == "passed"

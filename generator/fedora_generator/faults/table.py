"""Which cause can be planted in which stream, and by what."""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import h5py

from fedora_generator.faults import events, flow, images, imu, index_maps, metadata, pose, samples, storage
from fedora_generator.faults.fault import Fault
from fedora_qa.causes import CAUSES, INDEX_MAPS, TIMED, stream_family
from fedora_qa.layout.canonical import FLOW_STREAMS

Edit = Callable[[h5py.File, Fault], None]
Damage = Callable[[Path, Fault], None]

_FLOATS: Final = ("depth", "imu", "pose", "flow")
_IMAGES: Final = ("rgb", "depth", "flow")
_STORED: Final = (*TIMED, *INDEX_MAPS)


def _by_stream(cause: str, streams: Iterable[str], edit: Edit) -> dict[tuple[str, str], Edit]:
    return {(cause, stream): edit for stream in streams}


FAULTS: Final[Mapping[tuple[str, str], Edit]] = MappingProxyType(
    {
        **_by_stream("time_offset", TIMED, samples.time_offset),
        **_by_stream("clock_rate", TIMED, samples.clock_rate),
        **_by_stream("quantised_time", TIMED, samples.quantised_time),
        **_by_stream("time_unit", TIMED, samples.time_unit),
        **_by_stream("quantised_values", ("depth", "flow", "pose", "imu"), storage.quantised_values),
        **_by_stream("dropped_samples", TIMED, samples.dropped_samples),
        **_by_stream("duplicated_samples", TIMED, samples.duplicated_samples),
        **_by_stream("unsorted", TIMED, samples.unsorted),
        **_by_stream("frozen_frames", ("rgb", "depth", "flow", "pose", "imu"), samples.frozen_frames),
        **_by_stream("swapped_frames", _IMAGES, samples.swapped_frames),
        **_by_stream("nan_in_stream", _FLOATS, samples.nan_in_stream),
        **_by_stream("other_sequence", TIMED, samples.other_sequence),
        **_by_stream("index_off_by_one", INDEX_MAPS, index_maps.index_off_by_one),
        **_by_stream("index_side", INDEX_MAPS, index_maps.index_side),
        **_by_stream("mirrored", _IMAGES, images.mirrored),
        **_by_stream("spatial_offset", _IMAGES, images.spatial_offset),
        **_by_stream("invalid_encoding", ("depth", "flow"), images.invalid_encoding),
        ("polarity_inverted", "events"): events.polarity_inverted,
        ("axes_swapped", "events"): events.axes_swapped,
        ("mirrored", "events"): events.mirrored,
        ("spatial_offset", "events"): events.spatial_offset,
        ("interpolated_frames", "events"): events.interpolated_frames,
        ("dead_region", "events"): events.dead_region,
        ("hot_pixels", "events"): events.hot_pixels,
        ("time_jitter", "events"): events.time_jitter,
        ("threshold_misdeclared", "events"): events.threshold_misdeclared,
        ("event_model_misdeclared", "events"): events.event_model_misdeclared,
        ("noise_misdeclared", "events"): events.noise_misdeclared,
        ("axes_swapped", "imu"): imu.axes_swapped,
        ("frame_convention", "imu"): imu.frame_convention,
        ("unit_deg_rad", "imu"): imu.unit_deg_rad,
        ("gyro_bias", "imu"): imu.gyro_bias,
        ("accel_bias", "imu"): imu.accel_bias,
        ("gravity_missing", "imu"): imu.gravity_missing,
        ("gravity_sign", "imu"): imu.gravity_sign,
        ("gravity_magnitude", "imu"): imu.gravity_magnitude,
        ("lever_arm", "imu"): imu.lever_arm,
        ("noise_misdeclared", "imu"): imu.noise_misdeclared,
        ("axes_swapped", "pose"): pose.axes_swapped,
        ("frame_convention", "pose"): pose.frame_convention,
        ("unit_mm_m", "pose"): pose.unit_mm_m,
        ("quaternion_order", "pose"): pose.quaternion_order,
        ("quaternion_inverted", "pose"): pose.quaternion_inverted,
        ("quaternion_not_unit", "pose"): pose.quaternion_not_unit,
        ("teleport", "pose"): pose.teleport,
        ("lever_arm", "pose"): pose.lever_arm,
        ("interpolated_pose", "pose"): pose.interpolated_pose,
        ("noise_misdeclared", "pose"): pose.noise_misdeclared,
        ("flow_sign", "flow"): flow.flow_sign,
        ("axes_swapped", "flow"): flow.axes_swapped,
        ("frame_convention", "flow"): flow.frame_convention,
        ("flow_gain", "flow"): flow.flow_gain,
        ("flow_unit", "flow"): flow.flow_unit,
        ("flow_rate_mixed", "flow"): flow.flow_rate_mixed,
        ("flow_interval_shifted", "flow"): flow.flow_interval_shifted,
        ("intrinsics_focal", "flow"): flow.intrinsics_focal,
        ("intrinsics_centre", "flow"): flow.intrinsics_centre,
        ("extrinsic_rotation", "flow"): flow.extrinsic_rotation,
        ("flow_from_noisy_pose", "flow"): flow.flow_from_noisy_pose,
        ("unit_mm_m", "depth"): images.unit_mm_m,
        ("depth_ray_not_z", "depth"): images.depth_ray_not_z,
        ("channel_order", "rgb"): images.channel_order,
        ("exposure_or_gamma", "rgb"): images.exposure_or_gamma,
        ("vignetting", "rgb"): images.vignetting,
        ("intrinsics_focal", "metadata"): metadata.intrinsics_focal,
        ("intrinsics_centre", "metadata"): metadata.intrinsics_centre,
        ("extrinsic_rotation", "metadata"): metadata.extrinsic_rotation,
        ("lever_arm", "metadata"): metadata.lever_arm,
        ("frame_convention", "metadata"): metadata.frame_convention,
        ("rectification_misdeclared", "metadata"): metadata.rectification_misdeclared,
        ("gravity_magnitude", "metadata"): metadata.gravity_magnitude,
        ("nan_in_stream", "metadata"): metadata.nan_in_stream,
        **_by_stream("truncated", _STORED, storage.truncated),
        **_by_stream("missing_stream", (*_STORED, "metadata"), storage.missing_stream),
        **_by_stream("wrong_shape", (*_STORED, "metadata"), storage.wrong_shape),
        **_by_stream("wrong_dtype", (*_STORED, "metadata"), storage.wrong_dtype),
    }
)
"""(cause, stream) -> the function that changes the open copy; ``flow`` also stands for every rate."""

BYTE_FAULTS: Final[Mapping[tuple[str, str], Damage]] = MappingProxyType(
    {
        ("truncated", "file"): storage.truncate_file,
        **{("corrupt_chunk", stream): storage.corrupt_chunk for stream in _STORED},
    }
)
"""(cause, stream) -> the function that changes the bytes of the copy; ``file`` is the file as a whole."""


_TIMELESS: Final = frozenset(
    {
        *("truncated", "missing_stream", "wrong_shape", "wrong_dtype", "corrupt_chunk", "other_sequence"),
        *("threshold_misdeclared", "event_model_misdeclared", "noise_misdeclared", "quantised_values"),
        "rectification_misdeclared",
    }
)
"""Faults of a whole stream, of its storage or of a declaration."""

_OF_ROWS: Final = frozenset(
    {
        *("time_offset", "clock_rate", "quantised_time", "time_unit", "time_jitter"),
        *("dropped_samples", "duplicated_samples", "unsorted"),
    }
)
"""Faults of timestamps and of whole rows: a region of an image has none of its own, while events are single pixels."""

_EVENTS_TOGETHER: Final = frozenset({"time_unit", "unsorted"})
"""Faults that no region confines even for events: the events outside would move to other rows of the file."""


def allows_interval(cause: str, stream: str) -> bool:
    """Whether a fault can be confined to an interval of time."""
    return stream != "metadata" and cause not in _TIMELESS


def allows_region(cause: str, stream: str) -> bool:
    """Whether a fault can be confined to a rectangle of the image."""
    family = stream_family(stream)
    if family == "events":
        return cause not in _TIMELESS | _EVENTS_TOGETHER
    return family in _IMAGES and cause not in _TIMELESS | _OF_ROWS


def allows_direction(cause: str, stream: str) -> bool:
    """Whether a fault is a shift that can go in any direction, and by parts of a pixel.

    Depth cannot be interpolated between surfaces, and events lie on whole pixels.
    """
    return cause == "spatial_offset" and stream_family(stream) in ("rgb", "flow")


USUAL_FACTORS: Final[Mapping[tuple[str, str], float]] = MappingProxyType(
    {
        ("unit_mm_m", "depth"): 1e-3,
        ("unit_mm_m", "pose"): 1e3,
        ("unit_deg_rad", "imu"): math.degrees(1),
        **{("time_unit", stream): 1e3 for stream in TIMED},
    }
)
"""Factors of the usual errors of units: depth in metres, positions in mm, rates in deg/s, timestamps in ns."""


def legal_causes() -> tuple[str, ...]:
    """Return the causes that can be planted, in the order of ``CAUSES``."""
    causes = {cause for cause, _ in (*FAULTS, *BYTE_FAULTS)}
    return tuple(cause for cause in CAUSES if cause in causes)


def usual_stream(cause: str) -> str:
    """Return the only stream in which a cause can be planted, and ``events`` for a cause that has several or none."""
    families = _families_of(cause)
    return families[0] if len(families) == 1 else "events"


def legal_streams(cause: str) -> tuple[str, ...]:
    """Return the streams that a cause can be planted in, ``flow`` with each of its rates."""
    return tuple(
        name for family in _families_of(cause) for name in ((family, *FLOW_STREAMS) if family == "flow" else (family,))
    )


def _families_of(cause: str) -> list[str]:
    """Return the streams that a cause can be planted in, all rates of ``flow`` as one."""
    return [stream for fault_cause, stream in (*FAULTS, *BYTE_FAULTS) if fault_cause == cause]

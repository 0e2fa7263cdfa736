"""The table of faults, and how one is planted: in a copy, complete or not at all."""

import math
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import h5py
import hdf5plugin  # noqa: F401 - its import makes the codec of the layout known to HDF5

from fedora_generator.errors import OutputError
from fedora_generator.faults import (
    clocks,
    depth,
    events,
    flow,
    flow_geometry,
    images,
    imu,
    index_maps,
    metadata,
    pose,
    rgb,
    samples,
    storage,
)
from fedora_generator.faults.fault import Fault, FaultError, default_unit
from fedora_qa.causes import CAUSES, INDEX_MAPS, TIMED, stream_family
from fedora_qa.layout.canonical import FLOW_STREAMS

Edit = Callable[[h5py.File, Fault], None]
Damage = Callable[[Path, Fault], None]

_FLOATS: Final = ("depth", "imu", "pose", "flow")
_IMAGES: Final = ("rgb", "depth", "flow")
_STORED: Final = (*TIMED, *INDEX_MAPS)


def _each(cause: str, streams: Iterable[str], edit: Edit) -> dict[tuple[str, str], Edit]:
    return {(cause, stream): edit for stream in streams}


FAULTS: Final[Mapping[tuple[str, str], Edit]] = MappingProxyType(
    {
        **_each("time_offset", TIMED, clocks.time_offset),
        **_each("clock_rate", TIMED, clocks.clock_rate),
        **_each("quantised_time", TIMED, clocks.quantised_time),
        **_each("time_unit", TIMED, clocks.time_unit),
        **_each("dropped_samples", TIMED, samples.dropped_samples),
        **_each("duplicated_samples", TIMED, samples.duplicated_samples),
        **_each("unsorted", TIMED, samples.unsorted),
        **_each("frozen_frames", ("rgb", "depth", "flow", "pose", "imu"), samples.frozen_frames),
        **_each("swapped_frames", _IMAGES, samples.swapped_frames),
        **_each("nan_in_stream", _FLOATS, samples.nan_in_stream),
        **_each("index_off_by_one", INDEX_MAPS, index_maps.index_off_by_one),
        **_each("index_side", INDEX_MAPS, index_maps.index_side),
        **_each("mirrored", _IMAGES, images.mirrored),
        **_each("spatial_offset", _IMAGES, images.spatial_offset),
        **_each("invalid_encoding", ("depth", "flow"), images.invalid_encoding),
        ("polarity_inverted", "events"): events.polarity_inverted,
        ("axes_swapped", "events"): events.axes_swapped,
        ("mirrored", "events"): events.mirrored,
        ("spatial_offset", "events"): events.spatial_offset,
        ("dead_region", "events"): events.dead_region,
        ("hot_pixels", "events"): events.hot_pixels,
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
        ("intrinsics_focal", "flow"): flow_geometry.intrinsics_focal,
        ("intrinsics_centre", "flow"): flow_geometry.intrinsics_centre,
        ("extrinsic_rotation", "flow"): flow_geometry.extrinsic_rotation,
        ("flow_from_noisy_pose", "flow"): flow_geometry.flow_from_noisy_pose,
        ("unit_mm_m", "depth"): depth.unit_mm_m,
        ("depth_ray_not_z", "depth"): depth.depth_ray_not_z,
        ("channel_order", "rgb"): rgb.channel_order,
        ("exposure_or_gamma", "rgb"): rgb.exposure_or_gamma,
        ("intrinsics_focal", "metadata"): metadata.intrinsics_focal,
        ("intrinsics_centre", "metadata"): metadata.intrinsics_centre,
        ("extrinsic_rotation", "metadata"): metadata.extrinsic_rotation,
        ("lever_arm", "metadata"): metadata.lever_arm,
        ("frame_convention", "metadata"): metadata.frame_convention,
        ("gravity_magnitude", "metadata"): metadata.gravity_magnitude,
        **_each("truncated", _STORED, storage.truncated),
        **_each("missing_stream", (*_STORED, "metadata"), storage.missing_stream),
        **_each("wrong_shape", (*_STORED, "metadata"), storage.wrong_shape),
        **_each("wrong_dtype", (*_STORED, "metadata"), storage.wrong_dtype),
    }
)
"""(cause, stream) -> what it does to the open copy; ``flow`` stands for each of its rates too."""

BYTE_FAULTS: Final[Mapping[tuple[str, str], Damage]] = MappingProxyType(
    {
        ("truncated", "file"): storage.truncate_file,
        **{("corrupt_chunk", stream): storage.corrupt_chunk for stream in _STORED},
    }
)
"""(cause, stream) -> what it does to the bytes of the copy; ``file`` is the file as a whole."""


USUAL_FACTORS: Final[Mapping[tuple[str, str], float]] = MappingProxyType(
    {
        ("unit_mm_m", "depth"): 1e-3,
        ("unit_mm_m", "pose"): 1e3,
        ("unit_deg_rad", "imu"): math.degrees(1),
        **{("time_unit", stream): 1e3 for stream in TIMED},
    }
)
"""Factors of the values by which a unit is usually missed: depth in metres, positions in mm, rates in deg/s, ns."""


def legal_causes() -> tuple[str, ...]:
    """Return the causes that can be planted, in the order of ``CAUSES``."""
    known = {cause for cause, _ in (*FAULTS, *BYTE_FAULTS)}
    return tuple(cause for cause in CAUSES if cause in known)


def legal_streams(cause: str) -> tuple[str, ...]:
    """Return the streams that a cause can be planted in, ``flow`` with each of its rates."""
    families = [stream for known, stream in (*FAULTS, *BYTE_FAULTS) if known == cause]
    return tuple(name for each in families for name in ((each, *FLOW_STREAMS) if each == "flow" else (each,)))


def plant_fault(
    source: Path,
    target: Path,
    cause: str,
    stream: str,
    magnitude: float | None = None,
    unit: str | None = None,
    seed: int = 0,
    start_s: float | None = None,
    stop_s: float | None = None,
    *,
    consistent_maps: bool = True,
) -> Fault:
    """Copy ``source`` to ``target`` with one fault in it.

    Parameters
    ----------
    source, target
        The clean file, which is only read, and where the faulty one goes, replaced in one step when it is complete.
    cause, stream
        As ``legal_causes`` and ``legal_streams`` list them.
    magnitude, unit
        Positive: stamps too late, values too large. The unit is the cause's own if none is given. Where the magnitude
        is a factor, 1, which is no fault, stands for the usual one (``USUAL_FACTORS``); a fault without a size needs
        none.
    seed
        For what is placed or drawn at random.
    start_s, stop_s
        Half-open interval, seconds after the file's first stamp, to confine the fault to.
    consistent_maps
        Make the index maps anew where a recorder would have made them after the fault.

    Returns
    -------
    Fault
        What was planted.

    Raises
    ------
    FaultError
        The fault cannot be planted as asked; nothing is written.
    OutputError
        The target's folder does not exist.
    """
    _require_legal(cause, stream)
    unit = default_unit(cause, stream) if unit is None else unit
    fault = Fault(
        cause=cause,
        stream=stream,
        magnitude=_size_of(cause, stream, magnitude, unit),
        unit=unit,
        seed=seed,
        start_s=start_s,
        stop_s=stop_s,
    )
    _require_two_files(source, target)
    partial = target.with_name(f".{target.name}.{os.getpid()}.partial")
    try:
        shutil.copyfile(source, partial)
        _apply(partial, fault, consistent_maps=consistent_maps)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return fault


def _apply(path: Path, fault: Fault, *, consistent_maps: bool) -> None:
    key = (fault.cause, stream_family(fault.stream))
    if key in BYTE_FAULTS:
        BYTE_FAULTS[key](path, fault)
        return
    with h5py.File(path, "r+") as file:
        FAULTS[key](file, fault)
        if consistent_maps and index_maps.maps_follow(fault):
            index_maps.remake_index_maps(file)


def _size_of(cause: str, stream: str, magnitude: float | None, unit: str) -> float:
    usual = USUAL_FACTORS.get((cause, stream_family(stream)))
    if usual is not None and magnitude in (None, 1):
        return usual
    if magnitude is None and unit not in ("", "1"):
        raise FaultError(f"Expected a magnitude for {cause}, in {unit} unless a unit is given; use --magnitude")
    magnitude = 1.0 if magnitude is None else magnitude
    if not math.isfinite(magnitude) or (magnitude == 0 and unit):
        raise FaultError(f"Expected a finite magnitude other than 0 for {cause}, got {magnitude:g}")
    return magnitude


def _require_legal(cause: str, stream: str) -> None:
    if cause not in legal_causes():
        raise FaultError(
            f"Expected a cause that can be planted, got {cause!r}; choose from {', '.join(legal_causes())}"
        )
    if stream not in legal_streams(cause):
        streams = ", ".join(legal_streams(cause))
        raise FaultError(f"Expected a stream that {cause} can befall, got {stream!r}; choose from {streams}")


def _require_two_files(source: Path, target: Path) -> None:
    if not source.is_file() or not h5py.is_hdf5(source):
        raise FaultError(f"Expected an HDF5 file, got {source}; name a file that the generator wrote")
    if not target.parent.is_dir():
        raise OutputError(f"Expected an existing folder to write into, got {target.parent}; create it first")
    if target.exists() and target.samefile(source):
        raise FaultError(
            f"Expected a target other than the source, got {target} twice; faults are never planted in place"
        )

"""Faults of the flow fields: what is done to them, and how they are made.

A fault of how flow is made (from a wrong camera, or from the noisy pose) is the difference of two flows made from the
file's own depth and pose, one right and one wrong. So a file with pose noise gets a flow that differs from the
noise-free one by the fault and nothing else.
"""

from collections.abc import Callable, Iterator

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.metadata import MatrixChange, group_in, longer_focal, rolled, shifted_centre
from fedora_generator.faults.pose import body_poses_at
from fedora_generator.faults.rows import edit_values, flow_streams_in, streams_in, timestamps_in, window_of
from fedora_generator.flow import flow_px
from fedora_qa.conventions import MM_PER_M, US_PER_S

Floats = NDArray[np.float64]
MakeFlow = Callable[[Floats, Floats], Floats]
"""(K, T_body_camera) -> flow (H, W, 2) of one interval"""

_CAMERA, _DEPTH = "metadata/cameras/depth", "path/depth"


def flow_sign(file: h5py.File, fault: Fault) -> None:
    """Point backwards."""
    edit_values(file, fault, lambda flow_px: -flow_px)


def axes_swapped(file: h5py.File, fault: Fault) -> None:
    """Write (v, u)."""
    edit_values(file, fault, lambda flow_px: flow_px[..., ::-1])


def frame_convention(file: h5py.File, fault: Fault) -> None:
    """Let v point up."""
    edit_values(file, fault, lambda flow_px: flow_px * np.array([1, -1], dtype=flow_px.dtype))


def flow_gain(file: h5py.File, fault: Fault) -> None:
    """Make flow too large by the magnitude."""
    gain = np.float32(1 + fault.magnitude_in("percent") / 100)
    edit_values(file, fault, lambda flow_px: flow_px * gain)


def flow_unit(file: h5py.File, fault: Fault) -> None:
    """Write px/s, or px s (the paper's equation) where the magnitude is negative: too large values, or too small."""
    power = 1 if fault.magnitude_in("1") > 0 else -1
    for stream in streams_in(file, fault.stream):
        timestamps_us = timestamps_in(file, stream)
        for row in _rows(file, stream, fault):
            interval_s = float(timestamps_us[row, 1] - timestamps_us[row, 0]) / US_PER_S
            file[f"path/{stream}"][row] = file[f"path/{stream}"][row] * np.float32(interval_s**-power)


def flow_rate_mixed(file: h5py.File, fault: Fault) -> None:
    """Store under one rate the field of the fastest other rate that begins at the same time, or last before.

    With the stream ``flow`` the fastest rate keeps its own.
    """
    present = [stream for stream in reversed(flow_streams_in(file)) if f"path/{stream}" in file]
    streams = streams_in(file, fault.stream)
    receivers = [stream for stream in streams if fault.stream != "flow" or stream != present[0]]
    if len(present) < 2:
        raise FaultError(f"Expected flow at two rates or more, got {', '.join(present) or 'none'}")
    for stream in receivers:
        donor = next(other for other in present if other != stream)
        starts_us, donor_starts_us = timestamps_in(file, stream)[:, 0], timestamps_in(file, donor)[:, 0]
        nearest = np.searchsorted(donor_starts_us, starts_us, side="right") - 1
        for row in _rows(file, stream, fault):
            file[f"path/{stream}"][row] = file[f"path/{donor}"][max(int(nearest[row]), 0)]


def flow_interval_shifted(file: h5py.File, fault: Fault) -> None:
    """Stamp fields too late by the given number of intervals; at the end that becomes free, the last field repeats."""
    shift = fault.count()
    for stream in streams_in(file, fault.stream):
        fields = file[f"path/{stream}"]
        rows = _rows(file, stream, fault)
        # From the end towards which fields move, so that none is overwritten before it has been read.
        for row in reversed(rows) if shift > 0 else rows:
            fields[row] = fields[min(max(row - shift, 0), len(fields) - 1)]


def intrinsics_focal(file: h5py.File, fault: Fault) -> None:
    """Make flow with a focal length too large by the magnitude."""
    _make_with(file, fault, K_change=longer_focal(fault))


def intrinsics_centre(file: h5py.File, fault: Fault) -> None:
    """Make flow with a principal point too far right by the magnitude."""
    _make_with(file, fault, K_change=shifted_centre(fault))


def extrinsic_rotation(file: h5py.File, fault: Fault) -> None:
    """Make flow with a camera rolled about its optical axis by the magnitude."""
    _make_with(file, fault, mount_change=rolled(fault))


def flow_from_noisy_pose(file: h5py.File, fault: Fault) -> None:
    """Make flow from the poses that the file holds, with their noise."""
    K, T_body_camera = _declared_camera(file)
    noises = group_in(file, "metadata/pose").attrs
    if not any(noises.get(name, 0) for name in ("position_sigma", "rotation_sigma")):
        raise FaultError("Expected declared pose noise, got none: flow would stay the same")
    for fields, row, make in _intervals(file, fault):
        fields[row] = make(K, T_body_camera)


def _rows(file: h5py.File, stream: str, fault: Fault) -> range:
    window = window_of(file, stream, fault)
    return range(window.start, window.stop)


def _unchanged(matrix: Floats) -> Floats:
    return matrix


def _make_with(
    file: h5py.File, fault: Fault, K_change: MatrixChange = _unchanged, mount_change: MatrixChange = _unchanged
) -> None:
    K, T_body_camera = _declared_camera(file)
    for fields, row, make in _intervals(file, fault):
        error_px = make(K_change(K), mount_change(T_body_camera)) - make(K, T_body_camera)
        fields[row] = fields[row] + error_px


def _declared_camera(file: h5py.File) -> tuple[Floats, Floats]:
    attributes = group_in(file, _CAMERA).attrs
    return np.array(attributes["K"], dtype=np.float64), np.array(attributes["T_body_camera"], dtype=np.float64)


def _intervals(file: h5py.File, fault: Fault) -> Iterator[tuple[h5py.Dataset, int, MakeFlow]]:
    """Every interval that the fault touches: its dataset, its row, and how to make its flow."""
    depth_us = timestamps_in(file, "depth")[...]
    for stream in streams_in(file, fault.stream):
        fields, window = file[f"path/{stream}"], window_of(file, stream, fault)
        intervals_us = timestamps_in(file, stream)[window]
        poses = body_poses_at(file, intervals_us.ravel()).reshape(-1, 2, 4, 4)
        frames = np.searchsorted(depth_us, intervals_us[:, 0])
        if np.any(frames == len(depth_us)) or np.any(depth_us[frames] != intervals_us[:, 0]):
            raise FaultError(f"Expected a depth frame at the start of every interval of {stream}, got some without")
        for row, frame, (start, end) in zip(range(window.start, window.stop), frames, poses, strict=True):
            yield fields, row, _maker(file[_DEPTH][int(frame)], start, end)


def _maker(depth_mm: NDArray[np.float32], T_world_body_start: Floats, T_world_body_end: Floats) -> MakeFlow:
    inverse_depth_per_m = MM_PER_M / depth_mm.astype(np.float64)

    def make(K: Floats, T_body_camera: Floats) -> Floats:
        T_start, T_end = T_world_body_start @ T_body_camera, T_world_body_end @ T_body_camera
        return flow_px(inverse_depth_per_m, K, T_start, T_end).astype(np.float64)

    return make

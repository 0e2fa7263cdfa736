"""Faults of how flow was made: from a wrong camera, or from the noisy pose.

The fault is the difference of two flows made from the file's own depth and pose, one right and one wrong. So a file
with pose noise still gets a flow that differs from the noise-free one by the fault and nothing else.
"""

from collections.abc import Callable, Iterator

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.metadata import MatrixChange, group_in, longer_focal, rolled, shifted_centre
from fedora_generator.faults.rows import streams_in, timestamps_in, window_of
from fedora_generator.faults.trajectory import body_poses_at
from fedora_generator.flow import flow_px
from fedora_qa.conventions import MM_PER_M

Floats = NDArray[np.float64]
MakeFlow = Callable[[Floats, Floats], Floats]
"""(K, T_body_camera) -> flow (H, W, 2) of one interval"""

_CAMERA, _DEPTH = "metadata/cameras/depth", "path/depth"


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

"""Causes for which other checks have the stronger evidence, and that also spoil the agreement of depth and pose."""

from typing import Final

from fedora_qa.checks.protocol import Suspect

_WEAK: Final = 0.02
"""Joins a finding to a cause for which there is stronger evidence elsewhere."""

_CAUSES: Final = {
    "depth": (
        "unit_mm_m", "depth_ray_not_z", "mirrored", "spatial_offset", "frozen_frames", "swapped_frames", "time_offset",
        "clock_rate", "quantised_time", "time_unit", "unsorted", "other_sequence",
    ),
    "pose": (
        "unit_mm_m", "quaternion_order", "quaternion_inverted", "quaternion_not_unit", "axes_swapped",
        "frame_convention", "frozen_frames", "time_offset", "clock_rate", "quantised_time", "time_unit", "unsorted",
        "teleport", "interpolated_pose", "noise_misdeclared", "lever_arm", "other_sequence", "dropped_samples",
        "duplicated_samples",
    ),
    "metadata": ("intrinsics_focal", "intrinsics_centre", "extrinsic_rotation", "lever_arm", "frame_convention"),
}  # fmt: skip

ANY_MISFIT: Final = tuple(Suspect(cause, stream, _WEAK) for stream, causes in _CAUSES.items() for cause in causes)
"""What makes depth frames and poses contradict each other."""

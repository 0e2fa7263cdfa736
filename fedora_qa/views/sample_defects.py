"""Defects of the samples themselves that disturb whatever is computed from them: looked for wherever that is done."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Suspect
from fedora_qa.conventions import NS_PER_MS, NS_PER_S, NS_PER_US
from fedora_qa.estimators.clocks.displaced_timestamps import displaced_part
from fedora_qa.estimators.clocks.rounded_timestamps import rounding_grid_ns
from fedora_qa.estimators.imu.frozen_samples import unmoved
from fedora_qa.estimators.imu.local_motion import Vectors
from fedora_qa.estimators.imu.straight_lines import Interpolation, find_interpolation
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import ImuSamples, PoseSamples
from fedora_qa.views.motion_samples import imu_roundings, measured_pose_sigmas, stored_resolution

LEAST_EVENNESS: Final = 0.2
"""Curvature of a smooth motion does not change fivefold within a step, nor does the median of noise."""

_NOISIER: Final = 1.2
_OF_TIMESTAMPS: Final = 0.95
"""Weight of what the stamps themselves show, exactly."""


def interpolation_of(poses: PoseSamples) -> Interpolation | None:
    """Look for straight lines between every n-th position."""
    resolution = stored_resolution(poses.positions_world_m)
    return find_interpolation(poses.times_ns, Vectors(poses.positions_world_m), resolution=resolution)


def is_interpolated(found: Interpolation | None) -> bool:
    """Whether the curvature is too uneven for a motion that was sampled."""
    return found is not None and found.evenness < LEAST_EVENNESS


def rate_hz(poses: PoseSamples) -> float:
    """Return the poses' own rate."""
    return NS_PER_S / float(np.median(np.diff(poses.times_ns)))


def frozen_poses(poses: PoseSamples) -> NDArray[np.intp]:
    """Return poses that repeat the one before while the body moves."""
    samples = poses.positions_world_m, poses.orientations_xyzw
    return unmoved(*samples, roundings=[stored_resolution(values) for values in samples])


def frozen_imu(imu: ImuSamples) -> NDArray[np.intp]:
    """Return IMU samples that repeat the one before while others change."""
    if len(imu.times_ns) < 2:
        return np.empty(0, dtype=np.intp)
    return unmoved(imu.angular_velocities_body_rad_s, imu.specific_forces_body_m_s2, roundings=imu_roundings(imu))


def timestamp_defects(facts: Facts, *streams: str) -> tuple[Suspect, ...]:
    """Name what is wrong with the stamps themselves: all that is computed from these streams is disturbed.

    Stamps on a coarse grid, and a part of an exact clock that was moved, show in the stamps alone.
    """
    return tuple(suspect for stream in streams for suspect in _defects_of(stream, facts.clocks[stream].times_ns))


def _defects_of(stream: str, times_ns: NDArray[np.int64]) -> tuple[Suspect, ...]:
    grid_ns = rounding_grid_ns(times_ns, resolution_ns=NS_PER_US)
    if grid_ns:
        return (Suspect("quantised_time", stream, _OF_TIMESTAMPS, grid_ns / NS_PER_MS, "ms"),)
    moved = displaced_part(times_ns, resolution_ns=NS_PER_US)
    if moved is None:
        return ()
    if moved.drift:
        return (Suspect("clock_rate", stream, _OF_TIMESTAMPS, 1e6 * moved.drift, "ppm"),)
    return (Suspect("time_offset", stream, _OF_TIMESTAMPS, moved.offset_ns / NS_PER_MS, "ms"),)


def pose_defects(facts: Facts, poses: PoseSamples, model: PoseModel) -> tuple[Suspect, ...]:
    """Name what is wrong with the poses themselves and may show in all that is computed from them."""
    of_timestamps = timestamp_defects(facts, "pose")
    if of_timestamps:
        return of_timestamps
    suspects = []
    found = interpolation_of(poses)
    if found is not None and is_interpolated(found):
        suspects.append(Suspect("interpolated_pose", "pose", 0.9, rate_hz(poses) / found.stride, "Hz"))
    frozen = frozen_poses(poses)
    if len(frozen):
        suspects.append(Suspect("frozen_frames", "pose", 0.8, float(len(frozen)), "samples"))
    if not suspects:
        position_m, rotation_rad = measured_pose_sigmas(poses)
        noisier = position_m > _NOISIER * model.position_sigma_m or rotation_rad > _NOISIER * model.rotation_sigma_rad
        if noisier and max(model.position_sigma_m, model.rotation_sigma_rad) > 0:
            suspects.append(Suspect("noise_misdeclared", "pose", 0.7))
    return tuple(suspects)

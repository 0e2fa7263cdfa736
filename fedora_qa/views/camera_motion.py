"""The camera's motion over the intervals of a window, from poses that are interpolated once."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from fedora_qa.conventions import NS_PER_S
from fedora_qa.geometry.camera import RigidMotion, camera_motion
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Interval, Pose, finite_poses, owned_intervals, pose_track, poses_at

DELAY_NS: Final = NS_PER_S // 1000
"""Step of the central difference of a motion by time, ns."""


def motion_over(window: Window, interval: Interval) -> RigidMotion | None:
    """Return how points move over an interval in the depth camera; None where no pose covers it.

    Flow lies on the grid of that camera. Poses at all ends of the window's intervals, and ``DELAY_NS`` before and after
    them, are interpolated at once.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the motion.
    interval
        Start and end, ns from the file's origin.

    Returns
    -------
    RigidMotion or None
        Of points in the camera frame (Z forward, X right, Y down).
    """
    return window.derived(_motion_over, interval.start_ns, interval.end_ns)


def _motion_over(window: Window, start_ns: int, end_ns: int) -> RigidMotion | None:
    track = pose_track(window, window.facts.declared.cameras["depth"])
    poses = window.derived(_poses_at_ends)
    before, after = poses.get(start_ns), poses.get(end_ns)
    if before is None or after is None:
        return track.motion(start_ns, end_ns)
    return camera_motion(*before, *after, track.camera.T_body_camera)


def _poses_at_ends(window: Window) -> Mapping[int, Pose]:
    """Return the poses by their instants, those that are finite."""
    intervals = [interval for stream in window.facts.flow_streams for interval in owned_intervals(window, stream)]
    ends_ns = np.array([(interval.start_ns, interval.end_ns) for interval in intervals], dtype=np.int64).ravel()
    # ``tile_templates`` differentiates the motion by central differences, so each end is needed three times.
    instants_ns = np.unique(np.concatenate((ends_ns, ends_ns - DELAY_NS, ends_ns + DELAY_NS)))
    R, positions_m = poses_at(finite_poses(window), instants_ns)
    finite = np.isfinite(R).all(axis=(1, 2)) & np.isfinite(positions_m).all(axis=1)
    return {int(instants_ns[i]): (R[i], positions_m[i]) for i in np.flatnonzero(finite)}

"""The camera's motion over the intervals of a window, from poses that are interpolated once."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from fedora_qa.conventions import NS_PER_S
from fedora_qa.geometry.camera import RigidMotion, camera_motion
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Interval, Pose, PoseTrack, owned_intervals

DELAY_NS: Final = NS_PER_S // 1000
"""Step of the central difference of a motion by time, ns."""


def motion_over(window: Window, track: PoseTrack, interval: Interval) -> RigidMotion | None:
    """Return how points move over an interval in the camera of a window's own track; None where no pose covers it.

    Poses at all ends of the window's intervals, and ``DELAY_NS`` before and after them, are interpolated at once. The
    track is that of the depth camera, on whose grid flow lies.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the motion.
    track
        Poses, with the depth camera.
    interval
        Start and end, ns from the file's origin.

    Returns
    -------
    RigidMotion or None
        Of points in the camera frame (Z forward, X right, Y down).
    """

    def compute() -> RigidMotion | None:
        poses = window.once("poses at ends of intervals", lambda: _poses_at_ends(window, track))
        before, after = poses.get(interval.start_ns), poses.get(interval.end_ns)
        if before is None or after is None:
            return track.motion(interval.start_ns, interval.end_ns)
        return camera_motion(*before, *after, track.camera.T_body_camera)

    return window.once(("motion over", interval.start_ns, interval.end_ns), compute)


def _poses_at_ends(window: Window, track: PoseTrack) -> Mapping[int, Pose]:
    """Return the poses by their instants, those that are finite."""
    intervals = [interval for stream in window.facts.flow_streams for interval in owned_intervals(window, stream)]
    ends_ns = np.array([(interval.start_ns, interval.end_ns) for interval in intervals], dtype=np.int64).ravel()
    # ``tile_templates`` differentiates the motion by central differences, so each end is needed three times.
    instants_ns = np.unique(np.concatenate((ends_ns, ends_ns - DELAY_NS, ends_ns + DELAY_NS)))
    R, positions_m = track.poses_at(instants_ns)
    finite = np.isfinite(R).all(axis=(1, 2)) & np.isfinite(positions_m).all(axis=1)
    return {int(instants_ns[i]): (R[i], positions_m[i]) for i in np.flatnonzero(finite)}

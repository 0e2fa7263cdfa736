"""Poses of the body at the frames of a window: interpolated at once, and shared by streams with equal timestamps."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Pose, PoseTrack, finite_poses, poses_at

Float64 = NDArray[np.float64]


def pose_of_frame(window: Window, track: PoseTrack, stream: str, frame: int) -> Pose:
    """Return the pose of the body at a frame of a stream.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the poses of its frames.
    track
        Poses of the body.
    stream
        Stream of the frame.
    frame
        Row of the frame in the file.

    Returns
    -------
    R_world_body, position_world_m
        (3, 3) and (3,); NaN where no poses cover the frame.
    """
    # Poses of all frames of the window, and of the one before, are interpolated together: each by itself takes many
    # times as long. They are of the body, and so the same for all cameras.
    owned, times_ns = window.owned(stream), window.facts.clocks[stream].times_ns
    first = max(owned.start - 1, 0)
    if not first <= frame < owned.stop:
        return track.pose(int(times_ns[frame]))
    at_ns = times_ns[first : owned.stop]
    R_world_body, positions_world_m = window.derived(_poses_at, at_ns.tobytes())
    return R_world_body[frame - first], positions_world_m[frame - first]


def _poses_at(window: Window, instants_ns: bytes) -> tuple[Float64, Float64]:
    return poses_at(finite_poses(window), np.frombuffer(instants_ns, np.int64))

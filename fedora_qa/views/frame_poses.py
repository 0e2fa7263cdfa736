"""Where the body was at the frames of a window: interpolated at once, and shared by streams whose stamps agree."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Pose, PoseTrack

Float64 = NDArray[np.float64]


def pose_of_frame(window: Window, track: PoseTrack, stream: str, frame: int) -> Pose:
    """Return the pose of the body at a frame of a stream; NaN where none covers it.

    Those of the frames that a window owns, and of the one before, are interpolated together: one by one takes many
    times as long. What a track gives of the body is the same for all cameras.
    """
    owned, times_ns = window.owned(stream), window.facts.clocks[stream].times_ns
    first = max(owned.start - 1, 0)
    if not first <= frame < owned.stop:
        return track.pose(int(times_ns[frame]))
    at_ns = times_ns[first : owned.stop]
    R_world_body, positions_world_m = window.once(("poses of frames", at_ns.tobytes()), lambda: track.poses_at(at_ns))
    return R_world_body[frame - first], positions_world_m[frame - first]

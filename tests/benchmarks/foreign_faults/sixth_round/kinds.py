"""The sixth round: faults that users and makers of real tools report, in the proportion in which they do.

A number is that of an issue or a pull request in the repository of the tool that is named.
"""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import displacement, poses
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import FLOW
from tests.benchmarks.foreign_faults.poses import ORIENTATION
from tests.benchmarks.foreign_faults.sixth_round import flow, frames
from tests.benchmarks.foreign_faults.sixth_round.event_kinds import EVENT_KINDS
from tests.benchmarks.foreign_faults.sixth_round.image_kinds import IMAGES
from tests.benchmarks.foreign_faults.sixth_round.sample_kinds import SAMPLES

_COMPOSITES: Final = (
    Kind("colour and depth behind the pose", frames.behind_the_pose, ("path/rgb", "path/depth"),
         ("rgb:time_offset", "depth:time_offset"),
         "Flightmare, whose images belong to an earlier pose than the one at their time (issue 121).",
         Range(1, 3, "frames", whole=True), composite=True),
    Kind("flow towards the frame before", flow.towards_the_frame_before, FLOW,
         ("flow:flow_sign", "flow:flow_interval_shifted"),
         "Blender's pass of four channels, of which the first two lead to the frame before (vision_blender issue 7).",
         composite=True),
    Kind("flow as CARLA sends it", both(displacement.normalised, displacement.changed(((1, 0), (0, -1)))), FLOW,
         ("flow:flow_unit", "flow:frame_convention"),
         "SHIFT, whose flow is that of CARLA as it is, in shares of the image and with v upwards (issue 52).",
         composite=True),
    Kind("flow of CARLA times the whole size", displacement.changed(((2, 0), (0, -2))), FLOW,
         ("flow:flow_gain", "flow:frame_convention"),
         "CARLA's users, who multiply by the width and height, and not by half of them (issues 4795 and 5514).",
         composite=True),
    Kind("quaternions inverted, and w first", both(poses.conjugated, poses.scalar_first), (ORIENTATION,),
         ("pose:quaternion_inverted", "pose:quaternion_order"),
         "Kalibr's exported poses, whose order and direction are not those of their header (issue 751).",
         composite=True),
)  # fmt: skip

SIXTH_ROUND: Final = tuple(replace(kind, round=6) for kind in (*EVENT_KINDS, *IMAGES, *SAMPLES, *_COMPOSITES))
"""Kinds of the sixth round, in the order of streams."""

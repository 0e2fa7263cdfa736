"""The seventh round: mistakes that are made where data of simulators, recordings and other formats are ported.

Kinds follow how the tools that are named are known to work, in the proportion in which such mistakes are likely.
"""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import displacement, images, poses, sensor
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import FLOW, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION
from tests.benchmarks.foreign_faults.seventh_round import samples, timestamps
from tests.benchmarks.foreign_faults.seventh_round.event_kinds import EVENT_KINDS
from tests.benchmarks.foreign_faults.seventh_round.image_kinds import IMAGES
from tests.benchmarks.foreign_faults.seventh_round.sample_kinds import SAMPLES

_COMPOSITES: Final = (
    Kind("IMU and pose on the clock of the autopilot", timestamps.imu_and_pose_late, ("path/imu/ts", "path/pose/ts"),
         ("imu:time_offset", "pose:time_offset"), "PX4 beside cameras of another computer, without time synchronised.",
         Range(4, 47, "ms", signed=True), composite=True),
    Kind("pose as KITTI's, and flow by 64 in place of 128",
         both(samples.in_camera_axes, displacement.changed(((2, 0), (0, 2)))), (*POSE, *FLOW),
         ("pose:frame_convention", "flow:flow_gain"), "A converter of KITTI that is used for other data.",
         composite=True),
    Kind("depth in metres, and invalid as 0",
         both(images.invalid_as_zero("path/depth"), images.scaled("path/depth", 1e-3)), ("path/depth",),
         ("depth:unit_mm_m", "depth:invalid_encoding"), "32FC1 images of ROS, filled with 0.",
         composite=True),
    Kind("polarity inverted, and quaternions w first", both(sensor.polarity_inverted, poses.scalar_first),
         ("path/events/p", ORIENTATION), ("events:polarity_inverted", "pose:quaternion_order"),
         "The simulated DVS of Gazebo beside a log of its poses.", composite=True),
)  # fmt: skip

SEVENTH_ROUND: Final = tuple(replace(kind, round=7) for kind in (*EVENT_KINDS, *IMAGES, *SAMPLES, *_COMPOSITES))
"""Kinds of the seventh round, in the order of streams."""

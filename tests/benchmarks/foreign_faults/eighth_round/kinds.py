"""The eighth round: further mistakes that are made where data of simulators, recordings and formats are ported.

Kinds follow how the tools that are named are known to work, in the proportion in which such mistakes are likely.
"""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import clocks, images, inertial, poses, sensor
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.eighth_round import flow
from tests.benchmarks.foreign_faults.eighth_round.event_kinds import EVENT_KINDS
from tests.benchmarks.foreign_faults.eighth_round.image_kinds import IMAGES
from tests.benchmarks.foreign_faults.eighth_round.sample_kinds import SAMPLES
from tests.benchmarks.foreign_faults.kind import Kind
from tests.benchmarks.foreign_faults.paths import FLOW, IMU, POSE

_COMPOSITES: Final = (
    Kind("flow of Unity's motion vectors", flow.of_texture_coordinates, FLOW,
         ("flow:flow_unit", "flow:frame_convention"),
         "Unity's motion vectors, in shares of the image and with v upwards.", composite=True),
    Kind("colour and events upside down", both(images.flipped("path/rgb", 1), sensor.mirrored("y")),
         ("path/rgb", "path/events/y"), ("rgb:mirrored", "events:mirrored"),
         "ReadPixels of Unity, from whose frames the events are made.", composite=True),
    Kind("IMU in FRD, and pose in NED",
         both(inertial.in_axes((1, 0, 0), (0, -1, 0), (0, 0, -1)), poses.north_east_down), (*IMU, *POSE),
         ("imu:frame_convention", "pose:frame_convention"), "Logs of PX4 as they are.", composite=True),
    Kind("IMU and pose in nanoseconds", both(clocks.in_unit("imu", 1e3), clocks.in_unit("pose", 1e3)),
         ("path/imu/ts", "path/pose/ts"), ("imu:time_unit", "pose:time_unit"), "EuRoC's tables as they are.",
         composite=True),
)  # fmt: skip

EIGHTH_ROUND: Final = tuple(replace(kind, round=8) for kind in (*EVENT_KINDS, *IMAGES, *SAMPLES, *_COMPOSITES))
"""Kinds of the eighth round, in the order of streams."""

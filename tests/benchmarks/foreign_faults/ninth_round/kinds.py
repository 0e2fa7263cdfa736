"""The ninth round: further mistakes of those who simulate, convert, calibrate and clean.

Kinds follow how the tools that are named are known to work. Truths were fixed before anything was measured.
"""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import clocks, images, inertial, sensor
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.ninth_round import samples
from tests.benchmarks.foreign_faults.ninth_round.event_kinds import EVENT_KINDS
from tests.benchmarks.foreign_faults.ninth_round.image_kinds import IMAGES
from tests.benchmarks.foreign_faults.ninth_round.sample_kinds import SAMPLES
from tests.benchmarks.foreign_faults.paths import MAPS, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION

_COMPOSITES: Final = (
    Kind("pose of CARLA, and depth in metres", both(samples.of_carla, images.scaled("path/depth", 1e-3)),
         (*POSE, "path/depth"), ("pose:frame_convention", "depth:unit_mm_m"),
         "CARLA's transforms, and its depth times 1000 m.", composite=True),
    Kind("pose predicted, and accelerometer with the sign of iOS",
         both(samples.predicted, inertial.multiplied(ACCELEROMETER, -1.0)), (*POSE, ACCELEROMETER),
         ("pose:time_offset", "imu:gravity_sign"), "ARKit beside Core Motion.", Range(14, 48, "ms"), composite=True),
    Kind("quaternions of another fixed point, and gravity removed",
         both(samples.quaternions_of_other_fixed_point, inertial.with_gravity(-1.0)), (ORIENTATION, ACCELEROMETER),
         ("pose:quaternion_not_unit", "imu:gravity_missing"), "BNO055 with its linear acceleration.", composite=True),
    Kind("threshold of v2e by default, and colour stamped at its end",
         both(sensor.threshold_declared("threshold_on", "threshold_off"), clocks.delayed("rgb"),
              Range(5, 33, "ms")),
         ("metadata/events", "path/rgb_ts", *MAPS), ("events:threshold_misdeclared", "rgb:time_offset"),
         "v2e's default in the metadata, beside a video whose frames end at their times.",
         Range(20, 70, "%", signed=True), composite=True),
)  # fmt: skip

NINTH_ROUND: Final = tuple(replace(kind, round=9) for kind in (*EVENT_KINDS, *IMAGES, *SAMPLES, *_COMPOSITES))
"""Kinds of the ninth round, in the order of streams."""

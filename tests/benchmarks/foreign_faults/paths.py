"""What kinds alter: beginnings of the paths of objects in a file."""

from typing import Final

from tests.benchmarks.foreign.rows import FLOW_RATES
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

MAPS: Final = ("metadata/rgb_to_event", "metadata/depth_to_event")
COLOUR_MAP, DEPTH_MAP = MAPS
FLOW: Final = tuple(f"path/flow/{rate}" for rate in FLOW_RATES)
IMU: Final = (GYRO, ACCELEROMETER)
POSE: Final = (POSITION, ORIENTATION)
EVENTS: Final = ("path/events", *MAPS)
EVENT_TIME: Final = ("path/events/t", *MAPS)
CAMERA: Final = "metadata/cameras/"

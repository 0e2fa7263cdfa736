"""Kinds of the eighth round in the IMU and the pose."""

from typing import Final

from tests.benchmarks.foreign_faults import images, inertial, transport
from tests.benchmarks.foreign_faults.eighth_round import samples
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import IMU, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

_IMU: Final = (
    Kind("gyro in mrad/s", inertial.multiplied(GYRO, 1e3), (GYRO,), ("imu:unit_deg_rad",),
         "MAVLink's SCALED_IMU, whose rates are in mrad/s."),
    Kind("gyro of yaw, pitch and roll", samples.rates_of_yaw_first, (GYRO,), ("imu:axes_swapped",),
         "Euler rates in the order of Z, Y and X."),
    Kind("gyro mirrored like a vector", inertial.multiplied(GYRO, -1.0), (GYRO,), ("imu:frame_convention",),
         "Conversions from Unreal's left-handed axes, which turn the sign of Y for rates as for accelerations."),
    Kind("IMU in half precision", samples.in_half_precision, IMU, ("imu:quantised_values",),
         "Data sets for learning, stored as float16."),
    Kind("accelerometer of a lower rate", transport.held("imu", ACCELEROMETER), (ACCELEROMETER,),
         ("imu:frozen_frames",), "RealSense's unite_imu_method=copy.", Range(50, 260, "Hz")),
    Kind("accelerometer without partners", samples.without_partners, (ACCELEROMETER,), ("imu:nan_in_stream",),
         "Outer joins of pandas by time, of sensors with two rates.", Range(2, 6, "samples", whole=True)),
    Kind("IMU in FRD for a while", samples.in_frd_for_a_while, IMU, ("imu:frame_convention",),
         "Logs of two versions of a bridge for PX4.", local=True),
    Kind("buffer of the IMU read backwards", samples.buffer_read_backwards, ("path/imu",), ("imu:unsorted",),
         "A ring buffer that is read from its newest sample.", local=True),
    Kind("accelerometer in cm/s^2", inertial.multiplied(ACCELEROMETER, 1e2), (ACCELEROMETER,), (),
         "Unreal, whose unit of length is the centimetre."),
)  # fmt: skip

_POSE: Final = (
    Kind("position alone in NED", samples.position_in_ned, (POSITION,), ("pose:frame_convention",),
         "PX4's local position beside an attitude of MAVROS."),
    Kind("position as text", images.coarse(POSITION), (POSITION,), ("pose:quantised_values",),
         "Logs with two or three decimals.", Range(0.002, 0.04, "m")),
    Kind("quaternions of two decimals", samples.quaternions_of_two_decimals, (ORIENTATION,),
         ("pose:quantised_values", "pose:quaternion_not_unit"), "Prints of engines, copied into a table.",
         debatable="the rounding takes the length as well"),
    Kind("pose of the ticks before", samples.of_ticks_before, POSE, ("pose:time_offset",),
         "CARLA, whose get_transform gives the state of the last snapshot.", Range(1, 9, "samples", whole=True)),
    Kind("flight begins again", samples.flight_begins_again, POSE, ("pose:teleport",),
         "AirSim's reset after a collision, beside recordings that go on.", local=True,
         debatable="what follows the jump belongs to another time"),
    Kind("overlap of two files of poses", samples.overlap_of_two_files, ("path/pose",),
         ("pose:duplicated_samples", "pose:unsorted"), "Bags that were split with an overlap, and joined end to end.",
         local=True, debatable="what occurs again is also behind later poses"),
    Kind("quaternions of the inverse for a while", samples.inverted_for_a_while, (ORIENTATION,),
         ("pose:quaternion_inverted",), "Two scripts, of COLMAP's direction and of TUM's, for parts of a trajectory.",
         local=True),
    Kind("position in centimetres for a while", samples.in_centimetres_for_a_while, (POSITION,),
         ("pose:unit_mm_m",), "Levels of Unreal, of which one has another scale of the world.", local=True),
    Kind("way in body axes", samples.way_in_body_axes, (POSITION,), (),
         "Odometry that sums velocities of the body, which nothing turns."),
)  # fmt: skip

SAMPLES: Final = (*_IMU, *_POSE)
"""Kinds of the IMU and the pose."""

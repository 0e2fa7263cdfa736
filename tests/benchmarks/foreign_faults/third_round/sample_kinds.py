"""Kinds of the third round in the IMU and the pose."""

from typing import Final

from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO, with_gravity
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.third_round import samples, timestamps

_IMU: Final = (
    Kind("gyro in deg/s for a while", samples.gyro_in_degrees_for_a_while, (GYRO,), ("imu:unit_deg_rad",),
         "A driver that is restarted with another parameter.", local=True),
    Kind("axes of the accelerometer exchanged", samples.axes_of_accelerometer_exchanged, (ACCELEROMETER,),
         ("imu:axes_swapped",), "Boards with an accelerometer and a gyro of two makers."),
    Kind("gravity removed by a low-pass", samples.gravity_by_low_pass, (ACCELEROMETER,), ("imu:gravity_missing",),
         "The example for linear acceleration in Android's documentation.", Range(130, 1_700, "ms"),
         debatable="slow accelerations are removed as well"),
    Kind("gravity added twice", with_gravity(1.0), (ACCELEROMETER,), ("imu:gravity_magnitude",),
         "A plugin that adds gravity to what an engine gives as specific force.",
         debatable="gravity is there twice, which is no other planet's"),
    Kind("end of the IMU never filled", samples.end_never_filled, ("path/imu",), ("imu:truncated",),
         "np.zeros of the expected length, and a recorder that stops before.", Range(7, 41, "%"),
         debatable="rows are there, and are zero"),
    Kind("range of the gyro changes for a while", samples.range_of_gyro_changes_for_a_while, (GYRO,), (),
         "FS_SEL of an MPU-6050, which a reset of the chip clears.", local=True),
)  # fmt: skip

_POSE: Final = (
    Kind("pose in ticks of Windows", timestamps.in_ticks_of_windows, ("path/pose/ts",), ("pose:quantised_time",),
         "GetTickCount, which counts interrupts of 15.625 ms.",
         debatable="on the mean, poses are also early by half a tick"),
    Kind("pose clock set back", timestamps.set_back, ("path/pose",), ("pose:time_offset",),
         "NTP on a computer for motion capture; a merge sorts afterwards.", Range(11, 67, "ms"), local=True,
         debatable="poses of two times lie among each other around the step"),
    Kind("pose without leading zeros", timestamps.without_leading_zeros, ("path/pose/ts",), (),
         "printf with %d.%d for seconds and microseconds.",
         debatable="unsorted describes the timestamps, but sorting does not repair them"),
    Kind("positions alone from a lower rate", samples.positions_of_lower_rate, (POSITION,), ("pose:interpolated_pose",),
         "GNSS beside an attitude filter, joined by np.interp.", Range(2.3, 13, "Hz")),
    Kind("positions elsewhere for a while", samples.positions_elsewhere_for_a_while, (POSITION,), ("pose:teleport",),
         "GNSS near a wall, and fiducials that are taken for others.", Range(0.11, 1.7, "m"), local=True),
    Kind("order of quaternions converted twice", samples.order_converted_twice, (ORIENTATION,),
         ("pose:quaternion_order",), "A loader and a script that both convert to w first."),
    Kind("quaternions averaged across signs", samples.averaged_across_signs, (ORIENTATION,),
         ("pose:quaternion_not_unit",), "Moving averages of quaternions of motion capture.",
         Range(3, 11, "samples", whole=True), debatable="attitudes are smoothed as well"),
    Kind("attitude alone in NED", samples.attitude_alone_in_ned, (ORIENTATION,), ("pose:frame_convention",),
         "PX4's attitude beside positions of MAVROS."),
    Kind("pose behind a low-pass", samples.behind_a_low_pass, POSE, ("pose:time_offset",),
         "Exponential smoothing in a tracker's client.", Range(7, 43, "ms"),
         debatable="poses are smoothed as well as late"),
    Kind("angles of quaternions not halved", samples.angles_not_halved, (ORIENTATION,), (),
         "A conversion of rotation vectors by hand: cos(a) in place of cos(a / 2)."),
)  # fmt: skip

SAMPLES: Final = (*_IMU, *_POSE)
"""Kinds of the IMU and the pose."""

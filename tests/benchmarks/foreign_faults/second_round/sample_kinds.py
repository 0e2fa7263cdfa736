"""Kinds of the second round in the IMU and the pose."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import QUIET_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import IMU, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.second_round import imu, motion

_IMU: Final = (
    Kind("IMU in wall-clock time", imu.in_wall_clock_time, ("path/imu/ts",), ("imu:clock_rate", "imu:time_unit"),
         "Gazebo below real time, with a plugin that asks the computer for the time.", Range(1.3, 29, "times"),
         debatable="a large factor of the clock resembles a unit"),
    Kind("IMU stamped when its queue is read", imu.stamped_when_queue_is_read, ("path/imu/ts",),
         ("imu:quantised_time",), "Bosch's FIFO, read with an interrupt at its watermark.",
         Range(5, 31, "samples", whole=True), debatable="on the mean, samples are also late by half a queue"),
    Kind("IMU samples lost here and there", imu.lost_here_and_there, ("path/imu",), ("imu:dropped_samples",),
         "I2C transfers that are not acknowledged.", Range(2.3, 19, "%")),
    Kind("IMU of another sequence", clocks.from_donor("imu"), IMU, ("imu:other_sequence",),
         "A CSV that was exported from the bag before."),
    Kind("gravity subtracted along the body", imu.gravity_along_body, (ACCELEROMETER,), ("imu:gravity_missing",),
         "A script that takes 9.81 from az."),
    Kind("accelerometer with the sign of iOS", imu.accelerometer_negated, (ACCELEROMETER,), ("imu:gravity_sign",),
         "Core Motion, whose sign is the opposite of Android's.",
         debatable="accelerations have the other sign too, which no convention of axes describes"),
    Kind("IMU in Unity's axes", imu.in_axes_of_unity, IMU, ("imu:frame_convention",),
         "Unity's IMU sensors, which publish without conversion to ROS."),
    Kind("accelerometer zeroed on a slope", imu.zeroed_on_a_slope, (ACCELEROMETER,), ("imu:accel_bias",),
         "Calibration at start of a vehicle that is not level, or not at rest.", Range(31, 290, "samples", whole=True)),
    Kind("gyro zeroed in motion", imu.zeroed_in_motion, (GYRO,), ("imu:gyro_bias",),
         "Calibration at start of a vehicle that turns already.", Range(31, 290, "samples", whole=True)),
    Kind("bias of the gyro walks", imu.bias_walks, (GYRO,), ("imu:noise_misdeclared", "imu:gyro_bias"),
         "Gazebo's dynamic bias, which nothing declares.", Range(0.013, 0.19, "rad/s"),
         debatable="a walk is a noise that nothing declares, and also a bias that changes"),
    Kind("IMU noisy for a while", imu.noisy_for_a_while, IMU, ("imu:noise_misdeclared",),
         "Wheels on gravel, and rotors near the ground.", Range(0.017, 0.23, "rad/s"), local=True),
    Kind("noise of the IMU declared, not added", imu.noise_declared, ("metadata/imu",), ("imu:noise_misdeclared",),
         "Kalibr's default densities beside samples of an ideal sensor.", Range(0.0011, 0.017, "rad/s/sqrt(Hz)"),
         scenes=QUIET_SCENES),
    Kind("gyro as rates of angles", imu.rates_of_angles, (GYRO,), (), "Differences of angles in a game.",
         scenes=QUIET_SCENES, debatable="where roll and pitch are small, the rates are nearly right"),
    Kind("IMU upsampled", imu.upsampled, IMU, (), "A resampler that brings 100 or 200 Hz to the rate of a file.",
         Range(71, 330, "Hz")),
    Kind("acceleration of the body's velocity", imu.without_turning_of_velocity, (ACCELEROMETER,), (),
         "Simulators that differentiate u, v and w.", scenes=QUIET_SCENES),
    Kind("gyro wraps", imu.gyro_wraps, (GYRO,), (), "A sum in 16 bits that overflows.", Range(41, 83, "%")),
)  # fmt: skip

_POSE: Final = (
    Kind("pose in Unity's axes", motion.in_axes_of_unity, POSE, ("pose:frame_convention",),
         "Unity's Transform, written as it is."),
    Kind("body of the pose downwards", motion.body_downwards, (ORIENTATION,), ("pose:frame_convention",),
         "MAVROS with one of the two conversions from NED and FRD."),
    Kind("heading from north", motion.heading_from_north, (ORIENTATION,), ("pose:frame_convention",),
         "Yaw of an INS, which counts as a compass does."),
    Kind("height downwards", motion.height_downwards, (POSITION,), ("pose:frame_convention",),
         "The D of NED beside east and north.", debatable="the world is mirrored, which no convention of axes does"),
    Kind("north before east", motion.north_before_east, (POSITION,), ("pose:axes_swapped",),
         "Tables of surveyors, and latitude before longitude."),
    Kind("pose over a network", motion.over_a_network, POSE, ("pose:quantised_values",),
         "Unreal's NetQuantize, and Unity's compressed quaternions.", Range(7, 12, "bits", whole=True)),
    Kind("quaternions in half precision", motion.in_half_precision, (ORIENTATION,),
         ("pose:quantised_values", "pose:quaternion_not_unit"), "glTF animations and textures of poses.",
         debatable="rounding by component changes the length as well"),
    Kind("pose extrapolated", motion.extrapolated, POSE, ("pose:interpolated_pose",),
         "Dead reckoning of a multiplayer engine between packets.", Range(7, 43, "Hz"),
         debatable="poses of a lower rate are extrapolated, not interpolated"),
    Kind("pose through keyframes", motion.through_keyframes, POSE, ("pose:interpolated_pose",),
         "Blender's F-curves and splines of a trajectory editor.", Range(5, 31, "Hz")),
    Kind("poses overtake each other", motion.overtake_each_other, ("path/pose",), ("pose:unsorted",),
         "VRPN over UDP.", local=True),
    Kind("markers hidden for a while", motion.markers_hidden, POSE, ("pose:nan_in_stream",),
         "OptiTrack and Vicon, which give NaN where they lose a body.", local=True),
    Kind("position noisy for a while", motion.noisy_for_a_while, (POSITION,), ("pose:noise_misdeclared",),
         "RTK that falls back to a float solution under trees.", Range(3.1, 61, "mm"), local=True),
    Kind("pose by columns", motion.by_columns, POSE, ("pose:wrong_shape",), "MATLAB's h5write."),
    Kind("position in degrees of latitude", motion.in_degrees_of_latitude, (POSITION,), (), "NavSatFix as a position.",
         debatable="unit_mm_m means another unit of length, and degrees are none"),
    Kind("odometry accumulates", motion.odometry_accumulates, (POSITION,), (), "Odometry as ground truth.",
         Range(0.013, 0.37, "m"), debatable="noise_misdeclared describes white noise, and this one accumulates"),
    Kind("way of grid north", motion.way_of_grid_north, (POSITION,), (),
         "UTM positions beside attitudes of a compass.", Range(1.3, 11, "deg", signed=True)),
)  # fmt: skip

SAMPLES: Final = (*_IMU, *_POSE)
"""Kinds of the IMU and the pose."""

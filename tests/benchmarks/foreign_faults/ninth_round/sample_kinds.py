"""Kinds of the ninth round in the IMU and the pose."""

from math import pi
from typing import Final

from tests.benchmarks.foreign_faults import inertial
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.ninth_round import samples
from tests.benchmarks.foreign_faults.paths import IMU, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

_IMU: Final = (
    Kind("outliers of the IMU removed", samples.outliers_removed, ("path/imu",), ("imu:dropped_samples",),
         "A cleaning of tables by deviations from the mean, as tutorials of pandas show it.", Range(2, 12, "%")),
    Kind("gyro behind a high-pass", samples.gyro_behind_a_high_pass, (GYRO,), ("imu:gyro_bias",),
         "A filter against drift, in drivers of action cameras and gimbals.", Range(0.05, 0.5, "Hz"),
         debatable="what is lacking follows the motion, slowly"),
    Kind("gravity removed by a late attitude", samples.gravity_removed_by_a_late_attitude, (ACCELEROMETER,),
         ("imu:gravity_missing",), "An attitude filter that gives linear acceleration.", Range(60, 300, "ms")),
    Kind("accelerometer of the other sign for a while", samples.accelerometer_of_the_other_sign_for_a_while,
         (ACCELEROMETER,), ("imu:gravity_sign",), "Logs of two apps, for Android and for iOS, joined by time.",
         local=True),
    Kind("gyro in radians twice", inertial.multiplied(GYRO, pi / 180), (GYRO,), ("imu:unit_deg_rad",),
         "np.deg2rad on the output of a driver that gives rad/s."),
    Kind("gap of the IMU reindexed", samples.gap_of_the_imu_reindexed, IMU,
         ("imu:nan_in_stream", "imu:dropped_samples"), "pandas' reindex to an even grid of times.",
         Range(15, 110, "samples", whole=True), local=True, debatable="what is not a number was lost before"),
    Kind("IMU by differences of poses", samples.imu_by_differences_of_poses, IMU, ("imu:noise_misdeclared",),
         "Scripts that add an IMU to a data set with poses alone.", Range(55, 255, "ms"), scenes=("park-noisy",),
         debatable="motion is smoothed as well"),
    Kind("axis of the gyro in another range", samples.axis_of_the_gyro_in_another_range, (GYRO,), (),
         "Boards with a gyro of two axes and another of one."),
)  # fmt: skip

_POSE: Final = (
    Kind("components of quaternions interpolated", samples.components_interpolated, (ORIENTATION,),
         ("pose:interpolated_pose", "pose:quaternion_not_unit"), "np.interp and pandas' interpolate on four columns.",
         Range(2, 6, "Hz"), debatable="straight lines between rotations leave the unit sphere, and are short"),
    Kind("pose predicted for a display", samples.predicted, POSE, ("pose:time_offset",),
         "OpenXR and ARKit, whose poses are those of the time at which a frame will be displayed.",
         Range(14, 48, "ms"), debatable="what changes in between is not predicted"),
    Kind("pose of keyframes", samples.of_keyframes, ("path/pose",), ("pose:dropped_samples",),
         "SLAM, which keeps a pose where the view has changed.", Range(0.02, 0.09, "m"),
         debatable="the rate follows the motion, and no sample was lost by accident"),
    Kind("pose of CARLA", samples.of_carla, POSE, ("pose:frame_convention",),
         "CARLA's transforms, which are left-handed, in metres."),
    Kind("pose in NED for a while", samples.in_ned_for_a_while, POSE, ("pose:frame_convention",),
         "Two bridges of PX4, of MAVROS and of XRCE-DDS, in parts of a log.", local=True),
    Kind("position stalls beside attitude for a while", samples.position_stalls_for_a_while, (POSITION,),
         ("pose:frozen_frames",), "GNSS under a bridge, beside an attitude filter that goes on.", local=True),
    Kind("quaternions of another fixed point", samples.quaternions_of_other_fixed_point, (ORIENTATION,),
         ("pose:quaternion_not_unit",), "BNO055, whose quaternions are in 2^-14, read as int16 of full scale."),
)  # fmt: skip

SAMPLES: Final = (*_IMU, *_POSE)
"""Kinds of the IMU and the pose."""

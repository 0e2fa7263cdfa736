"""Kinds of the fifth round in the IMU and the pose."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks, inertial
from tests.benchmarks.foreign_faults.fifth_round import samples, timestamps
from tests.benchmarks.foreign_faults.fourth_round.sample_kinds import NOISY_SCENES
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import IMU, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

_IMU: Final = (
    Kind("IMU clock corrected at intervals", timestamps.corrected_at_intervals, ("path/imu/ts",),
         ("imu:clock_rate", "imu:time_offset"), "Messages of TIMESYNC, between which a slow crystal runs on.",
         Range(3.1, 11, "ms"), debatable="the rate is wrong between two corrections, and right on the mean"),
    Kind("IMU in ticks of a watch crystal", clocks.in_unit("imu", 0.032768), ("path/imu/ts",), ("imu:time_unit",),
         "Real-time clocks of microcontrollers, which count 32768 a second."),
    Kind("gravity removed for a while", samples.gravity_removed_for_a_while, (ACCELEROMETER,),
         ("imu:gravity_missing",), "A driver that is restarted with another type of sensor.", local=True),
    Kind("reads of the IMU fail", samples.reads_fail, IMU, ("imu:nan_in_stream",),
         "Transfers by I2C that time out, logged as NaN.", Range(0.9, 7.3, "%")),
    Kind("IMU mounted backwards", inertial.in_axes((-1, 0, 0), (0, -1, 0), (0, 0, 1)), IMU,
         ("imu:frame_convention",), "A flight controller whose arrow points to the tail."),
    Kind("densities and walks of the IMU exchanged", samples.densities_and_walks_exchanged, ("metadata/imu",),
         ("imu:noise_misdeclared",), "Lines of Kalibr's imu.yaml in another order.", scenes=NOISY_SCENES),
)  # fmt: skip

_POSE: Final = (
    Kind("yaw interpolated through its jump", samples.yaw_through_its_jump, (ORIENTATION,),
         ("pose:interpolated_pose",), "np.interp on angles of a compass, from 0 to 360 degrees.",
         Range(11, 47, "Hz"), debatable="across the jump the attitude turns around once"),
    Kind("attitude noisy for a while", samples.attitude_noisy_for_a_while, (ORIENTATION,),
         ("pose:noise_misdeclared",), "Motion capture that sees three markers near a line.",
         Range(13, 53, "mrad"), local=True),
    Kind("pose from the centre of the earth", samples.from_the_centre_of_the_earth, POSE,
         ("pose:frame_convention",), "ECEF of GNSS and Cesium."),
    Kind("pose of another body for a while", clocks.from_donor("pose"), POSE,
         ("pose:other_sequence", "pose:teleport"), "Motion capture that takes two vehicles for each other.",
         local=True, debatable="poses are of another flight, and jump to it and back"),
    Kind("quaternions reversed", samples.quaternions_reversed, (ORIENTATION,), ("pose:quaternion_order",),
         "memcpy of a structure whose fields are declared in reverse order."),
    Kind("height in feet", samples.height_in_feet, (POSITION,), ("pose:unit_mm_m",),
         "Altitude of aviation beside metres on the ground.", debatable="east and north are in metres"),
    Kind("roll and pitch exchanged", samples.roll_and_pitch_exchanged, (ORIENTATION,),
         ("pose:axes_swapped", "pose:frame_convention"), "Messages that give pitch first, read as roll, pitch, yaw.",
         debatable="two angles are exchanged, which are rotations about two axes"),
    Kind("variances declared as noise of the pose", samples.variances_of_noise, ("metadata/pose",),
         ("pose:noise_misdeclared",), "Diagonals of a covariance in PoseWithCovariance.", scenes=NOISY_SCENES),
    Kind("attitude left out", samples.attitude_left_out, (ORIENTATION,), ("pose:missing_stream",),
         "Trackers of single points, as GNSS and total stations."),
)  # fmt: skip

SAMPLES: Final = (*_IMU, *_POSE)
"""Kinds of the IMU and the pose."""

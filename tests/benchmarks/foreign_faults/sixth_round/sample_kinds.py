"""Kinds of the sixth round in the IMU and the pose."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks, inertial, poses
from tests.benchmarks.foreign_faults.fourth_round.sample_kinds import NOISY_SCENES
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import QUIET_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.sixth_round import samples, timestamps

_IMU_TIME: Final = ("path/imu/ts",)

_IMU: Final = (
    Kind("gyro in degrees of its driver", inertial.multiplied(GYRO, 57.295_779_513), (GYRO,), ("imu:unit_deg_rad",),
         "Drivers of Septentrio, ZED, u-blox and MPU-6050 for ROS (septentrio_gnss_driver issue 104)."),
    Kind("gravity added", inertial.with_gravity(-2.0), (ACCELEROMETER,), ("imu:gravity_sign",),
         "UnitySensors, which added gravity to acceleration where Gazebo subtracts it (issue 116).",
         scenes=QUIET_SCENES),
    Kind("gravity left out by a plugin", inertial.with_gravity(-1.0), (ACCELEROMETER,), ("imu:gravity_missing",),
         "gazebo_ros_imu, in whose place gazebo_ros_imu_sensor has gravity (LIO-SAM issue 136).",
         scenes=QUIET_SCENES),
    Kind("gravity of the sensor alone", samples.gravity_of_the_sensor, (ACCELEROMETER,),
         ("imu:gravity_magnitude", "metadata:gravity_magnitude"),
         "Gazebo, whose IMU did not follow the gravity of the world (gz-sensors issue 569).",
         Range(0.02, 8.2, "m/s^2", signed=True), scenes=QUIET_SCENES),
    Kind("densities of single samples", samples.densities_of_samples, ("metadata/imu",), ("imu:noise_misdeclared",),
         "VINS and Kalibr, one of which means deviations of samples, the other densities (VINS-Mono issue 102).",
         scenes=NOISY_SCENES),
    Kind("IMU dated back", timestamps.imu_back_dated, _IMU_TIME, ("imu:time_offset",),
         "zed-ros2-wrapper, whose times of the IMU were up to 0.8 s too early (issue 206).", Range(20, 800, "ms")),
    Kind("times of the IMU occur twice for a while", timestamps.imu_time_of_the_sample_before, _IMU_TIME,
         ("imu:duplicated_samples", "imu:quantised_time"),
         "zed-ros-wrapper, which published some samples with the time of the one before (issue 577).",
         Range(10, 60, "%"), local=True, debatable="samples are right, and only times occur twice"),
    Kind("time of the IMU counted twice", timestamps.imu_time_twice, _IMU_TIME, ("imu:clock_rate", "imu:time_unit"),
         "libcaer_driver, which added the sensor's time to the system's time of the message (issue 12).",
         debatable="a clock of twice the rate is one of another unit"),
    Kind("accelerometer of gravity alone", samples.gravity_alone, (ACCELEROMETER,), (),
         "Gazebo, whose IMU reported no acceleration of a robot driven by velocity (gz-sim issue 2974).",
         scenes=QUIET_SCENES),
    Kind("velocity differenced in the body", samples.velocity_differenced_in_the_body, (ACCELEROMETER,), (),
         "Isaac Sim, which turned velocity into the body before it took differences (issue 735).",
         scenes=QUIET_SCENES),
    Kind("times of the IMU scatter for a while", timestamps.imu_scatters_for_a_while, _IMU_TIME, (),
         "zed-ros2-wrapper, whose samples are not at a constant rate (issue 445).", Range(0.4, 4, "ms"), local=True),
)  # fmt: skip

_POSE: Final = (
    Kind("quaternions of Sophus", poses.scalar_first, (ORIENTATION,), ("pose:quaternion_order",),
         "Aria Digital Twin, whose columns x, y, z, w held w, x, y, z (projectaria_tools issue 7)."),
    Kind("quaternions through coeffs()", samples.quaternions_moved_round, (ORIENTATION,), ("pose:quaternion_order",),
         "AirSim with Eigen, whose constructor takes w first and whose coefficients end with it (issue 2339)."),
    Kind("pose as the simulator's NED", poses.north_east_down, POSE, ("pose:frame_convention",),
         "AirSim and TartanAir (tartanair_tools issue 37)."),
    Kind("pose of the markers", poses.elsewhere, (POSITION,), ("pose:lever_arm",),
         "EuRoC, Hilti and AR Table, whose motion capture gives markers (Hilti 2021 issue 3).", Range(0.05, 0.6, "m")),
    Kind("ground truth on its own clock", clocks.delayed("pose"), ("path/pose/ts",), ("pose:time_offset",),
         "UZH-FPV, whose ground truth was off by about 100 ms (IROS2019-FPV issue 6).",
         Range(20, 110, "ms", signed=True)),
    Kind("ground truth lost for a while", samples.poses_lost_for_a_while, (*POSE, "path/pose/ts"),
         ("pose:dropped_samples",), "NTU VIRAL, whose tracker loses its prism (issue 28).", local=True),
    Kind("ground truth bridged for a while", samples.straight_for_a_while, POSE, ("pose:interpolated_pose",),
         "Gaps of a tracker that are closed by straight lines, as advised for NTU VIRAL (issue 28).", local=True),
    Kind("some poses not a number", samples.poses_not_a_number, POSE, ("pose:nan_in_stream",),
         "BotanicGarden, whose ground truth has NaN in one pose (issue 20).", Range(1, 6, "poses", whole=True)),
    Kind("ground truth noisy for a while", samples.noisy_for_a_while, POSE, ("pose:noise_misdeclared",),
         "LaMAR, whose raw trajectories are very noisy in parts (issue 95).", Range(5, 80, "mm"), local=True),
    Kind("motion capture misreports for a while", samples.misreported_now_and_then, (POSITION,), ("pose:teleport",),
         "EVIMO2, where Vicon misreports the place of an object for a few samples (issue 18).",
         Range(0.05, 2, "m"), local=True),
)  # fmt: skip

SAMPLES: Final = (*_IMU, *_POSE)
"""Kinds of the IMU and the pose."""

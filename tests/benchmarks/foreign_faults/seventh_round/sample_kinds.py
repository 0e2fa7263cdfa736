"""Kinds of the seventh round in the IMU and the pose."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks, inertial
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import IMU, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.seventh_round import samples, timestamps

_IMU: Final = (
    Kind("IMU turned a quarter", inertial.in_axes((0, 1, 0), (-1, 0, 0), (0, 0, 1)), IMU,
         ("imu:frame_convention", "imu:axes_swapped"), "A board whose connector points to the side.",
         debatable="X and Y are exchanged, and one of them has the other sign"),
    Kind("IMU in the axes of EuRoC", inertial.in_axes((0, 0, 1), (0, -1, 0), (1, 0, 0)), IMU,
         ("imu:frame_convention",), "EuRoC, whose body is that of the IMU, with X upwards."),
    Kind("gyro alone in FRD", samples.gyro_in_frd, (GYRO,), ("imu:frame_convention",),
         "Bridges of PX4 and AirSim that convert the accelerometer alone."),
    Kind("gyro behind a low-pass", samples.gyro_behind_a_low_pass, (GYRO,), ("imu:time_offset",),
         "A causal filter of the gyro alone.", Range(3, 24, "ms"), debatable="fast turns are also damped"),
    Kind("last batch of the IMU lost", clocks.cut("imu"), ("path/imu",), ("imu:truncated",),
         "A buffer that is not flushed when the node ends.", Range(8, 46, "%")),
    Kind("IMU in the order of text", samples.by_text_of_times, ("path/imu",), ("imu:unsorted",),
         "Tables whose column of times is sorted as text."),
    Kind("mean of the accelerometer taken off", samples.mean_taken_off, (ACCELEROMETER,), ("imu:gravity_missing",),
         "detrend of scipy, or a normalisation for learning.",
         debatable="the mean acceleration is taken off as well"),
    Kind("IMU decimated for a while", samples.decimated_for_a_while, ("path/imu",), ("imu:dropped_samples",),
         "throttle of topic_tools, on a part of a recording.", Range(2, 8, "samples", whole=True), local=True),
)  # fmt: skip

_POSE: Final = (
    Kind("attitude of Blender's camera", samples.attitude_of_blenders_camera, (ORIENTATION,),
         ("pose:frame_convention",), "Blender, Unity's glTF and NeRF, whose cameras look along -Z with Y upwards."),
    Kind("pose with Y upwards, right-handed", samples.y_upwards, POSE, ("pose:frame_convention",),
         "glTF, FBX and Habitat, whose worlds have Y upwards."),
    Kind("pose as KITTI's", samples.in_camera_axes, POSE, ("pose:frame_convention",),
         "KITTI's odometry, whose world has the axes of the first camera."),
    Kind("pose of the gimbal", samples.of_the_gimbal, (ORIENTATION,), (),
         "tf of another link, which is pitched against the body.", Range(4, 42, "deg", signed=True),
         debatable="frame_convention means axes, and the angle is of no convention"),
    Kind("pose in wall time", timestamps.pose_in_wall_time, ("path/pose/ts",), ("pose:clock_rate",),
         "use_sim_time that one node does not have, beside a slow simulation.", Range(1.3, 32, "times")),
    Kind("pose in hundredths of seconds", timestamps.pose_in_hundredths, ("path/pose/ts",), ("pose:quantised_time",),
         "TUM's text of trajectories, written with two decimals."),
    Kind("attitude from a lower rate", samples.attitude_of_lower_rate, (ORIENTATION,), ("pose:interpolated_pose",),
         "Slerp between keyframes of an engine, beside positions of its physics.", Range(4, 28, "Hz")),
    Kind("position in half precision", samples.position_in_half_precision, (POSITION,), ("pose:quantised_values",),
         "Arrays of a network in float16.", Range(9, 240, "m")),
    Kind("pose in single precision", samples.pose_in_single_precision, POSE, ("pose:wrong_dtype",),
         "Unity and Unreal, whose transforms are float32."),
    Kind("attitude as matrices", samples.attitude_as_matrices, (ORIENTATION,), ("pose:wrong_shape",),
         "MVSEC and M3ED, whose poses are matrices."),
    Kind("quaternions w first for a while", samples.scalar_first_for_a_while, (ORIENTATION,),
         ("pose:quaternion_order",), "Two scripts, of EuRoC's order and of TUM's, for parts of a trajectory.",
         local=True),
)  # fmt: skip

SAMPLES: Final = (*_IMU, *_POSE)
"""Kinds of the IMU and the pose."""

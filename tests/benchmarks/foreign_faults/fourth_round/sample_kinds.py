"""Kinds of the fourth round in the IMU and the pose."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks
from tests.benchmarks.foreign_faults.fourth_round import samples, timestamps
from tests.benchmarks.foreign_faults.inertial import GYRO
from tests.benchmarks.foreign_faults.kind import QUIET_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import IMU, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION

NOISY_SCENES: Final = ("park-noisy",)
"""Scenes whose sensors have noise."""

_IMU: Final = (
    Kind("IMU samples lost and renumbered", timestamps.lost_and_renumbered, ("path/imu",),
         ("imu:dropped_samples", "imu:clock_rate"), "Logs that count samples, over a radio link that loses some.",
         Range(3.1, 14, "%"), debatable="samples are absent, and what is left comes at a wrong rate"),
    Kind("IMU averaged backwards", samples.averaged_backwards, IMU, ("imu:time_offset",),
         "Averaging filters of ADIS164xx, whose delay nobody subtracts.", Range(7, 43, "ms"),
         debatable="samples are smoothed as well as late"),
    Kind("IMU of another sequence for a while", clocks.from_donor("imu"), IMU, ("imu:other_sequence",),
         "A bag that is played while the live topic is recorded.", local=True),
    Kind("rate of yaw clockwise", samples.yaw_rate_clockwise, (GYRO,), ("imu:frame_convention",),
         "A controller whose rudder is positive to the right."),
    Kind("densities of the IMU as in data sheets", samples.densities_of_data_sheet, ("metadata/imu",),
         ("imu:noise_misdeclared",), "Data sheets, which give deg/s and micro-g per root of a hertz.",
         scenes=NOISY_SCENES),
    Kind("IMU in counts", samples.in_counts, IMU, (), "Registers of an MPU-6050, logged as they are.",
         debatable="the gyro is in deg/s times a factor, and the accelerometer in another unit as well"),
    Kind("gyro with a dead band", samples.within_dead_band, (GYRO,), (),
         "Controllers of games and gimbals, which ignore small rates.", Range(0.031, 0.23, "rad/s")),
)  # fmt: skip

_POSE: Final = (
    Kind("setpoints in place of poses", samples.of_setpoints, POSE, ("pose:time_offset",),
         "Topics of an autopilot for what it wants, which the vehicle follows.", Range(13, 71, "ms"),
         scenes=QUIET_SCENES, debatable="a setpoint is a prediction, which is not quite the later pose"),
    Kind("body of the pose with Y forward", samples.body_with_y_forward, (ORIENTATION,),
         ("pose:frame_convention",), "NovAtel's SPAN, whose vehicle is X right, Y forward, Z up."),
    Kind("attitude frozen beside positions", samples.attitude_frozen_for_a_while, (ORIENTATION,),
         ("pose:frozen_frames",), "An attitude filter that stalls, joined to GNSS by its latest message.",
         local=True),
    Kind("base stations take turns", samples.base_stations_take_turns, (POSITION,), ("pose:teleport",),
         "Lighthouses, of which one is hidden at times, and whose calibrations differ.", Range(0.037, 0.41, "m")),
    Kind("poses of fast turns left out", samples.fast_turns_left_out, ("path/pose",), ("pose:dropped_samples",),
         "Visual tracking, which gives no pose where images are blurred.", Range(7, 31, "%")),
    Kind("pose at the origin until it is tracked", samples.at_the_origin_until_tracked, POSE,
         ("pose:frozen_frames", "pose:teleport"), "ARKit and tf buffers, which give the identity at first.",
         local=True, debatable="poses stand still, and jump when tracking starts"),
    Kind("noise of the rotation declared in degrees", samples.rotation_noise_in_degrees, ("metadata/pose",),
         ("pose:noise_misdeclared",), "Configurations of simulators, whose angles are degrees.",
         scenes=NOISY_SCENES),
    Kind("attitude of yaw alone", samples.attitude_of_yaw_alone, (ORIENTATION,), (),
         "base_footprint of ROS, and planners in the plane."),
)  # fmt: skip

SAMPLES: Final = (*_IMU, *_POSE)
"""Kinds of the IMU and the pose."""

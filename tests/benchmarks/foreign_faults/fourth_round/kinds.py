"""The fourth round: kinds of faults that were written when the first three had been looked at."""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import clocks, images, inertial, poses, sensor
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.fourth_round import declarations, events, flow, timestamps
from tests.benchmarks.foreign_faults.fourth_round.image_kinds import IMAGES
from tests.benchmarks.foreign_faults.fourth_round.sample_kinds import NOISY_SCENES, SAMPLES
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, DEPTH_MAP, EVENT_TIME, EVENTS, FLOW, IMU, POSE
from tests.benchmarks.foreign_faults.poses import POSITION
from tests.benchmarks.foreign_faults.third_round.kinds import LOGARITHMIC_SCENES

_EVENTS: Final = (
    Kind("threshold grows across the sensor", events.threshold_grows_across, EVENTS,
         ("events:threshold_misdeclared",), "Bias voltages that fall along a line of the sensor.",
         Range(53, 230, "%"), scenes=LOGARITHMIC_SCENES),
    Kind("window with other biases for a while", events.window_with_other_biases, EVENTS,
         ("events:threshold_misdeclared",), "Regions of interest with a sensitivity of their own.",
         Range(1.6, 3.7, "times"), local=True, scenes=LOGARITHMIC_SCENES,
         debatable="outside the window the threshold is the declared one"),
    Kind("events of two recorders", events.of_two_recorders, EVENTS, ("events:duplicated_samples",),
         "Two nodes that record one topic, each with the time of its arrival, in one bag.", Range(31, 900, "us")),
    Kind("events at random times between frames", timestamps.at_random_times_between_frames, EVENTS,
         ("events:time_jitter", "events:interpolated_frames"),
         "Simulators that sample times between frames at random, as V2CE can.",
         debatable="times are random, and follow from frames alone"),
    Kind("pause of events cut out", timestamps.pause_cut_out, EVENTS,
         ("events:dropped_samples", "events:time_offset"), "Editors that cut a recording, and close the gap.",
         Range(5.3, 61, "ms"), local=True,
         debatable="events are absent, and the following ones are early: both names describe the fault"),
    Kind("events enlarged from the middle", events.enlarged, EVENTS, ("metadata:intrinsics_focal",),
         "Rectification to another focal length, which the file's K does not follow.",
         Range(5.3, 17, "%", signed=True)),
    Kind("crosstalk between pixels", events.crosstalk, EVENTS, ("events:noise_misdeclared",),
         "Capacitive coupling of neighbouring pixels, as ICNS measures it.", Range(7, 47, "%"),
         debatable="the added events follow events, and noise does not"),
    Kind("events stamped when they leave a queue", timestamps.when_they_leave_a_queue, EVENTS,
         ("events:time_jitter", "events:time_offset"), "Readouts without timestamps in the pixel array.",
         Range(111, 123, "%"), debatable="lateness is not constant, and follows from how many events there are"),
    Kind("half of the sensor late for a while", timestamps.half_of_sensor_late_for_a_while, EVENTS,
         ("events:time_offset",), "Two readout links, one of which is not aligned after it has lost its lock.",
         Range(2.9, 23, "ms"), local=True, debatable="events of the other half have their own times"),
    Kind("darker events late", timestamps.darker_late, EVENTS, ("events:time_offset",),
         "Comparators with unequal currents, which make one polarity slow.", Range(2.3, 17, "ms"),
         debatable="events of the other polarity have their own times"),
    Kind("rows of events exchanged in pairs", events.rows_exchanged_in_pairs, EVENTS, (),
         "A row address whose lowest line is inverted.",
         debatable="spatial_offset describes a shift, and every other row moves the other way"),
    Kind("bits of polarity flip for a while", events.bits_of_polarity_flip, ("path/events/p",), (),
         "A link without checksums beside a radio.", Range(13, 43, "%"), local=True,
         debatable="polarity_inverted describes all events, and these are some at random"),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("angles of mountings in degrees", declarations.angles_of_mountings_in_degrees, ("metadata/cameras",),
         ("metadata:extrinsic_rotation",), "rpy of a URDF, which is in radians, filled in with -90 0 -90."),
    Kind("light constant declared, not added", declarations.linear_below_declared, ("metadata/events",),
         ("events:event_model_misdeclared",), "v2e's linear part of its logarithm, in a copied description.",
         Range(13, 53, "DN"), scenes=LOGARITHMIC_SCENES,
         debatable="both models are logarithmic, with another constant"),
    Kind("hot pixels listed row first", declarations.hot_pixels_row_first, ("metadata/events",),
         ("events:hot_pixels", "metadata:axes_swapped"), "np.argwhere on an image of counts.", scenes=NOISY_SCENES,
         debatable="hot pixels are not listed, because the axes of the list are exchanged"),
    Kind("K as nine numbers", declarations.nine_numbers, ("metadata/cameras",), ("metadata:wrong_shape",),
         "camera_info of ROS, whose K is flat."),
    Kind("depth map in 32 bits", declarations.depth_map_in_32_bits, (DEPTH_MAP,), ("depth_to_event:wrong_dtype",),
         "NumPy before 2.0 on Windows, whose integers have 32 bits."),
    Kind("colour map as a column", declarations.colour_map_as_column, (COLOUR_MAP,), ("rgb_to_event:wrong_shape",),
         "pandas, whose to_numpy of a table with one column has two dimensions."),
    Kind("depth map to the nearest event", declarations.depth_map_to_nearest, (DEPTH_MAP,), (),
         "MVSEC's image_raw_event_inds.",
         debatable="index_off_by_one describes a constant shift, and some of these entries are right"),
)  # fmt: skip

_COMPOSITES: Final = (
    Kind("events in nanoseconds, and their axes exchanged", both(clocks.in_unit("events", 1e3), sensor.axes_exchanged),
         (*EVENT_TIME, "path/events/x", "path/events/y"), ("events:time_unit", "events:axes_swapped"),
         "A bag of ROS 2 through an array of rows and columns.", composite=True),
    Kind("quaternions w first, and position in millimetres", both(poses.scalar_first, images.scaled(POSITION, 1e3)),
         POSE, ("pose:quaternion_order", "pose:unit_mm_m"), "Exports of Qualisys and Vicon.", composite=True),
    Kind("gyro bias, and accelerometer bias",
         both(inertial.biased(GYRO), inertial.biased(ACCELEROMETER), Range(0.17, 1.3, "m/s^2")), IMU,
         ("imu:gyro_bias", "imu:accel_bias"), "A cheap chip, as it comes.", Range(0.017, 0.13, "rad/s"),
         composite=True),
    Kind("depth along rays in metres", both(images.along_rays, images.scaled("path/depth", 1e-3)), ("path/depth",),
         ("depth:depth_ray_not_z", "depth:unit_mm_m"), "distance_to_camera of Isaac Sim.", composite=True),
    Kind("depth and flow upside down", both(images.flipped("path/depth", 1), flow.upside_down),
         ("path/depth", *FLOW), ("depth:mirrored", "flow:mirrored"),
         "Render textures of OpenGL for all that is not colour.", composite=True),
)  # fmt: skip

FOURTH_ROUND: Final = tuple(
    replace(kind, round=4) for kind in (*_EVENTS, *IMAGES, *SAMPLES, *_DECLARATIONS, *_COMPOSITES)
)
"""Kinds of the fourth round, in the order of streams."""

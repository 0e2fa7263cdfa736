"""The eleventh round: kinds of faults that follow public reports, in the proportion in which they were met.

Each kind cites its report. 34 have a name, 6 have none, and 4 are of two faults.
"""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import clocks, sensor
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.eleventh_round import declarations, events, flow, frames, samples
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import QUIET_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENTS, FLOW, IMU, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION

_IMU_TIME: Final = ("path/imu/ts",)

_EVENTS: Final = (
    Kind("event times in numbers of renders", events.numbers_of_renders, EVENTS,
         ("events:time_unit", "events:quantised_time"),
         "EventNeRF, whose event times are the numbers of rendered frames (issue 7).", Range(310, 1900, "renders/s"),
         debatable="the unit is a render, and all events of a render share a time"),
    Kind("high words of time read as vectors", events.high_words_as_vectors, EVENTS, ("events:noise_misdeclared",),
         "OpenEB, which took the next high word of time for the end of an incomplete vector (issue 111).",
         Range(0.9, 13, "%"), debatable="noise has no pattern, and what is added lies in the row of an event"),
    Kind("places of events in 32nds of a pixel", events.in_subpixels, ("path/events/x", "path/events/y"), (),
         "BS-ERGB of Time Lens++, whose columns and rows are 32 times too large (timelens-pp issues 2 and 4).",
         debatable="intrinsics_focal describes an enlargement, and most of these events lie outside the sensor"),
    Kind("some events a second early", events.a_second_early, ("path/events/t",),
         ("events:unsorted", "events:time_offset"),
         "rpg_dvs_ros, in whose bags single events were 0.999 s before those around them (issue 57).",
         Range(3, 130, "events", whole=True), debatable="they are out of order as they are stored, and early"),
    Kind("events of the last run in front", events.begin_with_those_of_the_last_run, ("path/events",),
         ("events:unsorted", "events:other_sequence"),
         "libcaer, where buffers of the device hold events of the last run, with late times (issue 69).",
         Range(130, 4_300, "events", whole=True), debatable="they are out of order, and of another sequence"),
    Kind("samples of frames read as events for a while", events.samples_of_frames, EVENTS,
         ("events:noise_misdeclared",),
         "tonic, whose reader for DAVIS346 did not tell events from samples of frames and the IMU (pull request 291).",
         Range(1.7, 9.1, "ms"), local=True, debatable="they come in the order of the read-out"),
    Kind("pixels leak in step", events.leaks_in_step, EVENTS, ("events:noise_misdeclared",),
         "DVS-Voltmeter, where leakage made all pixels fire at intervals (issue 6).", Range(57, 390, "ms")),
    Kind("rows skipped by full read-outs for a while", events.rows_skipped_by_full_read_outs, EVENTS,
         ("events:dropped_samples",),
         "Sensors of Prophesee, where rows lack events when a scene has too many (OpenEB issue 75).",
         Range(16, 71, "%"), local=True),
    Kind("event of zeros in front", events.event_of_zeros_in_front, ("path/events",),
         ("rgb_to_event:index_off_by_one", "depth_to_event:index_off_by_one"),
         "OpenEB, whose RawReader put an event (0, 0, 0, 0) before the first one after seek_event(0) (issue 61).",
         debatable="both maps are off by the same event, which is the wrong one"),
)  # fmt: skip

_MAPS: Final = (
    Kind("colour map of intervals", events.colour_map_of_intervals, (COLOUR_MAP,),
         ("rgb_to_event:wrong_shape", "rgb_to_event:truncated"),
         "Time Lens, which has an entry of events for each two frames in sequence (rpg_timelens issue 19).",
         debatable="an entry is absent, and it is the last one"),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("K of colour as a matrix of projection", declarations.matrix_of_projection, (CAMERA + "rgb",),
         ("metadata:intrinsics_focal", "metadata:intrinsics_centre"),
         "Unity Perception, whose camera_intrinsic is a part of the matrix of projection (issues 388 and 548).",
         debatable="focal lengths and centre are both in another unit"),
    Kind("cameras at the body's origin", declarations.at_the_origin, ("metadata/cameras",), ("metadata:lever_arm",),
         "Kalibr, whose translation between camera and IMU came out as nearly zero (issue 599)."),
    Kind("X and Y of cameras exchanged", declarations.x_and_y_kept, ("metadata/cameras",),
         ("metadata:axes_swapped", "metadata:frame_convention", "metadata:extrinsic_rotation"),
         "Mid-Air, whose instructions give (z, y, x) of the camera for those of the body (issue 12).",
         debatable="the exchange of two axes is also the wrong mounting, and a left-handed one"),
)  # fmt: skip

_COLOUR: Final = (
    Kind("interleaved colour read as planes", frames.interleaved_read_as_planes, ("path/rgb",), (),
         "pyaer, which read frames of a DAVIS346 for colour as if they were grey: all is there three times (issue 9).",
         debatable="channels are in no order at all"),
    Kind("lines of the mosaic lost for a while", frames.lines_of_the_mosaic_lost, ("path/rgb",),
         ("rgb:channel_order", "rgb:spatial_offset"),
         "Cameras on CSI-2, which drop a line with more than one wrong bit (raspberrypi/linux issue 4811).", local=True,
         debatable="below the line colours are exchanged, and lines are too high"),
    Kind("gap of colour times before that of frames", frames.gap_of_times_before_that_of_frames,
         ("path/rgb", "path/rgb_ts", COLOUR_MAP), ("rgb:dropped_samples", "rgb:time_offset"),
         "zed-save-depth, where the gap of times comes some frames before that of images (issue 13).",
         Range(1, 7, "frames", whole=True), local=True,
         debatable="frames are absent, and those between the two gaps are late"),
    Kind("colour begins at another column", frames.begins_at_another_column, ("path/rgb",), ("rgb:spatial_offset",),
         "pointgrey_camera_driver, whose images began elsewhere until they were subscribed to again (issue 43).",
         Range(4, 85, "px", signed=True, whole=True)),
    Kind("zoom of colour grows", frames.zoom_grows, ("path/rgb",), ("metadata:intrinsics_focal",),
         "Kubric, which took an animated focal length for a constant one (issue 178).", Range(5, 31, "%")),
    Kind("every second colour frame again for a while", frames.every_second_frame_again, ("path/rgb",),
         ("rgb:frozen_frames",),
         "EPIC-KITCHENS, whose cameras gave each frame twice in low light (download scripts issue 26).", local=True),
    Kind("fewer times than colour frames", frames.fewer_times_than_frames, ("path/rgb_ts", COLOUR_MAP),
         ("rgb:wrong_shape", "rgb:truncated"),
         "HS-ERGB, with 334 frames and 284 times (rpg_timelens issue 36).", Range(6, 31, "%"),
         debatable="times are not as many as frames, and the last ones are absent"),
)  # fmt: skip

_DEPTH: Final = (
    Kind("rows of an aligned buffer of depth", frames.rows_of_an_aligned_buffer, ("path/depth",), (),
         "CARLA, whose depth of 1080x1080 pixels was broken and that of 1280x1280 was not (issue 6283)."),
    Kind("depth without values for a while", frames.without_values_for_a_while, ("path/depth",),
         ("depth:nan_in_stream",), "ScanNet, some of whose frames have no depth at all (PonderV2 issue 11).",
         local=True),
    Kind("squares of zeros in depth for a while", frames.squares_of_zeros_for_a_while, ("path/depth",),
         ("depth:invalid_encoding",),
         "Sensors of Orbbec, whose depth had black areas with square corners at times (astra issue 16).",
         Range(11, 47, "%"), local=True),
)  # fmt: skip

_FLOW: Final = (
    Kind("upper half of flow twice", flow.upper_half_twice, FLOW, (),
         "A mirror of MPI Sintel, whose archive has the first half of each field twice (FlowFormer issue 37)."),
    Kind("flow as a network gives it", flow.as_a_network_gives_it, FLOW, ("flow:flow_gain", "flow:flow_unit"),
         "FlowNetPytorch, which saved 20ths of the flow (issue 61).", debatable="the unit is 20 px, or the gain 1/20"),
    Kind("fast flow as parts of slow flow", flow.parts_of_the_slow_flow, FLOW[1:], ("flow:flow_rate_mixed",),
         "Users of DSEC, who take half of its flow for half of its interval (issue 72).",
         debatable="the field has the length of its own rate, and the motion of another"),
    Kind("flow by columns", flow.columns_before_rows, FLOW, ("flow:wrong_shape", "flow:axes_swapped"),
         "flownet2-tf, whose scripts write (width, height, channel) and whose loader reads the reverse (issue 56).",
         debatable="the shape is the wrong one, and rows and columns are exchanged"),
    Kind("flow not a number for a while", flow.not_a_number_for_a_while, FLOW, ("flow:nan_in_stream",),
         "FlyingThings3D, some of whose fields are not finite (MaskFlownet pull request 39).", local=True),
    Kind("invalid flow in thousands of pixels", flow.thousands_where_depth_is_invalid, FLOW,
         ("flow:invalid_encoding",), "EVIMO2, whose flow had vectors of thousands of pixels (issue 28).",
         Range(310, 2_300, "px")),
)  # fmt: skip

_IMU: Final = (
    Kind("gravity behind the rotation", samples.gravity_behind_the_rotation, (ACCELEROMETER,), (),
         "CARLA, which added gravity to Z of the IMU whatever its attitude (pull request 2795).", scenes=QUIET_SCENES,
         debatable="gravity is there, with the right size, in another direction"),
    Kind("gyro alone in the world", samples.gyro_in_the_world, (GYRO,), ("imu:frame_convention",),
         "CARLA, whose rates were along the axes of the world (issue 2939).", scenes=QUIET_SCENES),
    Kind("times of the IMU in six digits", samples.times_in_six_digits, _IMU_TIME, ("imu:quantised_time",),
         "M2UD, whose converter wrote times of the IMU as C++ does by default (issue 13).", Range(1_000, 90_000, "s")),
    Kind("vertical force noisy", samples.vertical_force_noisy, (ACCELEROMETER,), ("imu:noise_misdeclared",),
         "AirSim, whose vertical acceleration of a car at rest varied from 4 to 16 m/s^2 (issue 4870).",
         Range(0.7, 4.1, "m/s^2")),
    Kind("messages of the accelerometer late", samples.accelerometers_messages_late, ("path/imu",), ("imu:unsorted",),
         "realsense-ros, where each message with new acceleration was older than the one before it (issue 880).",
         Range(1, 7, "samples", whole=True)),
    Kind("IMU held for 100 ms each for a while", samples.held_for_a_while, IMU, ("imu:frozen_frames",),
         "iCub, whose IMU was at times constant for 100 ms (mesh-support issue 585).", Range(37, 110, "ms"),
         local=True),
)  # fmt: skip

_POSE: Final = (
    Kind("exponents of quaternions lost", samples.exponents_lost, (ORIENTATION,), ("pose:quaternion_not_unit",),
         "Ground-Challenge, whose ground truth has 4.8 for a component of 4.8e-05 (issue 9).",
         Range(1, 9, "poses", whole=True)),
    Kind("components of quaternions in pairs", samples.components_in_pairs, (ORIENTATION,),
         ("pose:quaternion_order", "pose:frame_convention"),
         "VINS-RGBD, whose ground truth needs (w, x, y, z) = (-q2, q1, -q4, q3) (issue 16).",
         debatable="components are in another order, with signs of other axes"),
    Kind("attitude alone since the first", samples.attitude_from_the_first, (ORIENTATION,), ("pose:frame_convention",),
         "gazebo_ros_imu_sensor, whose attitude counted from the first one (gazebo_ros_pkgs pull request 1057)."),
    Kind("poses infinite for a while", samples.minus_infinity_for_a_while, POSE, ("pose:nan_in_stream",),
         "ScanNet, whose poses are minus infinity where tracking was lost (ScanNet issue 9).", local=True),
    Kind("attitude without the heading", samples.without_the_heading, (ORIENTATION,), (),
         "habitat-lab, whose head cameras did not turn with the base (issue 1995)."),
)  # fmt: skip

_COMPOSITES: Final = (
    Kind("sections of events in the wrong order", events.sections_in_the_wrong_order, EVENTS,
         ("events:dropped_samples", "events:clock_rate"),
         "evlib, which decoded ECF in the wrong order: 37% of the events, in a small part of their time "
         "(pull request 57).", Range(37, 610, "times"), composite=True),
    Kind("depth of the mirrored centre, with float times",
         both(frames.registered_with_the_mirrored_centre, clocks.single_precision_seconds("depth"),
              Range(21_000, 130_000, "s")),
         ("path/depth", "path/depth_ts", DEPTH_MAP), ("depth:spatial_offset", "depth:quantised_time"),
         "HoloLens2ForCV, with a centre counted from the other side and times cast to floats (pull request 104).",
         Range(2, 9, "px", signed=True, whole=True), composite=True),
    Kind("polarity in 32 bits, and event axes exchanged",
         both(events.polarity_in_32_bits, sensor.axes_exchanged),
         ("path/events/p", "path/events/x", "path/events/y"), ("events:wrong_dtype", "events:axes_swapped"),
         "v2e, whose HDF5 had -1 as 2^32 - 1 and whose text had rows before columns (issues 47 and 48).",
         composite=True),
    Kind("positions of another run, without attitude",
         both(clocks.from_donor("pose"), samples.quaternions_of_zeros), POSE,
         ("pose:other_sequence", "pose:quaternion_not_unit"),
         "M2DGR, a link of whose ground truth led to another run, and whose quaternions are zero (issue 10).",
         composite=True),
)  # fmt: skip

ELEVENTH_ROUND: Final = tuple(
    replace(kind, round=11)
    for kind in (*_EVENTS, *_MAPS, *_DECLARATIONS, *_COLOUR, *_DEPTH, *_FLOW, *_IMU, *_POSE, *_COMPOSITES)
)
"""Kinds of the eleventh round, in the order of streams."""

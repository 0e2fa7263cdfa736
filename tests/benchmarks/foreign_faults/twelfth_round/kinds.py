"""The twelfth round: each cause of the tool, planted by code that knows only the page of the cause.

Each cause but `unknown` has a kind; its stream was drawn where a cause has several. 6 kinds are of two causes.
"""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import EXACT_SCENES, QUIET_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENTS, FLOW, IMU, MAPS, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.twelfth_round import (
    containers,
    events,
    flow,
    frames,
    interpolation,
    rigid_flow,
    samples,
    timestamps,
    trajectories,
)
from tests.benchmarks.foreign_faults.twelfth_round.timestamps import COLOUR_TIME, IMU_TIME, POSE_TIME

SLOW, MIDDLE, FAST = FLOW
FLOW_TIMES: Final = tuple(f"{key}_ts" for key in FLOW)

_TIME: Final = (
    Kind("poses stamped by a slow subscriber", timestamps.poses_late, (POSE_TIME,), ("pose:time_offset",),
         "A logger that stamps poses with its own time when they arrive, or with that of the next step.",
         Range(3, 31, "ms", signed=True)),
    Kind("IMU on a wall clock for a while", timestamps.imu_clock_fast_for_a_while, (IMU_TIME,), ("imu:clock_rate",),
         "A simulator that runs slower or faster than real time for a while and stamps the IMU with the wall clock.",
         Range(15_000, 120_000, "ppm", signed=True), local=True),
    Kind("colour frames not written in time", timestamps.colour_dropped, ("path/rgb", COLOUR_TIME, COLOUR_MAP),
         ("rgb:dropped_samples",), "A queue of images that is full while the disk is busy.",
         Range(2, 8, "frames", whole=True), local=True),
    Kind("flow of 25 Hz appended twice", timestamps.written_twice("flow/25hz", f"{MIDDLE}_ts"),
         (MIDDLE, f"{MIDDLE}_ts"), ("flow:duplicated_samples",),
         "A job that is started again and appends intervals that the file holds already.", local=True),
    Kind("IMU batches in the order of two threads", timestamps.imu_batches_exchanged, ("path/imu",),
         ("imu:unsorted",), "Two threads that write batches of samples without waiting for each other.",
         Range(3, 21, "samples", whole=True), local=True),
    Kind("colour stamped in ticks of a timer", timestamps.colour_in_ticks, (COLOUR_TIME, COLOUR_MAP),
         ("rgb:quantised_time",), "The timer of an operating system, which ticks 64 or 100 times a second.",
         Range(3.3, 17, "ms")),
    Kind("events stamped by their receiver for a while", events.stamped_when_received, EVENTS,
         ("events:time_jitter",), "A receiver under load that stamps each event when it gets it.",
         Range(0.7, 7, "ms"), local=True),
    Kind("intervals of flow in another unit", timestamps.flow_times_in_another_unit, FLOW_TIMES,
         ("flow:time_unit",), "A script that takes times of frames in milliseconds, or nanoseconds, as ROS has them."),
)  # fmt: skip

_MAPS: Final = (
    Kind("indices behind the events of a header", containers.maps_too_large, MAPS,
         ("rgb_to_event:index_off_by_one", "depth_to_event:index_off_by_one"),
         "Counting from 1, or from events of a first packet that were cut off later.",
         Range(1, 89, "events", whole=True), debatable="both maps have the same fault"),
    Kind("depth map searched from the right", containers.behind_equal_times, (*EVENTS, "metadata/events"),
         ("depth_to_event:index_side",), "np.searchsorted with side='right', where events come in packets."),
)  # fmt: skip

_EVENTS: Final = (
    Kind("events darker for 1", events.polarity_exchanged, ("path/events/p",), ("events:polarity_inverted",),
         "A simulator whose bit of polarity stands for darker."),
    Kind("events seen from behind, or upside down", events.counted_from_the_other_side, ("path/events",),
         ("events:mirrored",), "A sensor behind a mirror, or a renderer whose rows begin at the bottom."),
    Kind("threshold of another run declared", events.threshold_declared, ("metadata/events",),
         ("events:threshold_misdeclared",), "A file of settings that was edited after the simulation.",
         Range(15, 80, "%", signed=True)),
    Kind("the other model of events declared", events.other_model_declared, ("metadata/events",),
         ("events:event_model_misdeclared",), "Metadata copied from a dataset of another simulator.",
         debatable="the threshold is then in the unit of the other model"),
    Kind("events by lines between stored frames", interpolation.between_frames, EVENTS,
         ("events:interpolated_frames",), "A converter from video to events that gets the stored frames only.",
         scenes=QUIET_SCENES),
    Kind("a tile of events lost for a while", events.tile_lost, EVENTS, ("events:dead_region",),
         "A decoder that loses a tile of the sensor.", Range(9, 37, "px", whole=True), local=True),
    Kind("pixels that fire by themselves", events.defective_pixels, EVENTS, ("events:hot_pixels",),
         "A sensor with defective pixels that nobody masks.", Range(3, 31, "pixels", whole=True)),
    Kind("background of events undeclared", events.background_undeclared, EVENTS, ("events:noise_misdeclared",),
         "A model of shot noise that is switched on and not declared.", Range(0.7, 9, "Hz")),
    Kind("events of another flight for a while", events.of_another_flight_for_a_while, EVENTS,
         ("events:other_sequence",), "Segments of two recordings merged under similar names.", local=True),
)  # fmt: skip

_COLOUR: Final = (
    Kind("blue before red", frames.blue_first, ("path/rgb",), ("rgb:channel_order",), "cv2.imread without cvtColor."),
    Kind("automatic exposure for a while", frames.exposed_otherwise_for_a_while, ("path/rgb",),
         ("rgb:exposure_or_gamma",), "Automatic exposure that is left on, in a flight through shade or light.",
         Range(12, 60, "%", signed=True), local=True),
    Kind("lens model that darkens the border", frames.darker_at_the_border, ("path/rgb",), ("rgb:vignetting",),
         "A lens effect that is on by default in an engine.", Range(13, 60, "%")),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth cropped beside its centre", frames.depth_shifted, ("path/depth",), ("depth:spatial_offset",),
         "A crop that begins some pixels beside that of the other streams.", Range(2, 17, "px"),
         debatable="a principal point of depth that is wrong has the same geometry, but flow has the right one"),
    Kind("depth as length of rays", frames.depth_along_rays, ("path/depth",), ("depth:depth_ray_not_z",),
         "A ray tracer that stores the distance to the hit."),
    Kind("depth without value as a number", frames.depth_without_value_as_a_number, ("path/depth",),
         ("depth:invalid_encoding",), "A depth buffer that is 0, or infinite, where nothing is hit."),
    Kind("chunks of depth damaged on the disk", containers.chunks_of_depth_damaged, ("path/depth",),
         ("depth:corrupt_chunk",), "A disk that damages sectors after the file was written.",
         Range(1, 6, "chunks", whole=True), local=True),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow in another unit than pixels", flow.in_another_unit, FLOW, ("flow:flow_unit",),
         "Velocities divided by the time, or multiplied by it, or coordinates relative to the image."),
    Kind("flow from the end to the start", flow.multiplied(-1, -1), FLOW, ("flow:flow_sign",),
         "Source less target in place of target less source."),
    Kind("flow not rescaled with its image", flow.too_long, FLOW, ("flow:flow_gain",),
         "Fields resized to another width without their vectors.", Range(4, 40, "%", signed=True)),
    Kind("fields of 50 Hz under 25 Hz", flow.fast_as_middle, (MIDDLE,), ("flow:flow_rate_mixed",),
         "A loop over rates that reads its step from the wrong variable.",
         debatable="fields of half the time are about half as long"),
    Kind("fields of 50 Hz beside their interval", flow.of_another_interval, (FAST,), ("flow:flow_interval_shifted",),
         "Lists of fields and of intervals that begin at different frames.",
         Range(1, 3, "intervals", signed=True, whole=True), debatable="it is also a delay by whole intervals"),
    Kind("fields of 50 Hz repeated for a while", flow.repeated, (FAST,), ("flow:frozen_frames",),
         "A buffer of flow that is written again before it is computed.", Range(2, 7, "fields", whole=True),
         local=True),
    Kind("fields of 25 Hz exchanged in pairs for a while", flow.neighbours_exchanged, (MIDDLE,),
         ("flow:swapped_frames",), "Two processes that compute fields in turn and finish in the wrong order.",
         local=True),
    Kind("flow with v to the top", flow.multiplied(1, -1), FLOW, ("flow:frame_convention",),
         "Motion vectors of OpenGL, whose y points upwards."),
    Kind("flow with another focal length", rigid_flow.of_another_focal_length, FLOW, ("flow:intrinsics_focal",),
         "Flow computed with the K of another field of view.", Range(5, 37, "%", signed=True), scenes=EXACT_SCENES,
         debatable="flow of a turning camera is nearly proportional to the focal length, as with a gain"),
    Kind("flow with another principal point", rigid_flow.of_another_centre, FLOW, ("flow:intrinsics_centre",),
         "Flow computed with the K of the images before they were cropped.", Range(9, 43, "px"),
         scenes=EXACT_SCENES),
    Kind("flow with another mounting", rigid_flow.of_another_mounting, FLOW, ("flow:extrinsic_rotation",),
         "Flow computed with a camera that looks straight ahead, although it is tilted.", Range(2, 17, "deg"),
         scenes=EXACT_SCENES),
    Kind("flow with the noise of the pose", rigid_flow.of_the_noisy_pose, (*FLOW, *POSE, "metadata/pose"),
         ("flow:flow_from_noisy_pose",), "Flow computed from the file that is published.", Range(1.1, 7, "mrad"),
         scenes=EXACT_SCENES),
)  # fmt: skip

_IMU: Final = (
    Kind("IMU in few codes", samples.in_few_codes, IMU, ("imu:quantised_values",),
         "Samples scaled to 5 to 7 bits for a small archive or a short message.", Range(0.8, 4, "%")),
    Kind("rates in degrees", samples.rates_in_degrees, (GYRO,), ("imu:unit_deg_rad",),
         "Angular velocity of a game engine."),
    Kind("specific force without gravity", samples.without_gravity, (ACCELEROMETER,), ("imu:gravity_missing",),
         "Second differences of positions in place of an accelerometer.", scenes=QUIET_SCENES),
    Kind("specific force with gravity downwards", samples.with_gravity_downwards, (ACCELEROMETER,),
         ("imu:gravity_sign",), "A simulated accelerometer that adds gravity to acceleration.", scenes=QUIET_SCENES),
    Kind("specific force with another gravity", samples.with_another_gravity, (ACCELEROMETER,),
         ("imu:gravity_magnitude", "metadata:gravity_magnitude"),
         "An engine whose gravity is 10 m/s^2, or that of another place.", Range(0.05, 0.25, "m/s^2", signed=True),
         debatable="samples and declaration differ, and either may be called wrong"),
    Kind("gyro with its turn-on bias", samples.with_bias(GYRO), (GYRO,), ("imu:gyro_bias",),
         "A gyro whose bias was not estimated at rest.", Range(0.009, 0.09, "rad/s")),
    Kind("accelerometer with its turn-on bias", samples.with_bias(ACCELEROMETER), (ACCELEROMETER,),
         ("imu:accel_bias",), "An accelerometer without calibration.", Range(0.13, 0.9, "m/s^2")),
    Kind("samples of the IMU not a number for a while", samples.not_finite_for_a_while, IMU,
         ("imu:nan_in_stream",), "A division by the time between two samples that is zero.",
         Range(1, 31, "samples", whole=True), local=True),
    Kind("IMU in single precision", samples.in_single_precision, IMU, ("imu:wrong_dtype",),
         "Tensors of a network's loader saved as they are."),
)  # fmt: skip

_POSE: Final = (
    Kind("two axes of the position exchanged", trajectories.two_axes_exchanged, (POSITION,), ("pose:axes_swapped",),
         "North before east, or another order of columns.",
         debatable="north, east and up are a convention of axes as well"),
    Kind("positions of motion capture in mm", trajectories.in_millimetres, (POSITION,), ("pose:unit_mm_m",),
         "Motion capture, which exports millimetres."),
    Kind("positions of a marker on the body", trajectories.of_another_point, (POSITION,), ("pose:lever_arm",),
         "A tracked marker, or an antenna, beside the origin of the body.", Range(0.13, 0.9, "m")),
    Kind("quaternions with the real part first", trajectories.real_part_first, (ORIENTATION,),
         ("pose:quaternion_order",), "Libraries that write w, x, y, z."),
    Kind("quaternions from world to body", trajectories.from_world_to_body, (ORIENTATION,),
         ("pose:quaternion_inverted",), "The attitude of a view matrix."),
    Kind("quaternions of the Euler method", trajectories.longer_with_each_turn, (ORIENTATION,),
         ("pose:quaternion_not_unit",), "Rates integrated step by step, without normalising.", Range(0.5, 9, "%")),
    Kind("positions at another place for a while", trajectories.elsewhere_for_a_while, (POSITION,), ("pose:teleport",),
         "A tracker that takes another place for its own until it finds back.", Range(0.17, 4.3, "m"), local=True),
    Kind("poses filled in for a while", trajectories.interpolated_for_a_while, POSE, ("pose:interpolated_pose",),
         "Gaps of a tracker that a script fills from poses at a lower rate.", Range(7, 43, "Hz"), local=True),
)  # fmt: skip

_CONTAINER: Final = (
    Kind("lens declared for rectified events", containers.lens_of_rectified_events, (CAMERA + "events",),
         ("metadata:rectification_misdeclared",), "Events that were rectified, with the calibration of the raw ones.",
         Range(0.07, 0.41, "1")),
    Kind("depth map ends early", containers.depth_map_ends_early, (DEPTH_MAP,),
         ("depth_to_event:truncated", "depth_to_event:wrong_shape"),
         "A script that is stopped before all frames have an index.", Range(7, 47, "%"),
         debatable="the map is then not as long as its frames"),
    Kind("poses declared and not written", containers.without_poses, ("path/pose",), ("pose:missing_stream",),
         "A copy of chosen groups, which forgets one."),
    Kind("indices of colour frames as a matrix", containers.colour_map_as_a_column, (COLOUR_MAP,),
         ("rgb_to_event:wrong_shape",), "MATLAB, in which a vector is a matrix."),
)  # fmt: skip

_COMPOSITES: Final = (
    Kind("depth repeated, and flow in another unit",
         both(frames.depth_repeated, flow.in_another_unit), ("path/depth", *FLOW),
         ("depth:frozen_frames", "flow:flow_unit"), "A buffer that is not refreshed, and a renderer's motion vectors.",
         Range(2, 7, "frames", whole=True), local=True, composite=True),
    Kind("gyro bias, and real part first",
         both(samples.with_bias(GYRO), trajectories.real_part_first), (GYRO, ORIENTATION),
         ("imu:gyro_bias", "pose:quaternion_order"), "An autopilot's raw log, converted by hand.",
         Range(0.009, 0.09, "rad/s"), composite=True),
    Kind("focal length and threshold of another event camera",
         both(containers.focal_length_declared("events"), events.threshold_declared, Range(15, 80, "%", signed=True)),
         (CAMERA + "events", "metadata/events"), ("metadata:intrinsics_focal", "events:threshold_misdeclared"),
         "Metadata of the camera of another project.", Range(3, 21, "%", signed=True), composite=True),
    Kind("depth lost, and the centre of colour",
         both(timestamps.depth_dropped, containers.centre_declared("rgb"), Range(4, 31, "px")),
         ("path/depth", "path/depth_ts", DEPTH_MAP, CAMERA + "rgb"),
         ("depth:dropped_samples", "metadata:intrinsics_centre"), "A full queue, and a crop that K does not follow.",
         Range(2, 8, "frames", whole=True), local=True, composite=True),
    Kind("IMU written twice, and poses that end early",
         both(timestamps.written_twice("imu", IMU_TIME), timestamps.poses_end_early, Range(13, 47, "%")),
         ("path/imu", "path/pose"), ("imu:duplicated_samples", "pose:truncated"),
         "A logger that is started twice, and another that ends too soon.", local=True, composite=True),
    Kind("darker border, and events stamped by their receiver",
         both(frames.darker_at_the_border, events.stamped_when_received, Range(0.7, 7, "ms")),
         ("path/rgb", *EVENTS), ("rgb:vignetting", "events:time_jitter"),
         "A simulated lens, and a busy receiver.", Range(13, 60, "%"), composite=True),
)  # fmt: skip

TWELFTH_ROUND: Final = tuple(
    replace(kind, round=12)
    for kind in (
        *(*_TIME, *_MAPS, *_EVENTS, *_COLOUR, *_DEPTH, *_FLOW, *_IMU, *_POSE, *_CONTAINER),
        *_COMPOSITES,
    )
)
"""Kinds of the twelfth round, in the order of streams."""

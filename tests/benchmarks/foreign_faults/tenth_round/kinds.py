"""The tenth round: kinds of faults that were written when the first nine had been looked at.

They are mistakes of those who record, render, convert and publish: 31 with a name, 6 without, 3 composites.
"""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import poses
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER, GYRO
from tests.benchmarks.foreign_faults.kind import EXACT_SCENES, QUIET_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENT_TIME, EVENTS, FLOW, IMU, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION, POSITION
from tests.benchmarks.foreign_faults.tenth_round import declarations, events, flow, frames, samples

_EVENTS: Final = (
    Kind("columns of events wrap round", events.columns_wrap_round, EVENTS, ("events:spatial_offset",),
         "np.roll in an augmentation, or a read-out that begins at another column.",
         Range(2, 13, "px", signed=True, whole=True)),
    Kind("times of events skewed", events.skewed, EVENT_TIME, ("events:clock_rate", "events:time_offset"),
         "TimeSkew of Tonic, which multiplies times and adds to them, in a cache of training data.",
         Range(0.3, 2.7, "%", signed=True), debatable="the clock has another rate, and the first event is late"),
    Kind("places of events scattered", events.scattered, EVENTS, (),
         "SpatialJitter of Tonic, in a cache of training data.", Range(0.7, 2.6, "px")),
    Kind("event times held behind an outlier", events.held_behind_an_outlier, EVENTS,
         ("events:quantised_time", "events:time_offset"), "np.maximum.accumulate against times that step backwards.",
         local=True, debatable="events of a while share one time, which is late for most of them"),
    Kind("chunk of events overwritten by the next", events.chunk_of_the_next, EVENTS,
         ("events:dropped_samples", "events:duplicated_samples"),
         "Writers of HDF5 whose buffer is filled again while it is compressed.", local=True,
         debatable="events are absent at one place and doubled at another"),
    Kind("events rectified for stereo", events.rectified_for_stereo, EVENTS,
         ("metadata:extrinsic_rotation", "events:spatial_offset"),
         "Maps of cv2.stereoRectify on events, with the mounting of the raw sensor.", Range(0.9, 4.7, "deg"),
         debatable="the turned view resembles one that is shifted"),
    Kind("columns of events stretched", events.columns_stretched, EVENTS, ("metadata:intrinsics_focal",),
         "Events resized to the square input of a network, and cropped.", Range(6, 37, "%")),
    Kind("dead time of pixels declared, not simulated", declarations.dead_time_declared, ("metadata/events",),
         ("events:event_model_misdeclared",), "v2e's --refractory_period in the metadata of a run without it.",
         Range(1_700, 9_300, "us", whole=True), debatable="the comparison is right, and the dead time is not"),
)  # fmt: skip

_MAPS: Final = (
    Kind("colour map from the first full slice", events.colour_map_from_the_first_full_slice, (COLOUR_MAP,),
         ("rgb_to_event:index_off_by_one",), "Maps that were made before the first slice of events was cut off.",
         Range(7, 53, "ms")),
    Kind("depth map as text", events.depth_map_as_text, (DEPTH_MAP,), ("depth_to_event:wrong_dtype",),
         "np.loadtxt with dtype=str, or tables of CSV."),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("angle of view of depth over the diagonal", declarations.angle_of_view_over_the_diagonal,
         (CAMERA + "depth",), ("metadata:intrinsics_focal",),
         "Data sheets, whose angle of view is that of the diagonal, and simulators, whose is horizontal."),
    Kind("places of cameras in FRD", declarations.places_of_cameras_in_frd, ("metadata/cameras",),
         ("metadata:lever_arm",), "AirSim's settings.json beside mountings in optical axes."),
)  # fmt: skip

_COLOUR: Final = (
    Kind("mosaic of colour from the other corner", frames.mosaic_from_the_other_corner, ("path/rgb",),
         ("rgb:channel_order",), "OpenCV's names of Bayer patterns, which are not those of cameras."),
    Kind("gammas of channels", frames.gammas_of_channels, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "A colour grade of film, on by default in the volume of a renderer.", Range(1.13, 1.9, "1")),
    Kind("saturation of colour raised", frames.saturated, ("path/rgb",), (),
         "Vivid modes of cameras, and ColorJitter of torchvision.", Range(17, 130, "%"),
         debatable="luma is as it was, but where channels clip"),
    Kind("shutter of colour opens at its time", frames.exposed_from_its_time_on, ("path/rgb",), ("rgb:time_offset",),
         "Motion blur of Blender with the shutter's position at the start of the frame.", Range(43, 96, "%"),
         debatable="frames are blurred as well"),
    Kind("grain of film", frames.with_grain, ("path/rgb",), (), "Unreal's film grain.", Range(4, 23, "DN")),
    Kind("colour in fewer pixels for a while", frames.in_fewer_pixels_for_a_while, ("path/rgb",), (),
         "Dynamic resolution of engines and of video calls.", Range(2.3, 7.1, "times"), local=True),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth squeezed beside a border", frames.squeezed_beside_a_border, ("path/depth",),
         ("metadata:intrinsics_focal", "metadata:intrinsics_centre"),
         "Readers that take the length of a row for its width.", Range(4, 29, "%"),
         debatable="focal length and centre of columns are both those of another size"),
    Kind("ring of depth read from its middle", frames.ring_read_from_its_middle, ("path/depth",),
         ("depth:swapped_frames",), "A ring buffer that is flushed when a recording is interrupted.", local=True),
    Kind("depth in inches", frames.in_inches, ("path/depth",), ("depth:unit_mm_m",),
         "Scenes of SketchUp and Houdini, in inches.", debatable="the unit is neither mm nor m"),
    Kind("depth lost and renumbered", frames.lost_and_renumbered, ("path/depth", "path/depth_ts", DEPTH_MAP),
         ("depth:dropped_samples", "depth:time_offset"), "Image writers under load, and times by number of file.",
         Range(2, 11, "frames", whole=True), local=True,
         debatable="frames are absent, and the following ones are early"),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow to the end of the shutter", flow.to_the_end_of_the_shutter, FLOW, ("flow:flow_gain",),
         "Motion vectors of renderers for blur, which span the time of the open shutter.", Range(33, 87, "%"),
         scenes=EXACT_SCENES, debatable="flow over a part of the interval is nearly that part of it"),
    Kind("flow over its longest vector", flow.over_its_longest_vector, FLOW, ("flow:flow_unit", "flow:flow_gain"),
         "Fields that were scaled for colour wheels, and saved.", debatable="each field has a unit of its own"),
    Kind("flow averaged with the next", flow.mean_with_the_next, FLOW, ("flow:flow_interval_shifted",),
         "Interpolation of fields to instants between them.", debatable="half of the shift, and smoothed"),
    Kind("tile of flow of the interval before for a while", flow.tile_of_the_interval_before, FLOW,
         ("flow:flow_interval_shifted",), "Tiles of a shared texture that are read before they are drawn.",
         local=True),
    Kind("flow of a trajectory of another scale", flow.of_a_trajectory_of_another_scale, FLOW, (),
         "Rigid flow from depth of a sensor and a trajectory of monocular SLAM.", Range(4, 31, "%", signed=True),
         scenes=EXACT_SCENES, debatable="where a vehicle does not turn, flow_gain describes the fields"),
)  # fmt: skip

_IMU: Final = (
    Kind("accelerometer warms up", samples.accelerometer_warms_up, (ACCELEROMETER,), ("imu:accel_bias",),
         "Consumer sensors in their first minutes.", Range(0.09, 0.71, "m/s^2")),
    Kind("axis of the accelerometer reversed", samples.axis_of_the_accelerometer_reversed, (ACCELEROMETER,),
         ("imu:frame_convention",), "Matrices of an orientation in which one sign is wrong.",
         debatable="a reversed axis makes the sensor left-handed, which no convention is"),
    Kind("words of the IMU slip for a while", samples.words_slip_for_a_while, IMU, ("imu:axes_swapped",),
         "The FIFO of an MPU-6050 that overflows within a sample.", local=True,
         debatable="axes of one sensor move to the other as well"),
    Kind("sign of the gyro's counts lost", samples.sign_of_counts_lost, (GYRO,), (),
         "struct.unpack with H in place of h.", Range(245, 2_000, "deg/s")),
    Kind("gyro labelled in deg/s", declarations.gyro_labelled_in_degrees, (GYRO,), ("imu:unit_deg_rad",),
         "A label from the data sheet beside values of the driver.",
         debatable="the values are right, and the label is wrong"),
)  # fmt: skip

_POSE: Final = (
    Kind("poses stamped by the frame before", samples.stamped_by_the_frame_before, ("path/pose/ts",),
         ("pose:quantised_time",), "Game threads, which know the time of the frame alone.",
         debatable="poses are early by half a frame as well, and times occur several times"),
    Kind("dead reckoning for a while", samples.dead_reckoning_for_a_while, (POSITION,), ("pose:teleport",),
         "A filter that goes on with the IMU when the tracker is covered, and jumps back.", Range(0.13, 1.9, "m"),
         local=True, debatable="the position departs slowly and jumps once"),
    Kind("height of a barometer", samples.height_of_a_barometer, (POSITION,), ("pose:quantised_values",),
         "Autopilots that log the height of a barometer.", Range(0.07, 0.38, "m")),
    Kind("poses of another map from there on", samples.of_another_map_from_there_on, POSE,
         ("pose:teleport", "pose:frame_convention"), "ORB-SLAM3's Atlas, with a new map where tracking was lost.",
         Range(7, 83, "deg", signed=True), local=True,
         debatable="heading jumps at one row, and the world is another one from there on"),
    Kind("markers wobble for a while", samples.markers_wobble_for_a_while, (POSITION,), ("pose:noise_misdeclared",),
         "Reflective markers on sticks that resonate.", Range(6, 37, "mm"), local=True, scenes=QUIET_SCENES,
         debatable="a swing is no noise"),
)  # fmt: skip

_COMPOSITES: Final = (
    Kind("accelerometer warms up, and mosaic from the other corner",
         both(samples.accelerometer_warms_up, frames.mosaic_from_the_other_corner), (ACCELEROMETER, "path/rgb"),
         ("imu:accel_bias", "rgb:channel_order"), "A cold camera with a sensor of its own.",
         Range(0.13, 0.9, "m/s^2"), composite=True),
    Kind("columns of events wrap round, and poses stamped by the frame before",
         both(events.columns_wrap_round, samples.stamped_by_the_frame_before), (*EVENTS, "path/pose/ts"),
         ("events:spatial_offset", "pose:quantised_time"), "A plugin of an engine with a bug in its read-out.",
         Range(3, 17, "px", signed=True, whole=True), composite=True),
    Kind("angle of view over the diagonal, and quaternions of the inverse",
         both(declarations.angle_of_view_over_the_diagonal, poses.conjugated), (CAMERA + "depth", ORIENTATION),
         ("metadata:intrinsics_focal", "pose:quaternion_inverted"), "View matrices of an engine, and a data sheet.",
         composite=True),
)  # fmt: skip

TENTH_ROUND: Final = tuple(
    replace(kind, round=10)
    for kind in (*_EVENTS, *_MAPS, *_DECLARATIONS, *_COLOUR, *_DEPTH, *_FLOW, *_IMU, *_POSE, *_COMPOSITES)
)
"""Kinds of the tenth round, in the order of streams."""

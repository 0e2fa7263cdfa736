"""The second round: kinds of faults that were written when the first round had been looked at."""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import clocks, poses
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENT_TIME, EVENTS, FLOW, MAPS, POSE
from tests.benchmarks.foreign_faults.poses import ORIENTATION
from tests.benchmarks.foreign_faults.second_round import declarations, depth, event_times, events, flow, frames, motion
from tests.benchmarks.foreign_faults.second_round.image_kinds import IMAGES
from tests.benchmarks.foreign_faults.second_round.sample_kinds import SAMPLES

_EVENTS: Final = (
    Kind("events in ticks of 100 ns", clocks.in_unit("events", 10.0), EVENT_TIME, ("events:time_unit",),
         "DateTime.Ticks of .NET and Unity."),
    Kind("events in floating seconds", event_times.in_floating_seconds, ("path/events/t",),
         ("events:time_unit", "events:wrong_dtype"), "Text files of rpg_dvs_ros and ESIM, whose stamps are seconds.",
         debatable="unit and type are both those of another format"),
    Kind("events at even times between frames", event_times.at_even_times_between_frames, EVENTS,
         ("events:quantised_time", "events:interpolated_frames"), "v2e, which spreads the events of a pair of frames.",
         debatable="times are those of a few steps between two frames: both names describe them"),
    Kind("brighter events before darker ones", event_times.brighter_first, ("path/events",), ("events:unsorted",),
         "np.concatenate of two lists, one of each polarity.",
         debatable="the index maps are those of the sorted events"),
    Kind("event buffers from a stack", event_times.buffers_from_a_stack, ("path/events",), ("events:unsorted",),
         "A list that is emptied with pop.", Range(17, 310, "events", whole=True), local=True,
         debatable="the index maps are those of the sorted events"),
    Kind("border of the sensor silent", events.border_silent, EVENTS, ("events:dead_region",),
         "A convolution without padding before the sensor model.", Range(2, 9, "px", whole=True)),
    Kind("corners of the sensor silent", events.corners_silent, EVENTS, ("events:dead_region",),
         "A lens whose image circle is smaller than the sensor.", Range(7, 29, "%")),
    Kind("rows of the sensor silent at intervals", events.regular_rows_silent, EVENTS, ("events:dead_region",),
         "A row decoder with a line that is stuck.", Range(3, 13, "rows", whole=True)),
    Kind("hot pixels for a while", events.hot_for_a_while, EVENTS, ("events:hot_pixels",),
         "A sensor that warms up in the sun between two clouds.", Range(2, 19, "pixels", whole=True), local=True),
    Kind("busiest pixels masked", events.busiest_masked, EVENTS, ("events:dead_region",),
         "Metavision's search for active pixels, on a scene that is not static.", Range(3, 43, "pixels", whole=True),
         debatable="the pixels are single ones, at edges"),
    Kind("events lost while frames are read", events.lost_while_frames_are_read, EVENTS, ("events:dropped_samples",),
         "A DAVIS, whose two readouts share a bus.", Range(0.9, 6.1, "ms")),
    Kind("one event of a pixel in a slice", events.first_of_each_slice, EVENTS, ("events:dropped_samples",),
         "Event frames of 5 to 30 a second with one bit, converted back into lists.", Range(29, 230, "ms"),
         debatable="a refractory period has no name of its own, and this resembles one"),
    Kind("event clock warms up", event_times.clock_warms_up, EVENT_TIME, ("events:clock_rate",),
         "A crystal that is read cold and then warm.", Range(2_300, 31_000, "ppm", signed=True),
         debatable="the rate changes"),
    Kind("threshold doubled for a while", events.threshold_doubled_for_a_while, EVENTS,
         ("events:threshold_misdeclared",), "A control of biases that keeps the rate of events within limits.",
         local=True, debatable="the declared threshold is right elsewhere, and events are absent as if lost"),
    Kind("lamp flickers", events.lamp_flickers, EVENTS, ("events:noise_misdeclared",),
         "A fluorescent lamp that frames with a matching exposure do not show.", Range(4.3, 23, "%"),
         debatable="the light flickers in truth, and the frames do not show it"),
    Kind("events moved for a while", events.moved_for_a_while, EVENTS, ("events:spatial_offset",),
         "A region of interest that is set while recording.", Range(1, 5, "px", signed=True, whole=True), local=True),
    Kind("events of another sequence for a while", events.of_another_sequence, EVENTS, ("events:other_sequence",),
         "A directory of parts into which two runs wrote.", local=True),
    Kind("polarity of the event before", event_times.polarity_of_the_event_before, ("path/events/p",), (),
         "A parser of AER that reads the bit of the word before."),
    Kind("dark pixels late", event_times.dark_pixels_late, EVENTS, (),
         "Photoreceptors whose bandwidth falls with light, as v2e models them.", Range(0.9, 7.9, "ms"),
         debatable="on the mean, events are late"),
    Kind("events bent by a lens", events.lens_bends, EVENTS, (), "Events that nobody rectifies, under a pinhole model.",
         Range(1.3, 6.7, "px", signed=True)),
    Kind("high words of event times lost", event_times.high_words_lost, ("path/events/t",), (),
         "EVT 3.0, whose words TIME_HIGH a full link drops.", local=True,
         debatable="unsorted describes the timestamps, but sorting does not repair them"),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("colour map ends early", declarations.colour_map_ends_early, (COLOUR_MAP,),
         ("rgb_to_event:truncated", "rgb_to_event:wrong_shape"), "A map made of the events that were written so far.",
         Range(9, 43, "%"), debatable="a map that is too short has the wrong shape as well"),
    Kind("depth map off from a frame on", declarations.depth_map_off_from_a_frame_on, (DEPTH_MAP,),
         ("depth_to_event:index_off_by_one",), "Counts of parts of a recording that are added up wrongly.",
         Range(2, 41, "events", whole=True), local=True, debatable="entries before are right"),
    Kind("maps of another clock", declarations.maps_of_other_clock, MAPS, (),
         "Maps that are made before the clocks are aligned.", Range(2.3, 19, "ms", signed=True)),
    Kind("centre of cameras exchanged", declarations.centre_exchanged, ("metadata/cameras",),
         ("metadata:intrinsics_centre",), "shape[:2] / 2, which gives the row first."),
    Kind("focal length in millimetres", declarations.focal_in_millimetres, ("metadata/cameras",),
         ("metadata:intrinsics_focal",), "Blender's camera.lens."),
    Kind("rows of cameras upwards", declarations.rows_upwards, ("metadata/cameras",),
         ("metadata:frame_convention", "metadata:intrinsics_focal"), "K made from OpenGL's matrix of projection.",
         debatable="the sign is a convention, and the declared focal length is wrong as well"),
    Kind("focal length that is not a number", declarations.not_a_number, (CAMERA + "events",),
         ("metadata:nan_in_stream",), "A calibration that did not converge."),
    Kind("mountings stored by columns", declarations.mountings_by_columns, ("metadata/cameras",),
         ("metadata:frame_convention", "metadata:extrinsic_rotation"), "Matrices of Unity and OpenGL as raw memory.",
         debatable="the declared rotation is the inverse one, and the place is lost"),
    Kind("places of cameras of the inverse", declarations.way_of_the_inverse, ("metadata/cameras",),
         ("metadata:lever_arm",), "OpenCV's tvec beside a rotation that was inverted."),
    Kind("event camera in portrait", declarations.in_portrait, (CAMERA + "events",), ("metadata:extrinsic_rotation",),
         "URDF of a bracket on which the camera was mounted otherwise."),
    Kind("gravity declared downwards", declarations.gravity_downwards, ("metadata/imu",),
         ("metadata:gravity_magnitude", "imu:gravity_magnitude", "imu:gravity_sign"), "Unity's Physics.gravity.y.",
         debatable="the declaration has another sign than the format, and the samples are right"),
    Kind("K with a skew", declarations.skewed, (CAMERA + "events",), (), "MATLAB's calibration with EstimateSkew.",
         Range(2.3, 13, "%", signed=True)),
)  # fmt: skip

_COMPOSITES: Final = (
    Kind("events turned a quarter", events.turned_a_quarter, EVENTS, ("events:axes_swapped", "events:mirrored"),
         "A sensor that is mounted in portrait, and turned by nobody.", composite=True),
    Kind("quaternions w first and of the inverse", both(poses.conjugated, poses.scalar_first), (ORIENTATION,),
         ("pose:quaternion_order", "pose:quaternion_inverted"), "PX4's attitude, read as that of a body in NED.",
         composite=True),
    Kind("pose of Unreal", motion.left_handed_in_centimetres, POSE, ("pose:unit_mm_m", "pose:frame_convention"),
         "Unreal's actors, which are left-handed and in centimetres.", composite=True),
    Kind("flow in clip space", flow.in_clip_space, FLOW, ("flow:flow_unit", "flow:frame_convention"),
         "A velocity buffer of Unreal or Unity.", composite=True),
    Kind("invalid depth as ten billion metres, and colour in a logarithmic curve",
         both(frames.logarithmic, depth.invalid_as(1e13)), ("path/rgb", "path/depth"),
         ("depth:invalid_encoding", "rgb:exposure_or_gamma"), "Blender's passes and its Filmic Log.",
         Range(5.3, 71, "a"), composite=True),
)  # fmt: skip

SECOND_ROUND: Final = tuple(
    replace(kind, round=2) for kind in (*_EVENTS, *IMAGES, *SAMPLES, *_DECLARATIONS, *_COMPOSITES)
)
"""Kinds of the second round, in the order of streams."""

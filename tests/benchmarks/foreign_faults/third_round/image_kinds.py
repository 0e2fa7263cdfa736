"""Kinds of the third round in colour, depth and flow."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks
from tests.benchmarks.foreign_faults.kind import EXACT_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import FLOW, MAPS
from tests.benchmarks.foreign_faults.third_round import declarations, flow, frames, timestamps

_COLOUR: Final = (
    Kind("colour free of its trigger for a while", timestamps.free_of_its_trigger, ("path/rgb_ts", *MAPS),
         ("rgb:time_offset",), "A camera that misses triggers and runs freely, under the timestamps of the triggers.",
         Range(2.3, 8.9, "ms", signed=True), local=True),
    Kind("colour stamped at the start of an automatic exposure", timestamps.at_start_of_exposure,
         ("path/rgb_ts", *MAPS), ("rgb:time_offset",),
         "Machine-vision cameras, whose chunk data hold the start of the exposure.", Range(6.1, 18, "ms")),
    Kind("colour mirrored for a while", frames.mirrored_for_a_while, ("path/rgb",), ("rgb:mirrored",),
         "A driver that restarts without ReverseX.", local=True),
    Kind("colour in BGR for a while", frames.channels_reversed_for_a_while, ("path/rgb",), ("rgb:channel_order",),
         "Shards of a data set that two versions of a converter wrote.", local=True),
    Kind("iris opens for a while", frames.iris_opens_for_a_while, ("path/rgb",), ("rgb:vignetting",),
         "Lenses with an automatic iris, whose gain is corrected for exposure alone.", Range(17, 59, "%"), local=True),
    Kind("colour rectified for stereo", frames.rectified, ("path/rgb",), ("metadata:extrinsic_rotation",),
         "cv2.stereoRectify, whose R1 nothing declares.", Range(0.9, 5.3, "deg")),
    Kind("colour of the right eye", frames.of_the_right_eye, ("path/rgb",), ("metadata:lever_arm",),
         "Topics of a stereo camera whose names are exchanged.", Range(0.063, 0.41, "m")),
    Kind("colour with alpha", frames.with_alpha, ("path/rgb",), ("rgb:wrong_shape",),
         "Frames of Unreal and CARLA, which have four channels."),
    Kind("colour out of focus", frames.out_of_focus, ("path/rgb",), (),
         "Depth of field of Blender, and lenses that vibrate loose.", Range(0.8, 3.7, "px")),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth a frame late for a while", frames.depth_a_frame_late_for_a_while, ("path/depth",),
         ("depth:time_offset",), "A queue that holds a frame back until it is flushed.", local=True),
    Kind("depth along rays for a while", frames.depth_along_rays_for_a_while, ("path/depth",),
         ("depth:depth_ray_not_z",), "Parts of AirSim's DepthPerspective and DepthPlanar in one data set.", local=True),
    Kind("depth labelled in metres", declarations.depth_labelled_in_metres, ("path/depth",), ("depth:unit_mm_m",),
         "Attributes copied from a template.", debatable="the values are right, and the label is wrong"),
    Kind("depth blended with zero", frames.zero_blended_into_depth, ("path/depth",), ("depth:invalid_encoding",),
         "cv2.blur and cv2.remap, which take 0 for a depth as any other."),
    Kind("depth left out of an upload", frames.depth_left_out, ("path/depth",), ("depth:missing_stream",),
         "A limit for the size of one object in a bucket."),
    Kind("part of depth never sent", frames.depth_part_never_sent, ("path/depth",), ("depth:corrupt_chunk",),
         "Multipart uploads and sparse files, whose missing parts are zeros.", local=True),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow intervals in numbers of frames", timestamps.in_numbers_of_frames, tuple(f"{key}_ts" for key in FLOW),
         ("flow:time_unit",), "Lists of pairs of images, as networks for flow take them."),
    Kind("flow axes exchanged for a while", flow.axes_exchanged_for_a_while, FLOW, ("flow:axes_swapped",),
         "Nodes of a cluster with two versions of a script.", local=True),
    Kind("fields of flow lost", clocks.lost_rows("flow/50hz"), ("path/flow",), ("flow:dropped_samples",),
         "A job that runs out of memory and is skipped.", Range(1, 8, "fields", whole=True), local=True),
    Kind("slow flow of every other pair", flow.of_every_other_pair, ("path/flow/25hz",), ("flow:flow_rate_mixed",),
         "pairs[::2] in place of images[::2]."),
    Kind("flow from late poses", flow.of_late_poses, FLOW, ("flow:time_offset",),
         "Ground truth that is computed before Kalibr's time shift is applied to the poses.", Range(17, 83, "ms"),
         scenes=EXACT_SCENES, debatable="the motion is that of an interval before, and the grid is not"),
    Kind("flow as length and angle", flow.as_length_and_angle, FLOW, (), "cv2.cartToPolar."),
    Kind("flow by blocks of a codec", flow.by_blocks_of_a_codec, FLOW, (),
         "Motion vectors of H.264, exported by ffmpeg.", Range(4, 16, "px", whole=True),
         debatable="quantised_values describes the quarters of a pixel, and the blocks move more"),
)  # fmt: skip

IMAGES: Final = (*_COLOUR, *_DEPTH, *_FLOW)
"""Kinds of colour, depth and flow."""

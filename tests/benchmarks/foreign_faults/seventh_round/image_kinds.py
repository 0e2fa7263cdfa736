"""Kinds of the seventh round in colour, depth and flow."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks, displacement
from tests.benchmarks.foreign_faults.kind import EXACT_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, DEPTH_MAP, FLOW
from tests.benchmarks.foreign_faults.seventh_round import flow, frames, timestamps

_COLOUR: Final = (
    Kind("colour decoded though linear", frames.decoded_though_linear, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "Textures of Unity and Unreal that are flagged as sRGB."),
    Kind("colour numbered from 1", timestamps.colour_numbered_from_1, ("path/rgb_ts", COLOUR_MAP),
         ("rgb:time_offset",), "Blender, whose first frame has the number 1."),
    Kind("colour some frames late for a while", frames.late_for_a_while, ("path/rgb",), ("rgb:time_offset",),
         "Isaac Sim and AirSim, whose renderer falls behind the physics under load.",
         Range(1, 3, "frames", whole=True), local=True,
         debatable="where it falls behind frames occur twice, and where it ends some are left out"),
    Kind("colour sharpened", frames.sharpened, ("path/rgb",), (),
         "Cameras and engines that sharpen by default.", Range(0.4, 2.6, "times")),
    Kind("colour in 16 bits", frames.in_565, ("path/rgb",), (),
         "Render targets of 5, 6 and 5 bits; a coarse step of colour has no name."),
    Kind("colour compressed for a while", frames.compressed_for_a_while, ("path/rgb",), (),
         "Compressed topics whose quality follows the bandwidth.", Range(5, 30, "of 100", whole=True), local=True),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth along the ground", frames.along_the_ground, ("path/depth",), ("depth:depth_ray_not_z",),
         "Gazebo's ray sensors, whose columns have the distance and whose rows have the height.",
         debatable="it is the length of the ray without its height"),
    Kind("depth of two bytes", frames.of_two_bytes, ("path/depth",), ("depth:quantised_values",),
         "CARLA, whose depth is in three bytes of a PNG, read without the lowest."),
    Kind("invalid depth as -1", frames.invalid_as_minus_1, ("path/depth",), ("depth:invalid_encoding",),
         "Renderers that write -1 for a ray that meets nothing."),
    Kind("depth with a channel", frames.with_one_channel, ("path/depth",), ("depth:wrong_shape",),
         "Unity and Isaac Sim, whose annotators give (H, W, 1)."),
    Kind("last batch of depth lost", clocks.cut("depth"), ("path/depth", "path/depth_ts", DEPTH_MAP),
         ("depth:truncated",), "A writer of batches that leaves out the last, incomplete one.", Range(9, 45, "%")),
    Kind("depth when recorded", timestamps.depth_when_recorded, ("path/depth_ts", DEPTH_MAP), ("depth:time_offset",),
         "rosbag's time of recording, in place of the header's.", Range(5, 44, "ms"),
         debatable="times also scatter by a quarter of it"),
    Kind("depth in numbers of frames", timestamps.depth_in_numbers_of_frames, ("path/depth_ts", DEPTH_MAP),
         ("depth:time_unit",), "KITTI, whose files are numbered."),
    Kind("depth upside down for a while", frames.depth_upside_down_for_a_while, ("path/depth",), ("depth:mirrored",),
         "Unity, whose textures begin below on some devices, and captures that were joined.", local=True),
    Kind("tile of depth stale for a while", frames.tile_of_depth_stale, ("path/depth",), ("depth:frozen_frames",),
         "Rendering in tiles, one of which is not drawn again.", local=True),
    Kind("depth of the median for a while", frames.depth_of_the_median_for_a_while, ("path/depth",), (),
         "cv2.medianBlur against speckles, on one batch of files.", Range(2, 6, "px", whole=True), local=True),
    Kind("lens of depth not undone", frames.lens_of_depth, ("path/depth",), (),
         "Kinect and RealSense, whose raw depth is declared as a pinhole.", Range(2, 17, "px", signed=True)),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow of body axes", flow.of_body_axes, FLOW, ("flow:frame_convention", "flow:extrinsic_rotation"),
         "Poses of AirSim, whose cameras look along X, put into a formula for Z.", scenes=EXACT_SCENES,
         debatable="axes are a convention, and the mounting of the camera is left out as well"),
    Kind("flow by 64 in place of 128", displacement.changed(((2, 0), (0, 2))), FLOW, ("flow:flow_gain",),
         "DSEC's flow in 128ths of a pixel, read as KITTI's in 64ths."),
    Kind("flow with the offset of its PNG", flow.offset_left_in, FLOW, (),
         "DSEC's flow in 16 bits, from which 2^15 is not subtracted."),
    Kind("flow of 10 Hz summed in place", flow.summed_in_place, FLOW[:1], (),
         "Longer flow as a sum of short fields, without warping them."),
    Kind("one rate of flow of another run", clocks.from_donor("flow/25hz"), (FLOW[1],), ("flow:other_sequence",),
         "A folder of results that is left from the run before."),
    Kind("invalid flow as 0 for a while", flow.invalid_as_zero_for_a_while, FLOW, ("flow:invalid_encoding",),
         "Two jobs of a conversion, one of which fills arrays with zeros.", local=True),
    Kind("chunks of flow out of order", flow.chunks_out_of_order, (FLOW[2], f"{FLOW[2]}_ts"), ("flow:unsorted",),
         "Workers whose results are appended as they arrive.", local=True),
)  # fmt: skip

IMAGES: Final = (*_COLOUR, *_DEPTH, *_FLOW)
"""Kinds of colour, depth and flow."""

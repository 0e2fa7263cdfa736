"""Kinds of the sixth round in colour, depth and flow."""

from typing import Final

from tests.benchmarks.foreign_faults import displacement, images
from tests.benchmarks.foreign_faults.kind import EXACT_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import FLOW, MAPS
from tests.benchmarks.foreign_faults.sixth_round import flow, frames, timestamps

_COLOUR: Final = (
    Kind("channels as OpenCV has them", images.channels((2, 1, 0)), ("path/rgb",), ("rgb:channel_order",),
         "Readers of AirSim's images, which turn R, G, B round for OpenCV and store the result (AirSim issue 1724)."),
    Kind("colour encoded for a screen", frames.encoded_for_a_screen, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "Renderers whose linear light is encoded once more or once less than declared (FreeCAD-render issue 282)."),
    Kind("exposure adapts for a while", frames.exposure_adapts, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "AirSim, whose automatic exposure disregards the settings without a display (pull request 2518).",
         Range(20, 90, "%", signed=True), local=True),
    Kind("some frames nearly black", frames.now_and_then_nearly_black, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "AirSim, where about one of twenty images is almost black (issue 4967).", Range(2, 11, "%"),
         debatable="nothing but the exposure is wrong, but so far that little is left"),
    Kind("frames rendered again for a while", frames.each_frame_again, ("path/rgb", "path/rgb_ts", *MAPS),
         ("rgb:duplicated_samples",),
         "Genesis, which stored each call of render() at the same time of the simulation (pull request 3106).",
         Range(1, 4, "frames", whole=True), local=True),
    Kind("frames skipped by a slow client", frames.a_part_of_the_frames, ("path/rgb", "path/rgb_ts", *MAPS),
         ("rgb:dropped_samples",), "CARLA outside its synchronous mode (issue 1392).",
         Range(2, 5, "frames", whole=True), local=True),
    Kind("times of colour scatter", timestamps.colour_scatters, ("path/rgb_ts", *MAPS), (),
         "VisEvent, whose files of timestamps do not hold those of the frames (issues 1 and 7).", Range(3, 28, "ms")),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth as DepthPerspective", images.along_rays, ("path/depth",), ("depth:depth_ray_not_z",),
         "AirSim, SceneNet RGB-D and MuJoCo Warp, whose depth was the length of the ray (MuJoCo Warp 1195)."),
    Kind("depth in the driver's metres", images.scaled("path/depth", 1e-3), ("path/depth",), ("depth:unit_mm_m",),
         "Renderers and readers that mean metres where others mean millimetres (point_odyssey issue 16)."),
    Kind("depth in 5000ths of a metre", images.scaled("path/depth", 5.0), ("path/depth",), ("depth:unit_mm_m",),
         "Frames in the encoding of TUM RGB-D, which has 5000 for a metre (Joint-VO-SF issue 4)."),
    Kind("invalid depth as 65535", frames.invalid_as_65535, ("path/depth",), ("depth:invalid_encoding",),
         "DepthAI, whose invalid depth was 65535 in one version and 0 in the next (docs, pull request 156)."),
    Kind("depth through 8 bits", frames.in_8_bits, ("path/depth",), ("depth:quantised_values",),
         "Flightmare, which rendered depth into 8 bits of a channel (issue 51).", Range(30, 100, "m")),
    Kind("last depth frame delivered again for a while", timestamps.last_depth_frame_again,
         ("path/depth", "path/depth_ts", *MAPS), ("depth:duplicated_samples", "depth:dropped_samples"),
         "librealsense, which gives the last frame again, with its time, where one is dropped (issue 1686).",
         Range(5, 60, "%"), local=True, debatable="each frame that occurs again is in the place of one that is lost"),
    Kind("depth requested after colour", timestamps.depth_early, ("path/depth_ts", *MAPS), ("depth:time_offset",),
         "AirSim, where Scene and Depth are rendered one after the other (issues 244 and 275).", Range(4, 40, "ms")),
    Kind("depth of Linear01Depth", frames.share_of_a_shorter_range, ("path/depth",), (),
         "AI2-THOR, which multiplied a share of the far plane by far less near (issue 1301).", Range(0.05, 1, "m")),
    Kind("depth inflated", frames.near_things_inflated, ("path/depth",), (),
         "MVSEC, whose depth is accumulated over scans, so that objects look inflated (issue 7).",
         Range(1, 4, "px", whole=True)),
    Kind("grey frames for depth", frames.grey_in_place_of_depth, ("path/depth",), (),
         "AirSim, whose topic of DepthPlanar held grey frames of colour (issues 3648 and 3716)."),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow with Blender's sign of u", displacement.changed(((-1, 0), (0, 1))), FLOW, ("flow:frame_convention",),
         "Blender's vectors, which are (-column, row) (kubric issue 152, SURREAL issue 35)."),
    Kind("flow in 10 bits", flow.in_10_bits, FLOW, ("flow:quantised_values",),
         "CARLA, whose flow has steps of 1/1024 of half the image (issue 5514)."),
    Kind("flow overwritten by backward flow", displacement.backwards, FLOW, ("flow:flow_sign",),
         "BlenderProc, where one of two outputs overwrote the other (issue 684).", scenes=EXACT_SCENES),
    Kind("flow resized and not scaled", flow.of_another_size, FLOW, ("flow:flow_gain",),
         "Resized fields of TartanAir and of networks, whose vectors keep their length (tartanair_tools issue 29).",
         Range(1.2, 4, "times", signed=True)),
    Kind("flow read by OpenCV", displacement.changed(((0, 1), (1, 0))), FLOW, ("flow:axes_swapped",),
         "PNG files in the encoding of KITTI, whose channels OpenCV gives in reverse."),
)  # fmt: skip

IMAGES: Final = (*_COLOUR, *_DEPTH, *_FLOW)
"""Kinds of colour, depth and flow."""

"""Kinds of the eighth round in colour, depth and flow."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks, transport
from tests.benchmarks.foreign_faults.eighth_round import flow, frames
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, DEPTH_MAP, FLOW

_COLOUR: Final = (
    Kind("colour through a filmic curve", frames.with_a_filmic_curve, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "Unreal, Unity and Isaac Sim, whose tone mapping is that of ACES by default.", Range(0.6, 1.8, "times")),
    Kind("colour at a default rate", frames.at_a_default_rate, ("path/rgb_ts", COLOUR_MAP), ("rgb:clock_rate",),
         "Blender's 24, ffmpeg's 25, OpenCV's 30 and Unity's 60 frames in a second."),
    Kind("colour behind its warm-up", frames.behind_warm_up, ("path/rgb",), ("rgb:time_offset",),
         "Isaac Sim, whose renderer gives its first frame again until it is warm.",
         Range(1, 4, "frames", whole=True)),
    Kind("batch of colour shuffled", frames.batch_shuffled, ("path/rgb",), ("rgb:swapped_frames",),
         "A pool of workers whose results are taken as they are ready.", local=True,
         debatable="frames are not only exchanged with their neighbours"),
    Kind("colour with channels first", frames.channels_first, ("path/rgb",), ("rgb:wrong_shape",),
         "Tensors of PyTorch."),
    Kind("colour of a slower camera", transport.held("rgb", "path/rgb"), ("path/rgb",), ("rgb:frozen_frames",),
         "Recorders that store the last frame at each tick.", Range(9, 27, "Hz")),
    Kind("colour below a title bar", frames.below_a_title_bar, ("path/rgb",), ("rgb:spatial_offset",),
         "Windows of Gazebo and Flightmare that are recorded from the screen.", Range(4, 16, "px", whole=True)),
    Kind("corners of colour darker for a while", frames.corners_darker_for_a_while, ("path/rgb",),
         ("rgb:vignetting",), "A post-process volume of Unreal through which the camera flies.", Range(16, 62, "%"),
         local=True),
    Kind("both eyes side by side", frames.both_eyes_side_by_side, ("path/rgb",), (),
         "Stereo of Unity and ZED, whose views are halves of one image.",
         debatable="the focal length of columns is half of what is declared, in two images"),
    Kind("guards of propellers in colour", frames.guards_in_view, ("path/rgb",), (),
         "Vehicles that only the camera of colour sees.", Range(9, 30, "%"),
         debatable="frozen_frames describes a region that never changes, but frames are fresh"),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth in whole metres", frames.in_whole_metres, ("path/depth",), ("depth:quantised_values",),
         "astype(int) of metres, before they become millimetres."),
    Kind("depth of the next tick", frames.of_the_next_tick, ("path/depth",), ("depth:time_offset",),
         "Queues of CARLA's sensors, of which one is a tick ahead.", Range(1, 3, "frames", whole=True)),
    Kind("times of depth in single precision", clocks.single_precision_seconds("depth"), ("path/depth_ts", DEPTH_MAP),
         ("depth:quantised_time",), "Tables of PyTorch and MATLAB with seconds as float32.",
         Range(40_000, 260_000, "s")),
    Kind("border of depth as 0", frames.border_of_zeros, ("path/depth",), ("depth:invalid_encoding",),
         "cv2.remap, which fills what lies outside with 0.", Range(2, 14, "px", whole=True)),
    Kind("times of depth left out", frames.times_left_out, ("path/depth_ts",), ("depth:missing_stream",),
         "Frames in files whose names were their times."),
    Kind("invalid depth as infinite for a while", frames.invalid_as_infinite_for_a_while, ("path/depth",),
         ("depth:invalid_encoding",), "Batches of two versions of a renderer.", local=True),
    Kind("depth frames written twice", clocks.doubled_rows("depth"), ("path/depth", "path/depth_ts", DEPTH_MAP),
         ("depth:duplicated_samples",), "Bags that were split with an overlap, and merged by time.", local=True),
    Kind("first depth frames of the run before", frames.first_frames_of_the_run_before, ("path/depth",),
         ("depth:other_sequence",), "A buffer of a renderer that a reset of the simulation leaves filled.",
         Range(1, 6, "frames", whole=True)),
    Kind("rays of depth with 90 degrees", frames.rays_of_default_angle, ("path/depth",), (),
         "Conversions of AirSim's DepthPerspective with its default angle of view.",
         debatable="depth_ray_not_z means the whole length of the ray, and this is less than z"),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow in px/ms", flow.per_millisecond, FLOW, ("flow:flow_unit",),
         "Libraries for events, whose unit of speed is px/ms."),
    Kind("flow in whole pixels", flow.in_whole_pixels, FLOW, ("flow:quantised_values",),
         "astype(int16) without a factor."),
    Kind("intervals of flow in nanoseconds", flow.intervals_in_nanoseconds, flow.FLOW_TIMES, ("flow:time_unit",),
         "Times of ROS 2 in the headers of a node for flow."),
    Kind("intervals of flow without ends", flow.intervals_without_ends, flow.FLOW_TIMES, ("flow:wrong_shape",),
         "MVSEC, where a field has one time."),
    Kind("flow in any order", flow.in_any_order, FLOW, ("flow:swapped_frames",),
         "os.listdir, whose order is that of the disk.",
         debatable="fields are not only exchanged with their neighbours"),
    Kind("tile of flow not computed for a while", flow.tile_not_computed_for_a_while, FLOW, ("flow:nan_in_stream",),
         "Computation in tiles, one of which ran out of memory.", local=True),
    Kind("flow of half the rate for a while", flow.of_half_the_rate_for_a_while, FLOW[2:],
         ("flow:flow_rate_mixed",), "A batch that is started with every other frame.", local=True),
)  # fmt: skip

IMAGES: Final = (*_COLOUR, *_DEPTH, *_FLOW)
"""Kinds of colour, depth and flow."""

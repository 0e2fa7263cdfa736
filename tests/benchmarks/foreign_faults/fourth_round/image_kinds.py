"""Kinds of the fourth round in colour, depth and flow."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks, images
from tests.benchmarks.foreign_faults.fourth_round import flow, frames, timestamps
from tests.benchmarks.foreign_faults.kind import EXACT_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import FLOW, MAPS

_COLOUR: Final = (
    Kind("histogram of colour equalised", frames.histogram_equalised, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "cv2.equalizeHist on each frame, as preparation for feature tracking."),
    Kind("exposures of colour alternate", frames.exposures_alternate, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "Sequencers of machine-vision cameras, which take brackets for HDR.", Range(1.7, 4.3, "times")),
    Kind("colour in floating point", frames.in_floating_point, ("path/rgb",), ("rgb:wrong_dtype",),
         "ToTensor of torchvision, whose images are float32 from 0 to 1."),
    Kind("lens breathes for a while", frames.lens_breathes_for_a_while, ("path/rgb",),
         ("metadata:intrinsics_focal",), "Automatic focus, which changes the angle of view as it searches.",
         Range(3.1, 9.7, "%"), local=True),
    Kind("slice of colour concealed for a while", frames.slice_concealed_for_a_while, ("path/rgb",),
         ("rgb:frozen_frames",), "Decoders of H.264, which repeat a slice whose packets are lost.",
         Range(19, 53, "%"), local=True, debatable="a part of each frame is frozen, and the rest moves on"),
    Kind("colour stamped by batch", timestamps.by_batch, ("path/rgb_ts", *MAPS), ("rgb:quantised_time",),
         "Frame grabbers that interrupt once for several frames.", Range(2, 5, "frames", whole=True),
         debatable="on the mean, frames are also late by half a batch"),
    Kind("sectors of colour lost", frames.sectors_lost, ("path/rgb",), ("rgb:corrupt_chunk",),
         "A flash card with bad sectors, copied with ddrescue.", local=True),
    Kind("colour rolls for a while", frames.rolls_for_a_while, ("path/rgb",), ("rgb:spatial_offset",),
         "Receivers that lose the start of a frame, and count lines from where they are.", Range(11, 43, "%"),
         local=True, debatable="what leaves the image below comes in above"),
    Kind("colour as luma and chroma", frames.as_luma_and_chroma, ("path/rgb",), (),
         "cv2.COLOR_RGB2YCrCb before an encoder that was turned off.",
         debatable="channel_order describes another order of R, G and B, and these are other quantities"),
    Kind("times burnt into colour", frames.times_burnt_in, ("path/rgb",), (),
         "Overlays of drones and of cv2.putText.", Range(2, 5, "px", whole=True)),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth in milliseconds", clocks.in_unit("depth", 1e-3), ("path/depth_ts", *MAPS), ("depth:time_unit",),
         "get_timestamp of librealsense."),
    Kind("left border of depth invalid", frames.depth_left_border_invalid, ("path/depth",), ("depth:nan_in_stream",),
         "Stereo matching, which finds no partner for the first columns.", Range(4.3, 19, "%"),
         debatable="NaN also encodes what has no depth, but these pixels have one"),
    Kind("depth in 256ths of a metre", images.scaled("path/depth", 0.256), ("path/depth",), ("depth:unit_mm_m",),
         "Depth of KITTI's development kit, read without its division."),
    Kind("depth not destaggered", frames.depth_staggered, ("path/depth",), ("depth:spatial_offset",),
         "Range images of Ouster's lidars, whose lasers look in different directions.",
         Range(1, 4, "px", whole=True), debatable="every fourth row is in its place"),
    Kind("depth shorter than its timestamps", frames.depth_shorter_than_its_timestamps, ("path/depth",),
         ("depth:truncated", "depth:wrong_shape"), "An encoder that is closed before its last frames are flushed.",
         Range(11, 47, "%"), debatable="frames end early, and their number is not that of the timestamps"),
    Kind("depth of the nearest in a block", frames.depth_of_nearest_in_block, ("path/depth",), (),
         "Pooling for obstacle avoidance, as in PX4's collision prevention.", Range(3, 9, "px", whole=True)),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow with channels first", flow.channels_first, FLOW, ("flow:wrong_shape",),
         "Tensors of PyTorch, written as they are."),
    Kind("flow in doubles", flow.in_doubles, FLOW, ("flow:wrong_dtype",), "NumPy's default type."),
    Kind("flow invalid where it leaves the image", flow.invalid_outside, FLOW, ("flow:nan_in_stream",),
         "Masks of KITTI's flow_noc, applied to vectors.",
         debatable="NaN also encodes what has no flow, but these pixels have some"),
    Kind("names of flow rates exchanged", flow.names_of_rates_exchanged, ("path/flow/10hz", "path/flow/10hz_ts",
         "path/flow/25hz", "path/flow/25hz_ts"), ("flow:flow_rate_mixed",),
         "zip of two lists of names, one of which is sorted."),
    Kind("flow written twice by a restarted job", flow.written_twice, ("path/flow",), ("flow:duplicated_samples",),
         "Jobs that start again before their last checkpoint, whose results are merged by time.", local=True),
    Kind("flow of smaller images for a while", flow.shrunk_for_a_while, FLOW, ("flow:flow_gain",),
         "Nodes with less memory, which halve images and not the unit of vectors.", Range(1.4, 2.9, "times"),
         local=True),
    Kind("flow through colours", flow.through_colours, FLOW, ("flow:quantised_values",),
         "Pictures of flow by hue and value, as in OpenCV's example, decoded again."),
    Kind("intervals of flow centred on their start", timestamps.centred_on_start,
         tuple(f"{key}_ts" for key in FLOW), ("flow:time_offset",),
         "Windows of a time series, which pandas can centre on their label."),
    Kind("flow of a plane", flow.of_a_plane, FLOW, (), "A homography of frames, taken for the flow of all points.",
         scenes=EXACT_SCENES),
)  # fmt: skip

IMAGES: Final = (*_COLOUR, *_DEPTH, *_FLOW)
"""Kinds of colour, depth and flow."""

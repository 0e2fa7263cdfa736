"""Kinds of the fifth round in colour, depth and flow."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks, displacement, images
from tests.benchmarks.foreign_faults.fifth_round import depth, flow, frames, timestamps
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, FLOW, MAPS

_COLOUR: Final = (
    Kind("colour encoded for a while", frames.encoded_for_a_while, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "Parts of a render that were saved as PNG with a view transform, and not as EXR.", local=True),
    Kind("colour moved by parts of a pixel", frames.moved_by_part_of_a_pixel, ("path/rgb",),
         ("rgb:spatial_offset", "metadata:intrinsics_centre"),
         "Pyramids of images whose levels have their corners in common, not their middles.",
         Range(0.41, 0.93, "px", signed=True), debatable="a shift of the image is one of the principal point"),
    Kind("columns of colour stretched", frames.columns_stretched, ("path/rgb",), ("metadata:intrinsics_focal",),
         "Pixels of PAL and NTSC, which are not square.", Range(2.7, 11, "%", signed=True)),
    Kind("bands of lamps in colour", frames.bands_of_lamps, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "A rolling shutter under lamps on alternating current.", Range(9, 31, "%"),
         debatable="rows have different exposures, and their mean is nearly right"),
    Kind("colour occurs again when its trigger bounces", timestamps.trigger_bounces,
         ("path/rgb", "path/rgb_ts", COLOUR_MAP), ("rgb:duplicated_samples",),
         "A trigger line without a debounce, and a camera that sends its last frame again.", Range(7, 29, "%"),
         debatable="the copies have times of their own, a little later"),
    Kind("colour stands still at its end", frames.still_at_the_end, ("path/rgb",),
         ("rgb:frozen_frames", "rgb:truncated"), "Encoders that fill up to the length of another stream.",
         Range(13, 41, "%"), debatable="frames end early, and what follows is frozen"),
    Kind("colour without channels", frames.without_channels, ("path/rgb",), ("rgb:wrong_shape",),
         "cv2.IMREAD_GRAYSCALE, and mono8 of ROS."),
    Kind("shading off the middle", frames.shaded_off_the_middle, ("path/rgb",), ("rgb:vignetting",),
         "A lens that is not centred before its sensor.", Range(23, 61, "%"),
         debatable="one side gets darker more than the others"),
    Kind("channels in sequence", frames.channels_in_sequence, ("path/rgb",), (),
         "Filter wheels, and projectors of one chip, which show one colour after the other.",
         debatable="red is late, blue is early, and green is right"),
    Kind("colour noisy for a while", frames.noisy_for_a_while, ("path/rgb",), (),
         "Automatic gain in the shade.", Range(7, 23, "DN"), local=True),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth mirrored", images.flipped("path/depth", 2), ("path/depth",), ("depth:mirrored",),
         "OpenNI's mirror mode, set for one of two topics."),
    Kind("depth in quarters of a millimetre", images.scaled("path/depth", 4.0), ("path/depth",),
         ("depth:unit_mm_m",), "Frames of a RealSense L515, whose unit is 0.25 mm."),
    Kind("every other depth frame late", timestamps.every_other_late, ("path/depth_ts", *MAPS),
         ("depth:time_offset",), "Two buffers that take turns, one of which is emptied later.",
         Range(3.1, 9.7, "ms"), debatable="the other frames have their own times"),
    Kind("holes of depth kept from before", depth.holes_kept_from_before, ("path/depth",),
         ("depth:invalid_encoding",), "Persistence of librealsense's temporal filter.",
         debatable="what stays without depth all the time is NaN"),
    Kind("depth of even surfaces invalid", depth.even_surfaces_invalid, ("path/depth",), ("depth:nan_in_stream",),
         "Thresholds of texture in stereo matching.", Range(17, 53, "%"),
         debatable="NaN also encodes what has no depth, but these pixels have one"),
    Kind("depth of another sequence for a while", clocks.from_donor("depth"), ("path/depth",),
         ("depth:other_sequence",), "Two simulators that write to one shared memory.", local=True),
    Kind("disparity with an offset", depth.disparity_off, ("path/depth",), (),
         "Stereo whose cameras turn towards each other as the mount warms up.", Range(0.27, 0.93, "px")),
    Kind("columns of depth swept", depth.columns_swept, ("path/depth",), (),
         "Rotating lidars, whose columns are of different times.", Range(43, 97, "ms"),
         debatable="columns at one side are late, and at the other early"),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow with u to the left", displacement.changed(((-1, 0), (0, 1))), FLOW, ("flow:frame_convention",),
         "A matrix of projection whose first row has the other sign."),
    Kind("slow flow from fast flow", flow.of_the_fastest_rate, ("path/flow/10hz", "path/flow/25hz"),
         ("flow:flow_rate_mixed",), "Scripts that multiply a field by the number of frames.",
         debatable="vectors are as long as those of the rate, if motion is even"),
    Kind("holes of flow filled", flow.holes_filled, FLOW, ("flow:invalid_encoding",),
         "Networks and EpicFlow, which give each pixel a vector."),
    Kind("flow of the interval before for a while", flow.of_the_interval_before_for_a_while, FLOW,
         ("flow:flow_interval_shifted",), "A job that starts again one pair too early.", local=True),
    Kind("flow in px/s for a while", flow.per_second_for_a_while, FLOW, ("flow:flow_unit",),
         "Shards of a data set that two versions of a script wrote.", local=True),
    Kind("bits of flow flip on a disk", flow.bits_flip_on_a_disk, FLOW, ("flow:corrupt_chunk",),
         "A disk that ages, without checks of its own.", local=True),
    Kind("flow zero for a while", flow.zero_for_a_while, FLOW, (),
         "np.zeros of the expected length, and a worker that fails without a word.", local=True,
         debatable="frozen_frames and invalid_encoding each describe a part of it"),
    Kind("intervals of flow as start and length", timestamps.start_and_length, tuple(f"{key}_ts" for key in FLOW), (),
         "Subtitles, and tables of video annotation.",
         debatable="times are not wrong, but the second one is no time"),
    Kind("flow of a coarse grid", flow.of_a_coarse_grid, FLOW, (),
         "Networks that compute at an eighth of the size.", Range(9, 27, "px", whole=True)),
)  # fmt: skip

IMAGES: Final = (*_COLOUR, *_DEPTH, *_FLOW)
"""Kinds of colour, depth and flow."""

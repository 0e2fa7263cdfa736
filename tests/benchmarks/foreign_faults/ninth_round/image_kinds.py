"""Kinds of the ninth round in colour, depth and flow."""

from typing import Final

from tests.benchmarks.foreign_faults.kind import EXACT_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.ninth_round import flow, frames
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, FLOW

_COLOUR: Final = (
    Kind("colour raised in bytes that wrap", frames.brighter_in_bytes, ("path/rgb",), ("rgb:exposure_or_gamma",),
         "NumPy's multiplication of uint8, or astype(np.uint8) without np.clip.", Range(25, 120, "%"),
         debatable="what wraps is no exposure"),
    Kind("colour like the last left out", frames.like_the_last_left_out, ("path/rgb", "path/rgb_ts", COLOUR_MAP),
         ("rgb:dropped_samples",), "ffmpeg's mpdecimate.", Range(15, 50, "%")),
    Kind("hood before the lens", frames.behind_a_hood, ("path/rgb",), ("rgb:vignetting",),
         "Hoods, filters and housings that are too narrow for the lens.", Range(9, 32, "%"),
         debatable="what lies behind a hood is black"),
    Kind("mount of colour loose for a while", frames.shaken_for_a_while, ("path/rgb",), ("rgb:spatial_offset",),
         "A camera that resonates with the rotors at one of their speeds.", Range(1.5, 7, "px"), local=True,
         debatable="the shift is another one in each frame"),
    Kind("some colour frames of the run before", frames.some_of_the_run_before, ("path/rgb",),
         ("rgb:other_sequence",), "A swap chain of buffers, one of which is never drawn into.",
         Range(2, 6, "frames", whole=True)),
    Kind("colour turned by half for a while", frames.turned_by_half_for_a_while, ("path/rgb",), ("rgb:mirrored",),
         "EXIF's orientation, which changes when the vehicle rolls or is upside down, and is not applied.",
         local=True),
    Kind("colour from alpha on", frames.alpha_first, ("path/rgb",), ("rgb:channel_order",),
         "ARGB of Unity's and Apple's buffers, read as RGBA.", debatable="blue is lost as well"),
    Kind("still blocks of colour kept for a while", frames.still_blocks_kept_for_a_while, ("path/rgb",),
         ("rgb:frozen_frames",), "Remote desktops and codecs of low delay, which send what has changed.",
         Range(3, 14, "DN"), local=True, debatable="parts of frames are frozen, at other times each"),
    Kind("bloom of colour", frames.bloom, ("path/rgb",), (), "Unreal's bloom, which is on by default.",
         Range(20, 90, "%"), debatable="exposure_or_gamma describes the frame's brightness, which rises as well"),
)  # fmt: skip

_DEPTH: Final = (
    Kind("depth padded for a network", frames.padded_for_a_network, ("path/depth",),
         ("metadata:intrinsics_focal", "metadata:intrinsics_centre"),
         "MiDaS and stereo networks, whose padding is resized and not cut off.",
         debatable="focal lengths and the centre are both those of another size"),
    Kind("edges of depth invalid for a while", frames.edges_invalid_for_a_while, ("path/depth",),
         ("depth:nan_in_stream",), "A check of stereo from left to right, which is turned on for one batch.",
         Range(2, 7, "px", whole=True), local=True),
    Kind("depth in bytes for a while", frames.in_bytes_for_a_while, ("path/depth",), ("depth:quantised_values",),
         "Previews in 8 bits, taken where the full frames are absent.", Range(60, 240, "mm"), local=True),
    Kind("depth in millimetres twice", frames.in_millimetres_twice, ("path/depth",), ("depth:unit_mm_m",),
         "Two stages of a conversion, each of which takes metres."),
    Kind("depth faded from a lower rate", frames.faded_from_a_lower_rate, ("path/depth",), (),
         "scipy's interp1d over frames of a slower sensor.", Range(6, 20, "frames", whole=True)),
)  # fmt: skip

_FLOW: Final = (
    Kind("flow of another focal length of rows", flow.of_rows_with_another_focal_length, FLOW,
         ("flow:intrinsics_focal",), "A vertical angle of view that follows from a ratio of sides of another window.",
         Range(9, 40, "%", signed=True), scenes=EXACT_SCENES),
    Kind("flow made again from the published pose", flow.of_the_published_pose, FLOW,
         ("flow:flow_from_noisy_pose",), "Users who make flow at their own rate from depth and pose of the file.",
         scenes=("park-noisy",)),
    Kind("slow flow masked", flow.without_what_is_slow, FLOW, ("flow:nan_in_stream",),
         "Masks of static background, made for evaluation and applied before saving.", Range(5, 30, "%")),
    Kind("flow with a channel of validity", flow.with_validity, FLOW, ("flow:wrong_shape",),
         "KITTI's and DSEC's three channels as an array."),
    Kind("flow flipped at random", flow.flipped_at_random, FLOW, ("flow:mirrored",),
         "RandomHorizontalFlip of a loader from which a cache of truth was written.", Range(25, 75, "%"),
         debatable="some fields are right"),
    Kind("flow with v upwards for a while", flow.upwards_for_a_while, FLOW, ("flow:frame_convention",),
         "Workers with two drivers of graphics, Direct3D and OpenGL.", local=True),
    Kind("flow smoothed for a while", flow.smoothed_for_a_while, FLOW, (),
         "A variational method, whose smoothness grows where images are dark.", Range(6, 16, "px"), local=True),
)  # fmt: skip

IMAGES: Final = (*_COLOUR, *_DEPTH, *_FLOW)
"""Kinds of colour, depth and flow."""

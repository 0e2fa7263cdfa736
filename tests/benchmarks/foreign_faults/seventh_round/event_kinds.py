"""Kinds of the seventh round in events, in the maps into them and in what is declared of cameras."""

from typing import Final

from tests.benchmarks.foreign_faults.kind import QUIET_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENTS
from tests.benchmarks.foreign_faults.seventh_round import declarations, events

_EVENTS: Final = (
    Kind("events clamped at the border", events.clamped_at_the_border, EVENTS, ("events:spatial_offset",),
         "Converters that subtract a margin and clip what is left to the sensor.",
         Range(1, 6, "px", signed=True, whole=True)),
    Kind("polarities of -1 and 1", events.polarity_of_minus_1, ("path/events/p",), ("events:wrong_dtype",),
         "ESIM, v2e and MVSEC, whose polarities are -1 and 1.",
         debatable="the code of the values is another one as well"),
    Kind("pixels behind their times", events.pixels_behind_their_times, EVENTS, ("events:time_offset",),
         "Columns of a table that are written from buffers of their own, one of which began later.",
         Range(160, 2_600, "events", whole=True),
         debatable="the lateness of a time changes with the rate of events"),
    Kind("dark pixels noisy", events.dark_pixels_noisy, EVENTS, ("events:noise_misdeclared",),
         "v2e, whose shot noise is greatest where it is dark.", Range(2.6, 27, "Hz")),
    Kind("tile of the sensor late", events.tile_late, EVENTS, ("events:time_offset",),
         "Simulation in tiles, one of which is computed from the frame before.", Range(6, 41, "ms")),
    Kind("tile of the sensor thinned for a while", events.tile_thinned, EVENTS, ("events:dropped_samples",),
         "A worker for a part of the image whose buffer of events is full.", Range(35, 88, "%"), local=True),
    Kind("event axes exchanged for a while", events.axes_exchanged_for_a_while, EVENTS, ("events:axes_swapped",),
         "Two batches of a conversion, one of which takes rows for columns.", local=True),
    Kind("events between frames for a while", events.between_frames_for_a_while, EVENTS,
         ("events:interpolated_frames",), "vid2e, whose adaptive rendering is turned off for a part of the video.",
         scenes=QUIET_SCENES, local=True),
)  # fmt: skip

_MAPS: Final = (
    Kind("colour map to the event before", events.colour_map_to_the_event_before, (COLOUR_MAP,),
         ("rgb_to_event:index_off_by_one",), "MVSEC's image_raw_event_inds, which lead to an event before the frame."),
    Kind("depth map off for a while", events.depth_map_off_for_a_while, (DEPTH_MAP,),
         ("depth_to_event:index_off_by_one",), "Batches whose maps are joined with a row of overlap.",
         Range(1, 60, "events", signed=True, whole=True), local=True),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("colour at half size, K kept", declarations.colour_at_half_size, ("path/rgb", CAMERA + "rgb"),
         ("metadata:intrinsics_focal", "metadata:intrinsics_centre"),
         "Images that are made smaller to save space, beside the calibration of the full size.",
         debatable="focal length and centre are both those of another size"),
    Kind("centre of colour at the corner", declarations.centre_of_colour_at_the_corner, (CAMERA + "rgb",),
         ("metadata:intrinsics_centre",), "A K of a renderer whose origin is the middle of the image."),
    Kind("colour camera declared upside down", declarations.colour_camera_upside_down, (CAMERA + "rgb",),
         ("metadata:extrinsic_rotation",), "A driver that turns the image of a camera mounted upside down; tf stays."),
    Kind("mounting of the left eye", declarations.depth_of_the_left_eye, (CAMERA + "depth",),
         ("metadata:lever_arm",), "Depth of the right camera with the extrinsics of the left one.",
         Range(0.08, 0.5, "m")),
    Kind("mounting of depth inverted", declarations.depth_alone_inverted, (CAMERA + "depth",),
         ("metadata:extrinsic_rotation", "metadata:frame_convention"),
         "tf2's lookup_transform with source and target exchanged for one camera.",
         debatable="the direction of a transform is a convention, and the declared mounting is wrong as well"),
    Kind("K of raw events", declarations.raw_events, (CAMERA + "events",),
         ("metadata:intrinsics_focal", "metadata:intrinsics_centre"),
         "DSEC and M3ED, where events are rectified, and the raw K is copied.", Range(3, 16, "%", signed=True),
         debatable="focal length and centre are both those of the raw image"),
    Kind("events of the right eye", events.of_the_right_eye, EVENTS, ("metadata:lever_arm",),
         "MVSEC and DSEC, of which the right sensor is read with the left calibration.", Range(0.13, 0.55, "m"),
         debatable="the events are of another camera, or the mounting of other events"),
)  # fmt: skip

EVENT_KINDS: Final = (*_EVENTS, *_MAPS, *_DECLARATIONS)
"""Kinds of events, index maps and cameras."""

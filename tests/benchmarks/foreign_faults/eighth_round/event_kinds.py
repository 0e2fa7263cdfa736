"""Kinds of the eighth round in events, in the maps into them and in what is declared of cameras and ranges."""

from typing import Final

from tests.benchmarks.foreign_faults import clocks, index_maps
from tests.benchmarks.foreign_faults.eighth_round import declarations, events
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENT_TIME, EVENTS
from tests.benchmarks.foreign_faults.third_round.kinds import LOGARITHMIC_SCENES

_EVENTS: Final = (
    Kind("events of light with an offset", events.of_light_with_an_offset, EVENTS,
         ("events:event_model_misdeclared", "events:threshold_misdeclared"),
         "ESIM and its followers, which add a constant to light before they take its logarithm.",
         Range(6, 60, "DN"), scenes=LOGARITHMIC_SCENES,
         debatable="the constant is a part of the sensor's model, and acts as a larger threshold where it is dark"),
    Kind("darker events of a preset", events.darker_of_a_preset, EVENTS, ("events:threshold_misdeclared",),
         "v2e, whose --dvs_params replace the thresholds that a command gives.", Range(14, 90, "%"),
         scenes=LOGARITHMIC_SCENES),
    Kind("events in milliseconds", clocks.in_unit("events", 1e-3), EVENT_TIME, ("events:time_unit",),
         "Converters to the unit of a player or a network.", debatable="times are rounded as well"),
    Kind("places of events in doubles", events.places_in_doubles, ("path/events/x", "path/events/y"),
         ("events:wrong_dtype",), "MVSEC, whose events are rows of float64."),
    Kind("last buffer of events not emptied", events.last_buffer_not_emptied, ("path/events",),
         ("events:duplicated_samples", "events:unsorted"),
         "Writers that store the whole of a buffer that is filled in part.",
         Range(700, 9_000, "events", whole=True),
         debatable="what occurs again is also behind later events"),
    Kind("seam of tiles doubled", events.seam_doubled, EVENTS, ("events:duplicated_samples",),
         "Simulation in tiles, which overlap so that borders are right.", Range(4, 22, "px", whole=True)),
    Kind("batch of events timed from its beginning", events.batch_from_its_own_beginning, ("path/events/t",),
         ("events:unsorted", "events:time_offset"),
         "Converters of many files, whose times each begin at zero.", local=True,
         debatable="events are in order as they are stored, and those of one batch are early by one constant"),
    Kind("tile of the sensor noisy for a while", events.tile_noisy_for_a_while, EVENTS, ("events:noise_misdeclared",),
         "Jobs for a tile and a part of the time, one of which has noise turned on.", Range(5, 60, "Hz"), local=True),
    Kind("numbers of pixels of another width", events.numbers_of_another_width, EVENTS, (),
         "np.unravel_index with the shape of another sensor.", Range(1, 6, "px", signed=True, whole=True)),
)  # fmt: skip

_MAPS: Final = (
    Kind("colour map counts lines of its text", index_maps.moved("rgb"), (COLOUR_MAP,),
         ("rgb_to_event:index_off_by_one",), "Numbers of lines in a text of events that begins with a comment.",
         Range(1, 9, "lines", whole=True)),
    Kind("depth map without its first entries", events.depth_map_without_first_entries, (DEPTH_MAP,),
         ("depth_to_event:truncated", "depth_to_event:wrong_shape"),
         "Entries of frames before the first event, which a writer leaves out.", Range(1, 6, "entries", whole=True),
         debatable="the beginning is absent, and the length is that of no other dataset"),
    Kind("colour map of milliseconds", events.colour_map_of_milliseconds, (COLOUR_MAP,), (),
         "DSEC's ms_to_idx, taken for a map of frames."),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("K of the calibration's size", declarations.intrinsics_of_calibration, (CAMERA + "depth",),
         ("metadata:intrinsics_focal", "metadata:intrinsics_centre"),
         "Depth that is published smaller than the images of its calibration.", Range(1.2, 4, "times"),
         debatable="focal length and centre are both those of another size"),
    Kind("events declared with 90 degrees", declarations.events_of_default_angle, (CAMERA + "events",),
         ("metadata:intrinsics_focal",), "CARLA, AirSim and Unreal, whose angle of view is 90 degrees by default."),
    Kind("colour camera declared to the side", declarations.colour_to_the_side, (CAMERA + "rgb",),
         ("metadata:extrinsic_rotation",), "A rig of several cameras, of which another one's mounting is taken.",
         Range(20, 120, "deg", signed=True)),
    Kind("mounting of events left-handed", declarations.events_left_handed, (CAMERA + "events",),
         ("metadata:frame_convention", "metadata:extrinsic_rotation"),
         "Unreal and CARLA, whose Y points right.",
         debatable="the hand of axes is a convention, and the declared mounting is wrong as well"),
    Kind("gravity declared as 1", declarations.gravity_in_g, ("metadata/imu",),
         ("metadata:gravity_magnitude", "imu:gravity_magnitude"),
         "Configurations of IMUs, whose unit of acceleration is g."),
    Kind("range of depth of another sensor", declarations.range_of_another_sensor, ("metadata/depth_range",), (),
         "A data sheet of a RealSense or a Kinect beside depth of a renderer.", Range(3.2, 17, "m"),
         debatable="invalid_encoding describes values beyond a range, and these are right"),
)  # fmt: skip

EVENT_KINDS: Final = (*_EVENTS, *_MAPS, *_DECLARATIONS)
"""Kinds of events, index maps, cameras and ranges."""

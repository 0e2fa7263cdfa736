"""The fifth round: kinds of faults that were written when the first four had been looked at."""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import clocks, images, inertial, poses, sensor
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.fifth_round import declarations, events, thresholds, timestamps
from tests.benchmarks.foreign_faults.fifth_round.image_kinds import IMAGES
from tests.benchmarks.foreign_faults.fifth_round.sample_kinds import SAMPLES
from tests.benchmarks.foreign_faults.inertial import ACCELEROMETER
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, DEPTH_MAP, EVENT_TIME, EVENTS, POSE
from tests.benchmarks.foreign_faults.third_round.kinds import LOGARITHMIC_SCENES

_EVENTS: Final = (
    Kind("high word of event times late", timestamps.high_word_late, EVENTS,
         ("events:time_jitter", "events:time_offset"),
         "EVT 3.0, where a decoder takes TIME_LOW of a new range before its TIME_HIGH; a merge sorts afterwards.",
         Range(7, 31, "%"), debatable="some events are early by one constant, and the others have their own times"),
    Kind("events of a row share a time", timestamps.of_first_request_of_row, EVENTS,
         ("events:quantised_time", "events:time_jitter"),
         "Sensors that note when a row first asks to be read, and read it later.", Range(1.7, 7.1, "ms"),
         debatable="there is no grid of all times, but one of each row that begins with an event"),
    Kind("events of what is near alone", events.nothing_far_away, EVENTS, ("events:dropped_samples",),
         "Engines that cull far objects for the cameras of an event simulator, to render at 1000 Hz.",
         Range(7.9, 14, "m"), debatable="regions give no events, and move with the scene"),
    Kind("halves of the sensor apart", events.halves_apart, EVENTS, ("events:spatial_offset",),
         "Sensors of two dies, whose gap counts as columns.", Range(1, 4, "px", whole=True),
         debatable="events of the other half are in their places"),
    Kind("comparators kick back", events.comparators_kick_back, EVENTS, ("events:noise_misdeclared",),
         "A reset that couples into the pixel, as DVS with high gain have it.", Range(9, 47, "%"),
         debatable="the added events follow events, and noise does not"),
    Kind("thresholds differ by pixel", thresholds.differ_by_pixel, EVENTS,
         ("events:threshold_misdeclared", "events:noise_misdeclared"),
         "Transistors that do not match; ESIM draws a contrast for each pixel.", Range(17, 43, "%"),
         scenes=LOGARITHMIC_SCENES,
         debatable="thresholds scatter about the declared one, and threshold_sigma says that they do not"),
    Kind("threshold grows in time", thresholds.grow_in_time, EVENTS, ("events:threshold_misdeclared",),
         "Biases that drift while the sensor warms up.", Range(47, 190, "%"), scenes=LOGARITHMIC_SCENES),
    Kind("flashes of motion capture for a while", events.flashes_for_a_while, EVENTS, ("events:noise_misdeclared",),
         "Infrared strobes of OptiTrack, which a DVS without a filter sees.", Range(0.5, 3.1, "%"), local=True),
    Kind("scattered pixels masked", events.scattered_pixels_masked, EVENTS, ("events:dead_region",),
         "A mask of noisy pixels that was made of another sensor.", Range(7, 29, "%"),
         debatable="the region is of single pixels, anywhere"),
    Kind("trails of events removed", events.trails_removed, EVENTS, ("events:dropped_samples",),
         "The filter of trails in Metavision, which keeps the first event of a row of equal ones.",
         Range(7, 43, "ms")),
    Kind("bits of columns flip for a while", events.bits_of_columns_flip_for_a_while, EVENTS, (),
         "A parallel bus of AER beside a motor.", Range(13, 43, "%"), local=True,
         debatable="noise_misdeclared describes events that are added, and these are elsewhere"),
    Kind("bit of polarity stuck for a while", events.bit_of_polarity_stuck_for_a_while, ("path/events/p",), (),
         "A connector with a loose pin.", local=True,
         debatable="polarity_inverted describes all events, and half of these are right"),
    Kind("events backwards in time", timestamps.backwards, EVENTS, (),
         "Augmentation that turns time around and not polarity, and was saved.",
         debatable="the order of time is right as it is stored"),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("threshold in decades", declarations.threshold_in_decades, ("metadata/events",),
         ("events:threshold_misdeclared",), "np.log10 in a description, and np.log in the simulator.",
         scenes=LOGARITHMIC_SCENES),
    Kind("mountings measured from the nose", declarations.mountings_from_the_nose, ("metadata/cameras",),
         ("metadata:lever_arm",), "A drawing whose origin is not that of the flight controller.",
         Range(0.31, 1.4, "m")),
    Kind("K in whole numbers", declarations.whole_numbers_of_pixels, ("metadata/cameras",),
         ("metadata:intrinsics_centre", "events:spatial_offset"), "int() of what a configuration holds.",
         debatable="half a pixel of the centre, and up to one of the focal length"),
    Kind("colour map left out", declarations.colour_map_left_out, (COLOUR_MAP,), ("rgb_to_event:missing_stream",),
         "A converter that writes maps when it closes, and is killed before."),
    Kind("depth map without its last entry", declarations.depth_map_of_intervals, (DEPTH_MAP,),
         ("depth_to_event:wrong_shape", "depth_to_event:truncated"), "zip(t[:-1], t[1:]) over frames.",
         debatable="the map ends early, and its length is not that of the timestamps"),
    Kind("colour map from before a filter", declarations.colour_map_before_a_filter, (COLOUR_MAP,), (),
         "Maps that are made before events are filtered.", Range(3.7, 19, "%"),
         debatable="index_off_by_one describes a constant shift, and this one grows"),
)  # fmt: skip

_COMPOSITES: Final = (
    Kind("colour and depth mirrored", both(images.flipped("path/rgb", 2), images.flipped("path/depth", 2)),
         ("path/rgb", "path/depth"), ("rgb:mirrored", "depth:mirrored"),
         "OpenNI's mirror mode, which is on by default.", composite=True),
    Kind("gravity removed, and IMU late",
         both(inertial.with_gravity(-1.0), clocks.delayed("imu"), Range(2.9, 17, "ms")),
         (ACCELEROMETER, "path/imu/ts"), ("imu:gravity_missing", "imu:time_offset"),
         "Fused sensors of Android, whose filter is late.", composite=True),
    Kind("invalid depth as 0, and depth one frame late",
         both(images.invalid_as_zero("path/depth"), clocks.one_late("path/depth")), ("path/depth",),
         ("depth:invalid_encoding", "depth:time_offset"), "RealSense with a chain of filters.", composite=True),
    Kind("pose in NED, and late", both(poses.north_east_down, clocks.delayed("pose"), Range(3.1, 21, "ms")),
         (*POSE, "path/pose/ts"), ("pose:frame_convention", "pose:time_offset"),
         "PX4's odometry over a slow telemetry link.", composite=True),
    Kind("events mirrored, and on another epoch",
         both(sensor.mirrored("x"), clocks.delayed("events"), Range(2.3, 19, "ms", signed=True)),
         (*EVENT_TIME, "path/events/x"), ("events:mirrored", "events:time_offset"),
         "jAER, whose columns count from the right and whose time begins at a reset.", composite=True),
)  # fmt: skip

FIFTH_ROUND: Final = tuple(
    replace(kind, round=5) for kind in (*_EVENTS, *IMAGES, *SAMPLES, *_DECLARATIONS, *_COMPOSITES)
)
"""Kinds of the fifth round, in the order of streams."""

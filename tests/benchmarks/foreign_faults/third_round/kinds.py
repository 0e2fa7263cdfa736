"""The third round: kinds of faults that were written when the first two had been looked at."""

from dataclasses import replace
from typing import Final

from tests.benchmarks.foreign_faults import images, inertial
from tests.benchmarks.foreign_faults.composites import both
from tests.benchmarks.foreign_faults.inertial import GYRO
from tests.benchmarks.foreign_faults.kind import ALL_SCENES, QUIET_SCENES, Kind, Range
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENTS, IMU
from tests.benchmarks.foreign_faults.third_round import declarations, events, timestamps
from tests.benchmarks.foreign_faults.third_round.image_kinds import IMAGES
from tests.benchmarks.foreign_faults.third_round.sample_kinds import SAMPLES

LOGARITHMIC_SCENES: Final = tuple(scene for scene in ALL_SCENES if scene != "racetrack")
"""Scenes whose event sensor compares logarithms of light."""

_EVENTS: Final = (
    Kind("packets of events jitter", timestamps.packets_jitter, EVENTS, ("events:time_jitter",),
         "Hosts that stamp a packet when it arrives, whose events have times since its beginning.",
         Range(0.7, 5.3, "ms")),
    Kind("events pixel by pixel", events.pixel_by_pixel, ("path/events",), ("events:unsorted",),
         "ESIM and scripts that simulate one pixel after the other."),
    Kind("polarity inverted in a part of the sensor", events.inverted_in_a_part, ("path/events/p",),
         ("events:polarity_inverted",), "Tiles of a simulation, which two versions of it made.", Range(23, 67, "%")),
    Kind("events mirrored for a while", events.mirrored_for_a_while, ("path/events/x",), ("events:mirrored",),
         "A driver that restarts without its flip.", local=True),
    Kind("events of encoded frames", events.of_encoded_frames, EVENTS, ("events:threshold_misdeclared",),
         "Simulators that take PNG frames of gamma 2.2 for light.", scenes=LOGARITHMIC_SCENES),
    Kind("columns of the sensor fire", events.columns_fire, EVENTS, ("events:hot_pixels",),
         "A column's amplifier that oscillates.", Range(19, 170, "Hz")),
    Kind("mask moves over the sensor", events.mask_moves, EVENTS, ("events:dead_region",),
         "Anonymisation of faces and number plates, whose boxes follow them.", Range(11, 37, "%"),
         debatable="each pixel is silent for a part of the time"),
    Kind("quiet packets lost", events.quiet_packets_lost, EVENTS, ("events:dropped_samples",),
         "A converter that skips packets with fewer events than a minimum.", Range(7, 47, "%")),
    Kind("events turned by some degrees", events.turned, EVENTS, ("metadata:extrinsic_rotation",),
         "A beam splitter whose event camera is rolled.", Range(1.3, 7.9, "deg", signed=True)),
    Kind("darker events moved", events.darker_moved, EVENTS, ("events:spatial_offset",),
         "Two maps of events, one of each polarity, one of which is padded.",
         Range(1, 4, "px", signed=True, whole=True), debatable="events of the other polarity are in their places"),
    Kind("halves of the sensor exchanged", events.halves_exchanged, ("path/events/x",), (),
         "Two readout links whose cables are exchanged.",
         debatable="spatial_offset describes a shift, but what leaves at one side comes in at the other"),
    Kind("bases of event vectors lost", events.bases_of_vectors_lost, EVENTS, (),
         "EVT 3.0, whose words VECT_BASE_X a full link drops.", local=True),
    Kind("polarity of darker events as 255", events.minus_one_as_byte, ("path/events/p",), (),
         "Polarities -1 and 1 that are stored as bytes without sign."),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("threshold in percent", declarations.threshold_in_percent, ("metadata/events",),
         ("events:threshold_misdeclared",), "Data sheets, which give contrast in percent."),
    Kind("noise of events declared, not added", declarations.event_noise_declared, ("metadata/events",),
         ("events:noise_misdeclared",), "v2e's noisy preset in the metadata of a clean run.", Range(0.9, 11, "Hz"),
         scenes=QUIET_SCENES),
    Kind("colour map off for a while", declarations.colour_map_off_for_a_while, (COLOUR_MAP,),
         ("rgb_to_event:index_off_by_one",), "Maps that are made by parts, of which one begins elsewhere.",
         Range(2, 47, "events", signed=True, whole=True), local=True,
         debatable="entries before and after are right"),
    Kind("colour map in doubles", declarations.colour_map_in_doubles, (COLOUR_MAP,), ("rgb_to_event:wrong_dtype",),
         "MATLAB, whose numbers are doubles."),
    Kind("depth map of pairs", declarations.depth_map_of_pairs, (DEPTH_MAP,), ("depth_to_event:wrong_shape",),
         "Loaders that keep where the events of a frame begin and end."),
    Kind("depth map of ends", declarations.depth_map_of_ends, (DEPTH_MAP,), (),
         "Counts of events up to the end of a frame's interval: np.cumsum of np.histogram.",
         debatable="index_off_by_one describes a shift by events, and this one is by a frame"),
    Kind("angle of view not halved", declarations.angle_not_halved, (CAMERA + "rgb",), ("metadata:intrinsics_focal",),
         "W / (2 tan(fov)) in place of tan(fov / 2)."),
    Kind("angle of view not in radians", declarations.angle_not_in_radians, (CAMERA + "events",),
         ("metadata:intrinsics_focal",), "math.tan(30) for 30 degrees."),
    Kind("all cameras tilted", declarations.all_tilted, ("metadata/cameras",), ("metadata:extrinsic_rotation",),
         "A bracket of all cameras, whose angle in the vehicle's drawing is nominal.", Range(1.1, 8.3, "deg")),
)  # fmt: skip

_COMPOSITES: Final = (
    Kind("K in shares of the image's size", declarations.shares_of_size, ("metadata/cameras",),
         ("metadata:intrinsics_focal", "metadata:intrinsics_centre"), "OpenSfM and networks, whose K is normalised.",
         composite=True),
    Kind("depth of TUM", both(images.scaled("path/depth", 5.0), images.invalid_as_zero("path/depth")),
         ("path/depth",), ("depth:unit_mm_m", "depth:invalid_encoding"),
         "Files of TUM RGB-D, in which 5000 are a metre and 0 is nothing.", composite=True),
    Kind("IMU of a flight controller",
         both(inertial.in_axes((1, 0, 0), (0, -1, 0), (0, 0, -1)), inertial.multiplied(GYRO, 57.295_779_513)), IMU,
         ("imu:frame_convention", "imu:unit_deg_rad"), "Blackbox logs of Betaflight and ArduPilot.", composite=True),
    Kind("BGR upside down", both(images.channels((2, 1, 0)), images.flipped("path/rgb", 1)), ("path/rgb",),
         ("rgb:channel_order", "rgb:mirrored"), "glReadPixels with GL_BGR, and bitmaps of Windows.", composite=True),
)  # fmt: skip

THIRD_ROUND: Final = tuple(
    replace(kind, round=3) for kind in (*_EVENTS, *IMAGES, *SAMPLES, *_DECLARATIONS, *_COMPOSITES)
)
"""Kinds of the third round, in the order of streams."""

"""Kinds of the ninth round in events, in the maps into them and in what is declared of cameras."""

from typing import Final

from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.ninth_round import declarations, events
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENT_TIME, EVENTS
from tests.benchmarks.foreign_faults.third_round.kinds import LOGARITHMIC_SCENES

_EVENTS: Final = (
    Kind("thresholds of both polarities exchanged", events.thresholds_exchanged, (*EVENTS, "metadata/events"),
         ("events:threshold_misdeclared",),
         "v2e and ESIM, whose arguments for brighter and darker events are in different orders.",
         Range(12, 80, "%"), scenes=LOGARITHMIC_SCENES),
    Kind("steps of event times floored", events.steps_of_time_floored, EVENT_TIME, ("events:clock_rate",),
         "Compression of events by differences of times, in coarser ticks and without the remainder.",
         Range(2, 4, "us", whole=True), scenes=LOGARITHMIC_SCENES,
         debatable="the clock loses more where there are more events"),
    Kind("events of a slow-motion video", events.in_slow_motion, EVENT_TIME,
         ("events:clock_rate", "events:time_unit"), "v2e, whose input_slowmotion_factor is not given.",
         Range(1.5, 8, "times"), debatable="a factor of the clock is also one of its unit"),
    Kind("event clock loses ticks for a while", events.of_a_clock_that_loses_ticks, EVENT_TIME,
         ("events:clock_rate", "events:time_offset"), "Virtual machines under load, which lose interrupts of a timer.",
         Range(15_000, 120_000, "ppm"), local=True,
         debatable="the rate is wrong for a while, and times are early from then on"),
    Kind("second events of bursts alone for a while", events.second_of_each_burst_for_a_while, EVENTS,
         ("events:dropped_samples",), "Metavision's filter by contrast in space and time, turned on while recording.",
         Range(8, 60, "ms"), local=True),
    Kind("events in a table indexed by time", events.first_of_each_tick, EVENTS, ("events:dropped_samples",),
         "pandas, where drop_duplicates on a rounded index of times leaves one row of each.",
         Range(15, 90, "us", whole=True)),
    Kind("events without their warm-up", events.begin_late, EVENTS, ("events:truncated", "events:dropped_samples"),
         "Drivers that discard what a sensor sends until its biases have settled.", Range(8, 32, "%"),
         debatable="the beginning is absent, and not the end"),
    Kind("holes of a rectification of events", events.enlarged_to_whole_pixels, (*EVENTS, CAMERA + "events"),
         ("events:dead_region",), "cv2.undistortPoints and a rounding, to a new K that is declared.",
         Range(8, 45, "%"), debatable="pixels that nothing leads to are not dead"),
    Kind("pixels of random telegraph", events.pixels_of_random_telegraph, EVENTS, ("events:hot_pixels",),
         "Traps in the transistors of aged sensors, which fill and empty at random.",
         Range(8, 90, "pixels", whole=True)),
    Kind("sun on the junctions for a while", events.sun_on_the_junctions, EVENTS, ("events:noise_misdeclared",),
         "Light that leaks to the switch of a pixel and lets it fire evenly.", Range(5, 40, "Hz"), local=True),
    Kind("bits of polarity unpacked in reverse", events.bits_of_polarity_reversed, ("path/events/p",), (),
         "np.packbits and a reader in C, whose orders of bits differ."),
    Kind("events of a black first frame", events.of_a_black_first_frame, EVENTS, (),
         "ESIM and v2e, whose memory of light begins with zeros.", Range(3, 20, "DN"),
         debatable="noise_misdeclared and interpolated_frames describe what such events resemble"),
    Kind("events warped along the flow", events.warped_to_slices, EVENTS, (),
         "Compensation of motion, as maximisation of contrast gives it, saved as raw events.",
         Range(100, 300, "ms"),
         debatable="spatial_offset means a constant shift, and this one grows within each slice"),
)  # fmt: skip

_MAPS: Final = (
    Kind("colour map joined by time", events.colour_map_joined_by_time, (COLOUR_MAP,),
         ("rgb_to_event:nan_in_stream", "rgb_to_event:wrong_dtype"), "pandas' merge_asof with a tolerance.",
         Range(3, 30, "us"), debatable="what has no partner makes all entries floating numbers"),
    Kind("depth map left out", events.depth_map_left_out, (DEPTH_MAP,), ("depth_to_event:missing_stream",),
         "Converters that write one map for the cameras of a synchronised rig."),
    Kind("colour map of counts", events.colour_map_of_counts, (COLOUR_MAP,), (),
         "np.histogram over times of frames, without the sum."),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("rotation vector of events read as angles", declarations.rotation_vector_read_as_angles,
         (CAMERA + "events",), ("metadata:extrinsic_rotation",),
         "rvec of OpenCV's solvePnP or stereoCalibrate in the rpy of a URDF."),
    Kind("focal length of colour on full frame", declarations.focal_length_of_full_frame, (CAMERA + "rgb",),
         ("metadata:intrinsics_focal",), "Unreal's film back of 23.76 mm, and converters that take one of 36 mm."),
    Kind("place of events in optical axes", declarations.place_in_optical_axes, (CAMERA + "events",),
         ("metadata:lever_arm",), "Kalibr's translation, whose axes are those of the camera."),
    Kind("mountings without their last row", declarations.mountings_without_last_row,
         tuple(f"{CAMERA}{camera}" for camera in ("rgb", "depth", "events")), ("metadata:wrong_shape",),
         "KITTI's calibrations, whose transformations have three rows."),
)  # fmt: skip

EVENT_KINDS: Final = (*_EVENTS, *_MAPS, *_DECLARATIONS)
"""Kinds of events, index maps and cameras."""

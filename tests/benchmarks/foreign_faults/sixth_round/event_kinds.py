"""Kinds of the sixth round in events, in the maps into them and in what is declared of cameras."""

from typing import Final

from tests.benchmarks.foreign_faults import cameras, images
from tests.benchmarks.foreign_faults.kind import Kind, Range
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, EVENT_TIME, EVENTS
from tests.benchmarks.foreign_faults.sixth_round import declarations, events, timestamps
from tests.benchmarks.foreign_faults.third_round.kinds import LOGARITHMIC_SCENES

_EVENTS: Final = (
    Kind("events a frame early at first", timestamps.squeezed_towards_the_end, EVENTS,
         ("events:clock_rate", "events:time_offset"),
         "v2e, whose events were a frame from the video at its beginning and right at its end (issue 12).",
         Range(8, 42, "ms"), debatable="a rate and an offset together describe it, and either alone a part"),
    Kind("events at the times of renders", timestamps.of_the_next_render, EVENTS, ("events:quantised_time",),
         "v2e, where all events between two interpolated frames have one time (issue 2).", Range(0.52, 10, "ms")),
    Kind("counter of events begins again", timestamps.counter_begins_again, ("path/events/t",),
         ("events:unsorted", "events:time_offset"),
         "neuromorphic-drivers, whose times of EVT 3 began again after 2^23 us (issue 1).",
         debatable="events are in order as they are stored, and those of one part are early by one constant"),
    Kind("first high word subtracted from event times", timestamps.first_high_word_subtracted, EVENT_TIME,
         ("events:time_offset",),
         "OpenEB, whose reader counts from the first high word of the file and other decoders do not (issue 108).",
         Range(1, 1570, "ranges of 4.096 ms", whole=True)),
    Kind("low word of event times constant", timestamps.low_word_constant, EVENTS, ("events:quantised_time",),
         "expelliarmus, which decoded EVT 3 with the same 12 lowest bits in all times (issue 19)."),
    Kind("event times in single precision", timestamps.in_single_precision, EVENTS, ("events:quantised_time",),
         "e2calib, which converted times to float32 by mistake (pull request 9).", Range(900, 50_000, "s")),
    Kind("DVS of CARLA in nanoseconds", timestamps.events_in_nanoseconds, EVENT_TIME, ("events:time_unit",),
         "CARLA for Unreal 5, whose DVS reported nanoseconds (pull request 8823)."),
    Kind("origin of event times added again", timestamps.origin_added_again, EVENT_TIME, ("events:time_offset",),
         "DSEC, where a reader adds t_offset to times that already have it (issue 24).", Range(910, 52_000, "s")),
    Kind("packets of events exchanged for a while", events.packets_exchanged, ("path/events",), ("events:unsorted",),
         "event-driven of iCub, where a race between buffers gave times out of order (issue 7).",
         Range(32, 2_048, "events", whole=True), local=True),
    Kind("busiest packets of events lost for a while", events.busiest_packets_lost, EVENTS,
         ("events:dropped_samples",), "metavision_driver, which loses packets during fast motion (issue 77).",
         Range(9, 60, "%"), local=True),
    Kind("events of pairs of frames", events.of_pairs_of_frames, EVENTS, ("events:interpolated_frames",),
         "AirSim's event simulator, which compares log luma of two frames in sequence (pull request 3202).",
         scenes=LOGARITHMIC_SCENES),
    Kind("polarity of four values", events.polarity_of_four_values, ("path/events/p",), (),
         "EVIMO2, whose first NPZ files had polarities of 0, 1, 2 and 3 (issue 20)."),
    Kind("polarity always 1", events.polarity_always_1, ("path/events/p",), (),
         "tonic, whose EventDownsampling gave all events polarity 1 (issue 298).",
         debatable="polarity_inverted describes all events, and some of these are right"),
)  # fmt: skip

_MAPS: Final = (
    Kind("depth map counted from 1", events.depth_map_from_1, (DEPTH_MAP,), ("depth_to_event:index_off_by_one",),
         "Code brought from MATLAB, whose indices count from 1."),
    Kind("colour map from before a cut", events.cut_behind_the_colour_map, EVENTS,
         ("rgb_to_event:index_off_by_one",),
         "Converters that cut events to a common start when the maps have been made.",
         Range(0.3, 7, "%")),
    Kind("colour map of whole messages", events.colour_map_of_whole_messages, (COLOUR_MAP,), (),
         "EV-FlowNet, which gave a frame all events of the message in which it lies (pull request 7).",
         Range(1, 20, "ms"), debatable="index_off_by_one describes a constant shift, and this one differs by frame"),
)  # fmt: skip

_DECLARATIONS: Final = (
    Kind("principal points off by 1", declarations.centres_from_1, ("metadata/cameras",),
         ("metadata:intrinsics_centre",),
         "Gazebo and its models, which declare (W+1)/2 for pixels that count from 0 (gazebo_ros_pkgs 938, subt 406)."),
    Kind("focal length of depth written into the code", cameras.focal("depth"), (CAMERA + "depth",),
         ("metadata:intrinsics_focal",),
         "realsense_gazebo_plugin, whose focal length did not follow the field of view (issue 28).",
         Range(3, 32, "%", signed=True)),
    Kind("colour cropped behind its undistortion", images.cropped, ("path/rgb", CAMERA + "rgb"),
         ("metadata:intrinsics_centre", "rgb:spatial_offset"),
         "nerfstudio, which cropped to the valid region and kept the principal point (pull request 3382).",
         Range(1, 12, "px", whole=True), debatable="K or the crop may be called wrong"),
    Kind("mountings as T_cam_imu", cameras.inverted, ("metadata/cameras",),
         ("metadata:extrinsic_rotation", "metadata:frame_convention"),
         "Kalibr, whose T_cam_imu is taken for its inverse (issues 182 and 662).",
         debatable="the direction of a transform is a convention, and the declared mounting is wrong as well"),
)  # fmt: skip

EVENT_KINDS: Final = (*_EVENTS, *_MAPS, *_DECLARATIONS)
"""Kinds of events, index maps and cameras."""

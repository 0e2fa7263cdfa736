"""Every transformation of the study, and what is left out."""

from typing import Final

from tests.benchmarks.foreign import declarations, events, gauge, geometry, images, sampling, storage
from tests.benchmarks.foreign.storage import ACCELEROMETER, FLOW, GYRO, ORIENTATION, POSITION, rounded, stored_as
from tests.benchmarks.foreign.transformation import Transformation

MAPS: Final = ("metadata/rgb_to_event", "metadata/depth_to_event")
COLOUR: Final = ("path/rgb", "metadata/rgb_to_event")
DEPTH: Final = ("path/depth", "metadata/depth_to_event")
EVENTS: Final = ("path/events", "metadata/events", *MAPS)
IMU: Final = (GYRO, ACCELEROMETER)
POSE: Final = (POSITION, ORIENTATION)
CAMERAS: Final = ("metadata/cameras",)
ALL: Final = ("",)
UNIX_US: Final = 1_790_000_000_000_000
"""September 2026."""

_STEP: Final = "; no value moves by more than half a step"
_LOSSLESS: Final = "; no value changes"

_STORAGE: Final = (
    Transformation("depth in whole mm", rounded(["path/depth"], 1.0), DEPTH[:1], "Writers of depth sensors" + _STEP),
    Transformation(
        "depth as float64", stored_as(["path/depth"], "f8"), DEPTH[:1], "Pipelines of plain NumPy" + _LOSSLESS
    ),
    Transformation("flow in 1/64 px", rounded(FLOW, 64.0), FLOW, "KITTI's format of flow" + _STEP),
    Transformation("flow in 1/128 px", rounded(FLOW, 128.0), FLOW, "DSEC's format of flow" + _STEP),
    Transformation("flow with 3 decimals", rounded(FLOW, 1e3), FLOW, "Exports through text" + _STEP),
    Transformation(
        "flow through float16", storage.through_type(FLOW, "f2"), FLOW, "Caches for training" + _STEP + " of float16"
    ),
    Transformation("flow as float64", stored_as(FLOW, "f8"), FLOW, "Pipelines of plain NumPy" + _LOSSLESS),
    *(
        Transformation(
            f"quaternions with {count} decimals",
            rounded([ORIENTATION], 10.0**count),
            POSE[1:],
            "TUM trajectories and other text" + _STEP,
        )
        for count in (6, 7, 9)
    ),
    Transformation(
        "quaternions through float32",
        storage.through_type([ORIENTATION], "f4"),
        POSE[1:],
        "ROS 1 bridges and game engines" + _STEP + " of float32",
    ),
    Transformation(
        "quaternions normalised in float32",
        storage.normalised_float32,
        POSE[1:],
        "Game engines, which normalise after each step; no component moves by more than two steps of float32",
    ),
    Transformation(
        "quaternions with random signs", storage.random_signs, POSE[1:], "Solvers by sample; q and -q are one rotation"
    ),
    Transformation(
        "quaternions with w >= 0", storage.positive_scalar_part, POSE[1:], "SciPy and Eigen; q and -q are one rotation"
    ),
    Transformation("positions in 0.1 mm", rounded([POSITION], 1e4), POSE[:1], "Motion capture and text" + _STEP),
    Transformation(
        "positions through float32", storage.through_type([POSITION], "f4"), POSE[:1], "Game engines" + _STEP
    ),
    Transformation("IMU of 16 bits", storage.imu_16_bit, IMU, "Every real IMU: 2000 deg/s and 16 g" + _STEP),
    Transformation("IMU as float32", stored_as(IMU, "f4"), IMU, "Game engines, AirSim" + _STEP),
    Transformation("IMU with 4 decimals", storage.imu_four_decimals, IMU, "Logs of text" + _STEP),
    Transformation(
        "gzip", storage.gzip_shuffle, ALL, "Publishers whose files must be readable without plugins" + _LOSSLESS
    ),
    Transformation("LZF, guessed chunks", storage.lzf, ALL, "h5py with its own defaults" + _LOSSLESS),
    Transformation("bitshuffle, 8 frames a chunk", storage.bitshuffle, ALL, "Detectors at light sources" + _LOSSLESS),
    Transformation("contiguous", storage.contiguous, ALL, "h5py without options" + _LOSSLESS),
    Transformation("big-endian", storage.big_endian, ALL, "Java and old clusters" + _LOSSLESS),
    Transformation("soft links", storage.soft_links, ("path/rgb", "path/depth", "images"), "Releases by part"),
    Transformation(
        "all samples in float32, gzip", storage.single_precision, ALL, "Releases made small for download" + _STEP
    ),
    Transformation(
        "polarity as bool", stored_as(["path/events/p"], "?"), ("path/events/p",), "Metavision's readers" + _LOSSLESS
    ),
    Transformation(
        "coordinates as uint32",
        stored_as(["path/events/x", "path/events/y"], "u4"),
        ("path/events/x", "path/events/y"),
        "PyTorch's users" + _LOSSLESS,
    ),
    Transformation("timestamps as float64", storage.timestamps_as("f8"), ALL, "MATLAB and the paper's lab" + _LOSSLESS),
    Transformation("timestamps as uint64", storage.timestamps_as("u8"), ALL, "C++ recorders" + _LOSSLESS),
)

_GEOMETRY: Final = (
    Transformation(
        "colour cropped",
        geometry.crop_colour,
        (*COLOUR, *CAMERAS),
        "Colour cameras that show the middle of the depth image",
    ),
    Transformation(
        "colour cropped off centre",
        geometry.crop_colour_off_centre,
        (*COLOUR, *CAMERAS),
        "Crops that avoid a propeller; K moves by as many pixels",
    ),
    Transformation(
        "depth and flow cropped off centre",
        geometry.crop_depth_off_centre,
        ("path/depth", *FLOW, *CAMERAS),
        "Depth cameras with a smaller field of view than colour; K moves by as many pixels",
    ),
    Transformation(
        "events cropped", geometry.crop_events, (*EVENTS, *CAMERAS), "A sensor's region of interest; K moves with it"
    ),
    Transformation("every camera cropped", geometry.crop_all, ALL, "Crops after rectification; K moves with them"),
    Transformation(
        "depth and flow at half size",
        geometry.decimate_depth,
        ("path/depth", *FLOW, *CAMERAS),
        "Releases made small: every second pixel, so that its depth is that of its centre; K and flow are halved",
    ),
)

_SAMPLING: Final = (
    Transformation("colour at 25 Hz", sampling.every_nth(2, "rgb"), COLOUR, "Real colour cameras"),
    Transformation("colour at 10 Hz", sampling.every_nth(5, "rgb"), COLOUR, "Releases made small"),
    Transformation("depth at 25 Hz", sampling.every_nth(2, "depth"), DEPTH, "Real depth cameras"),
    Transformation("depth every third frame", sampling.every_nth(3, "depth"), DEPTH, "Lidars, slower than colour"),
    Transformation(
        "colour and depth at 25 Hz",
        sampling.frames_at_25_hz,
        (*COLOUR, *DEPTH, "path/flow"),
        "Real RGB-D cameras; flow of other rates than 25 Hz would begin on no frame, and is left out",
    ),
    Transformation(
        "flow of every third interval", sampling.sparse_flow, ("path/flow",), "DSEC, where most frames have no flow"
    ),
    Transformation("flow at 10 Hz only", sampling.only_flow("10hz"), ("path/flow",), "DSEC, which has one rate"),
    Transformation(
        "IMU at 500 Hz",
        sampling.imu_every(2),
        ("path/imu", "metadata/imu"),
        "Real IMUs; the declared densities are adapted",
    ),
    Transformation("pose at 100 Hz", sampling.every_nth(2, "pose"), ("path/pose",), "Motion capture"),
    Transformation("pose at 50 Hz", sampling.every_nth(4, "pose"), ("path/pose",), "A pose for each frame"),
    Transformation("pose every 15 ms", sampling.every_nth(3, "pose"), ("path/pose",), "A pose for every third sample"),
    Transformation("pose every 35 ms", sampling.every_nth(7, "pose"), ("path/pose",), "Logs made small"),
    *(
        Transformation(
            f"IMU every {period} ms",
            sampling.imu_every(period),
            ("path/imu", "metadata/imu"),
            f"Loops of {period} ms; the declared densities are adapted",
        )
        for period in (3, 6, 7)
    ),
    Transformation("colour begins a frame late", sampling.colour_begins_late, COLOUR, "Recorders that start in turn"),
    Transformation("depth ends a frame early", sampling.depth_ends_early, DEPTH, "Recorders that stop in turn"),
    Transformation("no frame at the end", sampling.half_open_span, ALL, "np.arange, without its end"),
    Transformation("ends cut between frames", sampling.cut_between_frames, ALL, "Cuts at take-off and landing"),
    Transformation("middle third", sampling.middle_third, ALL, "Splits of a recording for training and test"),
    Transformation("middle third from zero", sampling.middle_third_from_zero, ALL, "Splits whose time starts at zero"),
)

_GAUGE: Final = (
    Transformation(
        "world turned by 90 degrees", gauge.move_world(90.0, (0.0, 0.0, 0.0)), POSE, "NED and ENU mixed, correctly"
    ),
    Transformation("world turned and moved", gauge.move_world(-137.3, (12.5, -40.25, 3.75)), POSE, "Motion capture"),
    Transformation("world in UTM", gauge.move_world(0.0, (505_123.25, 4_475_321.5, 187.5)), POSE, "GNSS; UTM metres"),
    Transformation("first pose as origin", gauge.first_pose_as_origin, POSE, "Odometry and SLAM"),
    Transformation("clock an hour on", gauge.shift_time(3_600_000_000), ALL, "A clock that starts with the machine"),
    Transformation("Unix time", gauge.shift_time(UNIX_US), ALL, "ROS; the recorder's wall clock"),
    Transformation("clock before zero", gauge.shift_time(-5_000_123), ALL, "Time from take-off"),
)

_EVENTS: Final = (
    Transformation(
        "events by columns",
        events.order_by_columns,
        ("path/events",),
        "Sensors read by column; the order within a microsecond is free",
    ),
    Transformation("packets of 200 us", events.packets, EVENTS, "The paper's plugin; the interval is declared"),
)

_DECLARATIONS: Final = (
    Transformation("units in capitals", declarations.capital_units, ALL, "People; the unit is the same"),
    Transformation(
        "sizes as floats", declarations.sizes_as_floats, (*CAMERAS, "metadata/events"), "MATLAB and JSON" + _LOSSLESS
    ),
    Transformation(
        "intrinsics in float32", declarations.intrinsics_float32, CAMERAS, "OpenCV and PyTorch; 1e-7 of a focal length"
    ),
    Transformation("text of fixed length", declarations.text_of_fixed_length, ALL, "C and MATLAB" + _LOSSLESS),
    Transformation("numbers as arrays of one", declarations.arrays_of_one, ALL, "MATLAB" + _LOSSLESS),
    Transformation(
        "defaults left out", declarations.defaults_left_out, ALL, "Publishers who write only what the format requires"
    ),
    Transformation("provenance left out", declarations.provenance_left_out, ("@",), "Blind benchmarks"),
    Transformation(
        "wider depth range",
        declarations.wider_depth_range,
        ("metadata/depth_range",),
        "Data sheets: the range of the sensor, within which all values lie",
    ),
    Transformation("extra objects", declarations.more_of_everything, (), "Everybody"),
    Transformation("index of milliseconds", declarations.millisecond_index, (), "DSEC"),
)

_IMAGES: Final = (
    Transformation(
        "colour through JPEG 95", images.jpeg_95, COLOUR[:1], "Recorders; the contract of the checks accepts it"
    ),
    Transformation(
        "colour with read noise",
        images.read_noise,
        COLOUR[:1],
        "Real sensors, 1 DN; the contract of the checks accepts it",
    ),
)

TRANSFORMATIONS: Final = (*_STORAGE, *_GEOMETRY, *_SAMPLING, *_GAUGE, *_EVENTS, *_IMAGES, *_DECLARATIONS)

UNCHANGED: Final = Transformation("unchanged", lambda file: None, (), "The reference generator")
"""The control: the clean sequence itself."""

LEFT_OUT: Final = {
    "depth as 16-bit millimetres": "0 stands for invalid where the format has NaN; a dialect reads such files",
    "polarity of -1 and +1": "the format has 0 and 1; a dialect reads such files",
    "positions in whole mm": "this is noise, which the file would have to declare",
    "a tilted world": "the format defines world gravity as (0, 0, -g)",
    "colour binned 2x2": "the mean of clipped values differs from the clipped mean",
    "events that begin late": "the format has no declaration for it",
}

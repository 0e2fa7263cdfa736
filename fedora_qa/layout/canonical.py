"""The canonical FEDORA layout, version 1.0, as data.

One description, used to write, to read and to validate. Shapes are symbolic: a name stands for a size that every
dataset of the file shares (``N`` colour frames, ``E`` events), a number for itself.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Final

from fedora_qa.conventions import FLOW_RATES_HZ

Size = str | int

# Rows in a chunk: 256 Ki timestamps of 8 bytes are 2 MiB decoded, 16 Ki are 128 KiB.
EVENT_CHUNK_ROWS: Final = 256 * 1024
SAMPLE_CHUNK_ROWS: Final = 16 * 1024

DISTORTION_MODELS: Final = ("none", "radtan", "equidistant")
"""Models of a lens: radial-tangential and equidistant are those of OpenCV."""


MS_TO_EVENT: Final = "metadata/ms_to_event"
RECTIFY_MAP: Final = "metadata/rectify_map"


@dataclass(frozen=True, slots=True)
class DatasetSpec:
    """One dataset of the file.

    Attributes
    ----------
    key
        Where it lies, from the root, without a leading slash. The canonical key names the dataset in every dialect.
    stream
        The stream that it is part of.
    dtype
        NumPy name of the stored type.
    shape
        Symbolic sizes; the first is the axis of time.
    units
        Value of the attribute ``units``.
    chunk_rows
        Rows in a chunk (1 for images: one frame a chunk); 0 for contiguous storage.
    meaning
        One line for people.
    optional
        Whether the stream is whole without it.
    """

    key: str
    stream: str
    dtype: str
    shape: tuple[Size, ...]
    units: str
    chunk_rows: int
    meaning: str
    optional: bool = False

    @property
    def is_timestamps(self) -> bool:
        """Whether the values are times on the file's clock."""
        return self.key.endswith(("_ts", "/ts", "/t"))

    @property
    def is_image(self) -> bool:
        """Whether a row is a whole image."""
        # The layout stores one frame in a chunk for images, and for nothing else.
        return self.chunk_rows == 1

    @property
    def has_columns(self) -> bool:
        """Whether the last axis is one of columns or of channels: of images, the fourth."""
        return len(self.shape) == 4 if self.is_image else len(self.shape) > 1


@dataclass(frozen=True, slots=True)
class AttributeSpec:
    """One attribute: the object that carries it, its name, type and whether the format requires it.

    ``opposites`` are texts that mean the opposite of the only choice; ``is_open`` allows other texts than the choices,
    which then say that the check has no model of it.
    """

    owner: str
    name: str
    kind: str
    units: str
    required: bool
    meaning: str
    choices: tuple[str, ...] = ()
    opposites: tuple[str, ...] = ()
    is_open: bool = False


def _flow_datasets(rate: str) -> tuple[DatasetSpec, ...]:
    key, stream, count = f"path/flow/{rate}hz", f"flow/{rate}hz", f"K{rate}"
    return (
        DatasetSpec(key, stream, "float32", (count, "H", "W", 2), "px", 1,
                    "displacement over the interval (u right, v down), NaN where depth is invalid"),
        DatasetSpec(f"{key}_ts", stream, "int64", (count, 2), "us", SAMPLE_CHUNK_ROWS, "start and end of the interval"),
        DatasetSpec(f"{key}_moving", stream, "uint8", (count, "H", "W"), "1", 1,
                    "1 where the pixel shows an object that moves by itself", optional=True),
    )  # fmt: skip


PINHOLE: Final = "pinhole"
"""The camera model by which checks project."""

UNCALIBRATED: Final = "unknown"
"""Camera model of a recording without calibration: every check that projects is not applicable."""

_DATASETS: Final = (
    DatasetSpec("path/rgb", "rgb", "uint8", ("N", "H_rgb", "W_rgb", 3), "DN", 1, "colour frames, R, G, B"),
    DatasetSpec("path/rgb_ts", "rgb", "int64", ("N",), "us", SAMPLE_CHUNK_ROWS, "middle of the exposure"),
    DatasetSpec("path/depth", "depth", "float32", ("D", "H", "W"), "mm", 1, "z-depth, NaN invalid"),
    DatasetSpec("path/depth_ts", "depth", "int64", ("D",), "us", SAMPLE_CHUNK_ROWS, "time of the depth frame"),
    DatasetSpec("path/events/x", "events", "uint16", ("E",), "px", EVENT_CHUNK_ROWS, "column"),
    DatasetSpec("path/events/y", "events", "uint16", ("E",), "px", EVENT_CHUNK_ROWS, "row"),
    DatasetSpec("path/events/t", "events", "int64", ("E",), "us", EVENT_CHUNK_ROWS, "time, non-decreasing"),
    DatasetSpec("path/events/p", "events", "uint8", ("E",), "1", EVENT_CHUNK_ROWS, "1 brighter, 0 darker"),
    DatasetSpec("path/imu/angular_velocity", "imu", "float64", ("M", 3), "rad/s", SAMPLE_CHUNK_ROWS, "body frame"),
    # f = R_body_world (a - g), world gravity g = (0, 0, -9.81) m/s^2: at rest the sensor measures +9.81 along body Z.
    DatasetSpec("path/imu/linear_acceleration", "imu", "float64", ("M", 3), "m/s^2", SAMPLE_CHUNK_ROWS,
                "specific force, body frame (+g on Z at rest)"),
    DatasetSpec("path/imu/ts", "imu", "int64", ("M",), "us", SAMPLE_CHUNK_ROWS, "time of the sample"),
    DatasetSpec("path/pose/position", "pose", "float64", ("P", 3), "m", SAMPLE_CHUNK_ROWS,
                "body origin in the world (ENU)"),
    DatasetSpec("path/pose/orientation", "pose", "float64", ("P", 4), "1", SAMPLE_CHUNK_ROWS,
                "unit quaternion x, y, z, w, body to world"),
    DatasetSpec("path/pose/ts", "pose", "int64", ("P",), "us", SAMPLE_CHUNK_ROWS, "time of the pose"),
    *(spec for rate_hz in FLOW_RATES_HZ for spec in _flow_datasets(f"{rate_hz}")),
    # Entry i counts the events with t < t_frame[i] (``np.searchsorted``, side left).
    DatasetSpec("metadata/rgb_to_event", "rgb_to_event", "int64", ("N",), "1", SAMPLE_CHUNK_ROWS,
                "index of the earliest event not before the colour frame; E where none is left"),
    DatasetSpec("metadata/depth_to_event", "depth_to_event", "int64", ("D",), "1", SAMPLE_CHUNK_ROWS,
                "index of the earliest event not before the depth frame; E where none is left"),
    # In metres, unlike depth frames, which are in millimetres.
    DatasetSpec("metadata/depth_range", "depth_range", "float64", (2,), "m", 0, "nearest and farthest valid depth"),
)  # fmt: skip

DATASETS: Final[Mapping[str, DatasetSpec]] = MappingProxyType({spec.key: spec for spec in _DATASETS})
"""Every dataset of the layout by its key, in the order of the file; of flow the usual rates. See ``spec_of``."""


_BESIDE: Final = (
    # Entry k counts the events with t < k ms, on the clock of the events as stored.
    DatasetSpec(MS_TO_EVENT, "ms_to_event", "int64", ("T",), "1", SAMPLE_CHUNK_ROWS,
                "index of the earliest event not before each millisecond; E where none is left"),
    DatasetSpec(RECTIFY_MAP, "rectify_map", "float32", ("H_events", "W_events", 2), "px", 0,
                "where the view of the depth camera has each pixel of the event camera (x right, y down)"),
)  # fmt: skip
"""Datasets that are no part of the layout, and are read and checked where a file or a dialect has them."""

BESIDE: Final = tuple(spec.stream for spec in _BESIDE)


def _camera(name: str) -> tuple[AttributeSpec, ...]:
    owner = f"metadata/cameras/{name}"
    return (
        AttributeSpec(owner, "width", "int", "px", True, "columns"),
        AttributeSpec(owner, "height", "int", "px", True, "rows"),
        AttributeSpec(owner, "K", "matrix3", "px", True, "intrinsics; integer coordinates are pixel centres"),
        AttributeSpec(owner, "T_body_camera", "matrix4", "m", True, "p_body = T_body_camera p_optical"),
        AttributeSpec(
            owner, "exposure_us", "float", "us", False, "global exposure centred on the timestamp, 0 by default"
        ),
        AttributeSpec(
            owner,
            "camera_model",
            "text",
            "",
            False,
            "pinhole by default; of others nothing is projected",
            (PINHOLE,),
            is_open=True,
        ),
        AttributeSpec(
            owner, "distortion_model", "text", "", False, "model of the lens, none by default", DISTORTION_MODELS
        ),
        AttributeSpec(owner, "distortion", "numbers", "1", False, "coefficients of the distortion, in OpenCV's order"),
    )


_EVENT_EFFECTS: Final = (
    ("threshold_sigma", "unit of the threshold", "spread of the thresholds over pixels"),
    ("leak_rate_hz", "Hz", "brighter events a pixel gives at rest"),
    ("shot_rate_hz", "Hz", "spurious events a pixel gives"),
    ("bandwidth_hz", "Hz", "first-order low-pass before the comparator"),
    ("refractory_us", "us", "dead time of a pixel after an event"),
    ("hot_pixel_rate_hz", "Hz", "rate of a hot pixel"),
)

_ATTRIBUTES: Final = (
    AttributeSpec("", "format", "text", "", True, "name of the format", ("fedora",)),
    AttributeSpec("", "format_version", "text", "", True, "version of the layout", ("1.0",)),
    AttributeSpec("", "sequence", "text", "", False, "name of the sequence"),
    AttributeSpec("", "world", "text", "", False, "name of the world"),
    AttributeSpec("", "illumination", "text", "", False, "day or night"),
    AttributeSpec("", "created_by", "text", "", False, "the program that wrote the file"),
    AttributeSpec("", "scene_digest", "text", "", False, "digest of the scene's description"),
    AttributeSpec("", "seed", "int", "", False, "seed of every random stream"),
    AttributeSpec("", "kind", "text", "", False, "recorded by sensors or rendered", ("recorded", "synthetic")),
    AttributeSpec("", "profile", "text", "", False, "further figures that the file promises", ("fedora-paper",)),
    AttributeSpec("path/rgb", "transfer", "text", "", False, "transfer curve, linear by default",
                  ("linear", "srgb", "gamma2.2")),
    *_camera("rgb"), *_camera("depth"), *_camera("events"),
    AttributeSpec("metadata/events", "model", "text", "", True, "sensor model", ("log", "linear", "unknown")),
    AttributeSpec("metadata/events", "threshold_on", "float", "nat or DN", True, "contrast threshold, brighter"),
    AttributeSpec("metadata/events", "threshold_off", "float", "nat or DN", True, "contrast threshold, darker"),
    AttributeSpec("metadata/events", "log_eps_dn", "float", "DN", False, "L = ln(Y + log_eps_dn), 0 by default"),
    AttributeSpec("metadata/events", "linear_below_dn", "float", "DN", False,
                  "T of lin-log: L = (Y + log_eps_dn) ln(T) / T below T; 0 by default: L is ln"),
    AttributeSpec("metadata/events", "initial_phase", "text", "", False, "first reference level", ("zero", "uniform"),
                  is_open=True),
    AttributeSpec("metadata/events", "packet_interval_us", "int", "us", False, "0: asynchronous"),
    AttributeSpec("metadata/events", "polarity", "text", "", True, "polarity code", ("1=brighter",),
                  ("0=brighter", "1=darker")),
    *(AttributeSpec("metadata/events", name, "float", units, False, meaning)
      for name, units, meaning in _EVENT_EFFECTS),
    AttributeSpec("metadata/events", "hot_pixels", "pixels", "px", False, "columns and rows of hot pixels"),
    AttributeSpec("metadata/imu", "gyro_noise_density", "float", "rad/s/sqrt(Hz)", True, "white noise of the gyro"),
    AttributeSpec("metadata/imu", "accel_noise_density", "float", "m/s^2/sqrt(Hz)", True,
                  "white noise of the accelerometer"),
    AttributeSpec("metadata/imu", "gyro_bias_walk", "float", "rad/s^2/sqrt(Hz)", True, "random walk of the bias"),
    AttributeSpec("metadata/imu", "accel_bias_walk", "float", "m/s^3/sqrt(Hz)", True, "random walk of the bias"),
    AttributeSpec("metadata/imu", "gravity", "float", "m/s^2", True, "g; world gravity is (0, 0, -g)"),
    AttributeSpec("metadata/imu", "sampling", "text", "", False, "what a sample is, instant by default",
                  ("instant", "interval_mean")),
    AttributeSpec("metadata/pose", "position_sigma", "float", "m", True, "noise per axis, world"),
    AttributeSpec("metadata/pose", "rotation_sigma", "float", "rad", True, "noise per axis, body"),
    AttributeSpec("metadata/flow", "unit", "text", "", True, "unit of the flow", ("px",)),
    AttributeSpec("metadata/flow", "model", "text", "", False, "motion that the flow contains, rigid by default",
                  ("rigid", "scene")),
)  # fmt: skip

ATTRIBUTES: Final[Mapping[tuple[str, str], AttributeSpec]] = MappingProxyType(
    {(spec.owner, spec.name): spec for spec in _ATTRIBUTES}
)
"""Every attribute of the layout by owner and name. The attribute ``units`` of each dataset stands in its spec."""

# ``dict.fromkeys`` removes repeats and keeps the order of the layout, in which problems are reported.
METADATA_GROUPS: Final = tuple(dict.fromkeys(owner for owner, _ in ATTRIBUTES if owner.startswith("metadata/")))
"""The groups that declare something."""

FLOW_STREAMS: Final = tuple(f"flow/{rate_hz}hz" for rate_hz in FLOW_RATES_HZ)
STREAMS: Final = ("rgb", "depth", "events", "imu", "pose", *FLOW_STREAMS, "rgb_to_event", "depth_to_event")
"""Every stream of a usual file, a flow rate each on its own. A file may hold flow of other rates instead."""

TIMESTAMPS_OF: Final[Mapping[str, str]] = MappingProxyType(
    {spec.stream: spec.key for spec in _DATASETS if spec.is_timestamps}
)
"""The dataset that holds the timestamps of a stream."""

PROMISED_BY: Final[Mapping[str, str]] = MappingProxyType(
    {
        "rgb": "metadata/cameras/rgb",
        "depth": "metadata/cameras/depth",
        "events": "metadata/events",
        "imu": "metadata/imu",
        "pose": "metadata/pose",
    }
)
"""The group whose presence declares that the file holds the stream."""

FRAMES_OF_MAP: Final[Mapping[str, str]] = MappingProxyType({"rgb_to_event": "rgb", "depth_to_event": "depth"})
"""The frames that an index map points from. It points to events."""

STREAM_GROUPS: Final[Mapping[str, str]] = MappingProxyType(
    {"events": "path/events", "imu": "path/imu", "pose": "path/pose"}
)
"""The group that holds the datasets of a stream and of no other."""


_FLOW_STREAM: Final = re.compile(r"flow/([0-9]{1,7}(?:\.[0-9]{1,6})?)hz")
_FLOW_KEY: Final = re.compile(r"path/(flow/[0-9.]+hz)(?:_ts|_moving)?")

FASTEST_FLOW_HZ: Final = 1e6
"""Timestamps are whole microseconds: no interval is shorter."""


@lru_cache(maxsize=4096)
def is_flow_stream(stream: str) -> bool:
    """Whether a name is that of flow at a rate: ``flow/<R>hz``, R a decimal number above 0 and up to 1e6."""
    match = _FLOW_STREAM.fullmatch(stream)
    return match is not None and 0 < float(match[1]) <= FASTEST_FLOW_HZ


def flow_rate_hz(stream: str) -> float:
    """Return the rate in the name of a flow stream, Hz: 12.5 of ``flow/12.5hz``."""
    return float(stream.removeprefix("flow/").removesuffix("hz"))


def flow_stream_of(key: str) -> str:
    """Return the flow stream of a dataset; empty where the key is of no flow at a legal rate."""
    match = _FLOW_KEY.fullmatch(key)
    return match[1] if match is not None and is_flow_stream(match[1]) else ""


def is_dataset_key(key: str) -> bool:
    """Whether a key is that of a dataset of the layout, flow at any rate included."""
    return key in DATASETS or key in {spec.key for spec in _BESIDE} or bool(flow_stream_of(key))


@lru_cache(maxsize=4096)
def spec_of(key: str) -> DatasetSpec:
    """Return what the layout states of a dataset, of flow at any rate.

    Raises
    ------
    KeyError
        The layout has no such dataset.
    """
    if key in DATASETS:
        return DATASETS[key]
    return {spec.key: spec for spec in (*_BESIDE, *_specs_of(flow_stream_of(key)))}[key]


def is_timed(stream: str) -> bool:
    """Whether the stream has timestamps of its own."""
    return stream in TIMESTAMPS_OF or is_flow_stream(stream)


def timestamps_of(stream: str) -> str:
    """Return the key of the timestamps of a stream; raises ``KeyError`` for a stream without."""
    return f"path/{stream}_ts" if is_flow_stream(stream) else TIMESTAMPS_OF[stream]


def datasets_of(stream: str) -> tuple[DatasetSpec, ...]:
    """Return the datasets that make up a stream."""
    return tuple(spec for spec in _specs_of(stream) if not spec.optional)


def companions_of(stream: str) -> tuple[DatasetSpec, ...]:
    """Return the datasets that may lie beside those of a stream, row by row."""
    return tuple(spec for spec in _specs_of(stream) if spec.optional)


def in_file_order(streams: Collection[str]) -> tuple[str, ...]:
    """Return streams in the order of the layout, flow with the lowest rate first."""
    # Names of equal rates (25hz, 25.0hz) have an order, too.
    rates = sorted(filter(is_flow_stream, streams), key=lambda stream: (flow_rate_hz(stream), stream))
    others = [stream for stream in STREAMS if not is_flow_stream(stream)]
    before = others.index("rgb_to_event")
    return tuple(stream for stream in (*others[:before], *rates, *others[before:]) if stream in streams)


def datasets_of_all(streams: Collection[str]) -> tuple[DatasetSpec, ...]:
    """Return every dataset that streams can have, companions included, in the order of the layout."""
    return tuple(spec for stream in in_file_order(streams) for spec in _specs_of(stream))


def _specs_of(stream: str) -> tuple[DatasetSpec, ...]:
    usual = tuple(spec for spec in (*_DATASETS, *_BESIDE) if spec.stream == stream)
    return usual or (_flow_datasets(stream.removeprefix("flow/").removesuffix("hz")) if is_flow_stream(stream) else ())


def attributes_of(owner: str) -> tuple[AttributeSpec, ...]:
    """Return the attributes that an object carries by the format."""
    return tuple(spec for spec in _ATTRIBUTES if spec.owner == owner)

"""Undoing returns the true rows of data that a test altered itself: a shared sign error would survive a round trip.

Each planter is written with plain arrays from the definitions of the format and the meaning of the cause: positive is
too late or too large.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from fedora_qa.faults.axes import VectorAxes
from fedora_qa.faults.clocks import ClockRate, ClockShift, TimeUnit
from fedora_qa.faults.fault import FaultySequence, InapplicableError, ReversibleFault
from fedora_qa.faults.flow import FlowIntervalShift
from fedora_qa.faults.gravity import ForceSign, GravityAlongBody, GravityError, SensorsInWorld
from fedora_qa.faults.images import (
    ChannelOrder,
    ExposureGain,
    InvalidCode,
    PowerCurve,
    RayLength,
    Vignetting,
)
from fedora_qa.faults.index_maps import IndexShift, IndexSide
from fedora_qa.faults.motion import (
    AccelBias,
    AngleOrder,
    AngleSense,
    GyroBias,
    PoseInversion,
    PoseLeverArm,
    QuaternionInversion,
    QuaternionLength,
    QuaternionOrder,
    Teleport,
)
from fedora_qa.faults.name_order import FramesInOrderOfNames
from fedora_qa.faults.pixels import Mirroring, PixelShift, PolarityInversion, SwappedPixelAxes
from fedora_qa.faults.row_order import DuplicatedSamples, RotatedFrames, SwappedFrames, Unsorted
from fedora_qa.faults.units import AngleUnit, FlowGain, FlowSign, FlowUnit, LengthUnit
from tests.support.memory_sequence import (
    EVENT_HEIGHT,
    EVENT_WIDTH,
    HEIGHT,
    MS,
    WIDTH,
    Arrays,
    MemorySequence,
    all_rows,
    facts_of,
    memory_sequence,
)

Planter = Callable[[Arrays], Arrays]
EVENT_KEYS = tuple(f"path/events/{column}" for column in "xytp")
FLOW_KEYS = tuple(f"path/flow/{rate}hz" for rate in (10, 25, 50))
X, Y, T, P = EVENT_KEYS
GYRO, ACCEL = "path/imu/angular_velocity", "path/imu/linear_acceleration"


def counted(arrays: Arrays) -> Arrays:
    """Index maps of a recorder that makes them from these timestamps."""
    instants = {frames: arrays[f"path/{frames}_ts"] for frames in ("rgb", "depth")} | {"ms": MS * np.arange(101)}
    return {f"metadata/{name}_to_event": np.array([np.sum(arrays[T] < at) for at in instants[name]])
            for name in instants}  # fmt: skip


def on(planter: Callable[[np.ndarray], np.ndarray], *keys: str) -> Planter:
    """Alter each of these arrays."""
    return lambda arrays: {key: planter(arrays[key].copy()) for key in keys}


def with_maps(planter: Planter) -> Planter:
    """Alter timestamps or rows, then make the index maps of what came out."""
    return lambda arrays: (altered := planter(arrays)) | counted({**arrays, **altered})


def rows_twice(arrays: Arrays) -> Arrays:
    """Write rows 3 and 4 of rgb twice, each copy after its frame."""
    twice = [0, 1, 2, 3, 3, 4, 4, 5]
    return {key: arrays[key][twice] for key in ("path/rgb", "path/rgb_ts")}


def packet_twice(arrays: Arrays) -> Arrays:
    """Flush the IMU samples 40 to 49 twice, all ten together."""
    twice = [*range(50), *range(40, 50), *range(50, 101)]
    return {key: arrays[key][twice] for key in arrays if key.startswith("path/imu")}


def events_twice(arrays: Arrays) -> Arrays:
    """Write events 150 to 249 twice, each copy after its event."""
    twice = np.sort([*range(400), *range(150, 250)])
    return {key: arrays[key][twice] for key in EVENT_KEYS}


def reversed_events(arrays: Arrays) -> Arrays:
    """Write the distinct timestamps of 60 events in reverse, with all their values."""
    order = np.arange(400)
    order[300:360] = order[300:360][::-1]
    return {key: arrays[key][order] for key in EVENT_KEYS}


def distinct(arrays: Arrays) -> Arrays:
    """Give every event its own timestamp, so that there is one order of time."""
    return {T: arrays[T] + np.arange(400)}


def late_flow(fields: np.ndarray) -> np.ndarray:
    """Store each field one row too late; the first row repeats it."""
    return fields[[0, *range(len(fields) - 1)]]


def in_px_per_s(arrays: Arrays) -> Arrays:
    """Divide displacements by the duration of their interval, s."""
    intervals_s = {key: np.diff(arrays[f"{key}_ts"], axis=1)[:, :, None, None] / 1e9 for key in FLOW_KEYS}
    return {key: (arrays[key].astype(float) / intervals_s[key]).astype(np.float32) for key in FLOW_KEYS}


def in_px_per_ms(arrays: Arrays) -> Arrays:
    """Divide displacements by the duration of their interval, ms."""
    return {key: (flow.astype(float) / 1000).astype(np.float32) for key, flow in in_px_per_s(arrays).items()}


def per_frame(arrays: Arrays) -> Arrays:
    """Divide displacements by the number of periods of the frames in their interval."""
    period_s = np.median(np.diff(arrays["path/rgb_ts"])) / 1e9
    return {key: (flow.astype(float) * period_s).astype(np.float32) for key, flow in in_px_per_s(arrays).items()}


def in_images(arrays: Arrays) -> Arrays:
    """Divide u by the width of the image, and v by its height."""
    flows = {key: arrays[key].astype(float) for key in FLOW_KEYS}
    shares = {key: np.stack([f[..., 0] / f.shape[2], f[..., 1] / f.shape[1]], axis=-1) for key, f in flows.items()}
    return {key: share.astype(np.float32) for key, share in shares.items()}


def in_focal_lengths(arrays: Arrays) -> Arrays:
    """Divide u by fx, and v by fy, of the camera of depth and flow."""
    K = facts_of(memory_sequence()).declared.cameras["depth"].K
    return {key: (arrays[key].astype(float) / (K[0, 0], K[1, 1])).astype(np.float32) for key in FLOW_KEYS}


def attitudes_at_imu(arrays: Arrays) -> Rotation:
    """Body-to-world rotations at the IMU times, by cubic splines of the rotation vectors, which are linear here."""
    vectors = Rotation.from_quat(arrays["path/pose/orientation"]).as_rotvec()
    return Rotation.from_rotvec(CubicSpline(arrays["path/pose/ts"], vectors)(arrays["path/imu/ts"]))


def upward(m_s2: float) -> Planter:
    """Add an acceleration along the vertical of the world to the specific force in the body."""
    return lambda arrays: {"path/imu/linear_acceleration": arrays["path/imu/linear_acceleration"]
                           + attitudes_at_imu(arrays).inv().apply([0, 0, m_s2])}  # fmt: skip


def north_east_down(arrays: Arrays) -> Arrays:
    """Write (north, east, down) from (east, north, up), and a body of X forward, Y right, Z down."""
    W, B = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
    R = Rotation.from_quat(arrays["path/pose/orientation"]).as_matrix()
    position = arrays["path/pose/position"]
    return {"path/pose/position": np.column_stack([position[:, 1], position[:, 0], -position[:, 2]]),
            "path/pose/orientation": Rotation.from_matrix(W @ R @ B.T).as_quat()}  # fmt: skip


def world_in_body(arrays: Arrays) -> Arrays:
    """Poses as visual SLAM writes them: the inverse of each."""
    inverse = Rotation.from_quat(arrays["path/pose/orientation"]).inv()
    return {"path/pose/position": -inverse.apply(arrays["path/pose/position"].copy()),
            "path/pose/orientation": inverse.as_quat()}  # fmt: skip


def ray_lengths(arrays: Arrays) -> Arrays:
    """Distance of each point from the centre of the camera: sqrt(X^2 + Y^2 + Z^2)."""
    Z = arrays["path/depth"].astype(float)
    focal = WIDTH / (2 * np.tan(np.pi / 6))
    X = (np.arange(WIDTH) - (WIDTH - 1) / 2) / focal * Z
    Y = ((np.arange(HEIGHT) - (HEIGHT - 1) / 2) / focal)[:, None] * Z
    return {"path/depth": np.sqrt(X**2 + Y**2 + Z**2).astype(np.float32)}


def darker_corners(frames: np.ndarray) -> np.ndarray:
    """Lose 30% in the corner; the logarithm of the gain goes with the square of the distance from the middle."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    squares = (x - (WIDTH - 1) / 2) ** 2 + (y - (HEIGHT - 1) / 2) ** 2
    gains = np.exp(np.log(0.7) * squares / squares.max())
    return np.rint(frames * gains[..., None]).astype(np.uint8)


def shifted_right(images: np.ndarray) -> np.ndarray:
    """Shift by two columns to the right and one row down; what is freed is NaN."""
    shifted = np.full_like(images, np.nan)
    shifted[:, 1:, 2:] = images[:, :-1, :-2]
    return shifted


def from_row(value: float | list[float], first: int, last: int | None = None) -> Callable[[np.ndarray], np.ndarray]:
    """Add a value to the rows from one on."""

    def planter(rows: np.ndarray) -> np.ndarray:
        rows[first:last] = rows[first:last] + np.array(value).astype(rows.dtype)
        return rows

    return planter


Truth = tuple[ReversibleFault, Planter]


def from_north(arrays: Arrays) -> Arrays:
    """Yaw is counted clockwise from north."""
    yaw, pitch, roll = Rotation.from_quat(arrays["path/pose/orientation"]).as_euler("ZYX").T
    angles = np.stack((np.pi / 2 - yaw, pitch, roll), axis=1)
    return {"path/pose/orientation": Rotation.from_euler("ZYX", angles).as_quat()}


EXACT: list[Truth] = [
    (ClockShift("imu", 3 * MS), on(lambda t: t + 3 * MS, "path/imu/ts")),
    (ClockShift("flow", -2 * MS), on(lambda t: t - 2 * MS, *(f"{key}_ts" for key in FLOW_KEYS))),
    (ClockShift("depth", 6 * MS, regular_ns=(0, 20 * MS)),
     on(lambda t: t + 6 * MS + 1000 * (np.arange(len(t)) * 7919 % 3001), "path/depth_ts")),
    (ClockShift("depth", 30 * MS, regular_ns=(0, 20 * MS)),
     on(lambda t: t + 30 * MS + 1000 * (np.arange(len(t)) * 7919 % 9001), "path/depth_ts")),
    (ClockShift("pose", 5 * MS, rows=(9, None)), on(from_row(5 * MS, 9), "path/pose/ts")),
    (ClockShift("events", 7 * MS), with_maps(on(lambda t: t + 7 * MS, T))),
    (ClockShift("events", 7 * MS), on(lambda t: t + 7 * MS, T)),
    (ClockShift("events", 7 * MS, while_ns=(40 * MS, None)), with_maps(on(lambda t: t + 7 * MS * (t >= 40 * MS), T))),
    (ClockShift("events", -5 * MS, while_ns=(None, 30 * MS)), with_maps(on(lambda t: t - 5 * MS * (t < 30 * MS), T))),
    (ClockShift("rgb", -4 * MS), with_maps(on(lambda t: t - 4 * MS, "path/rgb_ts"))),
    (ClockRate("imu", 1000, pivot_ns=0), on(lambda t: t + t // 1000, "path/imu/ts")),
    (ClockRate("imu", 1000, pivot_ns=20 * MS, duration_ns=50 * MS),
     on(lambda t: t + np.clip(t - 20 * MS, 0, 50 * MS) // 1000, "path/imu/ts")),
    (TimeUnit("events", 1000), on(lambda t: t * 1000, T)),
    (TimeUnit("flow", 1000), on(lambda t: t * 1000, *(f"{key}_ts" for key in FLOW_KEYS))),
    (Unsorted("imu", 0, 2), lambda arrays: {key: arrays[key][[*range(50), *range(60, 49, -1), *range(61, 101)]]
                                            for key in arrays if key.startswith("path/imu")}),
    (Unsorted("imu", 0, 2, timestamps_only=True), on(lambda t: t[[1, 0, *range(2, 101)]], "path/imu/ts")),
    (DuplicatedSamples("imu"), packet_twice),
    (SwappedFrames("depth", ((1, 4),)), on(lambda images: images[[0, 4, 2, 3, 1, 5]], "path/depth")),
    (RotatedFrames("depth", (1, 5), -1), on(lambda images: images[[0, 2, 3, 4, 1, 5]], "path/depth")),
    (RotatedFrames("depth", (2, None), 1), on(lambda images: images[[0, 1, 5, 2, 3, 4]], "path/depth")),
    # Numbers 8, 9, 10 to 13 as text: 10, 11, 12, 13, 8, 9.
    (FramesInOrderOfNames("depth", 8), on(lambda images: images[[2, 3, 4, 5, 0, 1]], "path/depth")),
    (IndexShift("rgb_to_event", 1), on(lambda index: index + 1, "metadata/rgb_to_event")),
    (IndexShift("ms_to_event", -2), on(lambda index: index - 2, "metadata/ms_to_event")),
    (IndexSide("rgb_to_event"), lambda arrays: {"metadata/rgb_to_event": np.array(
        [np.sum(arrays[T] <= at) for at in arrays["path/rgb_ts"]])}),
    (PolarityInversion(), on(lambda p: np.choose(np.minimum(p, 2), [1, 0, 255]).astype(np.uint8), P)),
    (SwappedPixelAxes("events"), lambda arrays: {X: arrays[Y], Y: arrays[X]}),
    (SwappedPixelAxes("flow/10hz"), on(lambda flow: np.stack([flow[..., 1], flow[..., 0]], -1), "path/flow/10hz")),
    (Mirroring("rgb"), on(lambda frames: frames[:, :, ::-1], "path/rgb")),
    (Mirroring("depth", "vertical"), on(lambda frames: frames[:, ::-1], "path/depth")),
    (Mirroring("rgb", "both"), on(lambda frames: frames[:, ::-1, ::-1], "path/rgb")),
    (Mirroring("events"), on(lambda x: np.where(x < EVENT_WIDTH, 9 - x, x).astype(np.uint16), X)),
    (Mirroring("events", "vertical"), on(lambda y: np.where(y < EVENT_HEIGHT, 7 - y, y).astype(np.uint16), Y)),
    (FlowSign(), on(lambda flow: -flow, *FLOW_KEYS)),
    (QuaternionOrder((3, 0, 1, 2)), on(lambda q: np.column_stack([q[:, 3], q[:, :3]]), "path/pose/orientation")),
    (QuaternionInversion(), on(lambda q: np.column_stack([-q[:, :3], q[:, 3]]), "path/pose/orientation")),
    (QuaternionOrder((1, 2, 0, 3), inverted=True),
     on(lambda q: np.column_stack([-q[:, 1], -q[:, 2], -q[:, 0], q[:, 3]]), "path/pose/orientation")),
    (ForceSign(), on(lambda v: -v, ACCEL)),
    (ChannelOrder("BGR"), on(lambda frames: frames[..., ::-1], "path/rgb")),
    (ChannelOrder("GBR"), on(lambda frames: np.stack([frames[..., i] for i in (1, 2, 0)], -1), "path/rgb")),
    (InvalidCode("depth"), on(lambda depth: np.nan_to_num(depth, nan=0.0), "path/depth")),
    (InvalidCode("flow"), on(lambda flow: np.nan_to_num(flow, nan=0.0), *FLOW_KEYS)),
    (VectorAxes("imu", ((0, 1, 0), (1, 0, 0), (0, 0, 1)), sensors=("gyro",)),
     on(lambda v: np.column_stack([v[:, 1], v[:, 0], v[:, 2]]), GYRO)),
    (VectorAxes("imu", ((1, 0, 0), (0, -1, 0), (0, 0, -1))),
     on(lambda v: np.column_stack([v[:, 0], -v[:, 1], -v[:, 2]]), GYRO, ACCEL)),
    (VectorAxes("imu", ((0, 1, 0), (0, 0, 1), (1, 0, 0))), on(lambda v: v[:, [1, 2, 0]], GYRO, ACCEL)),
]  # fmt: skip
"""Whose undone rows equal the true ones, bit by bit."""

ROUNDED: list[Truth] = [
    (LengthUnit("depth", 1e-3), on(lambda depth: depth / np.float32(1000), "path/depth")),
    (LengthUnit("pose", 1e3), on(lambda position: position * 1000, "path/pose/position")),
    (AngleUnit(180 / np.pi), on(np.degrees, "path/imu/angular_velocity")),
    (FlowUnit("flow", "px/s"), in_px_per_s),
    (FlowUnit("flow", "px/ms"), in_px_per_ms),
    (FlowUnit("flow", "px per frame"), per_frame),
    (FlowUnit("flow", "fractions", 128.0), on(lambda flow: flow * np.float32(128), *FLOW_KEYS)),
    (FlowUnit("flow", "images"), in_images),
    (
        FlowUnit("flow", "clip space"),
        lambda arrays: {key: flow * np.float32([2, -2]) for key, flow in in_images(arrays).items()},
    ),
    (FlowUnit("flow", "focal lengths"), in_focal_lengths),
    (FlowUnit("flow", "half images"), lambda arrays: {key: 2 * flow for key, flow in in_images(arrays).items()}),
    (FlowGain("flow", 10), on(lambda flow: flow + flow / np.float32(10), *FLOW_KEYS)),
    (GyroBias((0.1, 0, -0.2)), on(lambda v: v + np.array([0.1, 0, -0.2]), "path/imu/angular_velocity")),
    (AccelBias((0, 0.3, 0)), on(lambda v: v + np.array([0, 0.3, 0]), "path/imu/linear_acceleration")),
    (Teleport((0.5, 0, 0), (10, None)), on(from_row([0.5, 0, 0], 10), "path/pose/position")),
    (Teleport((0, -2, 0), (10, 15)), on(from_row([0, -2, 0], 10, 15), "path/pose/position")),
    (PoseLeverArm((0.3, 0, 0.1)), lambda arrays: {"path/pose/position": arrays["path/pose/position"]
        + Rotation.from_quat(arrays["path/pose/orientation"]).apply([0.3, 0, 0.1])}),
    (PoseInversion(), world_in_body),
    (AngleOrder(were_taken_so=True),
     on(lambda q: Rotation.from_euler("ZYX", Rotation.from_quat(q).as_euler("XYZ")[:, ::-1]).as_quat(),
        "path/pose/orientation")),
    (AngleOrder(), on(lambda q: Rotation.from_euler("XYZ", Rotation.from_quat(q).as_euler("ZYX")[:, ::-1]).as_quat(),
                      "path/pose/orientation")),
    (AngleSense((-1, 1, 1), ((0, -1, 0), (1, 0, 0), (0, 0, 1))), from_north),
    (GravityAlongBody(), on(lambda v: v - np.array([0.0, 0.0, 9.8066]), ACCEL)),
    (GravityAlongBody((0.3, -0.2, 9.7)), on(lambda v: v - np.array([0.3, -0.2, 9.7]), ACCEL)),
    (QuaternionLength(0.1), on(lambda q: q * 1.1, "path/pose/orientation")),
    (QuaternionLength(0.0), on(lambda q: q * np.linspace(0.9, 1.2, len(q))[:, None], "path/pose/orientation")),
    (VectorAxes("pose", ((0, 1, 0), (1, 0, 0), (0, 0, -1)), ((1, 0, 0), (0, -1, 0), (0, 0, -1))), north_east_down),
    (RayLength(), ray_lengths),
]  # fmt: skip
"""Whose undone rows differ from the true ones by roundings of their type."""


def undone_rows(fault: ReversibleFault, clean: MemorySequence, planter: Planter) -> Arrays:
    """All rows after undoing, in a sequence that the planter altered."""
    faulty = MemorySequence({**clean.arrays, **planter(clean.arrays)}, clean.declared, clean.origin_ns)
    assert any(not np.array_equal(faulty.arrays[key], array) for key, array in clean.arrays.items())
    return all_rows(FaultySequence(faulty, fault.undo(facts_of(faulty), faulty)))


@pytest.mark.parametrize(("fault", "planter"), EXACT)
def test_undone_rows_are_the_true_ones(fault: ReversibleFault, planter: Planter) -> None:
    """Every dataset is as in the clean sequence, index maps too, whether or not they were made after the fault."""
    clean = memory_sequence()
    for key, rows in undone_rows(fault, clean, planter).items():
        np.testing.assert_array_equal(rows, clean.arrays[key], err_msg=key)


@pytest.mark.parametrize(("fault", "planter"), ROUNDED)
def test_undone_rows_are_the_true_ones_but_for_rounding(fault: ReversibleFault, planter: Planter) -> None:
    """Every dataset is as in the clean sequence, but for two roundings; quaternions but for their sign."""
    clean = memory_sequence()
    for key, rows in undone_rows(fault, clean, planter).items():
        true, signs = clean.arrays[key], 1
        if key == "path/pose/orientation":
            signs = np.sign(np.sum(rows * true, axis=1, keepdims=True))
        tolerance = 4 * np.finfo(true.dtype).eps if true.dtype.kind == "f" else 0
        # Sums lose what is small against their terms: the largest value is of their size.
        np.testing.assert_allclose(
            signs * rows, true, rtol=tolerance, atol=4 * tolerance * np.nanmax(true), err_msg=key
        )


@pytest.mark.parametrize(
    ("cause", "m_s2"), [("gravity_missing", -9.8066), ("gravity_sign", -19.6132), ("gravity_magnitude", 0.2)]
)
def test_gravity_is_put_back(cause: str, m_s2: float) -> None:
    """Specific force is as before but for the interpolation of the attitude, by another spline."""
    clean, fault = memory_sequence(), GravityError(cause, 0.2)  # type: ignore[arg-type]
    rows = undone_rows(fault, clean, upward(m_s2))["path/imu/linear_acceleration"]
    np.testing.assert_allclose(rows, clean.arrays["path/imu/linear_acceleration"], atol=1e-4)


def test_gravity_is_put_back_in_a_part() -> None:
    clean = memory_sequence()
    key, rows = "path/imu/linear_acceleration", (40, 90)

    def lifted(arrays: Arrays) -> Arrays:
        inside = (np.arange(len(arrays[key])) >= rows[0]) & (np.arange(len(arrays[key])) < rows[1])
        return {key: np.where(inside[:, None], upward(-9.8066)(arrays)[key], arrays[key])}

    undone = undone_rows(GravityError("gravity_missing", rows=rows), clean, lifted)[key]
    np.testing.assert_allclose(undone, clean.arrays[key], atol=1e-4)
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(undone_rows(GravityError("gravity_missing"), clean, lifted)[key], clean.arrays[key])


@pytest.mark.parametrize("sensor", ["gyro", "accelerometer"])
def test_vectors_are_turned_back_from_the_world(sensor: Literal["gyro", "accelerometer"]) -> None:
    """Vectors are as before but for the interpolation of the attitude, by another spline."""
    clean, fault = memory_sequence(), SensorsInWorld((sensor,))
    key = GYRO if sensor == "gyro" else ACCEL

    def in_world(arrays: Arrays) -> Arrays:
        return {key: attitudes_at_imu(arrays).apply(arrays[key].copy())}

    rows = undone_rows(fault, clean, in_world)
    np.testing.assert_allclose(rows[key], clean.arrays[key], atol=1e-4)


def test_frames_and_events_that_were_written_twice() -> None:
    """Copies are dropped, also the rows of the index map, whose entries follow."""
    clean = memory_sequence()
    planters: tuple[tuple[ReversibleFault, Planter], ...] = (
        (DuplicatedSamples("rgb"), with_maps(rows_twice)),
        (DuplicatedSamples("events", 150, 100), with_maps(events_twice)),
    )
    for fault, planter in planters:
        for key, rows in undone_rows(fault, clean, planter).items():
            np.testing.assert_array_equal(rows, clean.arrays[key], err_msg=key)


@pytest.mark.parametrize("block", [16, 64])
def test_copies_of_events_are_dropped_in_blocks(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks end where the timestamp changes, so that no event is parted from its copy."""
    monkeypatch.setattr("fedora_qa.faults.row_order.BLOCK_ROWS", block)
    for key, rows in undone_rows(DuplicatedSamples("events", 150, 100), memory_sequence(), events_twice).items():
        if key in EVENT_KEYS:
            np.testing.assert_array_equal(rows, memory_sequence().arrays[key], err_msg=key)


def test_a_size_that_is_slightly_off_leaves_the_rest_of_the_fault() -> None:
    """Of 7 ms, 6.5 ms are undone; maps that followed the faulty timestamps follow those that are left."""
    clean = memory_sequence()
    late = with_maps(on(lambda t: t + 7 * MS, T))
    rows = undone_rows(ClockShift("events", 6.5 * MS), clean, late)
    np.testing.assert_array_equal(rows[T], clean.arrays[T] + MS // 2)
    for key, expected in counted({**clean.arrays, T: rows[T]}).items():
        np.testing.assert_array_equal(rows[key], expected)


def test_samples_that_share_a_timestamp_and_differ_are_kept() -> None:
    """Two frames of one timestamp with other values are not the same frame twice."""
    clean = memory_sequence()
    faulty = clean.altered(path__rgb_ts=np.array([0, 1, 1, 3, 4, 5]) * 20 * MS)
    undone = FaultySequence(faulty, DuplicatedSamples("rgb").undo(facts_of(faulty), faulty))
    assert undone.layout.bindings["path/rgb"].rows == 6


@pytest.mark.parametrize("block", [7, 64, 1 << 20])
def test_events_are_sorted_in_blocks(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Events go back to their place, whatever blocks the stream is scanned in."""
    monkeypatch.setattr("fedora_qa.faults.row_order.BLOCK_ROWS", block)
    clean = MemorySequence(
        {**memory_sequence().arrays, **distinct(memory_sequence().arrays)}, memory_sequence().declared
    )
    clean = MemorySequence({**clean.arrays, **counted(clean.arrays)}, clean.declared)
    undone = undone_rows(Unsorted("events", 0, 2), clean, reversed_events)
    for key, rows in undone.items():
        np.testing.assert_array_equal(rows, clean.arrays[key], err_msg=key)


def test_events_far_from_their_place_are_not_sorted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where too many events would have to be sorted together it is said."""
    monkeypatch.setattr("fedora_qa.faults.row_order._LONGEST_RUN", 30)
    with pytest.raises(InapplicableError, match="sorted within 30 rows"):
        undone_rows(Unsorted("events", 0, 2), memory_sequence(), reversed_events)


def test_invalid_timestamps_stay() -> None:
    """A timestamp without a place in time has none after any undoing."""
    clean, invalid = memory_sequence(), -(2**61)
    times = clean.arrays["path/imu/ts"].copy()
    times[[3, 50]] = invalid
    faulty = clean.altered(path__imu__ts=times)
    for fault in (ClockShift("imu", 9), ClockRate("imu", 9), TimeUnit("imu", 1e-3), Unsorted("imu", 0, 2)):
        rows = all_rows(FaultySequence(faulty, fault.undo(facts_of(faulty), faulty)))["path/imu/ts"]
        assert np.flatnonzero(rows == invalid).tolist() == [3, 50]


def test_images_are_resampled_between_pixels() -> None:
    """Straight lines of values stay straight; a value next to an invalid pixel, or between two surfaces, is none."""
    x, y = np.meshgrid(np.arange(16.0), np.arange(12.0))
    flow = np.stack([0.3 * x - 0.1 * y, 0.2 * y + 0.1 * x], axis=-1)
    flow[:, 10:] += 5.0
    flow[2, 3] = np.nan
    rows = np.repeat(flow[None], 2, axis=0).astype(np.float32)
    sequence = memory_sequence()
    undoing = PixelShift("flow/10hz", 0.25, -0.5).undo(facts_of(sequence), sequence)
    back = undoing.rows["path/flow/10hz"](lambda start, stop: rows[start:stop], 0, 2)
    assert (back.shape, back.dtype) == (rows.shape, rows.dtype)
    # The value of a pixel was stored a quarter to its right and half a row above.
    ramps = np.stack([0.3 * (x + 0.25) - 0.1 * (y - 0.5), 0.2 * (y - 0.5) + 0.1 * (x + 0.25)], axis=-1)
    ramps[:, 10:] += 5.0
    valid = np.isfinite(back[0, ..., 0])
    np.testing.assert_allclose(back[0][valid], ramps[valid], atol=1e-5)
    # The first row and the last column come from outside. Pixels about the invalid one and about the step are lost.
    invalid = np.zeros((12, 16), bool)
    invalid[0], invalid[:, -1], invalid[:6, :6], invalid[:, 7:12] = True, True, True, True
    assert not np.any(~valid & ~invalid)
    assert not np.any(valid[:, 8:11])
    assert not np.any(valid[2:4, 2:4])
    colour = np.tile((10 * np.arange(16))[None, None, :, None], (1, 12, 1, 3)).astype(np.uint8)
    undoing = PixelShift("rgb", 0.5).undo(facts_of(sequence), sequence)
    back = undoing.rows["path/rgb"](lambda start, stop: colour, 0, 1)
    np.testing.assert_array_equal(back[0, :, :-1, 0], np.tile(10 * np.arange(15) + 5, (12, 1)))


def test_shifted_images_and_events_go_back() -> None:
    """What has not left the image is where it was; what has left is NaN."""
    clean = memory_sequence()
    rows = undone_rows(PixelShift("depth", 2, 1), clean, on(shifted_right, "path/depth"))["path/depth"]
    np.testing.assert_array_equal(rows[:, :-1, :-2], clean.arrays["path/depth"][:, :-1, :-2])
    assert np.all(np.isnan(rows[:, -1]))
    assert np.all(np.isnan(rows[:, :, -2:]))
    x = clean.arrays[X]
    right = np.where(x < EVENT_WIDTH - 3, x + 3, x).astype(np.uint16)
    rows = all_rows(FaultySequence(faulty := clean.altered(path__events__x=right),
                                   PixelShift("events", 3).undo(facts_of(faulty), faulty)))[X]  # fmt: skip
    stays = x < EVENT_WIDTH - 3
    np.testing.assert_array_equal(rows[stays], x[stays])
    np.testing.assert_array_equal(rows[x >= EVENT_WIDTH], x[x >= EVENT_WIDTH])


def test_flow_goes_back_to_its_interval() -> None:
    """Fields that were stored one row late are where they were, and the lost last field is NaN."""
    clean = memory_sequence()
    rows = undone_rows(FlowIntervalShift("flow/50hz", 1), clean, on(late_flow, "path/flow/50hz"))["path/flow/50hz"]
    np.testing.assert_array_equal(rows[:-1], clean.arrays["path/flow/50hz"][:-1])
    assert np.all(np.isnan(rows[-1]))


def darker_from_row_2(frames: np.ndarray) -> np.ndarray:
    """Lose a fifth of each code from the third frame on."""
    return np.concatenate([frames[:2], np.rint(frames[2:] * 0.8).astype(np.uint8)])


@pytest.mark.parametrize(("fault", "planter", "most"), [
    (ExposureGain(-20, rows=(2, None)), on(darker_from_row_2, "path/rgb"), 1),
    (PowerCurve(1 / 2.2), on(lambda v: np.rint(255 * (v / 255) ** (1 / 2.2)).astype(np.uint8), "path/rgb"), 2),
    (Vignetting(30), on(darker_corners, "path/rgb"), 1),
])  # fmt: skip
def test_brightness_is_put_back(fault: ReversibleFault, planter: Planter, most: int) -> None:
    """Codes differ by the roundings of both curves: half a code times the slope of the inverse, and half a code."""
    clean = memory_sequence()
    rows = undone_rows(fault, clean, planter)["path/rgb"].astype(int)
    assert np.abs(rows - clean.arrays["path/rgb"]).max() <= most

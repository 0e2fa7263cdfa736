"""NaN and infinity, and how invalid pixels are marked."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks.integrity.finite import FALSE_ALARMS, empty_between_full, longest_displacement_px, run_of
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.images.values import add_up, tally_depth, tally_flow, tally_samples
from tests.support.checked import diagnoses_of, rules, run_check
from tests.support.handmade import write_handmade

DEPTH = "path/depth"
RANGE_M = (0.1, 30.0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The handmade file, to be altered."""
    return write_handmade(tmp_path / "hand.h5")


def alter(path: Path, key: str, rows: Any, value: float) -> None:
    with h5py.File(path, "r+") as file:
        file[key][rows] = value


@pytest.mark.parametrize(
    ("key", "stream"),
    [("path/imu/angular_velocity", "imu"), ("path/imu/linear_acceleration", "imu"), ("path/pose/position", "pose"),
     ("path/pose/orientation", "pose")],
)  # fmt: skip
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_samples_must_be_finite(path: Path, key: str, stream: str, value: float) -> None:
    """One component of two samples is enough; the first is located and the count diagnosed."""
    alter(path, key, (slice(11, 13), 1), value)
    result = run_check(path, "integrity.finite")
    assert rules(result) == ["not_finite"]
    assert result.findings[0].where.index_start == 11
    (diagnosis,) = diagnoses_of(path, "integrity")
    assert (diagnosis.cause, diagnosis.stream, diagnosis.magnitude) == ("nan_in_stream", stream, 2)


@pytest.mark.parametrize("code", [0.0, -1.0, 65535.0], ids=str)
def test_code_for_invalid_depth(path: Path, code: float) -> None:
    """A number that stands for no value is a wrong encoding, located to the pixel (column, row)."""
    alter(path, DEPTH, (slice(1, None), slice(0, 3)), code)
    result = run_check(path, "integrity.finite")
    assert rules(result) == ["outside_range"]
    where = result.findings[0].where
    assert (where.frame, where.pixel, where.start_us) == (1, (0, 0), 20_000)
    (diagnosis,) = diagnoses_of(path, "integrity")
    assert (diagnosis.cause, diagnosis.stream) == ("invalid_encoding", "depth")


@pytest.mark.parametrize(("key", "stream"), [(DEPTH, "depth"), ("path/flow/25hz", "flow/25hz")])
def test_infinity_is_no_invalid_value(path: Path, key: str, stream: str) -> None:
    """Infinity in depth or flow is a wrong encoding."""
    alter(path, key, (1, 4, 5), np.inf)
    result = run_check(path, "integrity.finite")
    assert rules(result) == ["infinite"]
    assert result.findings[0].where.pixel == (5, 4)
    (diagnosis,) = diagnoses_of(path, "integrity")
    assert (diagnosis.cause, diagnosis.stream) == ("invalid_encoding", stream)


@pytest.mark.parametrize(("beyond_mm", "expected"), [(0.0, []), (100.0, ["outside_range"])])
def test_rounding_may_leave_the_range(path: Path, beyond_mm: float, expected: list[str]) -> None:
    """Depths at both ends of the range, rounded to 64 mm, lie up to 32 mm beside it; others do not."""
    with h5py.File(path, "r+") as file:
        depth_mm = np.random.default_rng(0).uniform(1000 * RANGE_M[0], 1000 * RANGE_M[1], file[DEPTH].shape)
        depth_mm[:, 0] = 1000 * RANGE_M[0]
        depth_mm[:, 1] = 1000 * RANGE_M[1] + beyond_mm
        file[DEPTH][...] = 64.0 * np.rint(depth_mm / 64.0)
        assert file[DEPTH][()].max() > 1000 * RANGE_M[1]
    assert rules(run_check(path, "integrity.finite")) == expected


def test_metres_are_suspected(path: Path) -> None:
    """Depth in metres lies below the range as a whole; the factor is diagnosed."""
    with h5py.File(path, "r+") as file:
        file[DEPTH][...] = file[DEPTH][()] / 1000
    (diagnosis,) = diagnoses_of(path, "integrity")
    assert (diagnosis.cause, diagnosis.stream, diagnosis.magnitude) == ("unit_mm_m", "depth", 0.001)


def test_metres_for_a_while_are_undone_there(path: Path) -> None:
    """Frames of another unit are named, and divided alone: in the whole file correct ones would be wrong."""
    with h5py.File(path, "r+") as file:
        depth = file[DEPTH][...] * np.linspace(0.8, 1.2, 36, dtype=np.float32)
        depth[3:5] /= 1000
        file[DEPTH][...] = depth
    (diagnosis,) = diagnoses_of(path, "integrity")
    assert (diagnosis.cause, diagnosis.stream, diagnosis.magnitude) == ("unit_mm_m", "depth", 0.001)


@pytest.mark.parametrize(("rows", "run"), [((3,), (3, 4)), ((3, 4, 5), (3, 6)), ((3, 5), None), ((), None)])
def test_rows_in_metres_are_one_run_or_none(rows: tuple[int, ...], run: tuple[int, int] | None) -> None:
    """Most values of these frames fall into the range once multiplied by 1000; a tenth of a frame is no frame."""
    frames = np.full((8, 10, 10), 5000.0, dtype=np.float32)
    frames[list(rows)] /= 1000
    frames[7, 0] /= 1000
    (total,) = add_up(tally_depth(DEPTH, row, frame, RANGE_M) for row, frame in enumerate(frames))
    assert total.rescaled_rows == rows
    assert run_of(total.rescaled_rows) == run


def test_metres_in_a_part_of_the_image_are_suspected(path: Path) -> None:
    """Values of many sizes that all fall into the range once multiplied by 1000 are metres, wherever they are."""
    with h5py.File(path, "r+") as file:
        depth = file[DEPTH][...] * np.linspace(0.8, 1.2, 36, dtype=np.float32)
        depth[..., ::2] /= 1000
        file[DEPTH][...] = depth
    diagnosis = diagnoses_of(path, "integrity")[0]
    assert (diagnosis.cause, diagnosis.stream, diagnosis.magnitude) == ("unit_mm_m", "depth", 0.001)


def test_frame_without_values(path: Path) -> None:
    """A depth frame that is NaN throughout between full ones was never written."""
    alter(path, DEPTH, 3, np.nan)
    result = run_check(path, "integrity.finite")
    assert rules(result) == ["empty_images"]
    assert result.findings[0].where.frame == 3
    (diagnosis,) = diagnoses_of(path, "integrity")
    assert (diagnosis.cause, diagnosis.stream, diagnosis.magnitude) == ("nan_in_stream", "depth", 1)


def test_depth_without_any_value_is_noted(path: Path) -> None:
    """A whole stream of NaN is legal (nothing within range) and unusual: a warning."""
    alter(path, DEPTH, slice(None), np.nan)
    assert run_check(path, "integrity.finite").outcome == "warned"


def test_nan_timestamps(path: Path) -> None:
    """A stamp that is NaN is found although it has no place in time."""
    with h5py.File(path, "r+") as file:
        timestamps = file["path/imu/ts"][()].astype(np.float64)
        timestamps[[3, 50]] = np.nan
        del file["path/imu/ts"]
        file["path/imu/ts"] = timestamps
    result = run_check(path, "integrity.finite")
    assert rules(result) == ["stamps_not_finite"]
    assert result.findings[0].where.index_start == 3


@pytest.mark.parametrize("edge_m", RANGE_M)
def test_range_includes_its_ends(edge_m: float) -> None:
    """Depth that was clipped to the range and rounded to float32 lies within it; a ten-thousandth beyond does not."""
    at_edge = np.full((2, 2), np.float32(edge_m * 1000), dtype=np.float32)
    outwards = np.float32(1 + 1e-4 * (1 if edge_m == RANGE_M[1] else -1))
    assert tally_depth(DEPTH, 0, at_edge, RANGE_M).outside == 0
    assert tally_depth(DEPTH, 0, at_edge * outwards, RANGE_M).outside == 4


def test_without_range_depth_is_above_zero() -> None:
    """Where no range is declared any positive number is a depth."""
    depth_mm = np.array([[0.0, -1.0, 1e-20], [1e9, np.nan, np.inf]], dtype=np.float32)
    tally = tally_depth(DEPTH, 7, depth_mm, None)
    assert (tally.values, tally.nan, tally.infinite, tally.outside) == (6, 1, 1, 2)
    assert tally.first == (7, 0)
    assert (tally.low, tally.high) == (-1.0, 0.0)


def test_flow_counts_pixels_not_components() -> None:
    """A pixel is NaN or infinite if either component is."""
    flow = np.zeros((2, 3, 2), dtype=np.float32)
    flow[0, 1, 0], flow[1, 2] = np.nan, np.inf
    tally = tally_flow("path/flow/10hz", 2, flow)
    assert (tally.values, tally.nan, tally.infinite, tally.first) == (6, 1, 1, (2, 5))
    assert tally.filled == ((2, pytest.approx(5 / 6)),)


@pytest.mark.parametrize("length_px", [1e12, -1e30])
@pytest.mark.parametrize("rate", ["10hz", "25hz", "50hz"])
def test_a_displacement_that_no_surface_has(path: Path, rate: str, length_px: float) -> None:
    """One component of one pixel is enough; it is located."""
    alter(path, f"path/flow/{rate}", (0, 4, 5, 1), length_px)
    result = run_check(path, "integrity.finite")
    assert rules(result) == ["outside_range"]
    where = result.findings[0].where
    assert (where.stream, where.frame, where.pixel) == (f"flow/{rate}", 0, (5, 4))
    assert f"{abs(length_px):.3g} px" in result.findings[0].message
    assert diagnoses_of(path, "integrity")[0].cause == "invalid_encoding"


def test_what_comes_to_lie_beside_the_camera_may_be_displaced_far(path: Path) -> None:
    """A millimetre before the plane of the camera, a point one metre off is displaced by a thousand focal lengths."""
    alter(path, "path/flow/10hz", (0, 26), 31_000.0)
    assert run_check(path, "integrity.finite").outcome == "passed"


def test_long_displacements_are_as_rare_as_the_bound_says() -> None:
    """Grounds seen from random flights, which pass few edges: a hundredth of what the bound allows is displaced far."""
    random, intervals, height, width = np.random.default_rng(7), 4000, 27, 36
    focal_px, far_px = width / (2 * np.tan(np.pi / 6)), 1e5
    columns, rows = np.meshgrid(np.arange(width) - 17.5, np.arange(height) - 13.0)
    rays = np.stack([columns / focal_px, rows / focal_px, np.ones_like(rows)])
    longer = 0
    for _ in range(intervals):
        up = random.normal(size=3) * (0.3, 1.0, 0.3)
        facing = np.tensordot(up, rays, 1)
        depth_m = random.uniform(1.0, 3.0) * np.linalg.norm(up) / np.where(facing > 0, facing, np.nan)
        depth_m = np.where(depth_m < 30.0, depth_m, np.nan)
        later = depth_m * rays - np.array([0.0, 0.0, random.uniform(0.0, 4.0)])[:, None, None]
        in_front = later[2] > 0
        flow_px = focal_px * later[:2][:, in_front] / later[2][in_front] - np.stack([columns, rows])[:, in_front]
        longer += int(np.count_nonzero(np.abs(flow_px).max(axis=0) > far_px))
    allowed = FALSE_ALARMS * longest_displacement_px(intervals, height, width) / far_px
    assert allowed / 1000 < longer < allowed


@given(st.lists(st.lists(st.sampled_from([0.0, 1.0, np.nan, np.inf]), min_size=3, max_size=3), min_size=2, max_size=20),
       st.data())  # fmt: skip
def test_tallies_add(samples: list[list[float]], data: st.DataObject) -> None:
    """The tally of two pieces is the sum of their tallies, wherever the cut is."""
    cut = data.draw(st.integers(1, len(samples) - 1))
    array = np.array(samples)
    pieces = [tally_samples("k", 0, array[:cut]), tally_samples("k", cut, array[cut:])]
    assert add_up(pieces) == (tally_samples("k", 0, array),)


@pytest.mark.parametrize(
    ("shares", "empty"),
    [
        ([1, 0, 1], [1]),
        ([1, 0, 0, 1], [1, 2]),
        ([0, 1, 1], [0]),
        ([1, 1, 0], [2]),
        ([0, 0, 0], []),
        ([0], []),
        ([], []),
        ([1, 0, 0.2], []),
        ([0.2, 0, 1], []),
        ([1, 0, 1, 0, 1], [1, 3]),
    ],
    ids=str,
)
def test_empty_images(shares: list[float], empty: list[int]) -> None:
    """Empty images count where both neighbours of the run are mostly valid; nothing bounds a stream that is all NaN."""
    assert empty_between_full(list(enumerate(shares))) == empty


def test_rows_that_were_not_seen_bound_nothing() -> None:
    """Between sampled windows the neighbours are unknown, and an empty image proves nothing."""
    assert empty_between_full([(3, 1.0), (4, 0.0), (20, 0.0), (21, 1.0)]) == []


def test_values_that_a_type_cannot_hold_are_those_of_the_type(path: Path) -> None:
    """Depth in 8 bits holds what is left of millimetres: neither a code nor another unit."""
    with h5py.File(path, "r+") as file:
        depth_mm, attributes = file[DEPTH][...], dict(file[DEPTH].attrs)
        del file[DEPTH]
        file[DEPTH] = np.nan_to_num(depth_mm).astype(np.int64).astype(np.uint8)
        file[DEPTH].attrs.update(attributes)
    checks = ("integrity.layout", "integrity.finite")
    record = check_file(path, CheckOptions(select=checks, evidence=None)).record
    assert {result.check for result in record.results if result.outcome == "failed"} == set(checks)
    assert [(d.cause, d.stream) for d in record.diagnoses] == [("wrong_dtype", "depth")]

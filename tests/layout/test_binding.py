"""Stored values become canonical ones without losing anything."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.binding import (
    FARTHEST_TIMESTAMP_NS,
    INVALID_POLARITY,
    INVALID_TIMESTAMP_NS,
    Binding,
    canonical_rows,
    instant_ns,
    raw_rows,
    timestamps_ns,
)

EPOCH_US = 1_753_000_000_000_000


def timestamps_binding(ns_per_unit: int = 1000, offset_ns: int = 0) -> Binding:
    return Binding("path/imu/ts", "ts", 0, (0,), np.dtype(np.int64), ns_per_unit=ns_per_unit, offset_ns=offset_ns)


def bind(dataset: h5py.Dataset, key: str, **how: Any) -> Binding:
    return Binding(key, dataset.name, len(dataset), dataset.shape, dataset.dtype, **how)


@pytest.fixture
def file() -> Any:
    with h5py.File("test.h5", "w", driver="core", backing_store=False) as opened:
        yield opened


@given(
    origin_us=st.integers(-(2**62), 2**62),
    elapsed_us=st.lists(st.integers(-(10**14), 10**14), min_size=1, max_size=20),
)
def test_whole_microseconds_are_exact_at_any_origin(origin_us: int, elapsed_us: list[int]) -> None:
    """Stamps anywhere in int64 come out as the exact number of nanoseconds from the origin."""
    timestamps = np.array([origin_us + elapsed for elapsed in elapsed_us], dtype=np.int64)
    expected = [elapsed * 1000 for elapsed in elapsed_us]
    assert timestamps_ns(timestamps, timestamps_binding(), origin_us * 1000).tolist() == expected


@given(
    timestamps=st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=20),
    origin_ns=st.integers(-(2**75), 2**75),
    unit=st.sampled_from([1, 1000, 10**6, 10**9]),
)
@example(timestamps=[-(2**63)], origin_ns=-(2**63) * 1000 - 2001, unit=1000)  # three units outside of int64
def test_timestamps_never_wrap(timestamps: list[int], origin_ns: int, unit: int) -> None:
    """Whatever the stamps and the origin, an instant is exact or saturates on its own side; differences fit int64."""
    times = timestamps_ns(np.array(timestamps, dtype=np.int64), timestamps_binding(unit), origin_ns).tolist()
    for timestamp, time in zip(timestamps, times, strict=True):
        exact = timestamp * unit - origin_ns
        if abs(exact) < FARTHEST_TIMESTAMP_NS - 2 * unit:
            assert time == exact
        else:
            assert time * exact >= 0
    assert max(times) - min(times) < 2**63


def test_timestamps_beyond_int64_saturate() -> None:
    """Unsigned 64-bit stamps do not become negative."""
    times = timestamps_ns(np.array([5, 2**64 - 1], dtype=np.uint64), timestamps_binding(), 0)
    assert timestamps_ns(np.array([5, 2**32 - 1], dtype=np.uint32), timestamps_binding(), 0)[1] == (2**32 - 1) * 1000
    assert times[0] == 5000
    assert times[1] >= FARTHEST_TIMESTAMP_NS - 1000


def test_fractional_microseconds_survive() -> None:
    """Float64 microseconds keep their quarter of a microsecond a century after 1970's start."""
    timestamps = EPOCH_US + np.array([0.0, 0.25, 1.5, 20_000.75])
    times = timestamps_ns(timestamps, timestamps_binding(), EPOCH_US * 1000)
    assert times.tolist() == [0, 250, 1500, 20_000_750]


def test_float_seconds_are_as_exact_as_they_are_stored() -> None:
    """Seconds since the epoch come out within half a step of their own float64 resolution (0.24 us)."""
    timestamps = np.array([1_500_000_000.0, 1_500_000_000.005, 1_500_000_001.0])
    exact = [round((Fraction(timestamp) - 1_500_000_000) * 10**9) for timestamp in timestamps]
    assert timestamps_ns(timestamps, timestamps_binding(10**9), 1_500_000_000 * 10**9).tolist() == exact


def test_nan_and_infinite_timestamps_are_placed_at_the_ends() -> None:
    """NaN becomes the sentinel, infinity saturates, and no warning is raised."""
    times = timestamps_ns(np.array([np.nan, np.inf, -np.inf, 1.0]), timestamps_binding(), 0)
    assert times.tolist() == [INVALID_TIMESTAMP_NS, FARTHEST_TIMESTAMP_NS, -FARTHEST_TIMESTAMP_NS, 1000]


def test_offset_is_added() -> None:
    """A dialect's offset moves every stamp, and the file's clock with it."""
    binding = timestamps_binding(offset_ns=7_000)
    assert timestamps_ns(np.array([3]), binding, 0).tolist() == [10_000]
    assert instant_ns(np.int64(3), binding) == 10_000


@given(st.floats(allow_nan=False, allow_infinity=False, width=64), st.sampled_from([1, 1000, 10**9]))
def test_instant_is_the_exact_timestamp(timestamp: float, unit: int) -> None:
    """One stamp becomes nanoseconds in exact arithmetic, rounded once."""
    assert instant_ns(timestamp, timestamps_binding(unit)) == round(Fraction(timestamp) * unit)


def test_instant_of_no_number_is_none() -> None:
    """NaN and infinity are no instants."""
    assert instant_ns(float("nan"), timestamps_binding()) is None
    assert instant_ns(float("inf"), timestamps_binding()) is None


def test_instant_of_values_is_refused() -> None:
    """A dataset without a unit of time has no instants."""
    with pytest.raises(ValueError, match="no unit of time"):
        instant_ns(1, Binding("path/depth", "d", 0, (0,), np.dtype(np.float32)))


@pytest.mark.parametrize(
    ("code", "stored", "canonical"),
    [
        ("01", [0, 1, 2], [0, 1, INVALID_POLARITY]),
        ("inverted", [0, 1, 2], [1, 0, INVALID_POLARITY]),
        ("plus_minus", [-1, 1, 0], [0, 1, INVALID_POLARITY]),
    ],
)
def test_polarity_codes(file: h5py.File, code: Any, stored: list[int], canonical: list[int]) -> None:
    """Each code becomes 1 brighter, 0 darker; what a code does not know stays visible."""
    dataset = file.create_dataset("p", data=np.array(stored, dtype=np.int8))
    rows = canonical_rows(file, bind(dataset, "path/events/p", polarity=code), 0, 3, 0)
    assert rows.dtype == np.uint8
    assert rows.tolist() == canonical


def test_false_and_true_are_polarities(file: h5py.File) -> None:
    """HDF5's enumeration of booleans reads as 0 and 1."""
    dataset = file.create_dataset("p", data=np.array([True, False]))
    assert canonical_rows(file, bind(dataset, "path/events/p"), 0, 2, 0).tolist() == [1, 0]


def test_columns_out_of_range_are_not_wrapped(file: h5py.File) -> None:
    """A column of -1 or 70000 stays what it is, in a wider type."""
    dataset = file.create_dataset("x", data=np.array([-1, 3, 70_000], dtype=np.int32))
    assert canonical_rows(file, bind(dataset, "path/events/x"), 0, 3, 0).tolist() == [-1, 3, 70_000]


def test_columns_in_range_become_canonical(file: h5py.File) -> None:
    """Whole numbers in another type, floats too, become uint16 where all of them fit."""
    dataset = file.create_dataset("x", data=np.array([0.0, 639.0]))
    rows = canonical_rows(file, bind(dataset, "path/events/x"), 0, 2, 0)
    assert rows.dtype == np.uint16
    assert rows.tolist() == [0, 639]


def test_columns_that_are_no_number_stay_visible(file: h5py.File) -> None:
    """NaN and infinity become columns that no sensor has."""
    dataset = file.create_dataset("x", data=np.array([np.nan, np.inf, 4.0]))
    rows = canonical_rows(file, bind(dataset, "path/events/x"), 0, 3, 0)
    assert rows[0] == -1
    assert rows[1] > 2**40
    assert rows[2] == 4


def test_values_are_scaled(file: h5py.File) -> None:
    """Metres become millimetres, NaN stays NaN."""
    dataset = file.create_dataset("d", data=np.array([[[1.5, np.nan]]], dtype=np.float32))
    rows = canonical_rows(file, bind(dataset, "path/depth", scale=1000.0), 0, 1, 0)
    np.testing.assert_array_equal(rows, np.array([[[1500.0, np.nan]]], dtype=np.float32))
    assert rows.dtype == np.float32


def test_columns_are_selected_and_reordered(file: h5py.File) -> None:
    """One column of events, quaternions w first, and a grey image as three channels."""
    events = file.create_dataset("e", data=np.arange(8).reshape(2, 4))
    assert canonical_rows(file, bind(events, "path/events/y", columns=(1,)), 0, 2, 0).tolist() == [1, 5]
    wxyz = file.create_dataset("q", data=np.array([[1.0, 0.1, 0.2, 0.3]]))
    xyzw = canonical_rows(file, bind(wxyz, "path/pose/orientation", columns=(1, 2, 3, 0)), 0, 1, 0)
    assert xyzw.tolist() == [[0.1, 0.2, 0.3, 1.0]]
    grey = file.create_dataset("g", data=np.array([[[7, 9]]], dtype=np.uint8))
    rgb = canonical_rows(file, bind(grey, "path/rgb", columns=(0, 0, 0)), 0, 1, 0)
    assert rgb.tolist() == [[[[7, 7, 7], [9, 9, 9]]]]
    of_channels = file.create_dataset("c", data=np.array([[[[1, 2, 3, 4], [5, 6, 7, 8]]]], dtype=np.uint16))
    depth = canonical_rows(file, bind(of_channels, "path/depth", columns=(3,)), 0, 1, 0)
    assert depth.tolist() == [[[4.0, 8.0]]]


def test_images_with_nothing_to_convert_come_as_they_are(file: h5py.File) -> None:
    """Several rows of chunks of one row each, in the stored type."""
    stored = np.arange(60, dtype=np.float32).reshape(5, 3, 4)
    dataset = file.create_dataset("d", data=stored, chunks=(1, 3, 4), compression="gzip")
    binding = bind(dataset, "path/depth")
    assert binding.is_image_as_it_is
    rows = canonical_rows(file, binding, 1, 3, 0)
    np.testing.assert_array_equal(rows, stored[1:3])
    assert rows.dtype == np.float32


@pytest.mark.parametrize(
    ("stored", "how", "value"),
    [
        (np.ones((2, 3, 4), np.float32), {"scale": 1000.0}, 1000.0),
        (np.ones((2, 3, 4), ">f4"), {}, 1.0),
        (np.ones((2, 3, 4), np.float64), {}, 1.0),
        (np.ones((2, 3, 4), np.uint16), {}, 1.0),
        (np.ones((2, 3, 4, 1), np.float32), {"columns": (0,)}, 1.0),
    ],
    ids=["scaled", "big-endian", "float64", "integers", "columns"],
)
def test_images_with_something_to_convert_are_converted(
    file: h5py.File, stored: Any, how: dict[str, Any], value: float
) -> None:
    """What a dialect stores otherwise comes in the canonical type, unit and axes."""
    binding = bind(file.create_dataset("d", data=stored), "path/depth", **how)
    assert not binding.is_image_as_it_is
    rows = canonical_rows(file, binding, 0, 2, 0)
    np.testing.assert_array_equal(rows, np.full(rows.shape, value))
    assert rows.dtype == np.float32


def test_rows_are_half_open(file: h5py.File) -> None:
    """Rows start to stop, stop not included, in stored units."""
    dataset = file.create_dataset("t", data=np.arange(10))
    assert raw_rows(file, bind(dataset, "path/events/t", ns_per_unit=1000), 2, 4).tolist() == [2, 3]


def test_damaged_bytes_are_named(tmp_path: Path) -> None:
    """A chunk with a wrong checksum raises, with the key and the rows that were asked for."""
    path = tmp_path / "damaged.h5"
    with h5py.File(path, "w") as written:
        dataset = written.create_dataset("t", data=np.arange(64), chunks=(8,), fletcher32=True)
        place = dataset.id.get_chunk_info(3).byte_offset
    with path.open("r+b") as raw:
        raw.seek(place)
        raw.write(b"\xff\xff")
    with h5py.File(path) as damaged:
        binding = bind(damaged["t"], "path/events/t", ns_per_unit=1000)
        assert canonical_rows(damaged, binding, 0, 24, 0)[-1] == 23_000
        with pytest.raises(UnreadableRowsError) as raised:
            canonical_rows(damaged, binding, 20, 30, 0)
    assert (raised.value.key, raised.value.start, raised.value.stop) == ("path/events/t", 20, 30)

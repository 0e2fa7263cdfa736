"""Every fault of clocks, samples, events and index maps is of exactly the stated amount."""

import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_generator.faults import plant_fault
from tests.generator.fault_amounts.reading import events, true_maps
from tests.generator.tiny_sequence import (
    DURATION_US,
    HEIGHT,
    WIDTH,
)

# Clocks


@pytest.mark.parametrize(("magnitude", "unit", "late_us"), [(2, None, 2_000), (-0.5, "ms", -500), (3, "us", 3)])
def test_time_offset(plant: Any, magnitude: float, unit: str | None, late_us: int) -> None:
    """All stamps are late by the offset in its unit, and the maps are made anew unless they are to be stale."""
    faulty = plant("time_offset", "events", magnitude, unit)
    before, after = faulty.pair("path/events/t")
    np.testing.assert_array_equal(after - before, late_us)
    assert true_maps(faulty.path)
    before, after = plant("time_offset", "events", magnitude, unit, consistent_maps=False).pair("metadata/rgb_to_event")
    np.testing.assert_array_equal(before, after)


def test_time_offset_within_an_interval(plant: Any) -> None:
    """Confined to [0.1, 0.3) s only those samples are late."""
    before, after = plant("time_offset", "imu", 2, start_s=0.1, stop_s=0.3).pair("path/imu/ts")
    np.testing.assert_array_equal(after - before, np.where((before >= 100_000) & (before < 300_000), 2_000, 0))


def test_clock_rate(plant: Any) -> None:
    """A clock fast by 1000 ppm is late by a thousandth of the time since the stream's first stamp."""
    before, after = plant("clock_rate", "flow/10hz", 1_000).pair("path/flow/10hz_ts")
    np.testing.assert_array_equal(after - before, np.rint((before - before[0, 0]) * 1e-3))


def test_quantised_time_has_no_offset(plant: Any) -> None:
    """Stamps become multiples of 1 ms, each the nearest: the mean shift is that of rounding, not of truncation."""
    before, after = plant("quantised_time", "events", 1).pair("path/events/t")
    assert np.all(after % 1_000 == 0)
    assert np.abs(after - before).max() == 500
    assert abs((after - before).mean()) < 5 * 1_000 / np.sqrt(12 * len(before))


@pytest.mark.parametrize(("factor", "expected"), [(None, 1_000), (1e-3, 1e-3), (1e-6, 1e-6)])
def test_time_unit(plant: Any, factor: float | None, expected: float) -> None:
    """Stamps are multiplied by the factor, nanoseconds unless told, and rounded."""
    before, after = plant("time_unit", "pose", factor).pair("path/pose/ts")
    np.testing.assert_array_equal(after, np.rint(before * expected))
    assert after.dtype == np.int64


def test_time_jitter(plant: Any, clean: Path) -> None:
    """Each event keeps its pixel and polarity; times scatter by the spread, in order, within those of the stream."""
    rows, faulty = events(clean), plant("time_jitter", "events", 3, "ms")
    after = events(faulty.path)
    assert np.all(np.diff(after[:, 2]) >= 0)
    assert rows[0, 2] <= after[0, 2]
    assert after[-1, 2] <= rows[-1, 2]
    # Pixels and polarities are the same ones, in another order.
    columns = [0, 1, 3]
    np.testing.assert_array_equal(
        np.unique(rows[:, columns], axis=0, return_counts=True)[1],
        np.unique(after[:, columns], axis=0, return_counts=True)[1],
    )
    assert true_maps(faulty.path)


def test_time_jitter_within_an_interval(plant: Any) -> None:
    """Events before and after it keep their times and rows."""
    before, after = plant("time_jitter", "events", 3, start_s=0.1, stop_s=0.3).pair("path/events/t")
    outside = (before < 100_000) | (before >= 300_000)
    np.testing.assert_array_equal(before[outside], after[outside])
    assert not np.array_equal(before[~outside], after[~outside])


# Samples


def test_dropped_packet_of_events(plant: Any, clean: Path) -> None:
    """Exactly the events of 20 ms are gone, from all four columns, and the maps know it."""
    rows, faulty = events(clean), plant("dropped_samples", "events", 20, start_s=0.2)
    first = rows[rows[:, 2] >= 200_000][0, 2]
    expected = rows[(rows[:, 2] < 200_000) | (rows[:, 2] >= first + 20_000)]
    np.testing.assert_array_equal(events(faulty.path), expected)
    assert true_maps(faulty.path)


def test_dropped_frames_take_their_map_with_them(plant: Any) -> None:
    """Three colour frames fewer, the rest as before, and a map of as many entries."""
    faulty = plant("dropped_samples", "rgb", 3)
    before, after = faulty.pair("path/rgb")
    before_us, after_us = faulty.pair("path/rgb_ts")
    kept = np.isin(before_us, after_us)
    assert (~kept).sum() == 3
    assert np.diff(np.flatnonzero(~kept)).tolist() == [1, 1]
    np.testing.assert_array_equal(before[kept], after)
    assert true_maps(faulty.path)


def test_duplicated_samples_stand_twice(plant: Any) -> None:
    """Each of four IMU samples is followed by itself; the order of time holds."""
    faulty = plant("duplicated_samples", "imu", 4, start_s=0.1)
    for key in ("path/imu/ts", "path/imu/angular_velocity", "path/imu/linear_acceleration"):
        before, after = faulty.pair(key)
        repeats = np.ones(len(before), int)
        repeats[100:104] = 2
        np.testing.assert_array_equal(after, np.repeat(before, repeats, axis=0))


def test_unsorted_reverses_the_stated_number(plant: Any) -> None:
    """Five neighbouring poses are reversed in every dataset."""
    faulty = plant("unsorted", "pose", 5, start_s=0.1)
    for key in ("path/pose/ts", "path/pose/position", "path/pose/orientation"):
        before, after = faulty.pair(key)
        expected = np.concatenate([before[:20], before[20:25][::-1], before[25:]])
        np.testing.assert_array_equal(after, expected)


def test_frozen_and_swapped_frames(plant: Any) -> None:
    """Three depth frames repeat the one before; colour frames 5 and 7 change places; stamps stay."""
    faulty = plant("frozen_frames", "depth", 3, start_s=0.1)
    before, after = faulty.pair("path/depth")
    before[5:8] = before[4]
    np.testing.assert_array_equal(before, after)
    faulty = plant("swapped_frames", "rgb", 2, start_s=0.1)
    before, after = faulty.pair("path/rgb")
    before[[5, 7]] = before[[7, 5]]
    np.testing.assert_array_equal(before, after)
    np.testing.assert_array_equal(*faulty.pair("path/rgb_ts"))


def test_nan_in_stream(plant: Any) -> None:
    """Two IMU samples are NaN in both sensors, the rest finite."""
    faulty = plant("nan_in_stream", "imu", 2, start_s=0.1)
    for key in ("path/imu/angular_velocity", "path/imu/linear_acceleration"):
        assert np.flatnonzero(np.isnan(faulty.pair(key)[1]).all(axis=1)).tolist() == [100, 101]
        assert np.isnan(faulty.pair(key)[1]).sum() == 6


# Events


def test_polarity_axes_and_mirror(plant: Any, clean: Path) -> None:
    """p becomes 1 - p; columns and rows change places; columns count from the right."""
    x, y, _, p = events(clean).T
    np.testing.assert_array_equal(events(plant("polarity_inverted", "events").path)[:, 3], 1 - p)
    np.testing.assert_array_equal(events(plant("axes_swapped", "events").path)[:, :2], np.stack([y, x], axis=-1))
    np.testing.assert_array_equal(events(plant("mirrored", "events").path)[:, 0], WIDTH - 1 - x)


@pytest.mark.parametrize("shift", [2, -3])
def test_events_shift_by_whole_pixels(plant: Any, clean: Path, shift: int) -> None:
    """Events move right by the shift; those that leave the sensor are lost."""
    faulty = plant("spatial_offset", "events", shift)
    rows = events(clean) + np.array([shift, 0, 0, 0])
    np.testing.assert_array_equal(events(faulty.path), rows[(rows[:, 0] >= 0) & (rows[:, 0] < WIDTH)])
    assert true_maps(faulty.path)


def test_events_shift_within_an_interval(plant: Any, clean: Path) -> None:
    """Confined to [0.2, 0.3) s only those events move or leave."""
    rows = events(clean)
    inside = (rows[:, 2] >= 200_000) & (rows[:, 2] < 300_000)
    rows[inside, 0] += 4
    faulty = plant("spatial_offset", "events", 4, start_s=0.2, stop_s=0.3)
    np.testing.assert_array_equal(events(faulty.path), rows[rows[:, 0] < WIDTH])


def test_dead_region_is_a_silent_square(plant: Any, clean: Path) -> None:
    """Of the nine pixels of a 3 px square every event is gone, of the others none."""
    faulty = plant("dead_region", "events", 3, seed=5)
    histograms = [
        np.histogram2d(*events(path)[:, :2].T, bins=(range(13), range(10)))[0] for path in (clean, faulty.path)
    ]
    columns, rows = np.nonzero(histograms[0] != histograms[1])
    assert np.all(histograms[1][columns, rows] == 0)
    assert (len(columns), np.ptp(columns), np.ptp(rows)) == (9, 2, 2)
    assert true_maps(faulty.path)


@pytest.mark.parametrize("seed", range(8))
def test_dead_region_lies_where_the_sensor_fires(plant: Any, clean: Path, tmp_path: Path, seed: int) -> None:
    """Where two pixels fire, at edges of the sensor, all events of one of them are lost, never none."""
    quiet = tmp_path / "quiet.h5"
    shutil.copy(clean, quiet)
    with h5py.File(quiet, "r+") as file:
        first = np.arange(len(file["path/events/x"])) % 2 == 0
        file["path/events/x"][...] = np.where(first, WIDTH - 1, 0)
        file["path/events/y"][...] = np.where(first, 2, HEIGHT - 1)
    plant_fault(quiet, tmp_path / "faulty.h5", "dead_region", "events", 3, seed=seed)
    left = events(tmp_path / "faulty.h5")
    assert len(np.unique(left[:, 0])) == 1
    assert len(left) in {np.count_nonzero(first), np.count_nonzero(~first)}


def test_hot_pixels_add_events_in_canonical_order(plant: Any, clean: Path) -> None:
    """Two pixels gain about 200 events a second each, no other changes, and (t, y, x, p) stays sorted."""
    faulty = plant("hot_pixels", "events", 2, seed=1)
    rows = events(faulty.path)
    assert np.array_equal(np.lexsort((rows[:, 3], rows[:, 0], rows[:, 1], rows[:, 2])), np.arange(len(rows)))
    gained = [np.bincount(r[:, 1] * WIDTH + r[:, 0], minlength=WIDTH * HEIGHT) for r in (events(clean), rows)]
    gain = gained[1] - gained[0]
    assert np.count_nonzero(gain) == 2
    assert np.all(np.abs(gain[gain > 0] - 200 * DURATION_US / 1e6) < 5 * np.sqrt(100))
    assert true_maps(faulty.path)


def test_misdeclared_sensor(plant: Any) -> None:
    """Declared thresholds are 20 percent too large, the model is the other one, noise rates are halved."""
    for name in ("threshold_on", "threshold_off"):
        before, after = plant("threshold_misdeclared", "events", 20).pair(f"metadata/events@{name}")
        assert after == pytest.approx(before * 1.2)
    assert plant("event_model_misdeclared", "events").pair("metadata/events@model")[1] == "linear"
    before, after = plant("noise_misdeclared", "events", -50).pair("metadata/events@shot_rate_hz")
    assert after == pytest.approx(before / 2)


# Index maps


def test_index_maps(plant: Any) -> None:
    """Off by -1 exactly; side right points behind the two events that share the second frame's stamp."""
    before, after = plant("index_off_by_one", "rgb_to_event", -1).pair("metadata/rgb_to_event")
    np.testing.assert_array_equal(after, before - 1)
    before, after = plant("index_side", "depth_to_event").pair("metadata/depth_to_event")
    assert after[1] - before[1] >= 2
    assert np.all(after >= before)

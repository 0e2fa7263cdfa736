"""Each planted fault alters the streams that it names, by the amount that it states, and nothing else."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.benchmarks.blind_spots import (
    ACCEL,
    DEPTH,
    EVENTS,
    FAULTS,
    FLOW,
    GYRO,
    MOVING,
    ORIENTATION,
    POSITION,
    RGB,
    Fault,
)
from tests.generator.tiny_sequence import write_tiny_sequence

BY_NAME = {fault.name: fault for fault in FAULTS}
Values = dict[str, NDArray[Any]]
Planted = Callable[[str, float], Values]
FLOW_PX = 3.0
"""Flow in columns over 20 ms where a test draws a ramp."""


@pytest.fixture
def clean(tmp_path: Path) -> Path:
    """A tiny file, with one block of pixels that move by themselves."""
    path = tmp_path / "clean.h5"
    write_tiny_sequence(path)
    with h5py.File(path, "r+") as file:
        for flow, moving in zip(FLOW, MOVING, strict=True):
            mask = np.zeros(file[flow].shape[:3], dtype=np.uint8)
            mask[:, 3:5, 3:5] = 1
            file[moving] = mask
            file[flow][...] = file[flow][:] + 2.0 * mask[..., None]
        file["metadata/flow"].attrs["model"] = "scene"
        file["metadata/events"].attrs["refractory_us"] = 100
    return path


@pytest.fixture
def planted(clean: Path) -> Planted:
    """Plant a fault by name and size, and return what the file then holds."""

    def plant(name: str, size: float) -> Values:
        with h5py.File(clean, "r+") as file:
            BY_NAME[name].plant(file, size)
        return contents(clean)

    return plant


def contents(path: Path) -> Values:
    """Values of all datasets, and attributes of all objects as text."""
    values: Values = {}

    def keep(name: str, node: h5py.Dataset | h5py.Group) -> None:
        values[f"{name} attributes"] = np.array(sorted(f"{key}={value}" for key, value in node.attrs.items()))
        if isinstance(node, h5py.Dataset):
            values[name] = node[:]

    with h5py.File(path) as file:
        file.visititems(keep)
    return values


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_alters_its_own_streams(fault: Fault, clean: Path, planted: Planted) -> None:
    """The largest size alters exactly the objects that are named."""
    before = contents(clean)
    after = planted(fault.name, min(fault.sizes[-1], 20.0) if fault.unit == "px" else fault.sizes[-1])
    altered = {
        key.removesuffix(" attributes")
        for key in before
        if key not in after or not np.array_equal(before[key], after[key], equal_nan=before[key].dtype.kind == "f")
    }
    assert after.keys() <= before.keys()
    assert altered == set(fault.changes)


@pytest.mark.parametrize(("name", "path"), [("gain of the gyro", GYRO), ("gain of the accelerometer", ACCEL)])
def test_gain_multiplies(name: str, path: str, clean: Path, planted: Planted) -> None:
    before = contents(clean)[path]
    np.testing.assert_allclose(planted(name, 5.0)[path], 1.05 * before, rtol=1e-12)


def test_saturation_clips(clean: Path, planted: Planted) -> None:
    before = contents(clean)[GYRO]
    after = planted("range of the gyro, of its largest value", 50.0)[GYRO]
    limit = 0.5 * np.abs(before).max()
    assert np.abs(after).max() == pytest.approx(limit)
    np.testing.assert_array_equal(after[np.abs(before) < limit], before[np.abs(before) < limit])


def test_smoothing_damps_a_sine_and_keeps_a_constant_speed(clean: Path, planted: Planted) -> None:
    """A Gaussian leaves exp(-(omega sigma)^2 / 2) of a sine."""
    with h5py.File(clean, "r+") as file:
        times_s = file["path/pose/ts"][:] / 1e6
        omega = 2 * np.pi * 10
        speeds = np.column_stack([2 * times_s, 3 * times_s, np.sin(omega * times_s)])
        file[POSITION][...] = speeds
    after = planted("smoothed poses (sigma)", 10.0)[POSITION]
    np.testing.assert_allclose(after[:, :2], speeds[:, :2], atol=1e-12)
    inner = slice(10, -10)
    np.testing.assert_allclose(after[inner, 2], np.exp(-((omega * 0.01) ** 2) / 2) * speeds[inner, 2], atol=2e-3)


@pytest.mark.parametrize(
    ("name", "size", "angle_deg", "poses"),
    [("heading modulo pi", 10, 180, 10), ("yaw that jumps, and stays so", 5, 5, 51)],
)
def test_headings_turn(name: str, size: float, angle_deg: float, poses: int, clean: Path, planted: Planted) -> None:
    """The turn is about the vertical of the world, of the stated angle, in the stated number of poses."""
    before = Rotation.from_quat(contents(clean)[ORIENTATION])
    turns = (Rotation.from_quat(planted(name, size)[ORIENTATION]) * before.inv()).as_rotvec(degrees=True)
    turned = np.abs(turns).max(axis=1) > 1e-6
    assert turned.sum() == poses
    np.testing.assert_allclose(np.abs(turns[turned]), np.tile([0, 0, angle_deg], (poses, 1)), atol=1e-5)


def test_noise_has_the_stated_size(clean: Path, planted: Planted) -> None:
    before = contents(clean)
    assert np.nanstd(planted("noise of flow", 0.5)[FLOW[-1]] - before[FLOW[-1]]) == pytest.approx(0.5, rel=0.05)
    assert np.nanstd(planted("noise of depth", 3.0)[DEPTH] / before[DEPTH]) == pytest.approx(0.03, rel=0.05)


def test_shot_noise_adds_events(clean: Path, planted: Planted) -> None:
    """12 x 9 pixels of half a second at 20 Hz are 1080 events, give or take four standard deviations."""
    before, after = contents(clean), planted("shot noise of events, a pixel", 20.0)
    assert len(after["path/events/t"]) - len(before["path/events/t"]) == pytest.approx(1080, abs=4 * np.sqrt(1080))
    assert_events_are_consistent(after)


def test_dead_pixels_are_silent(clean: Path, planted: Planted) -> None:
    """The stated number of pixels loses all events, the others none."""
    before, after = contents(clean), planted("dead pixels", 10.0)
    counts = [
        np.bincount(values["path/events/y"].astype(int) * 12 + values["path/events/x"], minlength=108)
        for values in (before, after)
    ]
    assert np.sum((counts[0] > 0) & (counts[1] == 0)) == 10
    assert set(np.unique(counts[1] / counts[0])) == {0.0, 1.0}
    assert_events_are_consistent(after)


def test_refractory_pixels_keep_a_distance(planted: Planted) -> None:
    after = planted("refractory time", 5.0)
    pixels = after["path/events/y"].astype(int) * 12 + after["path/events/x"]
    order = np.lexsort((after["path/events/t"], pixels))
    gaps_us = np.diff(after["path/events/t"][order])[np.diff(pixels[order]) == 0]
    assert 5_000 <= gaps_us.min() < 5_100
    assert_events_are_consistent(after)


def assert_events_are_consistent(values: Values) -> None:
    """Events are in order, and the index maps are theirs."""
    times_us = values["path/events/t"]
    assert np.all(np.diff(times_us) >= 0)
    assert {len(values[path]) for path in EVENTS} == {len(times_us)}
    for name in ("rgb", "depth"):
        expected = [int(np.sum(times_us < frame_us)) for frame_us in values[f"path/{name}_ts"]]
        np.testing.assert_array_equal(values[f"metadata/{name}_to_event"], expected)


def draw_ramp(path: Path) -> None:
    """Draw frames that brighten by 10 DN a column, under a flow of three columns to the right in 20 ms."""
    with h5py.File(path, "r+") as file:
        file[RGB][...] = np.broadcast_to(50 + 10 * np.arange(12)[:, None], file[RGB].shape).astype(np.uint8)
        file[FLOW[-1]][...] = np.broadcast_to([FLOW_PX, 0.0], file[FLOW[-1]].shape)


def test_rolling_shutter_shears(clean: Path, planted: Planted) -> None:
    """The last row is exposed 10 ms late, when the ramp has moved by 1.5 columns; the middle row is on time."""
    draw_ramp(clean)
    before, after = contents(clean)[RGB].astype(int), planted("rolling shutter (first to last row)", 20.0)[RGB]
    change = (after.astype(int) - before)[:, :, 4:8]
    np.testing.assert_allclose(change[:, [0, 4, 8]], [[[[15]], [[0]], [[-15]]]] * np.ones_like(change[:, :3]), atol=1)


def test_blur_is_a_box_along_the_flow(clean: Path, planted: Planted) -> None:
    """A ramp stays as it is; one bright column spreads over the three columns of 20 ms, and keeps its light."""
    draw_ramp(clean)
    before = contents(clean)[RGB]
    after = planted("motion blur (exposure)", 20.0)[RGB]
    np.testing.assert_allclose(after[:, :, 4:8], before[:, :, 4:8].astype(float), atol=1)
    with h5py.File(clean, "r+") as file:
        file[RGB][...] = 100 + 100 * (np.arange(12) == 6)[:, None].astype(np.uint8) * np.ones(3, np.uint8)
    profile = planted("motion blur (exposure)", 20.0)[RGB][0, 4, :, 0] - 100.0
    columns = np.arange(12)
    assert profile.sum() == pytest.approx(100, abs=6)
    spread = np.sum(profile * (columns - 6) ** 2) / profile.sum()
    assert np.sum(profile * columns) / profile.sum() == pytest.approx(6, abs=0.1)
    assert spread == pytest.approx(FLOW_PX**2 * np.mean((np.arange(5) - 2) ** 2) / 25, abs=0.25)


def test_lens_distortion_moves_pixels(clean: Path, planted: Planted) -> None:
    """What lies at p is shown at p (1 + k1 r^2); the ramp is read at the ideal place of each pixel."""
    draw_ramp(clean)
    k1 = -0.2
    after = planted("lens distortion of frames (k1)", k1)[RGB][0, 4, :, 0]
    ideal = np.linspace(-0.5, 0.5, 1001)
    shown = np.interp(np.arange(12), 5.5 + 10 * ideal * (1 + k1 * ideal**2), 5.5 + 10 * ideal)
    np.testing.assert_allclose(after[2:10], (50 + 10 * shown)[2:10], atol=1)


def test_static_flow_is_that_of_the_wall(tmp_path: Path, planted: Planted) -> None:
    """The wall of the tiny file stands still, so its flow before objects moved comes back, in closed form."""
    wall = tmp_path / "wall.h5"
    write_tiny_sequence(wall)
    after = planted("moving objects, static flow", 3.0)
    before = contents(wall)
    for path in FLOW:
        # The tiny file makes one depth a little larger in each frame, so that no two frames are the same.
        np.testing.assert_allclose(after[path][:, 1:], before[path][:, 1:], atol=1e-4)

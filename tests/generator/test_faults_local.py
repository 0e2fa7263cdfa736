"""Local faults: half of the time, a part of the image; what lies outside keeps its values, bit for bit."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_generator.commands import fault as fault_command
from fedora_generator.faults import FAULTS, FaultError, allows_interval, allows_region, plant_fault
from fedora_qa.layout.canonical import FLOW_STREAMS, TIMESTAMPS_OF, datasets_of
from tests.generator.tiny_sequence import HEIGHT, WIDTH, declare_noise, write_tiny_sequence

IN_TIME = [pair for pair in FAULTS if allows_interval(*pair)]
IN_SPACE = [pair for pair in FAULTS if allows_region(*pair)]
MAGNITUDES = {"quantised_time": 3.0, "interpolated_pose": 50.0}
PLACED_ANEW = {"dead_region", "hot_pixels"}
"""Faults that are drawn within the region, and so elsewhere than without one."""


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clean") / "clean.h5"
    write_tiny_sequence(path, origin_us=3_000_000)
    declare_noise(path)
    return path


@contextmanager
def planted(clean: Path, cause: str, stream: str, **more: Any) -> Iterator[Path]:
    with TemporaryDirectory() as folder:
        target = Path(folder) / "faulty.h5"
        plant_fault(clean, target, cause, stream, MAGNITUDES.get(cause, 2.0), seed=3, **more)
        yield target


def read(path: Path, key: str) -> NDArray[Any]:
    with h5py.File(path) as file:
        return np.asarray(file[key][...])


def parts(stream: str) -> tuple[str, ...]:
    return FLOW_STREAMS if stream == "flow" else (stream,)


def starts_us(path: Path, stream: str) -> NDArray[np.int64]:
    timestamps = read(path, TIMESTAMPS_OF[stream.removesuffix("_to_event")]) - 3_000_000
    return timestamps[:, 0] if timestamps.ndim == 2 else timestamps


def events(path: Path) -> NDArray[np.int64]:
    return np.stack([read(path, f"path/events/{name}").astype(np.int64) for name in "xytp"], axis=-1)


def in_region(rows: NDArray[np.int64], region: tuple[int, int, int, int]) -> NDArray[np.bool_]:
    left, top, right, bottom = region
    return (rows[:, 0] >= left) & (rows[:, 0] < right) & (rows[:, 1] >= top) & (rows[:, 1] < bottom)


regions = st.tuples(
    st.integers(0, WIDTH - 4), st.integers(0, HEIGHT - 4), st.integers(4, WIDTH), st.integers(4, HEIGHT)
).map(lambda r: (r[0], r[1], min(r[0] + r[2], WIDTH), min(r[1] + r[3], HEIGHT)))


@pytest.mark.parametrize(("cause", "stream"), IN_TIME, ids=lambda part: part)
@settings(max_examples=2, deadline=None)
@given(start_ms=st.integers(20, 40), stop_ms=st.integers(310, 480))
def test_nothing_changes_before_or_after(clean: Path, cause: str, stream: str, start_ms: int, stop_ms: int) -> None:
    """Rows stamped before the interval are as they were, and so are those after it, counted from the end."""
    start_s, stop_s = start_ms / 1e3, stop_ms / 1e3
    with planted(clean, cause, stream, start_s=start_s, stop_s=stop_s) as faulty:
        for part in parts(stream):
            first, last = np.searchsorted(starts_us(clean, part), np.rint([start_s * 1e6, stop_s * 1e6]))
            for spec in datasets_of(part):
                before, after = read(clean, spec.key), read(faulty, spec.key)
                np.testing.assert_array_equal(after[:first], before[:first])
                np.testing.assert_array_equal(after[len(after) - (len(before) - last) :], before[last:])


@pytest.mark.parametrize(("cause", "stream"), [pair for pair in IN_SPACE if pair[1] != "events"], ids=lambda part: part)
@settings(max_examples=2, deadline=None)
@given(region=regions)
def test_images_change_within_the_region_alone(
    clean: Path, cause: str, stream: str, region: tuple[int, int, int, int]
) -> None:
    """Inside, images are as the whole fault makes them; outside as they were; stamps stay."""
    left, top, right, bottom = region
    with planted(clean, cause, stream, region=region) as local, planted(clean, cause, stream) as whole:
        for spec in (spec for part in parts(stream) for spec in datasets_of(part)):
            expected = read(clean, spec.key)
            if not spec.is_timestamps:
                expected[:, top:bottom, left:right] = read(whole, spec.key)[:, top:bottom, left:right]
            np.testing.assert_array_equal(read(local, spec.key), expected)


@pytest.mark.parametrize("cause", [cause for cause, stream in IN_SPACE if stream == "events"])
@settings(max_examples=2, deadline=None)
@given(region=regions)
def test_events_change_within_the_region_alone(clean: Path, cause: str, region: tuple[int, int, int, int]) -> None:
    """Events outside are the clean ones in the same order, those inside the faulty ones, and time still ascends."""
    with planted(clean, cause, "events", region=region) as local:
        before, after = events(clean), events(local)
        np.testing.assert_array_equal(after[~in_region(after, region)], before[~in_region(before, region)])
        assert np.all(np.diff(after[:, 2]) >= 0)
        assert len(after) != len(before) or np.any(after != before)
        frames_us = read(clean, "path/rgb_ts")
        np.testing.assert_array_equal(read(local, "metadata/rgb_to_event"), np.searchsorted(after[:, 2], frames_us))
        if cause not in PLACED_ANEW:
            with planted(clean, cause, "events") as whole:
                faulty = events(whole)
            expected = faulty[in_region(faulty, region)]
            got = after[in_region(after, region)]
            np.testing.assert_array_equal(got[np.lexsort(got.T)], expected[np.lexsort(expected.T)])


def test_time_and_region_together(clean: Path) -> None:
    """A quarter of the image for a part of the time: both limits hold."""
    with planted(clean, "flow_sign", "flow/50hz", start_s=0.1, stop_s=0.2, region=(0, 0, 6, 4)) as faulty:
        before, after = read(clean, "path/flow/50hz"), read(faulty, "path/flow/50hz")
    before[5:10, :4, :6] *= -1
    np.testing.assert_array_equal(after, before)


@pytest.mark.parametrize(
    ("cause", "stream", "more", "message"),
    [
        ("time_offset", "rgb", {"region": (0, 0, 4, 4)}, "no region"),
        ("truncated", "imu", {"start_s": 0.2}, "no interval"),
        ("intrinsics_focal", "metadata", {"stop_s": 0.2}, "no interval"),
        ("gyro_bias", "imu", {"region": (0, 0, 4, 4)}, "no region"),
        ("mirrored", "rgb", {"region": (0, 0, WIDTH + 1, 4)}, "within the 12x9"),
        ("mirrored", "events", {"region": (5, 0, 5, 4)}, "within the 12x9"),
        ("frozen_frames", "depth", {"start_s": 0.1, "stop_s": 0.13}, "before 0.13 s"),
        ("dropped_samples", "events", {"start_s": 0.1, "stop_s": 0.101}, "before 0.101 s"),
        ("other_sequence", "pose", {}, "--donor"),
    ],
)
def test_what_cannot_be_confined_is_refused(
    clean: Path, tmp_path: Path, cause: str, stream: str, more: dict[str, Any], message: str
) -> None:
    """A region where there is none, one that leaves the image, or rows that outlast the interval: no file."""
    with pytest.raises(FaultError, match=message):
        plant_fault(clean, tmp_path / "faulty.h5", cause, stream, 3.0, **more)
    assert list(tmp_path.iterdir()) == []


def test_command_reads_a_region(clean: Path, tmp_path: Path) -> None:
    """``--region`` reaches the fault; one that is no rectangle is misuse."""
    target = tmp_path / "faulty.h5"
    command = [str(clean), "channel_order", "--stream", "rgb", "-o", str(target), "--region"]
    assert CliRunner().invoke(fault_command, [*command, "2,3,5"]).exit_code == 2
    assert CliRunner().invoke(fault_command, [*command, "2,3,5,7"]).exit_code == 0
    changed = np.any(read(clean, "path/rgb") != read(target, "path/rgb"), axis=(0, 3))
    assert np.flatnonzero(changed.any(axis=0)).tolist() == [2, 3, 4]
    assert np.flatnonzero(changed.any(axis=1)).tolist() == [3, 4, 5, 6]


def test_a_stream_of_another_sequence(clean: Path, tmp_path: Path) -> None:
    """The donor's events stand in the file with the donor's stamps, and the maps are made from them."""
    donor, target = tmp_path / "donor.h5", tmp_path / "faulty.h5"
    plant_fault(clean, donor, "truncated", "events", 30.0)
    plant_fault(clean, target, "other_sequence", "events", donor=donor)
    np.testing.assert_array_equal(events(target), events(donor))
    np.testing.assert_array_equal(read(target, "metadata/rgb_to_event"), read(donor, "metadata/rgb_to_event"))
    np.testing.assert_array_equal(read(target, "path/rgb"), read(clean, "path/rgb"))


def test_a_shift_by_parts_of_a_pixel_moves_a_ramp_by_as_much(tmp_path: Path) -> None:
    """On a ramp a shift by (right, down) subtracts its slopes times the vector; by whole pixels it copies values."""
    source, target = tmp_path / "ramp.h5", tmp_path / "shifted.h5"
    write_tiny_sequence(source)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    with h5py.File(source, "r+") as file:
        for stream in FLOW_STREAMS:
            if f"path/{stream}" in file:
                file[f"path/{stream}"][...] = (2.0 * columns + 3.0 * rows)[None, :, :, None]
    plant_fault(source, target, "spatial_offset", "flow", magnitude=0.5, direction_deg=30.0)
    with h5py.File(target) as file:
        shifted = file["path/flow/25hz"][0, 2:-2, 2:-2, 0]
    vector_px = 0.5 * np.cos(np.pi / 6), 0.5 * np.sin(np.pi / 6)
    expected = 2.0 * (columns - vector_px[0]) + 3.0 * (rows - vector_px[1])
    np.testing.assert_allclose(shifted, expected[2:-2, 2:-2], atol=1e-4)
    with pytest.raises(FaultError, match="only shifts of rgb and flow"):
        plant_fault(source, target, "spatial_offset", "depth", magnitude=1.0, direction_deg=30.0)

"""Rates of the streams: timestamps, refusals, and files at other rates than the usual ones."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.rates import RateOptions, intervals_us, rate_text, timestamps_us
from fedora_generator.scene import load_scene
from tests.support.sequences import small_scene

RATES_HZ = st.decimals("0.5", "2000", places=3).map(float)


@given(RATES_HZ, st.integers(1, 3_000_000))
def test_timestamps_are_whole_periods_rounded_down(rate_hz: float, duration_us: int) -> None:
    """Sample k lies at floor(k / R), in exact arithmetic, and the last that fits is written."""
    times_us = timestamps_us(duration_us, rate_hz)
    period_us = 10**6 / Fraction(str(rate_hz))
    assert len(times_us) == duration_us // period_us + 1
    rows = sorted({0, len(times_us) // 2, len(times_us) - 1})
    assert [int(times_us[k]) for k in rows] == [k * period_us.numerator // period_us.denominator for k in rows]
    assert 0 <= times_us[-1] <= duration_us


@given(RATES_HZ, st.integers(1, 12), st.integers(1, 3_000_000))
def test_flow_ends_on_frames(rate_hz: float, frames: int, duration_us: int) -> None:
    """Where depth can be divided by the rate of flow, every interval starts and ends on a frame, to the microsecond."""
    depth_us = timestamps_us(duration_us, float(Fraction(str(rate_hz)) * frames))
    assert np.isin(intervals_us(duration_us, rate_hz), depth_us).all()


def test_usual_rates_keep_the_digest() -> None:
    """A scene that states the usual rates is the scene that states none; another rate is another scene."""
    scene = load_scene("park-day")
    assert replace(scene, rates=RateOptions(flow_hz=(10.0, 25.0, 50.0))).digest == scene.digest
    assert replace(scene, rates=RateOptions(flow_hz=(10.0, 25.0))).digest != scene.digest


def test_rates_are_spelt_without_needless_zeros() -> None:
    """As the names of streams spell them."""
    assert [rate_text(rate_hz) for rate_hz in (10.0, 12.5, 29.97, 100.0, 0.125)] == [
        "10",
        "12.5",
        "29.97",
        "100",
        "0.125",
    ]


@pytest.fixture(scope="module")
def uneven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fifth of a second with colour, depth, flow, IMU and pose each at a rate of its own."""
    path = tmp_path_factory.mktemp("rates") / "uneven.h5"
    scene = small_scene("park-day", 90, 68)
    rates = RateOptions(frames_hz=40.0, depth_hz=60.0, flow_hz=(30.0, 7.5), pose_hz=125.0)
    scene = replace(scene, rates=rates, imu=replace(scene.imu, rate_hz=400.0))
    generate_sequence(scene, path, Request(duration_s=0.2, quality="draft"))
    return path


def test_each_stream_has_its_own_rate(uneven: Path) -> None:
    """Colour and depth lie on their own grids, and index maps on those of their frames."""
    with h5py.File(uneven) as file:
        np.testing.assert_array_equal(file["path/rgb_ts"], np.arange(9) * 25_000)
        np.testing.assert_array_equal(file["path/depth_ts"], np.arange(13) * 1_000_000 // 60)
        assert (file["path/rgb"].shape[0], file["path/depth"].shape[0]) == (9, 13)
        assert all(image.any() for image in file["path/rgb"])
        assert all(np.isfinite(image).any() for image in file["path/depth"])
        np.testing.assert_array_equal(np.diff(file["path/imu/ts"]), 2500)
        np.testing.assert_array_equal(np.diff(file["path/pose/ts"]), 8000)
        assert set(file["path/flow"]) == {"30hz", "30hz_ts", "7.5hz", "7.5hz_ts"}
        np.testing.assert_array_equal(file["path/flow/7.5hz_ts"], [[0, 133_333]])
        assert file["path/flow/30hz"].shape[0] == 6
        assert np.isin(file["path/flow/30hz_ts"], file["path/depth_ts"]).all()
        assert all(np.isfinite(field).any() for field in file["path/flow/30hz"])
        events_us = file["path/events/t"][:]
        for name in ("rgb", "depth"):
            expected = np.searchsorted(events_us, file[f"path/{name}_ts"][:], "left")
            np.testing.assert_array_equal(file[f"metadata/{name}_to_event"], expected)


def test_what_two_rates_share_is_equal(uneven: Path, tmp_path: Path) -> None:
    """Frames, and fields of the same interval, do not depend on what else is written."""
    path = tmp_path / "usual.h5"
    scene = replace(small_scene("park-day", 90, 68), rates=RateOptions(frames_hz=60.0, flow_hz=(30.0,)))
    generate_sequence(
        scene, path, Request(duration_s=0.2, quality="draft", streams=frozenset({"rgb", "depth", "flow"}))
    )
    with h5py.File(uneven) as file, h5py.File(path) as other:
        np.testing.assert_array_equal(file["path/depth"], other["path/depth"])
        np.testing.assert_array_equal(file["path/flow/30hz"], other["path/flow/30hz"])
        # Colour shares every second frame of 40 Hz with every third of 60 Hz.
        np.testing.assert_array_equal(file["path/rgb"][::2], other["path/rgb"][::3])

"""Jitter of the timestamps of a file in closed form: measured where it is, bounded where there is none."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fedora_qa.record.types import Result
from tests.checks.event_file import LINEAR_WORLD, SHARP_WORLD, SMOOTH_WORLD, EventFile, linear_file, log_file
from tests.estimators.event_world import MS
from tests.support.checked import run_check

CHECK = "event_response.jitter"


def scattered(file: EventFile, sigma_ms: float, tick_ns: int = 1000) -> EventFile:
    """The file with normal noise added to each timestamp, in ticks, and its events sorted again."""
    events = file.events
    noise_ns = sigma_ms * MS * np.random.default_rng(1).normal(size=len(events))
    times_ns = np.clip(events.times_ns + noise_ns, 0, events.times_ns.max())
    times_ns = -(-times_ns.astype(np.int64) // tick_ns) * tick_ns
    return file.altered(events=replace(events, times_ns=times_ns).keep(np.argsort(times_ns, kind="stable")))


def jitter_of(file: EventFile, path: Path) -> Result:
    return run_check(file.write(path), CHECK)


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(log_file, id="waves"),
        pytest.param(lambda: log_file(threshold=0.05), id="small thresholds"),
        pytest.param(lambda: log_file(SMOOTH_WORLD, 0.5), id="large thresholds"),
        pytest.param(lambda: log_file(SHARP_WORLD), id="sharp edges"),
        pytest.param(linear_file, id="linear"),
        pytest.param(lambda: linear_file(LINEAR_WORLD, 3.0), id="linear, fine steps"),
        pytest.param(
            lambda: scattered(log_file(), 0.0, 200_000).declaring(packet_interval_us=200), id="packets of 0.2 ms"
        ),
        pytest.param(lambda: scattered(log_file(), 0.0, 1 * MS), id="1 ms, not declared"),
    ],
)
def test_exact_times_have_no_jitter(make: Callable[[], EventFile], tmp_path: Path) -> None:
    """Not above the bound, and the measurement is of use."""
    result = jitter_of(make(), tmp_path / "clean.h5")
    (jitter,) = result.measurements
    assert result.outcome == "passed"
    assert not result.findings
    assert jitter.least_detectable is not None
    assert jitter.least_detectable < 2.0


@pytest.mark.parametrize(("sigma_ms", "tick_ns"), [(0.2, 1000), (0.4, 1000), (0.4, 200_000)])
def test_jitter_is_measured(sigma_ms: float, tick_ns: int, tmp_path: Path) -> None:
    """The check fails, with the spread to a quarter."""
    file = scattered(log_file(SMOOTH_WORLD, 0.5), sigma_ms, tick_ns)
    result = jitter_of(file.declaring(packet_interval_us=tick_ns // 1000 if tick_ns > 1000 else 0), tmp_path / "j.h5")
    (jitter,) = result.measurements
    assert result.outcome == "failed"
    assert [finding.code for finding in result.findings] == ["event_response.jitter.spread"]
    assert jitter.value == pytest.approx(sigma_ms, rel=0.25)


def test_jitter_above_the_intervals_is_a_lower_bound(tmp_path: Path) -> None:
    """Edges that pass faster than stamps scatter: the statement says so."""
    result = jitter_of(scattered(log_file(SMOOTH_WORLD, 0.1), 8.0), tmp_path / "gross.h5")
    assert result.outcome == "failed"
    assert "at least" in result.findings[0].message


def test_hot_pixels_and_noise_are_left_out(tmp_path: Path) -> None:
    """Declared hot pixels count for nothing; with a declared noise of 2 Hz nothing is stated."""
    events = log_file().events
    rng, count = np.random.default_rng(2), 4000
    times_ns = np.concatenate([events.times_ns, np.sort(rng.integers(1, 800 * MS, count) // 1000 * 1000)])
    order = np.argsort(times_ns, kind="stable")
    hot = replace(
        events,
        x=np.concatenate([events.x, np.full(count, 5, events.x.dtype)])[order],
        y=np.concatenate([events.y, np.full(count, 7, events.y.dtype)])[order],
        times_ns=times_ns[order],
        p=np.concatenate([events.p, rng.integers(0, 2, count).astype(events.p.dtype)])[order],
    )
    with_hot = log_file().altered(events=hot).declaring(hot_pixels=np.array([[5, 7]]), hot_pixel_rate_hz=5000.0)
    value, expected = (
        jitter_of(file, tmp_path / f"{number}.h5").measurements[0].value
        for number, file in enumerate((with_hot, log_file()))
    )
    assert value == pytest.approx(expected, abs=0.05)
    noisy = jitter_of(log_file().declaring(shot_rate_hz=2.0), tmp_path / "noisy.h5")
    assert (noisy.outcome, noisy.measurements) == ("not_observable", ())
    assert "noise events of 2 Hz" in noisy.reason


def test_edges_within_a_tick_are_not_observable(tmp_path: Path) -> None:
    """Walls of sharp contrast pass within a millisecond, the step of the stamps: their order within it is lost."""
    result = jitter_of(scattered(log_file(SHARP_WORLD), 0.0, 1 * MS), tmp_path / "ticks.h5")
    assert (result.outcome, result.measurements) == ("not_observable", ())
    assert "within few steps of the timestamps" in result.reason


def test_without_quadruples_nothing_is_stated(tmp_path: Path) -> None:
    """Thresholds that no edge passes four times."""
    result = jitter_of(log_file(threshold=0.5), tmp_path / "few.h5")
    assert result.outcome == "not_observable"
    assert "fewer than 50 pixels" in result.reason


def test_thresholds_and_sensor_must_be_declared(tmp_path: Path) -> None:
    assert jitter_of(log_file().declaring(threshold_on=0.0), tmp_path / "none.h5").outcome == "not_applicable"

"""Windows are a partition of the rows, whatever the clocks do."""

import math
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.engine.options import Effort
from fedora_qa.engine.plan import EFFORTS, WINDOW_NS, cut_windows, make_plan, sees_every_window, window_length_ns
from fedora_qa.sequence.scan import Scan, scan
from fedora_qa.sequence.sequence import open_sequence
from fedora_qa.sequence.window import Span


def cut(path: Path) -> tuple[Scan, tuple[Span, ...]]:
    with open_sequence(path) as sequence:
        scanned = scan(sequence, window_length_ns(sequence))
        return scanned, cut_windows(scanned)


BROKEN_TIMESTAMPS = {
    "all equal": lambda t: np.full_like(t, t[0]),
    "backwards": lambda t: t[::-1],
    "random": lambda t: np.random.default_rng(5).permutation(t),
    "one from the far future": lambda t: np.where(np.arange(len(t)) == 3, 2**62, t),
    "one from the far past": lambda t: np.where(np.arange(len(t)) == 3, -(2**62), t),
    "one that is the end of int64": lambda t: np.where(np.arange(len(t)) == 3, 2**63 - 1, t),
    "from the epoch on": lambda t: t + 1_726_000_000_000_000,
    "in nanoseconds": lambda t: t * 1000,
}


@pytest.mark.parametrize("timestamps", BROKEN_TIMESTAMPS)
@pytest.mark.parametrize("stream", ["imu/ts", "events/t", "rgb_ts"])
def test_broken_clocks_do_not_break_the_windows(stream: str, timestamps: str, park_day: Path, tmp_path: Path) -> None:
    """Every row is owned once, in order, and the number of windows stays in proportion to the stamps."""
    path = tmp_path / "broken.h5"
    shutil.copy(park_day, path)
    with h5py.File(path, "r+") as file:
        stored = file[f"path/{stream}"]
        stored[...] = BROKEN_TIMESTAMPS[timestamps](stored[...])
    scanned, spans = cut(path)
    assert len(spans) <= sum(runs.count for runs in scanned.runs.values())
    for name, runs in scanned.runs.items():
        owned = np.concatenate([np.arange(*span.owned[name]) for span in spans if name in span.owned])
        assert np.array_equal(owned, np.arange(runs.count))


def test_windows_of_a_clean_file_lie_on_the_grid(park_day: Path) -> None:
    """A second has five windows and the frame at its very end; each owns what its time says."""
    scanned, spans = cut(park_day)
    assert [span.start_ns for span in spans] == [number * WINDOW_NS for number in range(6)]
    times = scanned.facts.clocks["imu"].times_ns
    for span in spans:
        within = np.flatnonzero((times >= span.start_ns) & (times < span.stop_ns))
        assert span.owned["imu"] == (int(within[0]), int(within[-1]) + 1)


@pytest.mark.parametrize("effort", EFFORTS)
def test_small_frames_are_not_thinned_out(effort: Effort) -> None:
    """Dense checks look at two thousand places of a frame where full effort does, and no denser than it does."""
    most = EFFORTS["full"].sampling.tile_share
    for pixels in (120 * 90, 180 * 136, 640 * 480):
        share = make_plan(effort, 10, pixels=pixels).sampling.tile_share
        assert pixels * share**2 >= min(2000, pixels * most**2) * (1 - 1e-9)
        assert effort == "exhaustive" or share <= most
    assert make_plan(effort, 10).sampling == EFFORTS[effort].sampling


def test_large_frames_are_looked_at_in_as_many_places_as_smaller_ones() -> None:
    """From 220,000 pixels on the number of places stays; exhaustive looks everywhere."""
    shares = {pixels: make_plan("full", 10, pixels=pixels).sampling.tile_share for pixels in (220_000, 1440 * 1080)}
    assert shares[220_000] == EFFORTS["full"].sampling.tile_share
    places = [pixels * share for pixels, share in shares.items()]
    assert places == pytest.approx([55_000, 55_000])
    assert make_plan("exhaustive", 10, pixels=1440 * 1080).sampling.tile_share == 1.0
    assert make_plan("full", 10, pixels=540 * 405).sampling == EFFORTS["full"].sampling


@pytest.mark.parametrize("pixels", [120 * 90, 640 * 480, 720 * 540, 1440 * 1080, 4000 * 3000])
def test_no_effort_looks_denser_than_a_greater_one(pixels: int) -> None:
    shares = [make_plan(effort, 10, pixels=pixels).sampling.tile_share for effort in EFFORTS]
    assert shares == sorted(shares)


def test_single_samples_are_all_seen() -> None:
    """Checks of IMU and poses alone see every window; one that needs images, or nothing at all, those of the plan."""
    assert sees_every_window(("imu", "pose"))
    assert sees_every_window(("pose",))
    assert not sees_every_window(("depth", "pose"))
    assert not sees_every_window(())


@pytest.mark.parametrize("effort", EFFORTS)
@pytest.mark.parametrize("windows", [0, 1, 3, 10, 81, 1100])
@pytest.mark.parametrize("window_ns", [WINDOW_NS // 8, WINDOW_NS // 3, WINDOW_NS, 7 * WINDOW_NS])
def test_plans_are_ordered_and_within_the_file(effort: Effort, windows: int, window_ns: int) -> None:
    """Windows are chosen once each, in order, the first and the last among them; full efforts choose all."""
    plan = make_plan(effort, windows, window_ns)
    assert list(plan.chosen) == sorted(set(plan.chosen))
    assert set(plan.chosen) <= set(range(windows))
    if windows:
        assert {0, windows - 1} <= set(plan.chosen)
        assert len(plan.chosen) == min(windows, max(4, round(EFFORTS[effort].window_share * windows)))


@pytest.mark.parametrize("effort", ["quick", "standard"])
@pytest.mark.parametrize("windows", [60, 81, 400, 8960])
def test_short_windows_are_chosen_in_stretches_as_long_as_a_usual_window(effort: Effort, windows: int) -> None:
    """Of windows of 25 ms as many are chosen as of any; in stretches of 0.2 s at most, evenly spread, four at least."""
    chosen = np.array(make_plan(effort, windows, WINDOW_NS // 8).chosen)
    breaks = np.flatnonzero(np.diff(chosen) > 1)
    stretches = np.split(chosen, breaks + 1)
    assert max(len(stretch) for stretch in stretches) <= 8
    assert len(stretches) == max(4, math.ceil(len(chosen) / 8))
    assert np.ptp(np.diff(chosen)[breaks]) <= 1


@pytest.mark.parametrize("windows", [5, 37, 100])
def test_usual_windows_are_chosen_one_by_one(windows: int) -> None:
    """A window of 0.2 s has no neighbour in a sample of a tenth."""
    steps = np.diff(make_plan("quick", windows).chosen)
    assert np.ptp(steps) <= 1

"""What undoing a fault changes is kept for the reader of a report."""

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.engine.executors.executor import InProcess
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.files import check_files
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.tasks import check_file
from fedora_qa.engine.trials.evidence import _worst_by_size
from tests.engine.test_trials import negate_flow
from tests.support.identical import identical
from tests.support.planters import bias_gyro, delay_events

CHEAP = ("clocks", "metadata", "index_maps")
BEFORE, AFTER = "trials/D1/before", "trials/D1/after"


def faulty(clean: Path, target: Path, plant: Callable[[h5py.File], None]) -> Path:
    shutil.copyfile(clean, target)
    with h5py.File(target, "r+") as file:
        plant(file)
    return target


def run_of(path: Path, *checks: str) -> FileRun:
    """Trials may measure as many windows as the run itself, which cheap checks measure here."""
    return check_file(path, CheckOptions(select=(*checks, *CHEAP)))


def test_a_delay_shows_where_its_cost_is_least(park_day: Path, tmp_path: Path) -> None:
    """The deviation is least where the delay that was planted is undone; events move, the frame below them does not."""
    run = run_of(faulty(park_day, tmp_path / "late.h5", delay_events), "event_response.timing")
    (diagnosis,) = run.record.diagnoses
    sizes_ms, ratios = run.arrays["trials/D1/size"].T
    assert len(sizes_ms) == 5
    assert sizes_ms[np.argmin(ratios)] == pytest.approx(diagnosis.magnitude)
    assert abs(sizes_ms[np.argmin(ratios)] - 3.0) < 0.5
    assert ratios.min() < 1 < ratios[[0, -1]].min()
    (before, limit_before), (after, limit_after) = run.arrays["trials/D1/deviations/event_response.timing/time_offset"]
    assert abs(before) > limit_before
    assert abs(after) <= limit_after
    assert run.arrays[f"{BEFORE}/brighter"].shape == run.arrays[f"{AFTER}/brighter"].shape
    assert not np.array_equal(run.arrays[f"{BEFORE}/brighter"], run.arrays[f"{AFTER}/brighter"])
    np.testing.assert_array_equal(run.arrays[f"{BEFORE}/rgb"], run.arrays[f"{AFTER}/rgb"])
    # A part of the image, not averaged: 200 px of 270.
    left, _, right, _ = run.arrays["trials/D1/box"]
    assert right - left == pytest.approx(200 / 270)
    assert run.arrays[f"{BEFORE}/rgb"].shape[1] == 200
    assert run.arrays.keys() == run.record.evidence.keys()
    assert run.arrays["agreement/events/rgb"][1] == 1
    assert {tuple(run.arrays[name][1:]) for name in run.arrays if name.startswith("agreement/depth")} <= {(0,)}


def test_a_reversed_flow_shows_what_it_leaves(small_park_day: Path, tmp_path: Path) -> None:
    """Undone, the flow has the other sign, and frames that it carries differ less."""
    run = run_of(faulty(small_park_day, tmp_path / "reversed.h5", negate_flow), "flow_geometry.endpoint")
    np.testing.assert_array_equal(run.arrays[f"{AFTER}/flow_px"], -run.arrays[f"{BEFORE}/flow_px"])
    before, after = (np.nanmean(np.square(run.arrays[f"{when}/residual_dn"], dtype=float)) for when in (BEFORE, AFTER))
    assert after < before / 2
    # What has no size has no course, and what the pictures do not need is not kept.
    assert "trials/D1/size" not in run.arrays
    assert f"{AFTER}/depth_m" not in run.arrays


def test_a_bias_shows_the_imu_against_the_path(small_park_day: Path, tmp_path: Path) -> None:
    """The residuals of the samples as declared, before and after; no picture, as none changes."""
    run = run_of(faulty(small_park_day, tmp_path / "biased.h5", bias_gyro), "imu.rotation")
    (before_s, before), (after_s, after) = (run.arrays[f"{when}/imu.rotation/residual"].T for when in (BEFORE, AFTER))
    np.testing.assert_array_equal(before_s, after_s)
    # 0.037 rad/s over 5 ms between poses at 200 Hz are 0.19 mrad.
    assert np.median(before) == pytest.approx(0.187, rel=0.1)
    assert np.median(after) < np.median(before) / 10
    assert f"{BEFORE}/times_us" not in run.arrays


def test_evidence_is_the_same_however_work_is_dealt_out(small_park_day: Path, tmp_path: Path) -> None:
    """In one process and in two, to the last bit."""
    path = faulty(small_park_day, tmp_path / "late.h5", delay_events)
    options = CheckOptions(select=("event_response.timing", *CHEAP))
    ((_, alone),) = check_files([path], options, InProcess(), lambda tally: None)
    with ProcessExecutor(2) as executor:
        ((_, together),) = check_files([path], options, executor, lambda tally: None)
    assert "trials/D1/size" in alone.arrays
    assert identical(dict(alone.arrays), dict(together.arrays))


def test_a_course_compares_the_same_deviations_at_all_sizes() -> None:
    """Of three deviations one is told at a single size, and one size tells nothing."""
    ratios = np.array([[9.0, 4.0, np.nan], [1.0, 2.0, 50.0], [np.nan, np.nan, np.nan], [8.0, 5.0, np.nan]])
    course = _worst_by_size(np.arange(4.0), ratios)
    np.testing.assert_array_equal(course, [[0.0, 9.0], [1.0, 2.0], [3.0, 8.0]])
    assert _worst_by_size(np.arange(2.0), np.full((2, 1), np.nan)).shape == (0, 2)

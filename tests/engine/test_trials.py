"""Proposed faults are undone, and only what clears the findings is confirmed."""

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.protocol import Check, Statistic
from fedora_qa.diagnosis.candidates import CauseCandidate
from fedora_qa.diagnosis.clock_grids import ClockPlace, places_of_clocks
from fedora_qa.diagnosis.conclusion import UndoTrial
from fedora_qa.diagnosis.diagnose import rank_candidates
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.engine.executors.executor import InProcess
from fedora_qa.engine.files import check_files
from fedora_qa.engine.measure import conclude
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import Survey, opened, survey_of
from fedora_qa.engine.tasks import check_file, measure_open
from fedora_qa.engine.trials.altered import PlainRun
from fedora_qa.engine.trials.inquiry import run_trials
from fedora_qa.engine.trials.trial import TrialBench, place_ns
from fedora_qa.engine.trials.views import SequenceViews
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.faults.pixels import Mirroring
from fedora_qa.faults.units import LengthUnit
from fedora_qa.judgement.judge import Alarm, judge
from fedora_qa.record.types import Finding, Where
from fedora_qa.record.wording import status_sentence
from tests.support.all_checks import CHECKS
from tests.support.planters import TIMES, bias_gyro, delay_events, flip_polarity, planted

OPTIONS = CheckOptions(evidence=None, profile="release")


def negate_flow(file: h5py.File) -> None:
    for rate in ("10hz", "25hz", "50hz"):
        file[f"path/flow/{rate}"][...] *= -1


def reverse_quaternions(file: h5py.File) -> None:
    """Write w first."""
    file["path/pose/orientation"][...] = np.roll(file["path/pose/orientation"][()], 1, axis=1)


def lose_events(file: h5py.File) -> None:
    """Move the events of 30 ms to the microsecond after them: the time is silent."""
    t_us = file[TIMES][()]
    middle_us = int(t_us[0] + t_us[-1]) // 2
    file[TIMES][...] = np.where((t_us >= middle_us) & (t_us < middle_us + 30_000), middle_us + 30_000, t_us)


def checked(clean: Path, target: Path, plant: Callable[[h5py.File], None]) -> FileRun:
    return check_file(planted(clean, target, plant), OPTIONS)


@pytest.fixture(scope="module")
def checked_with(
    small_park_day: Path, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[Callable[[h5py.File], None]], FileRun]:
    """The check of the small park with a fault, once: several tests look at the same."""
    target = tmp_path_factory.mktemp("trials") / "faulty.h5"
    return cache(lambda plant: checked(small_park_day, target, plant))


@pytest.mark.parametrize(
    ("plant", "name"),
    [
        (delay_events, "events:time_offset"),
        (negate_flow, "flow:flow_sign"),
        (bias_gyro, "imu:gyro_bias"),
        (reverse_quaternions, "pose:quaternion_order"),
    ],
)
def test_undoing_confirms_a_cause(
    checked_with: Callable[[Callable[[h5py.File], None]], FileRun], plant: Callable[[h5py.File], None], name: str
) -> None:
    """One cause is named, and confirmed, all that it explains is cleared, and the fault goes with the run."""
    require_confirmed(checked_with(plant), name)


def test_undoing_confirms_an_inverted_polarity(park_day: Path, tmp_path: Path) -> None:
    """It has many rivals, for all of which a shorter file or smaller frames leave no work."""
    require_confirmed(checked(park_day, tmp_path / "faulty.h5", flip_polarity), "events:polarity_inverted")


def require_confirmed(run: FileRun, name: str) -> None:
    (first,) = run.record.diagnoses
    assert (f"{first.stream}:{first.cause}", first.status) == (name, "confirmed"), status_sentence(first)
    assert set(first.cleared) >= set(first.explains)
    assert first.windows > 0
    assert (run.faults[first.id].cause, run.faults[first.id].stream) == (first.cause, first.stream)


def test_sizes_are_those_that_were_planted(checked_with: Callable[[Callable[[h5py.File], None]], FileRun]) -> None:
    """A delay to its error; a bias as the length of its vector, with the sign of the largest component."""
    late = checked_with(delay_events).record.diagnoses[0]
    assert late.magnitude is not None
    assert late.standard_error is not None
    assert abs(late.magnitude - 3.0) < 4 * late.standard_error
    biased = checked_with(bias_gyro).record.diagnoses[0]
    assert biased.magnitude == pytest.approx(-np.linalg.norm([0.02, -0.03, 0.01]), abs=5e-4)


def test_a_clean_file_costs_no_trial(small_park_day: Path) -> None:
    """Nothing is undone where nothing is found."""
    run = check_file(small_park_day, OPTIONS)
    assert (run.record.verdict, run.record.diagnoses, dict(run.faults)) == ("clean", (), {})


def test_a_fault_that_cannot_be_undone_is_not_confirmed(small_park_day: Path, tmp_path: Path) -> None:
    """A silence of the events: no trial gives them back."""
    record = checked(small_park_day, tmp_path / "silent.h5", lose_events).record
    assert record.verdict == "findings"
    assert "confirmed" not in {diagnosis.status for diagnosis in record.diagnoses}


def test_a_budget_of_time_leaves_no_work_for_trials(small_park_day: Path, tmp_path: Path) -> None:
    """Within a budget a file is judged several times, and every second belongs to the windows."""
    target = tmp_path / "faulty.h5"
    shutil.copyfile(small_park_day, target)
    with h5py.File(target, "r+") as file:
        flip_polarity(file)
    options = replace(OPTIONS, select=("event_response.orientation",), budget_s=20.0)
    ((_, run),) = check_files([target], options, InProcess(), lambda tally: None)
    first = run.record.diagnoses[0]
    assert (first.cause, first.tried) == ("polarity_inverted", ())


class Notebook:
    """A bench that notes what it is asked to undo, and clears nothing."""

    def __init__(self) -> None:
        self.alarms: list[Any] = []
        self.run: Any = SimpleNamespace(strict={}, ready=SimpleNamespace(facts=None))
        self.undone: list[ReversibleFault] = []

    def undo(self, fault: ReversibleFault) -> None:
        self.undone.append(fault)


def test_every_cause_is_tried_before_a_second_mechanism_of_any() -> None:
    """Work that runs out leaves second mechanisms untried, not causes."""
    hypotheses = [Hypothesis("mirrored", "events", 0.9), Hypothesis("mirrored", "rgb", 0.6)]
    candidates = [CauseCandidate(h.cause, h.stream, {"F1": h}, {"F1": 1.0}) for h in hypotheses]
    bench: Any = Notebook()
    assert run_trials(bench, candidates, {}, quiet) == {}
    ways = [(stream, way) for way in ("horizontal", "vertical", "both") for stream in ("events", "rgb")]
    assert bench.undone == [Mirroring(stream, way) for stream, way in ways]


class HalfCleared(Notebook):
    """A bench whose every fault leaves a seventh of the deviation that gave its size."""

    def undo(self, fault: ReversibleFault) -> UndoTrial:  # type: ignore[override]
        self.undone.append(fault)
        return UndoTrial(fault, "it is undone", frozenset({"F2"}), {"F1": 1 / 7}, (), 4)


def test_a_second_fit_keeps_to_the_grid_of_clocks() -> None:
    """A delay of whole periods leaves depth on the grid of the others; one that a second fit finds does not."""
    late = Hypothesis("time_offset", "depth", 0.9, -80.0, "ms", 0.1)
    candidates = [CauseCandidate(late.cause, late.stream, {"F1": late}, {"F1": 1.0})]
    for places, sizes_ms in (({}, [-80.0, -80.0 / (1 - 1 / 7)]), ({"depth": ClockPlace("in", 20.0)}, [-80.0])):
        bench: Any = HalfCleared()
        bench.run.ready.facts = SimpleNamespace(clocks={}, flow_streams=())
        run_trials(bench, candidates, places, quiet)
        assert [fault.magnitude for fault in bench.undone] == pytest.approx(sizes_ms)


@contextmanager
def plain_run(path: Path) -> Iterator[tuple[PlainRun, list[Alarm], Sequence[Check[Any]]]]:
    """Yield the run of a file before any trial, its alarms, and the checks whose question can be asked of it."""
    survey = survey_of(path, CHECKS, OPTIONS, quiet)
    assert isinstance(survey, Survey)
    with opened(survey) as file:
        states = measure_open(survey, file, survey.windows, quiet)
        observations = conclude(file.asked, states, file.ready.facts)
        judged = judge(observations, file.asked, OPTIONS.false_alarm_rate)
        strict = {each.result.check: each.result for each in judged}
        views = SequenceViews.of(file.sequence, file.ready)
        ready = views.prepared(file.sequence, file.ready, frozenset())
        run = PlainRun(file.sequence, ready, observations, strict, OPTIONS.effort, OPTIONS.false_alarm_rate, views)
        yield run, [alarm for each in judged for alarm in each.alarms], file.asked


def test_poses_and_imu_contradict_a_fault_by_the_whole_file(small_park_day: Path, tmp_path: Path) -> None:
    """Flow and depth of one window agree with positions a thousandth as large, as the way then moves nothing."""

    def nearer(file: h5py.File) -> None:
        file["path/depth"][...] *= 0.01

    with plain_run(planted(small_park_day, tmp_path / "faulty.h5", nearer)) as (run, alarms, asked):
        bench = TrialBench.of(alarms, asked, run)
        before = bench.work.left
        trial = bench.undo(LengthUnit("pose", 1000.0))
        assert trial is not None
        assert any(code.startswith("imu.translation.") for code in trial.caused)
        assert not trial.succeeds
        assert bench.work.left < before


def test_work_is_bounded_by_the_run_or_a_short_one(small_park_day: Path, tmp_path: Path) -> None:
    """Windows times checks of all trials are at most those that the run measured, or those of 16 windows."""
    target = tmp_path / "faulty.h5"
    shutil.copyfile(small_park_day, target)
    with h5py.File(target, "r+") as file:
        delay_events(file)
    with plain_run(target) as (run, alarms, asked):
        bench, facts, strict = TrialBench.of(alarms, asked, run), run.ready.facts, run.strict
        hypotheses = {alarm.finding.id: hypotheses_of(alarm, facts) for alarm in alarms}
        places = places_of_clocks(facts)
        trials = run_trials(bench, rank_candidates(alarms, hypotheses, strict, places), places, quiet)
        assert trials["time_offset", "events"].succeeds
        most = max(len(run.planned(run.ready)), 16) * len(asked)
        assert 0 <= bench.work.left < most
        assert TrialBench.of(alarms, asked, run).work.left == most
        # The opposite of the fault clears nothing.
        worse = TrialBench.of(alarms, asked, run).undo(ClockShift("events", -3_000_000.0))
        assert worse is not None
        assert not worse.cleared
        assert min(worse.left.values()) > 1.5


def test_windows_lie_where_values_deviate() -> None:
    """Behind the end of a stream nothing is compared: no fault clears anything in windows there."""

    def alarm(code: str, start_us: float) -> Alarm:
        where = Where(stream="depth", start_us=start_us, stop_us=start_us + 2)
        return Alarm(Finding("F1", code, "error", "off", where), Statistic("toy", 1.0, "1", 0.0, "off", code, where))

    run: Any = SimpleNamespace(ready=SimpleNamespace(facts=SimpleNamespace(from_file_us=lambda us: int(1000 * us))))
    end, pair = alarm("clocks.span.ends_early", 900.0), alarm("depth.consistency.frame", 300.0)
    assert place_ns([end, pair], run) == 301_000
    assert place_ns([end], run) == 901_000

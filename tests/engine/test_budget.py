"""A budget of time: as many windows as fit, evenly spread, judged on time; and what is found is what they show."""

import json
from concurrent.futures import Future
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks.protocol import Observation
from fedora_qa.engine.budget import visiting_order
from fedora_qa.engine.executors.executor import FINISH_FILE, MEASURE_WINDOWS, TRAFFIC_OF, Executor, InProcess, Task
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.files import check_files
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.plan import FEWEST_WINDOWS
from fedora_qa.engine.progress import Progress, ProgressTally
from fedora_qa.errors import WorkerLostError
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from tests.support.fake_executors import Loses, Travels
from tests.support.handmade import write_handmade
from tests.support.identical import identical
from tests.support.killers import Counts
from tests.support.replaced_checks import replace_checks


@given(windows=st.integers(0, 400), together=st.integers(1, 12))
def test_every_window_is_visited_once(windows: int, together: int) -> None:
    """The order is one of all windows, from the first and the last on where there are several stretches."""
    order = visiting_order(windows, together)
    assert sorted(order) == list(range(windows))
    assert order[:1] == (0,)[:windows]
    assert windows <= together or order[1] == windows - 1


@given(windows=st.integers(2, 400), share=st.floats(0.01, 1))
def test_every_beginning_is_spread_evenly(windows: int, share: float) -> None:
    """However early it ends, no gap is longer than twice that of as many windows spread evenly, but for rounding."""
    visited = sorted(visiting_order(windows)[: max(2, int(share * windows))])
    longest = max(after - before for before, after in pairwise(visited))
    assert longest <= 2 * (windows - 1) / (len(visited) - 1) + 1


@given(stretches=st.integers(4, 60), together=st.integers(2, 12))
def test_short_windows_are_visited_in_stretches(stretches: int, together: int) -> None:
    """One window of each of four stretches comes first; then whole stretches, in the order of single windows."""
    order = visiting_order(stretches * together, together)
    spread = visiting_order(stretches)
    assert [window // together for window in order[:FEWEST_WINDOWS]] == list(spread[:FEWEST_WINDOWS])
    rest = [window // together for window in order[FEWEST_WINDOWS:]]
    assert list(dict.fromkeys(rest)) == list(spread)
    assert sum(before != after for before, after in pairwise(rest)) == stretches - 1


class Clock:
    """A clock that only moves when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        """Return the time."""
        return self.now


CLOCK = Clock()


class Slow(Counts):
    """How long does it take? A second a window, at the end two more and a tenth for each of them."""

    def update(self, state: list[int], window: Window) -> None:
        """Take a second."""
        CLOCK.now += 1.0
        super().update(state, window)

    def conclude(self, state: list[int], facts: Facts) -> object:  # type: ignore[override]  # as the base says
        """Take longer the more was seen."""
        CLOCK.now += 2.0 + 0.1 * len(state)
        return super().conclude(state, facts)


class Steady(Counts):
    """What does a check of single samples see?"""

    name = "test.steady"
    needs = ("imu",)

    def conclude(self, state: list[int], facts: Facts) -> Observation:
        """Say nothing of what the other check has seen."""
        return Observation(Coverage(len(state), len(state), "windows"))


@pytest.fixture
def many_windows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file of 51 windows of 2 ms."""
    for module in ("plan", "budget"):
        monkeypatch.setattr(f"fedora_qa.engine.{module}.WINDOW_NS", 2_000_000)
    return write_handmade(tmp_path / "seq.h5")


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """Run the slow check alone, by a clock that only it moves."""
    replace_checks(monkeypatch, Slow())
    monkeypatch.setattr("fedora_qa.engine.budget.time", CLOCK)
    CLOCK.now = 100.0
    return CLOCK


def run_of(
    path: Path, budget_s: float | None, executor: Executor | None = None, select: tuple[str, ...] = ()
) -> FileRun:
    options = CheckOptions(budget_s=budget_s, evidence=None, select=select)
    with executor or InProcess() as running:
        ((_, run),) = check_files([path], options, running, lambda tally: None)
    return run


def seen(run: FileRun) -> list[int]:
    found: list[int] = json.loads(str(run.record.inferred["seen"]))
    return found


@pytest.mark.parametrize("budget_s", [20.0, 30.0, 50.0])
def test_it_ends_on_time(budget_s: float, many_windows: Path, slow: Clock) -> None:
    """By the clock: never late, most of the time used, rehearsals and judgement in it; windows evenly spread."""
    run = run_of(many_windows, budget_s)
    spent_s = slow.now - 100.0
    assert budget_s - 5 <= spent_s <= budget_s
    windows = seen(run)
    assert sorted(windows) == windows
    assert windows == sorted(visiting_order(51)[: len(windows)])
    assert len(windows) >= 0.4 * budget_s
    assert f"{len(windows)} of 51 windows at the density of quick, with " in run.reached


def test_too_small_a_budget(many_windows: Path, slow: Clock) -> None:
    """The least number of windows is looked at all the same, nothing is rehearsed, and the run says how late it is."""
    run = run_of(many_windows, 1.0)
    assert seen(run) == sorted(visiting_order(51)[:FEWEST_WINDOWS])
    assert slow.now == 100.0 + 4 + 2.4
    assert run.reached == (
        "4 of 51 windows at the density of quick, the least that is always looked at, 5.4 s longer than there was"
    )


def test_ample_time_is_used_for_density(many_windows: Path, slow: Clock) -> None:
    """Where all windows fit, all are seen at the density of ``full``."""
    run = run_of(many_windows, 1000.0)
    assert seen(run) == list(range(51))
    assert run.reached.startswith("51 of 51 windows at the density of full, with ")


class Denser(Slow):
    """What if a denser look takes longer? A second at the density of quick, three at that of full."""

    def update(self, state: list[int], window: Window) -> None:
        """Take as long as the density asks for."""
        CLOCK.now += {0.05: 0.0, 0.1: 0.5, 0.25: 2.0}[window.sampling.tile_share]
        super().update(state, window)


@pytest.mark.parametrize(
    ("budget_s", "reached"), [(60.0, "quick"), (100.0, "quick"), (140.0, "standard"), (250.0, "full")]
)
def test_the_densest_with_which_all_windows_fit(
    budget_s: float, reached: str, many_windows: Path, slow: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Density is bought only where it costs no window; what it is tried with never makes the run late."""
    replace_checks(monkeypatch, Denser())
    # In frames as small as these all efforts look at as many places, unless their shares of the image count alone.
    monkeypatch.setattr("fedora_qa.engine.plan._FEWEST_PLACES", 0)
    run = run_of(many_windows, budget_s)
    assert f"at the density of {reached}, with " in run.reached
    assert slow.now - 100.0 <= budget_s
    assert seen(run) == list(range(51)) or budget_s == 60.0


def test_files_share_the_budget(many_windows: Path, slow: Clock, tmp_path: Path) -> None:
    """Three files of one length get a third each, and hand on what they leave."""
    paths = [many_windows, *(write_handmade(tmp_path / f"{name}.h5") for name in "ab")]
    options = CheckOptions(budget_s=90.0, evidence=None)
    runs = [run for _, run in check_files(paths, options, InProcess(), lambda tally: None)]
    counts = [len(seen(run)) for run in runs]
    assert 75 <= slow.now - 100.0 <= 90.0
    assert max(counts) - min(counts) <= 5


@pytest.mark.parametrize("executor", [InProcess(), Travels()], ids=["alone", "three"])
def test_with_time_for_all_it_is_a_full_check(
    executor: Executor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All checks on all windows, visited in whatever order by one or three: the record of ``full``, to the last bit."""
    monkeypatch.setattr("fedora_qa.engine.plan.WINDOW_NS", 20_000_000)
    path = write_handmade(tmp_path / "seq.h5")
    budgeted, full = run_of(path, 3600.0, executor), run_of(path, None)
    assert budgeted.reached.startswith("6 of 6 windows at the density of full")
    assert identical(budgeted.record, full.record)


@pytest.mark.parametrize(("times", "gone"), [(1, []), (2, []), (9, [0])])
def test_a_window_that_kills(times: int, gone: list[int], many_windows: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is looked at again, at each density; one that kills always is told, and the file is incomplete."""
    replace_checks(monkeypatch, Counts())
    executor = Loses("measure_windows seq.h5 [0]", times=times)
    run = run_of(many_windows, 3600.0, executor)
    assert (run.record.verdict == "incomplete") == bool(gone)
    assert [window for window in range(51) if window not in seen(run)] == gone


def test_with_real_processes(park_day: Path) -> None:
    """Two processes share the windows of a file: what sees every window, and what is looked at one by one."""
    select = ("clocks", "imu", "integrity")
    run = run_of(park_day, 600.0, ProcessExecutor(2), select=select)
    assert " windows at the density of full, with " in run.reached
    assert identical(run.record, run_of(park_day, None, select=select).record)


def test_progress_never_runs_backwards(many_windows: Path, slow: Clock, tmp_path: Path) -> None:
    """Over two files, with windows visited anew at another density: counts grow, and end with all that was done."""
    paths = [many_windows, write_handmade(tmp_path / "other.h5")]
    tallies: list[ProgressTally] = []
    options = CheckOptions(budget_s=1000.0, evidence=None)
    for _ in check_files(paths, options, InProcess(), tallies.append):
        pass
    for counts in ("files_done", "windows_done", "windows", "bytes_done"):
        values = [getattr(tally, counts) for tally in tallies]
        assert values == sorted(values)
    sizes = sum(path.stat().st_size for path in paths)
    assert (tallies[-1].files_done, tallies[-1].windows_done, tallies[-1].bytes_done) == (2, 102, sizes)


def test_a_judgement_that_is_lost_leaves_the_one_before(many_windows: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a later round kills whoever judges it, the run by fewer windows stands."""
    replace_checks(monkeypatch, Counts())

    class Forgets(Travels):
        judged = 0

        def submit(self, task: Task, progress: Progress) -> Future[Any]:
            if task.function == FINISH_FILE:
                self.judged += 1
                if self.judged > 1:
                    future: Future[Any] = Future()
                    future.set_exception(WorkerLostError("lost"))
                    return future
            return super().submit(task, progress)

    run = run_of(many_windows, 3600.0, Forgets())
    assert len(seen(run)) == FEWEST_WINDOWS
    assert run.reached.startswith("4 of 51 windows at the density of quick")


def test_all_windows_lost_is_no_crash_of_checks(many_windows: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Checks whose windows were all lost have seen none, beside checks that get every window."""
    replace_checks(monkeypatch, Counts(), Steady())

    class Kills(Travels):
        def submit(self, task: Task, progress: Progress) -> Future[Any]:
            if task.function == MEASURE_WINDOWS and task.arguments[2] == "sampled":
                future: Future[Any] = Future()
                future.set_exception(WorkerLostError("lost"))
                return future
            return super().submit(task, progress)

    run = run_of(many_windows, 3600.0, Kills())
    outcomes = {result.check: result.outcome for result in run.record.results}
    assert outcomes["windows"] == "crashed"
    assert outcomes["test.counts"] != "crashed"
    assert run.record.verdict == "incomplete"


def test_a_count_of_traffic_that_is_lost_leaves_the_record(many_windows: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where every process that counts requests to a server dies, the file is judged all the same."""
    replace_checks(monkeypatch, Counts())
    # Any path counts as one behind a URL.
    monkeypatch.setattr("fedora_qa.engine.budget.RemoteFile", Path)

    class Uncounted(Travels):
        def submit(self, task: Task, progress: Progress) -> Future[Any]:
            if task.function == TRAFFIC_OF:
                future: Future[Any] = Future()
                future.set_exception(WorkerLostError("lost"))
                return future
            return super().submit(task, progress)

    run = run_of(many_windows, 3600.0, Uncounted())
    assert seen(run) == list(range(51))
    assert run.record.verdict == "clean"

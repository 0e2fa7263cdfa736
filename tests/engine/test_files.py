"""Files are checked at once and in parts: what is found does not depend on it, and a death costs what it interrupts."""

import gc
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_generator.faults import plant_fault
from fedora_qa.engine.executors.executor import OPEN_AND_CLOSE, SURVEY_FILE, Executor, InProcess, Task, opening_test
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.file_work import WorkQueue
from fedora_qa.engine.files import check_files
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import Progress, ProgressTally
from fedora_qa.errors import EndlessError, MisuseError
from fedora_qa.storage.place import RemoteFile
from fedora_qa.storage.signature import OPENING_VARIABLE
from tests.support.fake_executors import Loses, Travels
from tests.support.handmade import write_handmade
from tests.support.identical import identical
from tests.support.killers import Counts, CrashesLate, Kills
from tests.support.replaced_checks import replace_checks

WINDOWS = 6
"""Of 20 ms, in the tenth of a second and its last frame that the handmade file holds."""


@pytest.fixture
def short_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut windows of 20 ms."""
    monkeypatch.setattr("fedora_qa.engine.plan.WINDOW_NS", 20_000_000)


@pytest.fixture
def handmade(tmp_path: Path, short_windows: None) -> Path:
    return write_handmade(tmp_path / "seq.h5")


@pytest.fixture
def counting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run checks that are quick in place of the real ones."""
    replace_checks(monkeypatch, Counts())


def all_runs(
    paths: Sequence[Path],
    executor: Executor,
    options: CheckOptions | None = None,
    checks: tuple[Counts, ...] | None = None,
) -> dict[Path, FileRun]:
    options = options or CheckOptions(evidence=None)
    with executor:
        return dict(check_files(paths, options, executor, lambda tally: None, checks=checks))


def only_run(path: Path, executor: Executor, options: CheckOptions | None = None) -> FileRun:
    return all_runs([path], executor, options)[path]


def same(one: FileRun, other: FileRun) -> bool:
    """Whether two runs found the same, to the last bit."""
    return identical(one.record, other.record) and identical(one.arrays, other.arrays)


def test_what_is_found_does_not_depend_on_the_workers(small_park_day: Path, tmp_path: Path) -> None:
    """Checks of a faulty file, their second look, and evidence: dealt out over three workers, the same bits."""
    options = CheckOptions(select=("clocks", "event_response", "depth"))
    late = tmp_path / "late.h5"
    plant_fault(small_park_day, late, "time_offset", "events", 3.0)
    alone, dealt = (only_run(late, executor, options) for executor in (InProcess(), Travels()))
    assert alone.record.verdict == "findings"
    assert alone.arrays
    assert same(alone, dealt)


def test_a_crash_in_a_worker_is_an_outcome(handmade: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A check that fails on a later window has the same crash and traceback; the others have seen every window."""
    replace_checks(monkeypatch, CrashesLate(), Counts())
    alone, dealt = only_run(handmade, InProcess()), only_run(handmade, Travels())
    assert same(alone, dealt)
    crashed, counted = dealt.record.results
    assert (crashed.outcome, dealt.record.verdict) == ("crashed", "incomplete")
    assert "ZeroDivisionError: window 3" in crashed.traceback
    assert counted.coverage is not None
    assert counted.coverage.seen == WINDOWS


@pytest.mark.usefixtures("counting")
@pytest.mark.parametrize("lost", ["survey_file", "measure_windows seq.h5 [2, 3]", "finish_file"])
def test_what_is_lost_once_is_done_again(lost: str, handmade: Path) -> None:
    """A process that dies over any step leaves no trace in the record."""
    assert same(only_run(handmade, Loses(lost)), only_run(handmade, InProcess()))


@pytest.mark.usefixtures("counting")
def test_a_lost_stretch_is_done_again_window_by_window(handmade: Path) -> None:
    """After a death each window of the stretch is measured by itself, and no other is measured again."""
    executor = Loses("measure_windows seq.h5 [2, 3]")
    only_run(handmade, executor)
    measured = sorted(task for task in executor.done if task.startswith("measure"))
    assert measured == [f"measure_windows seq.h5 {windows}" for windows in ([0, 1], [2], [3], [4, 5])]


@pytest.mark.usefixtures("counting")
def test_a_window_that_kills_again_is_told(handmade: Path) -> None:
    """It costs itself alone, and the file is never clean."""
    run = only_run(handmade, Loses("measure_windows seq.h5 [2, 3]", "measure_windows seq.h5 [2]"))
    assert run.record.inferred["seen"] == str([0, 1, 3, 4, 5])
    assert run.record.verdict == "incomplete"
    told = run.record.results[-1]
    assert (told.check, told.outcome) == ("windows", "crashed")
    assert told.reason.startswith("1 of 6 windows were not seen by any check")
    assert "from 40000 to 60000 us" in told.reason
    assert told.coverage is not None
    assert (told.coverage.seen, told.coverage.of) == (5, 6)


@pytest.mark.usefixtures("counting")
def test_all_windows_lost(handmade: Path) -> None:
    """Where every window kills, the file is judged by none, and is incomplete."""
    run = only_run(handmade, Loses("measure_windows", times=99))
    assert run.record.inferred["seen"] == "[]"
    assert run.record.verdict == "incomplete"


@pytest.mark.usefixtures("counting")
@pytest.mark.parametrize(("lost", "doing"), [("survey_file seq", "being opened"), ("finish_file seq", "being judged")])
def test_a_file_that_kills_again_is_told(lost: str, doing: str, handmade: Path, tmp_path: Path) -> None:
    """Where opening or judging a file kills twice, each of its checks has crashed; other files stand."""
    other = write_handmade(tmp_path / "other.h5")
    runs = all_runs([handmade, other], Loses(lost, times=2))
    record = runs[handmade].record
    assert [result.outcome for result in record.results] == ["crashed"]
    assert doing in record.results[0].reason
    assert (record.verdict, len(record.sha256), record.path) == ("incomplete", 64, str(handmade))
    assert runs[other].record.results[0].outcome == "passed"


def test_a_killed_process_costs_nothing(handmade: Path, tmp_path: Path) -> None:
    """With real processes, one of which is killed in the middle: all windows seen, the other file untouched."""
    paths = [handmade, write_handmade(tmp_path / "other.h5")]
    runs = all_runs(paths, ProcessExecutor(2), checks=(Kills(once=tmp_path / "killed"),))
    assert (tmp_path / "killed").exists()
    for run in runs.values():
        assert [result.outcome for result in run.record.results] == ["passed"]
        assert run.record.inferred["seen"] == "[0]"


def test_a_window_that_kills_every_process(handmade: Path) -> None:
    """With real processes, a window that kills whoever looks at it ends the run honestly, and does not hang it."""
    record = all_runs([handmade], ProcessExecutor(1), checks=(Kills(),))[handmade].record
    assert [(result.check, result.outcome) for result in record.results][-1] == ("windows", "crashed")
    assert record.verdict == "incomplete"


@pytest.mark.usefixtures("counting")
def test_progress_tells_the_truth(handmade: Path, tmp_path: Path) -> None:
    """Nothing that is told goes back; at the end all files, windows and bytes are done; before it, not all."""
    paths = [handmade, write_handmade(tmp_path / "other.h5")]
    tallies: list[ProgressTally] = []
    executor = Travels()
    for _ in check_files(paths, CheckOptions(evidence=None), executor, tallies.append):
        pass
    sizes = sum(path.stat().st_size for path in paths)
    assert tallies[-1] == replace(
        tallies[-1], files_done=2, files=2, windows_done=2 * WINDOWS, windows=2 * WINDOWS, bytes_done=sizes, bytes=sizes
    )
    for counts in ("files_done", "windows_done", "bytes_done"):
        values = [getattr(tally, counts) for tally in tallies]
        assert values == sorted(values)
    assert all(tally.bytes_done < sizes for tally in tallies if tally.files_done < 2)


@pytest.mark.usefixtures("counting")
def test_memory_is_shared(handmade: Path) -> None:
    """Each of three workers gets a third of what libraries leave of the memory, or of a quarter of it."""
    seen: list[CheckOptions] = []

    class Looks(Travels):
        def submit(self, task: Task, progress: Progress) -> Future[Any]:
            if task.function == SURVEY_FILE:
                seen.append(task.arguments[2])
            return super().submit(task, progress)

    for memory_bytes, share in ((980_000_000, 200_000_000), (240_000_000, 20_000_000)):
        seen.clear()
        only_run(handmade, Looks(), CheckOptions(evidence=None, memory_bytes=memory_bytes))
        assert [options.memory_bytes for options in seen] == [share]


@pytest.mark.usefixtures("counting")
def test_runs_are_handed_over(tmp_path: Path) -> None:
    """Whoever drops the runs as they come holds no more than workers end at once."""
    paths = [write_handmade(tmp_path / f"{number}.h5") for number in range(6)]
    alive = []
    for _, run in check_files(paths, CheckOptions(evidence=None), Travels(), lambda tally: None):
        del run
        gc.collect()
        runs = [each.record.path for each in gc.get_objects() if isinstance(each, FileRun)]
        alive.append(sum(str(path) in runs for path in paths))
    assert len(alive) == 6
    assert max(alive) <= Travels.capacity


@pytest.mark.usefixtures("counting")
def test_errors_of_a_file_end_the_run(tmp_path: Path) -> None:
    """A path that is no file is misuse, also where somebody else was to open it."""
    with pytest.raises(MisuseError, match="does not exist"):
        all_runs([tmp_path / "none.h5"], InProcess())


@given(windows=st.integers(0, 3000), workers=st.integers(1, 64), data=st.data())
def test_regions_hold_every_window_once(windows: int, workers: int, data: st.DataObject) -> None:
    """Whoever asks when, every window is dealt out once, in stretches of neighbours, two thirds of all at most."""
    regions, dealt = WorkQueue(windows, workers), []
    while stretch := regions.take(data.draw(st.integers(0, workers - 1))):
        assert list(stretch) == list(range(stretch[0], stretch[0] + len(stretch)))
        assert len(stretch) <= min(max(2 * windows // 3, 4), 64)
        dealt += stretch
    assert sorted(dealt) == list(range(windows))


def test_workers_stay_in_their_neighbourhoods() -> None:
    """Each goes on where it was, and when it is done takes the far end of what is left of another's."""
    regions = WorkQueue(40, 2)
    assert [regions.take(0) for _ in range(3)] == [range(13), range(13, 17), range(17, 20)]
    assert regions.take(1) == range(20, 33)
    assert regions.take(0) == range(36, 40)
    assert regions.take(1) == range(33, 36)


@pytest.mark.usefixtures("counting")
def test_a_file_that_does_not_end_opening_is_not_opened_again(handmade: Path, tmp_path: Path) -> None:
    """It is given up at the first time, and the next file stands."""
    other = write_handmade(tmp_path / "other.h5")
    tried: list[str] = []

    class Endless(Travels):
        def submit(self, task: Task, progress: Progress) -> Future[Any]:
            if task.function == OPEN_AND_CLOSE and task.arguments[0].name == "seq.h5":
                tried.append(task.arguments[0].name)
                future: Future[Any] = Future()
                future.set_exception(EndlessError("endless"))
                return future
            return super().submit(task, progress)

    runs = all_runs([handmade, other], Endless())
    assert tried == ["seq.h5"]
    (crashed,) = runs[handmade].record.results
    assert crashed.reason == "the process by which it was being opened did not come to an end, and was ended"
    assert runs[other].record.results[0].outcome == "passed"


def test_opening_has_a_limit_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A minute where nobody says otherwise; a file behind a URL has the limits of its server."""
    test = opening_test(Path("seq.h5"))
    assert test is not None
    assert test.limit_s == 60.0
    monkeypatch.setenv(OPENING_VARIABLE, "5")
    test = opening_test(Path("seq.h5"))
    assert test is not None
    assert test.limit_s == 5.0
    for wrong in ("soon", "0", "-1", "nan", "inf"):
        monkeypatch.setenv(OPENING_VARIABLE, wrong)
        with pytest.raises(MisuseError, match="Expected seconds in FEDORA_QA_OPENING_S"):
            opening_test(Path("seq.h5"))
    assert opening_test(RemoteFile("https://host/seq.h5")) is None


@pytest.mark.usefixtures("counting")
def test_progress_that_comes_late_changes_nothing(handmade: Path) -> None:
    """What a task reports after its result, as threads may bring it about, neither ends a file early nor never."""

    class Late(Travels):
        def __init__(self) -> None:
            self.late: list[Progress] = []

        def submit(self, task: Task, progress: Progress) -> Future[Any]:
            future = super().submit(task, progress)
            for earlier in self.late:
                earlier("measuring", 0, 1)
                earlier("measuring", 99, 100)
            self.late.append(progress)
            return future

    assert same(only_run(handmade, Late()), only_run(handmade, InProcess()))

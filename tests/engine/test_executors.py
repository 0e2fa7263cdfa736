"""Tasks are done, wherever; a process that dies takes one task with it, and nothing waits for it."""

import os
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fedora_qa.engine.executors.executor import Executor, InProcess, Kept, Task
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.progress import quiet
from fedora_qa.errors import EndlessError, WorkerLostError
from tests.support import tasks


@pytest.fixture(scope="module")
def processes() -> Iterator[ProcessExecutor]:
    with ProcessExecutor(2) as executor:
        yield executor


@pytest.fixture(params=["in process", "processes"])
def executor(request: pytest.FixtureRequest, processes: ProcessExecutor) -> Executor:
    return InProcess() if request.param == "in process" else processes


def test_result_and_progress_come_back(executor: Executor) -> None:
    """A task gives its result, and what it told arrives in order before it."""
    told: list[tuple[str, int, int]] = []
    result, _ = executor.submit(Task(tasks.count, (3,)), lambda *what: told.append(what)).result()
    assert result == 3
    assert told == [("counting", number, 3) for number in range(3)]


def test_progress_is_complete_where_the_task_ends_first(processes: ProcessExecutor) -> None:
    """Reports of a task that ended before they were read are read."""
    reports: list[int] = []

    def read_slowly(what: str, done: int, of: int) -> None:
        time.sleep(0.3)
        reports.append(done)

    processes.submit(Task(tasks.count, (3,)), read_slowly).result()
    assert reports == [0, 1, 2]


def test_errors_come_back(executor: Executor) -> None:
    """What a task raises is raised where its result is asked for, with the place where it happened."""
    future = executor.submit(Task(tasks.divide, (0,)), quiet)
    with pytest.raises(ZeroDivisionError) as raised:
        future.result()
    shown = "".join(traceback.format_exception(raised.value))
    assert "tasks.py" in shown


def test_an_error_that_cannot_travel_is_told(processes: ProcessExecutor) -> None:
    """An error that cannot be unpickled arrives as its name and words."""
    with pytest.raises(RuntimeError, match="StubbornError: this and that"):
        processes.submit(Task(tasks.be_stubborn), quiet).result()


def test_a_task_that_cannot_travel_costs_no_process(processes: ProcessExecutor) -> None:
    """A task that cannot be pickled is refused, and the next one is done."""
    with pytest.raises(Exception, match=r"pickle|local object"):
        processes.submit(Task(lambda worker: None), quiet).result()
    assert processes.submit(Task(tasks.count, (1,)), quiet).result()[0] == 1


@pytest.mark.parametrize(
    ("task", "how"), [(tasks.die, "signal 9"), (tasks.leave, "exit code 7"), (tasks.leave_quietly, "exit code 0")]
)
def test_a_death_costs_its_own_task(task: Any, how: str, processes: ProcessExecutor) -> None:
    """A process that dies is reported by the task it did; all others, before and after, are done."""
    submitted = [processes.submit(Task(tasks.count, (2,)), quiet) for _ in range(3)]
    lost = processes.submit(Task(task), quiet)
    submitted += [processes.submit(Task(tasks.count, (2,)), quiet) for _ in range(3)]
    with pytest.raises(WorkerLostError, match=how):
        lost.result()
    assert [future.result()[0] for future in submitted] == [2] * 6


def test_what_never_ends_is_told_from_what_dies(processes: ProcessExecutor) -> None:
    """A task that exceeds its limit would do so again; one whose process was killed need not."""
    with pytest.raises(EndlessError, match=r"within 0\.2 s"):
        processes.submit(Task(tasks.burn, limit_s=0.2), quiet).result()
    with pytest.raises(WorkerLostError) as killed:
        processes.submit(Task(tasks.die), quiet).result()
    assert not isinstance(killed.value, EndlessError)


@pytest.mark.parametrize("kind", [InProcess, lambda: ProcessExecutor(2)], ids=["in process", "processes"])
def test_a_large_result_stays_where_it_was_made(kind: Callable[[], Executor]) -> None:
    """The future gives a handle, which later tasks load as often as they need it, until it is discarded."""
    with kind() as executor:
        kept = executor.submit(Task(tasks.count, (3,), keeps_result=True), quiet).result()
        assert isinstance(kept, Kept)
        for _ in range(2):
            assert executor.submit(Task(tasks.load, (kept,)), quiet).result()[0] == 3
        kept.discard()
        assert kept.path is None or not kept.path.exists()


def test_a_task_follows_its_predecessor_to_the_same_process(processes: ProcessExecutor) -> None:
    """While no more tasks run than there are processes, the one that is idle gets the next: its file is open."""
    busy = processes.submit(Task(tasks.sleep, (1.0,)), quiet)
    ids = {processes.submit(Task(tasks.process_id), quiet).result() for _ in range(5)}
    assert busy.result() not in ids
    assert len(ids) == 1


def test_an_interrupt_is_not_for_workers(processes: ProcessExecutor) -> None:
    """Ctrl-C, which the terminal sends to every process, ends no worker."""
    assert processes.submit(Task(tasks.interrupt), quiet).result() == "done"


def test_leaving_ends_what_is_being_done(tmp_path: Path) -> None:
    """After the executor is left, the process of a task that would never end is gone, and its task is lost."""
    note = tmp_path / "id"
    with ProcessExecutor(1) as executor:
        endless = executor.submit(Task(tasks.write_id_and_sleep, (note,)), quiet)
        waiting = executor.submit(Task(tasks.count, (1,)), quiet)
        while not note.exists():
            time.sleep(0.01)
    with pytest.raises(WorkerLostError):
        endless.result()
    assert waiting.cancelled()
    with pytest.raises(ProcessLookupError):
        os.kill(int(note.read_text()), 0)


def test_an_idle_process_that_was_killed_is_replaced() -> None:
    """Its end concerns no task: the next one gets another process."""
    with ProcessExecutor(1) as executor:
        first = executor.submit(Task(tasks.process_id), quiet).result()
        os.kill(first, signal.SIGKILL)
        time.sleep(0.5)
        second = executor.submit(Task(tasks.process_id), quiet).result()
    assert first != second


def test_deaths_in_a_row_are_told_each_time() -> None:
    """Whether a process dies before or after it has reported its task, nobody waits for ever."""
    with ProcessExecutor(2) as executor:
        for _ in range(10):
            futures = [executor.submit(Task(tasks.die), quiet), executor.submit(Task(tasks.count, (1,)), quiet)]
            with pytest.raises(WorkerLostError):
                futures[0].result(timeout=60)
            assert futures[1].result(timeout=60)[0] == 1

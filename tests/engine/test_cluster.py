"""The same tasks on a Dask cluster of separate processes, some of which die."""

import gc
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import dask
import pytest
from distributed import LocalCluster

from fedora_qa.engine.executors import cluster as cluster_module
from fedora_qa.engine.executors.cluster import DaskExecutor
from fedora_qa.engine.executors.executor import InProcess, Task
from fedora_qa.engine.files import check_files
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import Survey
from fedora_qa.engine.tasks import measure_windows, survey_file
from fedora_qa.errors import FedoraError, MisuseError, WorkerLostError
from tests.support import tasks
from tests.support.handmade import write_handmade
from tests.support.identical import identical
from tests.support.killers import Counts, Kills


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A cluster of two workers that gives a task up after two of them have died over it."""
    folder = tmp_path_factory.mktemp("dask")
    settings = {
        "distributed.scheduler.allowed-failures": 1,
        "distributed.deploy.lost-worker-timeout": "600s",  # a busy machine is slow to start another
        "temporary-directory": str(folder),
    }
    workers: dict[str, Any] = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}
    with dask.config.set(settings), LocalCluster(**workers, host="127.0.0.1") as made:  # type: ignore[no-untyped-call]
        yield made.scheduler_address


def test_tasks_are_done(address: str) -> None:
    """Results and errors come back from as many workers as there are."""
    with DaskExecutor(address) as executor:
        assert (executor.capacity, executor.sharing) == (2, 1)
        results = [executor.submit(Task(tasks.count, (number,)), quiet) for number in range(5)]
        assert [result.result()[0] for result in results] == list(range(5))
        with pytest.raises(ZeroDivisionError):
            executor.submit(Task(tasks.divide, (0,)), quiet).result()


def test_a_task_that_kills_is_lost(address: str) -> None:
    """A task that kills every worker that tries it is lost, and the next one is done."""
    with DaskExecutor(address) as executor:
        with pytest.raises(WorkerLostError, match="died"):
            executor.submit(Task(tasks.die), quiet).result()
        assert executor.submit(Task(tasks.count, (1,)), quiet).result()[0] == 1


def test_a_worker_killed_on_the_way(address: str, tmp_path: Path) -> None:
    """One of the workers is killed while it measures: the record is that of a run in one process, to the last bit."""
    paths = [write_handmade(tmp_path / name) for name in ("one.h5", "other.h5")]
    killed = tmp_path / "killed"
    checks = (Kills(once=killed),)

    def runs(executor: Any) -> dict[Path, FileRun]:
        with executor:
            return dict(check_files(paths, CheckOptions(), executor, lambda tally: None, checks=checks))

    on_cluster = runs(DaskExecutor(address))
    assert killed.exists()
    alone = runs(InProcess())
    for path in paths:
        assert identical(on_cluster[path].record, alone[path].record)
        assert identical(on_cluster[path].arrays, alone[path].arrays)


def test_what_windows_have_shown_stays_with_workers(address: str, park_day: Path) -> None:
    """It comes to nobody before it is asked for; where its worker is killed before that, it is made again."""
    of_file = (park_day, (Counts(),), CheckOptions(evidence=None))
    with DaskExecutor(address) as executor:
        survey = executor.submit(Task(survey_file, of_file), quiet).result()

        def measured(windows: Sequence[int], before: Any) -> Any:
            arguments = (survey, windows, "planned", before)
            return executor.submit(Task(measure_windows, arguments, keeps_result=True), quiet).result()

        first = measured([0], None)
        assert not first.pickled
        (holder,) = executor._client.who_has([first.future])[first.future.key]
        os.kill(executor._client.run(os.getpid)[holder], signal.SIGKILL)
        others = survey.windows[1:]
        both = measured(others, first)
        first.discard()
        assert both.load().states["test.counts"] == [0, *others] != [0]


def test_nothing_of_a_file_that_is_done_is_kept(address: str, tmp_path: Path) -> None:
    """Neither command nor scheduler, both in this process, hold surveys or runs; Dask logs its last 1000 messages."""
    paths = [write_handmade(tmp_path / f"{number}.h5") for number in range(6)]
    with DaskExecutor(address) as executor:
        for _ in check_files(paths, CheckOptions(evidence=None), executor, lambda tally: None, checks=(Counts(),)):
            pass
        gc.collect()
        places = [each.path for each in gc.get_objects() if isinstance(each, Survey)]
        places += [Path(each.record.path) for each in gc.get_objects() if isinstance(each, FileRun)]
        # That of the file that was done last is still referred to here.
        assert len(set(places) & set(paths)) <= 1


def test_other_code_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker that has another version does nothing, and says what to do."""
    monkeypatch.setattr(cluster_module, "code_digest", lambda: "another")
    with DaskExecutor(address) as executor, pytest.raises(MisuseError, match="install the same version"):
        executor.submit(Task(tasks.count, (1,)), quiet).result()


def test_nobody_at_the_address(monkeypatch: pytest.MonkeyPatch) -> None:
    """An address at which no scheduler answers is misuse."""
    monkeypatch.setattr(cluster_module, "_CONNECT_S", 0.2)
    with pytest.raises(MisuseError, match="Expected a Dask scheduler at tcp://127"):
        DaskExecutor("tcp://127.0.0.1:9")


def test_nobody_left(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cluster that has lost its workers for good ends the run, and does not let it wait."""
    with DaskExecutor(address) as executor:
        monkeypatch.setattr(executor._client, "nthreads", dict)
        monkeypatch.setattr(cluster_module, "_WITHOUT_WORKERS_S", -1.0)
        with pytest.raises(FedoraError, match="got none for a minute"):
            executor.require_workers()


def test_dask_is_an_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without Dask one sentence says how to install it."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MisuseError, match=r"pip install 'fedora-qa\[dask\]'"):
        DaskExecutor("tcp://127.0.0.1:9")

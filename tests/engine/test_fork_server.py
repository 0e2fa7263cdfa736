"""The command's own process loads nothing that measures, leaves nothing behind, and workers share what is loaded."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest

from fedora_qa.cli.workers import IN_PROCESS_VARIABLE, begin_to_load
from fedora_qa.engine import fork_server
from fedora_qa.engine.fork_server import start_method
from fedora_qa.engine.processes import ProcessExecutor
from fedora_qa.engine.progress import quiet
from fedora_qa.estimators.images.luma import luma_of
from tests.support import tasks
from tests.support.handmade import write_handmade

MEASURES = {"h5py", "numba", "cv2", "scipy", "fedora_qa.checks", "fedora_qa.layout.resolve"}

forked = pytest.mark.skipif(start_method() != "forkserver", reason="processes are forked on Linux alone")


def test_the_command_loads_nothing_that_measures(tmp_path: Path) -> None:
    """A file is checked to its record, and the process that says so has loaded neither HDF5 nor a check."""
    path = write_handmade(tmp_path / "seq.h5")
    code = (
        "import sys; from fedora_qa.cli.main import run; "
        f"code = run(['check', {str(path)!r}, '--json', {str(tmp_path / 'record.json')!r}]); "
        f"print(code, sorted({MEASURES!r} & set(sys.modules)))"
    )
    environment = {name: value for name, value in os.environ.items() if name != IN_PROCESS_VARIABLE}
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert ended.stdout.splitlines()[-1] == "0 []"
    assert (tmp_path / "record.json").exists()


@forked
def test_workers_are_forked_from_what_has_loaded_all() -> None:
    """What a worker needs is there before its first task, and all workers are children of one process."""
    with ProcessExecutor(2) as executor:
        futures = [executor.submit(tasks.loaded_modules, quiet, worker) for worker in range(2)]
        seen = [future.result() for future in futures]
    assert all(modules >= MEASURES for modules, _ in seen)
    assert len({parent for _, parent in seen}) == 1
    assert seen[0][1] != os.getpid()


def test_tasks_go_to_the_worker_that_is_named() -> None:
    """A worker is chosen by its number, so that it goes on with the file that it has open."""
    with ProcessExecutor(2) as executor:
        ids = [executor.submit(tasks.process_id, quiet, worker).result() for worker in (0, 1, 0, 1, 1)]
    assert ids == [ids[0], ids[1], ids[0], ids[1], ids[1]]
    assert ids[0] != ids[1]


def test_nothing_is_left_behind(tmp_path: Path) -> None:
    """When a command has ended, so have all processes that it has started, and its folder of what was shown is gone."""
    path = write_handmade(tmp_path / "seq.h5")
    folder = tmp_path / "temporary"
    folder.mkdir()
    environment = {name: value for name, value in os.environ.items() if name != IN_PROCESS_VARIABLE}
    command = [sys.executable, "-m", "fedora_qa", "check", str(path), "--jobs", "2", "--select", "clocks"]
    marked = {**environment, "TMPDIR": str(folder), "FEDORA_QA_TEST_MARK": str(tmp_path)}
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=marked)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert list(folder.glob("fedora-qa-*")) == []
    left = [process for process in psutil.process_iter() if _is_marked(process, str(tmp_path))]
    assert [process.cmdline() for process in left] == []


def _is_marked(process: psutil.Process, mark: str) -> bool:
    try:
        return process.environ().get("FEDORA_QA_TEST_MARK") == mark and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False


def test_loading_compiles_nothing() -> None:
    """Loops that are kept are loaded as they are, and a loop that is loaded gives what it gave."""
    before = luma_of(np.full((2, 2, 3), 7, np.uint8), np.ones((3, 256), np.float32))
    # In a process of its own: what is imported there ignores interrupts.
    code = (
        "import numpy as np; "
        "from fedora_qa.engine.preloaded import load_compiled_loops; "
        "from fedora_qa.estimators.images.luma import luma_of; "
        "loaded = load_compiled_loops('fedora_qa'); "
        "luma = luma_of(np.full((2, 2, 3), 7, np.uint8), np.ones((3, 256), np.float32)); "
        "print(loaded > 0, sum(luma_of.stats.cache_misses.values()), luma.ravel().tolist())"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == f"True 0 {before.ravel().tolist()}"


@pytest.mark.parametrize(
    ("arguments", "begins"),
    [("check a.h5 --jobs 2", True), ("gate release --policy p.toml", True), ("check --help", False),
     ("check a.h5 --dask=tcp://host:1", False), ("report record.json", False), ("", False)],
)  # fmt: skip
def test_loading_begins_where_workers_will_be_needed(
    arguments: str, begins: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Commands that measure begin to load before they are understood; others load nothing."""
    begun: list[bool] = []
    monkeypatch.setattr(fork_server, "begin_preloading", lambda: begun.append(True))
    monkeypatch.delenv(IN_PROCESS_VARIABLE, raising=False)
    begin_to_load(arguments.split())
    assert begun == [True] * begins


def test_loops_that_serve_others_are_left() -> None:
    """What can be called is loaded; a loop within the code of others is not loaded by itself."""
    luma_of(np.full((2, 2, 3), 7, np.uint8), np.ones((3, 256), np.float32))  # compiled and kept
    code = (
        "import fedora_qa.engine.preloaded; "
        "from fedora_qa.estimators.depth.inverse_depth import inverse_at; "
        "from fedora_qa.estimators.images.luma import luma_of; "
        "print(len(inverse_at.signatures), len(luma_of.signatures) > 0)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["0", "True"]

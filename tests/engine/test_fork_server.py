"""A command leaves nothing behind, and workers share what is loaded."""

import os
import subprocess
import sys
from pathlib import Path

import h5py
import hdf5plugin
import numpy as np
import psutil
import pytest

from fedora_qa.catalogue import CATALOGUE
from fedora_qa.check_names import subject_of
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE, preload_workers
from fedora_qa.engine.executors import fork_server
from fedora_qa.engine.executors.executor import Task
from fedora_qa.engine.executors.fork_server import preloaded_modules, start_method
from fedora_qa.engine.executors.processes import ProcessExecutor
from fedora_qa.engine.progress import quiet
from tests.support import tasks
from tests.support.handmade import write_handmade

MEASURES = {"h5py", "numba", "cv2", "scipy", "fedora_qa.checks", "fedora_qa.layout.resolve"}

forked = pytest.mark.skipif(start_method() != "forkserver", reason="processes are forked on Linux alone")


@forked
def test_workers_are_forked_from_what_has_loaded_all() -> None:
    """What a worker needs is there before its first task, and all workers are children of one process."""
    with ProcessExecutor(2) as executor:
        futures = [executor.submit(Task(tasks.loaded_modules), quiet) for _ in range(2)]
        seen = [future.result() for future in futures]
    assert all(modules >= MEASURES for modules, _ in seen)
    assert len({parent for _, parent in seen}) == 1
    assert seen[0][1] != os.getpid()


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


def test_no_library_warns_of_leaked_resources(tmp_path: Path) -> None:
    """The tracker of resources reports no leaked lock, also where images are decoded without HDF5."""
    path = write_handmade(tmp_path / "seq.h5")
    with h5py.File(path, "r+") as file:
        del file["path/rgb"]
        shape = (len(file["path/rgb_ts"]), 600, 600, 3)
        blosc = hdf5plugin.Blosc(cname="zstd", clevel=1)
        file.create_dataset("path/rgb", data=np.full(shape, 9, np.uint8), chunks=(1, *shape[1:]), **blosc)
    environment = {name: value for name, value in os.environ.items() if name != IN_PROCESS_VARIABLE}
    command = [sys.executable, "-m", "fedora_qa", "check", str(path), "--select", "integrity", "--select", "images"]
    # The tracker writes to the same pipe and ends last, so that its warnings are in the output.
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert "images.repeats" in ended.stdout, ended.stderr
    assert "resource_tracker" not in ended.stderr


def _is_marked(process: psutil.Process, mark: str) -> bool:
    try:
        return process.environ().get("FEDORA_QA_TEST_MARK") == mark and process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False


@pytest.mark.parametrize(
    ("arguments", "begins"),
    [("check a.h5 --jobs 2", [[]]), ("check --select=imu a.h5 --select clocks.rate", [["imu", "clocks.rate"]]),
     ("gate release --policy p.toml", [[]]), ("check --help", []), ("check a.h5 --dask=tcp://host:1", []),
     ("report record.json", []), ("", [])],
)  # fmt: skip
def test_loading_begins_where_workers_will_be_needed(
    arguments: str, begins: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Commands that measure begin to load what they select before they are understood; others load nothing."""
    begun: list[list[str]] = []
    monkeypatch.setattr(fork_server, "begin_preloading", lambda names: begun.append([*names]))
    monkeypatch.delenv(IN_PROCESS_VARIABLE, raising=False)
    preload_workers(arguments.split())
    assert begun == begins


def test_a_selection_loads_its_own_checks_alone() -> None:
    """For a selection of clocks no other check is loaded, nor what names causes, and a wrong name changes nothing."""
    modules = preloaded_modules(["clocks.rate", "no\udcffsense"])
    command = f"import sys\nfor name in {modules}: __import__(name)\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    loaded = {name.removeprefix("fedora_qa.") for name in done.stdout.split() if name.startswith("fedora_qa.")}
    assert {subject for subject in map(subject_of, CATALOGUE) if f"checks.{subject}" in loaded} == {"clocks"}
    assert "checks.clocks.rate" in loaded
    assert not loaded & {"checks.clocks.gaps", "diagnosis", "faults.table"}

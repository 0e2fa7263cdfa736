"""``fedora-qa check --jobs`` and ``--resume``: the same record however it was made, and nothing old is believed."""

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import pytest

from fedora_qa.cli import check as check_command
from fedora_qa.cli.progress import counts_words
from fedora_qa.cli.settings import with_jobs
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from fedora_qa.config import CheckConfig
from fedora_qa.engine.progress import ProgressTally
from fedora_qa.storage.place import place_of
from tests.cli.conftest import Command, Outcome
from tests.support.killers import Counts
from tests.support.replaced_checks import replace_checks


def facts_of(path: Path) -> dict[str, Any]:
    """The record but for its run, and the bytes of the arrays beside it."""
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    del document["run"]
    return {**document, "arrays": path.with_name(path.name + ".arrays.npz").read_bytes()}


@pytest.fixture
def two(sequence: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A clean file, and one of whose IMU two stamps are exchanged."""
    other = Path(shutil.copy(sequence, tmp_path / "other.h5"))
    with h5py.File(other, "r+") as file:
        timestamps: Any = file["path/imu/ts"]
        timestamps[20:22] = timestamps[20:22][::-1]
    return sequence, other


def test_two_jobs_write_the_record_of_one(fedora_qa: Command, two: tuple[Path, Path], tmp_path: Path) -> None:
    """Two files in two processes: exit code, record and arrays are those of one, and stderr is silent."""
    done = []
    for jobs in (1, 2):
        json_path = tmp_path / f"{jobs}.json"
        selected = ("--select", "clocks", "--select", "imu", "--jobs", str(jobs))
        done.append((fedora_qa("check", *two, *selected, "--json", json_path), facts_of(json_path)))
    (alone, expected), (shared, got) = done
    assert got == expected
    assert (shared.code, shared.err) == (alone.code, alone.err) == (1, "")


def test_memory_for_many(fedora_qa: Command, sequence: Path) -> None:
    """Memory that is too little for so many is misuse, and the message says how much is needed."""
    done = fedora_qa("check", sequence, "--jobs", "20", "--memory", "1GB")
    assert done.code == 2
    assert "1280MiB for 20 jobs" in done.err


def test_as_many_jobs_as_the_machine_and_the_files_occupy(
    sequence: Path, two: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no number is stated: cores, memory and files each bound it, and the memory follows; a stated one stands."""
    monkeypatch.setattr(f"{with_jobs.__module__}.usable_cores", lambda: 8)
    monkeypatch.setattr(f"{with_jobs.__module__}.memory_mib", lambda: 64 << 10)
    afar = [place_of("https://example.org/a.h5")]
    assert with_jobs(CheckConfig(), afar).jobs == 1  # in the process of the command
    monkeypatch.delenv(IN_PROCESS_VARIABLE)
    assert with_jobs(CheckConfig(jobs=3), [sequence]).jobs == 3
    every_core = with_jobs(CheckConfig(), afar)
    assert (every_core.jobs, every_core.memory_bytes) == (8, 5_600_000_000)
    assert every_core.digest == CheckConfig().digest == CheckConfig(memory="1GB").digest
    assert [with_jobs(CheckConfig(), files).jobs for files in ([sequence], two)] == [1, 2]
    os.truncate(sequence, 130_000_000)
    assert with_jobs(CheckConfig(), [sequence]).jobs == 3
    assert with_jobs(CheckConfig(memory="1GB"), afar).jobs == 2
    assert with_jobs(CheckConfig(memory="100MB"), afar).jobs == 1
    monkeypatch.setattr(f"{with_jobs.__module__}.memory_mib", lambda: 4 << 10)
    assert with_jobs(CheckConfig(), afar).jobs == 3


def test_jobs_or_dask(fedora_qa: Command, sequence: Path) -> None:
    """Two answers to who does the work are misuse."""
    assert fedora_qa("check", sequence, "--jobs", "2", "--dask", "tcp://127.0.0.1:1").code == 2


class Watch:
    """Which files are checked, and how far the run may come."""

    def __init__(self) -> None:
        self.checked: list[str] = []
        self.interrupt_after = 99
        self._check_files = check_command.check_files

    def __call__(self, paths: Any, *arguments: Any) -> Iterator[Any]:
        for path, run in self._check_files(paths, *arguments):
            if len(self.checked) == self.interrupt_after:
                raise KeyboardInterrupt
            self.checked.append(path.name)
            yield path, run


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> Watch:
    """Quick checks in place of the real ones, watched."""
    watch = Watch()
    monkeypatch.setattr(check_command, "check_files", watch)
    replace_checks(monkeypatch, Counts())
    return watch


class Resumed:
    """Runs of one command over two files that keep what they found."""

    def __init__(self, fedora_qa: Command, two: tuple[Path, Path], folder: Path) -> None:
        self.fedora_qa, self.two, self.folder = fedora_qa, two, folder
        self.out = folder / "out.json"

    def __call__(self, *options: str) -> Outcome:
        kept = ("--resume", self.folder / "kept")
        return self.fedora_qa("check", *self.two, *options, "--json", self.out, *kept)


@pytest.fixture
def resumed(fedora_qa: Command, two: tuple[Path, Path], tmp_path: Path) -> Resumed:
    return Resumed(fedora_qa, two, tmp_path)


def test_an_interrupt_keeps_what_is_done(watch: Watch, resumed: Resumed, fedora_qa: Command) -> None:
    """Interrupted after one of two files: 130, and what is kept is told. Run again, only the other is checked, and the
    record is that of a run without an interrupt."""
    watch.interrupt_after = 1
    stopped = resumed()
    assert stopped.code == 130
    assert f"1 of 2 files are done, and kept in {resumed.folder / 'kept'}" in stopped.err
    assert not resumed.out.exists()
    watch.interrupt_after = 99
    assert resumed().code == 0
    assert watch.checked == ["seq.h5", "other.h5"]
    whole = resumed.folder / "whole.json"
    fedora_qa("check", *resumed.two, "--json", whole)
    assert facts_of(resumed.out) == facts_of(whole)


def test_what_is_known_is_not_checked_again(watch: Watch, resumed: Resumed) -> None:
    """A second run checks nothing, whatever the number of jobs and their memory, and finds the same."""
    resumed()
    first = facts_of(resumed.out)
    resumed("--jobs", "3")
    assert watch.checked == ["seq.h5", "other.h5"]
    assert facts_of(resumed.out) == first


def test_a_changed_file_is_checked_again(watch: Watch, resumed: Resumed) -> None:
    """Where the content of a file has changed, that file alone is checked again, and its record is the new one."""
    resumed()
    with h5py.File(resumed.two[1], "r+") as file:
        file["path/imu/ts"][0] -= 1  # type: ignore[index]
    resumed()
    assert watch.checked == ["seq.h5", "other.h5", "other.h5"]


def test_a_copy_in_its_place_is_the_same_file(watch: Watch, resumed: Resumed) -> None:
    """The digest counts, not the time of the file, where the digest is of the whole file."""
    resumed()
    os.utime(resumed.two[0], ns=(1, 1))
    resumed()
    assert watch.checked == ["seq.h5", "other.h5"]


def test_a_partial_digest_is_not_enough(watch: Watch, resumed: Resumed, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that is too long to be read for its digest is checked again when its time says that it was written to."""
    monkeypatch.setattr("fedora_qa.storage.digest._WHOLE_UP_TO_BYTES", 0)
    monkeypatch.setattr("fedora_qa.storage.digest._PIECE_BYTES", 16)
    resumed()
    resumed()
    assert watch.checked == ["seq.h5", "other.h5"]
    os.utime(resumed.two[0], ns=(1, 1))
    resumed()
    assert watch.checked == ["seq.h5", "other.h5", "seq.h5"]


OTHER_WAYS = {
    "configuration": ("--effort", "quick"),
    "dialect": ("--dialect", "fedora"),
    "canaries": ("--canary",),
}


@pytest.mark.parametrize("options", OTHER_WAYS.values(), ids=OTHER_WAYS)
def test_another_configuration_starts_afresh(options: tuple[str, ...], watch: Watch, resumed: Resumed) -> None:
    """What was found with other options counts for nothing."""
    resumed()
    resumed(*options)
    assert len(watch.checked) == 4


@pytest.mark.parametrize("changed", ["code_digest", "package_version"])
def test_other_code_starts_afresh(
    changed: str, watch: Watch, resumed: Resumed, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was found by other code, or with other libraries, counts for nothing."""
    resumed()
    monkeypatch.setattr(f"fedora_qa.cli.resume.{changed}", lambda *_: "another")
    resumed()
    assert len(watch.checked) == 4


@pytest.mark.parametrize("damaged", ["*.json", "*.npz"])
def test_damaged_results_are_made_anew(damaged: str, watch: Watch, resumed: Resumed) -> None:
    """A result that cannot be read is no result."""
    resumed()
    for path in (resumed.folder / "kept").glob(damaged):
        path.write_text("{")
    resumed()
    assert len(watch.checked) == 4


def test_missing_arrays_are_made_anew(watch: Watch, resumed: Resumed, fedora_qa: Command) -> None:
    """What was found without evidence does not serve a run that shows it."""
    fedora_qa("check", *resumed.two, "--resume", resumed.folder / "kept")
    resumed()
    assert len(watch.checked) == 4


def test_kept_records_can_be_shown(watch: Watch, resumed: Resumed, fedora_qa: Command) -> None:
    """What is kept of a file is a record like any other."""
    resumed()
    shown = fedora_qa("report", next((resumed.folder / "kept").glob("seq-*.json")))
    assert shown.code == 0
    assert "seq.h5" in shown.out


def test_a_folder_that_cannot_be_made(fedora_qa: Command, sequence: Path) -> None:
    """A folder that cannot be is misuse, found before any work."""
    done = fedora_qa("check", sequence, "--resume", sequence / "kept")
    assert done.code == 2
    assert "keep results in" in done.err


def test_progress_counts_what_was_known() -> None:
    """Files that were done before are counted; windows are named as soon as any are known."""
    tally = ProgressTally("a.h5: measuring", 1, 3, 4, 10, 40, 100)
    assert counts_words(tally, file_count=2) == "files 3/5, windows 4/10"
    assert counts_words(ProgressTally("", 0, 3, 0, 0, 0, 100), file_count=0) == "files 0/3"

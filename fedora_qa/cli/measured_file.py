"""Measure the statistics of a file, for ``stats`` and ``compare``."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.progress import progress_bar
from fedora_qa.cli.settings import external_folders
from fedora_qa.config import parse_bytes
from fedora_qa.engine.executor import Task
from fedora_qa.engine.statistics import FileStatistics, collect_statistics
from fedora_qa.engine.tasks import opening_test
from fedora_qa.layout.dialect import DialectChoice, load_choice


@dataclass(frozen=True, slots=True)
class Reading:
    """How files are read.

    Attributes
    ----------
    dialect
        How they name and scale their data; None: as it is recognised.
    memory_bytes
        Memory to aim at.
    allow_external
        Folders with other files that a file may link to.
    in_process
        Whether they are opened in this process, which ends where HDF5 crashes on one.
    """

    dialect: DialectChoice
    memory_bytes: int
    allow_external: tuple[Path, ...]
    in_process: bool = False


def reading_of(
    dialect: str | None, metadata: str | None, memory: str, allow_external: Sequence[str], *, in_process: bool = False
) -> Reading:
    """Return how files are read, by the options of a command; raises ``MisuseError`` where one is illegal."""
    folders = external_folders(tuple(allow_external))
    return Reading(load_choice(dialect, metadata), parse_bytes(memory), folders, in_process)


def measured_file(
    path: Path, reading: Reading, *, with_distributions: bool = False, place: tuple[int, int] = (0, 1)
) -> FileStatistics:
    """Measure the statistics of a file and, if asked for, its distributions; raises as ``run_isolated``.

    Parameters
    ----------
    place
        How many files were measured before, and how many there are: the progress states both.
    """
    arguments = (path, reading.dialect, reading.memory_bytes, reading.allow_external, with_distributions)
    opening = opening_test(path, reading.dialect, reading.allow_external)
    done, count = place
    with progress_bar(path.name if count == 1 else f"{path.name}, file {done + 1} of {count}") as bar:
        measured: FileStatistics = run_isolated(
            Task(collect_statistics, arguments), path, opening, bar, in_process=reading.in_process
        )
    return measured

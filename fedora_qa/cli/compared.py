"""What the arguments of ``fedora-qa compare`` name: records, files to be measured, and folders of either."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from fedora_qa.cli.apart import apart
from fedora_qa.cli.arrays import arrays_beside, read_arrays
from fedora_qa.cli.check import require_hdf5
from fedora_qa.cli.progress import progress_bar
from fedora_qa.comparison.sampled import sampled_from
from fedora_qa.comparison.subjects import Given, GivenFile, labels
from fedora_qa.engine.opening import require_end_of_opening
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.statistics import FileStatistics, measure_file
from fedora_qa.errors import MisuseError
from fedora_qa.layout.dialect import Dialect
from fedora_qa.record.json_io import read_record

_SEQUENCES: Final = {".h5", ".hdf5"}
_RECORD: Final = ".json"


@dataclass(frozen=True, slots=True)
class Source:
    """The files that one argument names: all of them sequences, or all of them records."""

    given: Path
    paths: tuple[Path, ...]
    records: bool


def sources_of(given: Sequence[Path], dialect: Dialect | None) -> tuple[Source, ...]:
    """Return the files that the arguments name, before any of them is read.

    Raises
    ------
    MisuseError
        A path is missing or given twice, a file is no sequence, or a folder holds neither sequences nor records.
    """
    for path in given:
        if given.count(path) > 1:
            raise MisuseError(f"Expected each path once, got {path} {given.count(path)} times")
    sources = tuple(_source(path) for path in given)
    for source in sources:
        if not source.records:
            require_hdf5(source.paths)
        elif not source.paths[0].is_file():
            raise MisuseError(f"Expected a record at {source.given}, got no such file")
    return sources


def read_sources(
    sources: Sequence[Source], dialect: Dialect | None, memory_bytes: int, allow_external: Sequence[Path] = ()
) -> tuple[Given, ...]:
    """Read the records, and measure the other files, each in a process of its own; raises as ``apart``."""
    names = labels([str(source.given) for source in sources])
    return tuple(
        Given(
            name,
            tuple(
                _recorded(source.paths)
                if source.records
                else _measured(source.paths, dialect, memory_bytes, allow_external)
            ),
        )
        for name, source in zip(names, sources, strict=True)
    )


def _source(path: Path) -> Source:
    if not path.is_dir():
        return Source(path, (path,), path.suffix.lower() == _RECORD)
    inside = sorted(entry for entry in path.iterdir() if entry.is_file())
    sequences = tuple(entry for entry in inside if entry.suffix.lower() in _SEQUENCES)
    # Only a record with its arrays: distributions cannot be compared without them, and other JSON is no record.
    records = tuple(entry for entry in inside if entry.suffix.lower() == _RECORD and arrays_beside(entry).is_file())
    if not sequences and not records:
        raise MisuseError(f"Expected sequences (.h5) or records with their arrays in {path}, got neither")
    return Source(path, sequences or records, not sequences)


def _recorded(paths: Sequence[Path]) -> Iterator[GivenFile]:
    for path in paths:
        record = read_record(path)
        arrays = read_arrays(arrays_beside(path)) if arrays_beside(path).is_file() else {}
        # The names of arrays start with the number of the file, from 0, if a record holds several (`record_of`).
        apart = len(record.files) > 1
        for place, file in enumerate(record.files):
            yield GivenFile(file.path, file.statistics, sampled_from(arrays, f"{place}/" if apart else ""), file)


def _measured(
    paths: Sequence[Path], dialect: Dialect | None, memory_bytes: int, allow_external: Sequence[Path]
) -> Iterator[GivenFile]:
    for path in paths:
        with progress_bar(path.name) as report:
            counted = apart(partial(_counted, path, dialect, memory_bytes, allow_external), path, report)
        # As a record holds them: values that are not finite become None, which means unknown.
        statistics = {
            name: {key: None if isinstance(v, float) and not math.isfinite(v) else v for key, v in group.items()}
            for name, group in counted.statistics.items()
        }
        yield GivenFile(str(path), statistics, sampled_from(counted.arrays))


def _counted(
    path: Path, dialect: Dialect | None, memory_bytes: int, allow_external: Sequence[Path], progress: Progress
) -> FileStatistics:
    require_end_of_opening(path, dialect, allow_external)
    return measure_file(path, dialect, memory_bytes, progress, allow_external)

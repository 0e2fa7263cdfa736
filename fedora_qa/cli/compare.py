"""``fedora-qa compare``: sequences, datasets, or two versions of a release side by side."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from fedora_qa.cli.arrays import arrays_beside, read_arrays
from fedora_qa.cli.console import print_table, text
from fedora_qa.cli.documents import write_document
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.sequences import HDF5_SUFFIXES, require_hdf5
from fedora_qa.cli.stats import Reading, measured_file, reading_of
from fedora_qa.comparison.compare import compare as compare_subjects
from fedora_qa.comparison.paper_tables import paper_tables
from fedora_qa.comparison.subjects import (
    FileInput,
    KeptArrays,
    SharedEvidence,
    SubjectInput,
    labels,
    sampled_counts_of,
    shared_files,
)
from fedora_qa.comparison.tables import (
    comparison_to_markdown,
    conclusions_of,
    false_alarm_sentence,
    headline,
    pair_tables,
    tables_to_latex,
)
from fedora_qa.comparison.types import COMPARISON, Design
from fedora_qa.errors import MisuseError, UnrecognisedError
from fedora_qa.layout.dialect import Dialect, split_choice
from fedora_qa.layout.folder import is_sequence, sequences_in
from fedora_qa.record.evidence import MOMENTS, TRAJECTORY
from fedora_qa.record.json_io import read_record
from fedora_qa.record.wording import not_recognised
from fedora_qa.storage.folder import is_folder, list_files, require_readable

_RECORD: Final = ".json"

_MOST_SHARED: Final = 4
"""Most files of which a page shows pictures and paths: with more it would be too large to be sent."""


def run_compare(
    paths: tuple[Path, ...],
    design: Design | None,
    false_alarm_rate: float,
    dialect: str | None,
    metadata: str | None,
    memory: str,
    allow_external: tuple[str, ...],
    outputs: Outputs,
) -> int:
    """Run the command and return its exit code."""
    reading = reading_of(dialect, metadata, memory, allow_external)
    sources = sources_of(paths, split_choice(reading.dialect)[0])
    read = [path for source in sources for path in source.paths]
    # The arrays beside each record are inputs as well: no output may overwrite them.
    outputs.require_writable([*read, *map(arrays_beside, read)])
    inputs = read_sources(sources, reading)
    comparison = compare_subjects(inputs, design, false_alarm_rate)
    if outputs.json:
        write_document(outputs.json, COMPARISON.to_json(comparison))
    if outputs.markdown:
        write_document(outputs.markdown, comparison_to_markdown(comparison))
    if outputs.latex:
        of_pairs = (table for pair in pair_tables(comparison) for table in pair.tables)
        write_document(outputs.latex, tables_to_latex([*paper_tables(comparison), *of_pairs]))
    if outputs.html:
        from fedora_reports.comparison import render_comparison  # noqa: PLC0415 - an extra

        write_document(outputs.html, render_comparison(comparison, shared_evidence_of(inputs)))
    console = outputs.console()
    for sentence in conclusions_of(comparison):
        console.print(text(sentence, "bold"))
    console.print()
    for table in paper_tables(comparison):
        print_table(console, table)
    for pair in pair_tables(comparison):
        console.print(text(pair.title, "bold underline"))
        console.print(text(pair.summary))
        console.print()
        for table in pair.tables:
            print_table(console, table)
    for note in comparison.notes:
        console.print(text(note, "yellow"))
    console.print(text(headline(comparison), "bold"))
    console.print(text(false_alarm_sentence(comparison), "dim"))
    return 0


@dataclass(frozen=True, slots=True)
class Source:
    """The files that one argument names: all sequences, or all records."""

    path: Path
    paths: tuple[Path, ...]
    holds_records: bool


def sources_of(paths: Sequence[Path], dialect: Dialect | None = None) -> tuple[Source, ...]:
    """Return the files that the arguments name, before any of them is read.

    A folder that is one sequence in the dialect, or in one of the package, stands for itself; of another, the sequences
    directly in it.

    Raises
    ------
    MisuseError
        There are fewer than two paths, one is missing or given twice, a file is no sequence, or a folder is empty.
    UnrecognisedError
        A folder holds neither sequences nor records.
    """
    if len(paths) < 2:
        raise MisuseError(f"Expected two or more subjects to compare, got {len(paths)}")
    for path in paths:
        if paths.count(path) > 1:
            raise MisuseError(f"Expected each path once, got {path} {paths.count(path)} times")
    sources = []
    for path in paths:
        if not path.is_dir() or is_sequence(path, dialect):
            sources.append(Source(path, (path,), not is_folder(path) and path.suffix.lower() == _RECORD))
            continue
        if side_by_side := sequences_in(path, dialect):
            sources.append(Source(path, side_by_side, holds_records=False))
            continue
        entries = sorted(path.iterdir())
        inside = [entry for entry in entries if entry.is_file()]
        sequences = tuple(
            entry
            for entry in entries
            if (is_sequence(entry, dialect) if entry.is_dir() else entry.suffix.lower() in HDF5_SUFFIXES)
        )
        # Only a record with its arrays: distributions cannot be compared without them, and other JSON is no record.
        records = tuple(entry for entry in inside if entry.suffix.lower() == _RECORD and arrays_beside(entry).is_file())
        if not sequences and not records and list_files(path):
            raise UnrecognisedError(f"{not_recognised(path)}; it holds no records with their arrays either")
        if not sequences and not records:
            raise MisuseError(f"Expected sequences (.h5) or records with their arrays in {path}, got neither")
        sources.append(Source(path, sequences or records, not sequences))
    for source in sources:
        if not source.holds_records:
            require_hdf5([path for path in source.paths if not is_folder(path)])
            for path in filter(is_folder, source.paths):
                require_readable(path)
        elif not source.paths[0].is_file():
            raise MisuseError(f"Expected a record at {source.path}, got no such file")
    return tuple(sources)


def read_sources(sources: Sequence[Source], reading: Reading) -> tuple[SubjectInput, ...]:
    """Read the records, and measure the other files; raises as ``measured_file``."""
    names = labels([str(source.path) for source in sources])
    count = sum(len(source.paths) for source in sources if not source.holds_records)
    subjects, done = [], 0
    for name, source in zip(names, sources, strict=True):
        files = []
        for path in source.paths:
            if source.holds_records:
                record = read_record(path)
                arrays = read_arrays(arrays_beside(path)) if arrays_beside(path).is_file() else {}
                # Names of arrays start with the number of the file, from 0, if a record holds several (`record_of`).
                has_several = len(record.files) > 1
                for i, file in enumerate(record.files):
                    kept = KeptArrays(arrays_beside(path), f"{i}/" if has_several else "")
                    sampled = sampled_counts_of(arrays, kept.prefix)
                    files.append(FileInput(file.path, file.statistics, sampled, file, kept if arrays else None))
                continue
            counted = measured_file(path, reading, with_distributions=True, place=(done, count))
            done += 1
            # As a record holds them: values that are not finite become None, which means unknown.
            statistics = {
                group: {key: None if isinstance(v, float) and not math.isfinite(v) else v for key, v in values.items()}
                for group, values in counted.statistics.items()
            }
            files.append(FileInput(str(path), statistics, sampled_counts_of(counted.arrays)))
        subjects.append(SubjectInput(name, tuple(files)))
    return tuple(subjects)


def shared_evidence_of(inputs: Sequence[SubjectInput]) -> tuple[SharedEvidence, ...]:
    """Read pictures and paths of the first files that several subjects have; raises as ``read_arrays``.

    Files of which nobody kept anything are left out.
    """
    kept = [each for each in shared_files(inputs) if any(file and file.kept for file in each.files)]
    shared = []
    for each in kept[:_MOST_SHARED]:
        arrays: list[Mapping[str, NDArray[Any]] | None] = []
        for file in each.files:
            if file is None or file.kept is None:
                arrays.append(None if file is None else {})
                continue
            prefix = file.kept.prefix
            read = read_arrays(file.kept.path, (f"{prefix}{MOMENTS}/", f"{prefix}{TRAJECTORY}/"))
            arrays.append({name.removeprefix(prefix): array for name, array in read.items()})
        shared.append(SharedEvidence(each.name, tuple(arrays)))
    return tuple(shared)

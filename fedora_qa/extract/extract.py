"""Cut the shortest piece out of a sequence that still shows a finding, which a check of the piece confirms.

A piece has some rows of the file: the same groups, attributes and links, and index maps of its own events.
"""

from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field, replace
from math import lcm
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.plan import window_length_ns
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.tasks import check_file
from fedora_qa.extract.hdf5_copy import (
    copy_attributes,
    copy_rows,
    copy_whole,
    needs_whole_chunks,
    new_dataset,
    opened_beside_its_file,
)
from fedora_qa.extract.place import MILLISECONDS, CutRows, Piece, pieces_around, place_of, rows_kept
from fedora_qa.layout.canonical import BESIDE, FRAMES_OF_MAP, datasets_of, datasets_of_all, spec_of
from fedora_qa.layout.create import DeferredErrorFile
from fedora_qa.layout.dialect import Dialect, split_choice
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.hdf5_objects import READ_ERRORS, RefusedError, find_dataset, find_object
from fedora_qa.layout.resolve import detect_dialect
from fedora_qa.record.atomic import replacing
from fedora_qa.record.types import Finding
from fedora_qa.sequence.canonical_copy import canonical_file
from fedora_qa.sequence.facts import IndexMap
from fedora_qa.sequence.scan import Scan, definition_of_map, entries_by_definition, scan
from fedora_qa.sequence.sequence import SequenceRows, open_sequence
from fedora_qa.storage.folder import is_folder

_Address = tuple[str, int]
"""The file in which an object lies, and its address there."""

_SMALL_BYTES: Final = 64 << 10
"""Largest dataset of no stream that is copied. It is copied whole: no row of it belongs to a time."""


@dataclass(frozen=True, slots=True)
class CheckFinding:
    """A finding, and the check that found it."""

    check: str
    finding: Finding


@dataclass(frozen=True, slots=True)
class Extraction:
    """What was written.

    Attributes
    ----------
    kept
        Rows by stream.
    left_out
        Datasets that belong to no stream and are too large to be copied whole, and what could not be read.
    finding
        The finding as the check of the piece reports it; None where it reports none.
    """

    kept: dict[str, CutRows]
    left_out: tuple[str, ...]
    finding: Finding | None

    @property
    def is_whole(self) -> bool:
        """Whether every row of every stream was kept."""
        return all(rows.start == 0 and rows.to_the_end for rows in self.kept.values())


def extract(
    source: Path, target: Path, wanted: CheckFinding, options: CheckOptions, longest_s: float, report: Progress
) -> Extraction:
    """Write the shortest piece that shows a finding, or the longest that was tried where none does.

    Pieces around the finding's place are written and checked, each with twice the margin of the one before, until the
    check finds the same rule broken in the same stream. The target is written entirely or not at all. A folder is
    written as one canonical file first, of which pieces are cut.

    Parameters
    ----------
    options
        How the finding was found; only the check that found it is run. Values from other files, where
        ``allow_external`` names their folders, are written into the piece. The piece is checked without these files.
    longest_s
        Length of the longest piece to try; the first is tried whatever its length.

    Raises
    ------
    MisuseError, UnreadableFileError
        As ``open_sequence``.
    """
    folders = options.allow_external
    # Without `allow_external`: the piece must show the finding by itself, on a machine that has no other files.
    options = replace(options, select=(wanted.check,), ignore=(), evidence=None, canary=False, allow_external=())
    with ExitStack() as opened:
        if is_folder(source):
            beside = target.resolve().parent
            source, dialect = opened.enter_context(canonical_file(source, options.dialect, beside, report))
            options = replace(options, dialect=dialect)
        sequence = opened.enter_context(open_sequence(source, options.dialect, allow_external=folders))
        file = opened.enter_context(h5py.File(source.resolve() if folders else source, "r", locking="best-effort"))
        external_files = opened.enter_context(closing(ExternalFiles(folders))) if folders else None
        scanned = scan(sequence, window_length_ns(sequence))
        cutter = Cutter(
            file,
            sequence,
            scanned,
            split_choice(options.dialect)[0] or detect_dialect(file, external_files),
            external_files,
        )
        place = place_of(wanted.finding.where, wanted.check, scanned)
        with replacing(target) as temporary:
            pieces = tuple(pieces_around(place, round(longest_s * NS_PER_S)))
            for number, piece in enumerate(pieces):
                report(f"a piece of {(piece.stop_ns - piece.start_ns) / NS_PER_S:.3g} s", number, len(pieces))
                kept, left_out = cutter.write(piece, temporary)
                record = check_file(temporary, options).record
                # The same rule, broken in the same stream. Place and size may differ: the piece has fewer rows, so that
                # its worst place may be another.
                same = (
                    finding
                    for result in record.results
                    for finding in result.findings
                    if result.check == wanted.check
                    and finding.code == wanted.finding.code
                    and wanted.finding.where.stream in {where.stream for where in finding.all_places}
                )
                extracted = Extraction(kept, left_out, next(same, None))
                # A piece that holds all rows cannot grow.
                if extracted.finding or extracted.is_whole:
                    break
            return extracted


class Cutter:
    """Cuts pieces out of one open file.

    Parameters
    ----------
    file, sequence
        The file, open for reading, and the sequence that it holds.
    scanned
        Its timestamps and index maps.
    dialect
        How it names things.
    external_files
        Which other files may be read; None: no other. Their values are written into the piece.
    """

    def __init__(
        self,
        file: h5py.File,
        sequence: SequenceRows,
        scanned: Scan,
        dialect: Dialect,
        external_files: ExternalFiles | None = None,
    ) -> None:
        self._file = file
        self._external_files = external_files
        self._sequence = sequence
        self._scanned = scanned
        # Every dataset of a stream that can be opened, by canonical key, also of streams that lack another dataset.
        datasets: dict[str, h5py.Dataset] = {}
        # Contiguous in the canonical layout: values of the whole file and not rows of a stream; copied whole.
        self._whole: set[_Address] = set()
        streams = {*sequence.layout.streams, *sequence.layout.absent}
        beside = (spec for stream in BESIDE for spec in datasets_of(stream))
        for spec in (*datasets_of_all(streams), *beside):
            key = spec.key
            place = dialect.place_of(key)
            if place is None:
                continue
            # Bound: its size was tested.
            is_whole = not spec.chunk_rows and key in sequence.layout.bindings
            with suppress(RefusedError):
                dataset = find_dataset(file, place.path or key, external_files)
                if dataset is not None and is_whole:
                    self._whole.add(_linked_address(dataset.file, dataset.name))
                elif dataset is not None and dataset.shape and spec.chunk_rows:
                    # External files are named relative to their own file, not to the working directory.
                    datasets[key] = opened_beside_its_file(dataset) if dataset.external else dataset
        self._datasets = datasets

    def write(self, piece: Piece, target: Path) -> tuple[dict[str, CutRows], tuple[str, ...]]:
        """Write a piece to the target, and replace a file that is there.

        Returns
        -------
        The rows that were kept, by stream, and the paths that were left out.

        Raises
        ------
        MisuseError
            The target cannot be written: for example, the disk is full.
        """
        # The datasets of a stream may differ in length: the shortest gives the number of rows.
        counts: dict[str, int] = {}
        for key, dataset in self._datasets.items():
            stream = spec_of(key).stream
            counts[stream] = min(counts.get(stream, dataset.shape[0]), dataset.shape[0])
        kept = rows_kept(piece, self._sequence, self._scanned, counts)
        # A stream with rows that cannot be decoded starts at a whole chunk, so that damage is copied.
        for stream, rows in tuple(kept.items()):
            ours = [dataset for key, dataset in self._datasets.items() if spec_of(key).stream == stream]
            if any(needs_whole_chunks(dataset, rows.start, _stop(rows, dataset)) for dataset in ours):
                # All datasets of a stream start at one row, each at a whole chunk: at a multiple of all chunk lengths.
                together = lcm(*(dataset.chunks[0] for dataset in ours if dataset.chunks))
                kept[stream] = CutRows(rows.start // together * together, rows.stop, rows.of)
        cuts: dict[_Address, _Cut] = {}
        for key, dataset in self._datasets.items():
            stream = spec_of(key).stream
            # Entries of an index map; None of everything else, and where they cannot be read.
            entries: NDArray[np.int64] | None = None
            if stream in {*FRAMES_OF_MAP, MILLISECONDS} and "events" in kept:
                rows, events = kept[stream], kept["events"]
                index_map = self._scanned.facts.maps_to_events.get(stream)
                if index_map is not None:
                    # Entries count events from the start of the file; those of the piece count from its first event.
                    stated = index_map.by_definition is not None
                    definition = definition_of_map(self._sequence, stream) if stated else ""
                    entries = entries_kept(index_map, rows, events, definition)
                else:
                    with suppress(*READ_ERRORS):
                        stored = np.asarray(dataset[rows.start : _stop(rows, dataset)]).astype(np.int64)
                        entries = _shift_entries(stored, events)
            # By address, not by path: a dataset may have several names, and the walk meets any of them first.
            cuts[_linked_address(dataset.file, dataset.name)] = _Cut(dataset, kept[stream], entries)
        with DeferredErrorFile(target, "the piece") as file:
            with h5py.File(file, "w") as copy:
                writer = _Writer(cuts, self._whole, file, self._file.filename, self._external_files)
                writer.group(self._file, copy)
            file.raise_failure()
        return kept, tuple(writer.left_out)


@dataclass(frozen=True, slots=True)
class _Cut:
    """Rows of a dataset to copy; ``entries`` replace their values where an index map counts other events."""

    dataset: h5py.Dataset
    rows: CutRows
    entries: NDArray[np.int64] | None


def _stop(rows: CutRows, dataset: h5py.Dataset) -> int:
    return int(dataset.shape[0]) if rows.to_the_end else min(rows.stop, int(dataset.shape[0]))


def _linked_address(group: h5py.Group, path: str) -> _Address:
    """Return where the object of a hard link lies, read from the link: the object itself may be damaged."""
    return group.file.filename, int(group.id.links.get_info(path.encode("utf-8", "surrogateescape")).u)


@dataclass
class _Writer:
    """Walks a file and writes the rows of a piece; an object that has several names is written once."""

    cuts: Mapping[_Address, _Cut]
    whole: Collection[_Address]
    file: DeferredErrorFile
    source: str
    external_files: ExternalFiles | None
    written: dict[_Address, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

    def group(self, source: h5py.Group, copy: h5py.Group) -> None:
        """Write the attributes and members of a group."""
        copy_attributes(source, copy)
        # Listed first: an error of listing ends the list, not the writing of what it holds.
        links: list[tuple[str, Any]] = []
        with suppress(*READ_ERRORS):
            for name in source:
                if isinstance(name, str):  # other names are bytes, no UTF-8, and in no dialect
                    links.append((name, source.get(name, getlink=True)))
        for name, link in links:
            self.file.raise_failure()
            try:
                self._member(source, copy, name, link)
            except READ_ERRORS:
                self.left_out.append(f"{source.name.rstrip('/')}/{name}")
                with suppress(*READ_ERRORS):
                    # A member written half-way would be a fault that the source does not have.
                    del copy[name]

    def _member(self, source: h5py.Group, copy: h5py.Group, name: str, link: Any) -> None:
        if isinstance(link, h5py.HardLink):
            self._object(copy, name, _linked_address(source, name), lambda: source[name])
            return
        # A link to another file cannot stay a link in the piece. Nor can a soft link within another file: its path does
        # not exist in the piece.
        leaves = isinstance(link, h5py.ExternalLink) or source.file.filename != self.source
        target: Any = None
        if self.external_files is not None and leaves:
            with suppress(RefusedError):
                target = find_object(source.file, f"{source.name}/{name}", self.external_files)
        if target is None:
            copy[name] = link
        else:
            address = target.file.filename, int(h5py.h5o.get_info(target.id).addr)
            self._object(copy, name, address, lambda: target)

    def _object(self, copy: h5py.Group, name: str, address: _Address, open_object: Callable[[], Any]) -> None:
        if address in self.written:
            copy[name] = copy.file[self.written[address]]
            return
        if address in self.cuts:
            cut = self.cuts[address]
            if cut.entries is None:
                start = min(cut.rows.start, cut.dataset.shape[0])
                copy_rows(cut.dataset, copy, name, start, max(_stop(cut.rows, cut.dataset), start))
            else:
                # The stored type stays, so that a wrong one is a fault of the piece as well.
                entries = new_dataset(cut.dataset, copy, name, len(cut.entries))
                entries[...] = cut.entries.astype(cut.dataset.dtype)
                copy_attributes(cut.dataset, entries)
            self.written[address] = f"{copy.name.rstrip('/')}/{name}"
            return
        source = open_object()
        if isinstance(source, h5py.Group):
            self.written[address] = f"{copy.name.rstrip('/')}/{name}"
            self.group(source, copy.create_group(name))
            return
        if not isinstance(source, h5py.Dataset):
            copy[name] = source.dtype
        elif source.nbytes > _SMALL_BYTES and address not in self.whole:
            self.left_out.append(source.name)
            return
        else:
            copy_whole(source, copy, name)
        self.written[address] = f"{copy.name.rstrip('/')}/{name}"


def entries_kept(index_map: IndexMap, rows: CutRows, events: CutRows, definition: str = "") -> NDArray[np.int64]:
    """Return the entries that a piece has of an index map, which count from the first event of the piece.

    The error of an entry (events) is preserved: a cut must not correct a wrong map.

    Parameters
    ----------
    rows
        The entries that are kept.
    events
        The events that are kept.
    definition
        By which the map was made (``conversions.MapDefinition``); empty for that of the layout.
    """
    # A map with fewer entries than frames stays as short in the piece.
    kept = slice(rows.start, min(rows.stop, len(index_map.expected_left)))
    left, right = (
        _shift_entries(entries[kept], events) for entries in (index_map.expected_left, index_map.expected_right)
    )
    if definition == "nearest_event":
        # Where the nearest event is not kept, the first or the last that is kept is the nearest.
        correct = np.clip(index_map.correct[kept] - events.start, 0, max(events.stop - events.start - 1, 0))
    else:
        correct = entries_by_definition(definition, left, right, events.stop - events.start)
    # entry = (correct entry in the piece) + (stored - expected): the error in events, unchanged by the cut.
    return correct + (index_map.stored[kept] - index_map.expected_left[kept])


def _shift_entries(entries: NDArray[np.int64], events: CutRows) -> NDArray[np.int64]:
    """Return correct entries as they count from the first event of the piece, limited to its number of events."""
    return np.clip(entries - events.start, 0, events.stop - events.start)

"""Write a file with some rows of another: the same groups, attributes and links, and index maps of its own events."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from math import lcm
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.extract.index_maps import entries_kept, shifted
from fedora_qa.extract.place import Piece
from fedora_qa.extract.remembering import RememberingFile
from fedora_qa.extract.rows import CutRows, rows_kept
from fedora_qa.extract.storage import (
    beside_its_file,
    copy_attributes,
    copy_rows,
    copy_whole,
    needs_whole_chunks,
    new_dataset,
)
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.layout.dialect import Dialect
from fedora_qa.layout.elsewhere import Elsewhere
from fedora_qa.layout.links import READ_ERRORS, RefusedError, find_dataset, find_object
from fedora_qa.sequence.scan import FRAMES_OF_MAP, Scan
from fedora_qa.sequence.sequence import SequenceRows

_Place = tuple[str, int]
"""The file in which an object lies, and its address there."""

_SMALL_BYTES: Final = 64 << 10
"""Longest dataset unknown to the dialect that is copied, whole: which of its rows belong to a piece is unknown."""


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
    elsewhere
        Which other files may be read; None: no other. Their values are written into the piece.
    """

    def __init__(
        self,
        file: h5py.File,
        sequence: SequenceRows,
        scanned: Scan,
        dialect: Dialect,
        elsewhere: Elsewhere | None = None,
    ) -> None:
        self._file = file
        self._elsewhere = elsewhere
        self._sequence = sequence
        self._scanned = scanned
        # Every dataset of a stream that can be opened, by canonical key, also of streams that lack another dataset.
        datasets: dict[str, h5py.Dataset] = {}
        for key, spec in DATASETS.items():
            place = dialect.place_of(key)
            # Contiguous in the canonical layout: no rows of a stream but values of the whole file, copied whole.
            if place is None or not spec.chunk_rows:
                continue
            with suppress(RefusedError):
                dataset = find_dataset(file, place.path or key, elsewhere)
                if dataset is not None and dataset.shape:
                    # External files are named relative to their own file, not to the working directory.
                    datasets[key] = beside_its_file(dataset) if dataset.external else dataset
        self._datasets = datasets

    def write(self, piece: Piece, target: Path) -> tuple[dict[str, CutRows], tuple[str, ...]]:
        """Write a piece to the target, and replace a file that is there.

        Returns
        -------
        The rows that were kept, by stream, and the paths that were left out.

        Raises
        ------
        MisuseError
            The target cannot be written: the disk is full, say.
        """
        counts = _row_counts(self._datasets)
        kept = _aligned(rows_kept(piece, self._sequence, self._scanned, counts), self._datasets)
        cuts: dict[_Place, _Cut] = {}
        for key, dataset in self._datasets.items():
            stream = DATASETS[key].stream
            # By address, not by path: a dataset may have several names, and the walk meets any of them first.
            cuts[_linked_place(dataset.file, dataset.name)] = _Cut(
                dataset, kept[stream], self._entries(stream, dataset, kept)
            )
        with RememberingFile(target) as file:
            with h5py.File(file, "w") as copy:
                writer = _Writer(cuts, file, self._file.filename, self._elsewhere)
                writer.group(self._file, copy)
            file.go_on()
        return kept, tuple(writer.left_out)

    def _entries(self, stream: str, dataset: h5py.Dataset, kept: Mapping[str, CutRows]) -> NDArray[np.int64] | None:
        """Return the kept entries of an index map; None of everything else, and where they cannot be read."""
        if stream not in FRAMES_OF_MAP or "events" not in kept:
            return None
        frames, events = kept[stream], kept["events"]
        index_map = self._scanned.facts.index_maps.get(stream)
        if index_map is not None:
            # Entries count events from the start of the file; those of the piece must count from its first event.
            return entries_kept(index_map, frames, events)
        with suppress(*READ_ERRORS):
            return shifted(np.asarray(dataset[frames.start : _stop(frames, dataset)]).astype(np.int64), events)
        return None


def _row_counts(datasets: Mapping[str, h5py.Dataset]) -> dict[str, int]:
    """Return the number of rows of each stream: that of its shortest dataset where they differ."""
    counts: dict[str, int] = {}
    for key, dataset in datasets.items():
        stream = DATASETS[key].stream
        counts[stream] = min(counts.get(stream, dataset.shape[0]), dataset.shape[0])
    return counts


def _aligned(kept: Mapping[str, CutRows], datasets: Mapping[str, h5py.Dataset]) -> dict[str, CutRows]:
    """Return the rows; a stream with rows that cannot be decoded starts at a whole chunk, so that damage is copied."""
    whole = dict(kept)
    for stream, rows in kept.items():
        ours = [dataset for key, dataset in datasets.items() if DATASETS[key].stream == stream]
        if any(needs_whole_chunks(dataset, rows.start, _stop(rows, dataset)) for dataset in ours):
            # All datasets of a stream start at one row, and each at a whole chunk: at a multiple of all chunk lengths.
            together = lcm(*(dataset.chunks[0] for dataset in ours if dataset.chunks))
            whole[stream] = CutRows(rows.start // together * together, rows.stop, rows.of)
    return whole


@dataclass(frozen=True, slots=True)
class _Cut:
    """Rows of a dataset to copy; ``entries`` replace their values where an index map counts other events."""

    dataset: h5py.Dataset
    rows: CutRows
    entries: NDArray[np.int64] | None


def _stop(rows: CutRows, dataset: h5py.Dataset) -> int:
    return int(dataset.shape[0]) if rows.to_the_end else min(rows.stop, int(dataset.shape[0]))


def _linked_place(group: h5py.Group, path: str) -> _Place:
    """Return where the object of a hard link lies, read from the link: the object itself may be damaged."""
    return group.file.filename, int(group.id.links.get_info(path.encode("utf-8", "surrogateescape")).u)


@dataclass
class _Writer:
    """Walks a file and writes the rows of a piece; an object that has several names is written once."""

    cuts: Mapping[_Place, _Cut]
    file: RememberingFile
    source: str
    elsewhere: Elsewhere | None
    written: dict[_Place, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

    def group(self, source: h5py.Group, copy: h5py.Group) -> None:
        """Write the attributes and members of a group."""
        copy_attributes(source, copy)
        for name, link in _links(source):
            self.file.go_on()
            try:
                self._member(source, copy, name, link)
            except READ_ERRORS:
                self.left_out.append(f"{source.name.rstrip('/')}/{name}")
                with suppress(*READ_ERRORS):
                    # A member written half-way would be a fault that the source does not have.
                    del copy[name]

    def _member(self, source: h5py.Group, copy: h5py.Group, name: str, link: Any) -> None:
        if isinstance(link, h5py.HardLink):
            self._object(copy, name, _linked_place(source, name), lambda: source[name])
        elif (target := self._led_to(source, name, link)) is not None:
            place = target.file.filename, int(h5py.h5o.get_info(target.id).addr)
            self._object(copy, name, place, lambda: target)
        else:
            copy[name] = link

    def _led_to(self, source: h5py.Group, name: str, link: Any) -> Any:
        """Return the target of a link that cannot stay a link in the piece, if it may be read; else None."""
        # Also soft links within another file: their paths lead nowhere in the piece.
        leaves = isinstance(link, h5py.ExternalLink) or source.file.filename != self.source
        if self.elsewhere is None or not leaves:
            return None
        with suppress(RefusedError):
            return find_object(source.file, f"{source.name}/{name}", self.elsewhere)
        return None

    def _object(self, copy: h5py.Group, name: str, address: _Place, opened: Callable[[], Any]) -> None:
        if address in self.written:
            copy[name] = copy.file[self.written[address]]
            return
        if address in self.cuts:
            self._rows(self.cuts[address], copy, name)
            self.written[address] = f"{copy.name.rstrip('/')}/{name}"
            return
        thing = opened()
        if isinstance(thing, h5py.Group):
            self.written[address] = f"{copy.name.rstrip('/')}/{name}"
            self.group(thing, copy.create_group(name))
            return
        if not isinstance(thing, h5py.Dataset):
            copy[name] = thing.dtype
        elif thing.nbytes > _SMALL_BYTES:
            self.left_out.append(thing.name)
            return
        else:
            copy_whole(thing, copy, name)
        self.written[address] = f"{copy.name.rstrip('/')}/{name}"

    def _rows(self, cut: _Cut, copy: h5py.Group, name: str) -> None:
        dataset = cut.dataset
        if cut.entries is None:
            start = min(cut.rows.start, dataset.shape[0])
            copy_rows(dataset, copy, name, start, max(_stop(cut.rows, dataset), start))
            return
        # The stored type stays, so that a wrong one is a fault of the piece as well.
        entries = new_dataset(dataset, copy, name, len(cut.entries))
        entries[...] = cut.entries.astype(dataset.dtype)
        copy_attributes(dataset, entries)


def _links(group: h5py.Group) -> Iterator[tuple[str, Any]]:
    """Yield the members of a group that can be listed, by name, with how each is linked."""
    with suppress(*READ_ERRORS):
        for name in group:
            if isinstance(name, str):  # other names are bytes, no UTF-8, and in no dialect
                yield name, group.get(name, getlink=True)

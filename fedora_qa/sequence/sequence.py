"""Open a sequence: read-only, lazy, in canonical units."""

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from math import prod
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Protocol, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.errors import UnreadableFileError, UnreadableRowsError, first_line
from fedora_qa.layout.binding import Binding, Opened, canonical_rows, instant_ns, raw_rows
from fedora_qa.layout.canonical import is_timed, timestamps_of
from fedora_qa.layout.dialect import DialectChoice, split_choice
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.folder import OpenFolder, matched_folder
from fedora_qa.layout.hdf5_objects import RefusedError
from fedora_qa.layout.resolve import Layout, resolve, unrecognised
from fedora_qa.record.notebook import html_table, html_text
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.read_declared import read_declared
from fedora_qa.storage.folder import Version, is_folder
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.remote_bytes import BLOCK_BYTES, RemoteBytes
from fedora_qa.storage.server import NO_TRAFFIC, Traffic, version_of
from fedora_qa.storage.signature import require_signature, require_signature_in

_NO_CHUNKS: Final = 0
"""Bytes of chunks that HDF5 keeps of each dataset: callers read whole chunks and keep them."""

_FIRST_ROWS: Final = 5
"""Rows that tell a damaged first timestamp from a good one: a majority of three outvotes two damaged ones."""

_LONGEST_PAUSE_NS: Final = 86_400 * NS_PER_S
"""A day, ns: no recording pauses for longer between its first samples, of a stream or of all of them."""

_BLOCK_ROWS: Final = 1 << 18
"""Rows that are read together: a few MB of events."""


class SequenceRows(Protocol):
    """Interface to the rows of a sequence: a file (``Sequence``, which describes each member), or a view of one."""

    @property
    def layout(self) -> Layout:
        """Paths of the datasets."""
        ...

    @property
    def declared(self) -> Declared:
        """Declarations of the metadata."""
        ...

    @property
    def origin_ns(self) -> int:
        """The file's origin on its own clock, ns."""
        ...

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows of a dataset in canonical units; timestamps as int64 ns from the origin.

        Returns
        -------
        ndarray
            (stop - start, ...).

        Raises
        ------
        UnreadableRowsError
            The rows cannot be decoded.
        """
        ...

    def chunk_rows(self, key: str) -> int:
        """Return how many rows are stored together."""
        ...


def row_blocks(count: int) -> Iterator[tuple[int, int]]:
    """Yield the first row of each block, and the row after its last."""
    for start in range(0, count, _BLOCK_ROWS):
        yield start, min(start + _BLOCK_ROWS, count)


def file_times_us(sequence: SequenceRows, key: str, start: int, stop: int) -> NDArray[np.int64]:
    """Return timestamps in us on the clock of the file, rounded down, so that their order stays."""
    times_ns: NDArray[np.int64] = sequence.rows(key, start, stop)
    # The origin may lie far away and need not be whole us: both parts are divided before they are added.
    whole_us, rest_ns = divmod(sequence.origin_ns, NS_PER_US)
    return whole_us + (times_ns + rest_ns) // NS_PER_US


@dataclass(frozen=True, slots=True)
class OpeningFacts:
    """Results of opening a file, for opening the same version again.

    Attributes
    ----------
    layout
        Paths of the datasets, with defects of the layout.
    declared
        Declarations of the metadata.
    origin_ns
        The file's origin on its own clock, ns.
    """

    layout: Layout
    declared: Declared
    origin_ns: int


class Sequence:
    """An open file. Use as a context manager; it never writes.

    Attributes
    ----------
    path
        The file, or the folder of several.
    version
        Version of the file that was opened.
    layout
        Paths of the datasets, and defects of the layout.
    declared
        What the metadata declare.
    origin_ns
        The file's origin on its own clock: the earliest first timestamp of any stream, damaged ones left out.
    """

    def __init__(
        self,
        path: Place,
        file: h5py.File | OpenFolder | None,
        dialect: DialectChoice,
        remote: RemoteBytes | None = None,
        opening_facts: OpeningFacts | None = None,
        external_files: ExternalFiles | None = None,
    ) -> None:
        self.path = path
        self._file = file
        self._remote = remote
        self._external_files = external_files
        self._opened: Opened | None = {} if external_files is None else None  # other files are closed and opened again
        self.version: Version = remote.version if remote else version_of(path)
        if opening_facts:
            self.layout: Layout = opening_facts.layout
            self.declared: Declared = opening_facts.declared
        elif file is None:
            # A folder that fits no dialect holds nothing that could be read.
            self.layout, self.declared = unrecognised(str(path)), Declared()
        else:
            self.layout = resolve(file, dialect, external_files)
            self.declared = read_declared(file, self.layout, external_files)
        self.origin_ns: int = opening_facts.origin_ns if opening_facts else 0
        if not opening_facts:
            # The earliest first timestamp, so that times of correct streams are not negative. A stream on another clock
            # would take the others years from the origin.
            streams = filter(is_timed, self.layout.streams)
            firsts_ns = sorted(first for first in map(self._first_ns, streams) if first is not None)
            usual_ns = firsts_ns[len(firsts_ns) // 2] if firsts_ns else 0
            near = (first for first in firsts_ns if abs(first - usual_ns) < _LONGEST_PAUSE_NS)
            self.origin_ns = min(near, default=0)
        self._require_sound()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        streams = ", ".join(sorted(self.layout.streams)) or "no streams"
        return f"{self.path}: {streams}, in the dialect {self.layout.dialect_name}"

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: each dataset with its place, shape and stored type."""
        rows = [
            (key, binding.path, " x ".join(map(str, binding.shape)), str(binding.dtype))
            for key, binding in self.layout.bindings.items()
        ]
        return f"<p><b>{html_text(repr(self))}</b></p>{html_table(('dataset', 'found at', 'shape', 'type'), rows)}"

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
        if self._external_files:
            self._external_files.close()
        if self._remote:
            self._remote.close()

    @property
    def opening_facts(self) -> OpeningFacts:
        """Results of opening the file."""
        return OpeningFacts(self.layout, self.declared, self.origin_ns)

    @property
    def traffic(self) -> Traffic:
        """Requests to a server so far."""
        return self._remote.traffic if self._remote else NO_TRAFFIC

    def require_unchanged(self) -> None:
        """Raise ``StorageError`` where a file behind a URL cannot be read, or has changed since it was opened."""
        if self._remote:
            self._remote.require_unchanged()

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows of a dataset in canonical units, as ``SequenceRows.rows``; timestamps as int64 ns.

        Raises
        ------
        UnreadableRowsError
            The rows cannot be decoded.
        StorageError
            The server does not return the rows; this is no defect of the file.
        """
        try:
            binding = self.layout.bindings[key]
            return canonical_rows(self._holding(binding), binding, start, stop, self.origin_ns, self._opened)
        except UnreadableRowsError:
            self._require_sound()
            raise

    def raw_rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows of a dataset as stored; parameters and errors as of ``rows``."""
        try:
            binding = self.layout.bindings[key]
            return raw_rows(self._holding(binding), binding, start, stop, self._opened)
        except UnreadableRowsError:
            self._require_sound()
            raise

    def chunk_rows(self, key: str) -> int:
        """Return the number of rows that are stored, and so decoded, together; about 1 MiB where storage sets none."""
        binding = self.layout.bindings[key]
        if binding.chunk_rows:
            return binding.chunk_rows
        # No readable type has more than 8 bytes (``dataset_binder._require_readable_type``).
        row_bytes = 8 * prod(binding.shape[1:])
        return max(1, (1 << 20) // max(row_bytes, 1))

    def _first_ns(self, stream: str) -> int | None:
        """Return the first timestamp of a stream on the file's own clock, ns; None without a finite one.

        A first timestamp more than ``_LONGEST_PAUSE_NS`` from those behind it is passed over.
        """
        key = timestamps_of(stream)
        binding = self.layout.bindings[key]
        try:
            rows = self.raw_rows(key, 0, min(_FIRST_ROWS, binding.rows))
        except UnreadableRowsError:
            return None
        # Intervals of flow have a start and an end.
        starts = rows[:, 0] if rows.ndim > 1 else rows
        instants = (instant_ns(start, binding) for start in starts)
        finite = [instant for instant in instants if instant is not None]
        usual_ns = sorted(finite)[len(finite) // 2] if finite else 0
        return next((instant for instant in finite if abs(instant - usual_ns) < _LONGEST_PAUSE_NS), None)

    def _holding(self, binding: Binding) -> h5py.File | None:
        file = self._file.hdf5.get(binding.role) if isinstance(self._file, OpenFolder) else self._file
        if self._external_files is None or file is None or binding.outside is not None:
            return file
        try:
            return self._external_files.holding(file, binding)
        except (RefusedError, OSError) as error:
            raise UnreadableRowsError(binding.key, 0, binding.rows, str(error)) from error

    def _require_sound(self) -> None:
        """Raise the error that ended the reading of a file behind a URL: HDF5 reports it as damage."""
        if self._remote:
            self._remote.require_sound()


def open_sequence(
    path: Place,
    dialect: DialectChoice = None,
    opening_facts: OpeningFacts | None = None,
    allow_external: Iterable[Path] = (),
) -> Sequence:
    """Open a file, or a folder of files that are one sequence, for reading.

    Parameters
    ----------
    path
        An HDF5 file, on this machine or behind a URL; or a folder on this machine.
    dialect
        The dialect of the sequence, and what is declared beside it; None: as it is recognised.
    opening_facts
        Results of opening this version of the file before. The caller ensures that the version is the same.
    allow_external
        Folders with other files that a local file may link to, or consist of; none if empty.

    Returns
    -------
    Sequence
        Open until it is closed.

    Raises
    ------
    MisuseError
        There is no such file, or it may not be read; or a folder does not fit the dialect that was named.
    NotHdf5Error
        The file is not HDF5.
    UnreadableFileError
        The file begins like HDF5 and cannot be opened.
    """
    if isinstance(path, RemoteFile):
        # HDF5 reads through Python: its own drivers for servers are seldom built in.
        with ExitStack() as opened:
            remote = opened.enter_context(closing(RemoteBytes(path, BLOCK_BYTES)))
            require_signature_in(path, remote)
            try:
                file = opened.enter_context(h5py.File(remote, "r", rdcc_nbytes=_NO_CHUNKS))
            except OSError as error:
                # HDF5 reports a failed request as damage, so that the failure of the server takes precedence.
                remote.require_sound()
                raise UnreadableFileError(f"Expected a complete HDF5 file, got: {first_line(error)}") from error
            sequence = Sequence(path, file, dialect, remote, opening_facts)
            # From here on ``Sequence.close`` closes both.
            opened.pop_all()
            return sequence
    if is_folder(path):
        return _open_folder(path, dialect, opening_facts, tuple(allow_external))
    require_signature(path)
    external_files = ExternalFiles(folders) if (folders := tuple(allow_external)) else None
    try:  # HDF5 searches linked files beside the name under which this one is opened
        name = os.path.realpath(path) if external_files else path
        file = h5py.File(name, "r", locking="best-effort", rdcc_nbytes=_NO_CHUNKS)
    except OSError as error:
        raise UnreadableFileError(f"Expected a complete HDF5 file, got: {first_line(error)}") from error
    try:
        return Sequence(path, file, dialect, opening_facts=opening_facts, external_files=external_files)
    # Also on an interrupt: an open file keeps its lock.
    except BaseException:
        file.close()
        if external_files:
            external_files.close()
        raise


def _open_folder(
    folder: Path, choice: DialectChoice, opening_facts: OpeningFacts | None, allow_external: tuple[Path, ...]
) -> Sequence:
    matched = matched_folder(folder, split_choice(choice)[0])
    if matched is None:
        return Sequence(folder, None, choice, opening_facts=opening_facts)
    external_files = ExternalFiles(allow_external) if allow_external else None
    opened = OpenFolder(matched, rdcc_nbytes=_NO_CHUNKS)
    try:
        return Sequence(folder, opened, choice, opening_facts=opening_facts, external_files=external_files)
    except BaseException:
        opened.close()
        if external_files:
            external_files.close()
        raise

"""Copy a file, and rewrite in the copy only what a repair alters, block by block.

All else keeps its bytes: the copy is one of bytes, and of altered datasets only the chunks are written that hold an
altered value.
"""

import hashlib
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import NotRepairableError, UnreadableRowsError
from fedora_qa.layout.binding import Binding
from fedora_qa.layout.bitshuffle import require_sound_blocks
from fedora_qa.layout.canonical import spec_of
from fedora_qa.layout.links import READ_ERRORS
from fedora_qa.layout.resolve import Layout
from fedora_qa.layout.walk import walk
from fedora_qa.repairs.stored_values import replace_values
from fedora_qa.sequence.sequence import SequenceRows

_BLOCK_BYTES: Final = 4 << 20
"""Decoded bytes of a dataset that are in memory at once, but for the rows from which an alteration takes them."""

_NAMED: Final = 3
"""Datasets that a message names."""

Report = Callable[[str, int, int], None]
"""Called with the present activity, the amount done, and the total amount."""


@dataclass(frozen=True, slots=True)
class DatasetChange:
    """What a repair altered in one dataset.

    Attributes
    ----------
    path
        In the file.
    rows
        Number of rows of which a stored value was altered.
    removed
        Number of rows that the dataset has lost.
    """

    path: str
    rows: int
    removed: int


def copy_bytes(source: Path, target: Path) -> str:
    """Copy a file, and return the SHA-256 of all its bytes."""
    digest = hashlib.sha256()
    with source.open("rb") as read, target.open("wb") as written:
        while block := read.read(_BLOCK_BYTES):
            digest.update(block)
            written.write(block)
    return digest.hexdigest()


def open_copy(path: Path) -> h5py.File:
    """Open a copy for writing; raises ``NotRepairableError`` where HDF5 does not, as with one that was never closed."""
    with writing(path.name):
        return h5py.File(path, "r+", locking=False)


@contextmanager
def writing(what: str) -> Iterator[None]:
    """Turn what h5py raises when it cannot write into a ``NotRepairableError``."""
    try:
        yield
    except READ_ERRORS as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise NotRepairableError(f"Expected HDF5 to write {what} of the copy, got: {reason}") from error


def require_whole(file: h5py.File) -> None:
    """Raise ``NotRepairableError`` where a file consists of other files too: links of the copy might lead elsewhere."""

    def name_of_outside(name: bytes, link: h5py.h5l.LinkInfo) -> str | None:
        return name.decode("utf-8", "replace") if link.type == h5py.h5l.TYPE_EXTERNAL else None

    try:
        outside: str | None = file.id.links.visit(name_of_outside, info=True)
    except READ_ERRORS as error:
        raise NotRepairableError(f"Expected links that can be read, got: {error}") from error
    for path in () if outside else walk(file).paths:
        dataset = file[path]
        outside = path if dataset.is_virtual or dataset.external else outside
    if outside:
        raise NotRepairableError(
            f"Expected a file that holds all its data, got {outside} of another file; copy it into this one"
        )


def require_known_rows(file: h5py.File, layout: Layout, streams: Collection[str]) -> None:
    """Raise ``NotRepairableError`` where rows move and no dialect describes what belongs to them.

    These are further columns of its tables, and datasets beside its own that have as many rows; they would stay.
    """
    own = [binding for key, binding in layout.bindings.items() if spec_of(key).stream in streams]
    unknown = []
    columns: dict[str, set[int]] = defaultdict(set)
    for binding in own:
        if binding.columns is not None:
            columns[binding.path] |= set(binding.columns)
    for path, places in columns.items():
        # A grey image, which has no axis of columns, is read three times.
        shape = file[path].shape
        if len(places) < shape[-1] and not (len(places) == 1 and len(shape) == 3):
            unknown.append(f"further columns of {path}")
    bound = {binding.path for binding in layout.bindings.values()}
    own_places = {(binding.path.rpartition("/")[0], binding.rows) for binding in own}
    for path in walk(file).paths:
        shape = file[path].shape
        if path not in bound and shape and (path.rpartition("/")[0], shape[0]) in own_places:
            unknown.append(path)
    if unknown:
        more = f" and {len(unknown) - _NAMED} more" if len(unknown) > _NAMED else ""
        raise NotRepairableError(
            f"Expected rows whose every part is known, got {', '.join(unknown[:_NAMED])}{more}, which would stay "
            "behind; name them in a dialect, or leave them out"
        )


def rewrite(
    source: h5py.File,
    plain: SequenceRows,
    repaired: SequenceRows,
    keys: Collection[str],
    target: h5py.File | None,
    report: Report,
) -> tuple[DatasetChange, ...]:
    """Write the rows of some datasets as a view of the sequence gives them.

    Parameters
    ----------
    source, plain
        The file, and its sequence.
    repaired
        The sequence without the faults.
    keys
        Canonical keys of the datasets that may differ.
    target
        A copy of ``source``, open for writing; None: nothing is written, and the result states what would be.

    Raises
    ------
    NotRepairableError
        A stored type cannot hold the values, some rows cannot be decoded, or a dataset cannot be shortened.
    """
    by_path: dict[str, list[str]] = defaultdict(list)  # columns of one table are several canonical datasets
    for key in plain.layout.bindings:
        if key in keys:
            by_path[plain.layout.bindings[key].path].append(key)
    rewritten = []
    for path, together in by_path.items():
        bindings = [plain.layout.bindings[key] for key in together]
        old_rows, new_rows = bindings[0].rows, repaired.layout.bindings[together[0]].rows
        altered = 0
        for start, stop in _blocks(bindings[0], new_rows):
            report(f"repairing {path}", start, new_rows)
            try:
                # First, because it verifies chunks before HDF5 decodes them.
                canonical = [repaired.rows(key, start, stop) for key in together]
            except UnreadableRowsError as error:
                raise NotRepairableError(str(error)) from error
            try:
                require_sound_blocks(source[path], start, stop)
                stored = np.asarray(source[path][start:stop])
            except READ_ERRORS as error:
                raise NotRepairableError(f"Expected {path} to be readable, got: {error}") from error
            block = stored.copy()
            for binding, rows in zip(bindings, canonical, strict=True):
                replace_values(block, binding, rows, plain.origin_ns)
            changed = _changed_rows(stored, block)
            altered += len(changed)
            if target is not None:
                chunk = bindings[0].stored_chunk[0] if bindings[0].stored_chunk else 1
                with writing(path):
                    for first, last in _runs(changed, start, stop, chunk):
                        target[path][start + first : start + last] = block[first:last]
        if target is not None and new_rows < old_rows:
            with writing(path):
                _shorten(target, path, new_rows)
        if altered or new_rows < old_rows:
            rewritten.append(DatasetChange(path, altered, old_rows - new_rows))
    return tuple(rewritten)


def _blocks(binding: Binding, rows: int) -> Iterator[tuple[int, int]]:
    """Yield the first row of each block and the row after its last; blocks hold whole chunks."""
    # As much as the canonical values take, whose numbers have 8 bytes at most.
    fitting = max(_BLOCK_BYTES // (8 * max(prod(binding.shape[1:]), 1)), 1)
    chunk = binding.stored_chunk[0] if binding.stored_chunk else 1
    step = max(fitting // chunk, 1) * chunk
    for start in range(0, rows, step):
        yield start, min(start + step, rows)


def _changed_rows(old: NDArray[Any], new: NDArray[Any]) -> NDArray[np.int64]:
    """Return the rows (m,) in which any byte differs: NaN equals NaN, and -0 differs from 0."""
    old_bytes, new_bytes = (np.ascontiguousarray(rows).reshape(len(rows), -1).view(np.uint8) for rows in (old, new))
    return np.flatnonzero(np.any(old_bytes != new_bytes, axis=1))


def _runs(changed: NDArray[np.int64], start: int, stop: int, chunk: int) -> list[tuple[int, int]]:
    """Return the runs of rows to write, from ``start`` on: whole chunks, each of which holds a changed row."""
    if not len(changed):
        return []
    chunks = np.unique((start + changed) // chunk)
    runs = np.split(chunks, np.flatnonzero(np.diff(chunks) > 1) + 1)
    return [(int(run[0]) * chunk - start, min((int(run[-1]) + 1) * chunk, stop) - start) for run in runs]


def _shorten(file: h5py.File, path: str, rows: int) -> None:
    """Cut off the last rows of a dataset. One in contiguous storage is written anew, as HDF5 cannot shorten it."""
    dataset = file[path]
    if dataset.chunks:
        dataset.resize(rows, axis=0)
        return
    if h5py.h5o.get_info(dataset.id).rc > 1:
        raise NotRepairableError(f"Expected {path} to have one name, to be written anew without rows, got several")
    parent, name = dataset.parent, dataset.name.rpartition("/")[2]
    space = h5py.h5s.create_simple((rows, *dataset.shape[1:]))
    shorter = h5py.Dataset(
        h5py.h5d.create(parent.id, None, dataset.id.get_type(), space, dataset.id.get_create_plist())
    )
    binding_rows = max(_BLOCK_BYTES // max(dataset.dtype.itemsize * prod(dataset.shape[1:]), 1), 1)
    for start in range(0, rows, binding_rows):
        stop = min(start + binding_rows, rows)
        shorter[start:stop] = dataset[start:stop]
    for attribute in dataset.attrs:
        old = dataset.attrs.get_id(attribute)
        new = h5py.h5a.create(shorter.id, attribute.encode(), old.get_type(), old.get_space())
        values = np.empty(old.shape, old.dtype)
        old.read(values, mtype=old.get_type())
        new.write(values, mtype=old.get_type())
    del parent[name]
    parent[name] = shorter

"""Copy a file, and rewrite in the copy only what a repair alters: rows, block by block, and declarations.

All else keeps its bytes: the copy is one of bytes, and of altered datasets only the chunks are written that hold an
altered value. Stored values are the inverse of ``layout.binding``, which is refused where it does not exist.
"""

import hashlib
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US, POLARITY_BRIGHTER, POLARITY_DARKER
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import NotRepairableError, UnreadableRowsError, first_line
from fedora_qa.layout.binding import POLARITY_CODES, Binding, canonical_values, selected_columns, timestamps_ns
from fedora_qa.layout.canonical import ATTRIBUTES, spec_of
from fedora_qa.layout.conversions import MAP_DEFINITIONS
from fedora_qa.layout.decodable import require_sound_blocks
from fedora_qa.layout.hdf5_objects import READ_ERRORS, walk
from fedora_qa.layout.members import array_of_members, put_members
from fedora_qa.layout.metadata import Supplied
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.attributes import MalformedError, read_attribute
from fedora_qa.sequence.declared import Declared, declared_attributes
from fedora_qa.sequence.sequence import SequenceRows

_RESOLUTION_NS: Final = NS_PER_US // 2
"""Rounding error of a timestamp that the format has itself: half of its microsecond."""

_EXACT_NS: Final = 1 << 53
"""Whole numbers below it are exact in float64."""

_BLOCK_BYTES: Final = 4 << 20
"""Decoded bytes of a dataset that are in memory at once, but for the rows from which an alteration takes them."""

_NAMED: Final = 3
"""Datasets that a message names."""


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
        raise NotRepairableError(f"Expected HDF5 to write {what} of the copy, got: {first_line(error)}") from error


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

    These are further columns or members of its tables, and datasets beside its own that have as many rows; they would
    stay.
    """
    own = [binding for key, binding in layout.bindings.items() if spec_of(key).stream in streams]
    unknown = []
    columns: dict[tuple[str, tuple[int, ...]], set[int]] = defaultdict(set)
    members: dict[str, set[str]] = defaultdict(set)
    for binding in own:
        if binding.columns is not None:
            columns[binding.path, binding.shape] |= set(binding.columns)
        if binding.members:
            members[binding.path] |= set(binding.members)
    for (path, shape), places in columns.items():
        # A grey image, which has no axis of columns, is read three times.
        if len(places) < shape[-1] and not (len(places) == 1 and len(shape) == 3):
            unknown.append(f"further columns of {path}")
    for path, names in members.items():
        if further := [name for name in file[path].dtype.names if name not in names]:
            unknown.append(f"{further[0]} of {path}")
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
    report: Progress,
) -> tuple[DatasetChange, ...]:
    """Write the rows of some datasets as a view of the sequence gives them.

    Parameters
    ----------
    source, plain
        The file, and its sequence.
    repaired
        The sequence without the faults.
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
    block_rows = max(_BLOCK_BYTES // max(dataset.dtype.itemsize * prod(dataset.shape[1:]), 1), 1)
    for start in range(0, rows, block_rows):
        stop = min(start + block_rows, rows)
        shorter[start:stop] = dataset[start:stop]
    for attribute in dataset.attrs:
        old = dataset.attrs.get_id(attribute)
        new = h5py.h5a.create(shorter.id, attribute.encode(), old.get_type(), old.get_space())
        values = np.empty(old.shape, old.dtype)
        old.read(values, mtype=old.get_type())
        new.write(values, mtype=old.get_type())
    del parent[name]
    parent[name] = shorter


def replace_values(stored: NDArray[Any], binding: Binding, canonical: NDArray[Any], origin_ns: int) -> None:
    """Put canonical values into stored rows. Values that are already those keep their bits.

    Parameters
    ----------
    stored
        (n, ...) rows as stored, with all columns; altered in place.
    binding
        Which columns they are, and how they are converted.
    canonical
        (n, ...) what is to be read from them; timestamps as ns from ``origin_ns``.
    origin_ns
        On the clock of the file, ns.

    Raises
    ------
    NotRepairableError
        The stored type cannot hold the values: out of range, NaN as an integer, or rounded more than is allowed.
        Timestamps may be rounded to the microsecond of the format, floating-point values to their stored type.
    """
    current = selected_columns(stored, binding)
    same = _equal(canonical_values(current, binding, origin_ns), canonical)
    if np.all(same):
        return
    # Rows that were the same may hold what the conversion refuses, such as a damaged timestamp. A value that is
    # converted anyway takes their place.
    changed = canonical[~same]
    converted = current.copy()
    converted[~same] = _converted(changed, binding, origin_ns)
    table = array_of_members(stored, binding.members) if binding.members else stored
    if binding.columns is None:
        table[...] = converted
    elif not spec_of(binding.key).has_columns:
        table[..., binding.columns[0]] = converted
    elif table.ndim < len(spec_of(binding.key).shape):
        table[...] = converted[..., 0]  # a grey image: one channel, read three times
    else:
        table[..., list(binding.columns)] = converted
    if binding.members:
        put_members(stored, binding.members, table)
    # The proof of the inverse is that what is read is what was to be read.
    read = canonical_values(selected_columns(stored, binding), binding, origin_ns)[~same]
    if not np.all(_near(read, changed, binding)):
        raise _refused(binding, "more rounding than the repaired values allow, or columns that share one stored value")


def _converted(values: NDArray[Any], binding: Binding, origin_ns: int) -> NDArray[Any]:
    """Return canonical values (m,) in the stored unit and type."""
    dtype = binding.dtype
    # The definition of a map states the meaning of its entries and does not convert them.
    if binding.conversion is not None and binding.conversion.name not in MAP_DEFINITIONS:
        raise _refused(binding, "values that its dialect does not convert")
    if binding.ns_per_unit is not None:
        unit, origin = binding.ns_per_unit, origin_ns - binding.offset_ns
        if dtype.kind == "f":
            # Up to 2^53 ns one division is rounded once. Beyond, the fraction of a unit is rounded, finer than the
            # sum. Far from zero the rounding of the origin, which ``timestamps_ns`` subtracts, must cancel.
            total_ns = values + origin
            whole, rest_ns = np.divmod(total_ns, unit)
            is_exact = np.abs(total_ns) < _EXACT_NS
            nearest = np.where(is_exact, total_ns / unit, whole + rest_ns / unit).astype(dtype)
            anchored = np.asarray(origin / unit + values / unit).astype(dtype)
            return np.where(timestamps_ns(nearest, binding, origin_ns) == values, nearest, anchored)
        # t = units * unit + rest: the fraction of a unit alone is rounded, halves upwards, so that one offset moves all
        # timestamps by one number of units.
        units, rest = divmod(origin, unit)
        return _whole(units + (values + rest + unit // 2) // unit, binding)
    if binding.key == "path/events/p":
        brighter, darker = POLARITY_CODES[binding.polarity]
        if not np.all((values == POLARITY_BRIGHTER) | (values == POLARITY_DARKER)):
            raise _refused(binding, "polarities that the dialect does not define")
        return _whole(np.where(values == POLARITY_BRIGHTER, brighter, darker), binding)
    if np.dtype(spec_of(binding.key).dtype).kind in "iu":
        return _whole(values, binding)
    numbers = values.astype(np.float64) / binding.scale
    if dtype.kind == "f":
        with np.errstate(over="ignore"):  # what the type cannot hold becomes infinite, and is not read as wanted
            return numbers.astype(dtype)
    if not np.all(np.isfinite(numbers)):
        raise _refused(binding, "NaN or infinity")
    return _whole(np.rint(numbers), binding)


def _whole(values: NDArray[Any], binding: Binding) -> NDArray[Any]:
    if binding.dtype.kind == "f":
        with np.errstate(over="ignore"):
            return values.astype(binding.dtype)
    limits = (0, 1) if binding.dtype.kind == "b" else (np.iinfo(binding.dtype).min, np.iinfo(binding.dtype).max)
    lowest, highest = values.min(), values.max()
    if lowest < limits[0] or highest > limits[1]:
        raise _refused(binding, f"numbers from {lowest} to {highest}")
    return values.astype(binding.dtype)


def _near(read: NDArray[Any], wanted: NDArray[Any], binding: Binding) -> NDArray[np.bool_]:
    """Return which values (m,) are read as wanted, but for the rounding that is allowed."""
    equal = _equal(read, wanted)
    canonical = np.dtype(spec_of(binding.key).dtype)
    if binding.ns_per_unit is not None:
        return np.asarray(equal | (np.abs(read - wanted) <= _RESOLUTION_NS))
    if canonical.kind != "f":
        return equal
    coarser = max(
        (np.finfo(d) for d in (canonical, binding.dtype) if d.kind == "f"), key=lambda about: float(about.eps)
    )
    with np.errstate(invalid="ignore"):  # inf - inf; equal ones are near already
        # Two roundings of half a step each: to the stored type, and of the product with the scale.
        allowed = float(coarser.eps) * np.abs(wanted) + float(coarser.smallest_subnormal) * abs(binding.scale)
        return np.asarray(equal | (np.abs(read - wanted) <= allowed))


def _equal(first: NDArray[Any], second: NDArray[Any]) -> NDArray[np.bool_]:
    equal: NDArray[np.bool_] = np.equal(first, second)
    # NaN does not equal itself.
    return equal | np.asarray(np.isnan(first) & np.isnan(second)) if first.dtype.kind == "f" else equal


def _refused(binding: Binding, values: str) -> NotRepairableError:
    return NotRepairableError(f"Expected {binding.path} to hold the repaired values, got {binding.dtype} for {values}")


@dataclass(frozen=True, slots=True)
class Declaration:
    """An attribute and its new value.

    Attributes
    ----------
    owner
        Path of the object that carries it, as in the layout.
    name
        Of the attribute.
    value
        In the type of its kind.
    """

    owner: str
    name: str
    value: Any


def changed_declarations(
    before: Declared, after: Declared, supplied: Mapping[str, Supplied]
) -> tuple[Declaration, ...]:
    """Return the declarations that differ, in the order of the layout.

    Raises
    ------
    NotRepairableError
        One differs that lies in no attribute of the layout, or that the file does not make itself.
    """
    old, new = declared_attributes(before), declared_attributes(after)
    changed = {place for place, value in new.items() if place not in old or not np.array_equal(old[place], value)}
    unknown = [f"{owner}.{name}" for owner, name in changed - ATTRIBUTES.keys()]
    if unknown or before.depth_range_m != after.depth_range_m:
        raise NotRepairableError(
            f"Expected declarations that are attributes, got {', '.join(unknown) or 'a range of depth'}"
        )
    # What is supplied takes precedence over what would be written into the file.
    for owner, name in ATTRIBUTES:
        if (owner, name) in changed and (made := supplied.get(f"{owner}/{name}".lstrip("/"))):
            raise NotRepairableError(
                f"Expected declarations that the file makes itself, got {owner or '/'}.{name} by {made.origin}; change "
                f"it to {np.asarray(new[owner, name]).tolist()} there, or leave the diagnosis out with --only"
            )
    return tuple(Declaration(owner, name, new[owner, name]) for owner, name in ATTRIBUTES if (owner, name) in changed)


def write_declaration(file: h5py.File, layout: Layout, declaration: Declaration) -> None:
    """Write one declaration, in the stored type where that is a floating-point number.

    Raises
    ------
    NotRepairableError
        The stored type cannot hold it, or the value is none that the layout allows.
    """
    owner, name, value = declaration.owner, declaration.name, declaration.value
    binding = layout.bindings.get(owner)
    path = (binding.path if binding else owner) or "/"
    holder = file[path] if path in file else file.create_group(path)
    attributes = holder.attrs
    # As an array, not as an open attribute: of one that is open HDF5 would keep the old value when it is replaced.
    old = np.asarray(attributes[name]) if name in attributes else None
    if old is not None and old.dtype.kind == "f" and old.size == np.size(value):
        attributes.modify(name, np.asarray(value, old.dtype).reshape(old.shape))
    else:
        attributes[name] = value
    try:
        read = read_attribute(holder, ATTRIBUTES[owner, name])
    except MalformedError as error:
        raise NotRepairableError(f"Expected {path} to hold {name} = {value}, got: {error}") from error
    is_number = isinstance(value, float | np.ndarray)
    # Six digits: what single precision holds.
    if not (np.allclose(read, value, rtol=1e-6, atol=0) if is_number else read == value):
        raise NotRepairableError(f"Expected {path} to hold {name} = {value}, got {read} in the stored type")

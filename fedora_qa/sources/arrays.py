"""Arrays of NumPy: NPY, read through the memory of the file, and arrays in NPZ, decoded as a whole.

Many arrays are one dataset, in the order of the numbers in their names: a row each, or end to end.
"""

import zipfile
import zlib
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import lru_cache
from itertools import accumulate
from math import prod
from pathlib import Path
from tokenize import TokenError
from typing import Any, Final

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from fedora_qa.sources.images import in_order
from fedora_qa.sources.source import SourceError

_HEADER_ERRORS: Final = (ValueError, TypeError, SyntaxError, EOFError, RecursionError, MemoryError, TokenError)
"""What NumPy raises over a damaged header, which it evaluates as a literal of Python."""

LARGEST_BYTES: Final = 512 << 20
"""Largest array in NPZ: a deflated array is decoded as a whole."""


@dataclass(frozen=True, slots=True)
class NpyArray:
    """One array; ``member`` names it in NPZ, and is empty for NPY."""

    path: Path
    member: str
    changed_ns: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    rows_together: int = 0

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Return a copy of rows; raises ``SourceError`` or ``OSError``."""
        if self.member:
            return _member(self.path, self.member, self.changed_ns)[start:stop].copy()
        # Opened anew each time: the array keeps no descriptor, and a file that was cut off is detected.
        return np.array(np.load(self.path, mmap_mode="r", allow_pickle=False)[start:stop])


Part = tuple[str, str]
"""A file, and the name of an array where it is NPZ."""


@dataclass(frozen=True, slots=True)
class ArrayFrames:
    """Arrays of one shape and type, a row each; ``path`` is the folder of their files."""

    path: Path
    parts: tuple[Part, ...]
    frame_shape: tuple[int, ...]
    dtype: np.dtype[Any]
    rows_together: int = 1

    @property
    def shape(self) -> tuple[int, ...]:
        """(n, ...)."""
        return (len(self.parts), *self.frame_shape)

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Read arrays; raises ``SourceError`` or ``OSError``."""
        read = np.empty((stop - start, *self.frame_shape), self.dtype)
        for row in range(start, stop):
            frame = _part(self.path, self.parts[row])
            _require_form(self.parts[row], frame, self.frame_shape, self.dtype)
            read[row - start] = _values(frame)
        return read


@dataclass(frozen=True, slots=True)
class JoinedArrays:
    """Arrays end to end, such as the events of each frame; ``stops`` are the numbers of rows up to each end."""

    path: Path
    parts: tuple[Part, ...]
    stops: tuple[int, ...]
    row_shape: tuple[int, ...]
    dtype: np.dtype[Any]
    rows_together: int = 0

    @property
    def shape(self) -> tuple[int, ...]:
        """(n, ...) of all together."""
        return (self.stops[-1] if self.stops else 0, *self.row_shape)

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Return rows, which may lie in several arrays; raises ``SourceError`` or ``OSError``."""
        read = np.empty((stop - start, *self.row_shape), self.dtype)
        at = start
        while at < stop:
            number = bisect_right(self.stops, at)
            begin = self.stops[number - 1] if number else 0
            end = min(stop, self.stops[number])
            array = _part(self.path, self.parts[number])
            _require_form(self.parts[number], array, (self.stops[number] - begin, *self.row_shape), self.dtype)
            read[at - start : end - start] = _values(array)[at - begin : end - begin]
            at = end
        return read


def arrays_of(
    folder: Path, names: Iterable[str], member: str, *, is_joined: bool
) -> NpyArray | ArrayFrames | JoinedArrays | None:
    """Return the arrays of one dataset: of one file, of a file a row, or end to end.

    Parameters
    ----------
    folder, names
        The files, all NPY or all NPZ.
    member
        Name of an array in NPZ; with ``*``, ``?`` or ``[`` all that fit, in the order of the numbers in their names.
    is_joined
        Whether several arrays lie end to end; else each is a row.

    Returns
    -------
    source
        None where no array has the name.

    Raises
    ------
    SourceError, OSError
        A file cannot be read, or lacks an array that others have.
    """
    ordered = in_order(names)
    has_members = ordered[0].lower().endswith(".npz")
    is_pattern = has_members and any(sign in member for sign in "*?[")
    if len(ordered) == 1 and not is_pattern:
        return npz_array(folder / ordered[0], member) if has_members else npy_array(folder / ordered[0])
    parts: list[Part] = []
    lacking: list[str] = []
    for name in ordered:
        fits = [""]
        if has_members:
            fits = in_order(each for each in npz_names(folder / name) if fnmatchcase(each, member) or each == member)
        parts += [(name, each) for each in fits]
        lacking += [] if fits else [name]
    if parts and lacking:
        message = f"Expected {member} in each of the files, got none in {lacking[0]}"
        raise SourceError("missing_stream", "missing_stream", message)
    if not parts:
        return None
    first = _part(folder, parts[0])
    if not is_joined:
        return ArrayFrames(folder, tuple(parts), first.shape, first.dtype)
    # An array without rows has no type that counts: NumPy makes it float64.
    filled: list[tuple[Part, NpyArray]] = []
    for part in parts:
        array = _part(folder, part)
        if not array.shape:
            raise SourceError("wrong_shape", "wrong_shape", f"Expected rows in {_named(part)}, got a single number")
        if array.shape[0]:
            filled.append((part, array))
    first = filled[0][1] if filled else first
    for part, array in filled:
        _require_form(part, array, (array.shape[0], *first.shape[1:]), first.dtype)
    stops = tuple(accumulate(array.shape[0] for _, array in filled))
    return JoinedArrays(folder, tuple(part for part, _ in filled), stops, first.shape[1:], first.dtype)


def _part(folder: Path, part: Part) -> NpyArray:
    """Return one array from its header; raises ``SourceError`` or ``OSError``."""
    name, member = part
    if not member:
        return npy_array(folder / name)
    path = folder / name
    changed_ns = path.stat().st_mtime_ns
    with _decoding(path, member), zipfile.ZipFile(path) as archive:
        about = archive.getinfo(f"{member}.npy")
        with archive.open(about) as stored:
            shape, _, dtype = _header(stored)
            held = about.file_size - stored.tell()
    _require_numbers(_named(part), dtype)
    # A header can state any shape, and rows are allocated before they are decoded.
    if (stated := prod(shape) * dtype.itemsize) != held:
        message = f"Expected {stated} bytes of {_named(part)}, got {held}"
        raise SourceError("unreadable", "truncated", message)
    return NpyArray(path, member, changed_ns, tuple(map(int, shape)), dtype)


def _values(array: NpyArray) -> NDArray[Any]:
    if array.member:
        return _member(array.path, array.member, array.changed_ns)
    values: NDArray[Any] = np.load(array.path, mmap_mode="r", allow_pickle=False)
    return values


def _require_form(part: Part, array: NpyArray, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    if (array.shape, array.dtype) != (shape, dtype):
        message = f"Expected {_named(part)} as {dtype.str} {shape}, got {array.dtype.str} {array.shape}"
        raise SourceError("wrong_shape", "wrong_shape", message)


def _named(part: Part) -> str:
    return f"{part[1]} of {part[0]}" if part[1] else part[0]


def npy_array(path: Path) -> NpyArray:
    """Return an array of NPY from its header; raises ``SourceError`` or ``OSError``."""
    changed_ns, size = path.stat().st_mtime_ns, path.stat().st_size
    try:
        with path.open("rb") as file:
            shape, _, dtype = _header(file)
            start = file.tell()
    except _HEADER_ERRORS:
        raise SourceError(
            "unreadable", "corrupt_chunk", f"Expected an array of NumPy in {path.name}, got no such header"
        ) from None
    _require_numbers(path.name, dtype)
    if start + prod(shape) * dtype.itemsize > size:
        stated = prod(shape) * dtype.itemsize
        raise SourceError(
            "unreadable", "truncated", f"Expected {stated} bytes of values in {path.name}, got {size - start}"
        )
    return NpyArray(path, "", changed_ns, tuple(map(int, shape)), dtype)


def npz_names(path: Path) -> tuple[str, ...]:
    """Return the names of the arrays in NPZ; raises ``SourceError`` or ``OSError``."""
    try:
        with zipfile.ZipFile(path) as archive:
            return tuple(name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy"))
    except zipfile.BadZipFile:
        raise SourceError(
            "unreadable", "corrupt_chunk", f"Expected arrays of NumPy in {path.name}, got no NPZ"
        ) from None


def npz_array(path: Path, member: str) -> NpyArray | None:
    """Return an array of NPZ by its name, None where there is no such; raises ``SourceError`` or ``OSError``."""
    if member not in npz_names(path):
        return None
    changed_ns = path.stat().st_mtime_ns
    array = _member(path, member, changed_ns)
    return NpyArray(path, member, changed_ns, array.shape, array.dtype)


@contextmanager
def _decoding(path: Path, member: str) -> Iterator[None]:
    """Turn what a damaged NPZ raises into ``SourceError``."""
    try:
        yield
    except SourceError:
        raise
    except (*_HEADER_ERRORS, KeyError, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError) as error:
        message = f"Expected {member} of {path.name} to decode, got: {error}"
        raise SourceError("unreadable", "corrupt_chunk", message) from None


@lru_cache(maxsize=4)
def _member(path: Path, member: str, changed_ns: int) -> NDArray[Any]:
    name = f"{member}.npy"
    with _decoding(path, member), zipfile.ZipFile(path) as archive:
        about = archive.getinfo(name)
        if about.file_size > LARGEST_BYTES:
            message = f"Expected {member} of {path.name} in {LARGEST_BYTES} bytes at most, got {about.file_size}"
            raise SourceError("too_large", "wrong_shape", message)
        with archive.open(about) as stored:
            shape, fortran, dtype = _header(stored)
            _require_numbers(f"{member} of {path.name}", dtype)
            # The size that the archive states bounds what is read; zipfile compares it with the bytes.
            content = stored.read(about.file_size)
    if len(content) != prod(shape) * dtype.itemsize:
        stated = prod(shape) * dtype.itemsize
        raise SourceError(
            "unreadable", "truncated", f"Expected {stated} bytes of {member} in {path.name}, got {len(content)}"
        )
    flat = np.frombuffer(content, dtype)
    return flat.reshape(shape[::-1]).T if fortran else flat.reshape(shape)


def _header(file: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, whether columns are stored together, and type; raises ``_HEADER_ERRORS``."""
    version = npy_format.read_magic(file)
    read = npy_format.read_array_header_1_0 if version == (1, 0) else npy_format.read_array_header_2_0
    shape, fortran, dtype = read(file)
    if any(size < 0 for size in shape):
        raise ValueError(f"a shape of {shape}")
    return shape, fortran, dtype


def _require_numbers(name: str, dtype: np.dtype[Any]) -> None:
    if dtype.kind not in "iufb":
        # Objects are pickles, which run code when they are read.
        raise SourceError("wrong_dtype", "wrong_dtype", f"Expected numbers in {name}, got {dtype}")

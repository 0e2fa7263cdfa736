"""Arrays of NumPy: NPY, read through the memory of the file, and arrays in NPZ, decoded as a whole."""

import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
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
    kind: str

    @property
    def dtype(self) -> np.dtype[Any]:
        """As stored."""
        return np.dtype(self.kind)

    @property
    def rows_together(self) -> int:
        """Any number."""
        return 0

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Return a copy of rows; raises ``SourceError`` or ``OSError``."""
        if self.member:
            return _member(self.path, self.member, self.changed_ns)[start:stop].copy()
        # Opened anew each time: the array keeps no descriptor, and a file that was cut off is detected.
        return np.array(np.load(self.path, mmap_mode="r", allow_pickle=False)[start:stop])


@dataclass(frozen=True, slots=True)
class NpyFrames:
    """Arrays of one shape and type in NPY files, a row each, in the order of the numbers in their names."""

    path: Path
    names: tuple[str, ...]
    frame_shape: tuple[int, ...]
    kind: str

    @property
    def shape(self) -> tuple[int, ...]:
        """(n, ...)."""
        return (len(self.names), *self.frame_shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """As stored."""
        return np.dtype(self.kind)

    @property
    def rows_together(self) -> int:
        """One file."""
        return 1

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Read files; raises ``SourceError`` or ``OSError``."""
        read = np.empty((stop - start, *self.frame_shape), self.dtype)
        for row in range(start, stop):
            name = self.names[row]
            frame = npy_array(self.path / name)
            if (frame.shape, frame.kind) != (self.frame_shape, self.kind):
                message = f"Expected {name} as {self.kind} {self.frame_shape}, got {frame.kind} {frame.shape}"
                raise SourceError("wrong_shape", "wrong_shape", message)
            read[row - start] = np.load(self.path / name, mmap_mode="r", allow_pickle=False)
        return read


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
    return NpyArray(path, "", changed_ns, tuple(map(int, shape)), dtype.str)


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
    return NpyArray(path, member, changed_ns, array.shape, array.dtype.str)


def npy_frames(folder: Path, names: Iterable[str]) -> NpyFrames:
    """Return a row of each NPY file; only the header of the first is read. Raises ``SourceError`` or ``OSError``."""
    ordered = in_order(names)
    first = npy_array(folder / ordered[0])
    return NpyFrames(folder, tuple(ordered), first.shape, first.kind)


@lru_cache(maxsize=4)
def _member(path: Path, member: str, changed_ns: int) -> NDArray[Any]:
    name = f"{member}.npy"
    try:
        with zipfile.ZipFile(path) as archive:
            about = archive.getinfo(name)
            if about.file_size > LARGEST_BYTES:
                message = f"Expected {member} of {path.name} in {LARGEST_BYTES} bytes at most, got {about.file_size}"
                raise SourceError("too_large", "wrong_shape", message)
            with archive.open(about) as stored:
                shape, fortran, dtype = _header(stored)
                _require_numbers(f"{member} of {path.name}", dtype)
                # The size that the archive states bounds what is read; zipfile compares it with the bytes.
                content = stored.read(about.file_size)
    except SourceError:
        raise
    except (*_HEADER_ERRORS, KeyError, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError) as error:
        message = f"Expected {member} of {path.name} to decode, got: {error}"
        raise SourceError("unreadable", "corrupt_chunk", message) from None
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

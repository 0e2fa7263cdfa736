"""Write HDF5: datasets of the canonical layout, and a file that reports failed writes once it is closed."""

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import h5py
import hdf5plugin

from fedora_qa.errors import MisuseError
from fedora_qa.layout.canonical import spec_of

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_LEVEL: Final = 5
"""Of Zstandard; how hard it tries is no part of the layout."""


def create_dataset(file: h5py.File, key: str, sizes: Mapping[str, int], *, level: int = _LEVEL) -> h5py.Dataset:
    """Create one dataset with the type, chunks, codec, checksum and ``units`` of the layout.

    Parameters
    ----------
    key
        A key of ``DATASETS``.
    sizes
        A number for each symbolic size of the dataset's shape. The axis of time can grow later.
    level
        Of compression, 1 to 9.

    Raises
    ------
    KeyError
        The key is not of the layout, or a size is missing.
    """
    spec = spec_of(key)
    shape = tuple(size if isinstance(size, int) else sizes[size] for size in spec.shape)
    storage: dict[str, Any] = {}
    if spec.chunk_rows:
        storage = {
            "chunks": (spec.chunk_rows, *shape[1:]),
            # Unlimited along time: rows can be appended later.
            "maxshape": (None, *shape[1:]),
            "fletcher32": True,
            # The pipeline of layout 1.0; ``direct_chunks`` decodes it without HDF5.
            **hdf5plugin.Blosc(cname="zstd", clevel=level, shuffle=hdf5plugin.Blosc.SHUFFLE),
        }
    dataset = file.create_dataset(key, shape=shape, dtype=spec.dtype, **storage)
    dataset.attrs["units"] = spec.units
    return dataset


class DeferredErrorFile(io.FileIO):
    """A file by path, emptied, or by descriptor, open to read and write, that stores the error of a failed write.

    HDF5 cannot close a file that it could not write, and crashes when the interpreter ends. Therefore a failed write
    reports success to HDF5, all later writes are dropped, and ``raise_failure`` raises the error.

    Attributes
    ----------
    what
        What the file is, for the message of the error.
    failure
        The first error of a write, if any.
    """

    def __init__(self, file: Path | int, what: str, mode: str = "w+") -> None:
        self.what = what
        self.failure: OSError | None = None
        super().__init__(file, mode)

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write all of ``data``."""
        view = memoryview(data).cast("B")
        with self.deferred():
            written = 0
            while self.failure is None and written < len(view):
                # A raw write may take fewer bytes than given, for example on a disk that is nearly full.
                written += super().write(view[written:]) or 0
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Cut or lengthen the file."""
        size = self.tell() if size is None else size
        with self.deferred():
            if self.failure is None:
                super().truncate(size)
        return size

    def raise_failure(self) -> None:
        """Raise ``MisuseError`` where a write has failed."""
        if self.failure is not None:
            raise MisuseError(
                f"Expected to be able to write {self.what}, got: {self.failure.strerror}; nothing is written"
            )

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Store an error of the system instead of raising it."""
        try:
            yield
        except OSError as error:
            # The first failure is the cause; those after it are its consequences.
            self.failure = self.failure or error

"""Open the other files that a file links to or consists of: those in folders that the user allows, and no others.

HDF5 searches a name in many places. Here it is searched in one place only: beside the file that holds it.
``hdf5_objects`` follows links from file to file. HDF5 itself follows virtual datasets and external storage. So every
source of these must exist, complete, at that place, where HDF5 finds it before it searches elsewhere.
"""

import os
from collections.abc import Iterable
from math import prod
from pathlib import Path
from typing import Final

import h5py
from h5py import h5s

from fedora_qa.layout.binding import Binding
from fedora_qa.layout.decodable import (
    MOST_EXPANSION,
    SMALL_BYTES,
    require_filters,
    require_small_chunks,
    require_sound_blocks,
    require_whole_chunks,
    unwritten_chunks,
)
from fedora_qa.layout.hdf5_objects import RefusedError, find_dataset, reading

MOST_FILES: Final = 64
"""Other files that one file may name."""

MOST_SOURCES: Final = 4096
"""Pieces that a virtual dataset may be made of."""

_PREFIXES: Final = ("HDF5_VDS_PREFIX", "HDF5_EXTFILE_PREFIX")
"""Variables of the environment that change where HDF5 searches first."""


class ExternalFiles:
    """Opens the other files that a file names, and keeps them open until it is closed.

    Parameters
    ----------
    folders
        Where they must lie, after all links of the file system have been followed.
    """

    def __init__(self, folders: Iterable[Path]) -> None:
        # Resolved, so that a symbolic link in an allowed folder cannot lead out of it.
        self._folders = tuple(Path(os.path.realpath(folder)) for folder in folders)
        self._files: dict[Path, h5py.File] = {}

    def close(self) -> None:
        """Close every file."""
        for file in self._files.values():
            file.close()
        self._files.clear()

    def named(self, file: h5py.File, name: str, path: str) -> h5py.File:
        """Open the file that a file names at a path; raises ``RefusedError``."""
        return self._opened(self._place(file, name, path), path)

    def holding(self, file: h5py.File, binding: Binding) -> h5py.File:
        """Return the file that holds a dataset: the given one, or another, whose folder is tested again."""
        if binding.source is None:
            return file
        place = Path(binding.source[0])
        return file if place == Path(file.filename) else self._opened(self._allowed(place, binding.path), binding.path)

    def require_sources(self, dataset: h5py.Dataset, path: str) -> None:
        """Refuse a virtual or externally stored dataset unless every value lies in a file that may be read.

        Raises
        ------
        RefusedError
            A source is outside of the folders, missing, too short, itself of this kind, or unsafe to decode; or some
            values have none.
        """
        # With one of these variables HDF5 reads other files than those that are checked below.
        if variables := [name for name in _PREFIXES if os.environ.get(name)]:
            raise _refused(f"Expected {variables[0]} to be unset where {path} lies in other files, got a value")
        if dataset.is_virtual:
            self._require_virtual(dataset, path)
            return
        wanted = prod(dataset.shape) * dataset.dtype.itemsize
        for name, offset, size in dataset.external:
            there = self._place(dataset.file, name, path).stat().st_size - offset
            # A segment may claim more than the dataset needs (H5F_UNLIMITED); only bytes that exist count.
            wanted -= min(size, max(there, 0))
            if size <= there or wanted <= 0:
                continue
            raise RefusedError("unwritten", "truncated", f"Expected {size} bytes of {path} in {name}, got {there}")
        if wanted > 0:
            raise RefusedError(
                "unwritten", "truncated", f"Expected all of {path} in its files, got {wanted} bytes less"
            )

    def _require_virtual(self, dataset: h5py.Dataset, path: str) -> None:
        sources = dataset.virtual_sources()
        if len(sources) > MOST_SOURCES:
            raise _refused(f"Expected {path} to be made of {MOST_SOURCES} pieces at most, got {len(sources)}")
        mapped = h5s.create_simple(dataset.shape)
        mapped.select_none()
        stored: dict[tuple[str, str], int] = {}
        for virtual_source in sources:
            source = self._source(dataset, virtual_source.file_name, virtual_source.dset_name, path)
            stored[source.file.filename, source.name] = int(source.id.get_storage_size())
            taken_space, piece = virtual_source.src_space, virtual_source.vspace
            if taken_space.get_select_type() == h5s.SEL_ALL:
                taken = prod(source.shape)
            else:
                last = taken_space.get_select_bounds()[1]  # bounds of a selection include both ends
                if len(last) != len(source.shape) or any(at >= n for at, n in zip(last, source.shape, strict=True)):
                    message = f"Expected the source of {path} to reach as far as it is taken"
                    raise RefusedError("unwritten", "truncated", message)
                taken = int(taken_space.get_select_npoints())
            if piece.get_select_type() == h5s.SEL_ALL:
                mapped.select_all()
            elif piece.get_select_type() != h5s.SEL_HYPERSLABS or not piece.is_regular_hyperslab():
                raise _refused(f"Expected the pieces of {path} to be boxes, got another selection")
            else:
                start, stride, count, block = piece.get_regular_hyperslab()
                # The union counts each value once, so that overlapping pieces cannot hide a gap.
                mapped.select_hyperslab(start, count, stride, block, op=h5s.SELECT_OR)
            if taken != piece.get_select_npoints():
                raise _refused(f"Expected pieces of {path} as large as their sources, got another size")
        values = prod(dataset.shape)
        if mapped.get_select_npoints() != values:
            message = f"Expected all {values} values of {path} to have a source, got {mapped.get_select_npoints()}"
            raise RefusedError("unwritten", "truncated", message)
        decoded = values * dataset.dtype.itemsize
        # Each source counts once, however many pieces map it: repeats cannot raise the bound.
        if decoded > max(SMALL_BYTES, MOST_EXPANSION * sum(stored.values())):
            message = f"Expected {path} to unpack to {MOST_EXPANSION} times its sources at most, got {decoded} bytes"
            raise RefusedError("expands", "unknown", message)

    def _source(self, dataset: h5py.Dataset, name: str, path_there: str, path: str) -> h5py.Dataset:
        # HDF5 replaces %b by block numbers, and so reads files that have not been tested.
        if "%" in name or "%" in path_there:
            raise _refused(f"Expected the sources of {path} by their names, got a pattern")
        file = dataset.file if name == "." else self.named(dataset.file, name, path)
        source = find_dataset(file, path_there)  # HDF5 would follow any link out of it by itself
        if source is None:
            raise RefusedError("dangling_link", "missing_stream", f"Expected the source of {path}, got nothing there")
        # HDF5 decodes sources by itself, so that they must meet the rules for datasets of the file.
        require_filters(source, path)
        require_small_chunks(source, path)
        require_whole_chunks(source, path)
        with reading(path):
            require_sound_blocks(source, 0, len(source))
        if unwritten_chunks(source)[0]:
            raise RefusedError("unwritten", "truncated", f"Expected the source of {path} to be written, got holes")
        return source

    def _place(self, file: h5py.File, name: str, path: str) -> Path:
        return self._allowed(Path(os.path.realpath(Path(os.path.realpath(file.filename)).parent / name)), path)

    def _allowed(self, place: Path, path: str) -> Path:
        if not any(place.is_relative_to(folder) for folder in self._folders):
            raise _refused(f"Expected {path} in this file or a folder that may be read, got {place}")
        if not place.is_file():
            raise RefusedError("dangling_link", "missing_stream", f"Expected a file at {place} for {path}, got none")
        return place

    def _opened(self, place: Path, path: str) -> h5py.File:
        if place not in self._files:
            if len(self._files) == MOST_FILES:
                raise _refused(f"Expected {MOST_FILES} other files at most, got another for {path}")
            self._files[place] = h5py.File(place, "r", locking="best-effort")
        return self._files[place]


def _refused(message: str) -> RefusedError:
    return RefusedError("outside_link", "missing_stream", message)

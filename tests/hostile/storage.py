"""Attacks by how bytes are stored: sizes that are claimed, chunks, filters. Each edits an open copy of a small file."""

import zlib
from functools import cache
from math import prod
from typing import Any, Final

import h5py
import hdf5plugin
import numpy as np

EVENTS: Final = tuple(f"path/events/{name}" for name in "xytp")
BLOSC: Final[dict[str, Any]] = {"compression": 32001, "compression_opts": (0, 0, 0, 0, 5, 1, 5)}


def replace(file: h5py.File, path: str, **how: Any) -> h5py.Dataset:
    """Put another dataset in the place of one, with its label."""
    units = file[path].attrs.get("units")
    del file[path]
    made = file.create_dataset(path, **how)
    if units is not None:
        made.attrs["units"] = units
    return made


def petabytes_of_events(file: h5py.File) -> None:
    """A hundred thousand billion events, of which the first 77 are written."""
    for path in EVENTS:
        values = file[path][:]
        replace(file, path, shape=(2**47,), dtype=values.dtype, chunks=(2**18,), **BLOSC)[: len(values)] = values


def petabytes_of_frames(file: h5py.File) -> None:
    """Colour frames without end, one of them written; their stamps too."""
    first = file["path/rgb"][0]
    replace(file, "path/rgb", shape=(2**40, *first.shape), dtype="u1", chunks=(1, *first.shape), **BLOSC)[0] = first
    replace(file, "path/rgb_ts", shape=(2**40,), dtype="i8", chunks=(2**14,))[:6] = range(6)
    replace(file, "metadata/rgb_to_event", shape=(2**40,), dtype="i8", chunks=(2**14,))[:6] = 0


def poses_never_written(file: h5py.File) -> None:
    """Poses of a petabyte, contiguous, of which nothing is written."""
    for path, columns in (("path/pose/position", (3,)), ("path/pose/orientation", (4,)), ("path/pose/ts", ())):
        replace(file, path, shape=(2**44, *columns), dtype=file[path].dtype)


def frames_of_gigabytes(file: h5py.File) -> None:
    """Colour frames of 30,000 x 40,000 pixels, none of them written."""
    replace(file, "path/rgb", shape=(6, 30_000, 40_000, 3), dtype="u1", chunks=(1, 30_000, 40_000, 1), **BLOSC)


def bomb_of_samples(file: h5py.File) -> None:
    """IMU of a hundred million rows, all of them written, in a few kilobytes."""
    for name in ("ts", "angular_velocity", "linear_acceleration"):
        bomb(file, f"path/imu/{name}", rows=2**27, chunk=2**21)


def bomb_of_events(file: h5py.File) -> None:
    """A thousand million events in a few kilobytes."""
    for path in EVENTS:
        bomb(file, path, rows=2**30, chunk=2**24)


def bomb_of_an_index_map(file: h5py.File) -> None:
    """An index map, stamps and frames of a hundred million rows."""
    bomb(file, "metadata/depth_to_event", rows=2**27, chunk=2**24)
    bomb(file, "path/depth_ts", rows=2**27, chunk=2**24)
    bomb(file, "path/depth", rows=2**27, chunk=2**14)


def bomb(file: h5py.File, path: str, rows: int, chunk: int) -> None:
    """Write zeros through gzip twice, which leaves a ten thousandth of what gzip alone does."""
    sizes, dtype, units = file[path].shape[1:], file[path].dtype, file[path].attrs["units"]
    kept = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    kept.set_chunk((chunk, *sizes))
    kept.set_deflate(9)
    kept.set_deflate(9)
    del file[path]
    space = h5py.h5s.create_simple((rows, *sizes))
    made = h5py.h5d.create(file.id, path.encode(), h5py.h5t.py_create(dtype), space, dcpl=kept)
    packed = zeros_packed_twice(chunk * dtype.itemsize * prod(sizes))
    for start in range(0, rows, chunk):
        made.write_direct_chunk((start, *(0 for _ in sizes)), packed)
    file[path].attrs["units"] = units


@cache
def zeros_packed_twice(count: int) -> bytes:
    """Return what two gzip filters make of zeros."""
    return zlib.compress(zlib.compress(bytes(count), 6), 9)


def a_chunk_for_each_event(file: h5py.File) -> None:
    """Twenty thousand events, each in a chunk of its own."""
    count = 20_000
    rows = np.arange(count)
    values = {"x": rows * 7 % 16, "y": rows * 5 % 12, "t": rows * 5, "p": rows % 2}
    for path in EVENTS:
        replace(file, path, data=values[path[-1]].astype(file[path].dtype), chunks=(1,))
    for name in ("rgb", "depth"):
        file[f"metadata/{name}_to_event"][:] = np.searchsorted(rows * 5, file[f"path/{name}_ts"][:])


def a_chunk_beyond_its_dataset(file: h5py.File) -> None:
    """Event stamps in a chunk of 2 GiB, of which 77 rows are used."""
    made = replace(file, "path/events/t", shape=(77,), maxshape=(None,), dtype="i8", chunks=(2**28 - 1,),
                   compression="gzip")  # fmt: skip
    made.id.write_direct_chunk((0,), b"packed")


def a_chunk_for_each_value(file: h5py.File) -> None:
    """Colour frames in tiles of 1 x 1 pixel."""
    values = file["path/rgb"][:]
    replace(file, "path/rgb", data=values, chunks=(1, 1, 1, 1))


def no_rows(file: h5py.File) -> None:
    """Every stream is there and empty."""
    for path in paths(file):
        values = file[path][:]
        replace(file, path, data=values[:0], maxshape=(None, *values.shape[1:]), chunks=True)


def no_columns(file: h5py.File) -> None:
    """Every image is zero pixels wide."""
    for path in paths(file):
        values = file[path][:]
        if values.ndim > 2:
            replace(file, path, data=values[:, :, :0], chunks=(1, 1, 1, *values.shape[3:]),
                    maxshape=(None,) * values.ndim)  # fmt: skip


def through_bitshuffle(file: h5py.File) -> None:
    """Depth through a codec that a damaged chunk can crash."""
    replace(file, "path/depth", data=file["path/depth"][:], chunks=(1, 27, 36), **hdf5plugin.Bitshuffle())


def damaged_bitshuffle(file: h5py.File) -> None:
    """The same, and one of its blocks claims 2 GiB, which its decoder would write beyond its memory."""
    through_bitshuffle(file)
    stored = file["path/depth"].id
    _, chunk = stored.read_direct_chunk((2, 0, 0))
    stored.write_direct_chunk((2, 0, 0), chunk[:12] + b"\x7f\xff\xff\xff" + chunk[16:])


def bitshuffle_within_gzip(file: h5py.File) -> None:
    """Depth through Bitshuffle and then gzip, which hides the bytes that would be verified."""
    values = file["path/depth"][:]
    del file["path/depth"]
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((1, *values.shape[1:]))
    properties.set_filter(hdf5plugin.BSHUF_ID, h5py.h5z.FLAG_MANDATORY, (0, 0))
    properties.set_deflate(1)
    space = h5py.h5s.create_simple(values.shape)
    made = h5py.h5d.create(file.id, b"path/depth", h5py.h5t.IEEE_F32LE, space, properties)
    h5py.Dataset(made)[:] = values


def paths(file: h5py.File) -> list[str]:
    """Return the paths of all streams."""
    found: list[str] = []
    file["path"].visititems(lambda name, item: found.append(f"path/{name}") if isinstance(item, h5py.Dataset) else None)
    return found

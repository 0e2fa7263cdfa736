"""A chunk that is decoded without HDF5 is what HDF5 decodes, and whatever is stored otherwise is left to HDF5."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import hdf5plugin
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.layout.direct_chunks import StoredChunks, fletcher32

SHAPE = (3, 300, 500, 2)
CODECS: dict[str, dict[str, Any]] = {
    codec: dict(hdf5plugin.Blosc(cname=codec, clevel=3, shuffle=shuffle))
    for codec, shuffle in (("zstd", 1), ("lz4", 2), ("blosclz", 0), ("zlib", 1))
}
OTHERS: dict[str, dict[str, Any]] = {
    "contiguous": {},
    "gzip": {"chunks": (1, *SHAPE[1:]), "compression": "gzip"},
    "blosc of a part": {"chunks": (1, 150, 500, 2), **CODECS["zstd"]},
    "gzip and checksum": {"chunks": (1, *SHAPE[1:]), "fletcher32": True, "compression": "gzip"},
    "big-endian": {"chunks": (1, *SHAPE[1:]), "dtype": ">f4", **CODECS["zstd"]},
}


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., h5py.Dataset]:
    """Write fields through some filters, and open them again."""

    def write(**storage: Any) -> h5py.Dataset:
        with h5py.File(tmp_path / "fields.h5", "w") as file:
            file.create_dataset("flow", data=fields(), **storage)
        return h5py.File(tmp_path / "fields.h5")["flow"]

    return write


def fields() -> NDArray[np.float32]:
    return np.random.default_rng(3).integers(-50, 50, SHAPE).astype(np.float32) / 8


def damaged(dataset: h5py.Dataset, damage: Callable[[bytearray], None]) -> h5py.Dataset:
    """Change the stored bytes of the first chunk."""
    name, place = dataset.file.filename, dataset.id.get_chunk_info(0)
    dataset.file.close()
    content = bytearray(Path(name).read_bytes())
    chunk = content[place.byte_offset : place.byte_offset + place.size]
    damage(chunk)
    content[place.byte_offset : place.byte_offset + place.size] = chunk
    Path(name).write_bytes(content)
    return h5py.File(name)["flow"]


@pytest.mark.parametrize("checksum", [False, True])
@pytest.mark.parametrize("codec", CODECS)
def test_it_is_what_hdf5_decodes(codec: str, checksum: bool, written: Callable[..., h5py.Dataset]) -> None:
    """Every codec of Blosc, with and without its shuffles and a checksum."""
    dataset = written(chunks=(1, *SHAPE[1:]), fletcher32=checksum, **CODECS[codec])
    for row in range(SHAPE[0]):
        rows = np.empty((1, *SHAPE[1:]), np.float32)
        assert StoredChunks(dataset).decode(row, rows)
        np.testing.assert_array_equal(rows, dataset[row : row + 1])


@pytest.mark.parametrize("storage", OTHERS)
def test_what_is_stored_otherwise_is_left(storage: str, written: Callable[..., h5py.Dataset]) -> None:
    """Other codecs, parts of rows, checksums and types: nothing is done, and said so."""
    kept = {"dtype": "<f4"} | OTHERS[storage]
    dataset = written(**kept)
    rows = np.zeros((1, *SHAPE[1:]), dataset.dtype)
    assert StoredChunks(dataset).decode(0, rows) == (storage == "big-endian")
    if storage == "big-endian":  # the array has the order of the file: whoever wants another converts it
        np.testing.assert_array_equal(rows, fields()[:1])


def test_rows_that_are_no_chunk_are_left(written: Callable[..., h5py.Dataset]) -> None:
    """Two chunks at once, a part of one, and what was never written."""
    dataset = written(chunks=(1, *SHAPE[1:]), **CODECS["zstd"])
    assert not StoredChunks(dataset).decode(0, np.zeros((2, *SHAPE[1:]), np.float32))
    with h5py.File(dataset.file.filename.replace("fields", "empty"), "w") as file:
        empty = file.create_dataset("flow", SHAPE, "<f4", chunks=(1, *SHAPE[1:]), **CODECS["zstd"])
        assert not StoredChunks(empty).decode(0, np.zeros((1, *SHAPE[1:]), np.float32))


@pytest.mark.parametrize("place", [0, 16, 1000, -5, -4, -1])
def test_a_wrong_checksum_is_left_to_hdf5(place: int, written: Callable[..., h5py.Dataset]) -> None:
    """One bit anywhere in the chunk or its checksum: nothing is decoded, and HDF5 says what is wrong."""

    def damage(chunk: bytearray) -> None:
        chunk[place] ^= 1

    broken = damaged(written(chunks=(1, *SHAPE[1:]), fletcher32=True, **CODECS["zstd"]), damage)
    assert not StoredChunks(broken).decode(0, np.empty((1, *SHAPE[1:]), np.float32))
    with pytest.raises(OSError, match=r"filter returned failure|Fletcher32 checksum"):
        broken[0]


@given(content=st.binary(min_size=1, max_size=3000), repeats=st.integers(1, 3))
def test_checksum_is_that_of_hdf5(content: bytes, repeats: int) -> None:
    """What HDF5 writes behind any bytes, an odd number of them and nothing but zeros among these."""
    values = np.frombuffer(content * repeats, np.uint8)
    with h5py.File("checksum", "w", driver="core", backing_store=False) as file:
        dataset = file.create_dataset("values", data=values, chunks=values.shape, fletcher32=True)
        _, stored = dataset.id.read_direct_chunk((0,))
    words = np.frombuffer(stored, np.uint16, count=len(values) // 2)
    found = fletcher32(words, stored[len(values) - 1] if len(values) % 2 else -1)
    assert found.to_bytes(4, "little") == stored[-4:].replace(b"\xff\xff", b"\0\0")


@pytest.mark.parametrize(("at", "value"), [(4, 2**31), (4, 16), (12, 2**31), (12, 16), (8, 0), (0, 2**32 - 1)])
def test_a_header_that_lies_is_not_believed(at: int, value: int, written: Callable[..., h5py.Dataset]) -> None:
    """Sizes that are not those of the chunk and its rows: nothing is read or written beyond either."""
    dataset = written(chunks=(1, *SHAPE[1:]), **CODECS["zstd"])
    broken = damaged(dataset, lambda chunk: struct.pack_into("<I", chunk, at, value))
    assert not StoredChunks(broken).decode(0, np.empty((1, *SHAPE[1:]), np.float32))


@given(data=st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_bytes_stay_within_the_rows(data: st.DataObject, written: Callable[..., h5py.Dataset]) -> None:
    """Whatever is damaged, what lies behind the rows in memory is not touched."""
    codec = data.draw(st.sampled_from(sorted(CODECS)))
    dataset = written(chunks=(1, *SHAPE[1:]), **CODECS[codec])
    places = data.draw(st.lists(st.integers(16, dataset.id.get_chunk_info(0).size - 1), min_size=1, max_size=20))
    values = data.draw(st.lists(st.integers(0, 255), min_size=len(places), max_size=len(places)))

    def damage(chunk: bytearray) -> None:
        for place, value in zip(places, values, strict=True):
            chunk[place] = value

    broken = damaged(dataset, damage)
    memory = np.full(SHAPE, 7, np.float32)
    StoredChunks(broken).decode(0, memory[1:2])
    assert (memory[0] == 7).all()
    assert (memory[2] == 7).all()
    broken.file.close()

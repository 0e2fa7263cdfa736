"""Chunks that threads compress are what HDF5 would have stored, in the order in which they are given."""

import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.layout.create import create_dataset
from fedora_qa.layout.direct_chunks import ChunkWriter, checksum_of

KEYS = ("path/events/t", "path/events/x", "path/events/p", "path/imu/angular_velocity", "path/depth", "path/rgb")
SIZES = {"E": 0, "M": 0, "D": 0, "N": 0, "H": 30, "W": 41, "H_rgb": 31, "W_rgb": 43}


def rows_of(shape: tuple[int, ...], dtype: np.dtype[np.generic], seed: int) -> np.ndarray:
    """Rows whose values are neither constant nor mere noise."""
    return np.random.default_rng(seed).integers(0, 3, shape).cumsum(axis=0).astype(dtype)


@pytest.mark.parametrize("key", KEYS)
def test_stored_as_hdf5_stores(key: str, tmp_path: Path) -> None:
    """Every reader decodes and verifies what is written, through the filters of the layout."""
    with h5py.File(tmp_path / "a.h5", "w") as file, ChunkWriter(2) as chunks:
        ours, theirs = (create_dataset(file.create_group(name), key, SIZES, level=2) for name in ("ours", "theirs"))
        rows = rows_of(ours.chunks, ours.dtype, 1)
        for dataset in (ours, theirs):
            dataset.resize(len(rows), axis=0)
        chunks.write(ours, 0, rows)
        chunks.finish()
        theirs[:] = rows
    with h5py.File(tmp_path / "a.h5") as file:
        ours, theirs = file[f"ours/{key}"], file[f"theirs/{key}"]
        np.testing.assert_array_equal(ours[:], theirs[:])
        assert ours._filters == theirs._filters
        assert ours.fletcher32
        # The header of Blosc states codec, shuffle, type and size; then comes the size of its blocks.
        stored = [dataset.id.read_direct_chunk((0,) * dataset.ndim) for dataset in (ours, theirs)]
        assert stored[0][1][:8] == stored[1][1][:8]
        assert stored[0][0] == stored[1][0] == 0


def test_more_than_may_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However little may wait, every chunk lies where it belongs."""
    monkeypatch.setattr("fedora_qa.layout.direct_chunks._WAITING_BYTES", 4000)
    depth_mm = rows_of((40, 30, 41), np.dtype(np.float32), 2)
    with h5py.File(tmp_path / "a.h5", "w") as file, ChunkWriter(3) as chunks:
        depth = create_dataset(file, "path/depth", SIZES)
        depth.resize(len(depth_mm), axis=0)
        for row in range(len(depth_mm)):
            chunks.write(depth, row, depth_mm[row : row + 1])
        chunks.finish()
        np.testing.assert_array_equal(depth[:], depth_mm)


@pytest.mark.parametrize("delay_s", [0.0, 0.05])
def test_places_do_not_depend_on_the_speed_of_threads(
    delay_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chunks that are compressed late lie where those lie that are compressed before the next dataset is written."""

    def encoded(rows: np.ndarray, level: int, shuffle: int) -> bytes:
        time.sleep(delay_s)
        return rows.tobytes()

    monkeypatch.setattr("fedora_qa.layout.direct_chunks._encoded_chunk", encoded)
    depth_mm = rows_of((6, 30, 41), np.dtype(np.float32), 3)
    with h5py.File(tmp_path / "a.h5", "w") as file, ChunkWriter(2) as chunks:
        depth = create_dataset(file, "path/depth", {**SIZES, "D": len(depth_mm)})
        for row in range(len(depth_mm)):
            chunks.write(depth, row, depth_mm[row : row + 1])
            time.sleep(0.01)
            file.create_dataset(f"other/{row}", data=depth_mm[row])
        chunks.finish()
        first, *later = (depth.id.get_chunk_info(row).byte_offset for row in range(len(depth_mm)))
        # Neighbours in the file: all were written behind the last of the other datasets.
        assert later == [first + number * depth_mm[0].nbytes for number in range(1, len(depth_mm))]
        assert first > max(file[f"other/{row}"].id.get_offset() for row in range(len(depth_mm)))


@given(
    content=st.one_of(st.binary(min_size=1, max_size=2000), st.lists(st.sampled_from([0, 255]), min_size=1).map(bytes))
)
def test_checksum_is_that_of_hdf5(content: bytes) -> None:
    """To the last bit, also where a sum is 0 modulo 65535."""
    values = np.frombuffer(b"\1" + content, np.uint8)
    with h5py.File("checksum", "w", driver="core", backing_store=False) as file:
        dataset = file.create_dataset("values", data=values, chunks=values.shape, fletcher32=True)
        _, stored = dataset.id.read_direct_chunk((0,))
    assert checksum_of(values.tobytes()) == stored[-4:]

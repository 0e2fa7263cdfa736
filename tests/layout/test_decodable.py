"""Chunks of Bitshuffle are decoded only where their sizes agree: no damaged chunk reaches the decoder that it ends."""

import multiprocessing
import struct
from pathlib import Path

import h5py
import hdf5plugin
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.layout.decodable import require_filters, require_sound_blocks
from fedora_qa.layout.hdf5_objects import READ_ERRORS, RefusedError

CODECS = ("none", "lz4", "zstd")
HEADER_BYTES = 12
SHAPE = (5, 9, 13)
"""No multiple of eight values: the last ones of a chunk are stored as they are."""


def values(dtype: str = "f4") -> NDArray[np.float32]:
    return np.cumsum(np.random.default_rng(3).integers(-3, 4, SHAPE), axis=-1).astype(dtype)


def stored(
    path: Path, codec: str = "lz4", chunks: tuple[int, ...] = (2, 9, 13), dtype: str = "f4", **more: object
) -> h5py.Dataset:
    filters = hdf5plugin.Bitshuffle(nelems=0, cname=codec)
    return h5py.File(path, "w").create_dataset("x", data=values(dtype), chunks=chunks, **filters, **more)


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("dtype", ["u1", "f4", "i8"])
@pytest.mark.parametrize("checksum", [False, True], ids=["", "checksum"])
def test_what_the_library_writes_is_sound(codec: str, dtype: str, checksum: bool, tmp_path: Path) -> None:
    dataset = stored(tmp_path / "x.h5", codec, (2, 4, 7), dtype, fletcher32=checksum)
    require_filters(dataset, "x")
    require_sound_blocks(dataset, 0, len(dataset))
    np.testing.assert_array_equal(dataset[:], values(dtype))


def test_other_storage_is_left_alone(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "x.h5", "w") as file:
        for dataset in (
            file.create_dataset("plain", data=values()),
            file.create_dataset("scalar", data=1.0),
            file.create_dataset("gzip", data=values(), compression="gzip"),
            file.create_dataset("unwritten", shape=SHAPE, dtype="f4", chunks=(2, 9, 13), **hdf5plugin.Bitshuffle()),
        ):
            require_filters(dataset, dataset.name)
            require_sound_blocks(dataset, 0, 5)


@pytest.mark.parametrize(
    ("position", "layout", "number"),
    [
        (0, ">Q", 2 * 9 * 13 * 4 + 4),  # bytes of all values
        (0, ">Q", 2**63),
        (8, ">I", 0),  # bytes of a block
        (8, ">I", 33),
        (12, ">I", 2**31),  # packed bytes of the first block
        (12, ">I", 0),
    ],
)
def test_a_wrong_size_is_refused_by_place(position: int, layout: str, number: int, tmp_path: Path) -> None:
    dataset = stored(tmp_path / "x.h5")
    content = bytearray(dataset.id.read_direct_chunk((2, 0, 0))[1])
    struct.pack_into(layout, content, position, number)
    dataset.id.write_direct_chunk((2, 0, 0), bytes(content))
    require_sound_blocks(dataset, 0, 2)
    require_sound_blocks(dataset, 4, 5)
    with pytest.raises(OSError, match=r"chunk at \(2, 0, 0\)"):
        require_sound_blocks(dataset, 3, 4)


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("change", [-1, 1])
def test_a_chunk_of_another_length_is_refused(codec: str, change: int, tmp_path: Path) -> None:
    dataset = stored(tmp_path / "x.h5", codec)
    content = dataset.id.read_direct_chunk((0, 0, 0))[1]
    dataset.id.write_direct_chunk((0, 0, 0), content[:-1] if change < 0 else content + b"\0")
    with pytest.raises(OSError, match="fill the chunk"):
        require_sound_blocks(dataset, 0, 1)


def test_a_chunk_that_left_the_filter_out_holds_its_values(tmp_path: Path) -> None:
    dataset = stored(tmp_path / "x.h5")
    dataset.id.write_direct_chunk((0, 0, 0), values()[:2].tobytes(), filter_mask=1)
    require_sound_blocks(dataset, 0, 2)
    np.testing.assert_array_equal(dataset[:2], values()[:2])
    dataset.id.write_direct_chunk((0, 0, 0), values()[:2].tobytes()[:-4], filter_mask=1)
    with pytest.raises(OSError, match="fill the chunk"):
        require_sound_blocks(dataset, 0, 2)


def test_what_cannot_be_verified_is_refused(tmp_path: Path) -> None:
    """Another codec behind the filter."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((2, 9, 13))
    properties.set_filter(32008, h5py.h5z.FLAG_MANDATORY, (0, 0))
    properties.set_deflate(1)
    with h5py.File(tmp_path / "x.h5", "w") as file:
        made = h5py.h5d.create(file.id, b"x", h5py.h5t.IEEE_F32LE, h5py.h5s.create_simple(SHAPE), properties)
        with pytest.raises(RefusedError, match=r"filters \[32008, 1\]") as refused:
            require_filters(h5py.Dataset(made), "x")
    assert refused.value.rule == "unsafe_filter"


def test_a_filter_for_values_of_another_size_is_refused(tmp_path: Path) -> None:
    stored(tmp_path / "x.h5").file.close()
    with h5py.File(tmp_path / "x.h5") as file:
        parameters = file["x"].id.get_create_plist().get_filter(0)[2]
    wrong = (*parameters[:2], 8, *parameters[3:])
    content, layout = (tmp_path / "x.h5").read_bytes(), f"<{len(parameters)}I"
    assert content.count(struct.pack(layout, *parameters)) == 1
    (tmp_path / "x.h5").write_bytes(content.replace(struct.pack(layout, *parameters), struct.pack(layout, *wrong)))
    with (
        h5py.File(tmp_path / "x.h5") as file,
        pytest.raises(RefusedError, match="whose chunks can be verified"),
    ):
        require_filters(file["x"], "x")


@given(data=st.data(), codec=st.sampled_from(["lz4", "zstd"]))
def test_sizes_that_agree_are_all_that_passes(
    data: st.DataObject, codec: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Any bytes of a chunk that name other sizes are refused; bytes within blocks are left to the codec."""
    dataset = stored(tmp_path_factory.mktemp("any") / "x.h5", codec)
    content = dataset.id.read_direct_chunk((0, 0, 0))[1]
    position = data.draw(st.integers(0, HEADER_BYTES + 3))
    changed = bytearray(content)
    changed[position] ^= data.draw(st.integers(1, 255))
    dataset.id.write_direct_chunk((0, 0, 0), bytes(changed))
    if 8 <= position < HEADER_BYTES:
        # Blocks of more than all values, in whole groups of eight, say the same.
        block_bytes = struct.unpack_from(">I", changed, 8)[0]
        if block_bytes % 32 == 0 and block_bytes >= 2 * 9 * 13 * 4 - 2 * 9 * 13 * 4 % 32:
            require_sound_blocks(dataset, 0, 1)
            return
    with pytest.raises(OSError, match="fill the chunk"):
        require_sound_blocks(dataset, 0, 1)


def read_damaged(folder: Path, codec: str, count: int) -> None:
    """Decode damaged chunks that pass the tests; the exit code of the process says whether all were survived."""
    rng = np.random.default_rng(11)
    dataset = stored(folder / "x.h5", codec)
    content = dataset.id.read_direct_chunk((0, 0, 0))[1]
    decoded = 0
    for number in range(count):
        changed = bytearray(content)
        places = rng.integers(0 if number % 2 else HEADER_BYTES + 4, len(content), rng.integers(1, 9))
        for place in places:
            changed[place] = rng.choice([0, 15, 240, 255, rng.integers(256)])
        dataset.id.write_direct_chunk((0, 0, 0), bytes(changed))
        dataset.file.flush()
        try:
            require_sound_blocks(dataset, 0, 1)
            decoded += 1
            dataset[0]
        except READ_ERRORS:
            continue
    assert decoded > count / 3


@pytest.mark.parametrize("codec", ["lz4", "zstd"])
def test_no_damage_ends_the_process(codec: str, tmp_path: Path) -> None:
    process = multiprocessing.get_context("spawn").Process(target=read_damaged, args=(tmp_path, codec, 600))
    process.start()
    process.join()
    assert process.exitcode == 0

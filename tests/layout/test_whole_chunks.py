"""Chunks are held to the bytes that their values and checksums take, each by its own filters."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.layout.decodable import require_whole_chunks
from fedora_qa.layout.hdf5_objects import RefusedError

VALUES = np.arange(64, dtype=np.int32)
FILTERS = {
    "none": {},
    "shuffle": {"shuffle": True},
    "checksum": {"fletcher32": True},
    "gzip and checksum": {"compression": "gzip", "fletcher32": True},
}


def stored(path: Path, **options: object) -> h5py.Dataset:
    return h5py.File(path, "w").create_dataset("x", data=VALUES, chunks=(16,), **options)


@pytest.mark.parametrize("options", FILTERS.values(), ids=FILTERS)
def test_what_is_written_is_whole(options: dict[str, object], tmp_path: Path) -> None:
    """Whatever the filters, what the library writes is taken; and storage without chunks."""
    require_whole_chunks(stored(tmp_path / "whole.h5", **options), "x")
    require_whole_chunks(h5py.File(tmp_path / "plain.h5", "w").create_dataset("x", data=VALUES), "x")


@pytest.mark.parametrize(
    ("name", "size", "whole"),
    [("none", 63, False), ("none", 64, True), ("checksum", 67, False), ("checksum", 68, True),
     ("gzip and checksum", 4, False), ("gzip and checksum", 5, True)],
)  # fmt: skip
def test_a_byte_decides(name: str, size: int, whole: bool, tmp_path: Path) -> None:
    """Sixteen values of four bytes, and four of a checksum; of packed values one byte at least."""
    dataset = stored(tmp_path / "short.h5", **FILTERS[name])
    dataset.id.write_direct_chunk((16,), b"\1" * size)
    if whole:
        require_whole_chunks(dataset, "x")
    else:
        with pytest.raises(RefusedError, match=rf"one of {size} bytes at \(16\)") as refused:
            require_whole_chunks(dataset, "x")
        assert (refused.value.rule, refused.value.cause) == ("short_chunk", "corrupt_chunk")


def test_a_chunk_that_skipped_its_checksum_needs_no_room_for_it(tmp_path: Path) -> None:
    """A chunk says which filters were left out; without the checksum the values alone are whole."""
    dataset = stored(tmp_path / "skipped.h5", fletcher32=True)
    dataset.id.write_direct_chunk((0,), b"\1" * 64, filter_mask=1)
    require_whole_chunks(dataset, "x")

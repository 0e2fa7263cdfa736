"""Attacks that no library would write: bytes patched by hand. Each takes the path of a small file."""

import struct
from pathlib import Path
from typing import Final

import h5py
import numpy as np

BLOSC: Final = struct.pack("<H", 32001)


def filter_that_nobody_has(path: Path) -> None:
    """The Blosc filter of every dataset gets another number, and a name that colours a terminal."""
    content = path.read_bytes()
    named = content.index(b"blosc\0")
    at = content.rindex(BLOSC, 0, named)
    rest = content[at + 2 : at + 8]
    patched = content.replace(BLOSC + rest, struct.pack("<H", 32999) + rest).replace(b"blosc\0", b"\x1b[31m\0"[:6])
    path.write_bytes(patched)


def chunks_at_one_place(path: Path) -> None:
    """Every colour frame is stored where the first is."""
    with h5py.File(path) as file:
        chunks = [file["path/rgb"].id.get_chunk_info(i) for i in range(6)]
    content = bytearray(path.read_bytes())
    first = chunks[0].byte_offset
    for chunk in chunks[1:]:
        place = content.index(struct.pack("<Q", chunk.byte_offset))
        content[place : place + 8] = struct.pack("<Q", first)
    path.write_bytes(bytes(content))


def chunks_beyond_the_end(path: Path) -> None:
    """The chunks of colour frames claim gigabytes each."""
    with h5py.File(path) as file:
        chunks = [file["path/rgb"].id.get_chunk_info(i) for i in range(6)]
    content = bytearray(path.read_bytes())
    for chunk in chunks:
        place = content.index(struct.pack("<Q", chunk.byte_offset))
        key = content.rindex(struct.pack("<I", chunk.size), 0, place)
        content[key : key + 4] = struct.pack("<I", 2**32 - 1)
    path.write_bytes(bytes(content))


def attribute_of_gigabytes(path: Path) -> None:
    """The list of hot pixels claims a thousand million entries."""
    with h5py.File(path, "r+") as file:
        file["metadata/events"].attrs["hot_pixels"] = np.full((77, 2), 3, np.int64)
    content = bytearray(path.read_bytes())
    place = content.index(b"hot_pixels\0")
    sizes = content.index(struct.pack("<QQ", 77, 2), place)
    content[sizes : sizes + 8] = struct.pack("<Q", 2**30)
    path.write_bytes(bytes(content))


def user_block(path: Path) -> None:
    """A program stands before the file, and its own signature after half a megabyte."""
    content = path.read_bytes()
    path.write_bytes(b"#!/bin/sh\necho owned\n".ljust(2**19, b"\0") + content)


def signature_in_the_middle(path: Path) -> None:
    """Two files in one: which is meant?"""
    content = path.read_bytes()
    path.write_bytes(content.ljust(2**20, b"\0") + content)


def tree_that_holds_itself(path: Path) -> None:
    """A node of the chunks' tree claims to be its own child."""
    with h5py.File(path) as file:
        first = file["path/rgb"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    at = content.index(struct.pack("<Q", first.byte_offset))
    node = content.rindex(b"TREE", 0, at)
    content[node + 5] = 1
    content[at : at + 8] = struct.pack("<Q", node)
    path.write_bytes(bytes(content))


def names_out_of_order(path: Path) -> None:
    """Two names of the fastest flow are damaged in the index of their group, which then finds neither."""
    content = path.read_bytes()
    path.write_bytes(content.replace(b"50hz_ts\0", b"5\x01hz_ts\0"))


def chunk_shorter_than_its_checksum(path: Path, key: str = "path/rgb", size: int = 0) -> None:
    """The first chunk of a dataset claims fewer bytes than its checksum takes: HDF5 2.0 reads beyond its memory."""
    with h5py.File(path) as file:
        chunk = file[key].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    place = content.index(struct.pack("<Q", chunk.byte_offset), content.index(b"TREE"))
    at = content.rindex(struct.pack("<II", chunk.size, 0), 0, place)
    content[at : at + 4] = struct.pack("<I", size)
    path.write_bytes(bytes(content))


def chunk_shorter_than_its_values(path: Path) -> None:
    """The index map of frames claims to be one byte and its checksum, which fits: the rest is read from somewhere."""
    chunk_shorter_than_its_checksum(path, "metadata/rgb_to_event", 5)


def text_heap_without_end(path: Path) -> None:
    """The first text of the heap of texts claims 2^64 - 16 bytes: with its header the size wraps around to nothing."""
    content = bytearray(path.read_bytes())
    heap = content.index(b"GCOL")
    content[heap + 24 : heap + 32] = struct.pack("<Q", 2**64 - 16)
    path.write_bytes(bytes(content))


def name_heap_without_end(path: Path) -> None:
    """The first free block of a heap of names is followed by itself."""
    content = bytearray(path.read_bytes())
    heap = content.index(b"HEAP")
    free, start = struct.unpack_from("<QQ", content, heap + 16)
    content[start + free : start + free + 8] = struct.pack("<Q", free)
    path.write_bytes(bytes(content))


def names_of_a_flow_damaged(path: Path) -> None:
    """Two bytes in a heap of names: both datasets of a rate of flow go by others, and nothing else speaks of them."""
    content = path.read_bytes()
    names = b"25hz\0\0\0\x0025hz_ts"
    assert content.count(names) == 1
    path.write_bytes(content.replace(names, b"25hz\x80\0\0\x0025h\x01_ts"))

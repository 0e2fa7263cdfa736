"""Mutants of a small file: of its bytes, chunks, attributes, shapes, types and length. One number makes one mutant."""

from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from types import MappingProxyType
from typing import Any, Final

import h5py
import hdf5plugin  # noqa: F401  makes filter 32001 known to HDF5
import numpy as np

INTERESTING: Final = (0, 1, 0x7F, 0x80, 0xFF)
NUMBERS: Final = (0, 1, -1, 2**15, 2**31 - 1, -(2**31), 2**53, 2**63 - 1, -(2**63))
FLOATS: Final = (0.0, -0.0, 1e-320, 1e308, -1e308, float("nan"), float("inf"), -float("inf"))
TYPES: Final = ("f2", ">f4", "f8", "i1", "u2", ">i8", "u8", "?", "c8", "S4")


def mutate(clean: bytes, seed: int, path: Path) -> str:
    """Write the mutant of a number, and return what kind it is."""
    random = Random(seed)
    kind = random.choice(tuple(KINDS))
    path.write_bytes(clean)
    KINDS[kind](random, path)
    return kind


def _bytes(random: Random, path: Path) -> None:
    content = bytearray(path.read_bytes())
    for _ in range(random.choice((1, 1, 2, 8, 64))):
        content[random.randrange(8, len(content))] = random.choice((*INTERESTING, random.randrange(256)))
    path.write_bytes(content)


def _header_bytes(random: Random, path: Path) -> None:
    """Bytes near the names of HDF5's own structures, which random places in a file hardly ever hit."""
    content = bytearray(path.read_bytes())
    found = [at for mark in (b"TREE", b"SNOD", b"HEAP", b"GCOL") for at in _all(content, mark)]
    at = random.choice([0, *found])
    for _ in range(random.choice((1, 2, 4))):
        place = at + random.randrange(4, 96)
        content[min(place, len(content) - 1)] = random.choice((*INTERESTING, random.randrange(256)))
    path.write_bytes(content)


def _all(content: bytearray, mark: bytes) -> list[int]:
    found, at = [], content.find(mark)
    while at >= 0:
        found.append(at)
        at = content.find(mark, at + 1)
    return found


def _truncated(random: Random, path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: random.randrange(len(content))])


def _chunk(random: Random, path: Path) -> None:
    with h5py.File(path, "r+") as file:
        dataset = random.choice([one for one in _datasets(file) if one.chunks])
        info = dataset.id.get_chunk_info(random.randrange(dataset.id.get_num_chunks()))
    content = bytearray(path.read_bytes())
    for _ in range(random.choice((1, 2, 8))):
        within = random.choice((random.randrange(min(32, info.size)), random.randrange(info.size)))
        content[info.byte_offset + within] = random.choice((*INTERESTING, random.randrange(256)))
    path.write_bytes(content)


def _values(random: Random, path: Path) -> None:
    with h5py.File(path, "r+") as file:
        dataset = random.choice(_datasets(file))
        values = dataset[()]
        start = random.randrange(max(values.size, 1))
        stop = start + random.choice((1, 1, 10, values.size))
        values.reshape(-1)[start:stop] = _value(random, values.dtype)
        dataset[()] = values


def _attribute(random: Random, path: Path) -> None:
    with h5py.File(path, "r+") as file:
        owners = [one for one in (file, *_objects(file)) if len(one.attrs)]
        attrs = random.choice(owners).attrs
        name = random.choice(tuple(attrs))
        if random.random() < 0.2:
            del attrs[name]
            return
        text = "\x1b[2J<script>" + "x" * random.choice((0, 5000))
        choices = (random.choice(NUMBERS), random.choice(FLOATS), text, np.zeros((3, 3)), np.full(3, np.nan), b"\xff",
                   h5py.Empty("f8"), np.zeros(2, dtype=[("a", "f8")]))  # fmt: skip
        attrs[name] = random.choice(choices)


def _shape(random: Random, path: Path) -> None:
    with h5py.File(path, "r+") as file:
        dataset = random.choice(_datasets(file))
        values, name = dataset[()], dataset.name
        shape = list(values.shape)
        shape[random.randrange(len(shape))] = random.choice((0, 1, shape[0] - 1, shape[0] + 1))
        if random.random() < 0.3:
            shape = shape[:-1] if random.random() < 0.5 else [*shape, 1]
        _replace(file, name, np.resize(values, [max(size, 0) for size in shape]))


def _type(random: Random, path: Path) -> None:
    with h5py.File(path, "r+") as file, np.errstate(all="ignore"):
        dataset = random.choice(_datasets(file))
        _replace(file, dataset.name, dataset[()].astype(random.choice(TYPES)))


def _absent(random: Random, path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file[random.choice(_objects(file)).name]


def _replace(file: h5py.File, name: str, values: np.ndarray[Any, Any]) -> None:
    attributes = dict(file[name].attrs)
    del file[name]
    file.create_dataset(name, data=values).attrs.update(attributes)


def _value(random: Random, dtype: np.dtype[Any]) -> Any:
    if dtype.kind == "f":
        return random.choice(FLOATS)
    limits = np.iinfo(dtype)
    return min(max(random.choice(NUMBERS), limits.min), limits.max)


def _objects(file: h5py.File) -> list[Any]:
    found: list[Any] = []
    file.visititems(lambda _, item: found.append(item))
    return found


def _datasets(file: h5py.File) -> list[Any]:
    return [one for one in _objects(file) if isinstance(one, h5py.Dataset)]


KINDS: Final[Mapping[str, Callable[[Random, Path], None]]] = MappingProxyType(
    {
        "bytes": _bytes,
        "header": _header_bytes,
        "truncated": _truncated,
        "chunk": _chunk,
        "values": _values,
        "attribute": _attribute,
        "shape": _shape,
        "type": _type,
        "absent": _absent,
    }
)

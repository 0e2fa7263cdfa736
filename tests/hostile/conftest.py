"""A small clean file, and what the commands make of an attacked copy."""

from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import pytest

from tests.support.handmade import write_handmade

Edit = Callable[[h5py.File], None]
Attacked = Callable[[Edit], Path]


@pytest.fixture(scope="session")
def clean_bytes(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of a small clean file."""
    return write_handmade(tmp_path_factory.mktemp("hostile") / "clean.h5").read_bytes()


@pytest.fixture
def attacked(clean_bytes: bytes, tmp_path: Path) -> Iterator[Attacked]:
    """Make a copy and attack it."""
    target = tmp_path / "attacked.h5"

    def make(edit: Edit) -> Path:
        target.write_bytes(clean_bytes)
        with h5py.File(target, "r+") as file:
            edit(file)
        return target

    yield make
    target.unlink(missing_ok=True)

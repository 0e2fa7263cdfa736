"""A tiny sequence, and the fault that a test plants in a copy of it."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fedora_generator.faults import plant_fault
from tests.generator.fault_amounts.reading import read
from tests.generator.tiny_sequence import (
    declare_noise,
    write_tiny_sequence,
)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clean") / "clean.h5"
    write_tiny_sequence(path)
    declare_noise(path)
    return path


@pytest.fixture
def plant(clean: Path, tmp_path: Path) -> Any:
    """Plant a fault; return a reader of a dataset before and after, and the faulty path."""

    def planted(cause: str, stream: str, magnitude: float | None = None, unit: str | None = None, **more: Any) -> Any:
        target = tmp_path / "faulty.h5"
        plant_fault(clean, target, cause, stream, magnitude, unit, **more)
        return SimpleNamespace(path=target, pair=lambda key: (read(clean, key), read(target, key)))

    return planted

"""Conventions of the sweep change what they are about, and their right names exist."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.causes import CAUSES
from tests.benchmarks.conventions.convention import Array
from tests.benchmarks.conventions.study import CONVENTIONS, first_diagnosis


def contents(path: Path) -> dict[str, Array]:
    """Return all datasets and attributes."""
    values: dict[str, Array] = {}

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        values.update({f"{name}@{key}": np.asarray(value) for key, value in item.attrs.items()})
        if isinstance(item, h5py.Dataset):
            values[name] = item[()]

    with h5py.File(path) as file:
        file.visititems(visit)
    return values


def is_same(first: Array, second: Array) -> bool:
    return np.array_equal(first, second, equal_nan=first.dtype.kind == "f")


@pytest.fixture(scope="module")
def clean_contents(tiny_park_day: Path) -> dict[str, Array]:
    return contents(tiny_park_day)


@pytest.mark.parametrize("name", CONVENTIONS)
def test_a_convention_changes_the_file(
    name: str, tiny_park_day: Path, clean_contents: dict[str, Array], tmp_path: Path
) -> None:
    """It changes some values, and neither types nor shapes, and its right names are causes of their streams."""
    for truth in CONVENTIONS[name].truth:
        stream, cause = truth.split(":")
        assert stream in CAUSES[cause].streams
    target = tmp_path / "changed.h5"
    shutil.copyfile(tiny_park_day, target)
    with h5py.File(target, "r+") as file:
        CONVENTIONS[name].change(file)
    changed = contents(target)
    assert changed.keys() == clean_contents.keys()
    assert not all(is_same(changed[key], clean_contents[key]) for key in changed)
    for key, values in changed.items():
        assert (values.dtype, values.shape) == (clean_contents[key].dtype, clean_contents[key].shape)


@pytest.mark.parametrize(
    ("name", "select"),
    [
        ("quaternions yxzw", ("imu", "pose")),
        ("gyro in optical axes", ("imu", "pose")),
        ("flow -u +v", ("flow_geometry", "flow_rates")),
        ("depth times 4", ("depth.range", "depth.scale")),
        ("mountings inverted", ("depth",)),
    ],
)
def test_conventions_are_named(name: str, select: tuple[str, ...], small_park_day: Path, tmp_path: Path) -> None:
    """One of each table, of which no other convention of its stream is the near name, by checks that fail of it."""
    clean = tmp_path / "clean.h5"
    shutil.copyfile(small_park_day, clean)
    assert first_diagnosis(clean, name, select) in CONVENTIONS[name].truth

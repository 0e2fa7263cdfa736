"""Folders of images are rows in the order of their numbers."""

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.sources.images import images_of, in_order, left_out, number_in, numbers_of
from fedora_qa.sources.source import SourceError
from tests.support.dsec_folder import write_png


def names_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_rows_follow_the_numbers(tmp_path: Path) -> None:
    """Image 10 comes after image 9, with and without leading zeros."""
    for number in (10, 9, 2):
        write_png(tmp_path / f"frame{number}.png", np.full((2, 3), number, np.uint8))
    images = images_of(tmp_path, names_in(tmp_path))
    assert images.shape == (3, 2, 3)
    assert images.rows(0, 3)[:, 0, 0].tolist() == [2, 9, 10]
    assert images.rows(1, 2)[:, 0, 0].tolist() == [9]


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=30, unique=True))
def test_order_is_that_of_the_numbers(numbers: list[int]) -> None:
    """Whatever the order of the listing."""
    names = [f"{number}.png" for number in numbers]
    read = numbers_of(Path(), names)
    assert read is not None
    assert read.rows(0, len(numbers)).tolist() == sorted(numbers)
    assert in_order(names) == [f"{number}.png" for number in sorted(numbers)]


def test_times_in_names(tmp_path: Path) -> None:
    """A name may state seconds with decimals; a name without a number states none."""
    assert float(number_in("1504645177.25.png") or 0) == 1504645177.25
    assert number_in("left.png") is None
    read = numbers_of(Path(), ["1.5.png", "1.25.png"])
    assert read is not None
    assert read.rows(0, 2).tolist() == [1.25, 1.5]
    assert numbers_of(Path(), ["a1.png", "b1.png"]) is None
    assert in_order(["b.png", "a.png"]) == ["a.png", "b.png"]


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [([0, 1, 2], None), ([0, 2, 4], None), ([0, 1, 3, 4], 2), ([0, 2, 4, 8], 6), ([5], None), ([0.5, 1.0, 2.0], None)],
)
def test_gaps(numbers: list[float], missing: int | None) -> None:
    """Equal steps of any length leave out nothing; times may have any steps."""
    assert left_out(np.array(numbers)) == missing


def test_an_image_of_another_size_fails_alone(tmp_path: Path) -> None:
    """The rows before and after it are read."""
    for number, width in enumerate((3, 4, 3)):
        write_png(tmp_path / f"{number}.png", np.zeros((2, width), np.uint8))
    images = images_of(tmp_path, names_in(tmp_path))
    with pytest.raises(SourceError, match=r"1.png of 3 x 2 pixels"):
        images.rows(0, 3)
    assert images.rows(2, 3).shape == (1, 2, 3)


def test_opening_twenty_thousand_images_reads_one_header(tmp_path: Path) -> None:
    """Less than two seconds: names are listed, and nothing but the first header is read."""
    first = tmp_path / "000000.png"
    write_png(first, np.zeros((2, 3), np.uint8))
    for number in range(1, 20_000):
        (tmp_path / f"{number:06d}.png").touch()
    began = time.perf_counter()
    images = images_of(tmp_path, names_in(tmp_path))
    numbers = numbers_of(tmp_path, names_in(tmp_path))
    spent_s = time.perf_counter() - began
    assert images.shape == (20_000, 2, 3)
    assert numbers is not None
    assert spent_s < 2.0

"""A folder of images, a row each, in the order of the numbers in their names."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sources.png import ImageForm, image_form, read_image

_NUMBER: Final = re.compile(r"\d+(?:\.\d+)?$")
"""The number that ends the name of an image: a count (``000123``), or a time (``1504645177.25``)."""


@dataclass(frozen=True, slots=True)
class Images:
    """Images of one size and type, which is that of the first; each is read when its row is.

    Attributes
    ----------
    path
        Their folder.
    names
        (n,) names in the order of rows.
    form
        Size and type of each.
    """

    path: Path
    names: tuple[str, ...]
    form: ImageForm

    @property
    def shape(self) -> tuple[int, ...]:
        """(n, H, W) grey, (n, H, W, channels) else."""
        return (len(self.names), *self.form.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """8 or 16 bits."""
        return np.dtype(self.form.dtype)

    @property
    def rows_together(self) -> int:
        """One image."""
        return 1

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Decode images; raises ``SourceError`` or ``OSError``."""
        decoded = np.empty((stop - start, *self.form.shape), self.dtype)
        for row in range(start, stop):
            decoded[row - start] = read_image(self.path / self.names[row], self.form)
        return decoded


@dataclass(frozen=True, slots=True)
class NumbersOfNames:
    """The numbers in the names of images as rows: their timestamps, where the names state them."""

    path: Path
    numbers: tuple[float | int, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """(n,)."""
        return (len(self.numbers),)

    @property
    def dtype(self) -> np.dtype[Any]:
        """int64 for whole numbers, else float64."""
        return np.dtype(np.int64 if all(isinstance(number, int) for number in self.numbers) else np.float64)

    @property
    def rows_together(self) -> int:
        """Any number."""
        return 0

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Return numbers."""
        return np.array(self.numbers[start:stop], self.dtype)


def images_of(paths: Iterable[Path]) -> Images:
    """Return the images of one folder; only the header of the first is read. Raises ``SourceError`` or ``OSError``."""
    ordered = in_order(paths)
    return Images(ordered[0].parent, tuple(path.name for path in ordered), image_form(ordered[0]))


def numbers_of(paths: Iterable[Path]) -> NumbersOfNames | None:
    """Return the numbers in the names of files, ascending; None where a name has none or two have the same."""
    ordered = in_order(paths)
    numbers = [number_in(path.name) for path in ordered]
    if None in numbers or len(set(numbers)) < len(numbers):
        return None
    exact = [number for number in numbers if number is not None]
    values = tuple(int(number) if number.denominator == 1 else float(number) for number in exact)
    return NumbersOfNames(ordered[0].parent, values)


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Return files in the order of the numbers in their names, of the names where some have none."""
    by_name = sorted(paths, key=lambda path: path.name)
    numbers = [number_in(path.name) for path in by_name]
    # Names without leading zeros: as text, 10 would come before 9.
    if None not in numbers:
        by_number = sorted(zip(numbers, by_name, strict=True), key=lambda pair: (pair[0] or 0, pair[1].name))
        return [path for _, path in by_number]
    return by_name


def number_in(name: str) -> Fraction | None:
    """Return the number at the end of a name without its suffix; None where there is none."""
    match = _NUMBER.search(name.rpartition(".")[0] or name)
    return Fraction(match[0]) if match and len(match[0]) <= 32 else None


def left_out(numbers: NDArray[Any]) -> int | None:
    """Return the first number that a numbering in equal steps leaves out; None where it leaves out none.

    Parameters
    ----------
    numbers
        (n,) whole numbers, ascending.
    """
    steps = np.diff(numbers)
    if not len(steps) or numbers.dtype.kind != "i":
        return None
    # The usual step, not the smallest: DSEC counts every second image.
    usual = int(np.median(steps))
    longer = np.flatnonzero(steps != usual)
    return int(numbers[longer[0]]) + usual if len(longer) and usual else None

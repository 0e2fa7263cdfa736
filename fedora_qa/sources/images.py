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

_LONGEST_NUMBER: Final = 32
"""Digits of such a number; nanoseconds since 1970 have 19."""


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


def images_of(folder: Path, names: Iterable[str]) -> Images:
    """Return the images of a folder by their names; only the header of the first is read.

    Raises
    ------
    SourceError, OSError
        The header cannot be read.
    """
    ordered = in_order(names)
    return Images(folder, tuple(ordered), image_form(folder / ordered[0]))


def numbers_of(folder: Path, names: Iterable[str]) -> NumbersOfNames | None:
    """Return the numbers in names of files, ascending; None where a name has none or two have the same."""
    numbers = [number_in(name) for name in names]
    exact = sorted(number for number in numbers if number is not None)
    if len(set(exact)) < len(numbers):
        return None
    return NumbersOfNames(folder, tuple(int(number) if number == int(number) else float(number) for number in exact))


def in_order(names: Iterable[str]) -> list[str]:
    """Return names in the order of the numbers in them, of the names themselves where some have none."""
    by_name = sorted(names)
    numbers = [number_in(name) for name in by_name]
    if None in numbers:
        return by_name
    # Names without leading zeros: as text, 10 would come before 9. The sort is stable.
    order = sorted(range(len(by_name)), key=lambda place: numbers[place] or 0)
    return [by_name[place] for place in order]


def number_in(name: str) -> int | Fraction | None:
    """Return the number at the end of a name without its suffix; None where there is none."""
    match = _NUMBER.search(name.rpartition(".")[0] or name)
    if not match or len(match[0]) > _LONGEST_NUMBER:
        return None
    return int(match[0]) if match[0].isdecimal() else Fraction(match[0])


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

"""Sums of errors over the pixels of parts of an image, which merge exactly and depend on no order."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Final, get_args

import numpy as np
from numpy.typing import NDArray

from fedora_qa.scoring.types import Split

Float64 = NDArray[np.float64]

PartKey = tuple[Split, str]

_SPLITS: Final = get_args(Split)


@dataclass(frozen=True, slots=True)
class Partition:
    """Pixels divided into parts.

    Attributes
    ----------
    split
        By what.
    parts
        Names of the parts.
    labels
        (H, W) index of the part of each pixel; negative: of none.
    """

    split: Split
    parts: tuple[str, ...]
    labels: NDArray[np.int8]


class ErrorSums:
    """Sums of several quantities over the pixels of each part, of every field apart.

    Totals add the sums of all fields with one rounding (``math.fsum``). So they depend neither on the order of the
    fields nor on which of them were summed together.
    """

    def __init__(self) -> None:
        self._fields: dict[PartKey, list[tuple[float, ...]]] = {}
        self._quantities: tuple[str, ...] = ()

    def add(self, values: Mapping[str, Float64], valid: NDArray[np.bool_], partitions: Sequence[Partition]) -> None:
        """Add a field.

        Parameters
        ----------
        values
            Of each quantity (n,), of the valid pixels in their order; the same quantities in every call.
        valid
            (H, W) which pixels these are.
        partitions
            Ways to divide the pixels, each by another split.
        """
        self._quantities = tuple(values)
        # One cell for each combination of parts; along each axis the first cells are of what is of no part. Every
        # quantity is summed once over the cells, and the cells then along each axis.
        cells = tuple(len(partition.parts) + 1 for partition in partitions)
        places = np.ravel_multi_index([partition.labels[valid].clip(-1) + 1 for partition in partitions], cells)
        counts = np.bincount(places, minlength=prod(cells)).reshape(cells)
        sums = np.stack([np.bincount(places, value, prod(cells)).reshape(cells) for value in values.values()], axis=-1)
        for axis, partition in enumerate(partitions):
            others = tuple(other for other in range(len(cells)) if other != axis)
            part_counts, part_sums = counts.sum(axis=others)[1:], sums.sum(axis=others)[1:]
            for part, count, totals in zip(partition.parts, part_counts, part_sums, strict=True):
                # Also of a part without pixels, so that parts keep their order.
                fields = self._fields.setdefault((partition.split, part), [])
                if count:
                    fields.append(tuple(totals.tolist()))

    def merged(self, other: "ErrorSums") -> "ErrorSums":
        """Return the sums over the fields of both."""
        both = ErrorSums()
        both._quantities = self._quantities or other._quantities
        for side in (self, other):
            for key, fields in side._fields.items():
                both._fields.setdefault(key, []).extend(fields)
        return both

    def totals(self) -> dict[PartKey, dict[str, float]]:
        """Return the total of each quantity by part, ``all`` first; a part without a valid pixel has none."""
        return {
            key: dict(zip(self._quantities, map(math.fsum, zip(*fields, strict=True)), strict=True))
            for key, fields in sorted(self._fields.items(), key=lambda entry: _SPLITS.index(entry[0][0]))
            if fields
        }


def share(part: float, whole: float) -> float | None:
    """Return a part of a whole; None where the whole is 0."""
    return part / whole if whole else None

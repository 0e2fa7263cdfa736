"""Count the values of a dataset that a correct file does not hold. Arrays in, counts out."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.estimators.images.values import count_not_finite, count_outside

_FLOAT32_ROUNDING: Final = 2.0**-22
"""Depth is compared with a range in float64 before it is rounded to float32 (2^-24, relative); two more bits for
a range that was itself rounded."""


@dataclass(frozen=True, slots=True)
class DatasetCounts:
    """Counts over some rows of one dataset. Adding keeps the earlier first place.

    Attributes
    ----------
    values, nan, infinite
        Values read (rows of samples, pixels of images); those that are NaN (of samples: not finite); infinite.
    outside
        Finite values that no correct file holds: depth not above zero, or out of the declared range; flow beyond a
        length.
    rescaled
        Those of ``outside`` that lie in the range once they are multiplied by 1000.
    low, high
        Least and greatest of ``outside``.
    first
        Row, and flat index within the row, of the first value that is wrong; (-1, -1) where there is none.
    filled
        Row and ratio of finite values of each image.
    """

    key: str
    values: int
    nan: int
    infinite: int = 0
    outside: int = 0
    rescaled: int = 0
    low: float = inf
    high: float = -inf
    first: tuple[int, int] = (-1, -1)
    filled: tuple[tuple[int, float], ...] = ()

    def __add__(self, later: "DatasetCounts") -> "DatasetCounts":
        return DatasetCounts(
            key=self.key,
            values=self.values + later.values,
            nan=self.nan + later.nan,
            infinite=self.infinite + later.infinite,
            outside=self.outside + later.outside,
            rescaled=self.rescaled + later.rescaled,
            low=min(self.low, later.low),
            high=max(self.high, later.high),
            first=self.first if self.first[0] >= 0 else later.first,
            filled=self.filled + later.filled,
        )


def add_up(tallies: Iterable[DatasetCounts]) -> tuple[DatasetCounts, ...]:
    """Add up tallies of the same dataset, in the order in which each first occurs."""
    totals: dict[str, DatasetCounts] = {}
    for tally in tallies:
        totals[tally.key] = totals[tally.key] + tally if tally.key in totals else tally
    return tuple(totals.values())


def tally_samples(key: str, start: int, samples: NDArray[np.float64]) -> DatasetCounts:
    """Count samples, (n, columns) from row ``start``, in which any column is not finite."""
    bad = ~np.isfinite(samples).all(axis=1)
    first = (start + int(np.argmax(bad)), 0) if bad.any() else (-1, -1)
    return DatasetCounts(key, len(samples), nan=int(np.count_nonzero(bad)), first=first)


def tally_flow(key: str, row: int, flow_px: NDArray[np.float32], longest_px: float = inf) -> DatasetCounts:
    """Count pixels of a field, (H, W, 2), that are NaN, infinite, or displaced by more than a length along an axis."""
    pixels = flow_px.shape[0] * flow_px.shape[1]
    nan, infinite, beyond = count_not_finite(flow_px, longest_px)
    filled = ((row, 1.0 - nan / pixels),)
    if not infinite and not beyond:
        return DatasetCounts(key, pixels, nan, filled=filled)
    length_px = np.fmax(np.abs(flow_px[..., 0]), np.abs(flow_px[..., 1]))
    bad = (length_px > np.float32(longest_px)) | np.isinf(length_px)
    finite = length_px[bad & np.isfinite(length_px)]
    return DatasetCounts(
        key=key,
        values=pixels,
        nan=nan,
        infinite=infinite,
        outside=beyond,
        low=float(finite.min(initial=inf)),
        high=float(finite.max(initial=-inf)),
        first=_first(row, bad),
        filled=filled,
    )


def tally_depth(key: str, row: int, depth_mm: NDArray[Any], range_m: tuple[float, float] | None) -> DatasetCounts:
    """Count pixels of a frame, (H, W) in mm, that are neither NaN nor within a range in metres (above 0 if None)."""
    nearest_mm, farthest_mm = _bounds_mm(range_m)
    invalid, outside = count_outside(depth_mm, float(nearest_mm), float(farthest_mm))
    filled = ((row, 1.0 - invalid / depth_mm.size),)
    if not outside:
        return DatasetCounts(key, depth_mm.size, invalid, filled=filled)
    bad = ~(((depth_mm >= nearest_mm) & (depth_mm <= farthest_mm)) | np.isnan(depth_mm))
    values = depth_mm[bad]
    finite = values[np.isfinite(values)]
    rescaled_mm = finite.astype(np.float64) * MM_PER_M
    rescaled = (rescaled_mm >= nearest_mm) & (rescaled_mm <= farthest_mm) & (range_m is not None)
    return DatasetCounts(
        key=key,
        values=depth_mm.size,
        nan=invalid,
        infinite=values.size - finite.size,
        outside=finite.size,
        rescaled=int(np.count_nonzero(rescaled)),
        low=float(finite.min(initial=inf)),
        high=float(finite.max(initial=-inf)),
        first=_first(row, bad),
        filled=filled,
    )


def _bounds_mm(range_m: tuple[float, float] | None) -> tuple[np.float32, np.float32]:
    if range_m is None:
        limits = np.finfo(np.float32)
        return limits.smallest_subnormal, limits.max
    nearest_m, farthest_m = range_m
    return (
        np.float32(nearest_m * MM_PER_M * (1 - _FLOAT32_ROUNDING)),
        np.float32(farthest_m * MM_PER_M * (1 + _FLOAT32_ROUNDING)),
    )


def _first(row: int, bad: NDArray[np.bool_]) -> tuple[int, int]:
    return (row, int(np.argmax(bad))) if bad.any() else (-1, -1)

"""Passes over all values of an image: counts, values that a correct file does not hold, and a digest.

Numbers of single precision are read as integers by their bits. Positive numbers are in the same order as these
integers, infinity is 0x7F800000, and all larger ones are NaN. Integers are compared several at a time.

The digest of an image is made of eight lanes of 64 bits, each of which combines every eighth word, and SHA-256 over the
lanes. Each step of a lane is one-to-one in the lane and in the word. Images that differ in one word of a lane therefore
always differ in that lane; other images have the same lane by chance once in 2^64. The digest detects accidents, not
forgery. It takes a seventh of the time of SHA-256 over the whole image.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from math import inf
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M

Bits = NDArray[np.int32]
Words = NDArray[np.uint64]

_INFINITY: Final = np.int32(0x7F800000)
_SIGN: Final = np.int32(0x7FFFFFFF)
"""All bits but that of the sign."""

_SIGNS, _ONES, _TO_NAN = (np.uint64(number << 32 | number) for number in (0x7FFFFFFF, 1, 0x7FFFFFFF - 0x7F800000))
"""For two numbers in one word: the bits without the signs; a one for each; a summand that carries into the sign bit for
NaN only."""
_SIGN_AT, _HALF = np.uint64(31), np.uint64(32)

_FLOAT32_ROUNDING: Final = 2.0**-22
"""Depth is compared with a range in float64 before it is rounded to float32 (2^-24, relative); two more bits for
a range that was itself rounded."""

DIGEST_BYTES: Final = 16

_LANES: Final = 8
_ODD: Final = np.uint64(0x9E3779B97F4A7C15)
"""2^64 over the golden ratio: an odd factor without a pattern in its bits (D. E. Knuth, TAOCP 3, 6.4)."""


def bits_of(values: NDArray[Any]) -> Bits:
    """Return the bits, as int32, of values of any shape in single precision."""
    return np.ascontiguousarray(values, dtype=np.float32).view(np.int32)


def is_of_one_code(image: NDArray[np.uint8]) -> bool:
    """Return whether there are values (H, W, C), and all are equal; most images differ in their first row."""
    if not image.size:
        return False
    first = image.flat[0]
    return bool((image[0] == first).all() and (image == first).all())


def count_codes(rgb: NDArray[np.uint8], every_px: int, counts: NDArray[np.int64]) -> int:
    """Add the number of values of each code to counts, and return the number of clipped pixels.

    Parameters
    ----------
    rgb
        (H, W, 3) codes of a frame.
    every_px
        Every ``every_px``-th row and column is read.
    counts
        (256,) changed in place.

    Returns
    -------
    int
        Number of these pixels with a code of 255 in any channel.
    """
    frame = np.ascontiguousarray(rgb).view()
    frame.flags.writeable = False  # as in decoded frames, so that the loop is compiled once
    return int(_count_codes(frame, every_px, counts))


def count_not_finite(values: NDArray[np.float32], most: float = inf) -> tuple[int, int, int]:
    """Count the vectors of which any component is NaN, infinite, or finite and beyond a length.

    Parameters
    ----------
    values
        (..., 2) of any unit.
    most
        Largest size of a component, in the same unit.

    Returns
    -------
    nan, infinite, beyond
        Numbers of vectors; one vector may count more than once.
    """
    most_bits = bits_of(np.minimum([most], np.finfo(np.float32).max))[0]
    bits = bits_of(values).reshape(-1, 2)
    words = bits.view(np.uint64).reshape(-1)
    if words.flags.aligned:
        words = words.view()
        words.flags.writeable = False  # as in decoded images, so that the loop is compiled once
        above = int(_SIGN) - int(most_bits)
        nan, any_beyond = _count_nan(words, np.uint64(above << 32 | above))
        if not any_beyond:  # the usual case
            return int(nan), 0, 0
    nan, infinite, beyond = _count_not_finite(bits, most_bits)
    return int(nan), int(infinite), int(beyond)


def count_outside(values: NDArray[Any], least: float, most: float) -> tuple[int, int]:
    """Count the values that are NaN, and the other values outside a range.

    Parameters
    ----------
    values
        Of any shape and unit.
    least, most
        Ends of the range, both included; ends below 0 are taken as 0.

    Returns
    -------
    nan, outside
        Numbers of values; negative and infinite ones are outside.
    """
    ends = bits_of(np.maximum([least, most], 0.0))
    nan, outside = _count_outside(bits_of(values).ravel(), ends[0], ends[1])
    return int(nan), int(outside)


def positive_extremes(
    values: NDArray[Any], near: Sequence[tuple[float, float]] = ()
) -> tuple[float, float, NDArray[np.float32]] | None:
    """Return the least and the greatest of the positive finite values, and the values near them.

    Parameters
    ----------
    values
        Of any shape and unit.
    near
        At most two ranges (least, most), positive, both ends included.

    Returns
    -------
    least, most, within
        Extremes, and the values (k,) within any of the ranges, in single precision. None in place of all where no
        value is positive and finite.
    """
    ends = np.array([[1, 0], [1, 0]], np.int32)  # empty ranges
    for i, (low, high) in enumerate(near):
        ends[i] = bits_of(np.array([low, high]))
    flat = bits_of(values).ravel()
    least, most, within = _positive_extremes(flat, *ends.ravel())
    if most == 0:
        return None
    low, high = np.array([least, most], np.int32).view(np.float32).tolist()
    return low, high, within.view(np.float32)


@njit(cache=True)
def _count_codes(rgb: NDArray[np.uint8], every_px: int, counts: NDArray[np.int64]) -> int:
    at_end = 0
    for row in range(0, rgb.shape[0], every_px):
        line = rgb[row]
        for column in range(0, rgb.shape[1], every_px):
            red, green, blue = line[column, 0], line[column, 1], line[column, 2]
            counts[red] += 1
            counts[green] += 1
            counts[blue] += 1
            at_end += max(red, green, blue) == 255
    return at_end


@njit(cache=True)
def _count_nan(words: Words, to_most: np.uint64) -> tuple[int, bool]:
    """Count the vectors (n,) of which any of two numbers is NaN.

    Return also whether any number that is not NaN is beyond a bound. Both numbers of a word are compared in one step. A
    summand carries into the sign bit for numbers above a bound only, and no further. So eight numbers are compared in
    the time of four.
    """
    nan, beyond = np.uint64(0), np.uint64(0)
    for i in range(len(words)):
        sizes = words[i] & _SIGNS
        are_nan, are_beyond = ((sizes + _TO_NAN) >> _SIGN_AT) & _ONES, ((sizes + to_most) >> _SIGN_AT) & _ONES
        nan += (are_nan | (are_nan >> _HALF)) & np.uint64(1)
        beyond |= are_nan ^ are_beyond
    return int(nan), beyond != 0


@njit(cache=True)
def _count_not_finite(bits: Bits, most: np.int32) -> tuple[int, int, int]:
    nan, infinite, beyond = np.int32(0), np.int32(0), np.int32(0)
    for i in range(len(bits)):
        u, v = bits[i, 0] & _SIGN, bits[i, 1] & _SIGN
        nan += (u > _INFINITY) | (v > _INFINITY)
        infinite += (u == _INFINITY) | (v == _INFINITY)
        beyond += ((u > most) & (u < _INFINITY)) | ((v > most) & (v < _INFINITY))
    return int(nan), int(infinite), int(beyond)


@njit(cache=True)
def _count_outside(bits: Bits, least: np.int32, most: np.int32) -> tuple[int, int]:
    nan, inside = np.int32(0), np.int32(0)
    for i in range(len(bits)):
        nan += (bits[i] & _SIGN) > _INFINITY
        inside += (bits[i] >= least) & (bits[i] <= most)
    return int(nan), int(len(bits) - nan - inside)


@njit(cache=True)
def _positive_extremes(
    bits: Bits, low: np.int32, high: np.int32, low_too: np.int32, high_too: np.int32
) -> tuple[np.int32, np.int32, Bits]:
    """Return the extremes, and the values in one of two ranges, ``low`` to ``high`` and ``low_too`` to ``high_too``.

    All are bits of positive numbers; ends are included. Blocks whose own extremes reach neither range are not searched.
    """
    least, most = _INFINITY, np.int32(0)
    within, count = np.empty(0, np.int32), 0
    for start in range(0, len(bits), 4096):
        block = bits[start : start + 4096]
        nearest, farthest = _INFINITY, np.int32(0)
        for i in range(len(block)):
            value = block[i]
            valid = (value > 0) & (value < _INFINITY)
            nearest = min(nearest, value if valid else _INFINITY)
            farthest = max(farthest, value if valid else np.int32(0))
        least, most = min(least, nearest), max(most, farthest)
        if (nearest <= high and low <= farthest) or (nearest <= high_too and low_too <= farthest):
            if len(within) < count + len(block):
                longer = np.empty(2 * count + len(block), np.int32)
                for i in range(count):
                    longer[i] = within[i]
                within = longer
            for i in range(len(block)):  # without a branch: the next value overwrites one out of range
                value = block[i]
                within[count] = value
                count += ((low <= value) & (value <= high)) | ((low_too <= value) & (value <= high_too))
    return least, most, within[:count]


@dataclass(frozen=True, slots=True)
class DatasetCounts:
    """Counts over some rows of one dataset. A sum keeps the first location of the earlier summand.

    Attributes
    ----------
    key
        Name of the dataset.
    values, nan, infinite
        Number of values read (rows of samples, pixels of images); of those that are NaN (of samples: not finite);
        of infinite ones.
    outside
        Number of finite values that no correct file holds: depth not above zero, or out of the declared range; flow
        beyond a length.
    rescaled
        Number of those of ``outside`` that lie in the range if they are multiplied by 1000.
    low, high
        Least and greatest of ``outside``, in the unit of the file.
    first
        Row, and flat index within the row, of the first wrong value; (-1, -1) where there is none.
    filled
        Row of each image, and the share of its values that are not NaN.
    rescaled_rows
        Rows of images of which most values lie in the range only if they are multiplied by 1000.
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
    rescaled_rows: tuple[int, ...] = ()

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
            rescaled_rows=self.rescaled_rows + later.rescaled_rows,
        )


def add_up(tallies: Iterable[DatasetCounts]) -> tuple[DatasetCounts, ...]:
    """Return the sums of the tallies of each dataset, in the order in which datasets first occur."""
    totals: dict[str, DatasetCounts] = {}
    for tally in tallies:
        totals[tally.key] = totals[tally.key] + tally if tally.key in totals else tally
    return tuple(totals.values())


def tally_samples(key: str, start: int, samples: NDArray[np.float64]) -> DatasetCounts:
    """Return counts of samples of which any column is not finite.

    Parameters
    ----------
    start
        Row of the first sample in the dataset.
    samples
        (n, columns) of any unit.

    Returns
    -------
    DatasetCounts
        Samples that are not finite count as ``nan``.
    """
    bad = ~np.isfinite(samples).all(axis=1)
    first = (start + int(np.argmax(bad)), 0) if bad.any() else (-1, -1)
    return DatasetCounts(key, len(samples), nan=int(np.count_nonzero(bad)), first=first)


def tally_flow(key: str, row: int, flow_px: NDArray[np.float32], longest_px: float = inf) -> DatasetCounts:
    """Return counts of pixels of a field that are NaN, infinite, or displaced by more than a length along an axis.

    Parameters
    ----------
    row
        Of the field in the dataset.
    flow_px
        (H, W, 2) px.
    longest_px
        Largest size of a component of a correct flow, px.

    Returns
    -------
    DatasetCounts
        Of this field.
    """
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
    """Return counts of pixels of a depth frame that are NaN or outside a range.

    Parameters
    ----------
    row
        Of the frame in the dataset.
    depth_mm
        (H, W) mm.
    range_m
        Declared range, m, both ends included; None: all positive values are inside.

    Returns
    -------
    DatasetCounts
        Of this frame.
    """
    limits = np.finfo(np.float32)
    nearest_mm, farthest_mm = limits.smallest_subnormal, limits.max
    if range_m is not None:
        nearest_mm = np.float32(range_m[0] * MM_PER_M * (1 - _FLOAT32_ROUNDING))
        farthest_mm = np.float32(range_m[1] * MM_PER_M * (1 + _FLOAT32_ROUNDING))
    invalid, outside = count_outside(depth_mm, float(nearest_mm), float(farthest_mm))
    filled = ((row, 1.0 - invalid / depth_mm.size),)
    if not outside:
        return DatasetCounts(key, depth_mm.size, invalid, filled=filled)
    bad = ~(((depth_mm >= nearest_mm) & (depth_mm <= farthest_mm)) | np.isnan(depth_mm))
    values = depth_mm[bad]
    finite = values[np.isfinite(values)]
    rescaled_mm = finite.astype(np.float64) * MM_PER_M
    rescaled = (rescaled_mm >= nearest_mm) & (rescaled_mm <= farthest_mm) & (range_m is not None)
    count = int(np.count_nonzero(rescaled))
    return DatasetCounts(
        key=key,
        values=depth_mm.size,
        nan=invalid,
        infinite=values.size - finite.size,
        outside=finite.size,
        rescaled=count,
        low=float(finite.min(initial=inf)),
        high=float(finite.max(initial=-inf)),
        first=_first(row, bad),
        filled=filled,
        rescaled_rows=(row,) if 2 * count > depth_mm.size - invalid else (),
    )


def _first(row: int, bad: NDArray[np.bool_]) -> tuple[int, int]:
    return (row, int(np.argmax(bad))) if bad.any() else (-1, -1)


def digest_of(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the digest of the shape and of all bytes of an image.

    Parameters
    ----------
    image
        Of any shape.

    Returns
    -------
    ndarray of uint8
        (16,).
    """
    flat = np.ascontiguousarray(image).reshape(-1)
    whole = flat.size // (8 * _LANES) * (8 * _LANES)
    words = flat[:whole].view(np.uint64)
    words = words.view() if words.flags.aligned else words.copy()
    words.flags.writeable = False  # as in decoded images, so that the loop is compiled once
    # Bytes that fill no row of lanes, and the shape, enter SHA-256 as they are.
    lanes = _fold_all(words).tobytes() + flat[whole:].tobytes() + repr(image.shape).encode()
    return np.frombuffer(sha256(lanes).digest()[:DIGEST_BYTES], np.uint8)


@njit(cache=True)
def _fold_all(words: Words) -> Words:
    """Return the lanes (8,) after all words, whose number is a multiple of eight."""
    a = b = c = d = e = f = g = h = _ODD
    for i in range(0, len(words), 8):
        a, b, c, d = _fold(a, words[i]), _fold(b, words[i + 1]), _fold(c, words[i + 2]), _fold(d, words[i + 3])
        e, f, g, h = _fold(e, words[i + 4]), _fold(f, words[i + 5]), _fold(g, words[i + 6]), _fold(h, words[i + 7])
    return np.array([a, b, c, d, e, f, g, h])


@njit(cache=True)
def _fold(lane: np.uint64, word: np.uint64) -> np.uint64:
    mixed = (lane ^ word) * _ODD
    return mixed ^ (mixed >> _HALF)

"""Values that are no numbers, or stand for none: NaN and infinity, and how invalid pixels are marked."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import Measured, Observation, Suspect, WindowCheck
from fedora_qa.conventions import MM_PER_M
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.binding import INVALID_STAMP_NS
from fedora_qa.layout.canonical import DATASETS, STREAMS
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

_SAMPLE_KEYS: Final = (
    "path/imu/angular_velocity",
    "path/imu/linear_acceleration",
    "path/pose/position",
    "path/pose/orientation",
)
_FLOAT_KEYS: Final = tuple(
    key for key, spec in DATASETS.items() if spec.dtype.startswith("float") and spec.stream in STREAMS
)
_FLOAT32_ROUNDING: Final = 2.0**-22
"""Depth is compared with a range in float64 before it is rounded to float32 (2^-24, relative); two more bits for
a range that was itself rounded."""

_MOST: Final = 0.9
"""Share of the values that a wrong unit must explain to be suspected: it befalls all of them, edge cases aside."""


@dataclass(frozen=True, slots=True)
class Tally:
    """Counts over the rows of one dataset in one window; adding two keeps the earlier first place.

    Attributes
    ----------
    values, nan
        Values looked at (rows of samples, pixels of images), and how many of them are NaN.
    infinite
        Values that are infinite.
    outside
        Finite values that no honest file holds: depth not above zero, or out of the declared range.
    rescaled
        Those of ``outside`` that lie in the range once they are multiplied by 1000.
    low, high
        Least and greatest of ``outside``.
    first
        Row and flat index within the row of the first bad value; (-1, -1) where there is none.
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

    def __add__(self, later: "Tally") -> "Tally":
        return Tally(
            self.key,
            self.values + later.values,
            self.nan + later.nan,
            self.infinite + later.infinite,
            self.outside + later.outside,
            self.rescaled + later.rescaled,
            min(self.low, later.low),
            max(self.high, later.high),
            self.first if self.first[0] >= 0 else later.first,
        )


class Finite(WindowCheck[tuple[Tally, ...]]):
    """Are all values finite where they must be, and invalid pixels NaN?

    Samples of IMU and pose must be finite, stamps too. Depth is finite and within ``depth_range`` (above zero where
    none is declared) or NaN; flow is finite or NaN; neither is ever infinite. Counts the values that break this. When
    all depth outside the range falls into it once multiplied by 1000, metres are suspected; when it is all one number,
    a code for invalid pixels. Exact for what was decoded. Where the NaN must lie is for the checks of flow and depth.
    """

    name = "integrity.finite"

    def measure(self, window: Window) -> tuple[Tally, ...]:
        """Tally every float dataset of the window."""
        streams = ((key, DATASETS[key].stream) for key in _FLOAT_KEYS)
        present = [(key, stream) for key, stream in streams if stream in window.facts.streams]
        return _totals(tally for key, stream in present for tally in _tallies(window, key, window.owned(stream)))

    def conclude(self, state: Sequence[tuple[Tally, ...]], facts: Facts) -> Observation:
        """Add up, in the order of time."""
        totals = _totals(tally for window in state for tally in window)
        measured = [m for total in totals for m in _measured(total, facts)]
        measured += [m for stream in sorted(facts.clocks) for m in _stamps(facts, stream)]
        seen = sum(total.values for total in totals)
        unobservable = "" if measured else "there is no stream whose values could be other than finite"
        coverage = Coverage(seen, max(seen, _of(facts)), "values")
        return Observation(coverage, tuple(measured), unobservable=unobservable)


def _totals(tallies: Iterable[Tally]) -> tuple[Tally, ...]:
    """Add up tallies of the same dataset."""
    totals: dict[str, Tally] = {}
    for tally in tallies:
        totals[tally.key] = totals[tally.key] + tally if tally.key in totals else tally
    return tuple(totals.values())


def _tallies(window: Window, key: str, owned: range) -> Iterator[Tally]:
    """Tally what decodes; the rest is a finding of ``integrity.readable``."""
    blocks = [(owned.start, owned.stop)] if key in _SAMPLE_KEYS else [(row, row + 1) for row in owned]
    for start, stop in blocks:
        with suppress(UnreadableRowsError):
            yield _tally(key, start, window.rows(key, start, stop), window.facts)


def _tally(key: str, start: int, rows: NDArray[Any], facts: Facts) -> Tally:
    if key in _SAMPLE_KEYS:
        return tally_samples(key, start, rows)
    if key == "path/depth":
        return tally_depth(key, start, rows[0], facts.declared.depth_range_m)
    return tally_flow(key, start, rows[0])


def tally_samples(key: str, start: int, samples: NDArray[np.float64]) -> Tally:
    """Count samples, (n, columns) from row ``start``, in which any column is not finite."""
    bad = ~np.isfinite(samples).all(axis=1)
    first = (start + int(np.argmax(bad)), 0) if bad.any() else (-1, -1)
    return Tally(key, len(samples), nan=int(np.count_nonzero(bad)), first=first)


def tally_flow(key: str, row: int, flow_px: NDArray[np.float32]) -> Tally:
    """Count NaN and infinite pixels of a field, (H, W, 2)."""
    infinite = np.isinf(flow_px[..., 0]) | np.isinf(flow_px[..., 1])
    nan = int(np.count_nonzero(np.isnan(flow_px[..., 0])))
    return Tally(key, infinite.size, nan, infinite=int(np.count_nonzero(infinite)), first=_first(row, infinite))


def tally_depth(key: str, row: int, depth_mm: NDArray[Any], range_m: tuple[float, float] | None) -> Tally:
    """Count pixels of a depth frame, (H, W) in mm, that are neither NaN nor within the range."""
    nearest_mm, farthest_mm = _bounds_mm(range_m)
    nan = np.isnan(depth_mm)
    bad = ~(((depth_mm >= nearest_mm) & (depth_mm <= farthest_mm)) | nan)
    if not bad.any():
        return Tally(key, nan.size, int(np.count_nonzero(nan)))
    values = depth_mm[bad]
    finite = values[np.isfinite(values)]
    rescaled = np.zeros(0, dtype=bool)
    if range_m is not None:
        metres = finite.astype(np.float64) * MM_PER_M
        rescaled = (metres >= nearest_mm) & (metres <= farthest_mm)
    return Tally(
        key,
        nan.size,
        int(np.count_nonzero(nan)),
        infinite=values.size - finite.size,
        outside=finite.size,
        rescaled=int(np.count_nonzero(rescaled)),
        low=float(finite.min(initial=inf)),
        high=float(finite.max(initial=-inf)),
        first=_first(row, bad),
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


def _measured(total: Tally, facts: Facts) -> Iterator[Measured]:
    stream = DATASETS[total.key].stream
    if total.key in _SAMPLE_KEYS:
        name = total.key.removeprefix("path/")
        yield _count(facts, total, f"{name}.not_finite", total.nan, "samples",
                     f"{total.nan} of {total.values} samples of {name} are not finite; integration would end there",
                     Suspect("nan_in_stream", stream, 1.0, float(total.nan), "samples"))  # fmt: skip
        return
    yield _count(facts, total, f"{stream}.infinite", total.infinite, "pixels",
                 f"{total.infinite} pixels of {stream} are infinite; where there is no value it must be NaN",
                 Suspect("invalid_encoding", stream, 1.0))  # fmt: skip
    if total.key == "path/depth":
        yield _count(facts, total, "depth.outside_range", total.outside, "pixels",
                     _outside_statement(total, facts), *_outside_suspects(total))  # fmt: skip


def _outside_statement(total: Tally, facts: Facts) -> str:
    range_m = facts.declared.depth_range_m
    expected = f"{range_m[0]:g} to {range_m[1]:g} m" if range_m else "above zero"
    return (
        f"{total.outside} of {total.values} depth pixels lie between {total.low / MM_PER_M:.6g} and "
        f"{total.high / MM_PER_M:.6g} m; expected {expected}, or NaN"
    )


def _outside_suspects(total: Tally) -> tuple[Suspect, ...]:
    """Metres read as millimetres if that explains the values; one constant is a code; scattered values, unknown."""
    finite = total.values - total.nan - total.infinite
    if total.rescaled > _MOST * finite:
        return (Suspect("unit_mm_m", "depth", 0.9, 1 / MM_PER_M, "1"),)
    if total.low == total.high:
        return (Suspect("invalid_encoding", "depth", 1.0),)
    return (Suspect("invalid_encoding", "depth", 0.5), Suspect("unit_mm_m", "depth", 0.3))


def _stamps(facts: Facts, stream: str) -> Iterator[Measured]:
    clock = facts.clocks[stream]
    bad = clock.times_ns == INVALID_STAMP_NS
    if clock.ends_ns is not None:
        bad = bad | (clock.ends_ns == INVALID_STAMP_NS)
    count = int(np.count_nonzero(bad))
    first = (int(np.argmax(bad)), 0) if count else (-1, -1)
    tally = Tally(f"path/{stream}", len(bad), count, first=first)
    yield _count(facts, tally, f"{stream}.stamps_not_finite", count, "samples",
                 f"{count} stamps of {stream} are NaN; these samples have no place in time",
                 Suspect("nan_in_stream", stream, 1.0, float(count), "samples"))  # fmt: skip


def _count(
    facts: Facts, total: Tally, name: str, value: int, unit: str, statement: str, *suspects: Suspect
) -> Measured:
    return count_of_faults(
        name,
        value,
        unit,
        statement=statement,
        code=f"integrity.finite.{name.rsplit('.', 1)[1]}",
        where=_where(facts, total),
        severity="critical",
        suspects=suspects,
    )


def _where(facts: Facts, total: Tally) -> Where:
    stream = total.key.removeprefix("path/") if total.key not in DATASETS else DATASETS[total.key].stream
    row, flat = total.first
    if row < 0:
        return Where(stream=stream)
    time_ns = int(facts.clocks[stream].times_ns[row])
    start_us = facts.to_file_us(time_ns) if time_ns != INVALID_STAMP_NS else None
    if total.key not in DATASETS or not DATASETS[total.key].is_image:
        return Where(stream=stream, start_us=start_us, index_start=row)
    width = facts.layout.bindings[total.key].shape[2]
    return Where(stream=stream, start_us=start_us, index_start=row, frame=row, pixel=(flat % width, flat // width))


def _of(facts: Facts) -> int:
    """Count the values that a whole reading would look at."""
    of = 0
    for key in _FLOAT_KEYS:
        if DATASETS[key].stream in facts.streams:
            binding = facts.layout.bindings[key]
            of += binding.rows * (binding.shape[1] * binding.shape[2] if DATASETS[key].is_image else 1)
    return of

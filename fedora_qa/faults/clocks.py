"""Faults of the clock of a stream: an offset, a wrong rate, another unit.

Timestamps without a place in time (NaN, or farther than int64 nanoseconds reach) stay as they are. Index maps are left
as stored when a fault is planted. When it is undone, entries that follow the faulty timestamps follow the undone ones.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS
from fedora_qa.faults.fault import Fault
from fedora_qa.faults.index_maps import with_following_maps
from fedora_qa.faults.reversible import RowRange, in_rows, streams_in
from fedora_qa.layout.binding import FARTHEST_TIMESTAMP_NS
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.sequence.facts import Facts, has_place
from fedora_qa.sequence.sequence import SequenceRows

Int64 = NDArray[np.int64]

_LARGEST_WHOLE: Final = 10**9
"""Largest factor between two units of time that occur (s and ns)."""


@dataclass(frozen=True, slots=True)
class ClockShift:
    """Timestamps are late by a constant.

    Attributes
    ----------
    stream
        With timestamps.
    offset_ns
        Offset, ns, rounded to whole ones; positive: late.
    rows
        Rows whose timestamps are late; None: all.
    """

    stream: str
    offset_ns: float
    rows: RowRange | None = None
    cause: ClassVar[str] = "time_offset"

    @property
    def magnitude(self) -> float:
        """Offset, ms."""
        return self.offset_ns / NS_PER_MS

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the offset."""
        offset_ns = round(self.offset_ns)
        return _retimed(facts, self, f"{self.stream} {self.magnitude:.4g} ms late", lambda t: t + offset_ns)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the offset."""
        offset_ns = round(self.offset_ns)
        fault = _retimed(facts, self, f"{self.stream} {self.magnitude:.4g} ms earlier", lambda t: t - offset_ns)
        return with_following_maps(facts, sequence, fault)


@dataclass(frozen=True, slots=True)
class ClockRate:
    """The clock is fast: ``t' = t + e (t - pivot)``.

    Attributes
    ----------
    stream
        With timestamps.
    rate_error_ppm
        1e6 e; positive: timestamps lie too far apart.
    pivot_ns
        The timestamp that stays, ns from the file's origin.
    rows
        Rows whose timestamps are altered; None: all.
    """

    stream: str
    rate_error_ppm: float
    pivot_ns: int = 0
    rows: RowRange | None = None
    cause: ClassVar[str] = "clock_rate"

    @property
    def magnitude(self) -> float:
        """Rate error, ppm."""
        return self.rate_error_ppm

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Stretch the times from the pivot."""
        description = f"the clock of {self.stream} is wrong by {self.rate_error_ppm:.3g} ppm"
        return _retimed(facts, self, description, self._stretching(1e-6 * self.rate_error_ppm))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Shorten the times from the pivot."""
        # (t' - pivot) / (1 + e) = (t' - pivot) - (t' - pivot) e / (1 + e)
        error = 1e-6 * self.rate_error_ppm
        description = f"the clock of {self.stream} slower by {self.rate_error_ppm:.3g} ppm"
        fault = _retimed(facts, self, description, self._stretching(-error / (1 + error)))
        return with_following_maps(facts, sequence, fault)

    def _stretching(self, rate: float) -> Callable[[Int64], Int64]:
        # Only the small difference is rounded to float64: times themselves stay whole nanoseconds.
        return lambda t: t + np.rint(rate * (t - self.pivot_ns)).astype(np.int64)


@dataclass(frozen=True, slots=True)
class TimeUnit:
    """Timestamps are in another unit than the file's: ``t' = pivot + factor (t - pivot)``.

    Attributes
    ----------
    stream
        With timestamps.
    factor
        Stored over correct number: 1000 for nanoseconds that are read as microseconds.
    pivot_ns
        The timestamp that stays, ns from the file's origin; None: zero of the file's own clock.
    rows
        Rows whose timestamps are in the other unit; None: all.
    """

    stream: str
    factor: float
    pivot_ns: int | None = None
    rows: RowRange | None = None
    cause: ClassVar[str] = "time_unit"

    @property
    def magnitude(self) -> float:
        """Stored over correct number."""
        return self.factor

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply the times by the factor."""
        description = f"timestamps of {self.stream} are {self.factor:.6g} times as large"
        factor = Fraction(self.factor).limit_denominator(_LARGEST_WHOLE)
        return _retimed(facts, self, description, self._scaling(factor, sequence))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide the times by the factor."""
        description = f"timestamps of {self.stream} divided by {self.factor:.6g}"
        factor = 1 / Fraction(self.factor).limit_denominator(_LARGEST_WHOLE)
        fault = _retimed(facts, self, description, self._scaling(factor, sequence))
        return with_following_maps(facts, sequence, fault)

    def _scaling(self, factor: Fraction, sequence: SequenceRows) -> Callable[[Int64], Int64]:
        # The file's own clock is zero at -origin, on the clock that counts from the origin.
        pivot_ns = -sequence.origin_ns if self.pivot_ns is None else self.pivot_ns

        def scaled(times_ns: Int64) -> Int64:
            elapsed_ns = times_ns - pivot_ns
            if factor.denominator == 1:
                # Clipped before the product, so that no timestamp wraps around int64.
                reach_ns = FARTHEST_TIMESTAMP_NS // factor.numerator
                return np.asarray(pivot_ns + np.clip(elapsed_ns, -reach_ns, reach_ns) * factor.numerator)
            if factor.numerator == 1:
                # Rounded to the nearest whole number; float64 would round epoch times to 256 ns.
                return np.asarray(pivot_ns + (elapsed_ns + factor.denominator // 2) // factor.denominator)
            return np.asarray(pivot_ns + np.rint(elapsed_ns * float(factor)).astype(np.int64))

        return scaled


def _retimed(
    facts: Facts, fault: ClockShift | ClockRate | TimeUnit, description: str, retime: Callable[[Int64], Int64]
) -> Fault:
    """Return the fault that applies ``retime`` to the timestamps (n,), or (n, 2) of flow, that have a place in time."""
    farthest = FARTHEST_TIMESTAMP_NS

    def alter(times_ns: NDArray[Any]) -> NDArray[Any]:
        placed = has_place(times_ns)
        retimed = np.clip(retime(np.where(placed, times_ns, 0)), -farthest, farthest)
        return np.where(placed, retimed, times_ns)

    keys = [timestamps_of(name) for name in streams_in(facts, fault.stream)]
    return Fault(description, dict.fromkeys(keys, in_rows(alter, fault.rows)))

"""Faults of the clock of a stream: an offset, a wrong rate, another unit; and canaries of timestamps and maps.

Timestamps without a place in time (NaN, or farther than int64 nanoseconds reach) stay as they are. Index maps are left
as stored when a fault is planted. When it is undone, entries that follow the faulty timestamps follow the undone ones.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil, sqrt
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_US, US_PER_S
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import Fault, RowRange, in_rows, rows_from, streams_in, values, values_by_row
from fedora_qa.faults.index_maps import IndexShift, with_following_maps
from fedora_qa.faults.row_order import Unsorted
from fedora_qa.layout.binding import FARTHEST_TIMESTAMP_NS
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.sequence.facts import Facts, has_place
from fedora_qa.sequence.sequence import SequenceRows

Int64 = NDArray[np.int64]

_SEED = 1
_THOUSAND = 1_000
_COARSE_TICKS = 1_000
"""Ratio of the coarse grid to the declared one. By chance a thousand events lie on the coarse grid with a probability
of 1e-3000."""

_LARGEST_WHOLE: Final = 10**9
"""Largest factor between two units of time that occur (s and ns)."""


def _on_regular_clock(times_ns: Int64, regular_ns: tuple[float, float] | None, facts: Facts) -> Int64:
    """Return the nearest times of a regular clock, in whole microseconds of the file; the times without one."""
    if regular_ns is None:
        return times_ns
    start_ns, period_ns = regular_ns
    return _in_microseconds(start_ns + np.rint((times_ns - start_ns) / period_ns) * period_ns, facts)


def _in_microseconds(times_ns: NDArray[np.floating[Any]], facts: Facts) -> Int64:
    """Return times, rounded to whole microseconds of the file."""
    zero_ns = facts.from_file_us(0.0)
    return np.asarray(zero_ns + NS_PER_US * np.rint((times_ns - zero_ns) / NS_PER_US).astype(np.int64))


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
    regular_ns
        First instant and period, ns, of a regular clock whose times were late by about the offset, each by a time of
        its own; undone, the timestamp of each row is that of the clock, in whole microseconds. None: late by the
        constant.
    while_ns
        True times from which on, and before which, timestamps are late, ns from the file's origin; None at an end: up
        to that end of the stream. Undone, all timestamps that such a late one can have are moved. None: always.
    """

    stream: str
    offset_ns: float
    rows: RowRange | None = None
    regular_ns: tuple[float, float] | None = None
    while_ns: tuple[int | None, int | None] | None = None
    cause: ClassVar[str] = "time_offset"

    @property
    def magnitude(self) -> float:
        """Offset, ms."""
        return self.offset_ns / NS_PER_MS

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the offset."""
        offset_ns = round(self.offset_ns)
        description = f"{self.stream} {self.magnitude:.4g} ms late{self._place(facts)}"
        return _retimed(facts, self, description, lambda t: np.where(self._holds_at(t), t + offset_ns, t))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the offset."""
        offset_ns = round(self.offset_ns)
        description = f"{self.stream} {self.magnitude:.4g} ms earlier{self._place(facts)}"
        if self.regular_ns is not None:
            start_ns, period_ns = self.regular_ns
            description += f", every {period_ns / NS_PER_MS:.6g} ms"
            # By the number of the row: a delay may be longer than a period.
            of_rows = values_by_row(lambda _, rows: _in_microseconds(start_ns + period_ns * rows, facts))
            keys = [timestamps_of(name) for name in streams_in(facts, self.stream)]
            return with_following_maps(facts, sequence, Fault(description, dict.fromkeys(keys, of_rows)))

        def earlier(times_ns: Int64) -> Int64:
            true_ns = times_ns - offset_ns
            return np.where(self._holds_at(true_ns), true_ns, times_ns)

        return with_following_maps(facts, sequence, _retimed(facts, self, description, earlier))

    def _holds_at(self, true_ns: Int64) -> NDArray[np.bool_]:
        start_ns, stop_ns = self.while_ns or (None, None)
        late = np.ones(true_ns.shape, np.bool_) if start_ns is None else true_ns >= start_ns
        return late if stop_ns is None else late & (true_ns < stop_ns)

    def _place(self, facts: Facts) -> str:
        start_ns, stop_ns = self.while_ns or (None, None)
        words = (("from", start_ns), ("until", stop_ns))
        return "".join(f" {word} {facts.to_file_us(ns) / US_PER_S:.6g} s" for word, ns in words if ns is not None)


@dataclass(frozen=True, slots=True)
class ClockRate:
    """The clock is fast: ``t' = t + e (t - pivot)``, or for a while only, after which it keeps its offset.

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
    duration_ns
        True time from the pivot for which the clock is fast: times before keep their values, and times after it are
        late by ``e`` times the duration. None: the clock is fast throughout.
    """

    stream: str
    rate_error_ppm: float
    pivot_ns: int = 0
    rows: RowRange | None = None
    duration_ns: int | None = None
    cause: ClassVar[str] = "clock_rate"

    @property
    def magnitude(self) -> float:
        """Rate error, ppm."""
        return self.rate_error_ppm

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Stretch the times from the pivot."""
        description = f"the clock of {self.stream} is wrong by {self.rate_error_ppm:.3g} ppm"
        return _retimed(facts, self, description, self._stretching(1e-6 * self.rate_error_ppm, self.duration_ns))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Shorten the times from the pivot."""
        # (t' - pivot) / (1 + e) = (t' - pivot) - (t' - pivot) e / (1 + e)
        error = 1e-6 * self.rate_error_ppm
        description = f"the clock of {self.stream} slower by {self.rate_error_ppm:.3g} ppm"
        # The fast clock counts (1 + e) times the duration.
        duration_ns = None if self.duration_ns is None else round((1 + error) * self.duration_ns)
        fault = _retimed(facts, self, description, self._stretching(-error / (1 + error), duration_ns))
        return with_following_maps(facts, sequence, fault)

    def _stretching(self, rate: float, duration_ns: int | None) -> Callable[[Int64], Int64]:
        def stretched(times_ns: Int64) -> Int64:
            elapsed_ns = times_ns - self.pivot_ns
            if duration_ns is not None:
                elapsed_ns = np.clip(elapsed_ns, 0, duration_ns)
            # Only the small difference is rounded to float64: times themselves stay whole nanoseconds.
            moved_ns: Int64 = times_ns + np.rint(rate * elapsed_ns).astype(np.int64)
            return moved_ns

        return stretched


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
    regular_ns
        First instant and period, ns, of a regular clock whose times were rounded to the other unit; undone, the
        timestamps are the nearest of its times, in whole microseconds. None: what was rounded is lost.
    """

    stream: str
    factor: float
    pivot_ns: int | None = None
    rows: RowRange | None = None
    regular_ns: tuple[float, float] | None = None
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
        retime = self._scaling(factor, sequence)
        if self.regular_ns is not None:
            description += f", every {self.regular_ns[1] / NS_PER_MS:.6g} ms"
        fault = _retimed(
            facts, self, description, lambda times_ns: _on_regular_clock(retime(times_ns), self.regular_ns, facts)
        )
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


def exchanged_timestamps(conditions: CanaryConditions) -> Fault:
    """Two neighbouring timestamps are exchanged. Where only events have timestamps, these run backwards."""
    counts = {stream: len(clock.times_ns) for stream, clock in conditions.facts.clocks.items()}
    stream = next((stream for stream, count in counts.items() if count > 2), None)
    if stream is None:
        events = conditions.facts.events
        if events is None or events.first_ns == events.last_ns:
            raise UnplantableError("no stream has three timestamps")
        last_ns = events.last_ns
        return Fault("the timestamps of events run backwards", {timestamps_of("events"): values(lambda t: last_ns - t)})
    row = conditions.row_at_place(stream)
    return conditions.planted(Unsorted(stream, row - row % 2, 2, timestamps_only=True))


def in_nanoseconds(conditions: CanaryConditions) -> Fault:
    """The timestamps of a stream are in nanoseconds instead of microseconds."""
    streams = [stream for stream in ("imu", "pose", "depth", "rgb") if stream in conditions.facts.clocks]
    timed = len(streams) + len(conditions.facts.flow_streams) + (conditions.facts.events is not None)
    if not streams or (timed < 3 and not conditions.facts.flow_streams):
        raise UnplantableError("of two streams without flow none is known to be the wrong one")
    # From the file's origin, so that epoch timestamps stay within reach of int64.
    return conditions.planted(TimeUnit(streams[0], _THOUSAND, pivot_ns=0))


def wrong_rate(conditions: CanaryConditions) -> Fault:
    """The timestamps of a stream lie too far apart: its clock has a wrong rate."""
    stream = conditions.measured_stream("rate_error")
    if stream is None:
        raise UnplantableError("no stream has a nominal rate")
    if not conditions.facts.flow_streams and len(conditions.facts.clocks) < 2:
        raise UnplantableError("a single clock is held against nothing")
    return conditions.planted(ClockRate(stream, conditions.size(f"{stream}.rate_error")))


def lost_samples(conditions: CanaryConditions) -> Fault:
    """Three samples are missing: from a row on, all timestamps are three periods later."""
    stream = conditions.measured_stream("missing")
    if stream is None:
        raise UnplantableError("no stream has a regular clock")
    row = conditions.row_at_place(stream)
    gap = conditions.planted(ClockShift(stream, 3 * conditions.period_ns(stream), rows=(row, None)))
    return replace(gap, description=f"three samples of {stream} are missing before row {row}")


def begins_late(conditions: CanaryConditions) -> Fault:
    """All timestamps of a stream are later than those of the other streams."""
    stream = conditions.measured_stream("begins_late")
    if stream is None:
        raise UnplantableError("fewer than two streams have a regular clock")
    late_ms = conditions.size(f"{stream}.begins_late")
    return conditions.planted(ClockShift(stream, late_ms * NS_PER_MS))


def coarse_grid(conditions: CanaryConditions) -> Fault:
    """Event timestamps are rounded down to a grid that is a thousand times as coarse as declared."""
    grid_us = next((m.expected for m in conditions.measurements if m.name == "events.grid" and m.expected), None)
    if grid_us is None:
        raise UnplantableError("timestamps of sampled streams show a coarse grid only where their clock is irregular")
    grid_ns = round(grid_us * NS_PER_US) * _COARSE_TICKS
    description = f"event timestamps lie on a grid of {grid_ns / NS_PER_MS:g} ms"
    return Fault(description, {timestamps_of("events"): values(lambda t: t - t % grid_ns)})


def next_event_rgb(conditions: CanaryConditions) -> Fault:
    """The indices of ``metadata/rgb_to_event`` are too large by one event."""
    return conditions.planted(IndexShift("rgb_to_event", 1))


def next_event_depth(conditions: CanaryConditions) -> Fault:
    """The indices of ``metadata/depth_to_event`` are too large by one event."""
    return conditions.planted(IndexShift("depth_to_event", 1))


def next_event_milliseconds(conditions: CanaryConditions) -> Fault:
    """The indices of ``metadata/ms_to_event`` are too large by one event."""
    return conditions.planted(IndexShift("ms_to_event", 1))


def late_imu(conditions: CanaryConditions) -> Fault:
    """The timestamps of the IMU are too late."""
    return conditions.planted(ClockShift("imu", conditions.size("time_offset") * NS_PER_MS))


def late_events(conditions: CanaryConditions) -> Fault:
    """The timestamps of events are too late."""
    return conditions.planted(ClockShift("events", conditions.size("time_offset") * NS_PER_MS))


def scattered_events(conditions: CanaryConditions) -> Fault:
    """The timestamps of events scatter: within blocks of rows, events have exchanged their timestamps at random."""
    events = conditions.facts.events
    if events is None or events.last_ns <= events.first_ns:
        raise UnplantableError("the events have no duration")
    jitter_ms = conditions.size("jitter")
    # Both times of an exchange are uniform in the block of duration d: their difference has the spread d / sqrt(6).
    block_ns = sqrt(6) * jitter_ms * NS_PER_MS
    rows_per_block = max(2, ceil(events.count * block_ns / (events.last_ns - events.first_ns)))
    order = np.random.default_rng(_SEED).permutation(rows_per_block)
    # Timestamps stay in order, and so do index maps: the other columns are moved.
    exchange = rows_from(lambda rows: rows - rows % rows_per_block + order[rows % rows_per_block], events.count)
    columns = [f"path/events/{name}" for name in "xyp"]
    return Fault(f"timestamps of events scatter by {jitter_ms:.3g} ms", dict.fromkeys(columns, exchange))


def gap_in_events(conditions: CanaryConditions) -> Fault:
    """There is no event for an interval: from the place on, all timestamps of events are later."""
    gap_ms = conditions.size("gap")

    def alter(times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        # By time instead of by row: an event out of order stays on its side of the gap.
        return times_ns + np.where(times_ns >= conditions.place_ns, round(gap_ms * NS_PER_MS), 0)

    return Fault(f"there is no event for {gap_ms:.3g} ms", {timestamps_of("events"): values(alter)})

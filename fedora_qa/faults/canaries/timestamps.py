"""Faults of timestamps and index maps: clock offsets, rates, orders, and indices that are too large by one."""

from dataclasses import replace
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.clocks import ClockRate, ClockShift, TimeUnit
from fedora_qa.faults.fault import Fault, rows_from, values
from fedora_qa.faults.index_maps import IndexShift
from fedora_qa.faults.row_order import Unsorted
from fedora_qa.layout.canonical import timestamps_of

_SEED = 1
_THOUSAND = 1_000
_COARSE_TICKS = 1_000
"""Ratio of the coarse grid to the declared one. By chance a thousand events lie on the coarse grid with a probability
of 1e-3000."""


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


def next_event(conditions: CanaryConditions, index_map: str) -> Fault:
    """The indices of an index map are too large by one event.

    Parameters
    ----------
    conditions
        The file.
    index_map
        Name of the index map: ``rgb_to_event``, ``depth_to_event`` or ``ms_to_event``.

    Returns
    -------
    Fault
        Of ``metadata/<index_map>``.
    """
    return conditions.planted(IndexShift(index_map, 1))


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

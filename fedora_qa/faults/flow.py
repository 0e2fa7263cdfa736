"""Faults of the order of flow fields, and the canaries of flow."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.fault import Alteration, Fault, Read, streams_in, value_keys, values
from fedora_qa.faults.units import FlowGain, FlowSign
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

_BLOCK_PX: Final = 8


@dataclass(frozen=True, slots=True)
class FlowIntervalShift:
    """Flow belongs to a neighbouring interval.

    Fields at the end of the stream that no row holds are lost, and NaN.

    Attributes
    ----------
    stream
        ``flow``, or a rate.
    intervals
        Number of intervals; positive: fields are stamped too late.
    while_ns
        Starts of the first and the last field that have the fault, ns from the origin, for every rate: within them
        fields are those of other rows, and what these overwrote is lost; None: all fields.
    """

    stream: str
    intervals: int
    while_ns: tuple[int, int] | None = None
    cause: ClassVar[str] = "flow_interval_shifted"

    @property
    def magnitude(self) -> float:
        """Number of intervals."""
        return self.intervals

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Store fields in later rows."""
        description = f"{self.stream} is stamped {self.intervals} intervals too late"
        return self._moved(facts, description, self.intervals)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Store fields in earlier rows."""
        return self._moved(facts, f"{self.stream} back by {self.intervals} intervals", -self.intervals)

    def _moved(self, facts: Facts, description: str, later: int) -> Fault:
        parts = {stream: self._part(facts, stream) for stream in streams_in(facts, self.stream)}
        if self.while_ns is not None:
            first_s, last_s = (time_ns / NS_PER_S for time_ns in self.while_ns)
            description += f", of those that begin from {first_s:.3f} to {last_s:.3f} s"
        return Fault(
            description,
            {key: _later_by(later, *part) for stream, part in parts.items() for key in value_keys(facts, stream)},
        )

    def _part(self, facts: Facts, stream: str) -> tuple[int, int]:
        """Return the first row of a rate with the fault, and the row behind the last one."""
        clock = facts.clocks.get(stream)
        if self.while_ns is None or clock is None:
            return 0, facts.sizes[f"path/{stream}"]
        first_ns, last_ns = self.while_ns
        first, stop = np.searchsorted(clock.times_ns, (first_ns, last_ns + 1))
        return int(first), int(stop)


def _later_by(later: int, first: int, stop: int) -> Alteration:
    """Return the alteration that stores fields ``later`` rows later, and NaN in the rows that become free.

    Rows before ``first``, and from ``stop`` on, stay.
    """

    def alter(read: Read, begin: int, end: int) -> NDArray[Any]:
        rows = np.arange(begin, end)
        sources = np.where((rows >= first) & (rows < stop), rows - later, rows)
        is_lost = (sources < first) & (rows >= first) | (sources >= stop) & (rows < stop)
        kept = sources[~is_lost]
        if not len(kept):
            return np.full_like(read(begin, end), np.nan)
        lowest = int(kept.min())
        fields: NDArray[Any] = read(lowest, int(kept.max()) + 1)[np.where(is_lost, lowest, sources) - lowest]
        fields[is_lost] = np.nan
        return fields

    return alter


def larger(conditions: CanaryConditions) -> Fault:
    """Flow of every rate is too large by a factor."""
    return conditions.planted(FlowGain("flow", conditions.size("gain")))


def off_by_a_constant(conditions: CanaryConditions) -> Fault:
    """Flow of every rate is too large to the right by a constant."""
    size_px = conditions.size("endpoint_error")
    return _altered(conditions, f"flow is {size_px:.3g} px off", lambda flow: flow + _right(size_px))


def one_rate_off(conditions: CanaryConditions) -> Fault:
    """Flow of the slowest rate is too large to the right by a constant; flow of other rates is not altered."""
    size_px, stream = conditions.size(" error"), conditions.facts.flow_streams[0]
    return _altered(conditions, f"{stream} is {size_px:.3g} px off", lambda flow: flow + _right(size_px), [stream])


def backwards(conditions: CanaryConditions) -> Fault:
    """Flow has the opposite direction."""
    return conditions.planted(FlowSign())


def other_validity(conditions: CanaryConditions) -> Fault:
    """In one corner of 8 x 8 px NaN is replaced by 0, and values are replaced by NaN.

    Without poses they are replaced by infinity: only a pose states where a value must be.
    """
    no_value = np.float32(np.nan if "pose" in conditions.facts.streams else np.inf)

    def alter(flow: NDArray[Any]) -> NDArray[Any]:
        # Other readers may share the field that was read.
        altered = flow.copy()
        corner = altered[:, :_BLOCK_PX, :_BLOCK_PX]
        corner[:] = np.where(np.isnan(corner), np.float32(0), no_value)
        return altered

    written = "infinity" if np.isinf(no_value) else "NaN"
    return _altered(conditions, f"in a corner NaN of flow becomes 0, and values become {written}", alter)


def _right(size_px: float) -> NDArray[np.float32]:
    """Return a flow vector (u, v), px, u positive to the right."""
    return np.array([size_px, 0], dtype=np.float32)


def _altered(
    conditions: CanaryConditions,
    description: str,
    alter: Callable[[NDArray[Any]], NDArray[Any]],
    streams: Iterable[str] | None = None,
) -> Fault:
    wanted = conditions.facts.flow_streams if streams is None else streams
    return Fault(description, {f"path/{stream}": values(alter) for stream in wanted})

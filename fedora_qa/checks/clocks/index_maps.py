"""The maps from frames to events, held exactly against the stamps."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import FactsCheck, Measured, Observation, Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import EventScan, Facts, IndexMap

Int64 = NDArray[np.int64]

_MOST: Final = 0.9
"""A deviation is named after a rule that gives at least this share of the wrong entries; most of all entries wins."""


class _FrameToEvent(FactsCheck):
    """Shared by the maps of both cameras."""

    stream: str
    frames: str

    def not_applicable(self, facts: Facts) -> str:
        """Need the map as well as stamps that could be read."""
        return "" if self.stream in facts.index_maps else "the map or the stamps that it joins cannot be read"

    def examine(self, facts: Facts) -> Observation:
        """Count entries that differ from the definition."""
        index_map, events = facts.index_maps[self.stream], facts.events
        length = min(len(index_map.stored), len(index_map.expected_left))
        coverage = Coverage(length, max(len(index_map.stored), len(index_map.expected_left)), "frames")
        if events is None or events.unreadable:
            return Observation(coverage, unobservable="event stamps cannot all be decoded, so that none can be counted")
        wrong = np.flatnonzero(index_map.stored[:length] != index_map.expected_left[:length])
        return Observation(coverage, (self._wrong(facts, index_map, events, wrong),))

    def _wrong(self, facts: Facts, index_map: IndexMap, events: EventScan, wrong: NDArray[np.intp]) -> Measured:
        first = int(wrong[0]) if len(wrong) else None
        name, suspects = "", tuple[Suspect, ...]()
        place = ""
        if first is not None:
            name, suspects = self._name_deviation(facts, index_map, events, wrong)
            stored, expected = index_map.stored[first], index_map.expected_left[first]
            place = f": {name}. Frame {first} points to event {stored}, the first not before it is {expected}"
        return count_of_faults(
            name="wrong_entries",
            value=len(wrong),
            unit="frames",
            statement=f"{len(wrong)} of {len(index_map.stored)} entries of {self.stream} are wrong{place}.",
            code=f"index_maps.{self.frames}.entry",
            where=Where(
                stream=self.stream,
                frame=first,
                index_start=first,
                start_us=None if first is None else facts.to_file_us(float(self._frame_times(facts)[first])),
            ),
            suspects=suspects,
        )

    def _frame_times(self, facts: Facts) -> Int64:
        return facts.clocks[self.frames].times_ns

    def _name_deviation(
        self, facts: Facts, index_map: IndexMap, events: EventScan, wrong: NDArray[np.intp]
    ) -> tuple[str, tuple[Suspect, ...]]:
        length = len(index_map.expected_left)
        stored = index_map.stored[:length]
        fitting = [
            (float(np.mean(stored == entries)), name, suspect)
            for name, entries, suspect in self._candidates(index_map, events, wrong)
            if np.mean(stored[wrong] == entries[wrong]) >= _MOST
        ]
        if fitting:
            _, name, suspect = max(fitting, key=lambda fit: fit[0])
            return name, (suspect,)
        shift_ms = self._time_shift_ms(facts, index_map, wrong)
        if shift_ms is not None:
            shift, spread = shift_ms
            late = Suspect("time_offset", "events", 0.8, shift, "ms", spread)
            early = Suspect("time_offset", self.frames, 0.4, -shift, "ms", spread)
            return f"the entries fit events that are {shift:+.4g} ms late", (late, early)
        return "no known deviation", (Suspect("index_off_by_one", self.stream, 0.2),)

    def _candidates(
        self, index_map: IndexMap, events: EventScan, wrong: NDArray[np.intp]
    ) -> Iterator[tuple[str, Int64, Suspect]]:
        left, right = index_map.expected_left, index_map.expected_right
        shift = int(np.median(index_map.stored[wrong] - left[wrong]))
        yield "they point behind equal stamps", right, Suspect("index_side", self.stream, 0.95)
        zeros = np.zeros_like(left)
        yield "they are zero", zeros, Suspect("missing_stream", self.stream, 0.5)
        clipped = np.minimum(left, events.count - 1)
        yield "they stop at the last event", clipped, Suspect("index_off_by_one", self.stream, 0.8, -1.0, "events")
        off = Suspect("index_off_by_one", self.stream, 0.9, float(shift), "events")
        yield f"they are off by {shift:+d}", left + shift, off

    def _time_shift_ms(self, facts: Facts, index_map: IndexMap, wrong: NDArray[np.intp]) -> tuple[float, float] | None:
        """Fit the delay of events that would explain the entries: their deviation over the local event rate.

        If events were stamped d late after the map was made, an entry exceeds the count by rate * d.
        """
        times_s = self._frame_times(facts) / NS_PER_S
        if len(times_s) < 3:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.gradient(index_map.expected_left.astype(np.float64), times_s)
            shifts = 1e3 * (index_map.stored - index_map.expected_left)[wrong] / rate[wrong]
        shifts = shifts[np.isfinite(shifts)]
        if len(shifts) < 3:
            return None
        middle = float(np.median(shifts))
        spread = float(np.median(np.abs(shifts - middle))) / 0.6745
        return (middle, spread / np.sqrt(len(shifts))) if spread < 0.3 * abs(middle) else None


class Rgb(_FrameToEvent):
    """Does rgb_to_event name the earliest event not before each colour frame?

    Exact: searchsorted(t_event, t_frame, "left") on the stamps, the number of events where none is left. Every
    entry is looked at. What deviates is named: behind equal stamps, off by a constant, clipped, zero, or late by a
    time.
    """

    name = "index_maps.rgb"
    needs = ("rgb_to_event", "rgb", "events")
    stream = "rgb_to_event"
    frames = "rgb"


class Depth(_FrameToEvent):
    """Does depth_to_event name the earliest event not before each depth frame?

    Exact: searchsorted(t_event, t_frame, "left") on the stamps, the number of events where none is left. Every
    entry is looked at. What deviates is named: behind equal stamps, off by a constant, clipped, zero, or late by a
    time.
    """

    name = "index_maps.depth"
    needs = ("depth_to_event", "depth", "events")
    stream = "depth_to_event"
    frames = "depth"

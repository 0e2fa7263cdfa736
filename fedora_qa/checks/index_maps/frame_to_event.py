"""The maps from frames to events, held exactly against the stamps."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.index_maps.map_deviations import WrongMap, name_deviation
from fedora_qa.checks.protocol import FactsCheck, Observation, Statistic, Suspect
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import EventScan, Facts, IndexMap
from fedora_qa.views.clock_resets import set_clock


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
        if not length:
            return Observation(coverage, unobservable="the map, or the stream of its frames, is empty")
        wrong = np.flatnonzero(index_map.stored[:length] != index_map.expected_left[:length])
        return Observation(coverage, (self._wrong(facts, index_map, events, wrong),))

    def _wrong(self, facts: Facts, index_map: IndexMap, events: EventScan, wrong: NDArray[np.intp]) -> Statistic:
        first = int(wrong[0]) if len(wrong) else None
        suspects: tuple[Suspect, ...] = ()
        times_ns, place = facts.clocks[self.frames].times_ns, ""
        if first is not None:
            name, suspects = name_deviation(self._found(facts, index_map, events, wrong))
            was_set = set_clock(events)
            if was_set is not None and was_set.covers(times_ns[wrong]):
                suspects = (*was_set.suspects, *suspects)
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
                start_us=None if first is None else facts.to_file_us(float(times_ns[first])),
            ),
            suspects=suspects,
        )

    def _found(self, facts: Facts, index_map: IndexMap, events: EventScan, wrong: NDArray[np.intp]) -> WrongMap:
        length = min(len(index_map.stored), len(index_map.expected_left))
        cut = IndexMap(index_map.stored[:length], index_map.expected_left[:length], index_map.expected_right[:length])
        others = [other.expected_left for stream, other in facts.index_maps.items() if stream != self.stream]
        other = others[0][:length] if others and len(others[0]) >= length else None
        times_ns = facts.clocks[self.frames].times_ns[:length]
        return WrongMap(self.stream, self.frames, cut, times_ns, events.count, wrong, other)

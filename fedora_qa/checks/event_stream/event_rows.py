"""What the checks of the event stream share: coverage, the place of an event."""

from dataclasses import dataclass
from typing import Final

from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events

NO_EVENTS: Final = "there are no events"


@dataclass(frozen=True, slots=True)
class EventRow:
    """One event: its row in the file, its timestamp from the file's origin, column, row of the sensor, polarity."""

    row: int
    time_ns: int
    x: int
    y: int
    p: int


def event_coverage(facts: Facts, count: int) -> Coverage:
    """Return how many of the file's events were read."""
    return Coverage(count, facts.events.count if facts.events is not None else 0, "events")


def why_no_sensor(facts: Facts) -> str:
    """Return that the event camera is not declared; empty where it is."""
    return "" if "events" in facts.declared.cameras else "the size of the event camera is not declared"


def event_row(events: Events, i: int, first_row: int) -> EventRow:
    """Return the event ``i`` of events that begin at ``first_row`` of the file."""
    return EventRow(first_row + i, int(events.times_ns[i]), int(events.x[i]), int(events.y[i]), int(events.p[i]))


def where_of(facts: Facts, event: EventRow | None) -> Where:
    """Place a finding at an event; its row is that of the file where events are in order."""
    if event is None:
        return Where(stream="events")
    in_order = facts.events is not None and not facts.events.decreases
    start_us = facts.to_file_us(event.time_ns)
    return Where(
        stream="events", start_us=start_us, index_start=event.row if in_order else None, pixel=(event.x, event.y)
    )

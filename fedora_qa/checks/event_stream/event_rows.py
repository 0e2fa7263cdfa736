"""What the checks of the event stream share: coverage, the place of an event."""

from typing import Final

from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events

NO_EVENTS: Final = "there are no events"


def event_coverage(facts: Facts, seen: int) -> Coverage:
    """Return how many of the file's events were seen."""
    return Coverage(seen, facts.events.count if facts.events is not None else 0, "events")


def why_no_sensor(facts: Facts) -> str:
    """Say that the event camera is not declared; empty where it is."""
    return "" if "events" in facts.declared.cameras else "the size of the event camera is not declared"


def event_at(events: Events, i: int, first_row: int) -> tuple[int, int, int, int, int]:
    """Return row, stamp (ns), x, y and p of one event."""
    return first_row + i, int(events.times_ns[i]), int(events.x[i]), int(events.y[i]), int(events.p[i])


def where_of(facts: Facts, first: tuple[int, int, int, int, int] | None) -> Where:
    """Place a finding at an event; the row is known where events are in order."""
    if first is None:
        return Where(stream="events")
    row, time_ns, x, y, _ = first
    in_order = facts.events is not None and not facts.events.decreases
    start_us = facts.to_file_us(time_ns)
    return Where(stream="events", start_us=start_us, index_start=row if in_order else None, pixel=(x, y))

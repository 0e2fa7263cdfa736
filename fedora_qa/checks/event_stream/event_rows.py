"""Shared by the checks of the event stream: coverage, and the location of an event."""

from dataclasses import dataclass
from typing import Final

from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events

NO_EVENTS: Final = "there are no events"


@dataclass(frozen=True, slots=True)
class EventRow:
    """One event.

    Attributes
    ----------
    row
        Row in the file.
    time_ns
        Timestamp, ns from the file's origin.
    x, y
        Column and row of its pixel.
    p
        Polarity as stored.
    """

    row: int
    time_ns: int
    x: int
    y: int
    p: int


def event_coverage(facts: Facts, count: int) -> Coverage:
    """Return the coverage of a number of the file's events.

    Parameters
    ----------
    facts
        With the number of all events.
    count
        Number of events that were read.
    """
    return Coverage(count, facts.events.count if facts.events is not None else 0, "events")


def why_no_sensor(facts: Facts) -> str:
    """Return that the event camera is not declared; empty where it is."""
    return "" if "events" in facts.declared.cameras else "the size of the event camera is not declared"


def event_row(events: Events, i: int, first_row: int) -> EventRow:
    """Return one event with its row in the file.

    Parameters
    ----------
    events
        Consecutive events of the file.
    i
        Number of the event among them.
    first_row
        Row of the first of them in the file.
    """
    return EventRow(first_row + i, int(events.times_ns[i]), int(events.x[i]), int(events.y[i]), int(events.p[i]))


def where_of(facts: Facts, event: EventRow | None) -> Where:
    """Return the location of an event; its row only where the file's events are in order.

    Parameters
    ----------
    facts
        With the scan of the events.
    event
        None for the stream as a whole.

    Returns
    -------
    Where
        Timestamp in us on the clock of the file, and the pixel.
    """
    if event is None:
        return Where(stream="events")
    in_order = facts.events is not None and not facts.events.decreases
    start_us = facts.to_file_us(event.time_ns)
    return Where(
        stream="events", start_us=start_us, index_start=event.row if in_order else None, pixel=(event.x, event.y)
    )

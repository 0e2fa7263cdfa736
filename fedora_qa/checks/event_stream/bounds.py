"""Events within the bounds of the sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.event_stream.event_rows import (
    NO_EVENTS,
    EventRow,
    event_coverage,
    event_row,
    where_of,
    why_no_sensor,
)
from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import Notice, Observation, WindowCheck
from fedora_qa.estimators.events.pixels import survey_columns
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.sensor_events import all_events, all_on_sensor, own, sensor_shape

_ENOUGH_EVENTS: Final = 1000
"""Least number of events for a notice of a single polarity: fewer may come from one edge."""


@dataclass(frozen=True, slots=True)
class BoundsCount:
    """Events of one window outside of the sensor or with an unknown polarity.

    Attributes
    ----------
    events
        Number of all events.
    outside, bad_polarity
        Number of events outside of the sensor, and of those with another polarity than 0 or 1.
    first_outside, first_bad_polarity
        The first of each.
    farthest
        Largest column and row.
    polarities
        Number of events with p = 0 and with p = 1.
    """

    events: int
    outside: int
    bad_polarity: int
    first_outside: EventRow | None
    first_bad_polarity: EventRow | None
    farthest: tuple[int, int]
    polarities: tuple[int, int]


@dataclass(frozen=True, slots=True)
class EventExtent(Feature):
    """Extent of the events under exchanged axes.

    Attributes
    ----------
    fits_exchanged
        Whether all events lie on the declared sensor after x and y are exchanged.
    """

    fits_exchanged: bool


class EventStreamBounds(WindowCheck[BoundsCount]):
    """Does every event lie on the sensor, with a polarity of 0 or 1?

    The number of events outside the declared width and height, and of events with another polarity than 0 or 1.

    Why it matters
    --------------
    An event outside the image is written beyond the array in which events are accumulated, or wraps round to another
    pixel. Exchanged x and y are often noticed only by such events.

    How
    ---
    Every event of the decoded windows is compared with the declared event camera. The finding states the row, timestamp
    and pixel of the first event outside. Where all events lie on the sensor with x and y exchanged, it states that too.
    A stream of only one polarity is noted and is no finding.

    Noise model
    -----------
    None: counts are exact, and a correct file has none.

    Cannot detect
    -------------
    Wrong positions within the sensor (``event_response.orientation``), exchanged axes of a square sensor, and inverted
    polarity. A declared size that is too large hides wrong events.

    Sources
    -------
    First principles: the layout of ``/path/events`` and the declared camera.
    """

    name = "event_stream.bounds"
    needs = ("events",)

    def not_applicable(self, facts: Facts) -> str:
        """Require the size of the sensor."""
        return why_no_sensor(facts)

    def measure(self, window: Window) -> BoundsCount:
        """Count the window's events beyond the sensor and of unknown polarity."""
        events = own(window, all_events(window))
        survey, shape = np.empty(8, np.int64), sensor_shape(window.facts.declared)
        # Windows without an offender, nearly all, need no loop over their events.
        if len(events) and all_on_sensor(events, shape):
            on = int(np.count_nonzero(events.p))
            survey[:] = 0, 0, -1, -1, int(events.x.max()), int(events.y.max()), len(events) - on, on
        else:
            survey_columns(events.x, events.y, events.p, shape, survey)
        outside, unknown, *firsts, column, row, off, on = survey.tolist()
        start = window.owned("events").start
        first_outside, first_unknown = (event_row(events, index, start) if index >= 0 else None for index in firsts)
        return BoundsCount(
            events=len(events),
            outside=outside,
            bad_polarity=unknown,
            first_outside=first_outside,
            first_bad_polarity=first_unknown,
            farthest=(column, row),
            polarities=(off, on),
        )

    def conclude(self, state: Sequence[BoundsCount], facts: Facts) -> Observation:
        """Sum over the windows."""
        total = sum(count.events for count in state)
        if not total:
            return Observation(event_coverage(facts, 0), unobservable=NO_EVENTS)
        first_outside = next((count.first_outside for count in state if count.first_outside), None)
        first_unknown = next((count.first_bad_polarity for count in state if count.first_bad_polarity), None)
        outside, unknown = sum(count.outside for count in state), sum(count.bad_polarity for count in state)
        height, width = sensor_shape(facts.declared)
        # Columns and rows count from 0: the least size that holds them is one more.
        columns, rows = (1 + max(count.farthest[axis] for count in state) for axis in (0, 1))
        fits_exchanged = columns <= height and rows <= width
        hint = "; with x and y exchanged all events lie inside" if fits_exchanged else ""
        statistics = (
            count_of_faults(
                name="outside",
                value=outside,
                unit="events",
                statement=f"{outside} events lie outside the declared {width} x {height} px (largest column "
                f"{columns - 1}, largest row {rows - 1}){hint}.",
                code="event_stream.bounds.outside",
                where=where_of(facts, first_outside),
                severity="critical",
                features=(EventExtent(fits_exchanged),),
            ),
            count_of_faults(
                name="unknown_polarity",
                value=unknown,
                unit="events",
                statement=f"{unknown} events have a polarity that is neither 0 nor 1.",
                code="event_stream.bounds.polarity",
                where=where_of(facts, first_unknown),
                severity="critical",
            ),
        )
        off, on = (sum(count.polarities[p] for count in state) for p in (0, 1))
        notices: tuple[Notice, ...] = ()
        if total >= _ENOUGH_EVENTS and not (off and on):
            text = f"every event has polarity {'1 (brighter)' if on else '0 (darker)'}"
            notices = (Notice("event_stream.bounds.one_polarity", text, Where(stream="events")),)
        return Observation(event_coverage(facts, total), statistics, notices)

"""The event stream by itself: places."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import Notice, Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.events.row_kernels import survey_columns
from fedora_qa.estimators.events.timestamp_kernels import are_crowded
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events, Window
from fedora_qa.views.event_camera import all_events, all_on_sensor, own, sensor_shape

_CROWD: Final = 8
"""Events at one stamp, and such stamps in a window, from which on they are no coincidence."""

_MOST_CROWDED: Final = 0.9
"""Share of the events that lie at such stamps, where stamps have a tick of their own."""

NO_EVENTS: Final = "there are no events"


def event_coverage(facts: Facts, seen: int) -> Coverage:
    """Return how many of the file's events were seen."""
    return Coverage(seen, facts.events.count if facts.events is not None else 0, "events")


def why_no_sensor(facts: Facts) -> str:
    """Say that the event camera is not declared; empty where it is."""
    return "" if "events" in facts.declared.cameras else "the size of the event camera is not declared"


def tick_ns(facts: Facts) -> int:
    """Return the step of the event stamps: the grid on which all of them lie, a microsecond at least."""
    declared = facts.declared.events
    packet_ns = declared.packet_interval_us * NS_PER_US if declared is not None else 0
    grid_ns = facts.events.grid_ns if facts.events is not None else 0
    return max(NS_PER_US, packet_ns, grid_ns)


def local_tick_ns(window: Window) -> int:
    """Return the step of the event stamps in a window, though a few events lie off the grid.

    Where nine events of ten share their stamp with many others, the usual distance of those stamps is the tick.
    """
    return window.once("local_tick_ns", lambda: max(tick_ns(window.facts), _crowded_step_ns(all_events(window))))


def _crowded_step_ns(events: Events) -> int:
    times_ns = events.times_ns
    if not are_crowded(times_ns, _CROWD, _MOST_CROWDED):
        return 0
    first = np.flatnonzero(np.diff(times_ns, prepend=times_ns[:1] - 1))
    counts = np.diff(first, append=len(times_ns))
    crowded = counts >= max(_CROWD, 0.1 * float(counts.max(initial=0)))
    if np.count_nonzero(crowded) < _CROWD or counts[crowded].sum() < _MOST_CROWDED * len(times_ns):
        return 0
    return int(np.median(np.diff(times_ns[first[crowded]])))


@dataclass(frozen=True, slots=True)
class BoundsCount:
    """Events of one window beyond the sensor or with an unknown polarity.

    ``outside`` and ``bad_polarity`` count; ``first`` is (row, ns, x, y, p) of the first offender; ``farthest`` the
    largest column and row; ``polarities`` the events with p = 0 and p = 1.
    """

    seen: int
    outside: int
    bad_polarity: int
    first: tuple[int, int, int, int, int] | None
    farthest: tuple[int, int]
    polarities: tuple[int, int]


class Bounds(WindowCheck[BoundsCount]):
    """Does every event lie on the sensor, with a polarity of 0 or 1?

    The number of events beyond the declared width and height, and of those with a polarity of neither code.

    Why it matters
    --------------
    An event outside the image overruns the arrays of whoever accumulates events, or wraps round to another pixel;
    exchanged x and y show first in this way.

    How
    ---
    Every event of the windows seen is compared with the declared event camera; the first offender is named by row,
    stamp and pixel. Where all events would fit with x and y exchanged, that is said. A stream of one polarity alone is
    noted, not failed.

    Noise model
    -----------
    None: counts are exact, and one is too many.

    Cannot see
    ----------
    Wrong places on the sensor (``event_response.orientation``), exchanged axes of a square sensor, and polarities that
    are merely exchanged. A declaration that is too large hides events that should not be there.

    Sources
    -------
    First principles: the layout of ``/path/events`` and the declared camera.
    """

    name = "event_stream.bounds"
    needs = ("events",)

    def not_applicable(self, facts: Facts) -> str:
        """Need the size of the sensor."""
        return why_no_sensor(facts)

    def measure(self, window: Window) -> BoundsCount:
        """Count offenders."""
        events = own(window, all_events(window))
        found, shape = np.empty(7, np.int64), sensor_shape(window.facts.declared)
        if len(events) and all_on_sensor(events, shape):
            on = int(np.count_nonzero(events.p))
            found[:] = 0, 0, -1, int(events.x.max()), int(events.y.max()), len(events) - on, on
        else:
            survey_columns(events.x, events.y, events.p, shape, found)
        outside, unknown, first, column, row, off, on = found.tolist()
        return BoundsCount(
            seen=len(events),
            outside=outside,
            bad_polarity=unknown,
            first=event_at(events, first, window.owned("events").start) if first >= 0 else None,
            farthest=(column, row),
            polarities=(off, on),
        )

    def conclude(self, state: Sequence[BoundsCount], facts: Facts) -> Observation:
        """Sum over the windows."""
        seen = sum(count.seen for count in state)
        if not seen:
            return Observation(event_coverage(facts, 0), unobservable=NO_EVENTS)
        first = next((count.first for count in state if count.first is not None), None)
        outside, unknown = sum(count.outside for count in state), sum(count.bad_polarity for count in state)
        return Observation(
            event_coverage(facts, seen),
            (self._outside(state, facts, outside, first), self._polarity(facts, unknown, first)),
            self._one_sided(state, seen),
        )

    def _outside(
        self, state: Sequence[BoundsCount], facts: Facts, outside: int, first: tuple[int, int, int, int, int] | None
    ) -> Statistic:
        height, width = sensor_shape(facts.declared)
        columns, rows = (1 + max(count.farthest[axis] for count in state) for axis in (0, 1))
        swapped = columns <= height and rows <= width
        suspects = [Suspect("intrinsics_centre", "metadata", 0.2), Suspect("wrong_shape", "metadata", 0.4)]
        suspects.insert(0, Suspect("axes_swapped", "events", 0.9 if swapped else 0.1))
        hint = "; with x and y exchanged all of them would fit" if swapped else ""
        return count_of_faults(
            name="outside",
            value=outside,
            unit="events",
            statement=f"{outside} events lie outside the declared {width} x {height} px (largest column {columns - 1}, "
            f"largest row {rows - 1}){hint}.",
            code="event_stream.bounds.outside",
            where=where_of(facts, first),
            severity="critical",
            suspects=tuple(suspects),
        )

    def _polarity(self, facts: Facts, unknown: int, first: tuple[int, int, int, int, int] | None) -> Statistic:
        return count_of_faults(
            name="unknown_polarity",
            value=unknown,
            unit="events",
            statement=f"{unknown} events have a polarity that is neither 0 nor 1.",
            code="event_stream.bounds.polarity",
            where=where_of(facts, first),
            severity="critical",
            suspects=(Suspect("nan_in_stream", "events", 0.4, float(unknown), "samples"),),
        )

    def _one_sided(self, state: Sequence[BoundsCount], seen: int) -> tuple[Notice, ...]:
        off, on = (sum(count.polarities[p] for count in state) for p in (0, 1))
        if seen < 1000 or (off and on):
            return ()
        said = "brighter" if on else "darker"
        return (Notice("event_stream.bounds.one_polarity", f"every event is {said}", Where(stream="events")),)


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

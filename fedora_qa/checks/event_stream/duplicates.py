"""The event stream by itself: repeats."""

from collections.abc import Sequence
from dataclasses import dataclass

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
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.events.row_kernels import count_repeats, find_repeats
from fedora_qa.features import Feature
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import own, sensor_events, sensor_shape
from fedora_qa.views.event_tick import tick_ns


@dataclass(frozen=True, slots=True)
class RepeatedEvents(Feature):
    """Events that have pixel and timestamp of another.

    Attributes
    ----------
    count
        Their number in the file.
    """

    count: int


@dataclass(frozen=True, slots=True)
class RepeatCount:
    """Repeats in one window.

    Attributes
    ----------
    events
        Number of events.
    repeats
        Number of events with pixel and timestamp of another.
    doubled_ticks
        Number of ticks in which every event occurs twice.
    first, first_doubled
        First repeated event, and first event of such a tick; None without one.
    """

    events: int
    repeats: int
    doubled_ticks: int
    first: EventRow | None
    first_doubled: EventRow | None


class EventStreamDuplicates(WindowCheck[RepeatCount]):
    """Does every event occur once?

    The number of events with pixel and stamp of another, and of ticks in which all events occur an even number of
    times.

    Why it matters
    --------------
    A packet that is flushed twice doubles contrast for a moment: integrated brightness is off for the rest of the
    sequence, and rates of events are wrong.

    How
    ---
    A pixel of a sensor that stamps to the microsecond fires at most once in it: twice would be a slope of a threshold a
    microsecond. A sensor of the linear model fires once a rendered step. On a grid of packets a pixel may honestly fire
    several times a tick; there only doubled ticks count: each pixel fires an even number of times with each polarity,
    eight events at least.

    Noise model
    -----------
    Ideal events never coincide, so that one repeat is too many. Declared spurious events fall on a true one with the
    chance of their rate times the tick: that many are expected, with their Poisson error, and one more is allowed.
    Of eight honest events of a packet, four pairs of one pixel and polarity each do not happen by chance.

    Cannot see
    ----------
    Doubled events whose stamps were altered by as little as a microsecond, which ``event_response.conservation`` sees
    where pixels show it; on packets, doubled events among others that are not.

    Sources
    -------
    First principles, as above; the sensor's definition in the format's description.
    """

    name = "event_stream.duplicates"
    needs = ("events",)

    def not_applicable(self, facts: Facts) -> str:
        """Require the size of the sensor."""
        return why_no_sensor(facts)

    def measure(self, window: Window) -> RepeatCount:
        """Count the window's events that repeat pixel and timestamp of another."""
        events = own(window, sensor_events(window))
        shape = sensor_shape(window.facts.declared)
        repeats, first, doubled, first_doubled = count_repeats(events.x, events.y, events.times_ns, shape), -1, 0, -1
        # Rows of repeats cost a second pass, which only windows with repeats need.
        if repeats:
            repeats, first, doubled, first_doubled = find_repeats(events.x, events.y, events.times_ns, events.p, shape)
        start = window.owned("events").start
        return RepeatCount(
            len(events),
            repeats,
            doubled,
            event_row(events, first, start) if repeats else None,
            event_row(events, first_doubled, start) if doubled else None,
        )

    def conclude(self, state: Sequence[RepeatCount], facts: Facts) -> Observation:
        """Sum over the windows; on a grid only doubled ticks count."""
        total = sum(count.events for count in state)
        if not total:
            return Observation(event_coverage(facts, 0), unobservable=NO_EVENTS)
        repeats = sum(count.repeats for count in state)
        doubled = sum(count.doubled_ticks for count in state)
        first_doubled = next((count.first_doubled for count in state if count.first_doubled is not None), None)
        statistics = [
            count_of_faults(
                name="doubled_ticks",
                value=doubled,
                unit="ticks",
                statement=f"In {doubled} instants every event occurs twice: packets were written twice.",
                code="event_stream.duplicates.packet",
                where=where_of(facts, first_doubled),
                features=(RepeatedEvents(repeats),),
            )
        ]
        # A pixel fires once a tick where ticks are microseconds, or rendered steps of the linear model.
        declared = facts.declared.events
        linear = declared is not None and declared.model == "linear"
        packets = declared is not None and declared.packet_interval_us > 0
        if not packets and (linear or tick_ns(facts) == NS_PER_US):
            first = next((count.first for count in state if count.first is not None), None)
            spurious_hz = 0.0
            if declared is not None:
                # Rate of events without a change of light. Events of hot pixels coincide at the hot rate; this rate is
                # taken for all events.
                spurious_hz = declared.shot_rate_hz + (declared.hot_pixel_rate_hz if declared.hot_pixels else 0.0)
            # Each event coincides with a spurious one in its tick with probability rate times tick.
            chance = spurious_hz * tick_ns(facts) / NS_PER_S * total
            statistics.append(
                Statistic(
                    name="repeats",
                    value=float(repeats),
                    unit="events",
                    expected=chance,
                    # A count of rare coincidences; where none is declared even one exceeds the limit.
                    standard_error=float(np.sqrt(chance)),
                    model_error_bound=1.0 if chance > 0 else 0.0,
                    side="upper",
                    resolution=1.0,
                    statement=f"{repeats} events repeat pixel and stamp of another.",
                    code="event_stream.duplicates.event",
                    where=where_of(facts, first),
                    features=(RepeatedEvents(repeats),),
                )
            )
        return Observation(event_coverage(facts, total), tuple(statistics))

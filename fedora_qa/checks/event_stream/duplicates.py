"""Events that occur twice."""

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
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.clocks.grid import crowded_timestamps, moved_together
from fedora_qa.estimators.events.pixels import count_repeats, find_repeats, mark_repeats
from fedora_qa.estimators.events.repeats import (
    AROUND,
    MOST_PER_TICK,
    NEAR,
    NEAR_US,
    chance_of_coincidences,
    chance_of_doubled_ticks,
    chance_of_repeats,
    count_quiet_pairs,
    tally_ticks,
)
from fedora_qa.features import Feature
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.sensor_events import HALO_NS, local_tick_ns, own, pixel_events, sensor_events, sensor_shape

_MOST_TILES: Final = 32
"""Largest number of tiles of a doubled tick that is counted exactly: with more, the probability is negligible."""


@dataclass(frozen=True, slots=True)
class RepeatedEvents(Feature):
    """Events that have pixel and timestamp of another.

    Attributes
    ----------
    count
        Their number in the file.
    at_crowds
        Number of these at timestamps that many other pixels have as well, each counted once.
    """

    count: int
    at_crowds: int = 0


@dataclass(frozen=True, slots=True)
class RepeatCount:
    """Repeats in one window.

    Attributes
    ----------
    events
        Number of events.
    repeats
        Number of events with pixel and timestamp of another.
    of_moved
        Number of these at timestamps to which a part of the events was moved: a grid, or the ends of the stream.
    at_crowds
        Number of the others at crowded timestamps.
    close
        Number of pairs of successive events of a pixel that are 1 to ``NEAR_US`` us apart.
    on_grid
        Whether timestamps lie on a grid coarser than a microsecond.
    pairs
        On a grid: numbers of pairs of events of one polarity at quiet pixels that are 0, 1, ... ticks apart.
    doubled_ticks
        Numbers of ticks in which every event occurs twice, by their number of tiles.
    tiles, even_tiles
        Where there are such ticks: number of tiles with an event in each other tick, and of those whose pixels all fire
        an even number of times.
    first, first_doubled
        First repeated event: on a grid that of a quiet pixel, else the first that was not moved; first event of a
        doubled tick; None without one.
    """

    events: int
    repeats: int
    of_moved: int
    at_crowds: int
    close: int
    on_grid: bool
    pairs: tuple[int, ...]
    doubled_ticks: tuple[int, ...]
    tiles: int
    even_tiles: int
    first: EventRow | None
    first_doubled: EventRow | None


class EventStreamDuplicates(WindowCheck[RepeatCount]):
    """Does every event occur once?

    The number of events with the pixel and timestamp of another event, and the number of ticks in which every pixel
    fires an even number of times.

    Why it matters
    --------------
    A packet that is written twice doubles the contrast for a moment. Integrated brightness is then wrong for the rest
    of the sequence, and event rates are wrong.

    How
    ---
    A pixel whose timestamps have a resolution of a microsecond fires at most once in it: two events would be a slope of
    one threshold per microsecond. On a grid of packets or rendered steps, declared or measured, a pixel may fire
    several times a tick. There, pairs of events of one pixel and polarity are counted by the number of ticks between
    them, at quiet pixels only: no neighbour has two events of that polarity fewer than nine ticks apart at that time. A
    tick is doubled where each pixel fires an even number of times with each polarity, eight events at least.

    Noise model
    -----------
    Ideal events never coincide, so that one repeat within a microsecond exceeds the limit. Declared spurious events
    coincide with another event with a probability of their rate times the tick: this number is expected, with its
    Poisson error, and one more is allowed.

    Events whose timestamps err independently, by jitter or by spurious events that nobody declares, coincide by chance.
    They are then also close: intervals of 1 to 64 us are 128 times as frequent as those of 0. Given the number of close
    pairs, that of coincidences is binomial with the share 1/129. Exact streams have no close pair. Where a part of the
    events was moved to a grid, or to the ends of the stream, its timestamps hold more events than those beside them. No
    event there counts as repeated.

    On a grid of any tick, let n_k be the number of pairs k ticks apart. Intervals of random phase give ``n_0 <= n_k /
    2``, if the density of intervals does not decrease from zero on. Given all pairs, n_0 is binomial. At quiet pixels
    the density does not decrease, because an edge that crosses several thresholds within a tick does so at neighbours
    too. The density of noise decreases by at most 1/16 a tick, which the binomial probability includes
    (``fedora_qa/estimators/events/repeats.py``). No declaration is needed: tick and n_k are measured. A tick is doubled
    by chance with probability s^n, where n is the number of its 8 px tiles, and s the share of even tiles in the other
    ticks. The number of doubled ticks has a Poisson error.

    Cannot detect
    -------------
    Doubled events whose timestamps differ by a microsecond or more; ``event_response.conservation`` detects them where
    pixels are observable. On a grid: doubled events where neighbours fire more often than every nine ticks, at the
    border of the sensor, at pixels that fire more often than every 16 ticks, and on grids coarser than 1.25 ms. There
    only doubled ticks are detected, as at timestamps to which a part of the events was moved. Three repeats or fewer
    where timestamps err, so that other events of a pixel are less than 64 us apart.

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
        shape, tick = sensor_shape(window.facts.declared), local_tick_ns(window)
        on_grid, start = tick > NS_PER_US, window.owned("events").start
        repeats, close = count_repeats(events.x, events.y, events.times_ns, shape, NEAR_US * NS_PER_US)
        first, of_moved, at_crowds, doubled, first_doubled = -1, 0, 0, 0, -1
        doubled_ticks, tiles, even_tiles = np.zeros(_MOST_TILES + 1, np.int64), 0, 0
        # The rows of repeats take a second pass, which only windows with repeats need.
        if repeats:
            repeats, first, doubled, first_doubled = find_repeats(events.x, events.y, events.times_ns, events.p, shape)
        if repeats and not on_grid:
            rows = np.flatnonzero(mark_repeats(events.x, events.y, events.times_ns, shape))
            nearby = sensor_events(window)
            # Doubled events crowd no timestamp: each counts once.
            once_ns = nearby.times_ns[~mark_repeats(nearby.x, nearby.y, nearby.times_ns, shape)]
            moved = moved_together(events.times_ns[rows], once_ns)
            of_moved, others = int(np.count_nonzero(moved)), rows[~moved]
            at_crowds = int(np.count_nonzero(np.isin(events.times_ns[others], crowded_timestamps(once_ns))))
            first = int(others[0]) if len(others) else -1
        if doubled:
            tiles, even_tiles = tally_ticks(events.x, events.y, events.times_ns, events.p, shape, doubled_ticks)
        pairs = np.zeros(NEAR + 1, np.int64)
        # Neighbours are read in the halo of the window.
        if on_grid and (NEAR + AROUND) * tick <= HALO_NS:
            by_pixel, around = pixel_events(window), sensor_events(window).times_ns
            ticks = int(around[-1] - around[0]) // tick if len(around) else 0
            span = window.span
            pixel, time_ns = count_quiet_pairs(
                by_pixel.starts,
                by_pixel.timestamped,
                shape,
                tick,
                span.start_ns,
                span.stop_ns,
                MOST_PER_TICK * ticks,
                pairs,
            )
            at_pixel = (events.times_ns == time_ns) & (events.y == pixel // shape[1]) & (events.x == pixel % shape[1])
            first = int(np.flatnonzero(at_pixel)[-1]) if pixel >= 0 else -1
        return RepeatCount(
            events=len(events),
            repeats=repeats,
            of_moved=of_moved,
            at_crowds=at_crowds,
            close=close,
            on_grid=on_grid,
            pairs=tuple(pairs.tolist()),
            doubled_ticks=tuple(doubled_ticks.tolist()),
            tiles=tiles,
            even_tiles=even_tiles,
            first=event_row(events, first, start) if first >= 0 else None,
            first_doubled=event_row(events, first_doubled, start) if doubled else None,
        )

    def conclude(self, state: Sequence[RepeatCount], facts: Facts) -> Observation:
        """Add up the windows; windows on a grid have repeats by chance."""
        total = sum(count.events for count in state)
        if not total:
            return Observation(event_coverage(facts, 0), unobservable=NO_EVENTS)
        statistics = [_doubled_ticks(state, facts)]
        for on_grid in (False, True):
            counts = [count for count in state if count.on_grid is on_grid]
            if counts:
                statistics.append(_repeats_on_grid(counts, facts) if on_grid else _repeats(counts, facts))
        return Observation(event_coverage(facts, total), tuple(statistics))


def _doubled_ticks(state: Sequence[RepeatCount], facts: Facts) -> Statistic:
    """Return the number of doubled ticks, with the number expected by chance."""
    by_tiles = np.sum([count.doubled_ticks for count in state], axis=0)
    doubled = int(by_tiles.sum())
    tiles, even_tiles = sum(count.tiles for count in state), sum(count.even_tiles for count in state)
    # Rule of succession: a small sample without even tiles does not prove a share of zero.
    share = (even_tiles + 1) / (tiles + 2)
    chance = chance_of_doubled_ticks(float(by_tiles @ share ** np.arange(len(by_tiles)))) if doubled else None
    first_doubled = next((count.first_doubled for count in state if count.first_doubled is not None), None)
    return Statistic(
        name="doubled_ticks",
        value=float(doubled),
        unit="ticks",
        expected=chance.expected if chance is not None else 0.0,
        standard_error=chance.standard_error if chance is not None else 0.0,
        side="upper",
        resolution=1.0,
        statement=f"At {doubled} timestamps every event occurs twice: packets were written twice.",
        code="event_stream.duplicates.packet",
        where=where_of(facts, first_doubled),
        features=(RepeatedEvents(sum(count.repeats for count in state)),),
    )


def _repeats_on_grid(state: Sequence[RepeatCount], facts: Facts) -> Statistic:
    """Return the number of repeats at quiet pixels, with the number expected by chance."""
    pairs = np.sum([count.pairs for count in state], axis=0)
    chance = chance_of_repeats(pairs)
    return Statistic(
        name="repeats_on_grid",
        value=float(pairs[0]),
        unit="events",
        expected=chance.expected,
        standard_error=chance.standard_error,
        side="upper",
        resolution=1.0,
        tests=NEAR,
        statement=f"{pairs[0]} events have the pixel, polarity and timestamp of another where neighbours are quiet; "
        f"{chance.expected:.3g} are expected from the grid of timestamps.",
        code="event_stream.duplicates.event",
        where=where_of(facts, next((count.first for count in state if count.first is not None), None)),
        features=(RepeatedEvents(int(pairs[0])),),
    )


def _repeats(state: Sequence[RepeatCount], facts: Facts) -> Statistic:
    """Return the number of repeats within a microsecond, with that expected from close pairs and spurious events."""
    total, repeats = sum(count.events for count in state), sum(count.repeats - count.of_moved for count in state)
    measured = chance_of_coincidences(sum(count.close for count in state))
    declared, spurious_hz = facts.declared.events, 0.0
    if declared is not None:
        # Rate of events without a change of light. Events of hot pixels coincide at the hot rate; this rate is taken
        # for all events.
        spurious_hz = declared.shot_rate_hz + (declared.hot_pixel_rate_hz if declared.hot_pixels else 0.0)
    # Each event coincides with a spurious one in its tick with probability rate times tick.
    declared_chance = spurious_hz * NS_PER_US / NS_PER_S * total
    expected = max(declared_chance, measured.expected)
    by_chance = f"; {expected:.3g} are expected by chance" if expected else ""
    return Statistic(
        name="repeats",
        value=float(repeats),
        unit="events",
        expected=expected,
        # A count of rare coincidences; in an exact stream without declared spurious events even one exceeds the limit.
        standard_error=max(float(np.sqrt(declared_chance)), measured.standard_error),
        model_error_bound=1.0 if declared_chance > 0 else 0.0,
        side="upper",
        resolution=1.0,
        statement=f"{repeats} events have the pixel and timestamp of another{by_chance}.",
        code="event_stream.duplicates.event",
        where=where_of(facts, next((count.first for count in state if count.first is not None), None)),
        features=(RepeatedEvents(repeats, sum(count.at_crowds for count in state)),),
    )

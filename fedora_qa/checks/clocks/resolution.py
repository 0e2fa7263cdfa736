"""The grids on which timestamps lie."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fedora_qa.checks.clocks.streams import event_scan, fits_of
from fedora_qa.checks.protocol import Notice, Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.clocks.grid import (
    FLOAT32_STEPS_US,
    STEPS,
    comb_counts,
    is_on_comb,
    single_precision_spacing_us,
    surely_no_chance,
)
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.clock_resets import clock_reset

_ENOUGH_EVENTS: Final = 1000

_FEWEST_INSTANTS: Final = 3
_LOG_CHANCE: Final = -6.0
"""Decimal logarithm of the probability below which chance is excluded, as for grids of sampled streams."""

_SIGNIFICANT: Final = 10.0
_AS_MUCH: Final = 0.8
"""Least deviate of a significant comb, and least ratio of its hits to the most hits (both only choose among combs and
windows)."""


@dataclass(frozen=True, slots=True)
class PartialGrid(Feature):
    """Grid of a part of the events.

    Attributes
    ----------
    step_us
        Step of the grid, us.
    tick_us
        Declared tick, us.
    """

    step_us: float
    tick_us: int


@dataclass(frozen=True, slots=True)
class Comb:
    """The least probable comb of the timestamps of a window.

    Attributes
    ----------
    start_ns, stop_ns
        Ends of the window, ns from the file's origin.
    step_us
        Step of the comb, us.
    events, events_on
        Number of the events of the window, and of those that lie on the comb.
    timestamps_on
        Number of distinct timestamps of the events on the comb.
    share_by_chance
        Expected share of the events that lie on the comb if timestamps lie at random.
    deviate
        Excess of the hits in standard deviations.
    """

    start_ns: int
    stop_ns: int
    step_us: float
    events: int
    events_on: int
    timestamps_on: int
    share_by_chance: float
    deviate: float

    @property
    def share(self) -> float:
        """Share of the window's events that lie on the comb, 0 to 1."""
        return self.events_on / self.events


class ClocksResolution(WindowCheck[Comb]):
    """Do timestamps have the resolution that the file declares?

    For each stream, the grid of all its timestamps: the greatest common divisor of the steps between them, in us. For
    events also the comb (multiples of a step) on which more timestamps of a window lie than by chance, with the share
    of the window's events on it.

    Why it matters
    --------------
    Timestamps that were rounded to milliseconds, or stored as float32 seconds, keep their order and their rate, and
    lose their time resolution: at 2 px/ms, a grid of 1 ms displaces events that are warped along the flow by up to 2
    px.

    How
    ---
    Events must lie on the grid of the declared packets, or of one microsecond for asynchronous events of the log model.
    A finer grid than that of declared packets is noted.
    Where they lie on no coarser grid, the least distance of different timestamps is compared with it: events that have
    the times of renders keep the distance of these, whose times need not be whole multiples of a microsecond.
    The grid of a sampled stream can be measured where its steps vary: all of them are then multiples of a number above
    1 us. The same timestamps are compared with single-precision seconds, whose spacing doubles at each power of two.
    Where all events together lie on no coarse grid, each window of 0.2 s is compared with every comb of 2 to 2000 ticks
    through the clock's zero, and with the steps of single-precision seconds, 7.6 to 122 us: these detect that a part of
    the image or of the time was rounded. Where the sequence is declared as recorded, the grid of its events is that of
    the sensor's readout: the record states it, and it is not judged.

    Noise model
    -----------
    By chance, n timestamps at random microseconds all lie on a grid of g us with probability g^-n. No two of n instants
    within a span T are nearer than s with probability (1 - (n - 1) s / T)^n. Events are judged if
    there are 1000 or more; a sampled stream is judged where its irregular steps make that probability less than one in
    a million. The number of ticks of a comb that hold an event is binomial, with the share of all ticks that hold one.
    A tick counts once, however many events it holds, so that an edge that fires a whole column counts once. The
    deviation from the binomial mean, in standard deviations, is the number of standard errors. All combs and windows
    count as tests.

    Cannot detect
    -------------
    A grid that divides the period: an exact clock lies on every such grid, and loses nothing by it. Events of the
    linear model have the grid of rendered steps, which the format does not declare: this grid is correct. Grids of a
    part of the events that do not pass through zero, or are coarser than 2 ms.

    Sources
    -------
    IEEE 754-2019, 3.6 (24 bits of binary32); first principles, ``fedora_qa/estimators/clocks/grid.py``.
    """

    name = "clocks.resolution"

    def not_applicable(self, facts: Facts) -> str:
        """Require timestamps."""
        return "" if facts.events is not None or facts.clocks else "the file has no timestamps"

    def measure(self, window: Window) -> Comb | None:
        """Return the least probable comb of the window's events; a correct file has only combs by chance."""
        facts, span = window.facts, window.span
        if facts.events is None or _why_events_show_none(facts):
            return None
        tick_us = _declared_tick_us(facts)
        times_ns = window.events(0, 0).times_ns
        within = times_ns[slice(*np.searchsorted(times_ns, [span.start_ns, span.stop_ns]))]
        # Combs pass through the zero of the file's own clock, not through the file's origin.
        timestamps = within // NS_PER_US + round(facts.origin_us)
        ticks = timestamps if tick_us == 1 else timestamps // tick_us
        counts = comb_counts(ticks)
        deviates = counts.deviates()[: _combs(tick_us)]
        # No comb has more hits than expected by chance.
        if not deviates.max() > 0:
            return None
        hit_ratios = (counts.hits / np.maximum(counts.teeth, 1))[: _combs(tick_us)]
        # A grid also hits many other combs: its own comb is the finest of those with the most hits.
        significant = deviates >= min(float(deviates.max()), _SIGNIFICANT)
        best = int(np.flatnonzero(significant & (hit_ratios >= _AS_MUCH * hit_ratios[significant].max()))[0])
        on_comb = is_on_comb(ticks, STEPS[best])
        return Comb(
            start_ns=span.start_ns,
            stop_ns=span.stop_ns,
            step_us=STEPS[best] * tick_us,
            events=len(ticks),
            events_on=int(np.count_nonzero(on_comb)),
            timestamps_on=int(counts.hits[best]),
            share_by_chance=float(counts.teeth[best]) / counts.ticks,
            deviate=float(deviates[best]),
        )

    def conclude(self, state: Sequence[Comb], facts: Facts) -> Observation:
        """Measure the grid of each stream; where that of all events is the declared one, also that of a part."""
        observation = self.examine(facts)
        grids = observation.measurements
        # Where the grid of all events is not the declared one, combs only repeat that finding.
        if not state or not any(grid.where.stream == "events" and grid.value == grid.expected for grid in grids):
            return observation
        if facts.declared.kind == "recorded":
            return observation
        # Of the significant combs, that with the largest excess of events; without one, the least probable comb.
        worst = max(state, key=lambda comb: (min(comb.deviate, _SIGNIFICANT), comb.share - comb.share_by_chance))
        start_us, stop_us = facts.to_file_us(worst.start_ns), facts.to_file_us(worst.stop_ns)
        reset = clock_reset(facts.events)
        partial_grid = Statistic(
            name="events.partial_grid",
            value=worst.share,
            unit="1",
            expected=worst.share_by_chance,
            # Chosen so that the excess is ``deviate`` standard errors; the bounds keep it finite and above 0.
            standard_error=max(abs(worst.share - worst.share_by_chance), 1e-9) / max(min(worst.deviate, 1e6), 1e-6),
            side="upper",
            # Every comb was tried in every window.
            tests=len(state) * _combs(_declared_tick_us(facts)),
            statement=f"Events lie on a grid of {worst.step_us:g} us around {start_us / 1e6:.3f} s: "
            f"{worst.events_on} of {worst.events} do, with {worst.timestamps_on} timestamps, where "
            f"{worst.share_by_chance:.1%} are expected by chance.",
            code="clocks.resolution.partial_grid",
            where=Where(stream="events", start_us=start_us, stop_us=stop_us),
            features=(
                PartialGrid(worst.step_us, _declared_tick_us(facts)),
                *((reset,) if reset is not None else ()),
            ),
        )
        return replace(observation, measurements=(*grids, partial_grid))

    def examine(self, facts: Facts) -> Observation:
        """Measure the grid of each stream whose timestamps determine one."""
        grids: list[Statistic] = []
        notices: list[Notice] = []
        inferred: dict[str, str | float] = {}
        for stream, fit in fits_of(facts):
            # Equal steps are multiples of every divisor of the period; only unequal steps determine a grid.
            if fit.irregular_steps:
                # A grid of whole microseconds is 1; a finer one counts as 1.
                grid_us = fit.grid_ns / NS_PER_US
                steps_us = np.full(fit.irregular_steps, grid_us)
                if grid_us > 1 and fit.jitter_ns < fit.period_ns and surely_no_chance(steps_us):
                    clause = f"lie on a grid of {grid_us:g} us"
                else:
                    # The spacing of float32 numbers grows with their size, so that it is that of the absolute time.
                    times_us = facts.origin_us + facts.clocks[stream].times_ns / NS_PER_US
                    spacing_us = single_precision_spacing_us(times_us)
                    # A coarser grid, such as whole seconds, is also one of single-precision numbers.
                    is_single = grid_us < spacing_us
                    grid_us = spacing_us if is_single else 1.0
                    clause = f"are single-precision seconds, {spacing_us:.3g} us apart" if is_single else ""
                period_us = fit.period_ns / NS_PER_US
                text = f"All timestamps of {stream} {clause}, and deviate from their period of {period_us:.6g} us."
                grids.append(_grid(stream, grid_us, 1.0, text))
        count = sum(len(facts.clocks[grid.where.stream or ""].times_ns) for grid in grids)
        unobservable = "" if grids else "all clocks are exact, and lie on every grid that divides their periods"
        if facts.events is not None:
            unobservable = _why_events_show_none(facts)
            count += facts.events.count
            if not unobservable:
                expected_us, grid_us = _declared_tick_us(facts), event_scan(facts).grid_ns / NS_PER_US
                # Steps between packets are multiples of their interval, wherever the first one is.
                if event_scan(facts).grid_ns % (expected_us * NS_PER_US) and facts.declared.kind != "recorded":
                    message = (
                        f"packets of {expected_us} us are declared, and the steps between event timestamps have no "
                        f"common divisor above {grid_us:g} us"
                    )
                    notices.append(Notice("clocks.resolution.no_packets", message, Where(stream="events")))
                text = f"All event timestamps lie on a grid of {grid_us:g} us; {expected_us} us is declared."
                apart_us = distance_of_instants_us(facts)
                if grid_us <= expected_us < apart_us:
                    grid_us = apart_us
                    text = (
                        f"The {event_scan(facts).instants} different event timestamps are at least {apart_us:g} us "
                        f"apart; {expected_us} us is declared."
                    )
                if facts.declared.kind == "recorded" and grid_us > expected_us:
                    inferred["events.grid_us"] = grid_us
                    unobservable = (
                        "" if grids else "the grid of events is a property of the sensor, which is not declared"
                    )
                else:
                    grids.append(_grid("events", grid_us, float(expected_us), text))
        coverage = Coverage(count, count, "stamps")
        return Observation(coverage, tuple(grids), tuple(notices), unobservable=unobservable, inferred=inferred)


def _combs(tick_us: int) -> int:
    """Return how many of the combs of ``STEPS`` are tried.

    Single-precision seconds are combs of microseconds. Ticks of packets are whole, and rounded seconds leave them.
    """
    return len(STEPS) if tick_us == 1 else len(STEPS) - len(FLOAT32_STEPS_US)


def _why_events_show_none(facts: Facts) -> str:
    events, declared = event_scan(facts), facts.declared.events
    if events.count < _ENOUGH_EVENTS or not events.grid_ns:
        return f"{events.count} events are too few to distinguish a grid from chance"
    if declared is not None and declared.model == "linear":
        return "events of the linear model lie on the grid of rendered steps"
    return ""


def distance_of_instants_us(facts: Facts) -> float:
    """Return the least distance of different event timestamps, us, where it is none by chance; otherwise 0.

    Of n instants at random within a span T none are nearer than s with the probability (1 - (n - 1) s / T)^n. Instants
    of renders that are no whole number of microseconds apart lie on no grid, and keep their distance.
    """
    events = facts.events
    if events is None or events.decreases or events.unreadable or events.unplaced or events.instants < _FEWEST_INSTANTS:
        return 0.0
    # Timestamps are whole ticks: different ones are at least one apart.
    beyond_ns = max(events.shortest_step_ns - _declared_tick_us(facts) * NS_PER_US, 0)
    covered = (events.instants - 1) * beyond_ns / (events.last_ns - events.first_ns)
    log_chance = events.instants * np.log10(max(1.0 - covered, np.finfo(np.float64).tiny))
    return events.shortest_step_ns / NS_PER_US if log_chance < _LOG_CHANCE else 0.0


def _grid(stream: str, grid_us: float, expected_us: float, statement: str) -> Statistic:
    return Statistic(
        name=f"{stream}.grid",
        value=grid_us,
        unit="us",
        expected=expected_us,
        standard_error=0.0,
        side="upper",
        resolution=expected_us,
        statement=statement,
        code="clocks.resolution.grid",
        where=Where(stream=stream),
    )


def _declared_tick_us(facts: Facts) -> int:
    """Return the tick of event timestamps: the interval of declared packets, else one microsecond."""
    declared = facts.declared.events
    return max(1, declared.packet_interval_us if declared is not None else 0)

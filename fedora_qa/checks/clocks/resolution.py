"""The grids that stamps lie on."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fedora_qa.checks.clocks.combs import Comb, comb_of, declared_tick_us, worst_comb
from fedora_qa.checks.clocks.streams import event_scan, fits_of
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.clocks.grid import single_precision_spacing_us, surely_no_chance
from fedora_qa.estimators.clocks.regular_clock import RegularClock
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

_ENOUGH_EVENTS: Final = 1000


class ClocksResolution(WindowCheck[Comb]):
    """Do stamps have the resolution that the file declares?

    The grid on which all stamps of a stream lie: the greatest common divisor of the steps between them, in us; and of
    events the comb on which more of the stamps of a window lie than chance would put there, with the share of its
    teeth that hold an event.

    Why it matters
    --------------
    Stamps that went through milliseconds or through float32 seconds keep their order and their rate, and lose what
    events and IMU are recorded for: at 2 px/ms a grid of 1 ms blurs what is warped along the flow by 2 px.

    How
    ---
    Events must lie on the grid of the declared packets, or of one microsecond for asynchronous events of the log model.
    A sampled stream betrays its grid where its steps vary: all of them are then multiples of a number above 1 us. The
    same stamps are held against single-precision seconds, whose spacing doubles at each power of two. Where all events
    together lie on no coarse grid, each window of 0.2 s is held against every comb of 2 to 2000 ticks through the
    clock's zero and against the steps of single-precision seconds, 7.6 to 122 us: they find the rounding of a part of
    the image or of the time.

    Noise model
    -----------
    By chance alone n stamps at random microseconds all fall on a grid of g us with probability g^-n. Events are judged
    from 1000 on; a sampled stream where its irregular steps make that probability less than one in a million. A comb's
    teeth hit occupied ticks with the binomial chance of the share of ticks that are occupied; a tick counts once
    however many events it holds, so that an edge which fires a whole column is one witness. The deviate of that chance
    is the number of standard errors; all combs and windows are counted as tests.

    Cannot see
    ----------
    A grid that divides the period: an exact clock fits every such grid, and loses nothing by it. Events of the linear
    model come once a rendered step, which the format does not declare: there a grid is honest. Grids of a
    part of the events that do not pass through zero, or are coarser than 2 ms.

    Sources
    -------
    IEEE 754-2019, 3.6 (24 bits of binary32); first principles, ``fedora_qa/estimators/clocks/grid.py`` and
    ``stamp_combs.py``.
    """

    name = "clocks.resolution"

    def not_applicable(self, facts: Facts) -> str:
        """Need stamps."""
        return "" if facts.events is not None or facts.clocks else "the file has no stamps"

    def measure(self, window: Window) -> Comb | None:
        """Find what a part of the events keeps to, where grids are not honest."""
        facts = window.facts
        return None if facts.events is None or _why_events_show_none(facts) else comb_of(window)

    def conclude(self, state: Sequence[Comb], facts: Facts) -> Observation:
        """Measure the grid of each stream; where that of all events is as declared, also what a part keeps to."""
        whole = self.examine(facts)
        fine = any(one.where.stream == "events" and one.value == one.expected for one in whole.measurements)
        return replace(whole, measurements=(*whole.measurements, worst_comb(state, facts))) if state and fine else whole

    def examine(self, facts: Facts) -> Observation:
        """Measure the grid of each stream whose stamps show one."""
        measured = list(_of_samples(facts))
        count = sum(len(facts.clocks[one.where.stream or ""].times_ns) for one in measured)
        unobservable = "" if measured else "all clocks are exact, and so lie on every grid that divides their periods"
        if facts.events is not None:
            unobservable = _why_events_show_none(facts)
            count += facts.events.count
            measured += [] if unobservable else [_of_events(facts)]
        return Observation(Coverage(count, count, "stamps"), tuple(measured), unobservable=unobservable)


def _why_events_show_none(facts: Facts) -> str:
    events, declared = event_scan(facts), facts.declared.events
    if events.count < _ENOUGH_EVENTS or not events.grid_ns:
        return f"only {events.count} events: their grid is left to chance"
    if declared is not None and declared.model == "linear":
        return "events of the linear model lie on the grid of rendered steps"
    return ""


def _of_events(facts: Facts) -> Statistic:
    expected_us = declared_tick_us(facts)
    grid_us = event_scan(facts).grid_ns / NS_PER_US
    said = f"All event stamps lie on a grid of {grid_us:g} us; {expected_us} us is declared."
    return _grid("events", grid_us, float(expected_us), said)


def _of_samples(facts: Facts) -> Iterator[Statistic]:
    """State the grid of each stream whose steps vary: whole microseconds are 1, and what is finer counts as 1."""
    for stream, fit in fits_of(facts):
        if fit.irregular_steps:
            grid_us, how = _grid_of(facts, stream, fit)
            said = (
                f"All stamps of {stream} {how}, and so do not keep their period of {fit.period_ns / NS_PER_US:.6g} us."
            )
            yield _grid(stream, grid_us, 1.0, said)


def _grid_of(facts: Facts, stream: str, fit: RegularClock) -> tuple[float, str]:
    grid_us = fit.grid_ns / NS_PER_US
    if grid_us > 1 and fit.jitter_ns < fit.period_ns and surely_no_chance(np.full(fit.irregular_steps, grid_us)):
        return grid_us, f"lie on a grid of {grid_us:g} us"
    times_us = facts.origin_us + facts.clocks[stream].times_ns / NS_PER_US
    spacing_us = single_precision_spacing_us(times_us)
    if grid_us >= spacing_us:  # whole seconds, say, are single-precision seconds too
        return 1.0, ""
    return spacing_us, f"are single-precision seconds, {spacing_us:.3g} us apart"


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
        suspects=(Suspect("quantised_time", stream, 0.95, grid_us / 1e3, "ms"),),
    )

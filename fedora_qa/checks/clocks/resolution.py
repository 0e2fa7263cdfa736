"""The clocks of the streams: the grid that event stamps lie on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Measured, Observation, Suspect, WindowCheck
from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.stamp_grid import STEPS, comb_counts
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import EventScan, Facts
from fedora_qa.sequence.window import Window

_SURELY: Final = 10.0
_AS_MUCH: Final = 0.8
"""Deviate of combs that are no chance, and share of the most hits from which on a comb is hit as much (for naming)."""


@dataclass(frozen=True, slots=True)
class Comb:
    """The comb that the stamps of a window keep to least by chance: its step, share of teeth hit, and deviate."""

    start_ns: int
    stop_ns: int
    step: float
    share: float
    by_chance: float
    deviate: float


class Resolution(WindowCheck[Comb]):
    """Do event stamps have the resolution that the file declares?

    The grid on which all event stamps lie, in microseconds, and the comb on which more of the stamps of a window lie
    than chance would put there, with the share of its teeth that hold an event.

    Why it matters
    --------------
    Stamps that were rounded to 0.1 or 1 ms, or kept in float32 seconds, put edges where they were up to a step ago.
    Optical flow and learned models of timing degrade without a sign of why.

    How
    ---
    The common grid is the greatest common divisor of all steps of the file; it must be that of the declared packets,
    or a microsecond for asynchronous events of the log model. Where it is, each window of 0.2 s is held against every
    comb of 2 to 2000 ticks through the clock's zero and against the steps of float32 seconds, 7.6 to 122 us: they find
    the rounding of a part of the image or of the time.

    Noise model
    -----------
    n honest stamps all fall on a grid of g us with probability g^-n; with a thousand events that is never. A comb's
    teeth hit occupied ticks with the binomial chance of the share of ticks that are occupied; a tick counts once
    however many events it holds, so that an edge which fires a whole column is one witness. The deviate of that chance
    is the number of standard errors; all combs and windows are counted as tests.

    Cannot see
    ----------
    The linear model gives events once a rendered step, which the format does not declare: there a grid is honest.
    Grids of a part of the stamps that do not pass through zero, are coarser than 2 ms, or finer than two ticks. Fewer
    than a thousand events leave the grid to chance.

    Sources
    -------
    First principles, derived in ``stamp_grid``; IEEE 754 for the steps of float32.
    """

    name = "clocks.resolution"
    needs = ("events",)
    _ENOUGH_EVENTS: Final = 1000

    def measure(self, window: Window) -> Comb | None:
        """Find the comb of one window."""
        facts, span = window.facts, window.span
        tick_us = _expected_us(facts)
        if facts.declared.events is not None and facts.declared.events.model == "linear":
            return None
        times_ns = window.events(0, 0).times_ns
        within = times_ns[(times_ns >= span.start_ns) & (times_ns < span.stop_ns)]
        stamps = np.sort(within // NS_PER_US + round(facts.origin_us)) // tick_us
        counts = comb_counts(stamps)
        deviates = counts.deviates()
        if not deviates.max() > 0:
            return None
        shares = counts.hits / np.maximum(counts.teeth, 1)
        # Of a grid many combs are hit: it is the finest of those that are hit most.
        sure = deviates >= min(float(deviates.max()), _SURELY)
        best = int(np.flatnonzero(sure & (shares >= _AS_MUCH * shares[sure].max()))[0])
        by_chance = counts.occupied / counts.ticks
        return Comb(
            span.start_ns, span.stop_ns, STEPS[best] * tick_us, float(shares[best]), by_chance, float(deviates[best])
        )

    def conclude(self, state: Sequence[Comb], facts: Facts) -> Observation:
        """Measure the grid of all stamps; where that is as declared, also what a part of them keeps to."""
        whole = self.examine(facts)
        if not state or whole.unobservable or whole.measurements[0].value != whole.measurements[0].expected:
            return whole
        worst = max(state, key=lambda comb: comb.deviate)
        start_us, stop_us = facts.to_file_us(worst.start_ns), facts.to_file_us(worst.stop_ns)
        part = Measured(
            name="events.partial_grid",
            value=worst.share,
            unit="1",
            expected=worst.by_chance,
            standard_error=(worst.share - worst.by_chance) / max(min(worst.deviate, 1e6), 1e-6),
            side="upper",
            tests=len(state) * len(STEPS),
            statement=f"Events keep to a grid of {worst.step:g} us around {start_us / 1e6:.3f} s: {worst.share:.0%} of "
            f"its ticks are met, {worst.by_chance:.1%} by chance.",
            code="clocks.resolution.partial_grid",
            where=Where(stream="events", start_us=start_us, stop_us=stop_us),
            suspects=(Suspect("quantised_time", "events", 0.95, worst.step / 1e3, "ms"),),
        )
        return Observation(whole.coverage, (*whole.measurements, part))

    def examine(self, facts: Facts) -> Observation:
        """Measure the grid of all event stamps."""
        events = _events(facts)
        coverage = Coverage(events.count, events.count, "events")
        declared = facts.declared.events
        if events.count < self._ENOUGH_EVENTS or not events.grid_ns:
            return Observation(coverage, unobservable=f"only {events.count} events: their grid is left to chance")
        if declared is not None and declared.model == "linear":
            return Observation(coverage, unobservable="events of the linear model lie on the grid of rendered steps")
        expected_us, grid_us = _expected_us(facts), events.grid_ns / NS_PER_US
        measured = Measured(
            name="events.grid",
            value=grid_us,
            unit="us",
            expected=float(expected_us),
            standard_error=0.0,
            side="upper",
            resolution=float(expected_us),
            statement=f"All event stamps lie on a grid of {grid_us:g} us; {expected_us} us is declared.",
            code="clocks.resolution.grid",
            where=Where(stream="events"),
            suspects=(Suspect("quantised_time", "events", 0.95, grid_us / 1e3, "ms"),),
        )
        return Observation(coverage, (measured,))


def _expected_us(facts: Facts) -> int:
    declared = facts.declared.events
    return max(1, declared.packet_interval_us if declared is not None else 0)


def _events(facts: Facts) -> EventScan:
    if facts.events is None:
        raise ValueError("Expected the file to have events, got none; the check needs them")
    return facts.events

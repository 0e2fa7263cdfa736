"""The grid that a part of the event stamps keeps to, where the others do not."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.clocks.combs import STEPS, comb_counts
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.clock_resets import set_clock

_SURELY: Final = 10.0
_AS_MUCH: Final = 0.8
"""Deviate of combs that are no chance, and share of the most hits from which on a comb is hit as much (for naming)."""


@dataclass(frozen=True, slots=True)
class Comb:
    """The comb that the stamps of a window keep to least by chance: its step in us, share of teeth hit, deviate."""

    start_ns: int
    stop_ns: int
    step_us: float
    share: float
    by_chance: float
    deviate: float


def declared_tick_us(facts: Facts) -> int:
    """Return the tick of event stamps: the interval of declared packets, else one microsecond."""
    declared = facts.declared.events
    return max(1, declared.packet_interval_us if declared is not None else 0)


def comb_of(window: Window) -> Comb | None:
    """Find the comb of one window's events; None where no comb is hit more than chance would."""
    facts, span = window.facts, window.span
    tick_us = declared_tick_us(facts)
    times_ns = window.events(0, 0).times_ns
    within = times_ns[slice(*np.searchsorted(times_ns, [span.start_ns, span.stop_ns]))]
    timestamps = within // NS_PER_US + round(facts.origin_us)
    counts = comb_counts(timestamps if tick_us == 1 else timestamps // tick_us)
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


def worst_comb(combs: Sequence[Comb], facts: Facts) -> Statistic:
    """State the comb of all windows that is least by chance."""
    worst = max(combs, key=lambda comb: comb.deviate)
    start_us, stop_us = facts.to_file_us(worst.start_ns), facts.to_file_us(worst.stop_ns)
    return Statistic(
        name="events.partial_grid",
        value=worst.share,
        unit="1",
        expected=worst.by_chance,
        standard_error=(worst.share - worst.by_chance) / max(min(worst.deviate, 1e6), 1e-6),
        side="upper",
        tests=len(combs) * len(STEPS),
        statement=f"Events keep to a grid of {worst.step_us:g} us around {start_us / 1e6:.3f} s: {worst.share:.0%} of "
        f"its ticks are met, {worst.by_chance:.1%} by chance.",
        code="clocks.resolution.partial_grid",
        where=Where(stream="events", start_us=start_us, stop_us=stop_us),
        suspects=(*_of_a_set_clock(worst, facts), Suspect("quantised_time", "events", 0.95, worst.step_us / 1e3, "ms")),
    )


def _of_a_set_clock(comb: Comb, facts: Facts) -> tuple[Suspect, ...]:
    """Suspect another unit where it alone leaves the comb: whole ticks of the one are multiples in the other."""
    was_set = set_clock(facts.events)
    if was_set is None:
        return ()
    tick_us = declared_tick_us(facts)
    return tuple(
        suspect
        for suspect in was_set.suspects
        if suspect.cause == "time_unit" and suspect.magnitude == comb.step_us / tick_us
    )

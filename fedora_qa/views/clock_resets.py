"""A clock of the events that was set for a while: it leaves one step back, and mostly a step forwards to match."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Suspect
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.sequence.facts import EventScan, EventStep
from fedora_qa.views.timestamp_unit import unit_factor

_BEHIND: Final = 2
"""k events in reverse make k - 1 steps back and as many that lie behind; a clock that is set back leaves many."""

_SURE: Final = 0.97
_OTHER: Final = 0.3
_GAINED: Final = 0.9
_ONE_SIDED: Final = 0.6
"""Without a step to match, a clock gained what it was set back by, or it was late from the first event on, or is early
to the last one: the latter leave a part that reaches to an end of the file."""


@dataclass(frozen=True, slots=True)
class SetClock:
    """What the steps of a clock that was set tell.

    Attributes
    ----------
    back
        The step back.
    forwards
        The step forwards that begins or ends the part; None where no step stands out.
    suspects
        What moved the part, most probable first.
    """

    back: EventStep
    forwards: EventStep | None
    suspects: tuple[Suspect, ...]

    def covers(self, times_ns: NDArray[np.int64]) -> bool:
        """Whether all instants (n,) lie where a map or a count of the right stamps would now be wrong."""
        steps = [self.back] if self.forwards is None else [self.back, self.forwards]
        timestamps = [timestamp for step in steps for timestamp in (step.before_ns, step.after_ns)]
        from_ns = min(timestamps) if self.forwards is not None else np.iinfo(np.int64).min
        return bool(len(times_ns) and np.all((times_ns >= from_ns) & (times_ns <= max(timestamps))))

    def is_of(self, start_ns: int, stop_ns: int) -> bool:
        """Whether a silence is the step forwards of the part."""
        step = self.forwards
        return step is not None and step.before_ns < stop_ns and step.after_ns > start_ns


def set_clock(events: EventScan | None) -> SetClock | None:
    """Return how the clock of the events was set back; None where it was not, or where single events are out of order.

    A part that is late by d begins with a step of d and the time to the next event, a, and ends with one of -d and the
    time b: both are alike but for a + b, and a and b are no longer than the longest step that is left. A part in
    another unit lasts longer, by the factor, than the time that is left for it. A clock that gains has no step
    forwards: where none is as long as the one back, it was not late by so much at once.
    """
    if events is None:
        return None
    backwards, forwards = _by_length(step for step in events.longest_steps)
    if not backwards or events.decreases > len(backwards) or events.behind <= _BEHIND * events.decreases:
        return None
    back = backwards[0]
    usual_ns = forwards[1].length_ns if len(forwards) > 1 else 0
    if not forwards or forwards[0].length_ns <= 2 * usual_ns:
        least_ns = forwards[0].length_ns if forwards else 0
        return SetClock(back, None, _without_step(could_be_late=least_ns >= -back.length_ns))
    return SetClock(back, forwards[0], _with_step(back, forwards[0], usual_ns))


def _by_length(steps: Iterable[EventStep]) -> tuple[list[EventStep], list[EventStep]]:
    ordered = sorted(steps, key=lambda step: -abs(step.length_ns))
    return [step for step in ordered if step.length_ns < 0], [step for step in ordered if step.length_ns > 0]


def _without_step(*, could_be_late: bool) -> tuple[Suspect, ...]:
    late = Suspect("time_offset", "events", _GAINED if could_be_late else _ONE_SIDED)
    return Suspect("clock_rate", "events", _GAINED), late


def _with_step(back: EventStep, forwards: EventStep, usual_ns: int) -> tuple[Suspect, ...]:
    first, second = sorted((back, forwards), key=lambda step: step.row)
    due_ns, lasts_ns = second.after_ns - first.before_ns, second.before_ns - first.after_ns
    factor = unit_factor(lasts_ns / due_ns) if due_ns > 0 else 1.0
    if factor != 1.0:
        return (Suspect("time_unit", "events", _SURE, factor, "1"),)
    gained_ns = -back.length_ns - forwards.length_ns
    drifts = abs(gained_ns) > 2 * usual_ns
    offset_ms = (forwards.length_ns - back.length_ns) / 2 / NS_PER_MS * (1 if first is forwards else -1)
    error_ms = max(usual_ns, 1) / NS_PER_MS
    offset = Suspect("time_offset", "events", _OTHER if drifts else _SURE, offset_ms, "ms", error_ms)
    ppm = 1e6 * gained_ns / due_ns if due_ns > 0 else None
    drift = Suspect("clock_rate", "events", _SURE if drifts else _OTHER, ppm, "ppm")
    return (drift, offset) if drifts else (offset, drift)

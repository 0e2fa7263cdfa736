"""Mistakes of clocks: one that was set for a while, and timestamps in another unit."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS
from fedora_qa.features import Feature
from fedora_qa.sequence.facts import EventScan, EventStep

UNIT_FACTORS: Final = {
    1e-6: "are in seconds",
    1e-3: "are in milliseconds",
    1.0: "agree with the other streams",
    32.0: "are wall-clock time of a simulation that ran 32 times slower",
    1e3: "are in nanoseconds",
}
"""Meaning of the ratio of a stream's duration to that of the others, for the mistakes that occur in real files."""

UNIT_WITHIN: Final = 0.2
"""Largest relative difference from a factor. Durations farther from all factors are streams that end early
(clocks.span)."""

TICK_FACTORS: Final = {
    10.0: "are ticks of 100 ns",
    0.09: "are ticks of 90 kHz",
}
"""Meaning of the ratio of a whole stream's duration to that of the others, for ticks that systems count: of .NET and
Windows, and of MPEG. They lie near ratios of streams that were cut, so that other evidence has to be added."""

TICKS_WITHIN: Final = 0.05
"""Largest relative difference from such a factor: streams of a second begin and end within a few hundredths."""

_BEHIND: Final = 2
"""k events in reverse make k - 1 steps back and as many that lie behind; a clock that is set back leaves many."""

_STEPS_OF_BLOCKS: Final = 2
"""Steps forwards of two blocks that were exchanged: from before the one to the other, and from the one to behind it."""

_AGREES: Final = 0.97
_DISAGREES: Final = 0.3
_GAINED: Final = 0.9
_ONE_SIDED: Final = 0.6
"""Agreement of the steps with an offset and with another rate of the part. ``diagnosis`` uses these numbers as the
support of both causes. They are set by hand; their order follows from the cases below.

Two steps that stand out decide between both causes (0.97 and 0.3). With an offset the lengths of the steps differ by no
more than usual steps do; with another rate they differ by more. 0.97 is also the support of a known factor of units
(``clocks.reset_by_unit``). A step back alone decides less. A clock that ran fast and was then set back leaves no other
step (0.9). An offset leaves a step forwards of the same length. Where there is such a step that does not stand out,
both causes are equally supported (0.9). Where there is none, an offset is possible only if the part begins or ends with
the file (0.6)."""


def unit_factor(ratio: float) -> float:
    """Return the first factor of ``UNIT_FACTORS`` that a ratio of durations is near to; 1 where there is none.

    Near means a relative difference of ``UNIT_WITHIN`` at most.
    """
    return next((factor for factor in UNIT_FACTORS if abs(ratio / factor - 1) <= UNIT_WITHIN), 1.0)


def tick_factor(ratio: float) -> float:
    """Return the factor of ``TICK_FACTORS`` that a ratio of durations is near to; 1 where there is none."""
    return next((factor for factor in TICK_FACTORS if abs(ratio / factor - 1) <= TICKS_WITHIN), 1.0)


@dataclass(frozen=True, slots=True)
class ClockReset(Feature):
    """A part of the events whose clock differs, and the steps of the timestamps that begin and end it.

    Attributes
    ----------
    back
        The step back.
    forwards
        The step forwards that begins or ends the part; None where no step stands out.
    unit_factor
        Known factor of units by which the part lasts too long; 1 where there is none.
    offset_agreement, drift_agreement
        Agreement of the steps with a constant offset of the part, and with a clock of another rate, 0 to 1. Both are 0
        where the part is in another unit.
    offset_ms, offset_error_ms
        Clock offset of the part (positive: timestamps too late) and its error, ms. None without a step forwards, and
        for a part in another unit.
    drift_ppm
        Rate error of the clock of the part, ppm, positive where the clock runs fast; None where it is not measured.
    """

    back: EventStep
    forwards: EventStep | None
    unit_factor: float = 1.0
    offset_agreement: float = 0.0
    drift_agreement: float = 0.0
    offset_ms: float | None = None
    offset_error_ms: float | None = None
    drift_ppm: float | None = None

    def covers(self, times_ns: NDArray[np.int64]) -> bool:
        """Whether all instants (n,) lie where the reset makes an index map or a count of correct timestamps wrong."""
        steps = [self.back] if self.forwards is None else [self.back, self.forwards]
        timestamps = [timestamp for step in steps for timestamp in (step.before_ns, step.after_ns)]
        from_ns = min(timestamps) if self.forwards is not None else np.iinfo(np.int64).min
        return bool(len(times_ns) and np.all((times_ns >= from_ns) & (times_ns <= max(timestamps))))

    def has_step_between(self, start_ns: int, stop_ns: int) -> bool:
        """Whether the step forwards of the part overlaps an interval without events.

        Parameters
        ----------
        start_ns, stop_ns
            Ends of the interval, ns from the file's origin.
        """
        step = self.forwards
        return step is not None and step.before_ns < stop_ns and step.after_ns > start_ns


def clock_reset(events: EventScan | None) -> ClockReset | None:
    """Return how the clock of the events was set back; None where it was not, or where single events are out of order.

    Let d be the clock offset of a part, and a and b the times to the next event at its two ends. The part begins with a
    step of d + a and ends with a step of -d + b, so the lengths of the two steps differ by a + b only; a and b are at
    most the longest step elsewhere. A part in another unit lasts longer than the time between its neighbours, by the
    factor of the unit. A clock that runs fast causes no step forwards: the part has a constant offset only where a step
    forwards is as long as the step back.

    Parameters
    ----------
    events
        The scan of the event timestamps; None where the file has no events.

    Returns
    -------
    ClockReset or None
        None where no clock reset is detected.
    """
    if events is None:
        return None
    by_length = sorted(events.longest_steps, key=lambda step: -abs(step.length_ns))
    backwards = [step for step in by_length if step.length_ns < 0]
    forwards = [step for step in by_length if step.length_ns > 0]
    if not backwards or events.decreases > len(backwards) or events.behind <= _BEHIND * events.decreases:
        return None
    back = backwards[0]
    if _are_exchanged(back, forwards):
        return None
    # The longest forward step may be the end of the part itself; the second longest bounds ordinary gaps.
    usual_ns = forwards[1].length_ns if len(forwards) > 1 else 0
    if not forwards or forwards[0].length_ns <= 2 * usual_ns:
        longest_ns = forwards[0].length_ns if forwards else 0
        offset_agreement = _GAINED if longest_ns >= -back.length_ns else _ONE_SIDED
        return ClockReset(back, None, offset_agreement=offset_agreement, drift_agreement=_GAINED)
    # The steps at both ends of the part are compared with a factor of units, an offset, and another rate.
    forth = forwards[0]
    first, second = sorted((back, forth), key=lambda step: step.row)
    due_ns, lasts_ns = second.after_ns - first.before_ns, second.before_ns - first.after_ns
    factor = unit_factor(lasts_ns / due_ns) if due_ns > 0 else 1.0
    if factor != 1.0:
        return ClockReset(back, forth, unit_factor=factor)
    # A constant offset d makes steps of d + a and -d + b: their sum is a + b, at most twice the longest usual step.
    gained_ns = -back.length_ns - forth.length_ns
    drifts = abs(gained_ns) > 2 * usual_ns
    return ClockReset(
        back,
        forth,
        offset_agreement=_DISAGREES if drifts else _AGREES,
        drift_agreement=_AGREES if drifts else _DISAGREES,
        # Half the difference of d + a and -d + b is d, with an error of (a - b) / 2, below the longest usual gap.
        offset_ms=(forth.length_ns - back.length_ns) / 2 / NS_PER_MS * (1 if first is forth else -1),
        offset_error_ms=max(usual_ns, 1) / NS_PER_MS,
        # The net step is the time that the clock gained within the part: over the part's length it is the rate error.
        drift_ppm=1e6 * gained_ns / due_ns if due_ns > 0 else None,
    )


def _are_exchanged(back: EventStep, forwards: list[EventStep]) -> bool:
    """Whether two steps forwards (the longest first) lie around a step back, and are together as long as it."""
    if len(forwards) <= _STEPS_OF_BLOCKS:
        return False
    first, second = sorted(forwards[:_STEPS_OF_BLOCKS], key=lambda step: step.row)
    usual_ns = forwards[_STEPS_OF_BLOCKS].length_ns
    # Each of the three steps has a usual one more or less.
    is_as_long = abs(first.length_ns + back.length_ns + second.length_ns) <= 3 * usual_ns
    return first.row < back.row < second.row and min(first.length_ns, second.length_ns) > 2 * usual_ns and is_as_long

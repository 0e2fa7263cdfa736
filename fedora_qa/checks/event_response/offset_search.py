"""The second look at gross offsets: events of some windows are read again as they would be without the offset.

One fit reads an offset too small: light does not change evenly for long. Read again with the offset undone as far as it
is known, a window tells what is left of it, and so on until nothing is left (Gauss and Newton's way). That begins at
what one fit told of all windows, and at what a ladder of offsets tells by level samples; where these ends differ, the
one that leaves the smaller residual counts. Further windows are read with the same offset undone, and all are fitted
together, so that their scatter is seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_clock_offset import Lateness, by_readings, told_error_ms
from fedora_qa.views.frame_interpolation import ReadingSums, fit_all, reading_sums_on_time
from fedora_qa.views.level_samples import FARTHEST_OFFSET_NS, FoundOffset, search_offset

ROUNDS: Final = 5
"""Readings of a window: each leaves a third of what the last one left, or less, so that 20 ms become 0.2 ms."""

_CLOSED_S: Final = 3e-3
"""What a last reading may tell: so much one fit reads truly, as of level samples."""

_NEARLY: Final = 2.0
"""Times the error of one fit of all windows that a few which were read again may have to be believed instead."""


@dataclass(frozen=True, slots=True)
class ReadAgain:
    """A window's readings with events taken to be late by so much."""

    late_ns: int
    sums: ReadingSums


Searched = FoundOffset | ReadAgain


def search_again(window: Window, told_s: float | None, before: Sequence[Searched]) -> Searched | None:
    """Return a window's events with their offset undone, or the offset alone; None where they follow at none.

    ``told_s`` is what one fit of all windows told, where it did; ``before`` is what other windows told since.
    """
    told = [one.late_ns for one in before if isinstance(one, ReadAgain)]
    if told:
        return _read(window, told[0])
    by_ladder = search_offset(window)
    starts_s = [one for one in (told_s, None if by_ladder is None else by_ladder.late_s) if one is not None]
    closed = [one for start_s in starts_s if (one := _closed(window, start_s)) is not None]
    return min(closed, key=lambda one: one[1])[0] if closed else by_ladder


def _read(window: Window, late_ns: int) -> ReadAgain | None:
    sums = reading_sums_on_time(window, late_ns)
    return None if sums is None else ReadAgain(late_ns, sums)


def _closed(window: Window, late_s: float) -> tuple[ReadAgain, float] | None:
    """Return the window read with an offset undone that leaves none, and its residual; None where there is no end."""
    end: tuple[ReadAgain, float] | None = None
    for _ in range(ROUNDS):
        late_ns = round(late_s * 1e9)
        again = _read(window, late_ns) if abs(late_ns) <= FARTHEST_OFFSET_NS else None
        fits = fit_all([again.sums]) if again is not None else None
        found = by_readings(fits) if fits is not None else None
        if again is None or fits is None or found is None:
            return None
        late_s += found.late_s
        end = (again, fits.fit.relative_sigma) if abs(found.late_s) <= _CLOSED_S else None
    return end


def found_again(searched: Sequence[Searched]) -> Lateness | None:
    """Return the offset of all events by a fit of what was read again, or else the mean of what the ladder told."""
    read = [one for one in searched if isinstance(one, ReadAgain)]
    fits = fit_all([one.sums for one in read])
    left = by_readings(fits) if fits is not None else None
    if left is not None and abs(left.late_s) > _CLOSED_S:
        return None  # the other windows say something else than the first one
    if left is not None:
        late_s = 1e-9 * read[0].late_ns + left.late_s
        return Lateness(late_s, left.error_s, left.bound_s, 0.0, np.inf, np.inf, np.inf)
    offsets = [one for one in searched if isinstance(one, FoundOffset)]
    if not offsets:
        return None
    each_s = np.array([one.late_s for one in offsets])
    error_s = max(float(np.ptp(each_s)) / 2, *(one.standard_error_s for one in offsets))
    return Lateness(float(each_s.mean()), error_s, max(one.bound_s for one in offsets), 0.0, np.inf, np.inf, np.inf)


def tells_better(again: Lateness, found: Lateness, facts: Facts) -> bool:
    """Whether the windows that were read again tell the offset: as well as one fit of all does, nearly.

    That one reads it too small, by more than it knows where light changes from frame to frame.
    """
    known_ms = told_error_ms(found, 1e3 * found.late_s, 1e3 * found.bound_s, facts)
    return told_error_ms(again, 1e3 * again.late_s, 1e3 * again.bound_s, facts) < _NEARLY * known_ms

"""Two seconds of frames at a time: stretches are followed window by window, joined, and closed.

A longer stretch sees rarer losses, but gives every flaw of the frames' antialiasing more chances; it also tells less of
the place. States of any windows merge exactly: what may still grow stays open, at both ends of a state only.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.events.excursions import Excursions
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import ROUNDING_DN, seen_frames
from fedora_qa.views.frame_run_sums import ALL, EVEN, Stretch, excused_pixels, join, telling_pixels, violations

Bool = NDArray[np.bool_]

GROUP_NS: Final = 2 * NS_PER_S
"""Windows that begin within the same two seconds are joined."""


@dataclass(frozen=True, slots=True)
class Closed:
    """What is kept of the stretches of one group.

    Attributes
    ----------
    first_frame, last_frame
        Both included.
    frames
        Frames that were joined.
    pixels
        (h, w) the law was broken, eight pixels a byte.
    suspected
        The frame interval that most of the violations may lie in; the first one where nothing tells.
    events_per_pixel
        Mean number of events.
    mute
        Pixels that broke the law without a single event.
    telling
        Pixels in which a single event too many or too few could break the law.
    flawed
        Pixels that break the law only where uneven frames are believed: how often antialiasing fails here.
    from_start
        Whether the reference was held to be the signal at the first frame.
    """

    first_frame: int
    last_frame: int
    frames: int
    pixels: NDArray[np.uint8]
    suspected: int
    events_per_pixel: float
    mute: int
    telling: int
    flawed: int
    from_start: bool

    def unpacked(self, shape: tuple[int, int]) -> Bool:
        """Return the pixels (h, w) that broke the law."""
        return np.unpackbits(self.pixels, count=shape[0] * shape[1]).reshape(shape).astype(np.bool_)


@dataclass(slots=True)
class Ledger:
    """Groups of stretches in the order of time; all but the last, and the first that may go on before, are closed."""

    model: EventModel
    phase_known: bool = False
    """Whether the first reference is declared to be the signal at frame 0, and no event comes before it."""
    groups: list[tuple[int, list[Stretch] | Closed]] = field(default_factory=list)
    from_start: bool = False
    """Whether nothing comes before the first group."""

    def follow(self, window: Window) -> None:
        """Take in the frames of the window that comes next, in place where they go on from the last stretch."""
        seen, declared = seen_frames(window), window.facts.declared.events
        if declared is None or len(seen) < 2:
            return
        rounding_dn, excused = ROUNDING_DN[window.facts.declared.transfer], excused_pixels(window, declared)
        group = window.span.start_ns // GROUP_NS
        last = self.groups[-1][1] if self.groups and self.groups[-1][0] == group else []
        if isinstance(last, list) and last and last[-1].last_frame == seen.frames[0]:
            last[-1].follow(seen, declared, rounding_dn, excused)
            return
        self.from_start |= not self.groups and window.span.index == 0
        self.add(group, [join(seen, declared, rounding_dn, excused)])

    def add(self, group: int, stretches: list[Stretch] | Closed) -> None:
        """Append what comes next, joined to what it continues."""
        if self.groups and self.groups[-1][0] == group:
            number, known = self.groups.pop()
            stretches = _joined(known, stretches)
        elif self.groups and (len(self.groups) > 1 or self.from_start):
            number, known = self.groups[-1]
            self.groups[-1] = number, self._closed(known)
        self.groups.append((group, stretches))

    def then(self, later: "Ledger") -> "Ledger":
        """Return the ledger of both."""
        if not self.groups:
            return later
        merged = Ledger(self.model, self.phase_known, list(self.groups), self.from_start)
        for group, stretches in later.groups:
            merged.add(group, stretches)
        return merged

    def closed(self) -> list[Closed]:
        """Return all groups, closed."""
        return [self._closed(stretches) for _, stretches in self.groups]

    def _closed(self, stretches: list[Stretch] | Closed) -> Closed:
        return stretches if isinstance(stretches, Closed) else _close(stretches, self.model, self.phase_known)


def _joined(known: list[Stretch] | Closed, following: list[Stretch] | Closed) -> list[Stretch]:
    if isinstance(known, Closed) or isinstance(following, Closed):
        raise TypeError("Expected groups at the ends of a ledger to be open; add windows in the order of time")
    joined = list(known)
    for stretch in following:
        if joined and joined[-1].last_frame == stretch.first_frame:
            joined[-1] = joined[-1].then(stretch)
        else:
            joined.append(stretch)
    return joined


def _close(stretches: list[Stretch], declared: EventModel, phase_known: bool) -> Closed:
    first, last = stretches[0].first_frame, stretches[-1].last_frame
    pixels = np.zeros(stretches[0].excused.shape, np.bool_)
    mute, telling, flawed = pixels.copy(), pixels.copy(), pixels.copy()
    from_start = False
    # How many violations begin at or end with a frame: their running sum counts those that a frame interval may hold.
    changes = np.zeros(last - first + 2, np.int64)
    for stretch in stretches:
        known = phase_known and stretch.first_frame == 0
        broken, from_start_too = violations(stretch, EVEN, declared, known)
        from_start |= from_start_too
        telling |= telling_pixels(stretch, declared)
        pixels |= broken
        flawed |= violations(stretch, ALL, declared, from_start_too)[0]
        mute |= broken & (stretch.events == 0)
        if isinstance(stretch.bounds, Excursions):
            highest, lowest = stretch.bounds.highest_at[broken] - first, stretch.bounds.lowest_at[broken] - first
            np.add.at(changes, np.minimum(highest, lowest), 1)
            np.add.at(changes, np.maximum(highest, lowest), -1)
    return Closed(
        first,
        last,
        sum(stretch.last_frame - stretch.first_frame + 1 for stretch in stretches),
        np.packbits(pixels),
        first + int(np.argmax(np.cumsum(changes))),
        sum(float(stretch.events.mean()) for stretch in stretches),
        int(np.count_nonzero(mute)),
        int(np.count_nonzero(telling)),
        int(np.count_nonzero(flawed & ~pixels)),
        from_start,
    )

"""Stretches of frames over which events must add up: made window by window, joined, and closed after two seconds.

A longer stretch sees rarer losses, but gives every flaw of the frames' antialiasing more chances; it also tells less of
the place. States of any windows merge exactly: what may still grow stays open, at both ends of a state only.
"""

from dataclasses import dataclass, field
from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.events.view import ROUNDING_DN, SeenFrames, seen_frames, sensor_events, sensor_shape
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.event_excursions import EVERY_FRAME, Excursions, bound
from fedora_qa.estimators.event_kernels import mark_bursts
from fedora_qa.estimators.event_runs import Runs, follow_runs
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window

Bool = NDArray[np.bool_]

GROUP_NS: Final = 2 * NS_PER_S
"""Windows that begin within the same two seconds are joined."""

TELLS_THE_PHASE: Final = 1.2
"""Share of a threshold by which E must have varied to tell where it began. From a start at random at least a third of
such pixels leave the thresholds around it: of a range of r thresholds, 2 - r may be left before it is passed. First
runs of the linear model end with an event; there a range of one threshold has to do, and tells less."""
FEWEST_TO_TELL: Final = 30
MOST_BEYOND: Final = 0.1

MISMATCH_SIGMAS: Final = 5.0
"""Of the declared spread of thresholds: beyond lies one pixel in two million."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Consecutive frames whose bounds have been joined.

    Attributes
    ----------
    bounds
        By the law of the declared model, where frames are even enough to tell more than the events do.
    of_all
        The same with every frame: where only these are broken, frames are not the means of their pixels.
    events
        (h, w) events in the stretch.
    excused
        (h, w): events may honestly be missing (declared hot pixels, bursts within a declared refractory period).
    """

    bounds: Excursions | Runs
    of_all: Excursions | Runs
    events: NDArray[np.int64]
    excused: Bool

    def then(self, later: "Stretch") -> "Stretch":
        """Join with the stretch that begins at this one's last frame. Exact."""
        bounds, of_all = _then(self.bounds, later.bounds), _then(self.of_all, later.of_all)
        return Stretch(bounds, of_all, self.events + later.events, self.excused | later.excused)


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
    """Groups of stretches in the order of time; all but the first and the last are closed."""

    model: EventModel
    phase_known: bool = False
    """Whether the first reference is declared to be the signal at frame 0, and no event comes before it."""
    groups: list[tuple[int, list[Stretch] | Closed]] = field(default_factory=list)

    def add(self, group: int, stretches: list[Stretch] | Closed) -> None:
        """Append what comes next, joined to what it continues."""
        if self.groups and self.groups[-1][0] == group:
            number, known = self.groups.pop()
            stretches = _joined(known, stretches)
        elif len(self.groups) > 1:
            number, known = self.groups[-1]
            self.groups[-1] = number, self._closed(known)
        self.groups.append((group, stretches))

    def then(self, later: "Ledger") -> "Ledger":
        """Return the ledger of both."""
        merged = Ledger(self.model, self.phase_known, list(self.groups))
        for group, stretches in later.groups:
            merged.add(group, stretches)
        return merged

    def closed(self) -> list[Closed]:
        """Return all groups, closed."""
        return [self._closed(stretches) for _, stretches in self.groups]

    def _closed(self, stretches: list[Stretch] | Closed) -> Closed:
        return stretches if isinstance(stretches, Closed) else _close(stretches, self.model, self.phase_known)


def stretch_of(window: Window) -> Stretch | None:
    """Return the stretch of a window's frames and the one after it; None where there are not two."""
    seen, declared = seen_frames(window), window.facts.declared.events
    if declared is None or len(seen) < 2:
        return None
    excused = np.zeros(sensor_shape(window.facts.declared), np.bool_)
    if declared.refractory_us > 0:
        events = sensor_events(window)
        mark_bursts(events.x, events.y, events.times_ns, int(2 * declared.refractory_us * NS_PER_US), excused)
    for column, row in declared.hot_pixels:
        if 0 <= row < excused.shape[0] and 0 <= column < excused.shape[1]:
            excused[row, column] = True
    return join(seen, declared, ROUNDING_DN[window.facts.declared.transfer], excused)


def join(seen: SeenFrames, declared: EventModel, rounding_dn: float, excused: Bool) -> Stretch:
    """Return the stretch of two frames or more."""
    laws = _log_laws if declared.model == "log" else _linear_laws
    events = seen.counts.sum(axis=(0, 1), dtype=np.int32).astype(np.int64)
    uneven = rounding_dn, (declared.threshold_on + declared.threshold_off) / 2
    believed, of_all = laws(seen, declared, (uneven, EVERY_FRAME))
    return Stretch(believed, of_all, events, excused)


Rules = tuple[tuple[float, float], tuple[float, float]]
"""Which frames are believed: the even ones, and all.

Frames are left out where the pixels that a footprint cuts leave the signal open by C+ + C- or more: where their
error is not below rounding and (C+ + C-) / 2 times the light (log; of the linear model, (C+ + C-) / 2).

The signal is known that well without them, from the events. They would add something only where their bound holds
to the last, and that is so if the frame is the mean over its pixel. Of a renderer with n samples a side, a step of
d DN makes it err by up to d / (2 n); the bound of ``event_footprint`` is 0.27 d on average (at 9/4 frame pixels an
event pixel: two cut pixels a side of 1/6 d each over 9/4, in both directions). Four samples a side may thus err by
half the bound, which is most where the bound is.
"""


def _log_laws(seen: SeenFrames, declared: EventModel, rules: Rules) -> tuple[Excursions, ...]:
    elapsed_s = np.diff(seen.times_ns) / NS_PER_S
    return bound(
        seen.even_dn,
        seen.error_dn,
        seen.counts,
        declared.leak_rate_hz * declared.threshold_on * elapsed_s,
        threshold_on=declared.threshold_on,
        threshold_off=declared.threshold_off,
        frames=seen.frames,
        dark=declared.log_eps_dn,
        uneven=rules,
    )


def _linear_laws(seen: SeenFrames, declared: EventModel, rules: Rules) -> tuple[Runs, ...]:
    return tuple(_linear_law(seen, declared, uneven) for uneven in rules)


def _linear_law(seen: SeenFrames, declared: EventModel, uneven: tuple[float, float]) -> Runs:
    # The event camera rounds luma to whole values itself.
    error = np.where(seen.error_dn < sum(uneven), seen.error_dn + 0.5, np.inf)
    return follow_runs(
        seen.even_dn - error,
        seen.even_dn + error,
        seen.counts,
        threshold_on=declared.threshold_on + MISMATCH_SIGMAS * declared.threshold_sigma,
        threshold_off=declared.threshold_off + MISMATCH_SIGMAS * declared.threshold_sigma,
        frames=seen.frames,
    )


def _then(one: Excursions | Runs, other: Excursions | Runs) -> Excursions | Runs:
    if isinstance(one, Excursions) and isinstance(other, Excursions):
        return one.then(other)
    if isinstance(one, Runs) and isinstance(other, Runs):
        return one.then(other)
    raise TypeError(f"Expected stretches of one model, got {type(one).__name__} and {type(other).__name__}")


def _joined(known: list[Stretch] | Closed, following: list[Stretch] | Closed) -> list[Stretch]:
    if isinstance(known, Closed) or isinstance(following, Closed):
        raise TypeError("Expected groups at the ends of a ledger to be open; add windows in the order of time")
    joined = list(known)
    for stretch in following:
        if joined and joined[-1].bounds.last_frame == stretch.bounds.first_frame:
            joined[-1] = joined[-1].then(stretch)
        else:
            joined.append(stretch)
    return joined


def _close(stretches: list[Stretch], declared: EventModel, phase_known: bool) -> Closed:
    first, last = stretches[0].bounds.first_frame, stretches[-1].bounds.last_frame
    pixels = np.zeros(stretches[0].excused.shape, np.bool_)
    mute, telling, flawed = pixels.copy(), pixels.copy(), pixels.copy()
    from_start = False
    # How many violations begin at or end with a frame: their running sum counts those that a frame interval may hold.
    changes = np.zeros(last - first + 2, np.int64)
    for stretch in stretches:
        known = phase_known and stretch.bounds.first_frame == 0
        broken, from_start_too = violations(stretch, stretch.bounds, declared, known)
        from_start |= from_start_too
        telling |= _telling(stretch, declared)
        pixels |= broken
        flawed |= violations(stretch, stretch.of_all, declared, from_start_too)[0]
        mute |= broken & (stretch.events == 0)
        if isinstance(stretch.bounds, Excursions):
            highest, lowest = stretch.bounds.highest[1, broken] - first, stretch.bounds.lowest[1, broken] - first
            np.add.at(changes, np.minimum(highest, lowest), 1)
            np.add.at(changes, np.maximum(highest, lowest), -1)
    return Closed(
        first,
        last,
        sum(stretch.bounds.last_frame - stretch.bounds.first_frame + 1 for stretch in stretches),
        np.packbits(pixels),
        first + int(np.argmax(np.cumsum(changes))),
        sum(float(stretch.events.mean()) for stretch in stretches),
        int(np.count_nonzero(mute)),
        int(np.count_nonzero(telling)),
        int(np.count_nonzero(flawed & ~pixels)),
        from_start,
    )


def violations(
    stretch: Stretch, bounds: Excursions | Runs, declared: EventModel, phase_known: bool
) -> tuple[Bool, bool]:
    """Return where the law is broken, and whether a declared start was part of the law."""
    own = _own(stretch, declared)
    if isinstance(bounds, Runs):
        broken = bounds.broken
    else:
        broken = bounds.excess() > declared.threshold_on + declared.threshold_off + own
    beyond = _beyond_start(bounds, declared, own) if phase_known else None
    if beyond is not None:
        broken = broken | beyond
    return broken & ~stretch.excused, beyond is not None


def _telling(stretch: Stretch, declared: EventModel) -> Bool:
    """Return where the signal is known at all (linear), or varies by so much that an event more would break the law."""
    if isinstance(stretch.bounds, Runs):
        known: Bool = np.all(np.isfinite(stretch.bounds.tail), axis=0)
        return known
    varied: Bool = stretch.bounds.excess() > max(declared.threshold_on, declared.threshold_off)
    return varied


def _beyond_start(bounds: Excursions | Runs, declared: EventModel, own: NDArray[np.float64]) -> Bool | None:
    """Return where E left the thresholds around its start; None where the file does not bear the declared phase out."""
    beyond: Bool = bounds.departure(declared.threshold_on, declared.threshold_off) > own
    enough = TELLS_THE_PHASE if isinstance(bounds, Excursions) else 1.0
    telling: Bool = bounds.excess() > enough * max(declared.threshold_on, declared.threshold_off) + own
    if np.count_nonzero(telling) < FEWEST_TO_TELL or beyond[telling].mean() > MOST_BEYOND:
        return None
    return beyond


def _own(stretch: Stretch, declared: EventModel) -> NDArray[np.float64]:
    """Return what the spread of thresholds adds: each event steps by the pixel's own, and so are the law's ends."""
    own: NDArray[np.float64] = MISMATCH_SIGMAS * declared.threshold_sigma * (sqrt(2.0) + np.sqrt(stretch.events))
    return own

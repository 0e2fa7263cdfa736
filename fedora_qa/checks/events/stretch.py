"""Stretches of frames over which events must add up: made window by window, joined, and closed after two seconds.

A longer stretch sees rarer losses, but gives every flaw of the frames' antialiasing more chances; it also tells less of
the place. States of any windows merge exactly: what may still grow stays open, at both ends of a state only.
"""

from dataclasses import dataclass, field
from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.events.view import SeenFrames, seen_frames, sensor_events, sensor_shape
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.event_excursions import Excursions, bound
from fedora_qa.estimators.event_kernels import mark_bursts
from fedora_qa.estimators.event_runs import Runs, follow_runs
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

GROUP_NS: Final = 2 * NS_PER_S
"""Windows that begin within the same two seconds are joined."""

MISMATCH_SIGMAS: Final = 5.0
"""Of the declared spread of thresholds: beyond lies one pixel in two million."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Consecutive frames whose bounds have been joined.

    Attributes
    ----------
    bounds
        By the law of the declared model.
    events
        (h, w) events in the stretch.
    excused
        (h, w): events may honestly be missing (declared hot pixels, bursts within a declared refractory period).
    extent
        (2, h, w) largest lower and smallest upper bound of the signal itself, in the unit of the thresholds.
    """

    bounds: Excursions | Runs
    events: NDArray[np.int64]
    excused: Bool
    extent: Float64

    def then(self, later: "Stretch") -> "Stretch":
        """Join with the stretch that begins at this one's last frame. Exact."""
        one, other = self.bounds, later.bounds
        if isinstance(one, Excursions) and isinstance(other, Excursions):
            joined: Excursions | Runs = one.then(other)
        elif isinstance(one, Runs) and isinstance(other, Runs):
            joined = one.then(other)
        else:
            raise TypeError(f"Expected stretches of one model, got {type(one).__name__} and {type(other).__name__}")
        extent = np.stack([np.fmax(self.extent[0], later.extent[0]), np.fmin(self.extent[1], later.extent[1])])
        return Stretch(joined, self.events + later.events, self.excused | later.excused, extent)


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
    telling
        Share of the pixels in which the law would surely break if they gave no event, 0 to 1.
    """

    first_frame: int
    last_frame: int
    frames: int
    pixels: NDArray[np.uint8]
    suspected: int
    events_per_pixel: float
    telling: float

    def unpacked(self, shape: tuple[int, int]) -> Bool:
        """Return the pixels (h, w) that broke the law."""
        return np.unpackbits(self.pixels, count=shape[0] * shape[1]).reshape(shape).astype(np.bool_)


@dataclass(slots=True)
class Ledger:
    """Groups of stretches in the order of time; all but the first and the last are closed."""

    model: EventModel
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
        merged = Ledger(self.model, list(self.groups))
        for group, stretches in later.groups:
            merged.add(group, stretches)
        return merged

    def closed(self) -> list[Closed]:
        """Return all groups, closed."""
        return [self._closed(stretches) for _, stretches in self.groups]

    def _closed(self, stretches: list[Stretch] | Closed) -> Closed:
        return stretches if isinstance(stretches, Closed) else _close(stretches, self.model)


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
    bounds_of, law = (_log_bounds, _log_law) if declared.model == "log" else (_linear_bounds, _linear_law)
    lower, upper = bounds_of(seen, declared)
    extent = np.stack([np.fmax.reduce(lower), np.fmin.reduce(upper)])
    return Stretch(law(lower, upper, seen, declared), seen.counts.sum(axis=(0, 1), dtype=np.int64), excused, extent)


def _log_bounds(seen: SeenFrames, declared: EventModel) -> tuple[Float64, Float64]:
    """Return lower and upper bounds (n, h, w) of the signal at each frame, nat."""
    low = np.maximum(seen.even_dn - seen.error_dn + declared.log_eps_dn, 0.0)
    high = seen.even_dn + seen.error_dn + declared.log_eps_dn
    with np.errstate(divide="ignore"):
        return np.log(low), np.log(high)


def _log_law(lower: Float64, upper: Float64, seen: SeenFrames, declared: EventModel) -> Excursions:
    elapsed_s = np.diff(seen.times_ns) / NS_PER_S
    return bound(
        lower,
        upper,
        seen.counts,
        declared.leak_rate_hz * declared.threshold_on * elapsed_s,
        threshold_on=declared.threshold_on,
        threshold_off=declared.threshold_off,
        frames=seen.frames,
    )


def _linear_bounds(seen: SeenFrames, declared: EventModel) -> tuple[Float64, Float64]:
    """Return lower and upper bounds (n, h, w) of the signal at each frame, DN."""
    # The event camera rounds luma to whole values itself.
    error = seen.error_dn + 0.5
    return seen.even_dn - error, seen.even_dn + error


def _linear_law(lower: Float64, upper: Float64, seen: SeenFrames, declared: EventModel) -> Runs:
    return follow_runs(
        lower,
        upper,
        seen.counts,
        threshold_on=declared.threshold_on + MISMATCH_SIGMAS * declared.threshold_sigma,
        threshold_off=declared.threshold_off + MISMATCH_SIGMAS * declared.threshold_sigma,
        frames=seen.frames,
    )


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


def _close(stretches: list[Stretch], declared: EventModel) -> Closed:
    first, last = stretches[0].bounds.first_frame, stretches[-1].bounds.last_frame
    pixels = np.zeros(stretches[0].excused.shape, np.bool_)
    # How many violations begin at or end with a frame: their running sum counts those that a frame interval may hold.
    changes = np.zeros(last - first + 2, np.int64)
    for stretch in stretches:
        broken = _broken(stretch, declared) & ~stretch.excused
        pixels |= broken
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
        float(np.any([_telling(stretch, declared) for stretch in stretches], axis=0).mean()),
    )


def _broken(stretch: Stretch, declared: EventModel) -> Bool:
    if isinstance(stretch.bounds, Runs):
        return stretch.bounds.broken
    limit = declared.threshold_on + declared.threshold_off
    # Each event steps by the pixel's own threshold, and the law's ends are its own as well.
    own = MISMATCH_SIGMAS * declared.threshold_sigma * (sqrt(2.0) + np.sqrt(stretch.events))
    broken: Bool = stretch.bounds.excess() > limit + own
    return broken


def _telling(stretch: Stretch, declared: EventModel) -> Bool:
    """Return the pixels (h, w) whose level surely moves by more than a pixel without events may see."""
    brightest, darkest = stretch.extent
    telling: Bool = brightest - darkest > declared.threshold_on + declared.threshold_off
    return telling

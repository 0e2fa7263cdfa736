"""Stretches of frames over which events must add up, and the pixels in which they do not."""

from dataclasses import dataclass
from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.events.excursions import EVERY_FRAME, Excursions, Law, bound
from fedora_qa.estimators.events.linear_runs import Runs, follow_runs
from fedora_qa.estimators.events.row_kernels import add_counts, mark_bursts
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import SeenFrames, sensor_events, sensor_shape

Bool = NDArray[np.bool_]

TELLS_THE_PHASE: Final = 1.2
"""Share of a threshold by which E must have varied to tell where it began. From a start at random at least a third of
such pixels leave the thresholds around it: of a range of r thresholds, 2 - r may be left before it is passed. First
runs of the linear model end with an event; there a range of one threshold has to do, and tells less."""
FEWEST_TO_TELL: Final = 30
MOST_BEYOND: Final = 0.1

MISMATCH_SIGMAS: Final = 5.0
"""Of the declared spread of thresholds: beyond lies one pixel in two million."""


@dataclass(slots=True)
class Stretch:
    """Consecutive frames whose bounds have been joined.

    Attributes
    ----------
    bounds
        By the law of the declared model, by each rule which frames are believed: ``EVEN`` and ``ALL``.
    events
        (h, w) events in the stretch.
    excused
        (h, w): events may honestly be missing (declared hot pixels, bursts within a declared refractory period).
    """

    bounds: Excursions | tuple[Runs, ...]
    events: NDArray[np.int32]
    excused: Bool

    @property
    def first_frame(self) -> int:
        """The first frame."""
        return self.bounds.first_frame if isinstance(self.bounds, Excursions) else self.bounds[EVEN].first_frame

    @property
    def last_frame(self) -> int:
        """The last frame, included."""
        return self.bounds.last_frame if isinstance(self.bounds, Excursions) else self.bounds[EVEN].last_frame

    def follow(self, seen: SeenFrames, declared: EventModel, rounding_dn: float, excused: Bool) -> None:
        """Go on, in place, over frames of which the first is this stretch's last."""
        if isinstance(self.bounds, Excursions):
            self.bounds.follow(seen.even_dn, seen.error_dn, seen.counts, _drift(seen, declared), seen.frames)
        else:
            later = _linear_laws(seen, declared, rounding_dn)
            self.bounds = tuple(one.then(other) for one, other in zip(self.bounds, later, strict=True))
        add_counts(seen.counts, self.events)
        self.excused |= excused

    def then(self, later: "Stretch") -> "Stretch":
        """Join with the stretch that begins at this one's last frame. Exact."""
        return Stretch(_then(self.bounds, later.bounds), self.events + later.events, self.excused | later.excused)


def excused_pixels(window: Window, declared: EventModel) -> Bool:
    """Return the pixels (h, w) of a window in which events may honestly be missing."""
    excused = np.zeros(sensor_shape(window.facts.declared), np.bool_)
    if declared.refractory_us > 0:
        events = sensor_events(window)
        mark_bursts(events.x, events.y, events.times_ns, int(2 * declared.refractory_us * NS_PER_US), excused)
    for column, row in declared.hot_pixels:
        if 0 <= row < excused.shape[0] and 0 <= column < excused.shape[1]:
            excused[row, column] = True
    return excused


def join(seen: SeenFrames, declared: EventModel, rounding_dn: float, excused: Bool) -> Stretch:
    """Return the stretch of two frames or more."""
    events = np.zeros(excused.shape, np.int32)
    add_counts(seen.counts, events)
    if declared.model == "linear":
        return Stretch(_linear_laws(seen, declared, rounding_dn), events, excused)
    law = Law(declared.threshold_on, declared.threshold_off, declared.log_eps_dn, _rules(declared, rounding_dn))
    bounds = bound(seen.even_dn, seen.error_dn, seen.counts, _drift(seen, declared), law, seen.frames)
    return Stretch(bounds, events, excused)


EVEN, ALL = 0, 1
"""Which frames are believed: those that are even enough to tell more than the events do, and every frame. Where only
the bounds of all are broken, frames are not the means of their pixels.

Frames are left out where the pixels that a footprint cuts leave the signal open by C+ + C- or more: where their
error is not below rounding and (C+ + C-) / 2 times the light (log; of the linear model, (C+ + C-) / 2).

The signal is known that well without them, from the events. They would add something only where their bound holds
to the last, and that is so if the frame is the mean over its pixel. Of a renderer with n samples a side, a step of
d DN makes it err by up to d / (2 n); the bound of ``event_footprint`` is 0.27 d on average (at 9/4 frame pixels an
event pixel: two cut pixels a side of 1/6 d each over 9/4, in both directions). Four samples a side may thus err by
half the bound, which is most where the bound is.
"""


def _rules(declared: EventModel, rounding_dn: float) -> tuple[tuple[float, float], ...]:
    return (rounding_dn, (declared.threshold_on + declared.threshold_off) / 2), EVERY_FRAME


def _drift(seen: SeenFrames, declared: EventModel) -> NDArray[np.float64]:
    drift: NDArray[np.float64] = declared.leak_rate_hz * declared.threshold_on * np.diff(seen.times_ns) / NS_PER_S
    return drift


def _linear_laws(seen: SeenFrames, declared: EventModel, rounding_dn: float) -> tuple[Runs, ...]:
    return tuple(_linear_law(seen, declared, uneven) for uneven in _rules(declared, rounding_dn))


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


def _then(one: Excursions | tuple[Runs, ...], other: Excursions | tuple[Runs, ...]) -> Excursions | tuple[Runs, ...]:
    if isinstance(one, Excursions) and isinstance(other, Excursions):
        return one.then(other)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return tuple(earlier.then(later) for earlier, later in zip(one, other, strict=True))
    raise TypeError(f"Expected stretches of one model, got {type(one).__name__} and {type(other).__name__}")


def violations(stretch: Stretch, rule: int, declared: EventModel, phase_known: bool) -> tuple[Bool, bool]:
    """Return where the law is broken by a rule, and whether a declared start was part of the law."""
    own = _own(stretch, declared)
    if isinstance(stretch.bounds, Excursions):
        broken = stretch.bounds.excess(rule) > declared.threshold_on + declared.threshold_off + own
    else:
        broken = stretch.bounds[rule].broken
    beyond = _beyond_start(stretch, rule, declared, own) if phase_known else None
    if beyond is not None:
        broken = broken | beyond
    return broken & ~stretch.excused, beyond is not None


def telling_pixels(stretch: Stretch, declared: EventModel) -> Bool:
    """Return where the signal is known at all (linear), or varies by so much that an event more would break the law."""
    if isinstance(stretch.bounds, Excursions):
        varied: Bool = stretch.bounds.excess(EVEN) > max(declared.threshold_on, declared.threshold_off)
        return varied
    known: Bool = np.all(np.isfinite(stretch.bounds[EVEN].tail), axis=0)
    return known


def _beyond_start(stretch: Stretch, rule: int, declared: EventModel, own: NDArray[np.float64]) -> Bool | None:
    """Return where E left the thresholds around its start; None where the file does not bear the declared phase out."""
    if isinstance(stretch.bounds, Excursions):
        departure, excess, enough = stretch.bounds.departure(rule), stretch.bounds.excess(rule), TELLS_THE_PHASE
    else:
        runs, enough = stretch.bounds[rule], 1.0
        departure, excess = runs.departure(declared.threshold_on, declared.threshold_off), runs.excess()
    beyond: Bool = departure > own
    telling = excess > enough * max(declared.threshold_on, declared.threshold_off) + own
    if np.count_nonzero(telling) < FEWEST_TO_TELL or beyond[telling].mean() > MOST_BEYOND:
        return None
    return beyond


def _own(stretch: Stretch, declared: EventModel) -> NDArray[np.float64]:
    """Return what the spread of thresholds adds: each event steps by the pixel's own, and so are the law's ends."""
    own: NDArray[np.float64] = MISMATCH_SIGMAS * declared.threshold_sigma * (sqrt(2.0) + np.sqrt(stretch.events))
    return own

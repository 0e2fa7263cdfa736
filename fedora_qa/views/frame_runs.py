"""Runs of frames over which events must add up, and the pixels in which they do not.

Two seconds of frames are followed window by window, joined, and summarised. A longer run detects rarer losses, but
gives every flaw of the frames' antialiasing more chances, and it localises less in time. States of any windows merge
exactly: what may still grow stays open, at both ends of a state only.
"""

from dataclasses import dataclass, field
from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.events.excursions import EVERY_FRAME, ConservationLaw, Excursions, bound
from fedora_qa.estimators.events.linear_runs import EventFreeRuns, follow_runs
from fedora_qa.estimators.events.row_kernels import add_counts, mark_bursts
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import ROUNDING_DN, ResampledFrames, resampled_frames, sensor_events, sensor_shape

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

GROUP_NS: Final = 2 * NS_PER_S
"""Windows that begin within the same two seconds are joined."""

PHASE_RANGE: Final = 1.2
"""Multiple of a threshold by which E must vary to show where it began. From a start at random at least a third of such
pixels leave the thresholds around it: of a range of r thresholds, 2 - r may be left before it is passed. First runs of
the linear model end with an event; there a range of one threshold has to do, and shows less."""
FEWEST_FOR_PHASE: Final = 30
"""Pixels that use enough of their range; of fewer the share beyond says nothing of the declared phase."""
MOST_BEYOND_PHASE: Final = 0.1

MISMATCH_SIGMAS: Final = 5.0
"""Of the declared spread of thresholds: beyond lies one pixel in two million."""

EVEN, ALL = 0, 1
"""Which frames are accepted: those that are even enough to add to what the events bound, and every frame. Where only
the bounds of all are broken, frames are not the means of their pixels.

Frames are left out where the pixels that a footprint cuts leave the signal open by C+ + C- or more: where their
error is not below rounding and (C+ + C-) / 2 times the light (log; of the linear model, (C+ + C-) / 2).

The signal is known that well without them, from the events. They would add something only where their bound holds
to the last, and that is so if the frame is the mean over its pixel. Of a renderer with n samples a side, a step of
d DN makes it err by up to d / (2 n); the bound of ``footprint`` is 0.27 d on average (at 9/4 frame pixels an
event pixel: two cut pixels a side of 1/6 d each over 9/4, in both directions). Four samples a side may thus err by
half the bound, which is most where the bound is.
"""


@dataclass(slots=True)
class FrameRun:
    """Consecutive frames whose bounds have been joined.

    Attributes
    ----------
    bounds
        By the law of the declared model, by each rule which frames are accepted: ``EVEN`` and ``ALL``.
    events
        (h, w) events in the run.
    excused
        (h, w): a correct sensor may lack events (declared hot pixels, bursts within a declared refractory period).
    """

    bounds: Excursions | tuple[EventFreeRuns, ...]
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

    def follow(self, resampled: ResampledFrames, declared: EventModel, rounding_dn: float, excused: Bool) -> None:
        """Go on, in place, over frames of which the first is this run's last."""
        if isinstance(self.bounds, Excursions):
            self.bounds.follow(
                resampled.uniform_dn,
                resampled.error_dn,
                resampled.counts,
                _drift(resampled, declared),
                resampled.frames,
            )
        else:
            following = _event_free_runs(resampled, declared, rounding_dn)
            self.bounds = tuple(runs.then(later) for runs, later in zip(self.bounds, following, strict=True))
        add_counts(resampled.counts, self.events)
        self.excused |= excused

    def then(self, later: "FrameRun") -> "FrameRun":
        """Join with the run that begins at this one's last frame. Exact.

        Raises
        ------
        TypeError
            The runs are bounded by the laws of different sensor models.
        """
        bounds: Excursions | tuple[EventFreeRuns, ...]
        if isinstance(self.bounds, Excursions) and isinstance(later.bounds, Excursions):
            bounds = self.bounds.then(later.bounds)
        elif isinstance(self.bounds, tuple) and isinstance(later.bounds, tuple):
            bounds = tuple(runs.then(following) for runs, following in zip(self.bounds, later.bounds, strict=True))
        else:
            models = type(self.bounds).__name__, type(later.bounds).__name__
            raise TypeError(f"Expected frame runs of one model, got {models[0]} and {models[1]}")
        return FrameRun(bounds, self.events + later.events, self.excused | later.excused)


@dataclass(frozen=True, slots=True)
class FrameRunSummary:
    """What is kept of the frame runs of one group.

    Attributes
    ----------
    first_frame, last_frame
        Both included.
    frames
        Frames that were joined.
    pixels
        (h, w) the law was broken, eight pixels a byte.
    suspected
        The frame interval that most of the violations may lie in; the first one where none is bounded.
    events_per_pixel
        Mean number of events.
    without_events
        Pixels that broke the law without a single event.
    informative
        Pixels in which a single event too many or too few could break the law.
    flawed
        Pixels that break the law only where uneven frames are accepted: how often antialiasing fails here.
    from_start
        Whether the reference was held to be the signal at the first frame.
    """

    first_frame: int
    last_frame: int
    frames: int
    pixels: NDArray[np.uint8]
    suspected: int
    events_per_pixel: float
    without_events: int
    informative: int
    flawed: int
    from_start: bool

    @property
    def violations(self) -> int:
        """The number of pixels that broke the law."""
        return int(np.bitwise_count(self.pixels).sum())

    def unpacked(self, shape: tuple[int, int]) -> Bool:
        """Return the pixels (h, w) that broke the law."""
        return np.unpackbits(self.pixels, count=shape[0] * shape[1]).reshape(shape).astype(np.bool_)


@dataclass(slots=True)
class FrameRuns:
    """Groups of frame runs in the order of time; all but the last, and the first that may go on before, are summarised.

    Attributes
    ----------
    phase_declared
        Whether the first reference is declared to be the signal at frame 0, and no event comes before it.
    groups
        The number of each group, and its runs or what is kept of them.
    from_start
        Whether nothing comes before the first group.
    """

    model: EventModel
    phase_declared: bool = False
    groups: list[tuple[int, list[FrameRun] | FrameRunSummary]] = field(default_factory=list)
    from_start: bool = False

    def follow(self, window: Window) -> None:
        """Add the frames of the window that comes next, in place where they go on from the last run."""
        resampled, declared = resampled_frames(window), window.facts.declared.events
        if declared is None or len(resampled) < 2:
            return
        rounding_dn, excused = ROUNDING_DN[window.facts.declared.transfer], excused_pixels(window, declared)
        group = window.span.start_ns // GROUP_NS
        last = self.groups[-1][1] if self.groups and self.groups[-1][0] == group else []
        # A run whose last frame is the first of this window goes on; after a gap another begins.
        if isinstance(last, list) and last and last[-1].last_frame == resampled.frames[0]:
            last[-1].follow(resampled, declared, rounding_dn, excused)
            return
        self.from_start |= not self.groups and window.span.index == 0
        self.add(group, [join(resampled, declared, rounding_dn, excused)])

    def add(self, group: int, runs: list[FrameRun] | FrameRunSummary) -> None:
        """Append what comes next, joined to what it continues.

        Raises
        ------
        TypeError
            What comes next continues a group that has been summarised.
        """
        if self.groups and self.groups[-1][0] == group:
            number, earlier = self.groups.pop()
            if isinstance(earlier, FrameRunSummary) or isinstance(runs, FrameRunSummary):
                raise TypeError(
                    "Expected groups at the ends of frame runs to be open; add windows in the order of time"
                )
            joined = list(earlier)
            for run in runs:
                if joined and joined[-1].last_frame == run.first_frame:
                    joined[-1] = joined[-1].then(run)
                else:
                    joined.append(run)
            runs = joined
        elif self.groups and (len(self.groups) > 1 or self.from_start):
            # Nothing can join the last group any more; the first one may still go on before.
            number, earlier = self.groups[-1]
            self.groups[-1] = number, self._summary(earlier)
        self.groups.append((group, runs))

    def then(self, later: "FrameRuns") -> "FrameRuns":
        """Return the groups of both."""
        if not self.groups:
            return later
        merged = FrameRuns(self.model, self.phase_declared, list(self.groups), self.from_start)
        for group, runs in later.groups:
            merged.add(group, runs)
        return merged

    def summaries(self) -> list[FrameRunSummary]:
        """Return what is kept of each group."""
        return [self._summary(runs) for _, runs in self.groups]

    def _summary(self, runs: list[FrameRun] | FrameRunSummary) -> FrameRunSummary:
        if isinstance(runs, FrameRunSummary):
            return runs
        first, last = runs[0].first_frame, runs[-1].last_frame
        pixels = np.zeros(runs[0].excused.shape, np.bool_)
        without_events, informative, flawed = pixels.copy(), pixels.copy(), pixels.copy()
        from_start = False
        # How many violations begin at or end with a frame: their running sum counts those that a frame interval may
        # hold.
        changes = np.zeros(last - first + 2, np.int64)
        for run in runs:
            broken, start_in_law = violations(run, EVEN, self.model, self.phase_declared and run.first_frame == 0)
            from_start |= start_in_law
            pixels |= broken
            # What breaks the law only with all frames accepted is a flaw of their antialiasing.
            flawed |= violations(run, ALL, self.model, start_in_law)[0]
            without_events |= broken & (run.events == 0)
            if isinstance(run.bounds, Excursions):
                # Where E varies by more than a threshold, an event more or less may break the law.
                informative |= run.bounds.excess(EVEN) > max(self.model.threshold_on, self.model.threshold_off)
                highest, lowest = run.bounds.highest_at[broken] - first, run.bounds.lowest_at[broken] - first
                np.add.at(changes, np.minimum(highest, lowest), 1)
                np.add.at(changes, np.maximum(highest, lowest), -1)
            else:
                informative |= np.all(np.isfinite(run.bounds[EVEN].tail), axis=0)
        return FrameRunSummary(
            first,
            last,
            sum(run.last_frame - run.first_frame + 1 for run in runs),
            np.packbits(pixels),
            first + int(np.argmax(np.cumsum(changes))),
            sum(float(run.events.mean()) for run in runs),
            int(np.count_nonzero(without_events)),
            int(np.count_nonzero(informative)),
            int(np.count_nonzero(flawed & ~pixels)),
            from_start,
        )


def excused_pixels(window: Window, declared: EventModel) -> Bool:
    """Return the pixels (h, w) of a window in which a correct sensor may lack events."""
    excused = np.zeros(sensor_shape(window.facts.declared), np.bool_)
    if declared.refractory_us > 0:
        events = sensor_events(window)
        # Events closer than twice the refractory period may have suppressed others between them.
        mark_bursts(events.x, events.y, events.times_ns, int(2 * declared.refractory_us * NS_PER_US), excused)
    for column, row in declared.hot_pixels:
        if 0 <= row < excused.shape[0] and 0 <= column < excused.shape[1]:
            excused[row, column] = True
    return excused


def join(resampled: ResampledFrames, declared: EventModel, rounding_dn: float, excused: Bool) -> FrameRun:
    """Return the run of two frames or more; ``excused`` (h, w) as in ``FrameRun``.

    Parameters
    ----------
    resampled
        The frames, at the pixels of the event camera, and the events between them.
    declared
        The model and its thresholds.
    rounding_dn
        Half a step of the 8-bit code, linear DN.
    excused
        (h, w) pixels in which a correct sensor may lack events.
    """
    events = np.zeros(excused.shape, np.int32)
    add_counts(resampled.counts, events)
    if declared.model == "linear":
        return FrameRun(_event_free_runs(resampled, declared, rounding_dn), events, excused)
    rules = _rules(declared, rounding_dn)
    law = ConservationLaw(declared.threshold_on, declared.threshold_off, declared.log_eps_dn, rules)
    bounds = bound(
        resampled.uniform_dn, resampled.error_dn, resampled.counts, _drift(resampled, declared), law, resampled.frames
    )
    return FrameRun(bounds, events, excused)


def violations(run: FrameRun, rule: int, declared: EventModel, phase_declared: bool) -> tuple[Bool, bool]:
    """Return where (h, w) the law is broken by a rule, and whether a declared start was part of the law.

    Parameters
    ----------
    run
        Bounds of joined frames.
    rule
        ``EVEN`` or ``ALL``.
    declared
        The model and its thresholds.
    phase_declared
        Whether the reference is declared to be the signal at the first frame of the run.
    """
    # The declared spread of thresholds widens the law: n events of independent errors add sqrt(n) sigma, both ends of
    # the range a threshold each, sqrt(2) sigma.
    mismatch = MISMATCH_SIGMAS * declared.threshold_sigma * (sqrt(2.0) + np.sqrt(run.events))
    # Log model: E varies by less than C+ + C- (``excursions``); linear: laws of runs and rises (``linear_runs``).
    if isinstance(run.bounds, Excursions):
        broken = run.bounds.excess(rule) > declared.threshold_on + declared.threshold_off + mismatch
    else:
        broken = run.bounds[rule].broken
    start_in_law = False
    if phase_declared:
        # Where E left the thresholds around its start, the law is broken too.
        if isinstance(run.bounds, Excursions):
            departure, excess, enough = run.bounds.departure(rule), run.bounds.excess(rule), PHASE_RANGE
        else:
            runs, enough = run.bounds[rule], 1.0
            departure, excess = runs.departure(declared.threshold_on, declared.threshold_off), runs.excess()
        beyond: Bool = departure > mismatch
        # Pixels that use enough of their range would leave the thresholds if the phase were at random. Where many of
        # them do, the file contradicts the declared phase; where there are few, they cannot show it.
        informative = excess > enough * max(declared.threshold_on, declared.threshold_off) + mismatch
        start_in_law = not (
            np.count_nonzero(informative) < FEWEST_FOR_PHASE or beyond[informative].mean() > MOST_BEYOND_PHASE
        )
        if start_in_law:
            broken = broken | beyond
    return broken & ~run.excused, start_in_law


def _rules(declared: EventModel, rounding_dn: float) -> tuple[tuple[float, float], ...]:
    return (rounding_dn, (declared.threshold_on + declared.threshold_off) / 2), EVERY_FRAME


def _drift(resampled: ResampledFrames, declared: EventModel) -> Float64:
    """Return what leak adds to the signal between the frames (n - 1,), nat: a threshold for each leaked event."""
    drift: Float64 = declared.leak_rate_hz * declared.threshold_on * np.diff(resampled.times_ns) / NS_PER_S
    return drift


def _event_free_runs(resampled: ResampledFrames, declared: EventModel, rounding_dn: float) -> tuple[EventFreeRuns, ...]:
    def by_rule(uneven: tuple[float, float]) -> EventFreeRuns:
        # The event camera rounds luma to whole values itself.
        error = np.where(resampled.error_dn < sum(uneven), resampled.error_dn + 0.5, np.inf)
        return follow_runs(
            resampled.uniform_dn - error,
            resampled.uniform_dn + error,
            resampled.counts,
            threshold_on=declared.threshold_on + MISMATCH_SIGMAS * declared.threshold_sigma,
            threshold_off=declared.threshold_off + MISMATCH_SIGMAS * declared.threshold_sigma,
            frames=resampled.frames,
        )

    return tuple(by_rule(uneven) for uneven in _rules(declared, rounding_dn))

"""Runs of frames over which the sum of the events must follow the signal, and the pixels in which it does not.

Frames of 2 s are followed window by window, joined, and summarised. A longer run detects rarer losses. But it includes
more flaws of the frames' antialiasing, and it localises less in time. States of any windows merge exactly: runs that
may still grow, at both ends of a state, are not summarised.
"""

from dataclasses import dataclass, field, replace
from math import pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.events.conservation import (
    EVERY_FRAME,
    ConservationLaw,
    EventFreeRuns,
    Excursions,
    bound,
    follow_runs,
)
from fedora_qa.estimators.events.pixels import add_counts, mark_bursts
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import ROUNDING_DN, ResampledFrames, resampled_frames
from fedora_qa.views.sensor_events import events_around, sensor_events, sensor_shape

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

GROUP_NS: Final = 2 * NS_PER_S
"""Length of a group, ns: windows that begin within the same 2 s are joined."""

PHASE_RANGE: Final = 1.2
"""Multiple of a threshold by which E must vary to determine where E began. If the start is random, at least a third of
such pixels leave the thresholds around the start: with a range of r thresholds, E stays within them only for starts in
a part of 2 - r thresholds. First runs of the linear model end with an event; for these a range of one threshold has to
suffice, and determines less."""
FEWEST_FOR_PHASE: Final = 30
"""Least number of pixels with a sufficient range of E for a test of the declared phase."""
MOST_BEYOND_PHASE: Final = 0.1

MISMATCH_SIGMAS: Final = 5.0
"""Multiple of the declared spread of thresholds: one pixel in two million lies beyond it."""

SETTLING_TIME_CONSTANTS: Final = 5.0
"""Time constants of a low-pass within which a step has arrived: 99.3% of it."""
NYQUIST_PX: Final = 1.0
"""Half the period of the finest texture of an image."""

EVEN, ALL = 0, 1
"""Rules for the acceptance of frames: frames that are even enough to add to the bounds by the events, and all frames.
Where only the bounds of all frames are violated, frames are not the means of their pixels.

Frames are left out where the pixels that a footprint cuts leave the signal uncertain by C+ + C- or more: where their
error is not below rounding and (C+ + C-) / 2 times the light (log; of the linear model, (C+ + C-) / 2).

The events determine the signal that well without these frames. Such a frame adds information only where its bound is
exact, that is if the frame is the mean over its pixel. In a renderer with n samples a side, a step of d DN causes an
error of up to d / (2 n). The bound of ``footprint`` is 0.27 d on average (at 9/4 frame pixels an event pixel: two cut
pixels a side of 1/6 d each over 9/4, in both directions). With four samples a side the error may thus be half the
bound, and is largest where the bound is.
"""


@dataclass(slots=True)
class FrameRun:
    """Consecutive frames over which bounds have been joined.

    Attributes
    ----------
    bounds
        Bounds by the law of the declared model, under both rules of acceptance of frames, ``EVEN`` and ``ALL``.
    events
        (h, w) number of events in the run.
    excused
        (h, w) True where a correct sensor may lack events (declared hot pixels, bursts within a declared refractory
        period).
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
        """Extend the run in place over frames of which the first is this run's last.

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
        if isinstance(self.bounds, Excursions):
            self.bounds.follow(
                resampled.uniform_dn,
                resampled.error_dn,
                resampled.counts,
                _drift(resampled, declared),
                resampled.frames,
            )
        else:
            following = _event_free_runs(resampled, declared, _rules(declared, rounding_dn))
            self.bounds = tuple(runs.then(later) for runs, later in zip(self.bounds, following, strict=True))
        add_counts(resampled.counts, self.events)
        self.excused |= excused

    def then(self, later: "FrameRun") -> "FrameRun":
        """Join with the run that begins at this one's last frame; the result is exact.

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
    """Results of the frame runs of one group.

    Attributes
    ----------
    first_frame, last_frame
        Both included.
    frames
        Number of joined frames.
    pixels
        (h * w / 8,) pixels that violate the law, as bits, eight pixels a byte.
    suspected
        First frame of the frame interval in which most of the violations may lie; the first frame where none is
        bounded.
    events_per_pixel
        Mean number of events of a pixel.
    without_events
        Number of pixels that violate the law without a single event.
    informative
        Number of pixels in which one event too many or too few could violate the law.
    flawed
        Number of pixels that violate the law only if uneven frames are accepted: a measure of the flaws of
        antialiasing.
    from_start
        Whether the reference was taken as the signal at the first frame.
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
        """Number of pixels that violate the law."""
        return int(np.bitwise_count(self.pixels).sum())

    def unpacked(self, shape: tuple[int, int]) -> Bool:
        """Return the pixels (h, w) that violate the law."""
        return np.unpackbits(self.pixels, count=shape[0] * shape[1]).reshape(shape).astype(np.bool_)


@dataclass(slots=True)
class FrameRuns:
    """Groups of frame runs in the order of time.

    All groups are summarised but the last one, and the first one while earlier windows may still precede it.

    Attributes
    ----------
    model
        The declared event sensor.
    phase_declared
        Whether the first reference is declared to be the signal at frame 0, without an event before it.
    groups
        Number of each group, with its runs or their summary.
    from_start
        Whether the first group begins with the file.
    """

    model: EventModel
    phase_declared: bool = False
    groups: list[tuple[int, list[FrameRun] | FrameRunSummary]] = field(default_factory=list)
    from_start: bool = False

    def follow(self, window: Window) -> None:
        """Add the frames of the next window, in place where they continue the last run."""
        resampled, declared = resampled_frames(window), window.facts.declared.events
        if declared is None or len(resampled) < 2:
            return
        if declared.bandwidth_hz > 0:
            resampled = settled_frames(window, resampled, declared.bandwidth_hz)
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
        """Append the runs of a group, joined to the last run if they continue it.

        Parameters
        ----------
        group
            Number of the group, in the order of time.
        runs
            Runs of the group, or their summary.

        Raises
        ------
        TypeError
            The runs continue a group that has been summarised.
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
            # The last group cannot grow any more; windows before the first one may still join it.
            number, earlier = self.groups[-1]
            self.groups[-1] = number, self._summary(earlier)
        self.groups.append((group, runs))

    def then(self, later: "FrameRuns") -> "FrameRuns":
        """Return the groups of both, in the order of time."""
        if not self.groups:
            return later
        merged = FrameRuns(self.model, self.phase_declared, list(self.groups), self.from_start)
        for group, runs in later.groups:
            merged.add(group, runs)
        return merged

    def summaries(self) -> list[FrameRunSummary]:
        """Return the summary of each group."""
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
            # A violation that needs all frames to be accepted is a flaw of their antialiasing.
            flawed |= violations(run, ALL, self.model, start_in_law)[0]
            without_events |= broken & (run.events == 0)
            if isinstance(run.bounds, Excursions):
                # Where E varies by more than a threshold, an event more or less may violate the law.
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
    """Return the pixels of a window in which a correct sensor may lack events.

    Parameters
    ----------
    declared
        With the refractory period and the hot pixels of the sensor.

    Returns
    -------
    ndarray of bool
        (h, w) True at declared hot pixels, and at pixels with two events within twice the refractory period.
    """
    excused = np.zeros(sensor_shape(window.facts.declared), np.bool_)
    if declared.refractory_us > 0:
        events = sensor_events(window)
        # Events closer than twice the refractory period may have suppressed others between them.
        mark_bursts(events.x, events.y, events.times_ns, int(2 * declared.refractory_us * NS_PER_US), excused)
    for column, row in declared.hot_pixels:
        if 0 <= row < excused.shape[0] and 0 <= column < excused.shape[1]:
            excused[row, column] = True
    return excused


def settled_frames(window: Window, resampled: ResampledFrames, bandwidth_hz: float) -> ResampledFrames:
    """Return the frames of a window, used only at pixels that have settled behind a low-pass.

    A first-order low-pass of the light x has the output y, with x - y = tau dy/dt and tau = 1 / (2 pi f). Events follow
    y, and frames are of x. A pixel without events within 5 tau after a frame has a y that stays within C+ + C-. If x
    does not turn back in that time, y has passed 1 - exp(-5) of the distance. The distance then adds at most 0.7% to
    the range of E, which is below the rounding of a frame. A frame is not used at pixels with events within 5 tau
    before or after it.

    The finest texture of an image has a period of 2 px. It turns back where the image moves by 1 px within 5 tau, and y
    then varies less than x without an event. Frames of such motion are not used at all. With texture of no preferred
    direction, (v . grad x)^2 has the mean v^2 |grad x|^2 / 2, which gives the motion v between two frames. Faster than
    the texture is wide, v is too small; change of the light and noise make it too large.

    Parameters
    ----------
    window
        A window of the sequence.
    resampled
        Its frames at the pixels of the event camera.
    bandwidth_hz
        Declared cut-off f of the low-pass, Hz, above 0.

    Returns
    -------
    ResampledFrames
        With infinite errors where a frame is not used.
    """
    settling_ns = SETTLING_TIME_CONSTANTS * NS_PER_S / (2 * pi * bandwidth_hz)
    error_dn = resampled.error_dn.copy()
    if settling_ns >= GROUP_NS:
        # No pixel settles within the frames that are compared.
        error_dn[...] = np.inf
        return replace(resampled, error_dn=error_dn)
    intervals_ns = np.diff(resampled.times_ns)
    valid = np.isfinite(resampled.error_dn).all(axis=0)
    speeds_px_ns = _motion_px(resampled.uniform_dn, valid) / np.maximum(intervals_ns, 1)
    # A frame takes the faster of the intervals before and after it.
    fastest_px_ns = np.maximum(np.append(speeds_px_ns, 0.0), np.insert(speeds_px_ns, 0, 0.0))
    error_dn[fastest_px_ns * settling_ns >= NYQUIST_PX] = np.inf
    events = events_around(window, int(settling_ns))
    for image, time_ns in zip(error_dn, resampled.times_ns.tolist(), strict=True):
        first, stop = np.searchsorted(events.times_ns, (time_ns - settling_ns, time_ns + settling_ns))
        image[events.y[first:stop], events.x[first:stop]] = np.inf
    return replace(resampled, error_dn=error_dn)


def _motion_px(images_dn: NDArray[np.float32], valid: Bool) -> Float64:
    """Return the root mean square of image motion (n - 1,) between images (n, h, w), px, over valid pixels (h, w)."""
    change = np.diff(images_dn, axis=0).astype(np.float64)[:, valid]
    # Over a distance of 1 px, half of |grad x|^2 is the mean over both axes.
    down = np.diff(images_dn[:-1], axis=1).astype(np.float64)[:, valid[1:] & valid[:-1]]
    right = np.diff(images_dn[:-1], axis=2).astype(np.float64)[:, valid[:, 1:] & valid[:, :-1]]
    texture = np.square(np.concatenate([down, right], axis=1))
    return np.sqrt(_row_means(np.square(change)) / np.maximum(_row_means(texture), np.finfo(np.float64).tiny))


def _row_means(values: Float64) -> Float64:
    """Return the means (n,) of rows (n, m); 0 where m = 0."""
    return np.asarray(values.sum(axis=1) / max(values.shape[1], 1))


def join(
    resampled: ResampledFrames, declared: EventModel, rounding_dn: float, excused: Bool, *, only_even: bool = False
) -> FrameRun:
    """Return the run of two or more frames.

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
    only_even
        Whether the run is asked for violations under ``EVEN`` alone.

    Returns
    -------
    FrameRun
        From the first to the last of the frames.
    """
    events = np.zeros(excused.shape, np.int32)
    add_counts(resampled.counts, events)
    rules = _rules(declared, rounding_dn)
    if only_even:
        rules = (rules[EVEN],)
    if declared.model == "linear":
        return FrameRun(_event_free_runs(resampled, declared, rules), events, excused)
    law = ConservationLaw(declared.threshold_on, declared.threshold_off, declared.log_eps_dn, rules)
    bounds = bound(
        resampled.uniform_dn, resampled.error_dn, resampled.counts, _drift(resampled, declared), law, resampled.frames
    )
    return FrameRun(bounds, events, excused)


def violations(run: FrameRun, rule: int, declared: EventModel, phase_declared: bool) -> tuple[Bool, bool]:
    """Return where the law is violated under a rule, and whether a declared start was part of the law.

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

    Returns
    -------
    broken
        (h, w) True where the law is violated.
    start_in_law
        Whether the declared start was used: enough pixels are informative, and few of them leave the thresholds around
        it.
    """
    # A pixel has fixed thresholds C+ + a and C- + b, with a and b of the declared spread sigma. Its own residual varies
    # by less than C+ + a + C- + b; E counts with C+ and C-, which adds a P - b M for P brighter and M darker events.
    # The sum, a (P + 1) - b (M - 1) at the end and less before, has a standard deviation of at most
    # sigma sqrt((P + 1)^2 + (M + 1)^2); of all n = P + M events that is most where they have one polarity.
    mismatch = MISMATCH_SIGMAS * declared.threshold_sigma * np.hypot(run.events + 1.0, 1.0)
    # Log model: E varies by less than C+ + C- (``excursions``); linear: laws of runs and rises (``linear_runs``).
    if isinstance(run.bounds, Excursions):
        broken = run.bounds.excess(rule) > declared.threshold_on + declared.threshold_off + mismatch
    else:
        broken = run.bounds[rule].broken
    start_in_law = False
    if phase_declared:
        # The law is violated too where E left the thresholds around its start.
        if isinstance(run.bounds, Excursions):
            departure, excess, enough = run.bounds.departure(rule), run.bounds.excess(rule), PHASE_RANGE
        else:
            runs, enough = run.bounds[rule], 1.0
            departure, excess = runs.departure(declared.threshold_on, declared.threshold_off), runs.excess()
        beyond: Bool = departure > mismatch
        # If the phase were random, many pixels with a sufficient range of E would leave the thresholds. Where many do,
        # the file contradicts the declared phase; few pixels do not determine the phase.
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
    """Return the change of the signal by leak events between the frames (n - 1,), nat.

    Each leak event stands for one threshold.
    """
    drift: Float64 = declared.leak_rate_hz * declared.threshold_on * np.diff(resampled.times_ns) / NS_PER_S
    return drift


def _event_free_runs(
    resampled: ResampledFrames, declared: EventModel, rules: tuple[tuple[float, float], ...]
) -> tuple[EventFreeRuns, ...]:
    def by_rule(uneven: tuple[float, float]) -> EventFreeRuns:
        # The event camera rounds luma to whole DN: half a step more.
        error = np.where(resampled.error_dn < sum(uneven), resampled.error_dn + 0.5, np.inf)
        return follow_runs(
            resampled.uniform_dn - error,
            resampled.uniform_dn + error,
            resampled.counts,
            threshold_on=declared.threshold_on,
            threshold_off=declared.threshold_off,
            spread=MISMATCH_SIGMAS * declared.threshold_sigma,
            frames=resampled.frames,
        )

    return tuple(by_rule(uneven) for uneven in rules)

"""Events against the times of the frames: interpolation between renders."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.estimators.events.time_jitter import (
    FEWEST_EVENTS,
    LEAST_SPACING_TICKS,
    chance_of_line,
    straight_runs,
)
from fedora_qa.estimators.images.samples import tracked_motion_px
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import (
    intervals_due,
    is_large_sensor,
    local_tick_ns,
    pixel_events,
    resampled_frames,
    why_frames_and_events_do_not_meet,
)

STEPS: Final = (1, 2, 3, 4, 5, 6, 8, 10)
"""Numbers of renders in a frame interval that are tested."""

UNSEEN_LINES: Final = 10
"""Lines that are added to those across renders, for the error of their share.

Of m lines that are as likely in either place, all lie within with a probability of 2^-m. Where none is across, so many
must lie within as have the false-alarm rate of z standard errors: m = 20 for z = 4.7. With ``a`` lines added, the limit
is z sqrt(2 a) = 21 lines, of as many runs in either place.
"""

CLEAR: Final = 3.0
"""Standard errors from which the number of renders with the largest deviation is stated; else the first number."""


INTERVALS_OF_LARGE: Final = 3
"""Frame intervals in 0.2 s that are used of large sensors, evenly spread. The standard error is inverse to the root of
their number, or to the number itself where ``UNSEEN_LINES`` exceed the lines across: in 2 s of 640x480 it is 5e-5, 2.7
times that of all intervals, where a share of 0.1 matters."""


@dataclass(frozen=True, slots=True)
class RenderRate(Feature):
    """Renders between which the events are interpolated.

    Attributes
    ----------
    rate_hz
        Their rate.
    steps
        Renders in a frame interval.
    """

    rate_hz: float
    steps: int


@dataclass(frozen=True, slots=True)
class RunCounts:
    """Runs of events in a window, for each number of renders in a frame interval.

    Attributes
    ----------
    within, across
        (len(STEPS), 3) runs, runs on a line and events, from each supposed render to the next, and from the middle
        between two of them to the next middle.
    intervals, lengths_ns
        (len(STEPS),) number of frame intervals with sufficient motion, and the sum of their lengths, ns.
    frames
        Number of frame intervals that were used.
    period_ns
        Mean length of all frame intervals, ns.
    tick_ns
        Step of the timestamps, ns.
    start_ns, stop_ns
        First and last frame, ns from the file's origin.
    """

    within: NDArray[np.int64]
    across: NDArray[np.int64]
    intervals: NDArray[np.int64]
    lengths_ns: NDArray[np.int64]
    frames: int
    period_ns: int
    tick_ns: int
    start_ns: int
    stop_ns: int


class EventResponseInterpolation(WindowCheck[RunCounts]):
    """Are events interpolated between frames, along straight lines in time?

    The share of runs (three or more events of a pixel between two renders) that lie on a straight line from the first
    render to the second, minus the same share in intervals that begin and end halfway between renders. Renders are
    assumed at the frames, and at 2, 3, 4, 5, 6, 8 and 10 times their rate. A correct file gives 0; a file whose events
    are all interpolated gives 1.

    Why it matters
    --------------
    Events that are made from frames have the time resolution of frames: within an interval, the error of a timestamp is
    up to half the interval, 10 ms at 50 Hz. A model that is trained on them learns the interpolation. Such events agree
    with the frames at all frame times, so that no comparison at frames detects them.

    How
    ---
    If the signal of a pixel is a straight line from one render to the next, its events have one polarity and equal
    spacings, to within the step of the timestamps, and fill the interval (``straight_runs``). The light of a moving
    texture is no straight line, and an edge passes in a part of the interval. More than one render a frame interval (n
    > 1) is assumed only where the image moves by more than n pixels in it (``tracked_motion_px``): good simulators
    render whenever the image has moved by a pixel, interpolate on shorter paths, and pass. A file without any render
    between its frames fails at any motion. The number of renders with the largest deviation is stated. For large
    sensors, three frame intervals in each 0.2 s are used.

    Noise model
    -----------
    Light in a correct file does not depend on the times of the frames: lines within and across renders are equally
    probable. Light that changes slowly and evenly gives straight lines in both. Both shares are binomial with the
    probability of a line across. Ten lines are added to this probability, because few or none occur (derivation beside
    ``UNSEEN_LINES``). The model error bound is the probability of a line by chance, tick / spacing, so that coarse
    timestamps do not cause a finding. Runs with spacings of less than ten ticks are left out.

    Cannot detect
    -------------
    Interpolation between n > 1 renders a frame interval in which the image moves by n pixels or less, as adaptive
    simulators also do it. Renders at a rate that is no multiple of the frame rate, or more than ten times as high, or
    that are shifted against the frames. Changes of less than three thresholds from render to render (hovering, no
    texture: not_observable). Timestamps so coarse that three events at ten steps do not fit between two frames, such as
    one event each step of a millisecond in the simulated DVS plugin (not_observable). Interpolated events whose
    timestamps were then jittered by more than their step.

    Sources
    -------
    First principles (``straight_runs``). Linear interpolation between renders, and renders by image motion: H. Rebecq,
    D. Gehrig, D. Scaramuzza, "ESIM: an open event camera simulator", CoRL 2018.
    """

    name = "event_response.interpolation"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> RunCounts | None:
        """Count the runs of the window's frame intervals that have sufficient motion."""
        frames, declared, scan = resampled_frames(window), window.facts.declared.events, window.facts.events
        if len(frames) < 2 or declared is None or scan is None:
            return None
        last = len(frames) - 2
        due = intervals_due(window, frames, INTERVALS_OF_LARGE) if is_large_sensor(window) else last + 1
        if due <= 0:
            return None
        thresholds = declared.threshold_on, declared.threshold_off
        # After an event of the other polarity the signal has to cross both thresholds.
        first_spacings = sum(thresholds) / min(thresholds)
        tick_ns = local_tick_ns(window)
        chosen = np.unique((np.arange(due) + 0.5) * (last + 1) // due).astype(int).tolist()
        # Number of renders of each pair of parts: intervals from render to render, and from middle to middle.
        indices: list[int] = []
        parts_ns: list[NDArray[np.int64]] = []
        intervals, lengths_ns = np.zeros((2, len(STEPS)), np.int64)
        for before in chosen:
            ends_ns = frames.times_ns[before : before + 2]
            motion_px = tracked_motion_px(frames.uniform_dn[before : before + 2])
            for index, steps in enumerate(STEPS):
                # Renders that are a pixel of motion apart, or less, are as close as adaptive simulators make them.
                if steps > max(1.0, motion_px):
                    break
                edges_ns = ends_ns[0] + (ends_ns[1] - ends_ns[0]) * np.arange(steps + 1) // steps
                middles_ns = edges_ns + (ends_ns[1] - ends_ns[0]) // (2 * steps)
                halves_ns = np.stack([middles_ns[:-1], middles_ns[1:]], axis=1)
                # After the last event no run can be compared.
                halves_ns = halves_ns[halves_ns[:, 1] <= scan.last_ns]
                indices.append(index)
                parts_ns += [np.stack([edges_ns[:-1], edges_ns[1:]], axis=1), halves_ns]
                intervals[index] += 1
                lengths_ns[index] += ends_ns[1] - ends_ns[0]
        counts = straight_runs(pixel_events(window), parts_ns, tick_ns, first_spacings)
        within, across = np.zeros((2, len(STEPS), 3), np.int64)
        np.add.at(within, indices, counts[::2])
        np.add.at(across, indices, counts[1::2])
        period_ns = int(frames.times_ns[-1] - frames.times_ns[0]) // (last + 1)
        first_ns, stop_ns = int(frames.times_ns[0]), int(frames.times_ns[-1])
        return RunCounts(within, across, intervals, lengths_ns, len(chosen), period_ns, tick_ns, first_ns, stop_ns)

    def conclude(self, state: Sequence[RunCounts], facts: Facts) -> Observation:
        """Compare the shares of lines for each number of renders, and state the one that deviates most."""
        intervals = max(len(facts.clocks["rgb"].times_ns) - 1, 0)
        coverage = Coverage(sum(counts.frames for counts in state), intervals, "frame intervals")
        if not state:
            return Observation(coverage, unobservable="no two frames with events")
        tick_ns = max(counts.tick_ns for counts in state)
        period_ns = min(counts.period_ns for counts in state)
        if period_ns < FEWEST_EVENTS * LEAST_SPACING_TICKS * tick_ns:
            reason = f"timestamps in steps of {tick_ns / NS_PER_MS:g} ms are too coarse for three events between frames"
            return Observation(coverage, unobservable=reason)
        # Axes: number of renders, then runs, lines and events.
        within, across = (np.sum([getattr(counts, kind) for counts in state], axis=0) for kind in ("within", "across"))
        compared = np.flatnonzero((within[:, 0] > 0) & (across[:, 0] > 0)).tolist()
        if not compared:
            return Observation(coverage, unobservable="no pixel has three events between two frames")
        statistics = [self._lines(state, facts, index, len(compared)) for index in compared]
        worst = max(statistics, key=_significance)
        # Renders at the frames where nothing deviates: for many renders there are few runs, with a large limit.
        return Observation(coverage, (worst if _significance(worst) > CLEAR else statistics[0],))

    def _lines(self, state: Sequence[RunCounts], facts: Facts, index: int, tests: int) -> Statistic:
        """Return the statistic of a number of renders."""
        runs, lines, _ = np.sum([counts.within[index] for counts in state], axis=0).tolist()
        runs_across, lines_across, _ = np.sum([counts.across[index] for counts in state], axis=0).tolist()
        share, share_across = lines / runs, lines_across / runs_across
        # Difference of two shares with one probability (binomial), that of a line across renders.
        probability = (lines_across + UNSEEN_LINES) / (runs_across + 2 * UNSEEN_LINES)
        error = sqrt(probability * (1 - probability) * (1 / runs + 1 / runs_across))
        steps = STEPS[index]
        rates_hz = [NS_PER_S * steps * counts.intervals[index] / max(counts.lengths_ns[index], 1) for counts in state]
        rate_hz = max(rates_hz)
        # Mean spacing of a line: the time between two renders over the number of events.
        chances = [
            chance_of_line(counts.tick_ns, NS_PER_S / rate) * counts.within[index, 2]
            for counts, rate in zip(state, rates_hz, strict=True)
            if rate
        ]
        # Windows whose lines within clearly outnumber those across, by the error of the difference of two counts.
        excess, both = (
            np.array([combine(counts.within[index, 1], counts.across[index, 1]) for counts in state])
            for combine in (np.subtract, np.add)
        )
        affected = [counts for counts, clear in zip(state, excess > CLEAR * np.sqrt(both), strict=True) if clear]
        where = Where(stream="events")
        if affected and len(affected) < sum(counts.within[index, 0] > 0 for counts in state):
            where = Where(
                stream="events",
                start_us=facts.to_file_us(affected[0].start_ns),
                stop_us=facts.to_file_us(affected[-1].stop_ns),
            )
        return Statistic(
            name="lines_between_renders",
            value=share - share_across,
            unit="1",
            standard_error=error,
            model_error_bound=min(1.0, float(sum(chances)) / runs),
            side="upper",
            tests=tests,
            statement=f"{share:.0%} of the changes of a pixel between renders at {rate_hz:.3g} Hz are straight lines "
            f"in time, and {share_across:.0%} of those across a render: events are interpolated.",
            code="event_response.interpolation.lines",
            where=where,
            features=(RenderRate(rate_hz, steps),),
        )


def _significance(statistic: Statistic) -> float:
    """Return the deviation of a statistic beyond its bound, in standard errors."""
    return (statistic.value - statistic.expected - statistic.model_error_bound) / statistic.standard_error

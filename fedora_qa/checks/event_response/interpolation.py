"""Events against the times of the frames: interpolation between renders."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.estimators.events.time_jitter import (
    BLEND_OF_SIGNAL,
    FEWEST_EVENTS,
    LEAST_SPACING_TICKS,
    Blend,
    chance_of_line,
    straight_runs,
)
from fedora_qa.estimators.images.samples import tracked_motion_px
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import intervals_due, resampled_frames, why_frames_and_events_do_not_meet
from fedora_qa.views.sensor_events import is_large_sensor, local_tick_ns, pixel_events

STEPS: Final = (1, 2, 3, 4, 5, 6, 8, 10)
"""Numbers of renders in a frame interval that are tested."""

UNSEEN_LINES: Final = 10
"""Lines that are added to those across renders, for the error of their share.

Of m lines that are as likely in either place, all lie within with a probability of 2^-m. Where none is across, so many
must lie within as have the false-alarm rate of z standard errors: m = 20 for z = 4.7. With ``a`` lines added, the limit
is z sqrt(2 a) = 21 lines, of as many runs in either place.
"""

Domain = Literal["signal", "light", "codes"]
"""What is blended linearly between two renders."""

CODE_EXPONENTS: Final = {"srgb": 1 / 2.4, "gamma2.2": 1 / 2.2}
"""Exponent g of code ~ light^g, but for a constant, by transfer curve. The sRGB curve has it above 0.8 DN of light.
Codes of the linear transfer are light."""

SPACING_SHARE: Final = 0.02
"""Error of a level that is allowed to blends of light and codes, in thresholds: half a step of 1 DN in light of 125 DN,
for a threshold of 0.2 nat. A larger share admits more real motion, in which light is smooth as well. Blends that are
not rounded need none."""

FEWEST_BLENDS: Final = 10
"""Fewest blends in a frame interval between which the signal is taken for a straight line."""

_MOST_USEFUL: Final = 0.15
"""Largest sum of the bound and three standard errors of a blend whose limit is of use. Detection limits were about 3
times this sum, and one half is of use. The value is not derived."""

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
        (len(STEPS), 2 + m) runs, events in runs, and runs on a line of each of m blends, from each supposed render to
        the next, and from the middle between two of them to the next middle.
    scatter
        (len(STEPS), m, 3) sums over frame intervals of l^2, l n and n^2, for l lines among n runs across renders.
    domains
        (m,) what is blended.
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
    scatter: NDArray[np.int64]
    domains: tuple[Domain, ...]
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
    render to the second, of the signal, of light, or of code values, minus the same share in intervals that begin and
    end halfway between renders. Renders are assumed at the frames, and at 2, 3, 4, 5, 6, 8 and 10 times their rate. A
    correct file gives 0; a file whose events are all interpolated gives 1.

    Why it matters
    --------------
    Events that are made from frames have the time resolution of frames: within an interval, the error of a timestamp is
    up to half the interval, 10 ms at 50 Hz. A model that is trained on them learns the interpolation. Such events agree
    with the frames at all frame times, so that no comparison at frames detects them.

    How
    ---
    If the signal of a pixel is a straight line from one render to the next, its events have one polarity and equal
    spacings, to within the step of the timestamps, and fill the interval (``straight_runs``). If light is such a line,
    and the signal its logarithm, the spacings grow or shrink by the factor exp(C) from event to event; if code values
    are, by exp(g C) with the exponent g of the declared transfer curve. These are tested from frame to frame, to within
    2% of a spacing and the chords of ten blends an interval. The light of a moving texture is no straight line, and an
    edge passes in a part of the interval. More than one render a frame interval (n > 1) is assumed only where the image
    moves by more than n pixels in it (``tracked_motion_px``): good simulators render whenever the image has moved by a
    pixel, interpolate on shorter paths, and pass. A file without any render between its frames fails at any motion. The
    number of renders and the blend with the largest deviation are stated, or the limit of the least sensitive blend
    whose limit is of use where none deviates. For large sensors, three frame intervals in each 0.2 s are used.

    Noise model
    -----------
    Light in a correct file does not depend on the times of the frames: lines within and across renders are equally
    probable. Light that changes slowly and evenly gives straight lines in both: with an edge that crosses a footprint,
    a tenth to a half of the runs of a slow flight are straight in light. Textures are interpolated between texels, so
    that their light has lines of its own; between several renders a frame these can have the phase of the renders, and
    light and codes are not tested there. Both shares are binomial with the probability of a line across. Pixels along
    an edge have lines of light together: for light and codes the variance is multiplied by the dispersion of the lines
    across, from frame interval to frame interval, where that exceeds 1. All blends count as tests. Ten lines are added
    to this probability, because few or none occur (derivation beside ``UNSEEN_LINES``). The model error bound is the
    probability of a line by chance, tick / spacing, so that coarse timestamps do not cause a finding. Runs with
    spacings of less than ten ticks are left out.

    Cannot detect
    -------------
    Interpolation between n > 1 renders a frame interval in which the image moves by n pixels or less, as adaptive
    simulators also do it. Renders at a rate that is no multiple of the frame rate, or more than ten times as high, or
    that are shifted against the frames. Changes of less than three thresholds from render to render (hovering, no
    texture: not_observable). Blends of light or codes in less than ten steps a frame interval, or rounded to codes in
    the dark, where half a step exceeds 2% of a threshold by far. Blends of light or codes whose own limit is of no use;
    then the limit is that of the signal. Blends of light or codes between renders that are not in the file. Blends of
    anything but light in sensors of the linear model. Timestamps so coarse that three events at ten steps do not fit
    between two frames, such as one event each step of a millisecond in the simulated DVS plugin (not_observable).
    Interpolated events whose timestamps were then jittered by more than their step.

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
        blends = _blends(declared, window.facts.declared.transfer)
        counts = straight_runs(pixel_events(window), parts_ns, tick_ns, first_spacings, list(blends.values()))
        within, across = np.zeros((2, len(STEPS), counts.shape[1]), np.int64)
        np.add.at(within, indices, counts[::2])
        np.add.at(across, indices, counts[1::2])
        runs, lines = counts[1::2, :1], counts[1::2, 2:]
        scatter = np.zeros((len(STEPS), len(blends), 3), np.int64)
        np.add.at(scatter, indices, np.stack([lines**2, lines * runs, np.broadcast_to(runs**2, lines.shape)], axis=2))
        period_ns = int(frames.times_ns[-1] - frames.times_ns[0]) // (last + 1)
        first_ns, stop_ns = int(frames.times_ns[0]), int(frames.times_ns[-1])
        return RunCounts(
            within=within,
            across=across,
            scatter=scatter,
            domains=tuple(blends),
            intervals=intervals,
            lengths_ns=lengths_ns,
            frames=len(chosen),
            period_ns=period_ns,
            tick_ns=tick_ns,
            start_ns=first_ns,
            stop_ns=stop_ns,
        )

    def conclude(self, state: Sequence[RunCounts], facts: Facts) -> Observation:
        """Compare the shares of lines for each number of renders and blend, and state the one that deviates most."""
        intervals = max(len(facts.clocks["rgb"].times_ns) - 1, 0)
        coverage = Coverage(sum(counts.frames for counts in state), intervals, "frame intervals")
        if not state:
            return Observation(coverage, unobservable="no two frames with events")
        tick_ns = max(counts.tick_ns for counts in state)
        period_ns = min(counts.period_ns for counts in state)
        if period_ns < FEWEST_EVENTS * LEAST_SPACING_TICKS * tick_ns:
            reason = f"timestamps in steps of {tick_ns / NS_PER_MS:g} ms are too coarse for three events between frames"
            return Observation(coverage, unobservable=reason)
        # Axes: number of renders, then runs, events, and lines of each blend.
        within, across = (np.sum([getattr(counts, kind) for counts in state], axis=0) for kind in ("within", "across"))
        compared = np.flatnonzero((within[:, 0] > 0) & (across[:, 0] > 0)).tolist()
        if not compared:
            return Observation(coverage, unobservable="no pixel has three events between two frames")
        # Light of a texture is a straight line from texel to texel, whose phase may agree with several renders a frame.
        of_frames = range(len(state[0].domains)) if compared[0] == 0 else range(0)
        cases = [(0, blend) for blend in of_frames] + [(index, 0) for index in compared if index > 0]
        statistics = [self._lines(state, facts, index, blend, len(cases)) for index, blend in cases]
        worst = max(statistics, key=_significance)
        if _significance(worst) > CLEAR:
            return Observation(coverage, (worst,))
        # Renders at the frames where nothing deviates: for many renders there are few runs, with a large limit.
        # Of the blends whose limit is of use the least sensitive one; the signal has the smallest limit.
        signal, *others = statistics[: max(len(of_frames), 1)]
        of_use = [statistic for statistic in others if _limit(statistic) < _MOST_USEFUL]
        return Observation(coverage, (max([signal, *of_use], key=_limit),))

    def _lines(self, state: Sequence[RunCounts], facts: Facts, index: int, blend: int, tests: int) -> Statistic:
        """Return the statistic of a number of renders and a blend."""
        (runs, lines), (runs_across, lines_across) = (
            np.sum([getattr(counts, kind)[index, [0, 2 + blend]] for counts in state], axis=0).tolist()
            for kind in ("within", "across")
        )
        share, share_across = lines / runs, lines_across / runs_across
        # Difference of two shares with one probability (binomial), that of a line across renders.
        probability = (lines_across + UNSEEN_LINES) / (runs_across + 2 * UNSEEN_LINES)
        # Dispersion of the lines across: sum of (l - p n)^2 over that of binomial numbers, n p (1 - p).
        squares, products, run_squares = np.sum([counts.scatter[index, blend] for counts in state], axis=0).tolist()
        variance = squares - 2 * share_across * products + share_across**2 * run_squares
        binomial = runs_across * share_across * (1 - share_across)
        is_signal = state[0].domains[blend] == "signal"
        dispersion = max(1.0, variance / binomial) if binomial > 0 and not is_signal else 1.0
        error = sqrt(dispersion * probability * (1 - probability) * (1 / runs + 1 / runs_across))
        steps = STEPS[index]
        rates_hz = [NS_PER_S * steps * counts.intervals[index] / max(counts.lengths_ns[index], 1) for counts in state]
        rate_hz = max(rates_hz)
        # Mean spacing of a line: the time between two renders over the number of events.
        chances = [
            chance_of_line(counts.tick_ns, NS_PER_S / rate) * counts.within[index, 1]
            for counts, rate in zip(state, rates_hz, strict=True)
            if rate
        ]
        # Windows whose lines within clearly outnumber those across, by the error of the difference of two counts.
        excess, both = (
            np.array([combine(counts.within[index, 2 + blend], counts.across[index, 2 + blend]) for counts in state])
            for combine in (np.subtract, np.add)
        )
        affected = [counts for counts, clear in zip(state, excess > CLEAR * np.sqrt(both), strict=True) if clear]
        domain = {"signal": "", "light": " of light", "codes": " of code values"}[state[0].domains[blend]]
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
            statement=f"{share:.0%} of the changes of a pixel between renders at {rate_hz:.3g} Hz are straight lines"
            f"{domain} in time, and {share_across:.0%} of those across a render: events are interpolated.",
            code="event_response.interpolation.lines",
            where=where,
            features=(RenderRate(rate_hz, steps),),
        )


def _blends(declared: EventModel, transfer: str) -> dict[Domain, Blend]:
    """Return the blends that are tested for a declared event sensor and a transfer curve of the frames."""
    blends: dict[Domain, Blend] = {"signal": BLEND_OF_SIGNAL}
    if declared.model == "log":
        exponents: dict[Domain, float] = {"light": 1.0}
        if transfer in CODE_EXPONENTS:
            exponents["codes"] = CODE_EXPONENTS[transfer]
        for domain, exponent in exponents.items():
            log_ratios = -exponent * declared.threshold_off, exponent * declared.threshold_on
            blends[domain] = Blend(log_ratios, SPACING_SHARE, FEWEST_BLENDS)
    return blends


def _limit(statistic: Statistic) -> float:
    """Return a size that grows with the limit of a statistic, for statistics of equal numbers of tests."""
    return statistic.model_error_bound + CLEAR * statistic.standard_error


def _significance(statistic: Statistic) -> float:
    """Return the deviation of a statistic beyond its bound, in standard errors."""
    return (statistic.value - statistic.expected - statistic.model_error_bound) / statistic.standard_error

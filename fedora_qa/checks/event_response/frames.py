"""Events against log intensity: changes between single frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_US, US_PER_S
from fedora_qa.estimators.events.block_means import BLOCK_PX
from fedora_qa.estimators.events.change_courses import longest_unrelated
from fedora_qa.estimators.fitting.robust import robust_sigma, sensitivity_range
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_blocks import block_moments
from fedora_qa.views.event_camera import why_frames_and_events_do_not_meet

Float64 = NDArray[np.float64]

LARGEST_NOISE: Final = 0.05
"""Largest error of an interval's coefficient by the uncertainty between events: a tenth of the bound."""

LEAST_GAIN: Final = 0.3
"""Least median coefficient: below it most intervals disagree with the events, and no single one is a deviation."""

CHANGE_BOUND: Final = 0.5
"""Bound of the coefficient: halfway between a correct frame (1) and one that repeats the frame before (0)."""

FEWEST_INTERVALS: Final = 5


@dataclass(frozen=True, slots=True)
class IntervalMoments:
    """Moments of the frame intervals of a window.

    Attributes
    ----------
    frames
        (k, 2) rows of the frames at both ends of each interval.
    sums
        (k, 6) sums of ``ChangeMoments``.
    """

    frames: NDArray[np.int64]
    sums: Float64


@dataclass(frozen=True, slots=True)
class ChangeAnomalies(Feature):
    """Intervals with wrong changes.

    Attributes
    ----------
    unchanged
        Number of intervals in which the image does not change.
    reversed
        Number of intervals in which the image changes with the opposite sign of the events.
    unrelated
        Number of successive intervals in which image and events both change, and not together.
    """

    unchanged: int
    reversed: int
    unrelated: int = 0


class EventResponseFrames(WindowCheck[IntervalMoments]):
    """Does the change between successive frames agree with the events between them?

    For each pair of successive frames: the change of the signal over the change that follows from the events in
    between, relative to the median of all intervals. A correct file gives 1. The interval with the most significant
    deviation is judged.

    Why it matters
    --------------
    A repeated or exchanged frame is a wrong label for every quantity that is derived from images, and is hardly visible
    at 50 Hz. Events are an independent measurement of each single interval.

    How
    ---
    The change of the signal is regressed on the signed events in between, averaged over 4 x 4 px blocks. A frame that
    repeats the one before gives 0, and the next one 2. Exchanged frames give 2, -1, 2. Frames of
    another scene change without correlation. Intervals in which the uncertainty between events gives the coefficient an
    error of 0.05 or more are left out.

    Noise model
    -----------
    The standard error combines the spread of all coefficients (median absolute deviation) with the uncertainty between
    events in the interval, a variance of 2/3 C+ C- a pixel. The bound is half a frame's change: halfway between a
    correct frame and a repeated one.

    Cannot detect
    -------------
    Fewer than five usable intervals (hovering, no texture): not_observable. A file most of whose frames are wrong
    (``event_response.orientation``). Frames that are late by a fraction of an interval (``event_response.timing``).

    Sources
    -------
    First principles (``fedora_qa/estimators/events/block_means.py``).
    """

    name = "event_response.frames"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> IntervalMoments | None:
        """Sum over the blocks of each interval."""
        blocks = block_moments(window)
        if blocks is None:
            return None
        # Axis 2 holds the eight symmetries, the declared orientation first; axis 1 the tiles, which are summed.
        upright = blocks.steps[:, :, 0].sum(axis=1)
        return IntervalMoments(np.stack([blocks.frames[:-1], blocks.frames[1:]], axis=1), upright)

    def conclude(self, state: Sequence[IntervalMoments], facts: Facts) -> Observation:
        """Find the interval with the most significant deviation from all others."""
        declared = facts.declared.events
        times_ns = facts.clocks["rgb"].times_ns
        intervals = max(len(times_ns) - 1, 0)
        if not state or declared is None:
            return Observation(Coverage(0, intervals, "frame intervals"), unobservable="no two frames with events")
        frames = np.concatenate([window.frames for window in state])
        # Of each interval: the number of blocks, sums of squares of the frames' change d and of the events' change e,
        # and of d e.
        n, _, _, dd, ee, de = np.concatenate([window.sums for window in state]).T
        # The uncertainty between events, a variance of 2/3 C+ C- a pixel, is an error of the coefficient de / ee by
        # regression on e.
        open_squares = n * 2 / 3 * declared.threshold_on * declared.threshold_off / BLOCK_PX**2
        noise = np.sqrt(open_squares / np.maximum(n * ee, 1e-300))
        clear = (n > 0) & (noise < LARGEST_NOISE)
        coverage = Coverage(int(np.count_nonzero(clear)), intervals, "frame intervals")
        if coverage.seen < FEWEST_INTERVALS:
            return Observation(coverage, unobservable="frames change too little")
        # Regression coefficient of the frames' change on the events' change: sum d e / sum e^2.
        gains = de[clear] / ee[clear]
        middle = float(np.median(gains))
        if middle < LEAST_GAIN:
            reason = f"the median change of frames is only {middle:.2g} of that by events (event_response.orientation)"
            return Observation(coverage, unobservable=reason)
        spread = float(robust_sigma(gains, middle))
        errors = np.hypot(spread, noise[clear])
        # The most significant deviation beyond the bound, not the largest: quiet intervals scatter most.
        worst = int(np.argmax((np.abs(gains - middle) - CHANGE_BOUND * middle) / errors))
        earlier, later = (int(frame) for frame in frames[clear][worst])
        gain = float(gains[worst])
        # Exchanged frames change by -1 times the usual change: halfway from 0 to that counts as reversed.
        anomalies = ChangeAnomalies(
            unchanged=int(np.count_nonzero(dd[clear] == 0)),
            reversed=int(np.count_nonzero(gains < -0.5 * middle)),
            unrelated=longest_unrelated(dd[clear], ee[clear], de[clear]),
        )
        statistic = Statistic(
            name="change_shown",
            value=gain / middle,
            unit="1",
            standard_error=float(errors[worst]) / middle,
            expected=1.0,
            model_error_bound=CHANGE_BOUND,
            tests=len(gains),
            sensitivity=sensitivity_range(errors / middle, CHANGE_BOUND),
            # Between a repeated frame and one that comes too early, for any scatter of the others.
            statement=f"Between the colour frames {earlier} and {later} the image changes by {gain:.2f} of the change "
            f"by events; the median is {middle:.2f}.",
            code="event_response.frames.change",
            where=Where(
                stream="rgb",
                start_us=facts.to_file_us(int(times_ns[earlier])),
                stop_us=facts.to_file_us(int(times_ns[later])),
                frame=later,
            ),
            features=(anomalies,),
        )
        times_s = (facts.origin_us + times_ns[frames[clear][:, 1]] / NS_PER_US) / US_PER_S
        return Observation(
            coverage,
            (statistic,),
            evidence={"change_shown": np.stack([times_s, gains], axis=1)},
            titles={"change_shown": "Change between frames over change by events; x time [s]; y ratio [1]"},
        )

"""The scatter of event timestamps."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.events.time_jitter import (
    FEWEST_PIXELS,
    Quadruples,
    estimate_jitter,
    event_quadruples,
    step_polynomial,
)
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.sensor_events import GRID, HALO_NS, local_tick_ns, pixel_events, sensor_shape

MOST_QUADRUPLES: Final = 4000
"""Number of quadruples of a window beyond which pixels are sampled. 4000 determine the jitter of a window to 5%."""

_LINEAR_SHARE: Final = 1 / 3
"""Standard deviation of w / T due to whole grey values of a sensor of the linear model, times its threshold in DN.

A reference is a whole value, with a rounding error of 1 / sqrt(12) DN, so that a step of C has an error of
sqrt(2 / 12) DN, and an interval one of sqrt(1 / 6) / C of itself, T / 3. w weighs the intervals by 1, -2, 1 and has
sqrt(6) times this error: sqrt(6) sqrt(1 / 6) / (3 C)."""


@dataclass(frozen=True, slots=True)
class TimestampScatter(Feature):
    """Scatter of event timestamps.

    Attributes
    ----------
    sigma_ms, error_ms
        Standard deviation, and its error with bounds, ms.
    saturated
        Whether the standard deviation is only a lower bound.
    """

    sigma_ms: float
    error_ms: float
    saturated: bool


@dataclass(frozen=True, slots=True)
class JitterSummary:
    """Quadruples of a window.

    Attributes
    ----------
    quadruples
        Four successive events of one pixel and one polarity each.
    tick_ns
        Step of the event timestamps in the window, ns.
    """

    quadruples: Quadruples
    tick_ns: int


class EventResponseJitter(WindowCheck[JitterSummary]):
    """Do timestamps of single events scatter?

    The standard deviation of the timestamps of single events about the times at which their pixels fired, in ms.

    Why it matters
    --------------
    Events are used for their time resolution. At 200 px/s a jitter of 2 ms blurs each edge that is warped along the
    flow by 0.4 px. A method that uses the order of events, or estimates the slope of light from their intervals, has
    noisy input. Jitter changes neither the offset nor the rate nor the order of the stream.

    How
    ---
    While an edge crosses a pixel, events of one polarity follow each other in regular intervals: equal ones for the
    linear model, ones in the ratio exp(C) or exp(-C) for the log model. A third difference of the times of four
    successive events is zero for all of these. Jitter gives it 4.5 times its own standard deviation, with either sign.
    Blur and corners make the difference positive only. Its spread is therefore estimated from its lower quartile, or
    from the quartile of its absolute value if this is smaller. The shortest quadruples are used, because the
    contribution of light grows with their duration; the shortest eighth is left out, because it may contain noise
    events. Where jitter exceeds the intervals, longer quadruples are used as well. Where it exceeds these too, a lower
    bound is stated.

    Noise model
    -----------
    The expected value is 0. The standard error is the largest of the formal one of a quartile, for normal noise and
    overlapping quadruples, and those by leaving out tiles (4 x 4) and windows (delete-one jackknife). The error of a
    spread is proportional to the spread; where the spread exceeds the bounds, the error at the bounds is therefore
    used. The model error bound has three terms. Shape of light: 0.7% of the duration of the quadruples, because the
    lower quartile of straight edges, of edges with a Gaussian blur and of sine waves is not below -0.022 of it. Whole
    grey values of the linear model: a thirteenth of the duration over the threshold in DN. The scatter of a tick,
    declared or measured: tick / sqrt(12). A spread of thresholds between pixels, a leak and a low-pass change the
    intervals of a pixel smoothly. Noise events are in less than a tenth of the quadruples, up to the rate at which the
    check is not observable. Declared hot pixels are left out, and each pixel gives at most four quadruples of a window.

    Cannot detect
    -------------
    Jitter that all events of an edge share (``clocks.resolution`` measures packets of another length than declared).
    Jitter of a small part of the events, of a short time or of a region. Jitter below the bound. Near the detection
    limit, blur hides up to a quarter of the size. Where edges pass in less time than the jitter, the size is a lower
    bound. Scenes whose edges have fewer than four thresholds within 30 ms, or pass within eight steps of the
    timestamps.

    Sources
    -------
    First principles: ``fedora_qa/estimators/events/time_jitter.py``. Order statistics: Cramer, Mathematical Methods of
    Statistics, 1946; jackknife: Efron and Stein 1981.
    """

    name = "event_response.jitter"
    needs = ("events",)

    def not_applicable(self, facts: Facts) -> str:
        """Require the size of the sensor, and positive thresholds."""
        if "events" not in facts.declared.cameras:
            return "the camera events is not declared in /metadata/cameras"
        declared = facts.declared.events
        if declared is None or not min(declared.threshold_on, declared.threshold_off) > 0:
            return "the event sensor is not declared with positive thresholds in /metadata/events"
        return ""

    def measure(self, window: Window) -> JitterSummary | None:
        """Collect the quadruples that begin in the window."""
        declared, (height, width) = window.facts.declared.events, sensor_shape(window.facts.declared)
        if declared is None:
            return None
        hot = [row * width + column for column, row in declared.hot_pixels if 0 <= row < height and 0 <= column < width]
        quadruples = event_quadruples(
            pixel_events(window),
            window.span.start_ns,
            window.span.stop_ns,
            # The halo holds all events of a quadruple that is no longer.
            HALO_NS,
            np.array(hot, np.int64),
            MOST_QUADRUPLES,
        )
        return JitterSummary(quadruples, local_tick_ns(window)) if len(quadruples.pixels) else None

    def conclude(self, state: Sequence[JitterSummary], facts: Facts) -> Observation:
        """Estimate the jitter from the quadruples of all windows."""
        declared, (height, width) = facts.declared.events, sensor_shape(facts.declared)
        count = sum(len(summary.quadruples.pixels) for summary in state)
        coverage = Coverage(count, count, "quadruples of events")
        if declared is None:
            return Observation(coverage, unobservable="the event sensor is not declared")
        noise_hz = declared.leak_rate_hz + declared.shot_rate_hz
        if noise_hz > _MOST_NOISE_HZ:
            why = f"noise events of {noise_hz:g} Hz a pixel are in more than a tenth of the quadruples"
            return Observation(coverage, unobservable=why)
        durations_s = _joined([summary.quadruples.durations_ns for summary in state]) / NS_PER_S
        middles_s = _joined([summary.quadruples.middles_ns for summary in state]) / NS_PER_S
        pixels = _joined([summary.quadruples.pixels for summary in state]).astype(np.int64)
        rows, columns = np.divmod(pixels, width)
        windows = np.repeat(np.arange(len(state)), [len(summary.quadruples.pixels) for summary in state])
        linear = declared.model == "linear"
        threshold = 0.5 * (declared.threshold_on + declared.threshold_off)
        estimate = estimate_jitter(
            durations_s,
            middles_s,
            pixels,
            np.stack([GRID * rows // height * GRID + GRID * columns // width, windows], axis=1),
            c=step_polynomial(0.0 if linear else threshold),
            tick_s=max((summary.tick_ns for summary in state), default=1) / NS_PER_S,
            longest_s=HALO_NS / NS_PER_S,
            rounding_share=_LINEAR_SHARE / threshold if linear else 0.0,
        )
        if estimate is None:
            why = (
                f"fewer than {FEWEST_PIXELS} pixels have four events of one polarity within 30 ms "
                "(slow motion, little contrast, or large thresholds), or edges pass within few steps of the timestamps"
            )
            return Observation(coverage, unobservable=why)
        # The shape of light may increase or decrease the estimate.
        sigma_ms, error_ms = 1e3 * estimate.sigma_s, 1e3 * hypot(estimate.standard_error_s, estimate.bound_s)
        size = f"at least {sigma_ms:.3g}" if estimate.saturated else f"{sigma_ms:.3g} +/- {error_ms:.2g}"
        jitter = Statistic(
            name="jitter",
            value=sigma_ms,
            unit="ms",
            standard_error=1e3 * estimate.nominal_error_s,
            model_error_bound=1e3 * estimate.bound_s,
            side="upper",
            statement=f"Timestamps of events scatter by {size} ms about the times at which their pixels fired.",
            code="event_response.jitter.spread",
            where=Where(stream="events"),
            features=(TimestampScatter(sigma_ms, error_ms, estimate.saturated),),
        )
        return Observation(coverage, (jitter,))


_MOST_NOISE_HZ: Final = 0.8
"""Rate of noise events of a pixel at which one lies among four events within 30 ms with a probability of a tenth: four
such intervals times the rate."""


def _joined(columns: Sequence[NDArray[np.int32]]) -> NDArray[np.int32]:
    return np.concatenate(columns) if columns else np.zeros(0, np.int32)

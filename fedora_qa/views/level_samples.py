"""Bracketed level samples: their normal equations in a window, and the thresholds and delay that a file's windows fit.

``fedora_qa/estimators/events/levels.py`` derives the samples, ``threshold_fit.py`` beside it the fit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, log
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.events.footprint import LEFT_BY_SHARP
from fedora_qa.estimators.events.levels import (
    LevelImages,
    LevelPairs,
    accumulate,
    level_pairs,
    mark_usable,
    precision_weights,
)
from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.events.threshold_fit import (
    NormalBlocks,
    ResponseErrors,
    ResponseFit,
    concatenate,
    fit_response,
)
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_blocks import NOMINAL_RESPONSE
from fedora_qa.views.event_camera import ROUNDING_DN, ResampledFrames, resampled_frames
from fedora_qa.views.sensor_events import HALO_NS, events_around, local_tick_ns, pixel_events, sorted_by_pixel

LONGEST_GAP_NS: Final = 20_000_000
"""Events farther apart do not determine a level: between them the level of a pixel may have any value within its
thresholds."""

ENOUGH_PAIRS: Final = 400
"""Number of pairs of the shortest gaps that are taken where all pairs have equal weight."""
FEWEST_PAIRS: Final = 20
"""Least number of pairs of a window: fewer do not determine the scale of outliers."""

LINEAR_LEAST_TICKS: Final = 4
"""Least gap in rendered steps. One event a step does not determine the change of the step, so pixels with events in
every few steps are left out."""

FARTHEST_OFFSET_NS: Final = 100_000_000
OFFSET_STEP_NS: Final = 5_000_000
REFINEMENTS: Final = 3
"""Farthest offset and step of the ladder of offsets, and number of fits by which its best offset is refined."""

CAPTURE_RANGE_S: Final = 3e-3
"""Largest offset, s, that one fit estimates without bias. Larger ones also bias the thresholds."""

FOLLOWS: Final = 1.0
"""Largest residual, in thresholds, with which events follow the frames."""

LIMIT_ERRORS: Final = 5.0
"""Approximate number of standard errors in a limit, for the comparison of two fits only."""

HELD_LEVEL_BIAS: Final = float(np.sqrt(3.0))
"""Ratio of mean to scatter of the error of levels that hold from one event to the next.

At a fraction phi of the gap the interpolated level exceeds the true one by phi thresholds. phi is uniform: its mean is
1/2 and its standard deviation 1/sqrt(12), so their ratio is sqrt(3)."""

ROUNDING_SHARE: Final = 0.1
"""Largest share of the threshold that the rounding of a frame may reach; darker pixels are left out."""

_LINEAR_LEAST_DN: Final = 4.0
_DARKEST_DN: Final = 0.5


@dataclass(frozen=True, slots=True)
class LevelSums:
    """Normal equations of a window in both domains and by both reconstructions, for the four quarters of the image.

    Attributes
    ----------
    log_edge_aware, log_uniform, linear_edge_aware, linear_uniform
        By domain and reconstruction; levels in nat (log) or DN (linear).
    straight
        In the declared domain, with straight lines between events in place of cubics.
    overshoot
        Mean of tick over gap: the share of a threshold by which a pixel's level changes in one rendered step.
    pairs
        Number of pairs of level samples.
    window
        Number of the window.
    """

    log_edge_aware: NormalBlocks
    log_uniform: NormalBlocks
    linear_edge_aware: NormalBlocks
    linear_uniform: NormalBlocks
    straight: NormalBlocks
    overshoot: float
    pairs: int
    window: int


@dataclass(frozen=True, slots=True)
class WeightedLevelSums:
    """Normal equations of a window by two weightings of its pairs of level samples.

    Attributes
    ----------
    equal
        From the pairs of the shortest gaps, each of weight 1.
    by_precision
        From all pairs, weighted by ``precision_weights``.
    """

    equal: LevelSums
    by_precision: LevelSums


@dataclass(frozen=True, slots=True)
class LadderOffset:
    """An offset at which the events of a window follow its frames.

    Attributes
    ----------
    offset_s, standard_error_s
        Clock offset of the events (positive: timestamps too late) and its standard error, s.
    relative_sigma
        Residual over threshold, without unit.
    bound_s
        Bound on the bias by levels that jump at events, s.
    """

    offset_s: float
    standard_error_s: float
    relative_sigma: float
    bound_s: float


@dataclass(frozen=True, slots=True)
class ThresholdFit:
    """The fits of a file to its level samples.

    Attributes
    ----------
    fit
        In the declared domain.
    model_errors
        Bounds on errors of the model: of footprints (change of the fit by the other reconstruction of frames), of
        levels between events (change by straight lines), of regressors (attenuation).
    other_domain
        The fit in the other domain; None where it fails.
    preference
        Mean and standard error, over blocks, of ln(residual / threshold) in the declared domain less that in the other.
    overshoot
        As in ``LevelSums``.
    """

    fit: ResponseFit
    model_errors: ResponseErrors
    other_domain: ResponseFit | None
    preference: tuple[float, float]
    overshoot: float


def level_sums(window: Window) -> LevelSums | None:
    """Return the normal equations of the pairs with the shortest gaps; None where the window holds too few pairs."""
    return window.derived(_level_sums)


def _level_sums(window: Window) -> LevelSums | None:
    samples = _level_samples(window)
    if samples is None:
        return None
    pairs, frames, declared = samples
    return _summed(window, pairs.tightest(ENOUGH_PAIRS), frames, declared)


def weighted_level_sums(window: Window) -> WeightedLevelSums | None:
    """Return the normal equations of a window by both weightings; None where it holds too few pairs."""
    equal, samples = level_sums(window), _level_samples(window)
    if equal is None or samples is None:
        return None
    pairs, frames, declared = samples
    edge_aware = _levels_at_ends(pairs, frames.edge_aware_dn, declared)
    uniform = _levels_at_ends(pairs, frames.uniform_dn, declared)
    threshold = 0.5 * (declared.threshold_on + declared.threshold_off)
    weights = precision_weights(pairs, edge_aware, uniform, threshold)
    return WeightedLevelSums(equal, _summed(window, pairs, frames, declared, weights))


def fit_thresholds(state: Sequence[LevelSums], facts: Facts) -> ThresholdFit | str:
    """Fit thresholds and delay of a file to the sums of its windows.

    Parameters
    ----------
    state
        Sums of the windows, in the order of time.
    facts
        With the declared event sensor; ``NOMINAL_RESPONSE`` where there is none.

    Returns
    -------
    ThresholdFit or str
        A sentence that gives the reason where they cannot be fitted.
    """
    declared = facts.declared.events or NOMINAL_RESPONSE
    pairs = sum(sums.pairs for sums in state)
    too_few = f"only {pairs} pairs of frames at which events determine a level (slow motion, little texture, or dark)"
    if not state:
        return too_few
    ours, theirs = ("linear", "log") if declared.model == "linear" else ("log", "linear")
    blocks, other_blocks = _concatenated(state, f"{ours}_edge_aware"), _concatenated(state, f"{theirs}_edge_aware")
    fit, other = fit_response(blocks), fit_response(other_blocks)
    uniform, straight = (fit_response(_concatenated(state, name)) for name in (f"{ours}_uniform", "straight"))
    if fit is None or uniform is None or straight is None:
        return too_few
    least = min(fit.relative_sigma, other.relative_sigma if other is not None else fit.relative_sigma)
    if least > FOLLOWS:
        return (
            f"events do not agree with the frames: the residual is {least:.3g} thresholds "
            "(see event_response.orientation)"
        )
    overshoot = sum(sums.overshoot * sums.pairs for sums in state) / pairs
    # Residuals over thresholds in the declared and in the other domain, compared block by block.
    preference = 0.0, float("inf")
    if other is not None:
        enough = (blocks.counts >= FEWEST_PAIRS) & (other_blocks.counts >= FEWEST_PAIRS)
        if np.count_nonzero(enough) < 2:
            # One block has no scatter, so the preference has no standard error.
            preference = float(np.log(fit.relative_sigma / other.relative_sigma)), float("inf")
        else:
            difference = (np.log(fit.block_sigmas(blocks)) - np.log(other.block_sigmas(other_blocks)))[enough]
            # Residuals have units of their domain (nat, DN); over their threshold they are comparable.
            scale = np.log(fit.threshold / other.threshold)
            preference = float(difference.mean() - scale), float(difference.std(ddof=1) / np.sqrt(len(difference)))

    def bound(name: str) -> float:
        """Add up how far each other reconstruction moves an estimate, and its attenuation."""
        own = getattr(fit, name)
        moved = LEFT_BY_SHARP * abs(own - getattr(uniform, name)) + abs(own - getattr(straight, name))
        return float(moved + getattr(fit.attenuation, name))

    rate_bound = bound("delay_rate") if isfinite(fit.attenuation.delay_rate) else float("inf")
    errors = ResponseErrors(bound("threshold_on"), bound("threshold_off"), bound("delay_s"), rate_bound)
    return ThresholdFit(fit, errors, other, preference, overshoot)


def lower_variance_fit(equal: ThresholdFit | str, by_precision: ThresholdFit | str) -> ThresholdFit | str:
    """Return the fit with the smaller sum of the limits of both thresholds; ``equal`` where both sums are equal.

    Where edges are sharp this is the fit weighted by precision. Where light flickers between events, no sample predicts
    its error, and the number of pairs decides. The choice depends on errors and bounds only, never on the deviation of
    the thresholds.

    Parameters
    ----------
    equal
        Fit to pairs of equal weight, or the reason why there is none.
    by_precision
        Fit to pairs weighted by precision, or the reason why there is none.

    Returns
    -------
    ThresholdFit or str
        A sentence where neither fit exists.
    """
    if isinstance(by_precision, str):
        return equal
    if not isinstance(equal, str) and _threshold_limit(equal) <= _threshold_limit(by_precision):
        return equal
    return by_precision


def level_coverage(state: Sequence[LevelSums]) -> Coverage:
    """Return the number of pairs of level samples that were used; the number of possible pairs is unknown."""
    pairs = sum(sums.pairs for sums in state)
    return Coverage(pairs, pairs, "level samples")


def search_offset(window: Window) -> LadderOffset | None:
    """Search the offset at which the events of a window follow its frames, from -100 ms to 100 ms.

    A fit converges from offsets that are wrong by several ms. It is repeated from the best of a ladder of offsets.
    """
    frames, declared = resampled_frames(window), window.facts.declared.events
    if declared is None or len(frames) < 2:
        return None
    events = sorted_by_pixel(events_around(window, FARTHEST_OFFSET_NS + HALO_NS), window.facts.declared)
    fits = [
        (offset_ns, fit)
        for offset_ns in range(-FARTHEST_OFFSET_NS, FARTHEST_OFFSET_NS + 1, OFFSET_STEP_NS)
        if (fit := _fit_at_offset(window, frames, declared, events, offset_ns)) is not None
    ]
    if not fits:
        return None
    offset_ns, fit = min(fits, key=lambda candidate: candidate[1].relative_sigma)
    for _ in range(REFINEMENTS):
        offset_ns += round(fit.delay_s * 1e9)
        refined = _fit_at_offset(window, frames, declared, events, offset_ns)
        if refined is None:
            return None
        fit = refined
    if fit.relative_sigma > FOLLOWS or min(fit.threshold_on, fit.threshold_off) < 0:
        return None
    offset_s = offset_ns * 1e-9 + fit.delay_s
    held_s = HELD_LEVEL_BIAS * fit.coherent_delay_s if declared.model == "linear" else 0.0
    return LadderOffset(offset_s, fit.standard_errors.delay_s, fit.relative_sigma, held_s)


def usable_pixels(window: Window, frames: ResampledFrames, declared: EventModel) -> NDArray[np.bool_]:
    """Return the pixels that are bright enough, not saturated, and not declared hot.

    Parameters
    ----------
    frames
        Luma in linear DN at the pixels of the event camera.
    declared
        The sensor, with its thresholds and hot pixels.

    Returns
    -------
    ndarray of bool
        (n, h, w) by frame.
    """
    darkest_dn = least_dn(window, declared)
    usable: NDArray[np.bool_] = np.empty(frames.uniform_dn.shape, np.bool_)
    for frame, marked in enumerate(usable):
        mark_usable(frames.edge_aware_dn[frame], frames.uniform_dn[frame], frames.error_dn[frame], darkest_dn, marked)
    usable.reshape(len(usable), -1)[:, hot_pixels(declared, frames)] = False
    return usable


def hot_pixels(declared: EventModel, frames: ResampledFrames) -> NDArray[np.int64]:
    """Return the declared hot pixels that lie on the sensor.

    Parameters
    ----------
    declared
        With the (column, row) of each hot pixel.
    frames
        At the pixels of the sensor, which give its size.

    Returns
    -------
    ndarray of int64
        (k,) row * width + column, sorted.
    """
    height, width = frames.uniform_dn.shape[1:]
    on_sensor = [
        row * width + column for column, row in declared.hot_pixels if 0 <= row < height and 0 <= column < width
    ]
    return np.unique(np.array(on_sensor, np.int64))


def least_dn(window: Window, declared: EventModel) -> float:
    """Return the luma below which the level of a pixel is not determined.

    In the model ``log`` it follows from the rounding of frames: its standard deviation must not exceed
    ``ROUNDING_SHARE`` of the smaller threshold.

    Parameters
    ----------
    window
        With the declared transfer curve of frames.
    declared
        The model and its thresholds.

    Returns
    -------
    float
        Linear DN.
    """
    if declared.model != "log":
        return _LINEAR_LEAST_DN
    # The standard deviation of rounding, uniform over a step, over the level is that of its logarithm.
    sigma_dn = 2 * ROUNDING_DN[window.facts.declared.transfer] / np.sqrt(12.0)
    contrast = ROUNDING_SHARE * min(declared.threshold_on, declared.threshold_off)
    least = max(sigma_dn / contrast - declared.log_eps_dn, _DARKEST_DN)
    if declared.is_lin_log and sigma_dn * log(declared.linear_below_dn) / declared.linear_below_dn > contrast:
        # In the linear part the slope of the level, ln(T) / T, does not depend on luma.
        least = max(least, declared.linear_below_dn - declared.log_eps_dn)
    return float(least)


def _level_samples(window: Window) -> tuple[LevelPairs, ResampledFrames, EventModel] | None:
    """Return all pairs of level samples of a window, its frames, and the declared or nominal sensor; None: too few."""
    return window.derived(_sampled_levels)


def _sampled_levels(window: Window) -> tuple[LevelPairs, ResampledFrames, EventModel] | None:
    frames, declared = resampled_frames(window), window.facts.declared.events or NOMINAL_RESPONSE
    if len(frames) < 2:
        return None
    pairs = _pairs(window, frames, declared, pixel_events(window))
    return (pairs, frames, declared) if len(pairs) >= FEWEST_PAIRS else None


def _summed(
    window: Window,
    pairs: LevelPairs,
    frames: ResampledFrames,
    declared: EventModel,
    weights: NDArray[np.float64] | None = None,
) -> LevelSums:
    """Return the sums of pairs with weights (m,), 1 for each if not given."""
    weights = np.ones(len(pairs)) if weights is None else weights
    edge_aware, uniform = (pairs.ends_of(luma_dn) for luma_dn in (frames.edge_aware_dn, frames.uniform_dn))
    log_edge_aware, log_uniform = (_log_levels(luma_dn, declared) for luma_dn in (edge_aware, uniform))
    linear = declared.model == "linear"
    return LevelSums(
        _quarter_sums(pairs, frames, log_edge_aware, weights),
        _quarter_sums(pairs, frames, log_uniform, weights),
        _quarter_sums(pairs, frames, edge_aware, weights),
        _quarter_sums(pairs, frames, uniform, weights),
        _quarter_sums(pairs.with_straight_lines(), frames, edge_aware if linear else log_edge_aware, weights),
        float(np.average(local_tick_ns(window) * 1e-9 / pairs.gaps_s, weights=weights)),
        len(pairs),
        window.span.index,
    )


def _fit_at_offset(
    window: Window, frames: ResampledFrames, declared: EventModel, events: PixelEvents, offset_ns: int
) -> ResponseFit | None:
    """Fit one window after subtraction of a clock offset from its events, by frames that are later by the offset."""
    pairs = _pairs(window, frames, declared, events, offset_ns).tightest(ENOUGH_PAIRS)
    if len(pairs) < FEWEST_PAIRS:
        return None
    levels = _levels_at_ends(pairs, frames.edge_aware_dn, declared)
    return fit_response(_quarter_sums(pairs, frames, levels, np.ones(len(pairs))))


def _pairs(
    window: Window, frames: ResampledFrames, declared: EventModel, events: PixelEvents, offset_ns: int = 0
) -> LevelPairs:
    burst_ns = 2 * declared.refractory_us * NS_PER_US
    darkest_dn = least_dn(window, declared)
    pairs = level_pairs(
        events,
        frames.times_ns + offset_ns,
        LevelImages(frames.edge_aware_dn, frames.uniform_dn, frames.error_dn, darkest_dn, hot_pixels(declared, frames)),
        longest_gap_ns=LONGEST_GAP_NS,
        least_gap_ns=LINEAR_LEAST_TICKS * local_tick_ns(window) if declared.model == "linear" else int(burst_ns),
        off_over_on=declared.threshold_off / declared.threshold_on,
    )
    if declared.leak_rate_hz > 0:
        # Leak events are brighter events without a rise of the level: leak rate times elapsed time of them.
        elapsed_s = (frames.times_ns[pairs.later] - frames.times_ns[pairs.earlier]) * 1e-9
        pairs.regressors[:, 0] -= declared.leak_rate_hz * elapsed_s
    return pairs


def _quarter_sums(
    pairs: LevelPairs, frames: ResampledFrames, levels: NDArray[np.float64], weights: NDArray[np.float64]
) -> NormalBlocks:
    """Return the normal equations of four blocks, the quarters of the image, of ``levels`` (2, m) at both ends."""
    height, width = frames.uniform_dn.shape[1:]
    rows, columns = np.divmod(pairs.pixels, width)
    quarter = 2 * (2 * rows // height) + 2 * columns // width
    # The delay may drift: a pair determines it at the middle of its two frames, s from the file's origin.
    middle_ns = (frames.times_ns[pairs.earlier] + frames.times_ns[pairs.later]) / 2
    return accumulate(pairs, levels[1] - levels[0], quarter, 4, middle_ns * 1e-9, weights)


def _levels_at_ends(pairs: LevelPairs, luma_dn: NDArray[np.float32], declared: EventModel) -> NDArray[np.float64]:
    """Return the levels of the declared domain at both ends of pairs, (2, m), from luma (n, h, w) in DN."""
    at_ends = pairs.ends_of(luma_dn)
    return at_ends if declared.model == "linear" else _log_levels(at_ends, declared)


def _log_levels(luma_dn: NDArray[np.float64], declared: EventModel) -> NDArray[np.float64]:
    """Return L of luma in DN, NaN staying NaN."""
    level: NDArray[np.float64] = np.log(np.maximum(luma_dn + declared.log_eps_dn, 1e-3))
    return level


def _concatenated(state: Sequence[LevelSums], name: str) -> NormalBlocks:
    return concatenate([getattr(sums, name) for sums in state])


def _threshold_limit(fitted: ThresholdFit) -> float:
    """Return the sum of the limits of both thresholds."""
    errors, bounds = fitted.fit.standard_errors, fitted.model_errors
    of_both = bounds.threshold_on + bounds.threshold_off + LIMIT_ERRORS * (errors.threshold_on + errors.threshold_off)
    return float(of_both)

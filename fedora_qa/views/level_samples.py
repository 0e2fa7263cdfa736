"""How events answer to frames: what a window shows to the checks of threshold, model and timing."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.events.level_kernels import mark_usable
from fedora_qa.estimators.events.levels import LevelPairs, NormalBlocks, Shown, accumulate, level_pairs, sureness
from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.events.threshold_fit import ResponseFit, fit_response
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import (
    HALO_NS,
    ROUNDING_DN,
    ResampledFrames,
    events_around,
    pixel_events,
    resampled_frames,
    sorted_by_pixel,
)
from fedora_qa.views.event_tick import local_tick_ns

LONGEST_GAP_NS: Final = 20_000_000
"""Events farther apart do not tell a level: between them a pixel may go anywhere within its thresholds."""

ENOUGH_PAIRS: Final = 400
"""Where a window has more, those of the shortest gaps are taken where all weigh alike."""
FEWEST_PAIRS: Final = 20
"""A window with fewer has no scale of its own for outliers."""

LINEAR_LEAST_TICKS: Final = 4
"""One event a rendered step hides how far the step went; pixels that fire every few steps are left out."""

FARTHEST_OFFSET_NS: Final = 100_000_000
OFFSET_STEP_NS: Final = 5_000_000
REFINEMENTS: Final = 3
"""Offsets that are tried where events do not follow the frames as they stand."""

FOLLOWS: Final = 1.0
"""Residual, in thresholds, beyond which events do not follow the frames."""

HELD_LEVEL_BIAS: Final = float(np.sqrt(3.0))
"""Mean over scatter of the error of levels that stay where an event left them until the next one.

At a share phi of the gap the events tell phi thresholds more than there are: 1/2 on average, with a standard deviation
of 1/sqrt(12) as phi is uniform."""

ROUNDING_SHARE: Final = 0.1
"""Pixels so dark that rounding of the frame exceeds this share of the threshold are left out."""

_LINEAR_LEAST_DN: Final = 4.0
_DARKEST_DN: Final = 0.5


@dataclass(frozen=True, slots=True)
class LevelSums:
    """Normal equations of a window in both domains and by both reconstructions, four blocks of the image each.

    ``straight`` is in the declared domain, with straight lines between events in place of cubics.
    ``overshoot`` is the mean of tick over gap: the share of a threshold that a pixel moves in a rendered step.
    ``window`` is the window's number.
    """

    log_sharp: NormalBlocks
    log_even: NormalBlocks
    linear_sharp: NormalBlocks
    linear_even: NormalBlocks
    straight: NormalBlocks
    overshoot: float
    pairs: int
    window: int


@dataclass(frozen=True, slots=True)
class FoundOffset:
    """An offset at which events follow the frames.

    How late events are, the residual left, in thresholds, and a bound on the bias that levels which jump make.
    """

    late_s: float
    standard_error_s: float
    relative_sigma: float
    bound_s: float


@dataclass(frozen=True, slots=True)
class WeighedSums:
    """Sums of a window by two weightings: the pairs of the shortest gaps alike, and all by ``sureness``."""

    alike: LevelSums
    sure: LevelSums


def level_sums(window: Window) -> LevelSums | None:
    """Return the sums of a window, pairs of the shortest gaps alike; None where it shows too few levels."""
    return window.once("level_sums", lambda: _level_sums(window))


def weighed_sums(window: Window) -> WeighedSums | None:
    """Return the sums of a window by both weightings; None where it shows too few levels."""
    alike, found = level_sums(window), _level_pairs(window)
    if alike is None or found is None:
        return None
    pairs, seen, declared = found
    return WeighedSums(alike, _summed(window, pairs, seen, declared, _sureness(pairs, seen, declared)))


def _level_sums(window: Window) -> LevelSums | None:
    found = _level_pairs(window)
    if found is None:
        return None
    pairs, seen, declared = found
    tight = pairs.tightest(ENOUGH_PAIRS)
    return _summed(window, tight, seen, declared, np.ones(len(tight)))


def _level_pairs(window: Window) -> tuple[LevelPairs, ResampledFrames, EventModel] | None:
    return window.once("level_pairs", lambda: _find_level_pairs(window))


def _find_level_pairs(window: Window) -> tuple[LevelPairs, ResampledFrames, EventModel] | None:
    seen, declared = resampled_frames(window), window.facts.declared.events
    if declared is None or len(seen) < 2:
        return None
    pairs = _pairs(window, seen, declared, pixel_events(window))
    return (pairs, seen, declared) if len(pairs) >= FEWEST_PAIRS else None


def _summed(
    window: Window, pairs: LevelPairs, seen: ResampledFrames, declared: EventModel, sure: NDArray[np.float64]
) -> LevelSums:
    """Return the sums of pairs with weights (m,)."""
    sharp, even = (pairs.ends_of(luma) for luma in (seen.edge_aware_dn, seen.uniform_dn))
    log_sharp, log_even = (log_levels(luma, declared) for luma in (sharp, even))
    linear = declared.model == "linear"

    def sums(pairs: LevelPairs, levels: NDArray[np.float64]) -> NormalBlocks:
        return _sums(pairs, seen, levels, sure)

    return LevelSums(
        sums(pairs, log_sharp),
        sums(pairs, log_even),
        sums(pairs, sharp),
        sums(pairs, even),
        sums(pairs.with_straight_lines(), sharp if linear else log_sharp),
        float(np.average(local_tick_ns(window) * 1e-9 / pairs.gaps_s, weights=sure)),
        len(pairs),
        window.span.index,
    )


def search_offset(window: Window) -> FoundOffset | None:
    """Look for the offset at which the events of a window follow its frames, up to 100 ms either way.

    A fit draws towards the right offset from several ms away; it is repeated from the best of a ladder of offsets.
    """
    seen, declared = resampled_frames(window), window.facts.declared.events
    if declared is None or len(seen) < 2:
        return None
    events = sorted_by_pixel(events_around(window, FARTHEST_OFFSET_NS + HALO_NS), window.facts.declared)
    ladder = range(-FARTHEST_OFFSET_NS, FARTHEST_OFFSET_NS + 1, OFFSET_STEP_NS)
    fits = [(late_ns, _fit_at(window, seen, declared, events, late_ns)) for late_ns in ladder]
    known = [(late_ns, fit) for late_ns, fit in fits if fit is not None]
    if not known:
        return None
    late_ns, fit = min(known, key=lambda found: found[1].relative_sigma)
    for _ in range(REFINEMENTS):
        late_ns += round(fit.delay_s * 1e9)
        again = _fit_at(window, seen, declared, events, late_ns)
        if again is None:
            return None
        fit = again
    if fit.relative_sigma > FOLLOWS or min(fit.threshold_on, fit.threshold_off) < 0:
        return None
    late_s = late_ns * 1e-9 + fit.delay_s
    held_s = HELD_LEVEL_BIAS * fit.coherent_delay_s if declared.model == "linear" else 0.0
    return FoundOffset(late_s, fit.standard_errors.delay_s, fit.relative_sigma, held_s)


def _fit_at(
    window: Window, seen: ResampledFrames, declared: EventModel, events: PixelEvents, late_ns: int
) -> ResponseFit | None:
    """Fit one window with events taken to be late by so much: with frames at later times."""
    pairs = _pairs(window, seen, declared, events, late_ns).tightest(ENOUGH_PAIRS)
    if len(pairs) < FEWEST_PAIRS:
        return None
    sharp = pairs.ends_of(seen.edge_aware_dn)
    levels = sharp if declared.model == "linear" else log_levels(sharp, declared)
    return fit_response(_sums(pairs, seen, levels, np.ones(len(pairs))))


def _pairs(
    window: Window, seen: ResampledFrames, declared: EventModel, events: PixelEvents, late_ns: int = 0
) -> LevelPairs:
    burst_ns = 2 * declared.refractory_us * NS_PER_US
    pairs = level_pairs(
        events,
        seen.times_ns + late_ns,
        _shown(window, seen, declared),
        longest_gap_ns=LONGEST_GAP_NS,
        least_gap_ns=LINEAR_LEAST_TICKS * local_tick_ns(window) if declared.model == "linear" else int(burst_ns),
        off_over_on=declared.threshold_off / declared.threshold_on,
    )
    if declared.leak_rate_hz > 0:
        # Leak gives brighter events that the level does not rise by: so many thresholds in the time between.
        elapsed_s = (seen.times_ns[pairs.later] - seen.times_ns[pairs.earlier]) * 1e-9
        pairs.regressors[:, 0] -= declared.leak_rate_hz * elapsed_s
    return pairs


def _sureness(pairs: LevelPairs, seen: ResampledFrames, declared: EventModel) -> NDArray[np.float64]:
    """Return how surely frames and events tell the levels of pairs, (m,): alike in both domains."""
    threshold = 0.5 * (declared.threshold_on + declared.threshold_off)
    sharp, even = (pairs.ends_of(luma) for luma in (seen.edge_aware_dn, seen.uniform_dn))
    if declared.model == "linear":
        return sureness(pairs, sharp, even, threshold)
    return sureness(pairs, log_levels(sharp, declared), log_levels(even, declared), threshold)


def _sums(
    pairs: LevelPairs, seen: ResampledFrames, levels: NDArray[np.float64], sure: NDArray[np.float64]
) -> NormalBlocks:
    """Return the normal equations of four blocks, the quarters of the image, of ``levels`` (2, m) at both ends."""
    height, width = seen.uniform_dn.shape[1:]
    rows, columns = np.divmod(pairs.pixels, width)
    quarter = 2 * (2 * rows // height) + 2 * columns // width
    middle_ns = (seen.times_ns[pairs.earlier] + seen.times_ns[pairs.later]) / 2
    return accumulate(pairs, levels[1] - levels[0], quarter, 4, middle_ns * 1e-9, sure)


def usable_pixels(window: Window, seen: ResampledFrames, declared: EventModel) -> NDArray[np.bool_]:
    """Return the pixels (n, h, w) of a window's frames bright enough, not saturated, and not declared hot."""
    darkest_dn = least_dn(window, declared)
    usable: NDArray[np.bool_] = np.empty(seen.uniform_dn.shape, np.bool_)
    for frame, marked in enumerate(usable):
        mark_usable(seen.edge_aware_dn[frame], seen.uniform_dn[frame], seen.error_dn[frame], darkest_dn, marked)
    usable.reshape(len(usable), -1)[:, hot_pixels(declared, seen)] = False
    return usable


def _shown(window: Window, seen: ResampledFrames, declared: EventModel) -> Shown:
    """Return what tells levels: the same pixels, looked at only where an event asks."""
    darkest_dn = least_dn(window, declared)
    return Shown(seen.edge_aware_dn, seen.uniform_dn, seen.error_dn, darkest_dn, hot_pixels(declared, seen))


def hot_pixels(declared: EventModel, seen: ResampledFrames) -> NDArray[np.int64]:
    """Return the declared hot pixels that lie on the sensor, row * width + column, sorted."""
    height, width = seen.uniform_dn.shape[1:]
    on_sensor = [
        row * width + column for column, row in declared.hot_pixels if 0 <= row < height and 0 <= column < width
    ]
    return np.unique(np.array(on_sensor, np.int64))


def least_dn(window: Window, declared: EventModel) -> float:
    """Return the light, in DN, below which a pixel tells no level."""
    if declared.model != "log":
        return _LINEAR_LEAST_DN
    # The standard deviation of rounding, uniform over a step, over the level is that of its logarithm.
    sigma_dn = 2 * ROUNDING_DN[window.facts.declared.transfer] / np.sqrt(12.0)
    contrast = ROUNDING_SHARE * min(declared.threshold_on, declared.threshold_off)
    return float(max(sigma_dn / contrast - declared.log_eps_dn, _DARKEST_DN))


def log_levels(luma_dn: NDArray[np.float64], declared: EventModel) -> NDArray[np.float64]:
    """Return L of luma in DN, NaN staying NaN."""
    level: NDArray[np.float64] = np.log(np.maximum(luma_dn + declared.log_eps_dn, 1e-3))
    return level

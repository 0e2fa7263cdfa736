"""How events answer to frames: what the checks of threshold, model and timing measure together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_stream import tick_ns
from fedora_qa.checks.event_view import ROUNDING_DN, SeenFrames, seen_frames, sensor_events
from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.event_fit import ResponseFit, fit_response
from fedora_qa.estimators.event_levels import LevelPairs, NormalBlocks, accumulate, concatenate, find_level_pairs
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

LONGEST_GAP_NS: Final = 20_000_000
"""Events farther apart do not tell a level: between them a pixel may go anywhere within its thresholds."""

ENOUGH_PAIRS: Final = 400
"""Where a window has more, those of the shortest gaps are taken."""
FEWEST_PAIRS: Final = 20
"""A window with fewer has no scale of its own for outliers."""

LINEAR_LEAST_TICKS: Final = 4
"""One event a rendered step hides how far the step went; pixels that fire every few steps are left out."""

ROUNDING_SHARE: Final = 0.1
"""Pixels so dark that rounding of the frame exceeds this share of the threshold are left out."""


@dataclass(frozen=True, slots=True)
class LevelSums:
    """Normal equations of a window in both domains and by both reconstructions, four blocks of the image each.

    ``overshoot`` is the mean of tick over gap: the share of a threshold that a pixel moves in a rendered step.
    """

    log_sharp: NormalBlocks
    log_even: NormalBlocks
    linear_sharp: NormalBlocks
    linear_even: NormalBlocks
    overshoot: float
    pairs: int


@dataclass(frozen=True, slots=True)
class Answer:
    """The fits of a file.

    Attributes
    ----------
    sharp, even
        In the declared domain, by the two reconstructions; the truth lies between them.
    other
        In the other domain.
    preference
        Mean and standard error of ln(residual / threshold) in the declared domain less that in the other, over blocks.
    overshoot
        As in ``LevelSums``.
    """

    sharp: ResponseFit
    even: ResponseFit
    other: ResponseFit | None
    preference: tuple[float, float]
    overshoot: float


def level_sums(window: Window) -> LevelSums | None:
    """Return the sums of a window; None where it shows too few levels."""
    return window.once("level_sums", lambda: _level_sums(window))


def _level_sums(window: Window) -> LevelSums | None:
    seen, declared = seen_frames(window), window.facts.declared.events
    if declared is None or len(seen) < 2:
        return None
    pairs = _pairs(window, seen, declared)
    if len(pairs) < FEWEST_PAIRS:
        return None
    height, width = seen.sharp_dn.shape[1:]
    rows, columns = np.divmod(pairs.pixels, width)
    block = 2 * (2 * rows // height) + 2 * columns // width

    middle_ns = (seen.times_ns[pairs.earlier] + seen.times_ns[pairs.later]) / 2

    def sums(levels: NDArray[np.float64]) -> NormalBlocks:
        return accumulate(pairs, pairs.change_of(levels), block, 4, middle_ns * 1e-9)

    log_sharp, log_even = (_log(luma, declared) for luma in (seen.sharp_dn, seen.even_dn))
    return LevelSums(
        sums(log_sharp),
        sums(log_even),
        sums(seen.sharp_dn),
        sums(seen.even_dn),
        float(np.mean(tick_ns(window.facts) * 1e-9 / pairs.gaps_s)),
        len(pairs),
    )


def _pairs(window: Window, seen: SeenFrames, declared: EventModel) -> LevelPairs:
    events = sensor_events(window)
    burst_ns = 2 * declared.refractory_us * NS_PER_US
    pairs = find_level_pairs(
        events.x,
        events.y,
        events.times_ns,
        events.p,
        seen.times_ns,
        _usable(seen, declared, ROUNDING_DN[window.facts.declared.transfer]),
        longest_gap_ns=LONGEST_GAP_NS,
        least_gap_ns=LINEAR_LEAST_TICKS * tick_ns(window.facts) if declared.model == "linear" else int(burst_ns),
        off_over_on=declared.threshold_off / declared.threshold_on,
    ).tightest(ENOUGH_PAIRS)
    if declared.leak_rate_hz > 0:
        # Leak gives brighter events that the level does not rise by: so many thresholds in the time between.
        elapsed_s = (seen.times_ns[pairs.later] - seen.times_ns[pairs.earlier]) * 1e-9
        pairs.regressors[:, 0] -= declared.leak_rate_hz * elapsed_s
    return pairs


def _usable(seen: SeenFrames, declared: EventModel, rounding_dn: float) -> NDArray[np.bool_]:
    """Return the pixels (n, h, w) bright enough, not saturated, and not declared hot."""
    least_dn = 4.0
    if declared.model == "log":
        # The standard deviation of rounding, uniform over a step, over the level is that of its logarithm.
        sigma_dn = 2 * rounding_dn / np.sqrt(12.0)
        contrast = ROUNDING_SHARE * min(declared.threshold_on, declared.threshold_off)
        least_dn = max(sigma_dn / contrast - declared.log_eps_dn, 0.5)
    usable: NDArray[np.bool_] = (np.minimum(seen.sharp_dn, seen.even_dn) >= least_dn) & np.isfinite(seen.error_dn)
    for column, row in declared.hot_pixels:
        if 0 <= row < usable.shape[1] and 0 <= column < usable.shape[2]:
            usable[:, row, column] = False
    return usable


def _log(luma_dn: NDArray[np.float64], declared: EventModel) -> NDArray[np.float64]:
    level: NDArray[np.float64] = np.log(np.maximum(luma_dn + declared.log_eps_dn, 1e-3))
    return level


def answer(state: Sequence[LevelSums], facts: Facts) -> Answer | str:
    """Fit the file, or say why it cannot be."""
    declared = facts.declared.events
    pairs = sum(sums.pairs for sums in state)
    too_few = (
        f"only {pairs} pairs of frames at which events tell a pixel's level (slow motion, little texture, or dark)"
    )
    if declared is None or not state:
        return too_few
    linear = declared.model == "linear"
    sharp, even = _concatenated(state, linear, "sharp"), _concatenated(state, linear, "even")
    other = _concatenated(state, not linear, "sharp")
    fits = fit_response(sharp), fit_response(even), fit_response(other)
    if fits[0] is None or fits[1] is None:
        return too_few
    least = min(fit.relative_sigma for fit in (fits[0], fits[2]) if fit is not None)
    if least > 1.0:
        return (
            f"events do not follow the frames at all: what is left is {least:.3g} thresholds "
            "(see event_response.orientation)"
        )
    overshoot = sum(sums.overshoot * sums.pairs for sums in state) / pairs
    return Answer(fits[0], fits[1], fits[2], _preference(sharp, other, fits[0], fits[2]), overshoot)


def _concatenated(state: Sequence[LevelSums], linear: bool, kind: str) -> NormalBlocks:
    return concatenate([getattr(sums, f"{'linear' if linear else 'log'}_{kind}") for sums in state])


def _preference(
    declared: NormalBlocks, other: NormalBlocks, fit: ResponseFit, other_fit: ResponseFit | None
) -> tuple[float, float]:
    """Compare residuals over thresholds, block by block."""
    if other_fit is None:
        return 0.0, float("inf")
    enough = (declared.counts >= FEWEST_PAIRS) & (other.counts >= FEWEST_PAIRS)
    if np.count_nonzero(enough) < 2:
        return float(np.log(fit.relative_sigma / other_fit.relative_sigma)), float("inf")
    difference = (np.log(fit.block_sigmas(declared)) - np.log(other_fit.block_sigmas(other)))[enough]
    scale = np.log(fit.threshold / other_fit.threshold)
    return float(difference.mean() - scale), float(difference.std(ddof=1) / np.sqrt(len(difference)))

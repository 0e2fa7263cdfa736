"""How events answer to frames: what a whole file shows to the checks of threshold, model and timing."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.events.footprint import LEFT_BY_SHARP
from fedora_qa.estimators.events.levels import NormalBlocks, concatenate
from fedora_qa.estimators.events.threshold_fit import Errors, ResponseFit, fit_response
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import why_frames_and_events_do_not_meet
from fedora_qa.views.level_samples import FEWEST_PAIRS, FOLLOWS, FoundOffset, LevelSums, level_sums

CAPTURE_RANGE_S: Final = 3e-3
"""Offsets beyond this are read too small by one fit, and spoil thresholds."""

LIMIT_ERRORS: Final = 5.0
"""Standard errors in a limit, nearly: two answers are compared by it, nothing is judged."""

Seen = LevelSums | FoundOffset
"""What a window shows, and what a second look at it shows."""


@dataclass(frozen=True, slots=True)
class Answer:
    """The fits of a file.

    Attributes
    ----------
    fit
        In the declared domain.
    model_errors
        Bounds on what the fit does not know: of footprints (how far the other reconstruction of frames moves it), of
        levels between events (how far straight lines move it), of regressors (attenuation).
    other
        The fit in the other domain.
    preference
        Mean and standard error of ln(residual / threshold) in the declared domain less that in the other, over blocks.
    overshoot
        As in ``LevelSums``.
    """

    fit: ResponseFit
    model_errors: Errors
    other: ResponseFit | None
    preference: tuple[float, float]
    overshoot: float


class LevelCheck(WindowCheck[Seen]):
    """A check of the levels that events tell at frame times."""

    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> Seen | None:
        """Sum the window's level samples."""
        return level_sums(window)

    def conclude(self, state: Sequence[Seen], facts: Facts) -> Observation:
        """Fit, and state."""
        declared = facts.declared.events
        found = answer(state, facts)
        if isinstance(found, str) or declared is None:
            return Observation(level_coverage(state), unobservable=str(found))
        return Observation(level_coverage(state), self.state(found, declared, facts))

    def state(self, found: Answer, declared: EventModel, facts: Facts) -> tuple[Statistic, ...]:
        """Turn the fits into measurements."""
        raise NotImplementedError


def level_coverage(state: Sequence[Seen]) -> Coverage:
    """Return how many pairs of level samples were used; there is no telling how many there might have been."""
    pairs = sum(one.pairs for one in state if isinstance(one, LevelSums))
    return Coverage(pairs, pairs, "level samples")


def answer(seen: Sequence[Seen], facts: Facts) -> Answer | str:
    """Fit the file, or say why it cannot be."""
    declared = facts.declared.events
    state = [one for one in seen if isinstance(one, LevelSums)]
    pairs = sum(sums.pairs for sums in state)
    too_few = (
        f"only {pairs} pairs of frames at which events tell a pixel's level (slow motion, little texture, or dark)"
    )
    if declared is None or not state:
        return too_few
    linear = declared.model == "linear"
    ours, theirs = ("linear", "log") if linear else ("log", "linear")
    blocks, other_blocks = _concatenated(state, f"{ours}_sharp"), _concatenated(state, f"{theirs}_sharp")
    fit, other = fit_response(blocks), fit_response(other_blocks)
    even, straight = (fit_response(_concatenated(state, name)) for name in (f"{ours}_even", "straight"))
    if fit is None or even is None or straight is None:
        return too_few
    least = min(fit.relative_sigma, other.relative_sigma if other is not None else fit.relative_sigma)
    if least > FOLLOWS:
        return (
            f"events do not follow the frames at all: what is left is {least:.3g} thresholds "
            "(see event_response.orientation)"
        )
    overshoot = sum(sums.overshoot * sums.pairs for sums in state) / pairs
    preference = _preference(blocks, other_blocks, fit, other)
    return Answer(fit, _model_errors(fit, even, straight), other, preference, overshoot)


def surer(alike: Answer | str, sure: Answer | str) -> Answer | str:
    """Return the answer that knows both thresholds better; ``alike`` where neither does.

    Where edges are sharp that is the one of sure pairs; where light flickers between events, no reading predicts the
    error, and the number of pairs counts. The choice sees errors and bounds only, never how far thresholds are off.
    """
    if isinstance(sure, str) or (not isinstance(alike, str) and _uncertainty(alike) <= _uncertainty(sure)):
        return alike
    return sure


def _uncertainty(found: Answer) -> float:
    errors, bounds = found.fit.standard_errors, found.model_errors
    of_both = bounds.threshold_on + bounds.threshold_off + LIMIT_ERRORS * (errors.threshold_on + errors.threshold_off)
    return float(of_both)


def _concatenated(state: Sequence[LevelSums], name: str) -> NormalBlocks:
    return concatenate([getattr(sums, name) for sums in state])


def _model_errors(fit: ResponseFit, even: ResponseFit, straight: ResponseFit) -> Errors:
    def bound(name: str) -> float:
        own = getattr(fit, name)
        moved = LEFT_BY_SHARP * abs(own - getattr(even, name)) + abs(own - getattr(straight, name))
        return float(moved + getattr(fit.attenuation, name))

    rate_bound = bound("delay_rate") if isfinite(fit.attenuation.delay_rate) else float("inf")
    return Errors(bound("threshold_on"), bound("threshold_off"), bound("delay_s"), rate_bound)


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

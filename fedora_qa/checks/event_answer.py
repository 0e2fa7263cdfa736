"""How events answer to frames: what a whole file shows to the checks of threshold, model and timing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_qa.checks.event_levels import FEWEST_PAIRS, FOLLOWS, FoundOffset, LevelSums, level_sums
from fedora_qa.checks.event_view import why_frames_and_events_do_not_meet
from fedora_qa.checks.protocol import Measured, Observation, WindowCheck
from fedora_qa.estimators.event_fit import ResponseFit, fit_response
from fedora_qa.estimators.event_levels import NormalBlocks, concatenate
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

Seen = LevelSums | FoundOffset
"""What a window shows, and what a second look at it shows."""


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

    def state(self, found: Answer, declared: EventModel, facts: Facts) -> tuple[Measured, ...]:
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
    sharp, even = _concatenated(state, linear, "sharp"), _concatenated(state, linear, "even")
    other = _concatenated(state, not linear, "sharp")
    fits = fit_response(sharp), fit_response(even), fit_response(other)
    if fits[0] is None or fits[1] is None:
        return too_few
    least = min(fit.relative_sigma for fit in (fits[0], fits[2]) if fit is not None)
    if least > FOLLOWS:
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

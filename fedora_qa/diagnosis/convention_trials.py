"""What the hypotheses of all convention trials have in common: how their extent supports them, and their rank.

A convention trial is tried on single fields of flow or pairs of depth frames that are off; a cause must explain all.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support

_SINGLE_FRAME_CAUSES: Final = ("swapped_frames", "frozen_frames", "dropped_samples", "teleport")
"""Faults of single frames: they spoil some fields or pairs, the others all, or all from some time on."""

_MOST: Final = 0.5
_FEW: Final = 0.25
"""Shares of fields or pairs that are off above which single frames, and below which the other faults, are less
likely."""

_LEAST_SUPPORT: Final = 0.3
"""Causes that remove less than this share of the deviation are not named."""

_COMPARABLE: Final = 0.6
"""Causes that explain less than this share of what the best one does are not rivals."""

_MOST_HYPOTHESES: Final = 6


def support_of_extent(cause: str, share_off: float) -> float:
    """Return the factor on the support of a cause for the share of fields, or of pairs, that are off.

    One wrong frame cannot spoil most of them, and a fault of all does not spare most.
    """
    unlikely = share_off > _MOST if cause in _SINGLE_FRAME_CAUSES else share_off < _FEW
    return support("convention_trials.unlikely_extent") if unlikely else 1.0


def most_probable(hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the hypotheses that explain enough, most probable first."""
    best = max((hypothesis.support for hypothesis in hypotheses), default=0.0)
    enough = [hypothesis for hypothesis in hypotheses if hypothesis.support >= max(_LEAST_SUPPORT, _COMPARABLE * best)]
    return tuple(sorted(enough, key=lambda hypothesis: -hypothesis.support)[:_MOST_HYPOTHESES])


def weakened(hypotheses: Iterable[Hypothesis], factor: float) -> list[Hypothesis]:
    """Return the hypotheses with their support multiplied by a factor of 1 at most."""
    return [replace(hypothesis, support=factor * hypothesis.support) for hypothesis in hypotheses]

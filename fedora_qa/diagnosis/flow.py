"""What the hypotheses of several checks have in common: how many of them are named."""

from collections.abc import Sequence
from typing import Final

from fedora_qa.diagnosis.hypothesis import Hypothesis

_LEAST_SUPPORT: Final = 0.3
"""Causes that remove less than this share of the deviation are not named."""

_COMPARABLE: Final = 0.6
"""Causes that explain less than this share of what the best one does are not rivals."""

_MOST_HYPOTHESES: Final = 6


def most_probable(hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the hypotheses that explain enough, most probable first."""
    best = max((hypothesis.support for hypothesis in hypotheses), default=0.0)
    enough = [hypothesis for hypothesis in hypotheses if hypothesis.support >= max(_LEAST_SUPPORT, _COMPARABLE * best)]
    return tuple(sorted(enough, key=lambda hypothesis: -hypothesis.support)[:_MOST_HYPOTHESES])

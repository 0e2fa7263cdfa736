"""Support of hypotheses of convention trials by their extent, and their rank.

Convention trials are made on single deviating fields of flow or pairs of depth frames; a cause must explain all of
these.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support

_SINGLE_FRAME_CAUSES: Final = ("swapped_frames", "frozen_frames", "dropped_samples", "teleport")
"""Faults of single frames: they affect some fields or pairs. Other faults affect all, or all from some time on."""

_MOST: Final = 0.5
_FEW: Final = 0.25
"""Shares of deviating fields or pairs: above the first, faults of single frames are less likely; below the second, the
other faults are less likely."""

_LEAST_SUPPORT: Final = 0.3
"""Causes that remove less than this share of the deviation are not named."""

_COMPARABLE: Final = 0.6
"""Least ratio of a cause's support to that of the best cause for the cause to be named."""

_MOST_HYPOTHESES: Final = 6


def support_of_extent(cause: str, share_off: float) -> float:
    """Return the factor on the support of a cause for the share of deviating fields or pairs.

    A fault of single frames cannot affect most of them, and a fault of all frames does not leave most of them
    unaffected.

    Parameters
    ----------
    cause
        As in ``fedora_qa.causes``.
    share_off
        Share of the compared fields, or pairs of depth frames, that deviate, 0 to 1.

    Returns
    -------
    float
        1 for a likely extent, less for an unlikely one.
    """
    unlikely = share_off > _MOST if cause in _SINGLE_FRAME_CAUSES else share_off < _FEW
    return support("convention_trials.unlikely_extent") if unlikely else 1.0


def most_probable(hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the hypotheses with enough support, best supported first, six at most."""
    best = max((hypothesis.support for hypothesis in hypotheses), default=0.0)
    enough = [hypothesis for hypothesis in hypotheses if hypothesis.support >= max(_LEAST_SUPPORT, _COMPARABLE * best)]
    return tuple(sorted(enough, key=lambda hypothesis: -hypothesis.support)[:_MOST_HYPOTHESES])


def weakened(hypotheses: Iterable[Hypothesis], factor: float) -> list[Hypothesis]:
    """Return the hypotheses with their support multiplied by a factor.

    Parameters
    ----------
    hypotheses
        Of any check.
    factor
        0 to 1.

    Returns
    -------
    list[Hypothesis]
        In the same order.
    """
    return [replace(hypothesis, support=factor * hypothesis.support) for hypothesis in hypotheses]

"""Events that agree with the frames in another orientation in a stretch of time, or in a part of the image."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Suspect
from fedora_qa.estimators.events.orientation import SYMMETRIES, Moments

Float64 = NDArray[np.float64]

LEAST_PREDICTED: Final = 0.3
"""Below this correlation the noise model of the prediction itself is in doubt."""

FEWEST_BLOCKS: Final = 100
"""A part with fewer blocks, over all its frames, correlates by chance."""

FEWEST_UPRIGHT: Final = 0.25
"""Share of the parts that must agree as declared, by half of what is due, for others to be the odd ones."""

DEPENDENT: Final = 3.0
"""Standard error of a correlation in those of independent blocks: blocks of one moving texture are not."""

_OF_FRAMES: Final = 0.85
"""Weight of mirrored frames beside that of mirrored events: more often it is the events."""


@dataclass(frozen=True, slots=True)
class Turned:
    """The part whose events gain most by another orientation.

    Attributes
    ----------
    parts
        (k,) those in which this orientation is the better one.
    rival
        The orientation, as ``others_of`` numbers them.
    declared, other
        Correlations of the worst part, as declared and in that orientation.
    standard_error
        Of their difference.
    compared
        Parts that were compared.
    """

    parts: NDArray[np.bool_]
    rival: int
    declared: float
    other: float
    standard_error: float
    compared: int


def others_of(correlations: Float64) -> Float64:
    """Return the correlations of the fifteen other orientations: the inverted ones first, then the upright ones."""
    upright = correlations[: len(SYMMETRIES)]
    return np.concatenate([-upright, upright[1:]])


def most_turned(parts: Sequence[Moments], noise: float) -> Turned | None:
    """Return the part (each under the eight symmetries) that gains most; None where few parts agree as declared.

    ``noise`` is the variance that events leave open in a block.
    """
    sums = np.array([part.sums for part in parts])
    counts = sums[:, 0, 0]
    signal = np.array([part.frame_variance() for part in parts])
    telling = (counts >= FEWEST_BLOCKS) & (sums[:, 0, 4] > 0)
    due = np.sqrt(signal / (signal + noise))
    telling &= due >= LEAST_PREDICTED
    declared = np.array([part.correlations()[0] for part in parts])
    upright = np.count_nonzero(telling & (declared > due / 2))
    if upright <= FEWEST_UPRIGHT * np.count_nonzero(telling):
        return None
    others = np.array([others_of(part.correlations()) for part in parts])
    gains = np.where(telling, others.max(axis=1) - declared, -np.inf)
    worst = int(np.argmax(gains))
    rival = int(np.argmax(others[worst]))
    alike = telling & (gains > 0) & (np.argmax(others, axis=1) == rival)
    alike[worst] = True
    return Turned(
        alike,
        rival,
        float(declared[worst]),
        float(others[worst, rival]),
        float(DEPENDENT / np.sqrt(counts[worst])),
        int(np.count_nonzero(telling)),
    )


def words_for(rival: int) -> str:
    """Return what was done to events that agree in this orientation."""
    inverted, (swap, left, up) = _undo(rival)
    said = (inverted, "of inverted polarity"), (swap, "with exchanged axes"), (left, "mirrored left to right")
    return " and ".join(words for true, words in (*said, (up, "mirrored top to bottom")) if true)


def causes_of(rival: int) -> tuple[Suspect, ...]:
    """Return the causes that make events agree in this orientation.

    Mirrored frames have the effect of mirrored events: other streams tell which.
    """
    inverted, (swap, left, up) = _undo(rival)
    causes = (("polarity_inverted", inverted), ("axes_swapped", swap), ("mirrored", left or up))
    of_events = tuple(Suspect(cause, "events", 0.95) for cause, true in causes if true)
    return (*of_events, Suspect("mirrored", "rgb", _OF_FRAMES)) if (left or up) and not swap else of_events


def _undo(rival: int) -> tuple[bool, tuple[bool, bool, bool]]:
    count = len(SYMMETRIES)
    return rival < count, SYMMETRIES[rival if rival < count else rival - count + 1]

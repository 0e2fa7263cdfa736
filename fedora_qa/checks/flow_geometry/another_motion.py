"""Fields that another motion of the camera would put right: noise, single poses, or a stream of another sequence."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import ANY_CAUSE, Suspect
from fedora_qa.views.flow_comparison import FieldError

Float64 = NDArray[np.float64]

_THERE_AND_BACK: Final = 2
"""Fields of a rate that a jump of the pose and its return spoil: those in whose interval they happen."""

_AS_WELL: Final = 0.9
"""What another pose explains, whatever is wrong with the poses explains a little less surely."""

_NOT_ONLY: Final = 0.6
"""Where it is no noise it may as well be the flow: whatever is wrong with the poses explains it so much less."""

_NOISE: Final = 0.9

_OTHER: Final = 0.8
"""A free motion has six numbers a field: a cause of one number that removes as much is meant first."""

_BY_CHANCE: Final = 5.4
"""Exceeded by one in a thousand of the squares of three axes over their expectation: chi-square of three degrees."""


def another_motion(off: Sequence[FieldError], flow: str, *, local: bool) -> list[Suspect]:
    """Suspect what would explain that a rigid correction makes the fields agree, with ``ANY_CAUSE`` of the pose last.

    Of few fields single poses are to blame; of most, noise that is not declared, or the poses or the flow of another
    sequence: the corrections tell which.
    """
    known = [field for field in off if field.free_pixels]
    if not known:
        return []
    left = np.median([np.sqrt(field.free_squares / field.free_pixels) for field in known])
    before = np.median([np.sqrt(field.squares / field.pixels) for field in known])
    weight = max(1.0 - float(left / before), 0.0)
    noise = as_noise(known)
    if local:
        shift_m = float(np.median([np.linalg.norm(field.free_twist[3:]) for field in known]))
        teleport = 0.95 * weight * min(_THERE_AND_BACK / len(off), 1.0)
        suspects = [Suspect("teleport", "pose", teleport, shift_m, "m"),
                    Suspect("frozen_frames", "pose", 0.9 * weight)]  # fmt: skip
    else:
        other = _OTHER * (1.0 - noise) * weight
        suspects = [Suspect("noise_misdeclared", "pose", _NOISE * noise * weight),
                    *(Suspect("other_sequence", stream, other) for stream in ("pose", flow))]  # fmt: skip
    as_well = _AS_WELL if local else _AS_WELL * max(noise, _NOT_ONLY)
    return [*suspects, Suspect(ANY_CAUSE, "pose", as_well * max(one.weight for one in suspects))]


def as_noise(fields: Sequence[FieldError]) -> float:
    """Return how far (0 to 1) the corrections of the fields of one rate look like noise of the poses.

    Each field ends at the pose where the next begins, so that noise cancels in the sum of corrections: it is as large
    as one of them, however many there are. What another motion asks for adds up.
    """
    twists = np.array([field.free_twist for field in fields if field.free_twist])
    parts = (twists[:, :3], twists[:, 3:]) if len(twists) else ()
    return min((min(1.0, _BY_CHANCE / max(_growth(part), 1.0)) for part in parts), default=1.0)


def _growth(corrections: Float64) -> float:
    """Return the square of the sum of corrections (n, 3) over their mean square."""
    square = float(np.mean(np.sum(corrections**2, axis=1)))
    return float(np.sum(corrections.sum(axis=0) ** 2)) / square if square > 0 else 0.0

"""Which camera is shifted, when pairs of cameras disagree: one shift of one camera must explain all pairs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Suspect
from fedora_qa.sequence.declared import Camera

Float64 = NDArray[np.float64]

_LIKELY: Final = 0.85
_CENTRES_LIKELY: Final = 0.75
"""A principal point that is declared wrongly in all cameras alike looks like one camera that is off: less is supposed
where nothing else tells them apart; flow against depth and pose does."""

_ENOUGH: Final = 0.3


@dataclass(frozen=True, slots=True)
class PairShift:
    """By how much the second camera's image is shifted against the first one's, (2,) px of the second; its error."""

    first: str
    second: str
    shift_px: Float64
    error_px: Float64


def shift_suspects(pairs: Sequence[PairShift], cameras: Mapping[str, Camera]) -> tuple[Suspect, ...]:
    """Weigh each camera by the share of all pairs' shifts, in errors, that its own shift explains."""
    focal_px = {name: float(camera.K[0, 0]) for name, camera in cameras.items()}
    involved = dict.fromkeys(name for pair in pairs for name in (pair.second, pair.first))
    suspects = []
    for name in involved:
        gains = [_gain_of(name, pair, focal_px) for pair in pairs]
        suspects.append(_suspect("spatial_offset", name, _LIKELY, gains, pairs))
    # The centre of each camera moves by the same number of its own pixels, the image of the second one back.
    moved = [1.0 - focal_px[pair.second] / focal_px[pair.first] for pair in pairs]
    if any(abs(one) > 1e-6 for one in moved):
        suspects.append(_suspect("intrinsics_centre", "metadata", _CENTRES_LIKELY, [-one for one in moved], pairs))
    enough = [suspect for suspect in suspects if suspect.weight >= _ENOUGH]
    return tuple(sorted(enough, key=lambda suspect: -suspect.weight))


def _gain_of(name: str, pair: PairShift, focal_px: Mapping[str, float]) -> float:
    """Return how far the pair's shift moves when the camera's image is shifted by 1 px of its own."""
    if name == pair.second:
        return 1.0
    return -focal_px[pair.second] / focal_px[pair.first] if name == pair.first else 0.0


def _suspect(cause: str, stream: str, likely: float, gains: Sequence[float], pairs: Sequence[PairShift]) -> Suspect:
    """Fit one shift to all pairs by least squares; its weight is the share of their squares that it explains."""
    precisions = np.array([1.0 / np.maximum(pair.error_px, 1e-3) ** 2 for pair in pairs])
    shifts = np.array([pair.shift_px for pair in pairs])
    gain = np.array(gains)[:, np.newaxis]
    information = (precisions * gain**2).sum(axis=0)
    projected = (precisions * gain * shifts).sum(axis=0)
    fitted = np.divide(projected, information, out=np.zeros(2), where=information > 0)
    everything = float((precisions * shifts**2).sum())
    explained = float((projected * fitted).sum()) / everything if everything > 0 else 0.0
    axis = int(np.argmax(np.abs(fitted)))
    error = float(information[axis]) ** -0.5 if information[axis] > 0 else None
    return Suspect(cause, stream, likely * explained, float(fitted[axis]), "px", error)

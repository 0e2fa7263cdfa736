"""Which causes would explain that flow disagrees with depth and pose, and of what size they would be."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from fedora_qa.causes import CAUSES
from fedora_qa.checks.flow_comparison import FieldError
from fedora_qa.checks.flow_hypotheses import Weighed
from fedora_qa.checks.protocol import Suspect
from fedora_qa.estimators.flow_motion_fit import Evidence
from fedora_qa.estimators.flow_templates import SMALL_FAULTS
from fedora_qa.sequence.declared import PoseModel

_ENOUGH: Final = 0.5
"""Causes that leave more than half of the deviation standing are not named."""

_CERTAIN: Final = 0.98
"""An inverse transform that leaves less than 2% of the deviation is believed before a fitted small fault is."""


def spreads_over(stream: str, off: Mapping[str, bool]) -> str:
    """Return ``flow`` where every rate is off, otherwise the one rate: all rates off alike are one fault."""
    return "flow" if all(off.values()) else stream


def geometry_suspects(
    stream: str,
    fields: Sequence[FieldError],
    weighed: Sequence[Weighed],
    off: Mapping[str, bool],
    noise: PoseModel | None,
) -> tuple[Suspect, ...]:
    """Return the suspects for one rate, most probable first, at most six."""
    flow = spreads_over(stream, off)
    gross = _gross([w for w in weighed if w.rate == stream], flow)
    small = _small([field.evidence for field in fields if field.evidence], flow)
    if gross and max(suspect.weight for suspect in gross) > _CERTAIN:
        small = [_weakened(suspect, 0.8) for suspect in small]
    suspects = [*gross, *small]
    suspects += _of_the_pose(fields, noise, max((s.weight for s in suspects), default=0.0))
    ordered = sorted((s for s in suspects if s.weight >= _ENOUGH), key=lambda suspect: -suspect.weight)
    return tuple(ordered[:6]) or (Suspect("unknown", flow, 0.1),)


def _gross(weighed: Sequence[Weighed], flow: str) -> list[Suspect]:
    """Average the weights of each inverse transform over the fields that it was tried on."""
    by_cause: dict[tuple[str, str], list[Weighed]] = {}
    for one in weighed:
        by_cause.setdefault((one.cause, one.stream), []).append(one)
    suspects = []
    for (cause, stream), group in by_cause.items():
        weight = float(np.mean([one.weight for one in group]))
        magnitude = group[0].magnitude
        where = flow if stream == "flow" else stream
        suspects.append(Suspect(cause, where, weight, magnitude, CAUSES[cause].unit if magnitude is not None else ""))
    return suspects


def _small(evidences: Sequence[Evidence], flow: str) -> list[Suspect]:
    """Fit each small fault alone to all fields together."""
    if not evidences:
        return []
    total = evidences[0]
    for evidence in evidences[1:]:
        total = total + evidence
    suspects = []
    for fault in SMALL_FAULTS:
        sizes, share = total.explained_by(fault.columns)
        weight = 1.0 - float(np.sqrt(np.clip(1.0 - share, 0.0, 1.0)))
        stream = flow if fault.stream == "flow" else fault.stream
        error = float(np.sqrt(1.0 / max(np.trace(total.matrix[fault.columns, fault.columns]), 1e-300)))
        suspects.append(Suspect(fault.cause, stream, weight, fault.size(sizes), fault.unit, error))
    return suspects


def _of_the_pose(fields: Sequence[FieldError], noise: PoseModel | None, best: float) -> list[Suspect]:
    """Suspect single poses, or their noise, where a rigid correction makes the field agree and nothing else does."""
    off = [field for field in fields if field.suspicion > 1 and field.free_pixels]
    if not off:
        return []
    remaining = [
        np.sqrt(field.free_squares / field.free_pixels) / max(np.sqrt(field.squares / field.pixels), 1e-300)
        for field in off
    ]
    if noise and (noise.position_sigma_m > 0 or noise.rotation_sigma_rad > 0):
        return [Suspect("noise_misdeclared", "pose", 0.6 * (1 - best))]
    weight = 1.0 - float(np.nanmedian(remaining)) if np.isfinite(remaining).any() else 0.0
    if 2 * len(off) <= len(fields):
        shift_m = float(np.nanmedian([field.free_shift_m for field in off]))
        return [Suspect("teleport", "pose", 0.95 * weight, shift_m, "m")]
    return [Suspect("noise_misdeclared", "pose", 0.9 * weight)]


def _weakened(suspect: Suspect, factor: float) -> Suspect:
    return Suspect(
        suspect.cause, suspect.stream, factor * suspect.weight, suspect.magnitude, suspect.unit, suspect.standard_error
    )

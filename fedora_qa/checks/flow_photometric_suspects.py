"""Which causes would explain that flow disagrees with the frames, and of what size they would be."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from fedora_qa.checks.flow_hypotheses import Weighed
from fedora_qa.checks.flow_residuals import FieldResidual
from fedora_qa.checks.flow_suspects import gain_suspect, gross_suspects, most_probable, spreads_over, weakened
from fedora_qa.checks.protocol import Suspect
from fedora_qa.estimators.flow_field_fit import GAIN, MEAN, SHIFT
from fedora_qa.estimators.flow_motion_fit import sum_of

_SAME_GAIN: Final = 0.1
"""Gains near the capture range are known no better."""


def photometric_suspects(
    stream: str,
    fields: Sequence[FieldResidual],
    weighed: Sequence[Weighed],
    off: Mapping[str, bool],
    fields_off: Sequence[FieldResidual],
) -> tuple[Suspect, ...]:
    """Return the suspects for one rate against the frames, most probable first."""
    flow = spreads_over(stream, off)
    local = 2 * len(fields_off) <= len(fields)
    gross = gross_suspects(stream, weighed, flow, local=local) if fields_off else []
    small = _small(fields, flow)
    if fields_off:
        small = weakened(small, 0.8)
    found = most_probable([*gross, *small])
    if not fields_off:
        return found or (Suspect("unknown", flow, 0.1),)
    if local:
        return found + tuple(Suspect(cause, "rgb", 0.3) for cause in ("frozen_frames", "swapped_frames"))
    return found or (Suspect("other_sequence", "rgb", 0.3), Suspect("other_sequence", flow, 0.3))


def _small(fields: Sequence[FieldResidual], flow: str) -> list[Suspect]:
    """Weigh gain, shift of an image, and a constant, by the share of what all templates together explain.

    A wrong focal length is almost a gain, a wrong principal point or mounting almost a constant.
    """
    evidences = [one.evidence for one in fields if one.evidence]
    if not evidences:
        return []
    total = sum_of(evidences)
    _, everything = total.explained_by(slice(None))
    if everything <= 0:
        return []
    gain, by_gain = total.explained_by(GAIN)
    shift, by_shift = total.explained_by(SHIFT)
    _, by_mean = total.explained_by(MEAN)
    error = float(total.matrix[GAIN, GAIN][0, 0]) ** -0.5
    size = float(np.copysign(np.linalg.norm(shift), shift[np.argmax(np.abs(shift))]))
    by_gain, by_shift, by_mean = (share / everything for share in (by_gain, by_shift, by_mean))
    return [
        gain_suspect(flow, float(gain[0]), error, by_gain, fields[0].interval.duration_s, _SAME_GAIN),
        Suspect("intrinsics_focal", flow, 0.9 * by_gain),
        Suspect("spatial_offset", "rgb", by_shift, size, "px"),
        Suspect("spatial_offset", flow, 0.9 * by_shift, -size, "px"),
        Suspect("extrinsic_rotation", flow, 0.7 * by_mean),
        Suspect("intrinsics_centre", flow, 0.7 * by_mean),
    ]

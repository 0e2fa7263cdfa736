"""Which causes would explain that flow disagrees with the frames, and of what size they would be."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Suspect
from fedora_qa.estimators.fitting.largest_deviate import chance_of_largest
from fedora_qa.estimators.flow.field_fit import (
    CENTRE,
    FOCAL,
    GAIN,
    MEAN,
    MOUNTING,
    OF_THE_FLOW,
    SHIFT,
    TIME,
    gain_of_true,
)
from fedora_qa.estimators.flow.motion_fit import Evidence, sum_of
from fedora_qa.estimators.flow.templates import CENTRE as CENTRE_FAULT
from fedora_qa.estimators.flow.templates import FOCAL as FOCAL_FAULT
from fedora_qa.estimators.flow.templates import MOUNTING as MOUNTING_FAULT
from fedora_qa.estimators.flow.templates import TIME_OFFSET
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_residuals import FieldResidual
from fedora_qa.views.flow_suspects import gain_suspect, gross_suspects, most_probable, spreads_over, weakened

_SAME_GAIN: Final = 0.1
"""Gains near the capture range are known no better."""


def photometric_suspects(
    stream: str,
    fields: Sequence[FieldResidual],
    weighed: Sequence[ConventionTrial],
    off: Mapping[str, bool],
    fields_off: Sequence[FieldResidual],
    noise: PoseModel | None,
) -> tuple[Suspect, ...]:
    """Return the suspects for one rate against the frames, most probable first."""
    flow = spreads_over(stream, off)
    share_off = 1.0 if _share_a_gain(fields) else len(fields_off) / len(fields)
    local = share_off <= 0.5
    gross = gross_suspects(stream, weighed, flow, share_off=share_off) if fields_off else []
    small = _small(fields, flow)
    if not fields_off:
        return most_probable(small) or (Suspect("unknown", flow, 0.1),)
    unmatched = sum(one.unmatched for one in fields) / max(sum(one.textured for one in fields), 1)
    small = weakened(small, 0.4 if local else 0.8 * (1 - unmatched))
    if noise and is_noisy(noise):
        small.append(Suspect("flow_from_noisy_pose", flow, 0.9 * _by_own_mean(fields) * _as_noise(fields)))
    others = tuple(Suspect(cause, flow if stream == "flow" else stream, _WEAK) for cause, stream in _OTHERS)
    return most_probable([*gross, *small]) + others


_LEAST_GAIN: Final = 0.005
"""Gains that fields may have in common without it telling anything."""

_GAIN_ERROR: Final = 0.05
"""Share of a gain by which linearisation and the derivative's taps misjudge it."""

_MS_PER_PERCENT_OF_S: Final = 10.0

_LINEAR: Final = 1 / 3
"""Share of the largest size of a fault up to which tiles, which capture 3 to 4 px, follow its template."""

_FEWER_NUMBERS: Final = 0.95
"""For each number that a fault takes: of two that explain as much the simpler one is meant."""

_LARGEST_SHIFT_PX: Final = 10.0
"""Beyond it a flow's slopes say little about its values."""

_WEAK: Final = 0.02
"""Joins a finding to a cause for which there is stronger evidence elsewhere."""

_OTHERS: Final = tuple(
    (cause, stream)
    for stream, causes in (
        ("flow", ("flow_gain", "flow_unit", "flow_sign", "flow_interval_shifted", "flow_rate_mixed", "axes_swapped",
                  "frame_convention", "mirrored", "spatial_offset", "swapped_frames", "frozen_frames",
                  "time_offset", "other_sequence")),
        ("rgb", ("mirrored", "spatial_offset", "time_offset", "swapped_frames", "frozen_frames", "other_sequence")),
    )
    for cause in causes
)  # fmt: skip
"""What leads the flow to other places than the frames."""


def _share_a_gain(fields: Sequence[FieldResidual]) -> bool:
    """Whether most fields have a gain in common, which single frames cannot give them."""
    evidences = [one.evidence for one in fields if one.evidence]
    gains = np.array([one.vector[GAIN][0] / max(one.matrix[GAIN, GAIN][0, 0], 1e-300) for one in evidences])
    if len(gains) < 2:
        return False
    middle = float(np.median(gains))
    error = 1.5 * float(np.median(np.abs(gains - middle))) * 1.25 / float(np.sqrt(len(gains)))
    return abs(middle) > max(_LEAST_GAIN, 5 * error)


def _by_own_mean(fields: Sequence[FieldResidual]) -> float:
    """Return how much of what is explained falls to each field's own mean, and to nothing that fields have in common.

    So pose noise has it. What they have in common is what one fault of all fields explains, whichever explains most.
    """
    evidences = [one.evidence for one in fields if one.evidence]
    if not evidences:
        return 0.0
    own = sum(one.explained_by(MEAN)[1] * one.total for one in evidences)
    total = sum_of(evidences)
    common = max(total.explained_by(fault)[1] for fault in (MEAN, GAIN, FOCAL, CENTRE, MOUNTING)) * total.total
    everything = sum(one.explained_by(OF_THE_FLOW)[1] * one.total for one in evidences)
    return max(own - common, 0.0) / everything if everything > 0 else 0.0


def _as_noise(fields: Sequence[FieldResidual]) -> float:
    """Return how probable the largest mean is as noise: that befalls all fields alike, frames out of place only few."""
    means_px, errors_px = (np.array([getattr(one, name) for one in fields]) for name in ("mean_px", "mean_error_px"))
    return chance_of_largest(means_px, errors_px)


def _small(fields: Sequence[FieldResidual], flow: str) -> list[Suspect]:
    """Weigh gain, shift of an image, and what geometry tells, by the share of what all templates together explain."""
    evidences = [one.evidence for one in fields if one.evidence]
    if not evidences:
        return []
    total = sum_of(evidences)
    _, everything = total.explained_by(slice(None))
    if everything <= 0:
        return []
    gain, by_gain = total.explained_by(GAIN)
    shift, by_shift = total.explained_by(SHIFT)
    error = max(float(total.matrix[GAIN, GAIN][0, 0]), 1e-300) ** -0.5
    of_true, slope = gain_of_true(float(gain[0]))
    size = float(np.copysign(np.linalg.norm(shift), shift[np.argmax(np.abs(shift))]))
    by_gain, by_shift = by_gain / everything, by_shift / everything
    if abs(size) > _LARGEST_SHIFT_PX:
        by_shift = 0.0
    error = float(np.hypot(slope * error, _GAIN_ERROR * of_true))
    return [
        gain_suspect(flow, of_true, error, 0.95 * by_gain, fields[0].interval.duration_s, _SAME_GAIN),
        Suspect("spatial_offset", "rgb", by_shift, size, "px"),
        Suspect("spatial_offset", flow, 0.9 * by_shift, -size, "px"),
        *_geometric(total, everything, flow, fields[0].interval.duration_s),
    ]


def _geometric(total: Evidence, everything: float, flow: str, interval_s: float) -> list[Suspect]:
    """Weigh focal length, principal point, mounting and time, where depth and motion gave their templates."""
    ms_per_percent = _MS_PER_PERCENT_OF_S * interval_s
    suspects = []
    for fault, columns, scale in ((FOCAL_FAULT, FOCAL, 1.0), (CENTRE_FAULT, CENTRE, 1.0),
                                  (MOUNTING_FAULT, MOUNTING, 1.0), (TIME_OFFSET, TIME, ms_per_percent)):  # fmt: skip
        sizes, share = total.explained_by(columns)
        size = fault.size(scale * sizes)
        if abs(size) <= _LINEAR * fault.largest:
            simple = _FEWER_NUMBERS ** len(sizes)
            suspects.append(Suspect(fault.parameter, flow, simple * share / everything, size, fault.unit))
    return suspects

"""What the suspects of all flow checks have in common: streams, gross faults, and gains that have a name."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fedora_qa.causes import CAUSES
from fedora_qa.checks.protocol import Suspect
from fedora_qa.views.flow_conventions import ConventionTrial

_ENOUGH: Final = 0.3
"""Causes that remove less than this share of the deviation are not named."""

_COMPARABLE: Final = 0.6
"""Causes that explain less than this share of what the best one does are not rivals."""

_MOST_SUSPECTS: Final = 6

_OF_FRAMES: Final = ("swapped_frames", "frozen_frames", "dropped_samples", "teleport")
"""Faults of single frames: they spoil some fields, the others all, or all from some time on."""

_MOST: Final = 0.5
_FEW: Final = 0.25
"""Shares of fields that are off above which single frames, and below which the other faults, are half as likely."""


DISPLACEMENTS: Final = tuple(
    (cause, stream, 0.1)
    for stream, causes in (
        ("flow", ("flow_interval_shifted", "flow_rate_mixed", "mirrored", "spatial_offset", "frozen_frames",
                  "swapped_frames", "time_offset", "other_sequence")),
        ("depth", ("mirrored", "spatial_offset", "frozen_frames", "swapped_frames", "time_offset", "other_sequence")),
    )
    for cause in causes
)  # fmt: skip
"""Causes that put flow and depth out of register: cause, stream, and a weight that joins them to stronger evidence."""


def spreads_over(stream: str, off: Mapping[str, bool]) -> str:
    """Return ``flow`` where every rate is off, otherwise the one rate: all rates off alike are one fault."""
    return "flow" if all(off.values()) else stream


def gross_suspects(stream: str, weighed: Sequence[ConventionTrial], flow: str, *, share_off: float) -> list[Suspect]:
    """Average the weights of each inverse transform over the fields of one rate that it was tried on.

    ``share_off`` is the share of fields that are off. Where these are most, faults of single frames lose half of their
    weight; where they are few, the other faults do.
    """
    by_cause: dict[tuple[str, str], list[ConventionTrial]] = {}
    for one in weighed:
        if one.rate == stream:
            by_cause.setdefault((one.transform, one.stream), []).append(one)
    suspects = []
    for (cause, fault_stream), group in by_cause.items():
        weight = float(np.mean([one.removed_share for one in group]))
        unlikely = share_off > _MOST if cause in _OF_FRAMES else share_off < _FEW
        weight *= 0.5 if unlikely else 1.0
        magnitude = max(group, key=lambda one: one.removed_share).magnitude
        unit = "" if magnitude is None else CAUSES[cause].unit
        suspects.append(Suspect(cause, flow if fault_stream == "flow" else fault_stream, weight, magnitude, unit))
    return suspects


def gain_suspect(
    flow: str, gain: float, error: float | None, weight: float, seconds: float, tolerance: float
) -> Suspect:
    """Name a gain: minus two is a sign, the reciprocal of the interval or the interval itself is another unit."""
    factor = 1 + gain
    if abs(factor + 1) < tolerance:
        return Suspect("flow_sign", flow, weight)
    for unit_factor in (seconds, 1 / seconds) if seconds > 0 else ():
        if abs(factor / unit_factor - 1) < tolerance:
            return Suspect("flow_unit", flow, weight, unit_factor, "1")
    return Suspect("flow_gain", flow, weight, 100 * gain, "percent", None if error is None else 100 * error)


def most_probable(suspects: Sequence[Suspect]) -> tuple[Suspect, ...]:
    """Return the suspects that explain enough, most probable first."""
    best = max((suspect.weight for suspect in suspects), default=0.0)
    enough = [suspect for suspect in suspects if suspect.weight >= max(_ENOUGH, _COMPARABLE * best)]
    return tuple(sorted(enough, key=lambda suspect: -suspect.weight)[:_MOST_SUSPECTS])


def weakened(suspects: Iterable[Suspect], factor: float) -> list[Suspect]:
    """Return the suspects with less weight."""
    return [replace(suspect, weight=factor * suspect.weight) for suspect in suspects]

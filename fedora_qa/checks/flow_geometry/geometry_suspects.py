"""Which causes would explain that flow disagrees with depth and pose, and of what size they would be."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.flow_geometry.another_motion import another_motion
from fedora_qa.checks.flow_geometry.chosen_numbers import is_chosen
from fedora_qa.checks.protocol import ANY_CAUSE, Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.flow.motion_fit import Evidence, sum_of
from fedora_qa.estimators.flow.templates import FLOW_GAIN, SMALL_FAULTS, TIME_OFFSET, SmallFault
from fedora_qa.sequence.declared import Declared, PoseModel
from fedora_qa.views.flow_comparison import FieldError, is_noisy
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_suspects import gain_suspect, gross_suspects, most_probable, spreads_over, weakened

_CERTAIN: Final = 0.98
"""An inverse transform that leaves less than 2% of the deviation is believed before a fitted small fault is."""

_SAME_GAIN: Final = 0.02

_TOUCHED: Final = 0.1
_HARDLY: Final = 0.5
_NEARLY_ALL: Final = 0.9
"""What is declared holds for all fields; so many of them show it, where some hardly move."""

_OF_IMAGES: Final = ("flow", "depth")
"""Where a part of the image is off, what is wrong lies in the image: poses and cameras spoil all of it."""

_PPM_PER_MS_PER_S, _PERCENT_PER_MS_PER_S = 1e3, 0.1

_LINEAR_GAIN: Final = 0.1
"""Where the pose may be corrected it follows a larger gain, and the template no longer tells its size."""


def geometry_suspects(
    stream: str,
    fields: Sequence[FieldError],
    weighed: Sequence[ConventionTrial],
    off: Mapping[str, bool],
    declared: Declared,
) -> tuple[Suspect, ...]:
    """Return the suspects for one rate, most probable first."""
    noise = declared.pose
    flow = spreads_over(stream, off)
    fields_off = [field for field in fields if field.suspicion > 1]
    share_off = _share_touched(fields, fields_off)
    local = share_off <= 0.5
    gross = gross_suspects(stream, weighed, flow, share_off=share_off)
    for repeating in ("flow", "depth"):
        repeated = sum(field.repeats == repeating for field in fields_off)
        if repeated:
            where = flow if repeating == "flow" else repeating
            weight = (1.0 if local else 0.9) * repeated / len(fields_off)  # others are not frozen, and off
            gross.append(Suspect("frozen_frames", where, weight, float(repeated), "samples"))
    small = _small(fields, flow, noise)
    in_part = 2 * sum(field.region is not None for field in fields_off) > len(fields_off)
    if in_part:
        gross = [suspect for suspect in gross if suspect.cause != "other_sequence"]
        small = [suspect for suspect in small if suspect.stream in (*_OF_IMAGES, flow)]
    small = [replace(one, weight=one.weight * _trust(one, declared, share_off)) for one in small]
    if max((suspect.weight for suspect in gross if suspect.cause != "flow_gain"), default=0.0) > _CERTAIN:
        small = weakened(small, 0.8)
    moved = [] if is_noisy(noise) or in_part else another_motion(fields_off, flow, local=local)
    any_pose = tuple(one for one in moved if one.cause == ANY_CAUSE)
    named = most_probable([*gross, *small, *(one for one in moved if one not in any_pose)])
    return (named or (Suspect("unknown", flow, 0.1),)) + any_pose


def _share_touched(fields: Sequence[FieldError], fields_off: Sequence[FieldError]) -> float:
    """Return the share of fields that a fault touches: off, or as far from honest as a smaller motion would make them.

    Honest fields lie a hundred times within their bounds; those that move little show a fault that all fields share by
    less than the typical one that is off, but not by much less.
    """
    if not fields_off:
        return 0.0
    typical = float(np.median([field.suspicion for field in fields_off]))
    return sum(field.suspicion > _TOUCHED * typical for field in fields) / len(fields)


def _trust(suspect: Suspect, declared: Declared, share_off: float) -> float:
    """Return how likely a declaration is to be wrong: numbers that were chosen are not, nor what holds for a while."""
    if suspect.stream != "metadata":
        return 1.0
    chosen = is_chosen(declared.cameras["depth"], suspect.cause)
    return _HARDLY if chosen or share_off < _NEARLY_ALL else 1.0


def _small(fields: Sequence[FieldError], flow: str, noise: PoseModel | None) -> list[Suspect]:
    """Fit each small fault alone to all fields together; weigh it by the share of the deviation in px it removes."""
    evidences = [field.evidence for field in fields if field.evidence]
    if not evidences:
        return []
    total = sum_of(evidences)
    suspects = []
    for fault in SMALL_FAULTS:
        sizes, weight, error = _fit(total, fault.columns)
        if np.abs(sizes).max() > fault.largest:
            continue
        if fault.cause == "flow_gain":
            gain, seconds = 0.01 * float(sizes[0]), fields[0].interval.duration_s
            if is_noisy(noise) and abs(gain) > _LINEAR_GAIN:
                continue
            weight *= _in_common(total, gain)
            suspects.append(gain_suspect(flow, gain, 0.01 * error, weight, seconds, _SAME_GAIN))
            continue
        suspects += _of_every_stream(fault, flow, weight, fault.size(sizes), error)
    return suspects + _drift(fields, flow)


def _in_common(total: Evidence, gain: float) -> float:
    """Return the correlation of the stored flow with the recomputed one, which a gain leaves at 1.

    Where the recomputed flow is far too large, any other is nearly none of it: a gain of -100% then removes nearly all
    of the deviation and explains nothing. Where only rounding is left, no flow at all is a gain.
    """
    column = FLOW_GAIN.columns.start
    recomputed = float(total.matrix[column, column]) * 100.0**2
    if recomputed <= 0:  # all that a gain does, poses of unknown noise do as well
        return 1.0
    common = (1 + gain) ** 2 * recomputed
    left = max(total.total - gain**2 * recomputed, 0.0)
    return float(np.sqrt(min((common + total.count) / max(left + common, 1.0), 1.0)))


def _drift(fields: Sequence[FieldError], flow: str) -> list[Suspect]:
    """Fit an offset of stamps that grows with time, from none at the file's origin.

    Beside the offset at its middle, an interval is then too long or too short, which is a gain.
    """
    known = [(field, field.evidence) for field in fields if field.evidence]
    grown = []
    for field, one in known:
        direction = np.zeros(len(one.vector))
        direction[TIME_OFFSET.columns] = (field.interval.start_ns + field.interval.end_ns) / (2 * NS_PER_S)
        direction[FLOW_GAIN.columns] = _PERCENT_PER_MS_PER_S
        grown.append(one.along(direction))
    ms_per_s, weight, error = _fit(sum_of(grown), slice(None))
    last_s = max(field.interval.end_ns for field, _ in known) / NS_PER_S
    if abs(ms_per_s[0]) * last_s > TIME_OFFSET.largest:
        return []
    drift = replace(TIME_OFFSET, cause="clock_rate", unit="ppm")
    return _of_every_stream(drift, flow, weight, _PPM_PER_MS_PER_S * float(ms_per_s[0]), _PPM_PER_MS_PER_S * error)


def _of_every_stream(fault: SmallFault, flow: str, weight: float, size: float, error: float) -> list[Suspect]:
    suspects = []
    for stream, likeliness in fault.streams:
        where, signed = flow if stream == "flow" else stream, -size if stream in fault.opposite else size
        suspects.append(Suspect(fault.cause, where, likeliness * weight, signed, fault.unit, error))
    return suspects


def _fit(total: Evidence, columns: slice) -> tuple[NDArray[np.float64], float, float]:
    """Return a fault's fitted components, its weight, and the error of its size: larger where much is left."""
    sizes, share = total.explained_by(columns)
    left = float(np.clip(1.0 - share, 0.0, 1.0))
    error = _error(total, columns) * max(1.0, float(np.sqrt(left * total.total / total.count)))
    return sizes, 1.0 - float(np.sqrt(left)), error


def _error(total: Evidence, columns: slice) -> float:
    """Return the standard error of a fault's size from rounding alone: the largest of its components'."""
    information = np.diag(total.matrix[columns, columns])
    return float(np.max(1.0 / np.sqrt(np.maximum(information, 1e-300))))

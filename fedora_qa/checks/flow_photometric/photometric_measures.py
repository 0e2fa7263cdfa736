"""The worst of a rate's fields and tiles against the frames, whether they are off, and the unit that frames infer."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from fedora_qa.checks.flow_photometric.photometric_rates import MATTERS_PX, RateEstimate, scales_of
from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.estimators.flow.field_fit import GAIN, MEAN
from fedora_qa.estimators.flow.motion_fit import Evidence
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_intervals import place
from fedora_qa.views.flow_residuals import UNMATCHED, FieldResidual

_FIELD_BIAS_PX: Final = 0.02
"""The same for a single field, whose few tiles may all be of one steep texture: four times as much."""

_TILE_BIAS_PX: Final = 0.2
"""The same for a single tile: unresolved detail at grazing angles, and surfaces that meet without an edge of depth.

Neither is in the tile's own error, which takes what is left over for noise. Ray-cast scenes of every kind err by up to
0.1 px beyond it in one tile of ten thousand (three scenes, 50 000 tiles); twice that is allowed.
"""

_UNMATCHED_SHARE: Final = 0.1
"""Share of one field's tiles that may show something else: reflections, shadows, occlusions without depth."""

_MANY_TILES: Final = 10
"""Textured tiles from which on a field's own share of unmatched ones means something."""

_SURELY: Final = 6.0
"""Standard errors beyond which a closer look is worth its time; judgement draws its own line."""

_ANOTHER_UNIT: Final = 0.5
"""Gains of less than half are no other unit."""


def place_measurements(
    stream: str, fields: Sequence[FieldResidual], facts: Facts, suspects: tuple[Suspect, ...]
) -> list[Statistic]:
    """State the worst of a rate: tiles that do not match, the worst field, the worst tile."""
    measured = [_unmatched(stream, fields, facts, suspects)]
    masked_by_depth = [one for one in fields if one.least_matched_tile is not None]
    if masked_by_depth:
        measured.append(_least_matched(stream, masked_by_depth, facts, suspects))
    known = [one for one in fields if one.worst_tile is not None]
    if known:
        measured += [_worst_field(stream, known, facts, suspects), _worst_tile(stream, known, facts, suspects)]
    return measured


def _worst_field(stream: str, known: Sequence[FieldResidual], facts: Facts, suspects: tuple[Suspect, ...]) -> Statistic:
    errors_px = [scale * max(one.mean_error_px) for one, scale in zip(known, scales_of(known), strict=True)]
    worst, error_px = max(
        zip(known, errors_px, strict=True), key=lambda one: _mean_px(one[0]) / (_field_bias_px(one[0]) + one[1])
    )
    return Statistic(
        name=f"{stream} worst_field",
        value=_mean_px(worst),
        unit="px",
        standard_error=error_px,
        model_error_bound=_field_bias_px(worst),
        side="upper",
        material=MATTERS_PX,
        tests=len(known),
        statement=f"Field {worst.interval.row} of {stream} carries frame {worst.frame} "
        f"{_mean_px(worst):.3g} px past the frame at its end.",
        code="flow_photometric.residual.field",
        where=place(facts, (worst.interval, worst.interval), frame=worst.frame),
        suspects=suspects,
    )


def _worst_tile(stream: str, known: Sequence[FieldResidual], facts: Facts, suspects: tuple[Suspect, ...]) -> Statistic:
    worst = max(known, key=lambda one: (one.worst_px - _TILE_BIAS_PX) / one.worst_error_px)
    return Statistic(
        name=f"{stream} worst_tile",
        value=worst.worst_px,
        unit="px",
        standard_error=worst.worst_error_px,
        model_error_bound=_TILE_BIAS_PX,
        side="upper",
        tests=sum(one.textured for one in known),
        statement=f"Field {worst.interval.row} of {stream} is off by {worst.worst_px:.3g} px in one tile.",
        code="flow_photometric.residual.tile",
        where=place(facts, (worst.interval, worst.interval), frame=worst.frame, tile=worst.worst_tile),
        suspects=suspects,
    )


def _least_matched(
    stream: str, fields: Sequence[FieldResidual], facts: Facts, suspects: tuple[Suspect, ...]
) -> Statistic:
    """State the tile that matches least: the worst tile in px is sought among those that match."""
    worst = max(fields, key=lambda one: one.least_matched)
    return Statistic(
        name=f"{stream} least_matched_tile",
        value=100 * worst.least_matched,
        unit="percent",
        standard_error=0.0,
        model_error_bound=100 * UNMATCHED,
        side="upper",
        statement=f"In field {worst.interval.row} of {stream} the flow leads one tile to another place: "
        f"{100 * worst.least_matched:.0f}% of its contrast is left unexplained.",
        code="flow_photometric.residual.tile_match",
        where=place(facts, (worst.interval, worst.interval), frame=worst.frame, tile=worst.least_matched_tile),
        suspects=suspects,
    )


def _unmatched(stream: str, fields: Sequence[FieldResidual], facts: Facts, suspects: tuple[Suspect, ...]) -> Statistic:
    """State the worst field's share of tiles that do not match; fields of few tiles count together only."""
    worst = max(fields, key=_unmatched_share)
    together = sum(one.unmatched for one in fields) / sum(one.textured for one in fields)
    share = max(_unmatched_share(worst), together)
    off = [one for one in fields if one.unmatched_share > _UNMATCHED_SHARE]
    where = place(facts, (off[0].interval, off[-1].interval), frame=worst.frame) if off else Where(stream=stream)
    return Statistic(
        name=f"{stream} unmatched_tiles",
        value=100 * share,
        unit="percent",
        standard_error=0.0,
        model_error_bound=100 * _UNMATCHED_SHARE,
        side="upper",
        statement=f"In {len(off)} of {len(fields)} fields of {stream} the flow leads to other places than the frames: "
        f"up to {100 * share:.0f}% of a field's tiles do not match.",
        code="flow_photometric.residual.unmatched",
        where=where,
        suspects=suspects,
    )


def _unmatched_share(one: FieldResidual) -> float:
    return one.unmatched_share if one.textured >= _MANY_TILES else 0.0


def _field_bias_px(one: FieldResidual) -> float:
    return _FIELD_BIAS_PX * one.mean_locking


def _mean_px(one: FieldResidual) -> float:
    return float(np.hypot(*one.mean_px))


def suspicion(one: FieldResidual) -> float:
    """Return a number above 1 for a field that is surely off: unmatched tiles, or a mean or gain beyond its error."""
    unmatched = max(one.unmatched_share / _UNMATCHED_SHARE, one.least_matched / UNMATCHED)
    if one.evidence is None:
        return unmatched
    error_px = max(one.mean_error_px)
    by_mean = _mean_px(one) / (_field_bias_px(one) + _SURELY * error_px)
    gain_px, gain_error_px = _gain_px(one.evidence)
    by_gain = gain_px / (_FIELD_BIAS_PX + _SURELY * max(gain_error_px, error_px))
    return max(unmatched, by_mean, by_gain)


def _gain_px(evidence: Evidence) -> tuple[float, float]:
    """Return a field's gain and its formal error in px of its typical flow."""
    information = max(float(evidence.matrix[GAIN, GAIN][0, 0]), 1e-300)
    typical_flow_px = float(np.sqrt(2 * information / np.trace(evidence.matrix[MEAN, MEAN])))
    gain = abs(float(evidence.vector[GAIN][0])) / information
    return gain * typical_flow_px, typical_flow_px / float(np.sqrt(information))


def is_off(rate: RateEstimate | None, fields: Sequence[FieldResidual]) -> bool:
    """Whether a rate is surely off, in all its fields or in some."""
    if any(suspicion(one) > 1 for one in fields) or rate is None:
        return True
    known = [rate.mean, rate.gain, *([rate.geometric] if rate.geometric else [])]
    return any(bool(np.any(np.abs(one.sizes) > one.biases + _SURELY * one.errors)) for one in known)


def inferred_unit(
    rates: Mapping[str, RateEstimate | None],
    groups: Mapping[str, Sequence[FieldResidual]],
    weighed: Sequence[ConventionTrial],
) -> str:
    """Return the unit that the frames give the flow: px, px/s, px s; unknown where they give none, or several."""
    units = {_unit_of(stream, rates[stream], groups[stream], weighed) for stream in groups} - {None}
    return units.pop() or "unknown" if len(units) == 1 else "unknown"


def _unit_of(
    stream: str, rate: RateEstimate | None, fields: Sequence[FieldResidual], weighed: Sequence[ConventionTrial]
) -> str | None:
    """Return the unit of one rate; None where its gain is not known well enough to tell."""
    best = max((one for one in weighed if one.rate == stream), key=lambda one: one.removed_share, default=None)
    if best is not None and best.transform == "flow_unit" and best.magnitude is not None:
        return "px/s" if best.magnitude > 1 else "px s"
    unmatched = sum(one.unmatched for one in fields) / sum(one.textured for one in fields)
    if rate is None or unmatched > _UNMATCHED_SHARE:
        return "unknown"
    if _SURELY * rate.gain.errors[0] > _ANOTHER_UNIT:
        return None
    return "px" if abs(rate.gain.sizes[0]) < _ANOTHER_UNIT else "unknown"

"""Flow against the frames: warp the next frame back, and see how far it still lies from the one before."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.flow_candidates import residual_maps, weigh_candidates
from fedora_qa.checks.flow_frames import frame_pair, optics_of
from fedora_qa.checks.flow_hypotheses import Weighed
from fedora_qa.checks.flow_intervals import owned_intervals, place
from fedora_qa.checks.flow_photometric_suspects import photometric_suspects
from fedora_qa.checks.flow_residuals import FieldResidual, measure_field
from fedora_qa.checks.protocol import Measured, Observation, Suspect, WindowCheck
from fedora_qa.estimators.flow_field_fit import GAIN, MEAN, gain_of_true, robust_errors
from fedora_qa.estimators.flow_motion_fit import Evidence, sum_of
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

_CLOSER_LOOKS: Final = 8

_BIAS_PX: Final = 0.005
"""Largest mean bias of the estimate on scenes whose amplitude spectrum falls as 1/frequency or faster (edges do).

The spline read adds at most 0.0005 px there (measured over all fractions of a pixel, see its test). Detail that the
camera itself does not resolve moves the wrong way: its energy at w - 2 pi over that at w is ((2 pi - w)/w)^-4 for a
box-shaped pixel, 0.13% at 1 rad/px, and shifts the estimate by at most 0.0013 px per such frequency; 0.005 px leaves
room for steeper mixes. For white noise, which no scene is, it would be 0.03 px.
"""

_FIELD_BIAS_PX: Final = 0.02
"""The same for a single field, whose few tiles do not average over fractions of a pixel: four times as much."""

_TILE_BIAS_PX: Final = 0.1
"""The same for a single tile: unresolved detail dominates where a surface is seen at a grazing angle."""

_UNMATCHED_SHARE: Final = 0.1
"""Share of one field's tiles that may show something else: reflections, shadows, occlusions without depth."""

_MANY_TILES: Final = 10
"""Textured tiles from which on a field's own share of unmatched ones means something."""

_SURELY: Final = 6.0
"""Standard errors beyond which a closer look is worth its time; judgement draws its own line."""

_MATTERS_PX: Final = 0.5
_MATTERS_PERCENT: Final = 10.0


@dataclass(frozen=True, slots=True)
class WindowResiduals:
    """The fields that a window owns, those without frames, and what a closer look showed."""

    window: int
    fields: tuple[FieldResidual, ...] = ()
    without_frames: int = 0
    weighed: tuple[Weighed, ...] = ()
    maps: Mapping[str, NDArray[Any]] = field(default_factory=dict)


class Residual(WindowCheck[WindowResiduals]):
    """Does the stored flow carry each frame onto the next?

    Tiles of 32 px are sampled (their share and every how many-th field are stated by the effort). The frame at the end
    of a field's interval is warped back by the stored flow, and the flow's error in each tile follows from least
    squares on the difference to the frame at its start, with a gain and a bias of brightness left free. The errors, in
    pixels, are gathered by field and by rate: their mean (u, v), the gain of the flow, the worst field, the worst tile;
    and the share of tiles that do not match at all, which is how errors beyond the capture range of 3 to 4 px show.

    Pixels are used where depth and pose (never the flow under test) say that both frames show the same point, 3 px away
    from edges of the depth; without depth or pose, away from breaks of the flow. Tiles count where the noise floor of
    8-bit frames alone would let their flow be known to 0.1 px: night and plain walls do not, and are reported as such.

    Standard errors are the larger of the formal ones and the spread over fields (over tiles, for one field), for
    Student's distribution. Allowances cover detail that pixels do not resolve.

    It cannot see an error along the edges of a scene that has texture in one direction only, and less of it in slow
    fields: the gain needs motion. Method: B. D. Lucas, T. Kanade, IJCAI (1981).
    """

    name = "flow_photometric.residual"
    needs = ("flow", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Say why frames cannot be mapped onto the flow's grid."""
        optics = optics_of(facts)
        return optics if isinstance(optics, str) else ""

    def measure(self, window: Window) -> WindowResiduals | None:
        """Measure every field that the window owns and the plan wants."""
        optics = optics_of(window.facts)
        if isinstance(optics, str):
            return None
        fields: list[FieldResidual] = []
        without_frames = 0
        for stream in window.facts.flow_streams:
            for interval in owned_intervals(window, stream):
                if interval.row % window.sampling.field_stride:
                    continue
                frames = frame_pair(window, optics, interval)
                measured = measure_field(frames, interval, window.sampling.tile_share) if frames else None
                without_frames += frames is None
                fields += [measured] if measured else []
        return WindowResiduals(window.span.index, tuple(fields), without_frames)

    def look_again_at(self, state: list[WindowResiduals], facts: Facts) -> tuple[int, ...]:
        """Ask for the windows of the worst fields, the worst first."""
        worst = sorted((-max((_suspicion(one) for one in w.fields), default=0.0), w.window) for w in state)
        return tuple(window for suspicion, window in worst[:_CLOSER_LOOKS] if suspicion < -1)

    def look_again(self, state: list[WindowResiduals], window: Window) -> None:
        """Try inverse transforms on the window's worst field of each rate, and draw the worst of all."""
        optics = optics_of(window.facts)
        fields = [one for w in state if w.window == window.span.index for one in w.fields]
        off = sorted((one for one in fields if _suspicion(one) > 1), key=_suspicion, reverse=True)
        if isinstance(optics, str) or not off:
            return
        weighed: list[Weighed] = []
        for stream in window.facts.flow_streams:
            of_stream = [one for one in off if one.interval.stream == stream]
            if of_stream:
                weighed += weigh_candidates(window, optics, of_stream[0].interval)
        maps = residual_maps(window, optics, off[0].interval)
        state.append(WindowResiduals(window.span.index, weighed=tuple(weighed), maps=maps))

    def conclude(self, state: Sequence[WindowResiduals], facts: Facts) -> Observation:
        """State the residual flow of each rate."""
        fields = [one for w in state for one in w.fields]
        fields.sort(key=lambda one: (one.interval.stream, one.interval.row))
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        coverage = Coverage(len(fields), total, "flow fields")
        telling = {s: [f for f in fields if f.interval.stream == s and f.textured] for s in facts.flow_streams}
        telling = {stream: group for stream, group in telling.items() if group}
        if not telling:
            return Observation(coverage, unobservable=_why_none(state, fields))
        weighed = [one for w in state for one in w.weighed]
        rates = {stream: _estimate(group) for stream, group in telling.items()}
        off = {stream: _is_off(rates[stream], group) for stream, group in telling.items()}
        measurements: list[Measured] = []
        for stream, group in telling.items():
            suspects = photometric_suspects(stream, group, weighed, off, [one for one in group if _suspicion(one) > 1])
            measurements += _of_rate(stream, group, rates[stream], facts, suspects)
            measurements += _worst_places(stream, group, facts, suspects)
        maps = next((w.maps for w in state if w.maps), {})
        return Observation(
            coverage,
            tuple(measurements),
            evidence=maps,
            titles={name: name.replace("_", " ") for name in maps},
            inferred={"flow_unit": _inferred_unit(telling, weighed)},
        )


@dataclass(frozen=True, slots=True)
class _RateEstimate:
    """All fields of one rate together: mean residual (u, v) in px and gain (1 is 100%), with standard errors.

    ``gain_bias`` is the gain that a mean bias of ``_BIAS_PX`` would feign.
    """

    mean_px: NDArray[np.float64]
    mean_errors_px: NDArray[np.float64]
    gain: float
    gain_error: float
    gain_bias: float


def _estimate(fields: Sequence[FieldResidual]) -> _RateEstimate | None:
    evidences = [one.evidence for one in fields if one.evidence]
    if not evidences:
        return None
    total = sum_of(evidences)
    mean_px, mean_errors_px = _solved(evidences, total, MEAN)
    of_stored, error = _solved(evidences, total, GAIN)
    largest = float(np.linalg.eigvalsh(total.matrix[MEAN, MEAN])[-1])
    gain_bias = _BIAS_PX * float(np.sqrt(largest / max(total.matrix[GAIN, GAIN][0, 0], 1e-300)))
    gain, slope = gain_of_true(float(of_stored[0]))
    return _RateEstimate(mean_px, mean_errors_px, gain, slope * float(error[0]), slope * gain_bias)


def _solved(
    evidences: Sequence[Evidence], total: Evidence, columns: slice
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit some templates alone to all fields; fields are the blocks of the empirical error."""
    matrix = total.matrix[columns, columns]
    matrix = matrix + np.eye(len(matrix)) * (1e-12 * np.trace(matrix) + 1e-12)
    sizes = np.linalg.solve(matrix, total.vector[columns])
    scores = np.array([one.vector[columns] - one.matrix[columns, columns] @ sizes for one in evidences])
    return sizes, robust_errors(matrix, scores)


def _of_rate(
    stream: str,
    fields: Sequence[FieldResidual],
    rate: _RateEstimate | None,
    facts: Facts,
    suspects: tuple[Suspect, ...],
) -> list[Measured]:
    if rate is None:
        return []
    where = place(facts, (fields[0].interval, fields[-1].interval))
    measured = [
        Measured(
            name=f"{stream} residual_{axis}",
            value=float(rate.mean_px[i]),
            unit="px",
            standard_error=float(rate.mean_errors_px[i]),
            allowance=_BIAS_PX,
            matters=_MATTERS_PX,
            statement=f"{stream} carries frames {abs(rate.mean_px[i]):.3g} px too far "
            f"{('right', 'down')[i] if rate.mean_px[i] > 0 else ('left', 'up')[i]} on average.",
            code="flow_photometric.residual.mean",
            where=where,
            suspects=suspects,
        )
        for i, axis in enumerate("uv")
    ]
    percent = 100 * rate.gain
    measured.append(
        Measured(
            name=f"{stream} gain",
            value=percent,
            unit="percent",
            standard_error=100 * rate.gain_error,
            allowance=100 * rate.gain_bias,
            matters=_MATTERS_PERCENT,
            statement=f"{stream} is {abs(percent):.3g}% too {'large' if percent > 0 else 'small'} for the frames.",
            code="flow_photometric.residual.gain",
            where=where,
            suspects=suspects,
        )
    )
    return measured


def _worst_places(
    stream: str, fields: Sequence[FieldResidual], facts: Facts, suspects: tuple[Suspect, ...]
) -> list[Measured]:
    measured = [_unmatched(stream, fields, facts, suspects)]
    known = [one for one in fields if one.worst_tile is not None]
    if not known:
        return measured
    field_off = max(known, key=lambda one: _mean_px(one) / (_FIELD_BIAS_PX + max(one.mean_error_px)))
    tile_off = max(known, key=lambda one: (one.worst_px - _TILE_BIAS_PX) / one.worst_error_px)
    measured.append(
        Measured(
            name=f"{stream} worst_field",
            value=_mean_px(field_off),
            unit="px",
            standard_error=max(field_off.mean_error_px),
            allowance=_FIELD_BIAS_PX,
            side="upper",
            matters=_MATTERS_PX,
            tests=len(known),
            statement=f"Field {field_off.interval.row} of {stream} carries frame {field_off.frame} "
            f"{_mean_px(field_off):.3g} px past the frame at its end.",
            code="flow_photometric.residual.field",
            where=place(facts, (field_off.interval, field_off.interval), frame=field_off.frame),
            suspects=suspects,
        )
    )
    measured.append(
        Measured(
            name=f"{stream} worst_tile",
            value=tile_off.worst_px,
            unit="px",
            standard_error=tile_off.worst_error_px,
            allowance=_TILE_BIAS_PX,
            side="upper",
            tests=sum(one.textured for one in known),
            statement=f"Field {tile_off.interval.row} of {stream} is off by {tile_off.worst_px:.3g} px in one tile.",
            code="flow_photometric.residual.tile",
            where=place(facts, (tile_off.interval, tile_off.interval), frame=tile_off.frame, tile=tile_off.worst_tile),
            suspects=suspects,
        )
    )
    return measured


def _unmatched(stream: str, fields: Sequence[FieldResidual], facts: Facts, suspects: tuple[Suspect, ...]) -> Measured:
    """State the worst field's share of tiles that do not match; fields of few tiles count together only."""
    worst = max(fields, key=_unmatched_share)
    together = sum(one.unmatched for one in fields) / sum(one.textured for one in fields)
    share = max(_unmatched_share(worst), together)
    off = [one for one in fields if one.unmatched_share > _UNMATCHED_SHARE]
    where = place(facts, (off[0].interval, off[-1].interval), frame=worst.frame) if off else Where(stream=stream)
    return Measured(
        name=f"{stream} unmatched_tiles",
        value=100 * share,
        unit="percent",
        standard_error=0.0,
        allowance=100 * _UNMATCHED_SHARE,
        side="upper",
        statement=f"In {len(off)} of {len(fields)} fields of {stream} the flow leads to other places than the frames: "
        f"up to {100 * share:.0f}% of a field's tiles do not match.",
        code="flow_photometric.residual.unmatched",
        where=where,
        suspects=suspects,
    )


def _unmatched_share(one: FieldResidual) -> float:
    return one.unmatched_share if one.textured >= _MANY_TILES else 0.0


def _mean_px(one: FieldResidual) -> float:
    return float(np.hypot(*one.mean_px))


def _suspicion(one: FieldResidual) -> float:
    """Return a number above 1 for a field that is surely off: unmatched tiles, or a mean or gain beyond its error."""
    worst = one.unmatched_share / _UNMATCHED_SHARE
    if one.evidence is not None:
        matrix, vector = one.evidence.matrix, one.evidence.vector
        information = matrix[GAIN, GAIN][0, 0]
        typical_flow_px = float(np.sqrt(2 * information / np.trace(matrix[MEAN, MEAN])))
        by_gain_px = typical_flow_px * abs(float(vector[GAIN][0])) / max(information, 1e-300)
        gain_error_px = max(typical_flow_px / max(float(np.sqrt(information)), 1e-150), max(one.mean_error_px))
        worst = max(
            worst,
            _mean_px(one) / (_FIELD_BIAS_PX + _SURELY * max(one.mean_error_px)),
            by_gain_px / (_FIELD_BIAS_PX + _SURELY * gain_error_px),
        )
    return worst


def _is_off(rate: _RateEstimate | None, fields: Sequence[FieldResidual]) -> bool:
    if any(_suspicion(one) > 1 for one in fields) or rate is None:
        return True
    by_mean = np.abs(rate.mean_px) > _BIAS_PX + _SURELY * rate.mean_errors_px
    return bool(by_mean.any()) or abs(rate.gain) > rate.gain_bias + _SURELY * rate.gain_error


def _why_none(state: Sequence[WindowResiduals], fields: Sequence[FieldResidual]) -> str:
    without = sum(w.without_frames for w in state)
    if fields:
        tiles = sum(one.tiles for one in fields)
        return (
            f"none of {tiles} tiles in {len(fields)} fields has texture enough to tell its flow to 0.1 px "
            "where depth and pose let both frames show the same"
        )
    if without:
        return f"of {without} fields none starts and ends on the stamp of a colour frame"
    return "there is no field of flow whose image holds a tile of 32 px"


def _inferred_unit(telling: Mapping[str, Sequence[FieldResidual]], weighed: Sequence[Weighed]) -> str:
    """Return the unit that the frames give the flow."""
    fields = [one for group in telling.values() for one in group]
    if sum(one.unmatched for one in fields) <= _UNMATCHED_SHARE * sum(one.textured for one in fields):
        return "px"
    best = max(weighed, key=lambda one: one.weight, default=None)
    if best is None or best.cause != "flow_unit" or best.magnitude is None:
        return "unknown"
    return "px/s" if best.magnitude > 1 else "px s"

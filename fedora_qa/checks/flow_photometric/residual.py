"""Flow against the frames: the next frame is warped back, and its remaining displacement is estimated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.flow_photometric.rate_statistics import (
    SIGNIFICANT_SIGMAS,
    UNMATCHED_SHARE,
    deviates,
    deviation_ratio,
    fit_fields,
    mean_statistics,
    rate_features,
    worst_statistics,
)
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.flow.rate_fit import RateFit
from fedora_qa.estimators.flow.tiles import TileGrid
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_intervals import Interval, owned_intervals
from fedora_qa.views.flow_residuals import FEWEST_TILES, FieldResidual, measure_field, sample_tiles, textured
from fedora_qa.views.frame_conventions import try_transforms
from fedora_qa.views.warped_frames import Optics, frame_pair, optics_of

_MOST_FOLLOW_UPS: Final = 8

_ANOTHER_UNIT: Final = 0.5
"""Gains of less than half are no other unit."""


@dataclass(frozen=True, slots=True)
class WindowResiduals:
    """The fields that a window owns, the number of those without frames, and the trials and maps of a follow-up."""

    window: int
    fields: tuple[FieldResidual, ...] = ()
    without_frames: int = 0
    trials: tuple[ConventionTrial, ...] = ()
    maps: Mapping[str, tuple[NDArray[Any], str]] = field(default_factory=dict)


class FlowPhotometricResidual(WindowCheck[WindowResiduals]):
    """Does the stored flow carry each frame onto the next?

    The frame at the end of a field's interval is warped back by the stored flow. How far it still lies from the frame
    at its start is measured in tiles of 32 px, as a flow in px with its covariance. All tiles of a rate then give its
    mean (u, v), its gain, and what it would take of focal length, principal point, mounting, time and roll to explain
    it; the worst field, the worst tile, and the share of tiles that do not match at all are stated besides.

    Why it matters
    --------------
    A network learns flow from frames or events. Flow that is a hundredth too large, half a pixel to the side, in
    another unit or an interval late trains it to be wrong, and neither depth nor pose need show it.

    How
    ---
    Tiles and fields are sampled by shares that the effort states. In each tile least squares fit the flow's error,
    with gain and bias of brightness left free; beyond 0.5 px once more about the corrected flow. Pixels count where
    depth and pose (never the flow under test) say that both frames show the same point, 4 px away from edges of the
    depth; without depth or pose, away from breaks of the flow. After an alarm, faults are undone one by one (sign,
    axes, mirrors, units, gains, neighbouring intervals, other rates, frames out of order) on the tiles that do not
    match, and the share of the mismatch that this removes weighs them.

    Noise model
    -----------
    Formal errors follow from what each tile's fit leaves. They are multiplied by how far the tiles of a rate really
    scatter (Birge's ratio, its median over fields); where fields scatter more than one honest rate in a hundred,
    their own spread is taken, widened after Student. Consecutive fields share a frame, whose rounding enters with
    opposite signs: z of a mean spreads less than 1. Allowance: aliases and interpolation err by at most 0.005 px
    times sin(2 pi flow), of which only the mean over the tiles counts (0.02 px for a field, 0.2 px for a tile at
    grazing angles).

    Cannot see
    ----------
    Errors along the edges of a scene with texture in one direction only; much of a gain in slow fields. Tiles in
    which rounding or noise hides 0.1 px, or whose ground is grazed, do not count: walls and nights may be not
    observable. Where poses are noisy, time is not fitted.

    Sources
    -------
    B. D. Lucas, T. Kanade, IJCAI (1981) 674; S. Birchfield (1997) for the symmetric gradient; M. Unser, IEEE Signal
    Process. Mag. 16 (1999) 22 for the spline; J. Westerweel, Meas. Sci. Technol. 8 (1997) 1379 for peak locking; R.
    T. Birge, Phys. Rev. 40 (1932) 207. Derivations: `estimators/flow/residual.py`, `field_fit.py`.
    """

    name = "flow_photometric.residual"
    needs = ("flow", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Return why frames cannot be mapped onto the flow's grid; empty where they can."""
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
                # Strides count from the first row of the file, so that the sample does not depend on the windows.
                if interval.row % window.sampling.field_stride:
                    continue
                frames = frame_pair(window, optics, interval)
                measured = measure_field(frames, interval, window.sampling.tile_share) if frames else None
                without_frames += frames is None
                fields += [measured] if measured else []
        return WindowResiduals(window.span.index, tuple(fields), without_frames)

    def follow_up_windows(self, state: list[WindowResiduals], facts: Facts) -> tuple[int, ...]:
        """Return the windows of the worst fields, the worst first."""
        worst = sorted((-max(map(deviation_ratio, w.fields), default=0.0), w.window) for w in state)
        return tuple(window for negative_ratio, window in worst[:_MOST_FOLLOW_UPS] if negative_ratio < -1)

    def follow_up(self, state: list[WindowResiduals], window: Window) -> None:
        """Try inverse transforms on the window's worst field of each rate, and map the worst of all."""
        optics = optics_of(window.facts)
        fields = [residual for w in state if w.window == window.span.index for residual in w.fields]
        deviating = sorted(
            (residual for residual in fields if deviation_ratio(residual) > 1), key=deviation_ratio, reverse=True
        )
        if isinstance(optics, str) or not deviating:
            return
        trials: list[ConventionTrial] = []
        for stream in window.facts.flow_streams:
            # Sorted: the first field of a rate is its worst.
            of_stream = [residual for residual in deviating if residual.interval.stream == stream]
            if of_stream:
                trials += try_transforms(window, optics, of_stream[0].interval)
        maps = _residual_maps(window, optics, deviating[0].interval)
        state.append(WindowResiduals(window.span.index, trials=tuple(trials), maps=maps))

    def conclude(self, state: Sequence[WindowResiduals], facts: Facts) -> Observation:
        """State the residual flow of each rate."""
        fields = [residual for w in state for residual in w.fields]
        fields.sort(key=lambda residual: (residual.interval.stream, residual.interval.row))
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        coverage = Coverage(len(fields), total, "flow fields")
        informative = [residual for residual in fields if residual.textured >= FEWEST_TILES]
        by_rate = {
            stream: [residual for residual in informative if residual.interval.stream == stream]
            for stream in facts.flow_streams
        }
        by_rate = {stream: of_rate for stream, of_rate in by_rate.items() if of_rate}
        if not by_rate:
            return Observation(coverage, unobservable=_why_none(state, fields))
        trials = [trial for w in state for trial in w.trials]
        rates = {stream: fit_fields(of_rate) for stream, of_rate in by_rate.items()}
        deviates_by_rate = {stream: deviates(rates[stream], of_rate) for stream, of_rate in by_rate.items()}
        statistics: list[Statistic] = []
        for stream, of_rate in by_rate.items():
            of_trials = tuple(trial for trial in trials if trial.rate == stream)
            features = (*rate_features(stream, of_rate, deviates_by_rate), *of_trials)
            statistics += mean_statistics(stream, of_rate, rates[stream], facts, features)
            statistics += worst_statistics(stream, of_rate, facts, features)
        maps = next((w.maps for w in state if w.maps), {})
        # The unit is known where all rates that determine one agree.
        units = {_inferred_unit(stream, rates[stream], of_rate, trials) for stream, of_rate in by_rate.items()} - {None}
        return Observation(
            coverage,
            tuple(statistics),
            evidence={name: values for name, (values, _) in maps.items()},
            titles={name: title for name, (_, title) in maps.items()},
            inferred={"flow_unit": units.pop() or "unknown" if len(units) == 1 else "unknown"},
        )


def _inferred_unit(
    stream: str, rate: RateFit | None, fields: Sequence[FieldResidual], trials: Sequence[ConventionTrial]
) -> str | None:
    """Return the unit that the frames give one rate: px, px/s, px s, unknown; None where its gain is too uncertain."""
    best = max((trial for trial in trials if trial.rate == stream), key=lambda trial: trial.removed_share, default=None)
    if best is not None and best.transform == "rescaled_by_interval" and best.magnitude is not None:
        return "px/s" if best.magnitude > 1 else "px s"
    unmatched_share = sum(residual.unmatched for residual in fields) / sum(residual.textured for residual in fields)
    if rate is None or unmatched_share > UNMATCHED_SHARE:
        return "unknown"
    # A gain that is uncertain by half does not exclude another unit.
    if SIGNIFICANT_SIGMAS * rate.gain.errors[0] > _ANOTHER_UNIT:
        return None
    return "px" if abs(rate.gain.sizes[0]) < _ANOTHER_UNIT else "unknown"


def _residual_maps(window: Window, optics: Optics, interval: Interval) -> Mapping[str, tuple[NDArray[Any], str]]:
    """Return maps of one field, each with its title: residual u and v in px, and the unexplained share, by tile.

    Tiles without texture are NaN.
    """
    frames = frame_pair(window, optics, interval)
    # All tiles, in place of the share that the effort samples: the map is evidence for a reader.
    tiles = sample_tiles(frames, interval, 1.0) if frames else None
    if frames is None or tiles is None:
        return {}
    residuals = tiles.residuals(frames)
    stored = window.flow_px(interval.stream, interval.row)
    # Tiles are listed row by row: the number of distinct left edges is that of the columns.
    columns = len(np.unique(TileGrid.of(*stored.shape[:2]).origins[:, 0]))
    is_textured = textured(residuals)
    of_field = f"of tiles of 32 px, worst field (row {interval.row} of {interval.stream})"
    by_tile = {
        "residual_u_px": (residuals.flow_errors_px[:, 0], f"Residual flow u (right) {of_field} [px]"),
        "residual_v_px": (residuals.flow_errors_px[:, 1], f"Residual flow v (down) {of_field} [px]"),
        "unexplained_share": (residuals.unexplained, f"Share of the contrast left unexplained {of_field} [1]"),
    }
    return {
        name: (np.where(is_textured, values, np.nan).reshape(-1, columns).astype(np.float32), title)
        for name, (values, title) in by_tile.items()
    }


def _why_none(state: Sequence[WindowResiduals], fields: Sequence[FieldResidual]) -> str:
    without_frames = sum(w.without_frames for w in state)
    if fields:
        tiles = sum(residual.tiles for residual in fields)
        return (
            f"too few of {tiles} tiles in {len(fields)} fields have texture enough to tell its flow to 0.1 px "
            "where depth and pose let both frames show the same"
        )
    if without_frames:
        return f"of {without_frames} fields none starts and ends on the stamp of a colour frame"
    return "there is no field of flow whose image holds a tile of 32 px"

"""Flow against the frames: the next frame is warped back, and the remaining displacement is estimated."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
from fedora_qa.conventions import MS_PER_S, NS_PER_S
from fedora_qa.estimators.flow.residual import TileGrid, patches_of
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_axes import FLOW_AXES
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_intervals import Interval, interval_at, owned_intervals
from fedora_qa.views.flow_residuals import (
    FEWEST_TILES,
    LARGEST_FLOW_PX,
    UNMATCHED,
    FieldResidual,
    FieldTiles,
    measure_field,
    sample_tiles,
    textured,
)
from fedora_qa.views.warped_frames import FramePair, Optics, frame_pair, optics_of

Float32 = NDArray[np.float32]

_MOST_FOLLOW_UPS: Final = 8

_ANOTHER_UNIT: Final = 0.5
"""Least deviation of a gain from 1 for another unit."""

_TILE_STEP: Final = 4
"""Step between the tiles of a trial where tiles deviate in the whole image."""

_FEWEST_UNMATCHED: Final = 2
_TWO_CHANGES: Final = 0.95
"""Factor on the removed share of a mirrored grid with mirrored vectors: mirrored frames, a single change, have the same
effect.

Of two transforms with one effect, that with fewer changes is preferred.
"""

_GAINS: Final = (2.0, 1.5, 0.67, 0.5)
_FRAME_SHIFTS: Final = (-2, -1, 1, 2)


@dataclass(frozen=True, slots=True)
class WindowResiduals:
    """The fields of a window.

    Attributes
    ----------
    window
        Number of the window.
    fields
        Measured fields.
    without_frames
        Number of fields without a colour frame at both ends.
    trials, maps
        Trials and maps of a follow-up; a map has a title.
    """

    window: int
    fields: tuple[FieldResidual, ...] = ()
    without_frames: int = 0
    trials: tuple[ConventionTrial, ...] = ()
    maps: Mapping[str, tuple[NDArray[Any], str]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _FrameTransform:
    """Flow and frames after an inverse transform of one stream; None where the file does not hold what it needs."""

    name: str
    stream: str
    flow_px: Float32 | None
    frames: FramePair | None
    magnitude: float | None = None
    factor: float = 1.0


class FlowPhotometricResidual(WindowCheck[WindowResiduals]):
    """Does the stored flow warp each frame onto the next?

    The frame at the end of a field's interval is warped back by the stored flow. Its remaining displacement against the
    frame at the start is estimated in tiles of 32 px, as a residual flow in px with its covariance. All tiles of a rate
    together give the mean (u, v), the gain, and the errors of focal length, principal point, mounting, time and roll
    that would explain the residual. The worst field, the worst tile, and the share of tiles that do not match at all
    are stated too.

    Why it matters
    --------------
    A network learns flow from frames or events. Flow that is 1% too large, shifted by half a pixel, in another unit or
    late by an interval makes it learn this error, and depth and pose need not contain it.

    How
    ---
    The effort determines the sampled shares of tiles and fields. In each tile, the error of the flow is estimated by
    least squares, with gain and bias of brightness as free parameters; above 0.5 px it is estimated once more from the
    corrected flow. Pixels are used where both frames show the same point by depth and pose (never by the flow under
    test), 4 px away from edges of the depth; without depth or pose, away from discontinuities of the flow, and of
    places to which different flow leads: two sources of one target are an occlusion. After an alarm, inverse transforms
    (sign, axes, mirrors, units, gains, neighbouring intervals, other rates, frames in a wrong order) are applied one by
    one to the tiles that do not match. The share of the mismatch that a transform removes is
    its weight.

    Noise model
    -----------
    Formal errors follow from the residuals of each tile's fit. They are multiplied by the scatter of a rate's tiles
    over their formal errors (Birge's ratio, its median over fields). Where fields scatter more than those of one
    correct rate in a hundred, their own spread is used, widened by Student's distribution. Consecutive fields share a
    frame, whose rounding has opposite signs in both: the spread of z of a mean is below 1. The model error bound covers
    aliasing and interpolation: at most 0.005 px times sin(2 pi flow), of which the mean over the tiles counts (0.02 px
    for a field, 0.2 px for a tile at grazing angles).

    Cannot detect
    -------------
    Without depth, what a surface hides that the first frame does not show: up to a tenth of the tiles need not match.
    Errors along the edges of a scene whose texture has one direction. All but large gains in slow fields. Tiles in
    which rounding or noise hides 0.1 px, or whose ground has a grazing angle, are not used: walls and night scenes may
    be not observable. Where poses are noisy, time is not fitted.

    Sources
    -------
    B. D. Lucas, T. Kanade, IJCAI (1981) 674; S. Birchfield (1997) for the symmetric gradient; M. Unser, IEEE Signal
    Process. Mag. 16 (1999) 22 for the spline; J. Westerweel, Meas. Sci. Technol. 8 (1997) 1379 for peak locking; R. T.
    Birge, Phys. Rev. 40 (1932) 207. Derivations: `estimators/flow/residual.py`, `field_fit.py`.
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
        # The tiles that were read, of all tiles of all fields; fields are counted where none has a tile.
        tiles_of_field = max((residual.tiles_of_field for residual in fields), default=0)
        coverage = Coverage(sum(residual.tiles for residual in fields), total * tiles_of_field, "tiles of flow fields")
        if not tiles_of_field:
            coverage = Coverage(0, total, "flow fields")
        informative = [residual for residual in fields if residual.textured >= FEWEST_TILES]
        by_rate = {
            stream: [residual for residual in informative if residual.interval.stream == stream]
            for stream in facts.flow_streams
        }
        by_rate = {stream: of_rate for stream, of_rate in by_rate.items() if of_rate}
        if not by_rate:
            without_frames = sum(w.without_frames for w in state)
            reason = "no field of flow contains a tile of 32 px"
            if fields:
                tiles = sum(residual.tiles for residual in fields)
                reason = (
                    f"too few of {tiles} tiles in {len(fields)} fields have enough texture for an error of 0.1 px, and "
                    "show the same points in both frames by depth and pose"
                )
            elif without_frames:
                reason = f"none of {without_frames} fields starts and ends at timestamps of colour frames"
            return Observation(coverage, unobservable=reason)
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
        # The unit of each rate whose gain is certain enough, by the frames; it is known where all of them agree.
        units: set[str] = set()
        for stream, of_rate in by_rate.items():
            rate = rates[stream]
            best = max(
                (trial for trial in trials if trial.rate == stream),
                key=lambda trial: trial.removed_share,
                default=None,
            )
            unmatched_share = sum(residual.unmatched for residual in of_rate) / sum(
                residual.textured for residual in of_rate
            )
            if best is not None and best.transform == "rescaled_by_interval" and best.magnitude is not None:
                units.add("px/s" if best.magnitude > 1 else "px s")
            elif rate is None or unmatched_share > UNMATCHED_SHARE:
                units.add("unknown")
            # A gain that is uncertain by half does not exclude another unit.
            elif not SIGNIFICANT_SIGMAS * rate.gain.errors[0] > _ANOTHER_UNIT:
                units.add("px" if abs(rate.gain.sizes[0]) < _ANOTHER_UNIT else "unknown")
        return Observation(
            coverage,
            tuple(statistics),
            evidence={name: values for name, (values, _) in maps.items()},
            titles={name: title for name, (_, title) in maps.items()},
            inferred={"flow_unit": units.pop() if len(units) == 1 else "unknown"},
        )


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
        "unexplained_share": (residuals.unexplained, f"Share of the contrast that is not explained {of_field} [1]"),
    }
    return {
        name: (np.where(is_textured, values, np.nan).reshape(-1, columns).astype(np.float32), title)
        for name, (values, title) in by_tile.items()
    }


def try_transforms(window: Window, optics: Optics, interval: Interval) -> list[ConventionTrial]:
    """Apply every inverse transform to one field.

    Parameters
    ----------
    optics
        Mapping of the flow's grid to colour frames.
    interval
        Of the field.

    Returns
    -------
    list[ConventionTrial]
        For each transform and stream the variant that removes the largest share of the mismatch; empty where the field
        has too few textured tiles.
    """
    frames = frame_pair(window, optics, interval)
    tiles = sample_tiles(frames, interval, 1.0) if frames else None
    if frames is None or tiles is None:
        return []
    residuals = tiles.residuals(frames)
    is_textured = textured(residuals)
    if np.count_nonzero(is_textured) < FEWEST_TILES:
        return []
    # Tiles (n,) that do not match, where they are few (a fault of a part of the image); otherwise a sample of all
    # tiles.
    count = int(np.count_nonzero(is_textured))
    deviating = is_textured & (residuals.unexplained > UNMATCHED)
    if not _FEWEST_UNMATCHED <= np.count_nonzero(deviating) < 0.5 * count:
        step = min(_TILE_STEP, count // FEWEST_TILES)
        thinned = is_textured & (np.arange(len(is_textured)) % step == 0)
        deviating = thinned if np.any(thinned) else is_textured
    tiles = tiles.chosen(deviating)
    as_stored = _mismatch(tiles, frames)
    best: dict[tuple[str, str], ConventionTrial] = {}
    # Frames that equal the one before them bit for bit need no trial.
    rows = [row for row in {frames.before, frames.after} if row > 0]
    repeated = sum(np.array_equal(window.rgb(row), window.rgb(row - 1)) for row in rows)
    if repeated:
        best["repeated_frame", "rgb"] = ConventionTrial(interval.stream, "repeated_frame", "rgb", 1.0, float(repeated))
    for transform in _transforms(window, optics, interval, tiles, frames):
        if transform.flow_px is None or transform.frames is None:
            continue
        # The same tiles and pixels are compared before and after, so that the share depends on the transform alone.
        mismatch = _mismatch(replace(tiles, flow_px=transform.flow_px), transform.frames)
        removed_share = transform.factor * max(1.0 - mismatch / as_stored, 0.0) if as_stored > 0 else 0.0
        key = (transform.name, transform.stream)
        if key not in best or best[key].removed_share < removed_share:
            best[key] = ConventionTrial(interval.stream, *key, removed_share, transform.magnitude)
    return list(best.values())


def _mismatch(tiles: FieldTiles, frames: FramePair) -> float:
    """Return the median over tiles of the difference of the frames, relative to the image's own contrast."""
    return float(np.median(np.sqrt(tiles.residuals(frames).mismatch)))


def _transforms(
    window: Window, optics: Optics, interval: Interval, tiles: FieldTiles, frames: FramePair
) -> Iterator[_FrameTransform]:
    """Yield transforms of the stored numbers, of their grid, of the interval, and of the colour frames."""
    flow_px, interval_s = tiles.flow_px, np.float32(interval.duration_s)
    for name, axes in FLOW_AXES.items():
        yield _FrameTransform(name, "flow", axes.of(flow_px), frames)
    if interval_s > 0:
        yield _FrameTransform("rescaled_by_interval", "flow", flow_px * interval_s, frames, 1 / float(interval_s))
        yield _FrameTransform("rescaled_by_interval", "flow", flow_px / interval_s, frames, float(interval_s))
        interval_ms = MS_PER_S * interval_s
        yield _FrameTransform("times_milliseconds", "flow", flow_px * interval_ms, frames, 1 / float(interval_ms))
    for gain in _GAINS:
        yield _FrameTransform("scaled", "flow", flow_px / np.float32(gain), frames, 100 * (gain - 1))

    # The grid of the flow is mirrored, with or without its vectors.
    stored_px = window.flow_px(interval.stream, interval.row)
    for mirrored_px in (stored_px[:, ::-1], stored_px[::-1]):
        patches_px = patches_of(mirrored_px, tiles.origins)
        with np.errstate(invalid="ignore"):  # values may be NaN
            patches_px = np.where(np.abs(patches_px) < LARGEST_FLOW_PX, patches_px, np.float32(0))
        for signs in ((1, 1), (-1, 1), (1, -1)):
            turned_px = patches_px * np.array(signs, dtype=np.float32)
            factor = 1.0 if signs == (1, 1) else _TWO_CHANGES
            yield _FrameTransform("mirrored", "flow", turned_px, frames, factor=factor)

    # The frames of a neighbouring interval, or of a field of another rate.
    for intervals in (-1, 1):
        neighbours = frame_pair(window, optics, interval.shifted(intervals))
        yield _FrameTransform("shifted_interval", "flow", flow_px, neighbours, float(-intervals))
    for stream in window.facts.flow_streams:
        starts_ns = window.facts.clocks[stream].times_ns
        if stream == interval.stream or not len(starts_ns):
            continue
        # The other rate's field of the same time, and the one of the same row.
        latest = max(int(np.searchsorted(starts_ns, interval.start_ns, "right")) - 1, 0)
        for row in {latest, min(interval.row, len(starts_ns) - 1)}:
            others = frame_pair(window, optics, interval_at(window.facts, stream, row))
            yield _FrameTransform("field_of_another_rate", "flow", flow_px, others)

    # Other colour frames, no motion between them, or mirrored ones.
    times_ns = window.facts.clocks["rgb"].times_ns
    for shift in _FRAME_SHIFTS:
        before, after = frames.before + shift, frames.after + shift
        if min(before, after) >= 0 and max(before, after) < len(times_ns):
            delay_ms = float(times_ns[before] - times_ns[frames.before]) * 1e3 / NS_PER_S
            shifted = replace(frames, before=before, after=after)
            yield _FrameTransform("delayed", "rgb", flow_px, shifted, delay_ms)
            yield _FrameTransform("delayed", "flow", flow_px, shifted, -delay_ms)
    for before, after in ((frames.after, frames.before), (frames.before, frames.after + 1),
                          (frames.before, frames.after - 1), (frames.before + 1, frames.after),
                          (frames.before - 1, frames.after)):  # fmt: skip
        if min(before, after) >= 0 and max(before, after) < len(times_ns):
            exchanged = replace(frames, before=before, after=after)
            yield _FrameTransform("exchanged_frames", "rgb", flow_px, exchanged, 1.0)
    yield _FrameTransform("repeated_frame", "rgb", np.zeros_like(flow_px), frames)
    camera = frames.window.facts.declared.cameras.get("rgb")
    if camera is not None:
        H = np.eye(3) if frames.optics.H_rgb_flow is None else frames.optics.H_rgb_flow
        for mirror in ([[-1, 0, camera.width - 1], [0, 1, 0], [0, 0, 1]],
                       [[1, 0, 0], [0, -1, camera.height - 1], [0, 0, 1]]):  # fmt: skip
            mirrored = replace(frames.optics, H_rgb_flow=np.array(mirror, dtype=np.float64) @ H)
            yield _FrameTransform("mirrored", "rgb", flow_px, replace(frames, optics=mirrored))

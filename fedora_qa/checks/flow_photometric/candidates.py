"""Gross faults between flow and frames, tried one by one on a field that is off; and pictures of such a field."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.flow.residual import TileResiduals
from fedora_qa.estimators.flow.tiles import TileGrid, patches_of
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_intervals import Interval, interval_at
from fedora_qa.views.flow_residuals import (
    FEWEST_TILES,
    LARGEST_FLOW_PX,
    UNMATCHED,
    Tiles,
    sample_tiles,
    textured,
)
from fedora_qa.views.warped_frames import FramePair, Optics, frame_pair

Float32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

_EVERY: Final = 4
"""Of tiles that are off all over the image every fourth will do, as long as some are left."""

_FEWEST_OFF: Final = 2
_LESS_LIKELY: Final = 0.95
"""A flow that is mirrored with its sign is to the frames what mirrored frames are to the flow: frames come first."""

_LATE_FRAMES: Final = (-2, -1, 1, 2)


@dataclass(frozen=True, slots=True)
class _Candidate:
    """The flow and the frames as they would be without the fault."""

    cause: str
    stream: str
    flow_px: Float32 | None
    frames: FramePair | None
    magnitude: float | None = None
    likeliness: float = 1.0


def weigh_candidates(window: Window, optics: Optics, interval: Interval) -> list[ConventionTrial]:
    """Weigh every gross fault against one field: the share of the frames' mismatch that undoing it removes."""
    frames = frame_pair(window, optics, interval)
    tiles = sample_tiles(frames, interval, 1.0) if frames else None
    if frames is None or tiles is None:
        return []
    residuals = tiles.read(frames)
    can_tell = textured(residuals)
    if np.count_nonzero(can_tell) < FEWEST_TILES:
        return []
    tiles = tiles.chosen(_off(residuals, can_tell))
    as_stored = _mismatch(tiles, frames)
    best: dict[tuple[str, str], ConventionTrial] = {}
    if frozen := _repeated_frames(window, frames):
        best["frozen_frames", "rgb"] = ConventionTrial(interval.stream, "frozen_frames", "rgb", 1.0, float(frozen))
    for candidate in _candidates(window, optics, interval, tiles, frames):
        if candidate.flow_px is None or candidate.frames is None:
            continue
        left = _mismatch(replace(tiles, flow_px=candidate.flow_px), candidate.frames)
        weight = candidate.likeliness * max(1.0 - left / as_stored, 0.0) if as_stored > 0 else 0.0
        key = (candidate.cause, candidate.stream)
        if key not in best or best[key].removed_share < weight:
            best[key] = ConventionTrial(interval.stream, *key, weight, candidate.magnitude)
    return list(best.values())


def _off(residuals: TileResiduals, can_tell: Mask) -> Mask:
    """Return the tiles that do not match, where they are few: a fault of a part of the image. Else a share of all."""
    unmatched = can_tell & (residuals.unexplained > UNMATCHED)
    count = int(np.count_nonzero(can_tell))
    if _FEWEST_OFF <= np.count_nonzero(unmatched) < 0.5 * count:
        return unmatched
    every = min(_EVERY, count // FEWEST_TILES)
    share = np.arange(len(can_tell)) % every == 0
    return can_tell & share if np.any(can_tell & share) else can_tell


def _repeated_frames(window: Window, frames: FramePair) -> int:
    """Return how many frames of the pair equal the one before them, bit for bit."""
    rows = [row for row in {frames.before, frames.after} if row > 0]
    return sum(np.array_equal(window.rgb(row), window.rgb(row - 1)) for row in rows)


def _mismatch(tiles: Tiles, frames: FramePair) -> float:
    """Return the median over tiles of the difference of the frames, relative to the image's own contrast."""
    return float(np.median(np.sqrt(tiles.read(frames).mismatch)))


def _candidates(
    window: Window, optics: Optics, interval: Interval, tiles: Tiles, frames: FramePair
) -> Iterator[_Candidate]:
    yield from _of_the_values(interval, tiles, frames)
    yield from _of_the_grid(window, interval, tiles, frames)
    yield from _of_the_interval(window, optics, interval, tiles)
    yield from _of_the_frames(window, tiles, frames)


def _of_the_values(interval: Interval, tiles: Tiles, frames: FramePair) -> Iterator[_Candidate]:
    """Undo what may have happened to the stored numbers."""
    flow, seconds = tiles.flow_px, np.float32(interval.duration_s)

    def undone(cause: str, flow_px: Float32, magnitude: float | None = None) -> _Candidate:
        return _Candidate(cause, "flow", flow_px, frames, magnitude)

    yield undone("flow_sign", -flow)
    yield undone("axes_swapped", flow[..., ::-1])
    yield undone("frame_convention", flow * np.array([1, -1], dtype=np.float32))
    if seconds > 0:
        yield undone("flow_unit", flow * seconds, 1 / float(seconds))
        yield undone("flow_unit", flow / seconds, float(seconds))
    for gain in (2.0, 1.5, 0.67, 0.5):
        yield undone("flow_gain", flow / np.float32(gain), 100 * (gain - 1))


def _of_the_grid(window: Window, interval: Interval, tiles: Tiles, frames: FramePair) -> Iterator[_Candidate]:
    """Turn over the image that the numbers lie in."""
    stored = window.flow_px(interval.stream, interval.row)
    for turned in (stored[:, ::-1], stored[::-1]):
        patches = patches_of(turned, tiles.origins)
        with np.errstate(invalid="ignore"):
            patches = np.where(np.abs(patches) < LARGEST_FLOW_PX, patches, np.float32(0))
        for signs in ((1, 1), (-1, 1), (1, -1)):
            mirrored = patches * np.array(signs, dtype=np.float32)
            yield _Candidate("mirrored", "flow", mirrored, frames, likeliness=1.0 if signs == (1, 1) else _LESS_LIKELY)


def _of_the_interval(window: Window, optics: Optics, interval: Interval, tiles: Tiles) -> Iterator[_Candidate]:
    """Suppose that the field belongs to the frames of a neighbouring interval, or of another rate."""
    for intervals in (-1, 1):
        frames = frame_pair(window, optics, interval.shifted(intervals))
        yield _Candidate("flow_interval_shifted", "flow", tiles.flow_px, frames, float(-intervals))
    for stream in window.facts.flow_streams:
        starts_ns = window.facts.clocks[stream].times_ns
        if stream == interval.stream or not len(starts_ns):
            continue
        latest = max(int(np.searchsorted(starts_ns, interval.start_ns, "right")) - 1, 0)
        for row in {latest, min(interval.row, len(starts_ns) - 1)}:
            frames = frame_pair(window, optics, interval_at(window.facts, stream, row))
            yield _Candidate("flow_rate_mixed", "flow", tiles.flow_px, frames)


def _of_the_frames(window: Window, tiles: Tiles, frames: FramePair) -> Iterator[_Candidate]:
    """Undo what may have happened to the colour frames."""
    times_ns = window.facts.clocks["rgb"].times_ns
    for late in _LATE_FRAMES:
        before, after = frames.before + late, frames.after + late
        if min(before, after) >= 0 and max(before, after) < len(times_ns):
            late_ms = float(times_ns[before] - times_ns[frames.before]) * 1e3 / NS_PER_S
            moved = replace(frames, before=before, after=after)
            yield _Candidate("time_offset", "rgb", tiles.flow_px, moved, late_ms)
            yield _Candidate("time_offset", "flow", tiles.flow_px, moved, -late_ms)
    for before, after in ((frames.after, frames.before), (frames.before, frames.after + 1),
                          (frames.before, frames.after - 1), (frames.before + 1, frames.after),
                          (frames.before - 1, frames.after)):  # fmt: skip
        if min(before, after) >= 0 and max(before, after) < len(times_ns):
            exchanged = replace(frames, before=before, after=after)
            yield _Candidate("swapped_frames", "rgb", tiles.flow_px, exchanged, 1.0)
    yield _Candidate("frozen_frames", "rgb", np.zeros_like(tiles.flow_px), frames)
    camera = frames.window.facts.declared.cameras.get("rgb")
    if camera is not None:
        H = np.eye(3) if frames.optics.H_rgb_flow is None else frames.optics.H_rgb_flow
        for mirror in ([[-1, 0, camera.width - 1], [0, 1, 0], [0, 0, 1]],
                       [[1, 0, 0], [0, -1, camera.height - 1], [0, 0, 1]]):  # fmt: skip
            optics = replace(frames.optics, H_rgb_flow=np.array(mirror, dtype=np.float64) @ H)
            yield _Candidate("mirrored", "rgb", tiles.flow_px, replace(frames, optics=optics))


def residual_maps(window: Window, optics: Optics, interval: Interval) -> Mapping[str, tuple[NDArray[Any], str]]:
    """Return maps of one field, each with its title: residual u and v in px, and the unexplained share, by tile.

    A tile's value is NaN where the tile cannot tell.
    """
    frames = frame_pair(window, optics, interval)
    tiles = sample_tiles(frames, interval, 1.0) if frames else None
    if frames is None or tiles is None:
        return {}
    residuals = tiles.read(frames)
    stored = window.flow_px(interval.stream, interval.row)
    columns = len(np.unique(TileGrid.of(*stored.shape[:2]).origins[:, 0]))
    can_tell = textured(residuals)
    field = f"of tiles of 32 px, worst field (row {interval.row} of {interval.stream})"
    by_tile = {
        "residual_u_px": (residuals.flow_errors_px[:, 0], f"Residual flow u (right) {field} [px]"),
        "residual_v_px": (residuals.flow_errors_px[:, 1], f"Residual flow v (down) {field} [px]"),
        "unexplained_share": (residuals.unexplained, f"Share of the contrast left unexplained {field} [1]"),
    }
    return {
        name: (np.where(can_tell, values, np.nan).reshape(-1, columns).astype(np.float32), title)
        for name, (values, title) in by_tile.items()
    }

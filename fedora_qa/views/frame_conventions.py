"""Inverse transforms of flow and frames, each tried on one field that deviates: how much of the mismatch it removes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.flow.residual import TileResiduals
from fedora_qa.estimators.flow.tiles import patches_of
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_intervals import Interval, interval_at
from fedora_qa.views.flow_residuals import (
    FEWEST_TILES,
    LARGEST_FLOW_PX,
    UNMATCHED,
    FieldTiles,
    sample_tiles,
    textured,
)
from fedora_qa.views.warped_frames import FramePair, Optics, frame_pair

Float32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

_TILE_STEP: Final = 4
"""Of tiles that deviate all over the image every fourth is enough, as long as some are left."""

_FEWEST_UNMATCHED: Final = 2
_TWO_CHANGES: Final = 0.95
"""Factor on what a mirrored grid with mirrored vectors removes: mirrored frames, one change, leave the same mismatch.

Of two transforms that remove as much, the one with fewer changes comes first.
"""

_GAINS: Final = (2.0, 1.5, 0.67, 0.5)
_FRAME_SHIFTS: Final = (-2, -1, 1, 2)


@dataclass(frozen=True, slots=True)
class _FrameTransform:
    """Flow and frames after an inverse transform of one stream; None where the file does not hold what it needs."""

    name: str
    stream: str
    flow_px: Float32 | None
    frames: FramePair | None
    magnitude: float | None = None
    factor: float = 1.0


def try_transforms(window: Window, optics: Optics, interval: Interval) -> list[ConventionTrial]:
    """Try every inverse transform on one field.

    Returns
    -------
    list
        For each transform and stream the variant that removes the largest share of the frames' mismatch; empty where
        the field has too few textured tiles.
    """
    frames = frame_pair(window, optics, interval)
    tiles = sample_tiles(frames, interval, 1.0) if frames else None
    if frames is None or tiles is None:
        return []
    residuals = tiles.residuals(frames)
    is_textured = textured(residuals)
    if np.count_nonzero(is_textured) < FEWEST_TILES:
        return []
    tiles = tiles.chosen(_deviating(residuals, is_textured))
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


def _deviating(residuals: TileResiduals, is_textured: Mask) -> Mask:
    """Return the tiles (n,) that do not match, where they are few: a fault of a part of the image. Else some of all."""
    unmatched = is_textured & (residuals.unexplained > UNMATCHED)
    count = int(np.count_nonzero(is_textured))
    if _FEWEST_UNMATCHED <= np.count_nonzero(unmatched) < 0.5 * count:
        return unmatched
    step = min(_TILE_STEP, count // FEWEST_TILES)
    thinned = is_textured & (np.arange(len(is_textured)) % step == 0)
    return thinned if np.any(thinned) else is_textured


def _mismatch(tiles: FieldTiles, frames: FramePair) -> float:
    """Return the median over tiles of the difference of the frames, relative to the image's own contrast."""
    return float(np.median(np.sqrt(tiles.residuals(frames).mismatch)))


def _transforms(
    window: Window, optics: Optics, interval: Interval, tiles: FieldTiles, frames: FramePair
) -> Iterator[_FrameTransform]:
    yield from _of_values(interval, tiles, frames)
    yield from _of_grid(window, interval, tiles, frames)
    yield from _of_interval(window, optics, interval, tiles)
    yield from _of_frames(window, tiles, frames)


def _of_values(interval: Interval, tiles: FieldTiles, frames: FramePair) -> Iterator[_FrameTransform]:
    """Transform the stored numbers."""
    flow_px, interval_s = tiles.flow_px, np.float32(interval.duration_s)

    def transformed(name: str, values_px: Float32, magnitude: float | None = None) -> _FrameTransform:
        return _FrameTransform(name, "flow", values_px, frames, magnitude)

    yield transformed("negated", -flow_px)
    yield transformed("transposed_axes", flow_px[..., ::-1])
    yield transformed("flipped_v", flow_px * np.array([1, -1], dtype=np.float32))
    if interval_s > 0:
        yield transformed("rescaled_by_interval", flow_px * interval_s, 1 / float(interval_s))
        yield transformed("rescaled_by_interval", flow_px / interval_s, float(interval_s))
    for gain in _GAINS:
        yield transformed("scaled", flow_px / np.float32(gain), 100 * (gain - 1))


def _of_grid(window: Window, interval: Interval, tiles: FieldTiles, frames: FramePair) -> Iterator[_FrameTransform]:
    """Turn over the image that the numbers lie in, with or without the numbers themselves."""
    stored_px = window.flow_px(interval.stream, interval.row)
    for mirrored_px in (stored_px[:, ::-1], stored_px[::-1]):
        patches_px = patches_of(mirrored_px, tiles.origins)
        with np.errstate(invalid="ignore"):  # values may be NaN
            patches_px = np.where(np.abs(patches_px) < LARGEST_FLOW_PX, patches_px, np.float32(0))
        for signs in ((1, 1), (-1, 1), (1, -1)):
            flow_px = patches_px * np.array(signs, dtype=np.float32)
            factor = 1.0 if signs == (1, 1) else _TWO_CHANGES
            yield _FrameTransform("mirrored", "flow", flow_px, frames, factor=factor)


def _of_interval(window: Window, optics: Optics, interval: Interval, tiles: FieldTiles) -> Iterator[_FrameTransform]:
    """Take the frames of a neighbouring interval, or of a field of another rate."""
    for intervals in (-1, 1):
        frames = frame_pair(window, optics, interval.shifted(intervals))
        yield _FrameTransform("shifted_interval", "flow", tiles.flow_px, frames, float(-intervals))
    for stream in window.facts.flow_streams:
        starts_ns = window.facts.clocks[stream].times_ns
        if stream == interval.stream or not len(starts_ns):
            continue
        # The other rate's field of the same time, and the one of the same row.
        latest = max(int(np.searchsorted(starts_ns, interval.start_ns, "right")) - 1, 0)
        for row in {latest, min(interval.row, len(starts_ns) - 1)}:
            frames = frame_pair(window, optics, interval_at(window.facts, stream, row))
            yield _FrameTransform("field_of_another_rate", "flow", tiles.flow_px, frames)


def _of_frames(window: Window, tiles: FieldTiles, frames: FramePair) -> Iterator[_FrameTransform]:
    """Take other colour frames, no motion between them, or mirrored ones."""
    times_ns = window.facts.clocks["rgb"].times_ns
    for shift in _FRAME_SHIFTS:
        before, after = frames.before + shift, frames.after + shift
        if min(before, after) >= 0 and max(before, after) < len(times_ns):
            delay_ms = float(times_ns[before] - times_ns[frames.before]) * 1e3 / NS_PER_S
            shifted = replace(frames, before=before, after=after)
            yield _FrameTransform("delayed", "rgb", tiles.flow_px, shifted, delay_ms)
            yield _FrameTransform("delayed", "flow", tiles.flow_px, shifted, -delay_ms)
    for before, after in ((frames.after, frames.before), (frames.before, frames.after + 1),
                          (frames.before, frames.after - 1), (frames.before + 1, frames.after),
                          (frames.before - 1, frames.after)):  # fmt: skip
        if min(before, after) >= 0 and max(before, after) < len(times_ns):
            exchanged = replace(frames, before=before, after=after)
            yield _FrameTransform("exchanged_frames", "rgb", tiles.flow_px, exchanged, 1.0)
    yield _FrameTransform("repeated_frame", "rgb", np.zeros_like(tiles.flow_px), frames)
    camera = frames.window.facts.declared.cameras.get("rgb")
    if camera is not None:
        H = np.eye(3) if frames.optics.H_rgb_flow is None else frames.optics.H_rgb_flow
        for mirror in ([[-1, 0, camera.width - 1], [0, 1, 0], [0, 0, 1]],
                       [[1, 0, 0], [0, -1, camera.height - 1], [0, 0, 1]]):  # fmt: skip
            optics = replace(frames.optics, H_rgb_flow=np.array(mirror, dtype=np.float64) @ H)
            yield _FrameTransform("mirrored", "rgb", tiles.flow_px, replace(frames, optics=optics))

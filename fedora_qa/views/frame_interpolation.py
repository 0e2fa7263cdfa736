"""What a window shows of the time of events where frames are read at them (``event_reading``)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.delays import CellSums
from fedora_qa.estimators.events.frame_interpolation import Readings, Way, read_frames, reading_blocks, reading_weights
from fedora_qa.estimators.events.frame_interpolation_kernels import FINE
from fedora_qa.estimators.events.levels import NormalBlocks, concatenate
from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.events.threshold_fit import ResponseFit, fit_readings
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import corrected_events, pixel_events, resampled_frames, sorted_by_pixel
from fedora_qa.views.event_tick import local_tick_ns
from fedora_qa.views.event_tiles import GRID
from fedora_qa.views.level_samples import FEWEST_PAIRS, usable_pixels

KINDS: Final = ("fine", "coarse", "even")


@dataclass(frozen=True, slots=True)
class ReadingSums:
    """Normal equations of a window's readings, a block for each tile.

    ``fine`` reads the sharp reconstruction of frames through six of them; ``coarse`` through four; ``even`` reads the
    even reconstruction. ``start_ns`` and ``stop_ns`` are those of the window.
    """

    fine: NormalBlocks
    coarse: NormalBlocks
    even: NormalBlocks
    start_ns: int
    stop_ns: int


@dataclass(frozen=True, slots=True)
class ReadingFits:
    """The fit of a file by its readings, and by the others that bound its error."""

    fit: ResponseFit
    coarse: ResponseFit
    even: ResponseFit


def reading_sums(window: Window) -> ReadingSums | None:
    """Return the sums of a window; None where it has too few readings."""
    return _sums_of(window, pixel_events(window))


def reading_sums_on_time(window: Window, late_ns: int) -> ReadingSums | None:
    """Return the sums of a window whose events are late by so much, with that undone."""
    return _sums_of(window, sorted_by_pixel(corrected_events(window, late_ns), window.facts.declared))


def _sums_of(window: Window, events: PixelEvents) -> ReadingSums | None:
    seen, declared = resampled_frames(window), window.facts.declared.events
    if declared is None or len(seen) < FINE:
        return None
    usable = usable_pixels(window, seen, declared)
    linear = declared.model == "linear"
    readings = read_frames(
        events,
        seen.times_ns,
        seen.edge_aware_dn,
        seen.uniform_dn,
        usable,
        log_eps_dn=None if linear else declared.log_eps_dn,
        threshold=min(declared.threshold_on, declared.threshold_off),
        tick_s=local_tick_ns(window) * 1e-9 if linear else 0.0,
        leak_rate_hz=declared.leak_rate_hz,
    )
    if readings is None or len(readings) < FEWEST_PAIRS:
        return None
    weights, tiles = reading_weights(readings), _tiles(readings, usable.shape[1:])

    def blocks(read: Way) -> NormalBlocks:
        return reading_blocks(readings, weights, tiles, GRID**2, read=read)

    return ReadingSums(blocks("fine"), blocks("coarse"), blocks("even"), window.span.start_ns, window.span.stop_ns)


def fit_all(state: Sequence[ReadingSums]) -> ReadingFits | None:
    """Fit a file; None where it has too few readings.

    Errors of the frames may be common to a window, to a tile throughout, or to a row or column of a window's tiles,
    along which a straight edge lies: the standard errors are the largest of those that leave one of them out at a time.
    """
    if not state:
        return None
    there = np.concatenate([one.fine.counts > 0 for one in state])
    windows, tiles = np.divmod(np.flatnonzero(there), GRID**2)
    rows, columns = windows * GRID + tiles // GRID, windows * GRID + tiles % GRID
    groups = windows, tiles, rows, columns
    fits = [fit_readings(concatenate([getattr(one, kind) for one in state]), groups=groups) for kind in KINDS]
    known = [fit for fit in fits if fit is not None]
    return ReadingFits(*known) if len(known) == len(KINDS) else None


def cell_sums(state: Sequence[ReadingSums], kind: str, kappa_s: float) -> CellSums:
    """Return the sums of windows by tiles, of C+, C- and delay: with the file's kappa, as a cell may hold one edge."""
    cells = [_with_kappa(getattr(one, kind), kappa_s) for one in state]
    return CellSums(*(np.stack(each) for each in zip(*cells, strict=True)))


def _with_kappa(blocks: NormalBlocks, kappa_s: float) -> tuple[NDArray[np.float64], ...]:
    """Return what ``CellSums`` holds, of levels less kappa |L'|."""
    sizes = blocks.matrices[:, :, 3]
    return (
        blocks.matrices[:, :3, :3],
        blocks.vectors[:, :3] - kappa_s * sizes[:, :3],
        blocks.squares - 2 * kappa_s * blocks.vectors[:, 3] + kappa_s**2 * sizes[:, 3],
        blocks.weights,
        blocks.counts,
    )


def _tiles(readings: Readings, shape: tuple[int, ...]) -> NDArray[np.intp]:
    rows, columns = np.divmod(readings.pixels, shape[1])
    tiles: NDArray[np.intp] = GRID * (GRID * rows // shape[0]) + GRID * columns // shape[1]
    return tiles

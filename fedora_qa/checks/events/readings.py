"""What a window shows of the time of events where frames are read at them (``event_reading``)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.events.levels import FEWEST_PAIRS, log_levels, usable_pixels
from fedora_qa.checks.events.rows import local_tick_ns
from fedora_qa.checks.events.tiles import GRID
from fedora_qa.checks.events.view import ROUNDING_DN, SeenFrames, seen_frames, sensor_events
from fedora_qa.estimators.event_delays import CellSums
from fedora_qa.estimators.event_fit import ResponseFit, fit_readings
from fedora_qa.estimators.event_levels import NormalBlocks, concatenate
from fedora_qa.estimators.event_reading import Readings, read_frames, reading_blocks, reading_weights
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window

Float64 = NDArray[np.float64]

KINDS: Final = ("fine", "coarse", "even", "crests")


@dataclass(frozen=True, slots=True)
class ReadingSums:
    """Normal equations of a window's readings, a block for each tile.

    ``fine`` reads the sharp reconstruction of frames through six of them; ``coarse`` through four; ``even`` reads the
    even reconstruction; ``crests`` adds a threshold to each last event before light turns, for a sensor of the linear
    model (0 for one of log intensity). ``start_ns`` and ``stop_ns`` are those of the window.
    """

    fine: NormalBlocks
    coarse: NormalBlocks
    even: NormalBlocks
    crests: NormalBlocks
    start_ns: int
    stop_ns: int


@dataclass(frozen=True, slots=True)
class ReadingFits:
    """The fit of a file by its readings, and by the others that bound its error."""

    fit: ResponseFit
    coarse: ResponseFit
    even: ResponseFit
    crests: ResponseFit


def reading_sums(window: Window) -> ReadingSums | None:
    """Return the sums of a window; None where it has too few readings."""
    seen, declared = seen_frames(window), window.facts.declared.events
    if declared is None:
        return None
    usable = usable_pixels(seen, declared, ROUNDING_DN[window.facts.declared.transfer])
    sharp = _read(window, seen, declared, np.where(usable, seen.sharp_dn, np.nan))
    even = _read(window, seen, declared, np.where(usable, seen.even_dn, np.nan))
    if sharp is None or even is None or len(sharp) < FEWEST_PAIRS:
        return None
    weights, shape = reading_weights(sharp), usable.shape[1:]
    return ReadingSums(
        _blocks(sharp, weights, shape),
        _blocks(sharp, weights, shape, "coarse"),
        _blocks(even, weights, shape),
        _blocks(sharp, weights, shape, "crests" if declared.model == "linear" else "fine"),
        window.span.start_ns,
        window.span.stop_ns,
    )


def fit_all(state: Sequence[ReadingSums]) -> ReadingFits | None:
    """Fit a file; None where it has too few readings.

    Errors of the frames may be common to a window, or to a tile throughout: the standard errors are the largest of
    those that leave out a cell, a window, or a tile at a time.
    """
    if not state:
        return None
    there = np.concatenate([one.fine.counts > 0 for one in state])
    windows, tiles = np.divmod(np.flatnonzero(there), GRID**2)
    fits = [fit_readings(concatenate([getattr(one, kind) for one in state]), groups=(windows, tiles)) for kind in KINDS]
    known = [fit for fit in fits if fit is not None]
    return ReadingFits(*known) if len(known) == len(KINDS) else None


def cell_sums(state: Sequence[ReadingSums], kind: str) -> CellSums:
    """Return the sums of windows by tiles."""
    blocks = [getattr(one, kind) for one in state]
    return CellSums(*(np.stack([getattr(one, name) for one in blocks]) for name in CellSums.__slots__))


def _read(window: Window, seen: SeenFrames, declared: EventModel, levels: Float64) -> Readings | None:
    events = sensor_events(window)
    linear = declared.model == "linear"
    return read_frames(
        events.x,
        events.y,
        events.times_ns,
        events.p,
        seen.times_ns,
        levels if linear else log_levels(levels, declared),
        threshold=min(declared.threshold_on, declared.threshold_off),
        tick_s=local_tick_ns(window) * 1e-9 if linear else 0.0,
        leak_rate_hz=declared.leak_rate_hz,
    )


def _blocks(
    readings: Readings, weights: Float64, shape: tuple[int, ...], read: Literal["fine", "coarse", "crests"] = "fine"
) -> NormalBlocks:
    rows, columns = np.divmod(readings.pixels, shape[1])
    tiles = GRID * (GRID * rows // shape[0]) + GRID * columns // shape[1]
    return reading_blocks(readings, weights, tiles, GRID**2, read=read)

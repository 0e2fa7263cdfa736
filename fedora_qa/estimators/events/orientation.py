"""Whether events and frames agree in axes, direction and sign: correlation of what both say has changed.

The change of level between frames is compared with the sum of the events in between, averaged over blocks of pixels
(which forgives small shifts), under the eight symmetries of the square and both signs.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.orientation_kernels import (
    add_blocks,
    add_moments,
    mean_blocks_beyond,
    mean_event_blocks,
    multiply_blocks,
)

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

BLOCK_PX: Final = 4
"""Side of the blocks whose means are compared."""

LEAST_LIGHT: Final = 1e-3
"""Of less light than this no logarithm is taken, but of this, DN."""

SYMMETRIES: Final = tuple((swap, left, up) for swap in (False, True) for left in (False, True) for up in (False, True))
"""What could have been done to the events: axes exchanged, then columns mirrored, then rows mirrored."""


@dataclass(frozen=True, slots=True)
class Moments:
    """Sums over blocks of frame change d and event change e: (k, 6) of 1, d, e, d d, e e, d e."""

    sums: Float64

    def correlations(self) -> Float64:
        """Return the k correlation coefficients; 0 where either does not vary."""
        n, d, e, dd, ee, de = self.sums.T
        n = np.maximum(n, 1.0)
        spread = np.sqrt(np.maximum((dd - d * d / n) * (ee - e * e / n), 0.0))
        agreed = de - d * e / n
        correlations: Float64 = np.divide(agreed, spread, out=np.zeros_like(spread), where=spread > 0)
        return correlations

    def frame_variance(self) -> float:
        """Return the variance of d (of the first row)."""
        n, d, _, dd, *_ = self.sums[0]
        return max(float(dd - d * d / max(n, 1.0)), 0.0) / max(float(n), 1.0)


def level_blocks(light: Float32, error: Float32, dark: float | None) -> Float64:
    """Return the means of a frame's signal over blocks (r, c); NaN where it is not known of all pixels of a block.

    The signal is the logarithm of ``light`` (h, w) and ``dark``, or the light itself without one. It is known where the
    light is above twice its error (h, w). The mean of logarithms is that of the product: a logarithm a block.
    """
    side, grid = _grid(light.shape)
    blocks = np.empty(grid)
    if dark is None:
        add_blocks(light, error, side, blocks)
    else:
        multiply_blocks(light, error, dark, LEAST_LIGHT, side, blocks)
        np.log(blocks, out=blocks)
    blocks /= side**2
    return blocks


@dataclass(frozen=True, slots=True)
class EventBlocks:
    """Means over blocks (n - 1, r, c) of what events sum to between frames: as they lie, and with axes exchanged."""

    upright: Float64
    swapped: Float64


def event_blocks(counts: NDArray[np.int32], threshold_on: float, threshold_off: float) -> EventBlocks:
    """Return the block means of darker and brighter events (n - 1, 2, h, w) on a sensor."""
    side, grid = _grid(counts.shape[2:])
    upright, swapped = np.zeros((2, len(counts), *grid))
    for i in range(len(counts)):
        mean_event_blocks(counts[i], threshold_on, threshold_off, side, upright[i], swapped[i])
    return EventBlocks(upright, swapped)


def add_events_beyond(
    blocks: EventBlocks,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    times_ns: NDArray[np.int64],
    p: NDArray[np.integer],
    frame_times_ns: NDArray[np.int64],
    shape: tuple[int, int],
    threshold_on: float,
    threshold_off: float,
) -> None:
    """Add events that lie beyond the sensor (h, w) to blocks where they would lie on it with axes exchanged."""
    steps, side = (-threshold_off, threshold_on), _grid(shape)[0]
    columns, rows, times, signs = (column.astype(np.int64) for column in (x, y, times_ns, p))
    mean_blocks_beyond(columns, rows, times, signs, frame_times_ns, shape, steps, side, blocks.swapped)


def step_moments(levels: Float64, events: EventBlocks, tiles: int) -> Float64:
    """Return moments (n - 1, tiles^2, 8, 6) of changes between successive frames and events under all symmetries.

    ``levels`` (n, r, c) are the ``level_blocks`` of the frames.
    """
    sums = np.zeros((len(events.upright), tiles**2, len(SYMMETRIES), 6))
    for i, (upright, swapped) in enumerate(zip(events.upright, events.swapped, strict=True)):
        add_moments(levels[i + 1] - levels[i], upright, swapped, tiles, sums[i])
    return sums


def span_moments(levels: Float64, events: EventBlocks) -> Moments:
    """Return moments (8, 6) of the change from the first frame to the last and of all events in between."""
    sums = np.zeros((1, len(SYMMETRIES), 6))
    add_moments(levels[-1] - levels[0], events.upright.sum(axis=0), events.swapped.sum(axis=0), 1, sums)
    return Moments(sums[0])


def _grid(shape: tuple[int, ...]) -> tuple[int, tuple[int, int]]:
    """Return the side of blocks, and how many rows and columns of them fit into an image (h, w)."""
    side = min(BLOCK_PX, *shape)
    return side, (shape[0] // side, shape[1] // side)

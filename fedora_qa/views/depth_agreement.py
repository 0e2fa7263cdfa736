"""How well one depth frame agrees with the next, whole and by tiles."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.depth.warp import warp
from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.views.depth_pairs import DepthPair

Float64 = NDArray[np.float64]

_TILES: Final = (8, 6)
"""Tiles across and down: large enough that each holds a surface, small enough that a lost corner shows."""

_FEWEST_IN_TILE: Final = 20
"""Pixels of which the median of noise exceeds twice its own bound in no file."""


@dataclass(frozen=True, slots=True)
class DepthDeviation:
    """A median absolute residual, relative to the depth, and the median of its bounds."""

    typical: float
    bound: float

    @property
    def excess(self) -> float:
        """The residual over its bound: above 1 most pixels deviate by more than they may."""
        return self.typical / self.bound


@dataclass(frozen=True, slots=True)
class PairAgreement:
    """One pair of frames.

    Attributes
    ----------
    first, second
        Rows of the depth stream.
    whole, worst_tile, tile
        Over all compared pixels; in the tile that is off most; and that tile: left, top, right, bottom, in pixels.
    pixels
        How many pixels were compared.
    noise_square, noise_dof
        The correction of the motion against its declared noise (chi-square); 0 where none is declared.
    repeats
        Whether a pair that is off holds the same frame twice, bit for bit.
    """

    first: int
    second: int
    whole: DepthDeviation
    worst_tile: DepthDeviation
    tile: tuple[int, int, int, int] | None
    pixels: int
    noise_square: float
    noise_dof: float
    repeats: bool

    @property
    def excess(self) -> float:
        """Above 1 where the pair, or a tile of it, is off, or the motion by ten times the variance of its noise."""
        by_noise = self.noise_square / (10 * self.noise_dof) if self.noise_dof > 0 else 0.0
        return max(self.whole.excess, self.worst_tile.excess, by_noise)


def compare(pair: DepthPair) -> PairAgreement | None:
    """Compare the frames of a pair.

    Parameters
    ----------
    pair
        Two depth frames and the motion between them, which is corrected within its noise first.

    Returns
    -------
    PairAgreement | None
        None where the frames share too few pixels.
    """
    model, lattice = pair.model(), pair.lattice()
    # Declared pose noise moves all pixels alike: without this correction it would count as an error of depth.
    fit = pair.fit_as_declared()
    if fit is None:
        return None
    warped = warp(replace(model, motion=model.motion.corrected(fit.twist)), lattice, pair.image1)
    compared = np.isfinite(warped.residuals)
    residuals, bounds = np.abs(warped.residuals[compared]), warped.bounds[compared]
    whole = DepthDeviation(median_of(residuals), median_of(bounds))

    # Tiles of the first frame, numbered row by row.
    across, down = _TILES
    height, width = pair.image1.depths_m.shape
    tile_columns = (lattice.columns * across / width).astype(np.uint8)
    tile_rows = (lattice.rows * down / height).astype(np.uint8)
    tiles = (tile_rows * np.uint8(across) + tile_columns)[compared]
    worst, tile_px = _worst_tile(residuals, bounds, tiles, (height, width), pair.every_px) or (whole, None)

    # Only pairs that are off are compared value by value.
    repeats = max(whole.excess, worst.excess) > 1 and np.array_equal(
        pair.window.depth_m(pair.first), pair.window.depth_m(pair.second), equal_nan=True
    )
    return PairAgreement(
        pair.first,
        pair.second,
        whole,
        worst,
        tile_px,
        pixels=warped.compared,
        noise_square=fit.noise_square,
        noise_dof=fit.noise_dof,
        repeats=repeats,
    )


def _worst_tile(
    residuals: Float64, bounds: Float64, tiles: NDArray[np.uint8], shape: tuple[int, int], every_px: int
) -> tuple[DepthDeviation, tuple[int, int, int, int]] | None:
    """Return the tile that is off most, and its edges in px of the frame; None where no tile holds enough pixels."""
    across, down = _TILES
    height, width = shape
    typical, limits = medians_by_group(residuals, bounds, tiles, across * down, _FEWEST_IN_TILE)
    if not np.isfinite(typical).any():
        return None
    # Tiles are ranked by the residual over its bound: bounds grow where depth is steep or coarsely rounded.
    tile = int(np.nanargmax(typical / limits))
    row, column = divmod(tile, across)
    edges = (column * width // across, row * height // down, (column + 1) * width // across, (row + 1) * height // down)
    left_px, top_px, right_px, bottom_px = (every_px * edge for edge in edges)
    return DepthDeviation(float(typical[tile]), float(limits[tile])), (left_px, top_px, right_px, bottom_px)


@njit(cache=True)
def medians_by_group(
    first: Float64, second: Float64, groups: NDArray[np.uint8], count: int, fewest: int
) -> tuple[Float64, Float64]:
    """Return the medians (count,) of two columns (n,) by group; NaN in groups of fewer than ``fewest``."""
    ends = np.zeros(count + 1, np.int64)
    for group in groups:
        ends[group + 1] += 1
    ends = np.cumsum(ends)
    # Counting sort: values of one group lie together.
    next_index, first_sorted, second_sorted = ends[:-1].copy(), np.empty(len(first)), np.empty(len(first))
    for i in range(len(groups)):
        index = next_index[groups[i]]
        first_sorted[index], second_sorted[index] = first[i], second[i]
        next_index[groups[i]] = index + 1
    first_medians, second_medians = np.full(count, np.nan), np.full(count, np.nan)
    for group in range(count):
        start, stop = ends[group], ends[group + 1]
        if stop - start >= max(fewest, 1):
            first_medians[group] = median_of(first_sorted[start:stop])
            second_medians[group] = median_of(second_sorted[start:stop])
    return first_medians, second_medians

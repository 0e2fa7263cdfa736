"""How well one depth frame agrees with the next, whole and by tiles."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.pair_fit_kernels import medians_by_group
from fedora_qa.estimators.depth.warp import Lattice, warp
from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.views.depth_pairs import DepthPair

Float64 = NDArray[np.float64]

_TILES: Final = (8, 6)
"""Tiles across and down: large enough that each holds a surface, small enough that a lost corner shows."""

_FEWEST_IN_TILE: Final = 20
"""Pixels of which the median of noise exceeds twice its own bound in no file."""


@dataclass(frozen=True, slots=True)
class Deviation:
    """A median absolute residual, relative to the depth, and the median of what it may honestly be."""

    typical: float
    bound: float

    @property
    def suspicion(self) -> float:
        """Above 1 where most pixels deviate by more than they may."""
        return self.typical / self.bound


@dataclass(frozen=True, slots=True)
class PairAgreement:
    """One pair of frames.

    Attributes
    ----------
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
    whole: Deviation
    worst_tile: Deviation
    tile: tuple[int, int, int, int] | None
    pixels: int
    noise_square: float
    noise_dof: float
    repeats: bool

    @property
    def suspicion(self) -> float:
        """Above 1 where the pair, or a tile of it, is off, or the motion by ten times the variance of its noise."""
        by_noise = self.noise_square / (10 * self.noise_dof) if self.noise_dof > 0 else 0.0
        return max(self.whole.suspicion, self.worst_tile.suspicion, by_noise)


def compare(pair: DepthPair) -> PairAgreement | None:
    """Compare a pair, its motion corrected within its noise; None where the frames share too few pixels."""
    model, lattice = pair.model(), pair.lattice()
    fit = pair.fit_as_declared()
    if fit is None:
        return None
    warped = warp(replace(model, motion=model.motion.corrected(fit.twist)), lattice, pair.image1)
    known = np.isfinite(warped.residuals)
    sizes, bounds = np.abs(warped.residuals[known]), warped.bounds[known]
    whole = Deviation(median_of(sizes), median_of(bounds))
    tiles = _tiles(lattice, pair.image1.depths_m.shape)[known]
    worst, tile = _worst_tile(sizes, bounds, tiles, pair.image1.depths_m.shape, pair.every_px) or (whole, None)
    return PairAgreement(
        pair.first,
        pair.second,
        whole,
        worst,
        tile,
        pixels=warped.seen,
        noise_square=fit.noise_square,
        noise_dof=fit.noise_dof,
        repeats=max(whole.suspicion, worst.suspicion) > 1 and _same(pair),
    )


def _tiles(lattice: Lattice, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Return the number of the tile in which each pixel of a lattice lies, row by row."""
    across, down = _TILES
    height, width = shape
    column = (lattice.columns * across / width).astype(np.uint8)
    row = (lattice.rows * down / height).astype(np.uint8)
    return row * np.uint8(across) + column


def _worst_tile(
    sizes: Float64, bounds: Float64, tiles: NDArray[np.uint8], shape: tuple[int, ...], every_px: int
) -> tuple[Deviation, tuple[int, int, int, int]] | None:
    """Return the tile that is off most, and where it lies; None where no tile holds enough pixels."""
    across, down = _TILES
    height, width = shape
    typical, limits = medians_by_group(sizes, bounds, tiles, across * down, _FEWEST_IN_TILE)
    if not np.isfinite(typical).any():
        return None
    tile = int(np.nanargmax(typical / limits))
    top, left = divmod(tile, across)
    edges = (left * width // across, top * height // down, (left + 1) * width // across, (top + 1) * height // down)
    left_px, top_px, right_px, bottom_px = (every_px * edge for edge in edges)
    return Deviation(float(typical[tile]), float(limits[tile])), (left_px, top_px, right_px, bottom_px)


def _same(pair: DepthPair) -> bool:
    first, second = (pair.window.depth_m(row) for row in (pair.first, pair.second))
    return np.array_equal(first, second, equal_nan=True)

"""How well one depth frame agrees with the next, whole and by tiles."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.depth.pairs import DepthPair
from fedora_qa.estimators.depth_fit import fit_depth
from fedora_qa.estimators.depth_warp import Lattice, Warped, warp

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
    model, lattice = pair.model(), pair.lattice(most=None)
    fit = fit_depth(lambda _: model, pair.lattice(), pair.images[1], pair.noise, start=0.0, step=None)
    if fit is None:
        return None
    corrected = replace(model, motion=model.motion.corrected(fit.twist))
    warped = warp(corrected, lattice, pair.images[1])
    whole = _deviation(warped, np.isfinite(warped.residuals))
    worst, tile = _worst_tile(warped, lattice, pair.images[0].inverse_per_m.shape) or (whole, None)
    return PairAgreement(
        pair.first,
        pair.second,
        whole,
        worst,
        tile,
        pixels=int(np.count_nonzero(np.isfinite(warped.residuals))),
        noise_square=fit.noise_square,
        noise_dof=fit.noise_dof,
        repeats=max(whole.suspicion, worst.suspicion) > 1 and _same(pair),
    )


def _deviation(warped: Warped, chosen: NDArray[np.bool_]) -> Deviation:
    residuals, bounds = warped.residuals[chosen], warped.bounds[chosen]
    return Deviation(float(np.median(np.abs(residuals))), float(np.median(bounds)))


def _worst_tile(
    warped: Warped, lattice: Lattice, shape: tuple[int, ...]
) -> tuple[Deviation, tuple[int, int, int, int]] | None:
    """Return the tile that is off most, and where it lies; None where no tile holds enough pixels."""
    across, down = _TILES
    height, width = shape
    column = (lattice.columns * across / width).astype(np.intp)
    row = (lattice.rows * down / height).astype(np.intp)
    known = np.isfinite(warped.residuals)
    tiles = row * across + column
    counts = np.bincount(tiles[known], minlength=across * down)
    found = [(_deviation(warped, known & (tiles == tile)), tile) for tile in np.flatnonzero(counts >= _FEWEST_IN_TILE)]
    if not found:
        return None
    worst, tile = max(found, key=lambda one: one[0].suspicion)
    top, left = divmod(int(tile), across)
    edges = (left * width // across, top * height // down, (left + 1) * width // across, (top + 1) * height // down)
    return worst, edges


def _same(pair: DepthPair) -> bool:
    first, second = (pair.window.depth_m(row) for row in (pair.first, pair.second))
    return np.array_equal(first, second, equal_nan=True)

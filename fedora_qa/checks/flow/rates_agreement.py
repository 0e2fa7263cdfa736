"""How well two rates of flow agree over one common interval."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.flow.rates_chain import Composed, Segment, compose
from fedora_qa.estimators.depth_warp import lattice_stride
from fedora_qa.estimators.flow_path_kernels import medians_of_parts
from fedora_qa.sequence.window import Window

Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEWEST_PIXELS: Final = 50
"""Pixels below which two rates are not compared."""

_TILES: Final = (8, 6)
_FEWEST_IN_TILE: Final = 20

MOST_LOST: Final = 0.5
"""Share of all pixels that may leave the image by one rate only: where the way of a point bends, some leave it midway
and return, but never most, however few stay."""


@dataclass(frozen=True, slots=True)
class Deviation:
    """A median endpoint error in px, and the median of what it may honestly be."""

    typical_px: float
    bound_px: float

    @property
    def suspicion(self) -> float:
        """Above 1 where most pixels are off by more than they may."""
        return self.typical_px / self.bound_px


@dataclass(frozen=True, slots=True)
class RateAgreement:
    """One segment.

    Attributes
    ----------
    whole, worst_tile, tile
        Over all compared pixels, in the tile that is off most, and that tile: left, top, right, bottom. The first two
        are None where too few pixels could be compared.
    lost
        Share of all pixels that one rate keeps within the image and the other does not.
    """

    segment: Segment
    whole: Deviation | None
    worst_tile: Deviation | None
    tile: tuple[int, int, int, int] | None
    lost: float

    @property
    def suspicion(self) -> float:
        """Above 1 where the segment, or a tile of it, is off."""
        found = [self.lost / MOST_LOST]
        found += [deviation.suspicion for deviation in (self.whole, self.worst_tile) if deviation is not None]
        return max(found)


def compare(window: Window, segment: Segment) -> RateAgreement | None:
    """Compare two rates over a segment; None where a field's size is not the other's, or no flow is known."""
    if len(_shapes(window, segment)) != 1:
        return None
    columns, rows = lattice_of(window, segment)
    slow, fast = (compose(window, chain, columns, rows) for chain in (segment.slow, segment.fast))
    known = slow.clear & slow.stays
    if np.count_nonzero(known | (fast.clear & fast.stays)) < FEWEST_PIXELS:
        return None
    lost = float(np.mean(slow.stays != fast.stays))
    compared = known & fast.clear & fast.stays
    if np.count_nonzero(compared) < FEWEST_PIXELS:
        return RateAgreement(segment, None, None, None, lost)
    error_px = np.linalg.norm(slow.displacement_px - fast.displacement_px, axis=-1)
    bound_px = slow.bound_px + fast.bound_px
    whole = _deviation(error_px[compared], bound_px[compared])
    tiles = _tiles(columns, rows, *_shapes(window, segment).pop())
    worst, tile = _worst_tile(error_px, bound_px, compared, tiles) or (whole, None)
    return RateAgreement(segment, whole, worst, tile, lost)


def median_error_px(slow: Composed, fast: Composed) -> float:
    """Return the median endpoint error of two compositions; infinite where too few pixels can be compared."""
    compared = slow.clear & slow.stays & fast.clear & fast.stays
    if np.count_nonzero(compared) < FEWEST_PIXELS:
        return np.inf
    errors_px = np.linalg.norm(slow.displacement_px[compared] - fast.displacement_px[compared], axis=-1)
    return float(np.median(errors_px))


def lattice_of(window: Window, segment: Segment) -> tuple[Float64, Float64]:
    """Return columns and rows (n,) of the pixels that the effort asks for, if the image has so many."""
    height, width = _shapes(window, segment).pop()
    stride = lattice_stride(height, width, window.sampling.tile_share)
    columns, rows = np.meshgrid(np.arange(0.0, width - 1, stride), np.arange(0.0, height - 1, stride))
    return columns.ravel(), rows.ravel()


def _shapes(window: Window, segment: Segment) -> set[tuple[int, int]]:
    """Return the different heights and widths of the fields of a segment."""
    chains = (segment.slow, segment.fast)
    images = (window.flow_px(chain.stream, row) for chain in chains for row in chain.rows)
    return {(image.shape[0], image.shape[1]) for image in images}


@dataclass(frozen=True, slots=True)
class _Tiles:
    """The tile of each pixel, (n,), and the image's size."""

    numbers: NDArray[np.intp]
    width: int
    height: int

    def edges(self, tile: int) -> tuple[int, int, int, int]:
        """Return left, top, right, bottom of a tile."""
        (across, down), (top, left) = _TILES, divmod(tile, _TILES[0])
        return (
            left * self.width // across,
            top * self.height // down,
            (left + 1) * self.width // across,
            (top + 1) * self.height // down,
        )


def _tiles(columns: Float64, rows: Float64, height: int, width: int) -> _Tiles:
    across, down = _TILES
    return _Tiles(
        (rows * down / height).astype(np.intp) * across + (columns * across / width).astype(np.intp), width, height
    )


def _deviation(error_px: Float64, bound_px: Float64) -> Deviation:
    return Deviation(float(np.median(error_px)), float(np.median(bound_px)))


def _worst_tile(
    error_px: Float64, bound_px: Float64, compared: Mask, tiles: _Tiles
) -> tuple[Deviation, tuple[int, int, int, int]] | None:
    """Return the tile that is off most; None where no tile holds enough pixels."""
    pixels = np.flatnonzero(compared)
    pixels = pixels[np.argsort(tiles.numbers[pixels], kind="stable")]
    counts = np.bincount(tiles.numbers[pixels], minlength=_TILES[0] * _TILES[1])
    starts = np.concatenate(([0], np.cumsum(counts)))
    typical_px, limits_px = (medians_of_parts(values[pixels], starts) for values in (error_px, bound_px))
    enough = counts >= _FEWEST_IN_TILE
    if not enough.any():
        return None
    tile = int(np.argmax(np.where(enough, typical_px / limits_px, -1.0)))
    worst = Deviation(float(typical_px[tile]), float(limits_px[tile]))
    return worst, tiles.edges(tile)

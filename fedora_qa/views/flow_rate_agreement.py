"""Agreement of two rates of flow over one common interval."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.warp import lattice_stride
from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.flow.path_kernels import medians_of_parts
from fedora_qa.sequence.window import USUAL_PIXELS, Window
from fedora_qa.views.flow_chains import ComposedPaths, Segment, compose

Float64 = NDArray[np.float64]

FEWEST_PIXELS: Final = 50
"""Pixels below which two rates are not compared."""

_TILES: Final = (8, 6)
_FEWEST_PATHS: Final = 2_000
"""Least number of paths in large frames: about forty start in each of 48 tiles, against eighty in other frames.

Medians are stated, and their bounds do not depend on the number of paths: fewer paths leave the limits as they are.
With three rates, the paths of two pairs of rates pass each field. At 1440x1080 a path costs 150 ns for each field,
mostly the time to fetch the eleven lines about it from memory.
"""
_FEWEST_IN_TILE: Final = 20

MOST_LOST: Final = 0.5
"""Largest share of pixels that may leave the image by one rate only. Where the path of a point bends, some points leave
the image midway and return; most points never do."""


@dataclass(frozen=True, slots=True)
class MedianEndpointError:
    """A median endpoint error and the median of its bound from interpolation and rounding.

    Attributes
    ----------
    typical_px
        Median length of the difference of two displacements, px.
    bound_px
        Median of the bounds of that length, px.
    """

    typical_px: float
    bound_px: float

    @property
    def suspicion(self) -> float:
        """Ratio of error to bound: above 1 most pixels exceed their bounds."""
        return self.typical_px / self.bound_px

    @property
    def rank(self) -> tuple[float, float]:
        """Key by which the worst of several is chosen: by excess over the bound, within the bounds by their ratio.

        Whether a deviation matters follows from its excess in px, and not from its ratio to a bound.
        """
        return max(self.typical_px - self.bound_px, 0.0), self.suspicion


@dataclass(frozen=True, slots=True)
class RateAgreement:
    """Agreement of two rates over one common interval.

    Attributes
    ----------
    segment
        The common interval.
    whole
        Error over all compared pixels; None where too few pixels could be compared.
    worst_tile, tile
        Error of the tile whose error exceeds its bound most, and the tile (left, top, right, bottom, px, half-open).
        None where too few pixels could be compared; ``tile`` is also None where no tile holds enough of them.
    lost
        Share of the read pixels that one rate keeps within the image and the other does not.
    pixels_read, pixels_of_field
        Number of pixels whose paths were followed, and of all pixels of a field.
    """

    segment: Segment
    whole: MedianEndpointError | None
    worst_tile: MedianEndpointError | None
    tile: tuple[int, int, int, int] | None
    lost: float
    pixels_read: int = 0
    pixels_of_field: int = 0

    @property
    def suspicion(self) -> float:
        """Above 1 where the segment, or a tile of it, exceeds its bound."""
        suspicions = [self.lost / MOST_LOST]
        suspicions += [error.suspicion for error in (self.whole, self.worst_tile) if error is not None]
        return max(suspicions)


def compare_rates(window: Window, segment: Segment) -> RateAgreement | None:
    """Compare two rates over a segment.

    Parameters
    ----------
    window
        The fields are read from it.
    segment
        Fields of both rates over one interval.

    Returns
    -------
    RateAgreement or None
        None where the fields of both rates differ in size, or where fewer than ``FEWEST_PIXELS`` pixels have a flow of
        either rate.
    """
    shapes = _shapes(window, segment)
    if len(shapes) != 1:
        return None
    height, width = shapes.pop()
    starts = _path_starts(height, width, _steps(height, width, window.sampling.tile_share))
    columns, rows = starts.columns, starts.rows
    slow, fast = (compose(window, chain, columns, rows) for chain in (segment.slow, segment.fast))
    usable = slow.clear & slow.stays
    if np.count_nonzero(usable | (fast.clear & fast.stays)) < FEWEST_PIXELS:
        return None
    # A field of a wrong rate or unit carries pixels out of the image, where no endpoint error can be measured.
    lost = np.count_nonzero(slow.stays != fast.stays) / len(columns)
    compared = np.flatnonzero(usable & fast.clear & fast.stays)
    if len(compared) < FEWEST_PIXELS:
        return RateAgreement(segment, None, None, None, lost, len(columns), height * width)
    apart_px = slow.displacement_px[compared] - fast.displacement_px[compared]
    error_px = np.sqrt(np.square(apart_px[:, 0]) + np.square(apart_px[:, 1]))
    # Both compositions err, by any amount within their bounds: bounds add, not their squares.
    bound_px = slow.bound_px[compared] + fast.bound_px[compared]
    whole = MedianEndpointError(median_of(error_px), median_of(bound_px))
    # The worst tile, of those that hold enough pixels, is the one whose error exceeds its bound most.
    tiles = starts.tiles[compared]
    order = np.argsort(tiles, kind="stable")
    counts = np.bincount(tiles, minlength=_TILES[0] * _TILES[1])
    part_starts = np.concatenate(([0], np.cumsum(counts)))
    typical_px, limits_px = (medians_of_parts(values[order], part_starts) for values in (error_px, bound_px))
    enough = counts >= _FEWEST_IN_TILE
    if not enough.any():
        return RateAgreement(segment, whole, whole, None, lost, len(columns), height * width)
    number = int(np.argmax(np.where(enough, typical_px / limits_px, -1.0)))
    worst = MedianEndpointError(float(typical_px[number]), float(limits_px[number]))
    (across, down), (top, left) = _TILES, divmod(number, _TILES[0])
    tile = (left * width // across, top * height // down, (left + 1) * width // across, (top + 1) * height // down)
    return RateAgreement(segment, whole, worst, tile, lost, len(columns), height * width)


def compared_pixels(path: ComposedPaths, other: ComposedPaths) -> NDArray[np.bool_]:
    """Return which pixels both compositions keep within the image and clear of breaks.

    Parameters
    ----------
    path, other
        Compositions of the same n pixels.

    Returns
    -------
    ndarray of bool
        (n,).
    """
    both: NDArray[np.bool_] = path.clear & path.stays & other.clear & other.stays
    return both


def median_error_px(slow: ComposedPaths, fast: ComposedPaths) -> float:
    """Return the median endpoint error of two compositions; infinite where too few pixels can be compared.

    Parameters
    ----------
    slow, fast
        Compositions of the same n pixels by either rate.

    Returns
    -------
    float
        Median length of the difference of both displacements, px.
    """
    compared = compared_pixels(slow, fast)
    if np.count_nonzero(compared) < FEWEST_PIXELS:
        return np.inf
    errors_px = np.linalg.norm(slow.displacement_px[compared] - fast.displacement_px[compared], axis=-1)
    return float(np.median(errors_px))


@dataclass(frozen=True, slots=True)
class _PathStarts:
    """Columns, rows (n,) of a lattice, and the number of the tile that each lies in."""

    columns: Float64
    rows: Float64
    tiles: NDArray[np.intp]


@lru_cache(maxsize=4)
def _path_starts(height: int, width: int, steps: tuple[int, int]) -> _PathStarts:
    """Return every so many-th pixel of an image along columns and rows; they are the same in every field of a file."""
    columns, rows = np.meshgrid(np.arange(0.0, width - 1, steps[0]), np.arange(0.0, height - 1, steps[1]))
    columns, rows = columns.ravel(), rows.ravel()
    across, down = _TILES
    tiles = (rows * down / height).astype(np.intp) * across + (columns * across / width).astype(np.intp)
    return _PathStarts(columns, rows, tiles)


def path_starts(window: Window, segment: Segment) -> tuple[Float64, Float64]:
    """Return the pixels at which paths start, as many as the effort asks for.

    Parameters
    ----------
    window
        The fields are read from it.
    segment
        Its fields give the size of the image.

    Returns
    -------
    columns
        (n,) px.
    rows
        (n,) px.
    """
    height, width = _shapes(window, segment).pop()
    starts = _path_starts(height, width, _steps(height, width, window.sampling.tile_share))
    return starts.columns, starts.rows


def _steps(height: int, width: int, share: float) -> tuple[int, int]:
    """Return the steps between pixels that paths start from, along columns and along rows.

    In large frames those of one row lie nine times as close as the rows: paths beside each other share the lines about
    them, and with as many paths three quarters of a field need not be read from memory.
    """
    if height * width <= USUAL_PIXELS:
        stride = lattice_stride(height, width, share)
        return stride, stride
    stride = max(1, min(round(1 / share), int(np.sqrt(height * width / _FEWEST_PATHS))))
    return (stride, stride) if stride < 3 else (stride // 3, 3 * stride)


def _shapes(window: Window, segment: Segment) -> set[tuple[int, int]]:
    """Return the different heights and widths of the fields of a segment; those of one rate are of one shape."""
    images = (window.flow_px(chain.stream, chain.rows[0]) for chain in (segment.slow, segment.fast))
    return {(image.shape[0], image.shape[1]) for image in images}

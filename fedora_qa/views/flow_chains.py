"""Fields of one rate composed to a longer interval, and the agreement of two rates over it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.warp import lattice_stride
from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.flow.path_kernels import (
    PathStates,
    interpolation_errors,
    medians_of_parts,
    spans_at_targets,
    step,
)
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import USUAL_PIXELS, Window
from fedora_qa.views.flow_intervals import frame_at

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
FieldTransform = Callable[[Float32], NDArray[np.floating]]
"""Change of a stored field (H, W, 2) before it is composed."""

_MOST_FIELDS: Final = 12
"""Most fields of a common interval: five of 50 Hz, or five of 25 Hz against two of 10 Hz, with a margin."""

_MANY: Final = 1 / 16
"""Number of paths per pixel above which evaluating all pixels of a field is faster than evaluating those about each
path."""

_ROUNDING_PX: Final = 18 * 2.0**-24
"""Single-precision rounding of a flow, for each pixel of width and height; ``geometry.rigid_flow`` derives it in full.

Four roundings of 2 f (1 + |m|) and of pixel and principal point, with f = 0.87 W at 60 degrees: below 18 W.
"""

_NOT_TESTED: Final = np.empty((0, 0, 4), dtype=np.float32)
_NOT_COMPUTED: Final = np.empty((0, 0), dtype=np.float32)

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
class Chain:
    """Consecutive fields of one rate, by row, that lead from one instant to another.

    Attributes
    ----------
    stream
        ``flow/<rate>hz``.
    rows
        In the order of time; each field begins where the one before it ends.
    """

    stream: str
    rows: tuple[int, ...]

    def shifted(self, fields: int) -> "Chain":
        """Return the chain of the fields whose rows are larger by a number."""
        return Chain(self.stream, tuple(row + fields for row in self.rows))


@dataclass(frozen=True, slots=True)
class Segment:
    """An interval that two rates cover by whole fields.

    Attributes
    ----------
    slow, fast
        Fields of the lower and of the higher rate, from the start to the end.
    start_ns, end_ns
        Ns from the file's origin.
    """

    slow: Chain
    fast: Chain
    start_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class ComposedPaths:
    """Where pixels are taken by the fields of a chain.

    Attributes
    ----------
    displacement_px
        (n, 2) sum of the fields along each pixel's path, px (u right, v down); invalid where the path does not stay.
    bound_px
        (n,) bound of its error by interpolation and rounding, px.
    clear
        (n,) whether the flow is finite all along the path, and the path keeps away from breaks of the flow and from
        places where surfaces meet. A single field is read at its pixels, so its path need not keep away from either.
    stays
        (n,) whether the path ends, and lies, within the image.
    """

    displacement_px: Float64
    bound_px: Float64
    clear: Mask
    stays: Mask


def segments(window: Window, slow: str, fast: str) -> Iterator[Segment]:
    """Yield the shortest common intervals that begin with a field of the slower rate that the window owns.

    Parameters
    ----------
    window
        Owns the slower fields at which the segments begin.
    slow, fast
        Streams of flow, of the lower and of the higher rate.

    Yields
    ------
    Segment
        Segments of at most ``_MOST_FIELDS`` fields, in the order of time.
    """
    slow_clock, fast_clock = window.facts.clocks[slow], window.facts.clocks[fast]
    if slow_clock.ends_ns is None or fast_clock.ends_ns is None:
        return
    for row in window.owned(slow):
        start_ns = int(slow_clock.times_ns[row])
        fast_row = frame_at(fast_clock, start_ns)
        if fast_row is None or not slow_clock.advancing[row]:
            continue
        slow_rows, fast_rows = [row], [fast_row]
        # The rate that ends earlier takes its next field, until both end together.
        while len(slow_rows) + len(fast_rows) <= _MOST_FIELDS:
            slow_end, fast_end = int(slow_clock.ends_ns[slow_rows[-1]]), int(fast_clock.ends_ns[fast_rows[-1]])
            if slow_end == fast_end:
                yield Segment(Chain(slow, tuple(slow_rows)), Chain(fast, tuple(fast_rows)), start_ns, slow_end)
                break
            clock, rows, end_ns = (
                (fast_clock, fast_rows, fast_end) if fast_end < slow_end else (slow_clock, slow_rows, slow_end)
            )
            following = frame_at(clock, end_ns)
            if following is None or following == rows[-1]:
                break
            rows.append(following)


def exists(facts: Facts, chain: Chain) -> bool:
    """Whether the file holds every field of a chain.

    Parameters
    ----------
    facts
        With the number of fields of each stream.
    chain
        Its rows may lie outside the file.
    """
    return chain.rows[0] >= 0 and chain.rows[-1] < facts.sizes[f"path/{chain.stream}"]


def compose(
    window: Window, chain: Chain, columns: Float64, rows: Float64, transform: FieldTransform | None = None
) -> ComposedPaths:
    """Follow pixels along a chain of fields.

    Parameters
    ----------
    window
        The fields are read from it.
    chain
        Fields in the order of time.
    columns, rows
        (n,) integer coordinates of the pixels in the first field, px.
    transform
        Applied to each stored field (H, W, 2) before it is composed; none if None.

    Returns
    -------
    ComposedPaths
        Paths of the n pixels.
    """
    n = len(columns)
    paths = PathStates(columns.copy(), rows.copy(), np.zeros(n), np.ones(n, np.bool_), np.ones(n, np.bool_))
    last = len(chain.rows) - 1
    for number, row in enumerate(chain.rows):
        flow_px = window.flow_px(chain.stream, row)
        if transform is not None:
            flow_px = transform(flow_px)
        lines = _lines(flow_px)
        stored = None if transform is not None else (chain.stream, row)
        spans, errors_px = _NOT_TESTED, _NOT_COMPUTED
        # At the end of the last field nothing is read any more, so its targets need no test.
        if number < last:
            spans = _of_field(window, stored, spans_at_targets, lines)
        # A path reads few pixels: evaluating the whole field pays only with many paths to a pixel.
        if last > 0 and _MANY * lines.size < 2 * n:
            errors_px = _of_field(window, stored, interpolation_errors, lines)
        rounding_px = _ROUNDING_PX * (lines.shape[0] + lines.shape[1] // 2) + _storage_px(window, chain.stream, lines)
        step(lines, spans, errors_px, rounding_px, number == 0, last > 0, paths)
    displacement_px = np.stack((paths.x - columns, paths.y - rows), axis=-1)
    return ComposedPaths(displacement_px, paths.bound_px, paths.clear, paths.stays)


def _storage_px(window: Window, stream: str, lines: Float32) -> float:
    """Return the largest error of a flow vector of a field (H, 2 W) by the step in which flow is stored, px.

    Bilinear interpolation is a mean of stored values, and errs by no more than they do.
    """
    step = window.facts.steps.get(f"path/{stream}")
    if step is None or not step.is_coarse:
        return 0.0  # float32 is in ``_ROUNDING_PX``
    largest_px = float(np.nanmax(np.abs(lines), initial=0.0, where=np.isfinite(lines)))
    return float(np.hypot(*(step.component(axis).error_bounds(largest_px) for axis in range(2))))


def _of_field(
    window: Window, field: tuple[str, int] | None, compute: Callable[[Float32], Float32], lines: Float32
) -> Float32:
    """Return a result computed from a field. The window keeps the results of stored fields."""
    return compute(lines) if field is None else window.derived(_of_stored_field, compute, *field)


def _of_stored_field(window: Window, compute: Callable[[Float32], Float32], stream: str, row: int) -> Float32:
    return compute(_lines(window.flow_px(stream, row)))


def _lines(flow_px: Float32) -> Float32:
    """Return a field (H, W, 2) as rows of interleaved u and v, contiguous float32: the layout that kernels read."""
    return np.ascontiguousarray(flow_px, dtype=np.float32).reshape(len(flow_px), -1)


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

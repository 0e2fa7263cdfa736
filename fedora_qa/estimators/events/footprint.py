"""Frames resampled to the pixels of the event camera: area averages in linear intensity.

Two cameras with one centre and one orientation image a ray at pixels with ``x_to = K_to K_from^-1 x_from``. Columns and
rows are separate where the skew is 0. A pixel u covers [u - 1/2, u + 1/2].

The mean over an interval is the difference of the primitive (the integral of the image) at its ends, over its length.
At the borders of frame pixels the primitive is known exactly, because a frame pixel is itself a mean. Inside a pixel
two reconstructions bracket the primitive. The straight line (*uniform*) gives the pixel one value, which widens the
footprint and reduces contrast. The cubic through the four nearest borders (*edge-aware*) is exact for smooth images and
too steep at steps.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Bool = NDArray[np.bool_]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Weighted32 = tuple[NDArray[np.int64], Float32]
"""First pixel (m,) and weights (m, k) of the pixels from there."""

LEFT_BY_SHARP = 0.7
"""Bound on the error of a result by the edge-aware reconstruction, as a share of its distance from the result by the
uniform one.

On smooth images the cubic has almost no error; steps are the worst case. Consider unit steps at random places that move
by s frame pixels between two frames, with footprints of 9/4 frame pixels. At s = 1, 2, 3, 4 the amplitude of the change
is too small by 6.6, 4.4, 2.8, 2.0% (uniform) and by 2.7, 1.2, 0.5, 0.3% (edge-aware). The error of the edge-aware one
is 0.68, 0.38, 0.23, 0.20 times the difference of both. Motion of less than a frame pixel gives few events."""


@dataclass(frozen=True, slots=True)
class FootprintTaps:
    """Weights of successive frame pixels along one axis, for m pixels of the event camera.

    Attributes
    ----------
    first
        (m,) index of the first frame pixel.
    weights
        (m, k) weights of the k frame pixels from there on.
    """

    first: NDArray[np.int64]
    weights: Float64


class AxisWeights(NamedTuple):
    """A ``FootprintAxis`` in single precision, for compiled loops.

    Attributes
    ----------
    uniform, edge_aware, split
        First frame pixel (m,) and weights (m, k) of each reconstruction.
    inside
        (m,) True where the footprint lies wholly in the frame.
    """

    uniform: Weighted32
    edge_aware: Weighted32
    split: Weighted32
    inside: Bool


class FrameReconstructions(NamedTuple):
    """A frame at the pixels of the event camera.

    Attributes
    ----------
    edge_aware, uniform
        (h, w) means over the footprints by both reconstructions, DN.
    error
        (h, w) bound on the error of ``uniform``, DN; infinite where it is not known.
    """

    edge_aware: Float32
    uniform: Float32
    error: Float32


_RECONSTRUCTIONS = "uniform", "edge_aware", "split"


@dataclass(frozen=True, slots=True)
class FootprintAxis:
    """Weights of the frame pixels for the m pixels of the event camera, along one axis.

    Attributes
    ----------
    uniform, edge_aware
        Weights of means over the footprint, by the straight line and by the cubic.
    split
        The weights ``uniform``, each times the share of its frame pixel that lies in the footprint.
    inside
        (m,) True where the footprint lies wholly in the frame.
    """

    uniform: FootprintTaps
    edge_aware: FootprintTaps
    split: FootprintTaps
    inside: NDArray[np.bool_]

    def packed(self) -> NDArray[np.void]:
        """Return the axis as one structured array (m,), with a record for each pixel."""
        columns: list[tuple[str, NDArray[Any]]] = [("inside", self.inside)]
        for name in _RECONSTRUCTIONS:
            taps = getattr(self, name)
            columns += [(f"{name}_first", taps.first), (name, taps.weights)]
        table = np.empty(len(self.inside), [(name, column.dtype, column.shape[1:]) for name, column in columns])
        for name, column in columns:
            table[name] = column
        return table

    @staticmethod
    def unpacked(table: NDArray[np.void]) -> "FootprintAxis":
        """Return the axis from an array that ``packed`` made."""
        own = {name: np.ascontiguousarray(table[name]) for name in table.dtype.names or ()}
        uniform, edge_aware, split = (FootprintTaps(own[f"{name}_first"], own[name]) for name in _RECONSTRUCTIONS)
        return FootprintAxis(uniform, edge_aware, split, own["inside"])

    @property
    def single_precision(self) -> AxisWeights:
        """The weights in single precision."""
        taps = self.uniform, self.edge_aware, self.split
        uniform, edge_aware, split = ((each.first, each.weights.astype(np.float32)) for each in taps)
        return AxisWeights(uniform, edge_aware, split, self.inside)


@dataclass(frozen=True, slots=True)
class Footprints:
    """The footprints of the pixels of an event camera in a frame.

    Attributes
    ----------
    rows, columns
        Weights of the rows, and of the columns, of the frame.
    """

    rows: FootprintAxis
    columns: FootprintAxis

    def resample(
        self, luma: Float32, clipped: Bool, rounding: float, *, edge_aware: Float32, uniform: Float32, error: Float32
    ) -> None:
        """Write both averages of an image, and a bound on the error of the uniform one.

        A frame pixel of mean m whose share s lies in the footprint counts as s m. If the pixel contains a step of
        height d, the error is at most s (1 - s) d, which is reached where the step lies along the border. The bound is
        ``rounding`` plus the sum of s (1 - s) d over the footprint, relative to its size, where d is the range of
        values among the pixel and its eight neighbours. It is infinite where a footprint leaves the image, or touches a
        clipped pixel or a neighbour of one.

        Parameters
        ----------
        luma
            (H, W) linear intensity, DN.
        clipped
            (H, W) True where the value is not known.
        rounding
            Bound on the error of each value of the image, DN.
        edge_aware, uniform, error
            (h, w) receive both averages and the bound, DN.
        """
        rows, columns = self.rows.single_precision, self.columns.single_precision
        resample_frame(luma, clipped, rows, columns, rounding, FrameReconstructions(edge_aware, uniform, error))


def footprint_axis(
    K_frame: Float64, shape_frame: tuple[int, int], K_event: Float64, shape_event: tuple[int, int], axis: int
) -> FootprintAxis:
    """Return the weights of the rows (axis 0) or columns (1) of the frame for those of the event camera.

    Parameters
    ----------
    K_frame, K_event
        (3, 3) intrinsics without skew, px; pixel centres are whole numbers.
    shape_frame, shape_event
        Rows and columns of the frame (H, W) and of the event camera (h, w).
    axis
        0 or 1.
    """
    # K[0] holds f_x and c_x, K[1] holds f_y and c_y.
    frame, event = K_frame[1 - axis, [1 - axis, 2]], K_event[1 - axis, [1 - axis, 2]]
    size_frame, size_event = shape_frame[axis], shape_event[axis]
    # Edges of event pixels in frame pixels, from the left border of the first: x_to = K_to K_from^-1 x_from.
    # Pixel centres are whole numbers: -0.5 is the left border of a pixel, +0.5 counts from the left border of the
    # frame.
    edges = (np.arange(size_event + 1) - 0.5 - event[1]) * (frame[0] / event[0]) + frame[1] + 0.5
    lengths = np.diff(edges)[:, np.newaxis]
    uniform = _means(edges, size_frame, points=2)
    edge_aware = _means(edges, size_frame, points=min(4, size_frame + 1))
    # K in a file can be wrong by a millionth of a pixel; equal fields of view must still count as inside.
    inside = (edges[:-1] >= -1e-6) & (edges[1:] <= size_frame + 1e-6)
    return FootprintAxis(
        FootprintTaps(uniform.first, uniform.weights / lengths),
        FootprintTaps(edge_aware.first, edge_aware.weights / lengths),
        # s^2 / length, where ``uniform`` is s / length: their difference is the s (1 - s) of ``resample``.
        FootprintTaps(uniform.first, uniform.weights**2 / lengths),
        inside,
    )


def _means(edges: Float64, size: int, points: int) -> FootprintTaps:
    """Return the weights of pixels in the integral between successive edges, by Lagrange polynomials of ``points``.

    The primitive at border k is the sum of the pixels before it. The weight of pixel j is therefore the sum of the
    weights of all borders after it.
    """
    # A footprint that leaves the frame is cut to it. ``inside`` excludes it, so that its weights need not add up to 1.
    positions = np.clip(edges, 0.0, size)
    first = np.clip(np.floor(positions).astype(np.int64) - points // 2 + 1, 0, size + 1 - points)
    # Lagrange: l_i(x) = prod_{j != i} (x - x_j) / (x_i - x_j), of the borders x_j around each edge.
    borders, since = np.ones((points, len(edges))), positions - first
    for i in range(points):
        for j in range(points):
            if j != i:
                borders[i] *= (since - j) / (i - j)
    count = min(int(np.diff(first).max(initial=0)) + points - 1, size)
    start = np.minimum(first[:-1], size - count)
    behind = np.zeros((len(edges), points + 1))
    behind[:, :points] = borders[::-1].cumsum(axis=0)[::-1].T
    pixels = start[:, np.newaxis] + np.arange(count)

    def before(edge: slice) -> Float64:
        since = np.clip(pixels + 1 - first[edge, np.newaxis], 0, points)
        return np.take_along_axis(behind[edge], since, axis=1)

    # The integral over a footprint is the primitive at its end less that at its start.
    weights = before(slice(1, None)) - before(slice(None, -1))
    # Weights of the size of rounding become 0: a clipped pixel with such a weight would exclude the footprint.
    weights[np.abs(weights) < 1e-12] = 0.0
    return FootprintTaps(start, weights)


@njit(cache=True)
def resample_frame(
    luma: Float32,
    clipped: Bool,
    rows: AxisWeights,
    columns: AxisWeights,
    rounding: float,
    resampled: FrameReconstructions,
) -> None:
    """Write both averages of a frame and the bound on the error of the uniform one, as ``Footprints.resample``.

    The frame is processed row by row, so that all other arrays stay in the cache.

    Parameters
    ----------
    luma
        (H, W) linear intensity, DN.
    clipped
        (H, W) True where the value is not known.
    rows, columns
        Weights of the rows and of the columns.
    rounding
        Bound on the error of each value of the frame, DN.
    resampled
        (h, w) arrays that receive the results, DN.
    """
    width = luma.shape[1]
    uniform_rows, edge_aware_rows, split_rows, inside_rows = rows
    uniform_columns, edge_aware_columns, split_columns, inside_columns = columns
    edge_aware_means, uniform_means, errors = resampled
    # Most rows have no clipped pixel: they are not searched again.
    clipped_rows = np.empty(len(clipped), np.bool_)
    for row in range(len(clipped)):
        clipped_row, any_clipped = clipped[row], False
        for column in range(len(clipped_row)):  # without an exit, so that many pixels are read at once
            any_clipped |= clipped_row[column]
        clipped_rows[row] = any_clipped
    beyond = np.empty(len(inside_columns), np.float32)
    for column in range(len(beyond)):
        beyond[column] = rounding if inside_columns[column] else np.inf
    edge_aware, uniform, whole, split = (np.empty(width, np.float32), np.empty(width, np.float32),
                                 np.empty(width, np.float32), np.empty(width, np.float32))  # fmt: skip
    taps = uniform_rows[1].shape[1]
    # The last rows of the contrast are kept with their numbers: neighbouring footprints share one of these rows.
    contrast, kept_rows = np.empty((taps, width), np.float32), np.full(taps, -1)
    high, low, near_clipped = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.bool_)
    for row in range(len(errors)):
        _add_rows32(luma, edge_aware_rows[0][row], edge_aware_rows[1][row], edge_aware)
        _add_columns32(edge_aware, edge_aware_columns[0], edge_aware_columns[1], edge_aware_means[row])
        first, weights = uniform_rows[0][row], uniform_rows[1][row]
        _add_rows32(luma, first, weights, uniform)
        whole[:], split[:] = 0.0, 0.0
        for i in range(taps):
            slot = (first + i) % taps
            if kept_rows[slot] != first + i:
                _contrast_of_row(luma, first + i, high, low, contrast[slot])
                kept_rows[slot] = first + i
            # resample: the contrast of each cut pixel has the weight s (1 - s).
            _add_contrast(contrast[slot], weights[i], split_rows[1][row, i], whole, split)
        error = errors[row]
        _add_uniform_columns(uniform, whole, split, uniform_columns, split_columns[1], uniform_means[row], error)
        if inside_rows[row]:
            for column in range(len(error)):
                error[column] += beyond[column]
        else:
            error[:] = np.inf
        if _mark_clipped(clipped, clipped_rows, first, weights, near_clipped):
            _exclude_columns(near_clipped, uniform_columns[0], uniform_columns[1], error)


@njit(cache=True, fastmath={"contract"})
def _add_rows32(image: Float32, first: int, weights: Float32, line: Float32) -> None:
    """Write the weighted sum (W,) of successive rows of an image."""
    line[:] = 0.0
    for i in range(len(weights)):
        weight, row = weights[i], image[first + i]
        if weight != 0.0:
            for column in range(len(line)):
                line[column] += weight * row[column]


@njit(cache=True, fastmath={"contract"})
def _add_contrast(row: Float32, weight: np.float32, split_weight: np.float32, whole: Float32, split: Float32) -> None:
    """Add a row to two lines, each with its weight; the weights are 0 together or not at all."""
    if weight != 0.0:
        for column in range(len(whole)):
            whole[column] += weight * row[column]
            split[column] += split_weight * row[column]


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _add_columns32(line: Float32, first: NDArray[np.int64], weights: Float32, means: Float32) -> None:
    """Write the weighted sums (w,) of successive values of a line (W,)."""
    for column in range(len(means)):
        # Unsigned: an index that can be negative costs a comparison at each access.
        pixel, total = np.uint64(first[column]), np.float32(0)
        for i in range(weights.shape[1]):
            total += weights[column, i] * line[pixel + np.uint64(i)]
        means[column] = total


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _add_uniform_columns(
    uniform: Float32,
    whole: Float32,
    split: Float32,
    uniform_columns: Weighted32,
    split_weights: Float32,
    means: Float32,
    bounds: Float32,
) -> None:
    """Write the means (w,) of ``uniform``, and the bounds (w,): means of ``whole`` less those of ``split``."""
    first, weights = uniform_columns
    for column in range(len(means)):
        start, mean, bound = np.uint64(first[column]), np.float32(0), np.float32(0)
        for i in range(weights.shape[1]):
            pixel, weight = start + np.uint64(i), weights[column, i]
            mean += weight * uniform[pixel]
            bound += weight * whole[pixel] - split_weights[column, i] * split[pixel]
        means[column], bounds[column] = mean, bound


@njit(cache=True)
def _contrast_of_row(luma: Float32, row: int, high: Float32, low: Float32, contrast: Float32) -> None:
    """Write the range of values among each pixel of a row and its eight neighbours."""
    height, width = luma.shape
    above, line, below = luma[max(row - 1, 0)], luma[row], luma[min(row + 1, height - 1)]
    for column in range(width):
        high[column] = max(above[column], line[column], below[column])
        low[column] = min(above[column], line[column], below[column])
    for column in range(1, width - 1):
        most = max(high[column - 1], high[column], high[column + 1])
        least = min(low[column - 1], low[column], low[column + 1])
        contrast[column] = most - least
    for column in (0, width - 1):
        left, right = max(column - 1, 0), min(column + 1, width - 1)
        most = max(high[left], high[column], high[right])
        least = min(low[left], low[column], low[right])
        contrast[column] = most - least


@njit(cache=True)
def _mark_clipped(clipped: Bool, clipped_rows: Bool, first: int, weights: Float32, near_clipped: Bool) -> bool:
    """Mark columns with a clipped pixel in the rows of nonzero weight or beside them; return whether any is marked."""
    start, stop = len(clipped), 0
    for i in range(len(weights)):
        if weights[i] != 0.0:
            start, stop = min(start, max(first + i - 1, 0)), max(stop, min(first + i + 2, len(clipped)))
    if not np.any(clipped_rows[start:stop]):
        return False
    near_clipped[:] = False
    for row in range(start, stop):
        if clipped_rows[row]:
            for column in range(len(near_clipped)):
                near_clipped[column] |= clipped[row, column]
    return True


@njit(cache=True)
def _exclude_columns(near_clipped: Bool, first: NDArray[np.int64], weights: Float32, error: Float32) -> None:
    """Set the error to infinity where a column of nonzero weight, or one beside it, is marked."""
    # Number of marked columns before each column: a range holds a marked one if the numbers at its ends differ.
    before = 0
    until = np.zeros(len(near_clipped) + 1, np.int64)
    for column in range(len(near_clipped)):
        before += near_clipped[column]
        until[column + 1] = before
    for column in range(len(error)):
        start, stop = len(near_clipped), 0
        for i in range(weights.shape[1]):
            if weights[column, i] != 0.0:
                pixel = first[column] + i
                start, stop = min(start, max(pixel - 1, 0)), max(stop, min(pixel + 2, len(near_clipped)))
        if stop > start and until[stop] > until[start]:
            error[column] = np.inf

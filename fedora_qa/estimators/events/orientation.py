"""Whether events and frames agree in axes, direction and sign: correlation of their changes.

The change of level between frames is compared with the sum of the events in between, averaged over blocks of pixels
(which forgives small shifts), under the eight symmetries of the square and both signs. Blocks are squares of a side; as
many as fit lie in the middle of an image (h, w), so that mirroring maps their grid onto itself (to half a pixel).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

BLOCK_PX: Final = 4
"""Side of the blocks whose means are compared."""

LEAST_LIGHT: Final = 1e-3
"""Floor of the light whose logarithm is taken, DN."""

SYMMETRIES: Final = tuple((swap, left, up) for swap in (False, True) for left in (False, True) for up in (False, True))
"""Possible transforms of the events: axes exchanged, then columns mirrored, then rows mirrored."""

LEAST_PREDICTED: Final = 0.3
"""Below this correlation the noise model of the prediction itself is in doubt."""

FEWEST_BLOCKS: Final = 100
"""A part with fewer blocks, over all its frames, correlates by chance."""

FEWEST_UPRIGHT: Final = 0.25
"""Fraction of the parts that must agree as declared, by half of what is due, for the rest to be outliers."""

DEPENDENT: Final = 3.0
"""Standard error of a correlation over that of independent blocks: blocks of one moving texture are not independent."""


@dataclass(frozen=True, slots=True)
class ChangeMoments:
    """Sums over blocks of frame change d and event change e: (k, 6) of 1, d, e, d d, e e, d e."""

    sums: Float64

    def correlations(self) -> Float64:
        """Return the k correlation coefficients; 0 where either does not vary."""
        n, d, e, dd, ee, de = self.sums.T
        # Pearson: (de - d e / n) over the root of the product of both variances.
        n = np.maximum(n, 1.0)
        spread = np.sqrt(np.maximum((dd - d * d / n) * (ee - e * e / n), 0.0))
        covariance = de - d * e / n
        correlations: Float64 = np.divide(covariance, spread, out=np.zeros_like(spread), where=spread > 0)
        return correlations

    def frame_variance(self) -> float:
        """Return the variance of d (of the first row)."""
        n, d, _, dd, *_ = self.sums[0]
        return max(float(dd - d * d / max(n, 1.0)), 0.0) / max(float(n), 1.0)


@dataclass(frozen=True, slots=True)
class PartOrientation:
    """The part whose events gain most by another orientation.

    Attributes
    ----------
    parts
        (k,) those in which this orientation is the better one.
    orientation
        Its number, as ``other_correlations`` orders them.
    declared, other
        Correlations of the worst part, as declared and in that orientation.
    standard_error
        Of their difference.
    compared
        Parts that were compared.
    """

    parts: Bool
    orientation: int
    declared: float
    other: float
    standard_error: float
    compared: int


def other_correlations(correlations: Float64) -> Float64:
    """Return the correlations of the fifteen orientations that are not declared.

    Parameters
    ----------
    correlations
        (8,) under the symmetries of ``SYMMETRIES``, polarity as declared.

    Returns
    -------
    Float64
        (15,): eight with polarity inverted, then seven as declared in polarity.
    """
    # Inverted polarity negates e, and so the correlation; the first symmetry is the declared orientation itself.
    upright = correlations[: len(SYMMETRIES)]
    return np.concatenate([-upright, upright[1:]])


def transformation(orientation: int) -> tuple[bool, tuple[bool, bool, bool]]:
    """Return the transform of the events that an orientation stands for.

    Parameters
    ----------
    orientation
        Index into ``other_correlations``, 0 to 14.

    Returns
    -------
    tuple[bool, tuple[bool, bool, bool]]
        Whether polarity is inverted, and the symmetry as in ``SYMMETRIES``.
    """
    count = len(SYMMETRIES)
    return orientation < count, SYMMETRIES[orientation if orientation < count else orientation - count + 1]


def most_reoriented(parts: Sequence[ChangeMoments], noise: float) -> PartOrientation | None:
    """Return the part that gains most by another orientation; None where few parts agree as declared.

    Parameters
    ----------
    parts
        Moments (8, 6) of each part under the eight symmetries.
    noise
        Variance that events leave open in the change of a block, in squared units of the level.

    Returns
    -------
    PartOrientation | None
        The part with the largest gain, and the parts that share its orientation.
    """
    sums = np.array([part.sums for part in parts])
    counts = sums[:, 0, 0]
    frame_variance = np.array([part.frame_variance() for part in parts])
    informative = (counts >= FEWEST_BLOCKS) & (sums[:, 0, 4] > 0)
    # Correlation of a signal with itself and independent noise: sqrt(s / (s + noise)).
    due = np.sqrt(frame_variance / (frame_variance + noise))
    informative &= due >= LEAST_PREDICTED
    declared = np.array([part.correlations()[0] for part in parts])
    upright = np.count_nonzero(informative & (declared > due / 2))
    if upright <= FEWEST_UPRIGHT * np.count_nonzero(informative):
        return None
    alternatives = np.array([other_correlations(part.correlations()) for part in parts])
    # The part that gains most; parts of the same best orientation are taken together with it.
    gains = np.where(informative, alternatives.max(axis=1) - declared, -np.inf)
    worst = int(np.argmax(gains))
    orientation = int(np.argmax(alternatives[worst]))
    alike = informative & (gains > 0) & (np.argmax(alternatives, axis=1) == orientation)
    alike[worst] = True
    return PartOrientation(
        alike,
        orientation,
        float(declared[worst]),
        float(alternatives[worst, orientation]),
        # 1 / sqrt(n) bounds (1 - rho^2) / sqrt(n), the standard error of a correlation (Pearson and Filon 1898).
        float(DEPENDENT / np.sqrt(counts[worst])),
        int(np.count_nonzero(informative)),
    )


def level_blocks(light: Float32, error: Float32, dark: float | None) -> Float64:
    """Return the means of a frame's signal over blocks (r, c); NaN where it is not known of all pixels of a block.

    The signal is the logarithm of ``light`` (h, w) and ``dark``, or the light itself without one. It is known where the
    light is above twice its error (h, w). The mean of logarithms is the logarithm of the product: one for each block.

    Parameters
    ----------
    light, error
        (h, w) light and its error, DN.
    dark
        DN; None for a sensor of the linear model.

    Returns
    -------
    Float64
        (r, c) in nat, or in DN without ``dark``.
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
    """Block means (n - 1, r, c) of the events' sums between frames: as they lie, and with axes exchanged."""

    upright: Float64
    swapped: Float64


def event_blocks(counts: NDArray[np.int32], threshold_on: float, threshold_off: float) -> EventBlocks:
    """Return the block means of the events' sums between frames.

    Parameters
    ----------
    counts
        (n - 1, 2, h, w) darker and brighter events.
    threshold_on, threshold_off
        Change of the level by one event, as positive numbers.

    Returns
    -------
    EventBlocks
        In the unit of the thresholds.
    """
    side, grid = _grid(counts.shape[2:])
    upright, swapped = np.zeros((2, len(counts), *grid))
    for i in range(len(counts)):
        mean_event_blocks(counts[i], threshold_on, threshold_off, side, upright[i], swapped[i])
    return EventBlocks(upright, swapped)


class EventColumns(NamedTuple):
    """Events in the order of time, (m,) each, as stored: px, ns, and polarity (1 brighter, 0 darker)."""

    x: Int64
    y: Int64
    times_ns: Int64
    p: Int64


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
    """Add events beyond the sensor to the blocks on which they lie with axes exchanged, in place.

    Parameters
    ----------
    blocks
        Whose ``swapped`` is added to.
    x, y, times_ns, p
        (m,) events as stored, in the order of time; px, ns, 1 brighter and 0 darker.
    frame_times_ns
        (n,) of the frames.
    shape
        Rows and columns of the sensor.
    threshold_on, threshold_off
        Change of the level by one event, as positive numbers.
    """
    steps, side = (-threshold_off, threshold_on), _grid(shape)[0]
    events = EventColumns(*(column.astype(np.int64) for column in (x, y, times_ns, p)))
    mean_blocks_beyond(events, frame_times_ns, shape, steps, side, blocks.swapped)


def step_moments(levels: Float64, events: EventBlocks, tiles: int) -> Float64:
    """Return moments (n - 1, tiles^2, 8, 6) of changes between successive frames and events under all symmetries.

    Parameters
    ----------
    levels
        (n, r, c) ``level_blocks`` of the frames.
    events
        Of the n - 1 intervals.
    tiles
        Tiles along each axis.

    Returns
    -------
    Float64
        (n - 1, tiles^2, 8, 6) sums of ``ChangeMoments``, tiles by rows.
    """
    sums = np.zeros((len(events.upright), tiles**2, len(SYMMETRIES), 6))
    for i, (upright, swapped) in enumerate(zip(events.upright, events.swapped, strict=True)):
        add_moments(levels[i + 1] - levels[i], upright, swapped, tiles, sums[i])
    return sums


def span_moments(levels: Float64, events: EventBlocks) -> ChangeMoments:
    """Return moments of the change from the first frame to the last and of all events in between.

    Parameters
    ----------
    levels
        (n, r, c) ``level_blocks`` of the frames.
    events
        Of the n - 1 intervals.

    Returns
    -------
    ChangeMoments
        (8, 6), of the whole image.
    """
    sums = np.zeros((1, len(SYMMETRIES), 6))
    add_moments(levels[-1] - levels[0], events.upright.sum(axis=0), events.swapped.sum(axis=0), 1, sums)
    return ChangeMoments(sums[0])


def _grid(shape: tuple[int, ...]) -> tuple[int, tuple[int, int]]:
    """Return the side of blocks, and how many rows and columns of them fit into an image (h, w)."""
    side = min(BLOCK_PX, *shape)
    return side, (shape[0] // side, shape[1] // side)


@njit(cache=True)
def add_blocks(light: Float32, error: Float32, side: int, sums: Float64) -> None:
    """Write the sums (r, c) of an image (h, w) over blocks; NaN where it is not all above twice its error."""
    rows, columns = sums.shape
    top, left = (light.shape[0] - rows * side) // 2, (light.shape[1] - columns * side) // 2
    line = np.empty(columns * side)
    for row in range(rows):
        line[:] = 0.0
        for y in range(top + row * side, top + (row + 1) * side):
            values, errors = light[y, left : left + len(line)], error[y, left : left + len(line)]
            for x in range(len(line)):
                line[x] += np.float64(values[x]) if values[x] > 2 * errors[x] else np.nan
        sums[row] = 0.0
        _add_line(line, 0, side, sums[row])


@njit(cache=True)
def multiply_blocks(light: Float32, error: Float32, dark: float, least: float, side: int, products: Float64) -> None:
    """Write the products (r, c) over blocks of an image (h, w) and ``dark``, ``least`` at least.

    NaN where the image is not all above twice its error.
    """
    rows, columns = products.shape
    top, left = (light.shape[0] - rows * side) // 2, (light.shape[1] - columns * side) // 2
    line = np.empty(columns * side)
    for row in range(rows):
        line[:] = 1.0
        for y in range(top + row * side, top + (row + 1) * side):
            values, errors = light[y, left : left + len(line)], error[y, left : left + len(line)]
            for x in range(len(line)):
                value = max(values[x] + dark, least)
                # A product of 16 values of up to 1e3 is far below what double precision can hold.
                line[x] *= value if values[x] > 2 * errors[x] else np.nan
        for column in range(columns):
            product = 1.0
            for x in range(column * side, (column + 1) * side):
                product *= line[np.uint64(x)]
            products[row, column] = product


@njit(cache=True)
def mean_event_blocks(
    counts: Int32, step_on: float, step_off: float, side: int, upright: Float64, swapped: Float64
) -> None:
    """Add the mean steps of darker and brighter events (2, h, w) to blocks (r, c): as they lie, and exchanged.

    A pixel of row y and column x lies in row x and column y once axes are exchanged.
    """
    _, height, width = counts.shape
    rows, columns = upright.shape
    top, left = (height - rows * side) // 2, (width - columns * side) // 2
    brighter, darker = step_on / side**2, step_off / side**2
    # Steps of successive rows: of a row of blocks as they lie, and of a column of blocks once axes are exchanged.
    band, other_band = np.zeros(width), np.zeros(width)
    for y in range(height):
        off, on = counts[0, y], counts[1, y]
        for x in range(width):
            step = brighter * on[x] - darker * off[x]
            band[x] += step
            other_band[x] += step
        if (y + 1 - top) % side == 0:
            if 0 <= y - top < rows * side:
                _add_line(band, left, side, upright[(y - top) // side])
            band[:] = 0.0
        # Exchanged, rows y are columns: the last band may be cut by the sensor's last row, and is added as it is.
        if (y + 1 - left) % side == 0 or y + 1 == height:
            if 0 <= y - left < columns * side:
                blocks = swapped[:, (y - left) // side]
                whole = min((len(other_band) - top) // side, len(blocks))
                _add_line(other_band, top, side, blocks[:whole])
                for x in range(top + whole * side, min(len(other_band), top + len(blocks) * side)):
                    blocks[whole] += other_band[x]
            other_band[:] = 0.0


@njit(cache=True)
def _add_line(steps: Float64, first: int, side: int, blocks: Float64) -> None:
    """Add the steps of a line of pixels to successive blocks."""
    x = np.uint64(first)
    for block in range(len(blocks)):
        for _ in range(side):
            blocks[block] += steps[x]
            x += np.uint64(1)


@njit(cache=True)
def mean_blocks_beyond(
    events: EventColumns,
    frame_times: Int64,
    shape: tuple[int, int],
    steps: tuple[float, float],
    side: int,
    swapped: Float64,
) -> None:
    """Add events beyond the sensor to blocks (n - 1, r, c) on which they lie with axes exchanged.

    ``steps`` are those of a darker and a brighter event.
    """
    x, y, t, p = events
    (height, width), (rows, columns) = shape, swapped.shape[1:]
    top, left = (height - rows * side) // 2, (width - columns * side) // 2
    interval = -1
    for i in range(len(t)):
        while interval + 1 < len(frame_times) and frame_times[interval + 1] < t[i]:
            interval += 1
        if interval >= len(swapped):
            break
        on_sensor = 0 <= x[i] < width and 0 <= y[i] < height
        if interval >= 0 and not on_sensor and x[i] >= 0 and y[i] >= 0 and 0 <= p[i] <= 1:
            # With axes exchanged x is the row and y the column.
            down, right = x[i] - top, y[i] - left
            if 0 <= down < rows * side and 0 <= right < columns * side:
                swapped[interval, down // side, right // side] += steps[p[i]] / side**2


@njit(cache=True)
def add_moments(change: Float64, upright: Float64, swapped: Float64, tiles: int, sums: Float64) -> None:
    """Add moments of frame change d and event change e to ``sums`` (tiles^2, 8, 6): 1, d, e, d d, e e, d e.

    Blocks whose change is NaN are left out. Events are taken under the eight symmetries of ``SYMMETRIES``: axes
    exchanged, then columns mirrored, then rows. Tiles are those of the blocks, rows first.
    """
    rows, columns = change.shape
    # A row of changes and its mirror image: that of the events' columns is the same thing.
    is_finite, changes, of_changes = np.empty((2, columns)), np.empty((2, columns)), np.empty(3)
    for row in range(rows):
        for column in range(columns):
            finite = not np.isnan(change[row, column])
            is_finite[0, column] = is_finite[1, columns - 1 - column] = 1.0 if finite else 0.0
            changes[0, column] = changes[1, columns - 1 - column] = change[row, column] if finite else 0.0
        for tile in range(tiles):
            # Columns of which ``column * tiles // columns`` is the tile.
            first, stop = -(-tile * columns // tiles), -(-(tile + 1) * columns // tiles)
            of_tile = sums[tiles * (row * tiles // rows) + tile]
            _sum_changes(is_finite[0, first:stop], changes[0, first:stop], of_changes)
            for symmetry in range(8):
                # Bits of a number, in the order of SYMMETRIES: 4 axes exchanged, 2 columns mirrored, 1 rows mirrored.
                line = (swapped if symmetry & 4 else upright)[rows - 1 - row if symmetry & 1 else row]
                mirrored = (symmetry >> 1) & 1
                begin, end = (columns - stop, columns - first) if mirrored else (first, stop)
                moments = of_tile[symmetry]
                moments[0] += of_changes[0]
                moments[1] += of_changes[1]
                moments[3] += of_changes[2]
                _add_products(is_finite[mirrored, begin:end], changes[mirrored, begin:end], line[begin:end], moments)


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _sum_changes(is_finite: Float64, changes: Float64, sums: Float64) -> None:
    """Write the number of changes, their sum and that of their squares: alike under all symmetries."""
    n, d, dd = 0.0, 0.0, 0.0
    for i in range(len(is_finite)):
        n += is_finite[i]
        d += changes[i]
        dd += changes[i] * changes[i]
    sums[0], sums[1], sums[2] = n, d, dd


@njit(cache=True, fastmath={"reassoc", "nsz", "contract"})
def _add_products(is_finite: Float64, changes: Float64, events: Float64, sums: Float64) -> None:
    """Add the sums of events, of their squares, and of their products with the changes."""
    e, ee, de = 0.0, 0.0, 0.0
    for i in range(len(is_finite)):
        event = is_finite[i] * events[i]
        e += event
        ee += event * event
        de += changes[i] * event
    sums[2] += e
    sums[4] += ee
    sums[5] += de

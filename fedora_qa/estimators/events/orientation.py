"""Agreement of events and frames in axes, direction and sign: correlation of their changes.

The change of the level between frames is compared with the sum of the events in between, under the eight symmetries of
the square and both signs. Both are means over blocks of pixels (``block_means``).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.block_means import EventBlocks, block_grid

Float64 = NDArray[np.float64]
Bool = NDArray[np.bool_]

SYMMETRIES: Final = tuple((swap, left, up) for swap in (False, True) for left in (False, True) for up in (False, True))
"""Transforms of the events: whether axes are exchanged, then columns mirrored, then rows mirrored."""

LEAST_PREDICTED: Final = 0.3
"""Least predicted correlation of a part that is compared. For smaller ones the noise model itself is uncertain."""

FEWEST_BLOCKS: Final = 100
"""Least number of blocks of a part, over all its frames. Fewer blocks correlate by chance."""

FEWEST_UPRIGHT: Final = 0.25
"""Share (0 to 1) of the parts. If more parts than this have at least half of the predicted correlation as declared, the
other parts can be outliers."""

DEPENDENT: Final = 3.0
"""Ratio of the standard error of a correlation to that of independent blocks. Blocks of one moving texture are not
independent."""


@dataclass(frozen=True, slots=True)
class ChangeMoments:
    """Moments of the frame change d and the event change e of blocks.

    Attributes
    ----------
    sums
        (k, 6) sums of 1, d, e, d d, e e and d e over blocks, in k rows, such as the eight symmetries.
    """

    sums: Float64

    def correlations(self) -> Float64:
        """Return the correlation coefficients (k,) of d and e; 0 where one of them does not vary."""
        n, d, e, dd, ee, de = self.sums.T
        # Pearson: (de - d e / n) / sqrt((dd - d^2 / n) (ee - e^2 / n)).
        n = np.maximum(n, 1.0)
        spread = np.sqrt(np.maximum((dd - d * d / n) * (ee - e * e / n), 0.0))
        covariance = de - d * e / n
        correlations: Float64 = np.divide(covariance, spread, out=np.zeros_like(spread), where=spread > 0)
        return correlations

    def frame_variance(self) -> float:
        """Return the variance of d in the first row, in squared units of the level."""
        n, d, _, dd, *_ = self.sums[0]
        return max(float(dd - d * d / max(n, 1.0)), 0.0) / max(float(n), 1.0)


@dataclass(frozen=True, slots=True)
class PartOrientation:
    """The part whose correlation increases most by another orientation of the events.

    Attributes
    ----------
    parts
        (k,) True for the parts whose correlation is largest in this orientation.
    orientation
        Number of the orientation, in the order of ``other_correlations``.
    declared, other
        Correlations of the part, -1 to 1, as declared and in that orientation.
    standard_error
        Standard error of their difference.
    compared
        Number of parts that were compared.
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
        (15,): eight with inverted polarity, then seven with the declared polarity.
    """
    # Inverted polarity negates e and the correlation. The first symmetry is the declared orientation itself.
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


def implied_moments(change: NDArray[np.floating], threshold_on: float, threshold_off: float) -> ChangeMoments:
    """Return moments of the change of the signal and of the events that it implies where pixels start at a reference.

    Parameters
    ----------
    change
        (h, w) change of the signal since the reference; NaN where it is not known.
    threshold_on, threshold_off
        Change of the level by one brighter and by one darker event, both positive.

    Returns
    -------
    ChangeMoments
        One row, of the blocks all of whose pixels are known.
    """
    # A pixel has an event for each whole threshold by which its level has left the reference.
    threshold = np.where(change > 0, change.dtype.type(threshold_on), change.dtype.type(threshold_off))
    events = threshold * np.trunc(change / threshold)
    side, (rows, columns) = block_grid(change.shape)
    top, left = (change.shape[0] - rows * side) // 2, (change.shape[1] - columns * side) // 2
    inside = np.stack([change, events])[:, top : top + rows * side, left : left + columns * side]
    # Rows before columns: sums along whole rows of pixels are ten times as fast as those of blocks at once.
    bands = inside.reshape(2, rows, side, -1).sum(axis=2)
    blocks = bands.reshape(2, rows * columns, side).sum(axis=2, dtype=np.float64) / side**2
    d, e = blocks[:, np.isfinite(blocks[0])]
    return ChangeMoments(np.array([[d.size, d.sum(), e.sum(), d @ d, e @ e, d @ e]]))


def responding_shares(levels: Float64, threshold_on: float, threshold_off: float) -> Float64:
    """Return the shares of pixels that have responded by the end of each window, by their levels in the frames.

    A pixel whose first reference is its level in the first frame has no event until its level has become higher by
    ``threshold_on`` or lower by ``threshold_off``. No events are used, so that wrong ones do not change what is
    expected of them.

    Parameters
    ----------
    levels
        (w, 3, k) levels of k pixels in w windows in the order of time: in the first frame of the window, the least and
        the greatest; NaN where they are not known.
    threshold_on, threshold_off
        Change of the level by one brighter and by one darker event, both positive.

    Returns
    -------
    Float64
        (w,) 0 to 1; 1 where no pixel is known.
    """
    first, least, greatest = levels[0, 0], np.fmin.accumulate(levels[:, 1]), np.fmax.accumulate(levels[:, 2])
    responded = (greatest - first >= threshold_on) | (first - least >= threshold_off)
    is_known = np.isfinite(first)
    shares: Float64 = responded[:, is_known].mean(axis=1) if is_known.any() else np.ones(len(levels))
    return shares


def most_reoriented(parts: Sequence[ChangeMoments], noise: float) -> PartOrientation | None:
    """Return the part whose correlation increases most by another orientation of its events.

    Parameters
    ----------
    parts
        Moments (8, 6) of each of k parts under the eight symmetries.
    noise
        Variance of the change of a block that its events do not determine, in squared units of the level.

    Returns
    -------
    PartOrientation | None
        With all parts of the same best orientation. None where at most a quarter of the parts agree as declared.
    """
    sums = np.array([part.sums for part in parts])
    counts = sums[:, 0, 0]
    frame_variance = np.array([part.frame_variance() for part in parts])
    informative = (counts >= FEWEST_BLOCKS) & (sums[:, 0, 4] > 0)
    # Predicted correlation of a signal of variance v with the sum of it and noise: sqrt(v / (v + noise)).
    due = np.sqrt(frame_variance / (frame_variance + noise))
    informative &= due >= LEAST_PREDICTED
    declared = np.array([part.correlations()[0] for part in parts])
    upright = np.count_nonzero(informative & (declared > due / 2))
    if upright <= FEWEST_UPRIGHT * np.count_nonzero(informative):
        return None
    alternatives = np.array([other_correlations(part.correlations()) for part in parts])
    # The part of the largest gain; parts with the same best orientation are added to it.
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


def step_moments(levels: Float64, events: EventBlocks, tiles: int) -> Float64:
    """Return moments of the changes between successive frames and of their events, under all symmetries.

    Parameters
    ----------
    levels
        (n, r, c) ``level_blocks`` of the frames.
    events
        Block means of the n - 1 intervals.
    tiles
        Number of tiles along each axis.

    Returns
    -------
    Float64
        (n - 1, tiles^2, 8, 6) sums as in ``ChangeMoments``, by interval, tile (by rows) and symmetry.
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
        Block means of the n - 1 intervals.

    Returns
    -------
    ChangeMoments
        (8, 6) of the whole image, by symmetry.
    """
    sums = np.zeros((1, len(SYMMETRIES), 6))
    add_moments(levels[-1] - levels[0], events.upright.sum(axis=0), events.swapped.sum(axis=0), 1, sums)
    return ChangeMoments(sums[0])


@njit(cache=True)
def add_moments(change: Float64, upright: Float64, swapped: Float64, tiles: int, sums: Float64) -> None:
    """Add the moments of frame changes d and event changes e, for each tile and each of the eight ``SYMMETRIES``.

    Parameters
    ----------
    change
        (r, c) change of the level of each block; blocks where it is NaN are left out.
    upright, swapped
        (r, c) block means of the events, with axes as they are and exchanged.
    tiles
        Number of tiles along each axis.
    sums
        (tiles^2, 8, 6) is added to: sums of 1, d, e, d d, e e and d e, by tile (by rows) and symmetry.
    """
    rows, columns = change.shape
    # A row of changes and its mirror image: to mirror the changes has the effect of mirroring the columns of events.
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
    """Write the number of changes, their sum and that of their squares, which are equal under all symmetries."""
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

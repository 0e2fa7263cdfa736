"""By how many pixels events are shifted against frames: the peak of their cross-correlation."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.shift_kernels import (
    RADIUS,
    USABLE,
    add_slopes,
    correlate,
    correlate_with_itself,
    follow_signs,
    follow_turns,
    step_between,
)

Bool = NDArray[np.bool_]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

RADIUS_PX: Final = RADIUS
"""Farthest shift that is tried in each direction."""


@dataclass(frozen=True, slots=True)
class Shift:
    """A shift of events against frames, px: to the right and down."""

    right_px: float
    down_px: float


def cross_correlation(change: Float64, events: Float64, usable: NDArray[np.bool_], rest: float = 0.0) -> Float64:
    """Return the sum over pixels x of change(x) events(x + s) for all shifts s, rows down and columns right.

    ``change`` and ``events`` (h, w) are taken less their means over the usable pixels, 0 elsewhere. The result is
    (2 R + 1, 2 R + 1), R the radius; the middle is no shift. Products are in single precision. ``rest`` is what events
    hold where nothing fires; where that is most pixels, it costs less to know it.
    """
    patch = np.empty((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
    one, other = (np.ascontiguousarray(image, np.float64) for image in (change, events))
    flags = np.ascontiguousarray(usable).view(np.uint8)
    correlate(one, other, flags, USABLE, (0, usable.shape[0], 0, usable.shape[1]), rest, patch)
    return patch


def auto_correlation(change: Float64, usable: NDArray[np.bool_]) -> Float64:
    """Return what ``cross_correlation`` gives of an image (h, w) and itself, for half the time."""
    patch = np.empty((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
    flags = np.ascontiguousarray(usable).view(np.uint8)
    correlate_with_itself(np.ascontiguousarray(change, np.float64), flags, USABLE, patch)
    return patch


@dataclass(frozen=True, slots=True)
class ShiftSums:
    """Sums of parts of an interval: cross-correlations (k, s, s), squares (k, 2), slopes (k, 3, 2)."""

    patches: Float64
    squares: Float64
    slopes: Float64


@dataclass(frozen=True, slots=True)
class Interval:
    """What frames and events say has changed between two frames (h, w), and flags of its pixels.

    ``level`` is that of the earlier frame; ``flags`` are those of ``event_shift_kernels``.
    """

    level: NDArray[np.floating]
    change: Float64
    events: Float64
    flags: NDArray[np.uint8]

    def sums(self, flag: int, boxes: Sequence[tuple[int, int, int, int]]) -> ShiftSums:
        """Return the sums over flagged pixels of parts of the image: top, bottom, left, right."""
        patches = np.empty((len(boxes), 2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        squares, slopes = np.empty((len(boxes), 2)), np.zeros((len(boxes), 3, 2))
        for i, box in enumerate(boxes):
            squares[i] = correlate(self.change, self.events, self.flags, flag, box, 0.0, patches[i])
            add_slopes(self.level, self.change, self.flags, flag, box, slopes[i])
        return ShiftSums(patches, squares, slopes)

    def patch(self, flag: int) -> Float64:
        """Return the cross-correlation over the flagged pixels of the whole image."""
        patch = np.empty((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        box = 0, self.flags.shape[0], 0, self.flags.shape[1]
        correlate(self.change, self.events, self.flags, flag, box, 0.0, patch)
        return patch


def intervals(
    signal_of: Callable[[int], tuple[Float32, Bool]],
    counts: NDArray[np.int32],
    threshold_on: float,
    threshold_off: float,
    chosen: Sequence[int],
    before: NDArray[np.int32] | None = None,
) -> Iterator[Interval]:
    """Yield the chosen ones of successive intervals, in order; each is overwritten by the next.

    ``signal_of`` gives the signal (h, w) of a frame, and where it is known; ``counts`` (n - 1, 2, h, w) are darker and
    brighter events. A pixel whose signal changes against its last events is on its way back through both thresholds and
    has not fired yet. ``before`` (2, h, w) are the events before the first interval; those of pixels of which nothing
    is known before count as changed.
    """
    shape, steps = counts.shape[2:], (-threshold_off, threshold_on)
    change, events = np.empty(shape), np.empty(shape)
    signs, flags = np.zeros(shape, np.int8), np.empty(shape, np.uint8)
    if before is not None:
        follow_signs(before, signs)
    for i in range(max(chosen, default=-1) + 1):
        if i not in chosen:
            follow_signs(counts[i], signs)
            continue
        (earlier, lit_before), (later, lit_after) = signal_of(i), signal_of(i + 1)
        step_between(earlier, later, lit_before, lit_after, counts[i], steps, change, events, flags)
        follow_turns(counts[i], change, signs, flags)
        yield Interval(earlier, change, events, flags)


def peak(correlation: Float64) -> Shift | None:
    """Return the shift of the peak to a fraction of a pixel (parabola along each axis); None where it has none."""
    row, column = (int(i) for i in np.unravel_index(int(np.argmax(correlation)), correlation.shape))
    last = 2 * RADIUS_PX
    if correlation[row, column] <= 0 or not (0 < row < last and 0 < column < last):
        return None
    down = _vertex(correlation[row - 1 : row + 2, column])
    right = _vertex(correlation[row, column - 1 : column + 2])
    return Shift(column - RADIUS_PX + right, row - RADIUS_PX + down)


def _vertex(three: Float64) -> float:
    """Return where the parabola through three values at -1, 0, 1 has its top; the middle one is the largest."""
    bend = float(three[0] - 2 * three[1] + three[2])
    return 0.5 * float(three[0] - three[2]) / bend if bend < 0 else 0.0

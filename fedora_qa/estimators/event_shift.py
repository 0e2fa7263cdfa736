"""By how many pixels events are shifted against frames: the peak of their cross-correlation."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2

Float64 = NDArray[np.float64]

RADIUS_PX: Final = 8
"""Farthest shift that is tried in each direction."""


@dataclass(frozen=True, slots=True)
class Shift:
    """A shift of events against frames, px: to the right and down."""

    right_px: float
    down_px: float


def cross_correlation(change: Float64, events: Float64, usable: NDArray[np.bool_]) -> Float64:
    """Return the sum over pixels x of change(x) events(x + s) for all shifts s, rows down and columns right.

    ``change`` and ``events`` (h, w) are taken less their means over the usable pixels, 0 elsewhere. The result is
    (2 R + 1, 2 R + 1), R the radius; the middle is no shift.
    """
    one, other = (np.where(usable, image - image[usable].mean(), 0.0) if usable.any() else 0 * image
                  for image in (change, events))  # fmt: skip
    padded = [next_fast_len(size + RADIUS_PX, real=True) for size in change.shape]
    product = np.conj(rfft2(one, padded)) * rfft2(other, padded)
    correlation = irfft2(product, padded)
    shifts = np.arange(-RADIUS_PX, RADIUS_PX + 1)
    patch: Float64 = correlation[np.ix_(shifts, shifts)]
    return patch


def turned_pixels(counts: NDArray[np.int32], changes: Float64) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where events changed sign within an interval or since those before it, and where these or frames did.

    ``counts`` (n, 2, h, w) are darker and brighter events of successive intervals, ``changes`` (n, h, w) what the
    signal changed by; the results are (n, h, w). A pixel whose signal changes against its last events is on its way
    back through both thresholds and has not fired yet. Events of the first interval, and others that nothing is known
    before, count as changed.
    """
    darker, brighter = counts[:, 0] > 0, counts[:, 1] > 0
    sign = np.zeros(counts.shape[2:], np.int8)
    turned, against = np.empty(darker.shape, np.bool_), np.empty(darker.shape, np.bool_)
    for i, (off, on) in enumerate(zip(darker, brighter, strict=True)):
        now = on.astype(np.int8) - off
        turned[i] = (on & off) | ((on ^ off) & (now != sign))
        against[i] = sign * changes[i] < 0
        sign = np.where(on | off, now, sign)
    return turned, turned | against


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

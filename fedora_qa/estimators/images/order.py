"""How far one frame lies from another along a flow: 1 where they are its ends, 0 where they are the same.

Least squares on ``W - A = s p + a + b (A + W)/2`` with p = -g . u, the change that the flow u makes by the gradient g
of (A + W)/2; a and b absorb exposure. Frames are reduced first until most of the flow is about a pixel, so that s holds
for large flows too. One number a pair of frames: flow of any shape will do, expansion as well as a pan.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.residual import LUMA_ROUNDING_VARIANCE_DN2
from fedora_qa.estimators.images.order_kernels import Box, Sums, share_in_box, share_of_sums

Float32 = NDArray[np.float32]

FEWEST_PIXELS: Final = 64
"""Reduced pixels below which nothing is said."""

SMOOTHING_PX: Final = 1.0
CORRELATED_PIXELS: Final = 4 * pi * SMOOTHING_PX**2
"""Sum of the autocorrelation of white noise behind that smoothing: so many pixels count as one."""


def _taps() -> Float32:
    """Return the weights (5,) of a Gaussian of ``SMOOTHING_PX``, cut at four of it: of its middle and of one side."""
    weights = np.exp(-0.5 * (np.arange(5) / SMOOTHING_PX) ** 2)
    return np.asarray(weights / (2 * weights.sum() - weights[0]), dtype=np.float32)


_TAPS: Final = _taps()

LARGEST_PX: Final = 1.5
"""Frames are reduced until most of the flow is no longer than this: what the smoothing keeps is then nearly linear."""

_MOST_OF_THE_FLOW: Final = 90.0
_LARGEST_FLOW_PX: Final = 1e4

_SPEEDS: Final = 2_000
"""About so many pixels tell how long most of the flow is: its rank among all errs by less than a hundredth."""

_LINES: Final = 3
"""Of so many rows the mean of a reduced pixel is taken, of two where it has four.

At 1440x1080 the standard error of the share is then 0.0122, of all rows 0.0111, and the least fault 0.8% larger, as
half of a flow is allowed for.
"""

_NOTHING: Final[Sums] = (0.0,) * 11

_LEAST_STEP: Final = 3
"""Parts of large frames are reduced by so many pixels at least.

Less costs more, and tells no more: of a slower flow at 1440x1080 the reduced pixels are then many all the same, and the
least fault is 1083, without that 1084 thousandths of the flow; of a part 2.26 and 2.32.
"""

_CONDITION: Final = 1e10
"""Of the normal matrix: beyond, brightness and motion cannot be told apart."""


@dataclass(frozen=True, slots=True)
class MotionShare:
    """The share s of the flow by which two frames lie apart.

    Attributes
    ----------
    standard_error
        From what the fit leaves, where that is more than rounding.
    rounding_error
        From rounding alone: whether there is enough motion and texture to tell, which a fault cannot change.
    """

    share: float
    standard_error: float
    rounding_error: float


def motion_share(before: Float32, after: Float32, flow_px: Float32, box: Box | None = None) -> MotionShare | None:
    """Return how far ``after`` lies from ``before`` along the flow; None where too little of the flow is valid.

    Parameters
    ----------
    before, after
        (H, W) frames, DN.
    flow_px
        (H, W, 2) from the first frame on, NaN where invalid.
    box
        Left, top, right, bottom of the part that is looked at; None: all.
    """
    whole = (0, 0, before.shape[1], before.shape[0])
    found, share, inverse, left_dn2, pixels, _ = _in_box(
        before, after, flow_px, box or whole, _SPEEDS, 1, (_LINES, _LINES)
    )
    return _with_errors(share, inverse, left_dn2, pixels) if found else None


def motion_of_parts(
    before: Float32, after: Float32, flow_px: Float32, boxes: Sequence[Box]
) -> tuple[MotionShare | None, list[MotionShare | None]]:
    """Return the share of all parts together, with one gain and bias of brightness, and that of each by itself.

    For large frames: a quarter of the speeds and one row of the flow, which is smooth, tell as much. Each part is
    reduced by as much as its own flow asks for: what is regressed is the change in DN, whatever the size of a pixel.

    Parameters
    ----------
    before, after, flow_px
        As in ``motion_share``.
    boxes
        Left, top, right, bottom of each part.
    """
    shares, known, of_a_pixel = [], [_NOTHING], 0.0
    for box in boxes:
        found, share, inverse, left_dn2, pixels, sums = _in_box(
            before, after, flow_px, box, _SPEEDS // 4, _LEAST_STEP, (_LINES, 1)
        )
        shares.append(_with_errors(share, inverse, left_dn2, pixels) if found else None)
        if sums[0]:
            known.append(_from_zero(sums))
            of_a_pixel += sums[0] / pixels
    total = cast(Sums, tuple(sum(column) for column in zip(*known, strict=True)))
    found, share, inverse, left_dn2 = share_of_sums(total, FEWEST_PIXELS, _CONDITION)
    return _with_errors(share, inverse, left_dn2, total[0] / of_a_pixel) if found else None, shares


def _in_box(
    before: Float32, after: Float32, flow_px: Float32, box: Box, speeds: int, least: int, lines: tuple[int, int]
) -> tuple[bool, float, float, float, int, Sums]:
    if not before.shape == after.shape == flow_px.shape[:2]:
        raise ValueError(f"Expected frames on the flow's grid {flow_px.shape[:2]}, got {before.shape}, {after.shape}")
    return share_in_box(
        before, after, np.ascontiguousarray(flow_px), box,
        speeds, _MOST_OF_THE_FLOW, _LARGEST_FLOW_PX, LARGEST_PX, least, lines, _TAPS, FEWEST_PIXELS, _CONDITION,
    )  # fmt: skip


def _from_zero(sums: Sums) -> Sums:
    """Return ``motion_sums`` with levels from 0 on."""
    count, p_sum, l_sum, c_sum, pp, pl, ll, pc, lc, cc, base = sums
    pl, ll, lc = pl + base * p_sum, ll + base * (2 * l_sum + base * count), lc + base * c_sum
    return count, p_sum, l_sum + base * count, c_sum, pp, pl, ll, pc, lc, cc, 0.0


def _with_errors(share: float, inverse: float, left_dn2: float, pixels: float) -> MotionShare:
    """Return a share with its errors; smoothing lowers the rounding's variance as it lowers the number of pixels."""
    rounding_dn2 = 2 * LUMA_ROUNDING_VARIANCE_DN2 / pixels
    standard_error = sqrt(inverse * max(CORRELATED_PIXELS * left_dn2, rounding_dn2))
    return MotionShare(share, standard_error, sqrt(inverse * rounding_dn2))

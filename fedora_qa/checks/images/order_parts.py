"""Parts of frames along the flow: a part that is frozen, or taken from another frame, while the rest moves on."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import nan
from typing import Final, TypeGuard

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.images.order_causes import ALLOWED, exceeds_limit, order_suspects
from fedora_qa.checks.protocol import Statistic
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.estimators.images.order import MotionShare, motion_of_parts, motion_share
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import USUAL_PIXELS

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Box = tuple[int, int, int, int]
"""Left, top, right, bottom."""

PARTS: Final = 4
"""Parts along each side: one at least lies within any region of half the width and height."""

CLEAR: Final = 0.1
"""Error of a share from which on a part does not tell: a fifth of what is allowed for."""

FEWEST_PAIRS: Final = 8
"""Below, the usual share of a part and its scatter are not known."""

LEAST_SHARE: Final = 0.5
"""Below, a part does not follow the flow in most intervals."""

PartShares = tuple[tuple[float, float], ...]
"""(parts, 2) shares of the flow and their standard errors, row by row; NaN where a part does not tell."""


def shares_of_parts(before: Float32, after: Float32, flow_px: Float32) -> PartShares:
    """Return by how much of the flow each part of two frames (H, W) lies apart."""
    found = [motion_share(before, after, flow_px, box) for box in boxes(before.shape[1], before.shape[0])]
    return _told(found)


def shares_of_large_frames(before: Float32, after: Float32, flow_px: Float32) -> tuple[MotionShare | None, PartShares]:
    """Return the share of two large frames, and those of their parts, from the middle of each part.

    As many pixels are looked at as lie in the middle, by logarithms, between the frame's and those of a usual one: at
    1440x1080 38% of each part. A part whose middle does not tell is looked at as a whole. The standard error of a
    part's share is then 0.012 as a rule, not 0.008, and the least fault of a part 25% larger; that of a whole frame,
    half of which is allowed for, is the same.
    """
    height, width = before.shape
    looked_at = min(1.0, (USUAL_PIXELS / before.size) ** 0.25)
    parts = boxes(width, height)
    together, found = motion_of_parts(before, after, flow_px, [_middle(box, looked_at) for box in parts])
    tell = [
        one if _tells(one) else motion_of_parts(before, after, flow_px, [box])[1][0]
        for one, box in zip(found, parts, strict=True)
    ]
    return together, _told(tell)


def _tells(found: MotionShare | None) -> TypeGuard[MotionShare]:
    return found is not None and max(found.rounding_error, found.standard_error) < CLEAR


def _told(found: Iterable[MotionShare | None]) -> PartShares:
    return tuple((one.share, one.standard_error) if _tells(one) else (nan, nan) for one in found)


def _middle(box: Box, share: float) -> Box:
    """Return the middle of a box, of a share of its width and height."""
    left, top, right, bottom = box
    across, down = (round((1 - share) / 2 * size) for size in (right - left, bottom - top))
    return left + across, top + down, right - across, bottom - down


def boxes(width: int, height: int) -> tuple[Box, ...]:
    """Return the parts of an image, row by row."""
    columns, rows = ([round(edge * size / PARTS) for edge in range(PARTS + 1)] for size in (width, height))
    return tuple((left, top, right, bottom) for top, bottom in pairwise(rows) for left, right in pairwise(columns))


def odd_part(pairs: Sequence[tuple[int, int, PartShares]], size: tuple[int, int], facts: Facts) -> Statistic | None:
    """State the part that lies farthest from where it usually does; None where no part tells.

    Parameters
    ----------
    pairs
        Two frames, and the shares of the parts between them.
    size
        Width and height of the image.
    """
    shares, own = np.moveaxis(np.array([parts for _, _, parts in pairs]), -1, 0)
    known = np.isfinite(shares)
    usual = np.array([_median(column) for column in shares.T])
    telling = (np.count_nonzero(known, axis=0) >= FEWEST_PAIRS) & (usual >= LEAST_SHARE)
    if not telling.any():
        return None
    relative = np.where(telling, shares / np.where(telling, usual, 1.0), np.nan)
    scatter = MAD_TO_SIGMA * np.array([_median(np.abs(column - 1)) for column in relative.T])
    errors = np.hypot(scatter, own / np.where(telling, usual, 1.0))
    scores = np.where(np.isfinite(relative), (np.abs(relative - 1) - ALLOWED) / errors, -np.inf)
    pair, part = (int(i) for i in np.unravel_index(int(np.argmax(scores)), scores.shape))
    return _stated(pairs, relative, (pair, part), float(errors[pair, part]), boxes(*size)[part], facts)


def _median(values: Float64) -> float:
    """Return the median of what is known, 0 where nothing is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else 0.0


def _stated(
    pairs: Sequence[tuple[int, int, PartShares]],
    relative: Float64,
    at: tuple[int, int],
    error: float,
    box: Box,
    facts: Facts,
) -> Statistic:
    pair, part = at
    before, after, _ = pairs[pair]
    series = [(one[0], one[1], float(share)) for one, share in zip(pairs, relative[:, part], strict=True)]
    off = [one for one in series if abs(one[2] - 1) > ALLOWED] or [series[pair]]
    times_ns = facts.clocks["rgb"].times_ns
    return Statistic(
        name="share_of_the_flow_in_a_part",
        value=float(relative[pair, part]),
        unit="1",
        standard_error=error,
        expected=1.0,
        model_error_bound=ALLOWED,
        tests=int(np.count_nonzero(np.isfinite(relative))),
        statement=f"In columns {box[0]} to {box[2] - 1}, rows {box[1]} to {box[3] - 1} frame {after} lies "
        f"{relative[pair, part]:.2f} of what is usual from frame {before}.",
        code="images.order.part",
        where=Where(
            stream="rgb",
            start_us=facts.to_file_us(int(times_ns[off[0][1]])),
            stop_us=facts.to_file_us(int(times_ns[off[-1][0]])),
            frame=off[0][1],
            tile=box,
        ),
        suspects=order_suspects(exceeds_limit([one for one in series if np.isfinite(one[2])])),
    )

"""Frames along the flow: order in time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.images.order_causes import ALLOWED, exceeds_limit, order_suspects
from fedora_qa.checks.images.order_parts import (
    PartShares,
    odd_part,
    shares_of_large_frames,
    shares_of_parts,
)
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.estimators.images.order import MotionShare, motion_share
from fedora_qa.estimators.images.order_kernels import is_of_one_value
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.frame_pairs import luma_on_flow_grid, pairs_with_flow
from fedora_qa.views.large_frames import is_large
from fedora_qa.views.warped_frames import optics_of

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

LARGEST_ERROR: Final = 0.1
"""A pair of frames counts where rounding lets its share be known to this: a fifth of what is allowed for."""

LEAST_SHARE: Final = 0.5
"""Below, frames do not follow the flow in most intervals, and none of them can be told from the rest."""

FEWEST_PAIRS: Final = 4

MATTERS: Final = 2.0
"""A frame that moved elsewhere leaves an interval that is off by twice the flow (one that repeats: by the flow)."""


@dataclass(frozen=True, slots=True)
class Share:
    """Two frames, and by how much of the flow between their instants they lie apart: as a whole, and part by part.

    ``size`` is the width and height on the grid of the flow.
    """

    before: int
    after: int
    share: float
    standard_error: float
    rounding_error: float
    size: tuple[int, int]
    parts: PartShares


def _shares(before: Float32, after: Float32, flow_px: Float32, *, large: bool) -> tuple[MotionShare | None, PartShares]:
    """Return the share of two frames, and those of their parts: of large frames from some of their pixels."""
    if large:
        found, parts = shares_of_large_frames(before, after, flow_px)
        if found is not None and found.rounding_error < LARGEST_ERROR:
            return found, parts
        return motion_share(before, after, flow_px), parts
    return motion_share(before, after, flow_px), shares_of_parts(before, after, flow_px)


class ImagesOrder(WindowCheck[tuple[Share, ...]]):
    """Does each frame lie where the flow carries the frame before it?

    One number a pair of frames: the share of the flow by which the second lies away from the first. It is 1 in an
    honest file. A frame that repeats the one before gives 0, and the one after it 2; exchanged neighbours give 2, -1,
    2.

    Why it matters
    --------------
    A frame out of order, frozen or dropped turns motion round for two intervals. Anything that is learnt from pairs
    of frames, or aligned to events by them, is wrong there.

    How
    ---
    The change from each frame to the next is regressed on the change that the fastest flow predicts, with gain and
    bias of brightness left free; images are first reduced until the flow is about a pixel. The pair that lies
    farthest from the median of all is judged, and so is each of 4 x 4 parts of the image against its own median.
    Exchanged frames are told from frozen ones by the sign of their shares. A frame that is out of its place comes back
    to it in an interval beside: intervals that only fall short or only run ahead, with neighbours in order, are no
    frames out of their places, but an image that was moved or turned.

    Noise model
    -----------
    Standard error: the spread of all pairs (1.4826 times the median absolute deviation) and the pair's own, from what
    its regression leaves, together. Allowance: half of the flow, halfway between a frame in its place and one that
    repeats. Pairs count where rounding alone lets their share be known to 0.1; those of a part where its own error is
    no larger than that either.

    Cannot see
    ----------
    A fault of all frames alike, for which there is `flow_photometric.residual`; anything where little moves. With
    flow slower than the frames only frames at its ends are seen. Whether flow or frames are out of order is open to
    this check alone: `event_response.frames` asks events the same, and both failing means the frames.

    Sources
    -------
    B. D. Lucas, T. Kanade, IJCAI (1981) 674, with one unknown a pair; `estimators/images/order.py` derives it.
    """

    name = "images.order"
    needs = ("flow", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Say why frames cannot be seen on the flow's grid."""
        optics = optics_of(facts)
        return optics if isinstance(optics, str) else ""

    def measure(self, window: Window) -> tuple[Share, ...]:
        """Regress every pair that the window owns."""
        shares = []
        for pair in pairs_with_flow(window):
            if pair.flow_px is None:
                continue
            before, after = luma_on_flow_grid(window, pair.before), luma_on_flow_grid(window, pair.after)
            blank = is_of_one_value(before) or is_of_one_value(after)  # for images.exposure
            if blank:
                continue
            found, parts = _shares(before, after, pair.flow_px, large=is_large(before.size, window))
            if found is not None:
                size = before.shape[1], before.shape[0]
                shares.append(
                    Share(pair.before, pair.after, found.share, found.standard_error, found.rounding_error, size, parts)
                )
        return tuple(shares)

    def conclude(self, state: Sequence[tuple[Share, ...]], facts: Facts) -> Observation:
        """Find the pair that is farthest from all others."""
        every = [one for shares in state for one in shares]
        clear = [one for one in every if one.rounding_error < LARGEST_ERROR]
        coverage = Coverage(len(clear), max(facts.sizes.get("path/rgb", 0) - 1, 0), "frame intervals")
        if len(clear) < FEWEST_PAIRS:
            return Observation(coverage, unobservable="too few frames lie at the ends of the flow, or too little moves")
        shares = np.array([one.share for one in clear])
        middle = float(np.median(shares))
        if middle < LEAST_SHARE:
            reason = f"frames do not follow the flow at all: {middle:.2g} of it (see flow_photometric.residual)"
            return Observation(coverage, unobservable=reason)
        spread = MAD_TO_SIGMA * float(np.median(np.abs(shares - middle)))
        errors = np.hypot(spread, [one.standard_error for one in clear])
        worst = int(np.argmax((np.abs(shares - middle) - ALLOWED * middle) / errors))
        measured = [self._worst(clear[worst], middle, float(errors[worst]), clear, facts)]
        part = odd_part([(one.before, one.after, one.parts) for one in every], every[0].size, facts)
        return Observation(coverage, (*measured, *([part] if part is not None else [])))

    def _worst(self, pair: Share, middle: float, error: float, clear: Sequence[Share], facts: Facts) -> Statistic:
        times_ns = facts.clocks["rgb"].times_ns
        off = [one for one in clear if abs(one.share / middle - 1) > ALLOWED]
        first = off[0] if off else pair
        return Statistic(
            name="share_of_the_flow",
            value=pair.share / middle,
            unit="1",
            standard_error=error / middle,
            expected=1.0,
            model_error_bound=ALLOWED,
            tests=max(facts.sizes.get("path/rgb", 0) - 1, 1),
            material=MATTERS + ALLOWED,
            statement=f"Frame {pair.after} lies {pair.share:.2f} of the flow from frame {pair.before}; {middle:.2f} is "
            f"usual. {len(off)} frame intervals are out of order.",
            code="images.order.share",
            where=Where(
                stream="rgb",
                start_us=facts.to_file_us(int(times_ns[first.after])),
                stop_us=facts.to_file_us(int(times_ns[off[-1].before if off else pair.after])),
                frame=first.after,
            ),
            suspects=order_suspects(exceeds_limit([(one.before, one.after, one.share / middle) for one in clear])),
        )

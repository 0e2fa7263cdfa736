"""How sharp the image of warped events is, under a flow and under altered ones.

Events of one edge, carried along the true flow to one instant, meet in one line; carried otherwise they smear. The
sharpness is the mean, over events, of the density that they meet: the sum of squares of the image of warped events
over their number (G. Gallego, H. Rebecq, D. Scaramuzza, A unifying contrast maximization framework for event cameras,
CVPR (2018); mean square, as in G. Gallego, M. Gehrig, D. Scaramuzza, Focus is all you need, CVPR (2019)).

Events are carried to the middle of the interval, not to its start: in a flow that spreads, warping to one end lets all
events gather as the flow is overdone (S. Shiba, Y. Aoki, G. Gallego, Event collapse in contrast maximization
frameworks, Sensors 22 (2022)); to the middle those before it spread as those after it gather.

Events of one pixel are never of one place on an edge that moves: they meet best where nothing is carried, and would
draw every gain towards 0. What they contribute to the sum of squares is taken off; with votes that are Gaussian two of
them that are d apart contribute exp(-d^2 / (4 s^2)) / (4 pi s^2).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.contrast_kernels import (
    MARGIN_OF_CANVAS_PX,
    PARTS,
    VOTE_PX,
    carry,
    flows_at,
    meetings_with_oneself,
    sum_of_squares,
)

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Columns = NDArray[np.uint16]

GAINS: Final = (0.5, 0.7, 0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25, 1.4, 2.0)
"""Gains that are tried for the best one, about evenly spread in their logarithm around 1."""

SIGMA_PX: Final = 1.0
"""Standard deviation of a vote in the image of warped events."""

MARGIN_PX: Final = 12.0
"""Events farther from the border than this count however large the flow is."""

_MEMORY: Final = 16
"""Events of a pixel that later ones are held against; only pixels without cause fire more often."""


@dataclass(frozen=True, slots=True)
class SeenFlow:
    """A flow (H, W, 2), px of its own grid, as the event camera sees it.

    ``view`` (6,) says where its pixels lie on that grid: see ``contrast_kernels``.
    """

    flow_px: Float32
    view: tuple[float, float, float, float, float, float] = (1.0, 0.0, 1.0, 0.0, 1.0, 1.0)

    def mirrored(self, axis: int) -> "SeenFlow":
        """Return the flow whose grid, not its values, is turned over: 0 left to right, 1 top to bottom."""
        across, left, down, top, wide, high = self.view
        height, width = self.flow_px.shape[:2]
        if axis:
            return replace(self, view=(across, left, -down, height - 1 - top, wide, high))
        return replace(self, view=(-across, width - 1 - left, down, top, wide, high))

    def at(self, x: Columns, y: Columns) -> Float64:
        """Return the flow (n, 2) at pixels of the event camera, in its pixels; NaN where there is none."""
        return np.asarray(flows_at(self.flow_px, np.array(self.view), x, y))


@dataclass(frozen=True, slots=True)
class WarpedEvents:
    """Sharpness under each candidate (k,), events carried, and the root mean square of their way (first field), px."""

    sharpness: Float64
    carried: int
    way_px: float


def blank_canvas(height: int, width: int) -> Float32:
    """Return room for the votes of an image (height, width); whoever uses it leaves it blank."""
    return np.zeros((height + 2 * MARGIN_OF_CANVAS_PX, width + 2 * MARGIN_OF_CANVAS_PX), dtype=np.float32)


def pixel_by_pixel(x: Columns, y: Columns) -> NDArray[np.int64]:
    """Return the order of events by rows, by columns, and for those of one pixel as they came."""
    places = ((y.astype(np.int64) << 16) + x << 32) + np.arange(len(x))
    return np.sort(places) & 0xFFFFFFFF


def sharpness_under(
    x: Columns, y: Columns, tau: Float64, candidates: Sequence[tuple[SeenFlow, Float64]], canvas: Float32
) -> WarpedEvents:
    """Carry the same events by every candidate: a flow, and the matrix (2, 2) that it is multiplied by.

    An event counts for all candidates or none: it must have a flow in every field, and lie farther from the border than
    one and a half times its way, or than ``MARGIN_PX``.

    Parameters
    ----------
    x, y, tau
        Events pixel by pixel (``pixel_by_pixel``); ``tau`` is their instant in intervals of the flow after its start.
    canvas
        Of ``blank_canvas``, for the size of the event camera.
    """
    height, width = (size - 2 * MARGIN_OF_CANVAS_PX for size in canvas.shape)
    distinct = {id(flow): flow for flow, _ in candidates}
    which = np.array([list(distinct).index(id(flow)) for flow, _ in candidates], dtype=np.int64)
    turns = np.array([turn for _, turn in candidates], dtype=np.float64)
    flows = np.stack([flow.at(x, y) for flow in distinct.values()])
    way_px = _way_px(tau, flows[0])
    usable = _usable(x, y, tau, flows, height, width)
    x, y, tau, flows = x[usable], y[usable], tau[usable], np.ascontiguousarray(flows[:, usable])
    squares = np.zeros(len(candidates))
    for number, flow in enumerate(distinct.values()):
        own = np.flatnonzero(which == number)
        places = carry(x, y, tau, flow.flow_px, np.array(flow.view), flows[number], turns[own], (height, width))
        squares[own] = [sum_of_squares(of_one, _WEIGHTS, canvas) for of_one in places]
    pixels = y.astype(np.int64) * width + x
    squares -= meetings_with_oneself(pixels, tau, flows, which, turns, SIGMA_PX, _MEMORY)
    return WarpedEvents(squares / max(len(x), 1), len(x), way_px)


def _usable(x: Columns, y: Columns, tau: Float64, flows: Float64, height: int, width: int) -> NDArray[np.intp]:
    """Return the events that have a flow in every field, and room for their way."""
    longest = np.abs(flows).max(axis=(0, 2))  # NaN where any is
    clear = np.minimum(1.5 * np.abs(tau - 0.5) * longest + 2.0, min(MARGIN_PX, min(height, width) / 4))
    return np.flatnonzero(
        np.isfinite(longest) & (x >= clear) & (x <= width - 1 - clear) & (y >= clear) & (y <= height - 1 - clear)
    )


def _way_px(tau: Float64, flows: Float64) -> float:
    ways = np.hypot(flows[:, 0], flows[:, 1]) * np.abs(tau - 0.5)
    known = ways[np.isfinite(ways)]
    return float(np.sqrt(np.mean(np.square(known)))) if len(known) else 0.0


def _vote_weights() -> Float32:
    """Return the weights (PARTS, VOTE_PX) of a Gaussian on the pixels from 3 before to 4 behind one, of sum 1."""
    from_place = np.arange(-3, VOTE_PX - 3) - np.arange(PARTS)[:, None] / PARTS
    weights = np.exp(-0.5 * np.square(from_place / SIGMA_PX))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), dtype=np.float32)


_WEIGHTS: Final = _vote_weights()


def best_gain(sharpness: Float64) -> float:
    """Return the gain of the flow at which the sharpness (k,) under ``GAINS`` is largest.

    Between the gains, the parabola through the largest value and its neighbours in the logarithm of the gain tells. At
    the first and the last one the peak may lie beyond.
    """
    top = int(np.argmax(sharpness))
    if top in (0, len(GAINS) - 1):
        return GAINS[top]
    logs = np.log(GAINS)[top - 1 : top + 2]
    bend, slope, _ = np.polyfit(logs - logs[1], sharpness[top - 1 : top + 2], 2)
    step = -0.5 * slope / bend if bend < 0 else 0.0
    return float(np.exp(logs[1] + np.clip(step, logs[0] - logs[1], logs[2] - logs[1])))

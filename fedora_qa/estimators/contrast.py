"""How sharp the image of warped events is, under a flow and under altered ones.

Events of one edge, carried along the true flow to one instant, meet in one line; carried otherwise they smear. The
sharpness is the mean, over events, of the density that they meet: the sum of squares of the image of warped events
over their number (G. Gallego, H. Rebecq, D. Scaramuzza, A unifying contrast maximization framework for event cameras,
CVPR (2018); mean square, as in G. Gallego, M. Gehrig, D. Scaramuzza, Focus is all you need, CVPR (2019)).

Events are carried to the middle of the interval, not to its start: in a flow that spreads, warping to one end lets all
events gather as the flow is overdone (S. Shiba, Y. Aoki, G. Gallego, Event collapse in contrast maximization
frameworks, Sensors 22 (2022)); to the middle those before it spread as those after it gather.

Votes are cubic B-splines on nodes that are `NODE_PX` apart, four of them along either axis, and the image of them is
smoothed once, by three nodes, up to the variance of a Gaussian of `SIGMA_PX`. Without that second step nodes would have
to be 1.7 px apart, and a vote's square 4% larger at a node than between two, which lines of events feel together; with
it 1% either way. Against Gaussians on every pixel, of 64 weights a vote, gains and advantages of 30 fields of 640x480
differ by a twentieth of their standard errors at most, and these by 1%.

Events of one pixel are never of one place on an edge that moves: they meet best where nothing is carried, and would
draw every gain towards 0. What they contribute to the sum of squares is taken off: of two votes that are d apart on a
line, the autocorrelation of the B-spline at d, on the average over places between nodes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.contrast_kernels import PARTS, flow_as_seen, meetings_with_oneself, squares_under

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Columns = NDArray[np.uint16]

GAINS: Final = (0.5, 0.7, 0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25, 1.4, 2.0)
"""Gains that are tried for the best one, about evenly spread in their logarithm around 1."""

SIGMA_PX: Final = 1.0
"""Standard deviation of a vote in the image of warped events."""

NODE_PX: Final = 1.2
"""Distance of nodes."""

_SIDE: Final = ((SIGMA_PX / NODE_PX) ** 2 - 1 / 3) / 2
"""What a node gives to either neighbour: to the cubic B-spline's variance, 1/3 on nodes 1 apart, it adds twice this."""

MARGIN_PX: Final = 12.0
"""Events farther from the border than this count however large the flow is."""

_MEMORY: Final = 16
"""Events of a pixel that later ones are held against; only pixels without cause fire more often."""


@dataclass(frozen=True, slots=True)
class View:
    """Where pixels of the event camera lie on the grid (height, width) of a flow.

    Columns at ``across`` times theirs and ``left``, rows at ``down`` times theirs and ``top``; a pixel of the flow is
    ``wide`` by ``high`` pixels of the event camera.
    """

    across: float = 1.0
    left: float = 0.0
    down: float = 1.0
    top: float = 0.0
    wide: float = 1.0
    high: float = 1.0

    def mirrored(self, axis: int, shape: tuple[int, ...]) -> "View":
        """Return the view of a flow of that shape whose grid is turned over: 0 left to right, 1 top to bottom."""
        height, width = shape[:2]
        if axis:
            return replace(self, down=-self.down, top=height - 1 - self.top)
        return replace(self, across=-self.across, left=width - 1 - self.left)

    def of(self, flow_px: Float32, shape: tuple[int, int]) -> Float32:
        """Return a flow (H, W, 2), px of its grid, at the pixels of an event camera (h, w), in its px, (h, w, 2).

        Read bilinearly; NaN where there is none.
        """
        view = np.array([self.across, self.left, self.down, self.top, self.wide, self.high])
        return np.asarray(flow_as_seen(np.ascontiguousarray(flow_px, dtype=np.float32), view, *shape))


@dataclass(frozen=True, slots=True)
class WarpedEvents:
    """Sharpness under each candidate (k,), events carried, and the root mean square of their way (first field), px."""

    sharpness: Float64
    carried: int
    way_px: float


def pixel_by_pixel(x: Columns, y: Columns) -> NDArray[np.int64]:
    """Return the order of events by rows, by columns, and for those of one pixel as they came."""
    places = ((y.astype(np.int64) << 16) + x << 32) + np.arange(len(x))
    return np.sort(places) & 0xFFFFFFFF


def sharpness_under(
    x: Columns, y: Columns, tau: Float64, candidates: Sequence[tuple[Float32, Float64]]
) -> WarpedEvents:
    """Carry the same events by every candidate: a flow (h, w, 2), px, and the matrix (2, 2) that it is multiplied by.

    An event counts for all candidates or none: it must have a flow in every field, and lie farther from the border than
    one and a half times its way, or than ``MARGIN_PX``.

    Parameters
    ----------
    x, y, tau
        Events pixel by pixel (``pixel_by_pixel``); ``tau`` is their instant in intervals of the flow after its start.
    candidates
        Flows as the event camera sees them (``View.of``), all of its shape.
    """
    fields = {id(flow): flow for flow, _ in candidates}
    height, width = candidates[0][0].shape[:2]
    pixels = y.astype(np.int64) * width + x
    flows = [flow.reshape(-1, 2).take(pixels, axis=0) for flow in fields.values()]
    way_px = _way_px(tau, flows[0])
    usable = _usable(x, y, tau, flows, height, width)
    x, y, tau, pixels = x[usable], y[usable], tau[usable], pixels[usable]
    squares = np.zeros(len(candidates))
    for (name, field), flow in zip(fields.items(), flows, strict=True):
        own = [i for i, (of_one, _) in enumerate(candidates) if id(of_one) == name]
        turns = np.array([candidates[i][1] for i in own], dtype=np.float64)
        met = meetings_with_oneself(pixels, tau, flow[usable], turns, _SHARED, NODE_PX, _MEMORY)
        squares[own] = squares_under(x, y, tau, field, turns, _WEIGHTS, _SIDE, NODE_PX) - met
    return WarpedEvents(squares / max(len(x), 1), len(x), way_px)


def _usable(
    x: Columns, y: Columns, tau: Float64, flows: Sequence[Float32], height: int, width: int
) -> NDArray[np.intp]:
    """Return the events that have a flow (n, 2) in every field, and room for their way."""
    longest = np.zeros(len(x), dtype=np.float32)
    for flow in flows:
        for component in flow.T:
            longest = np.maximum(longest, np.abs(component))  # NaN where any is
    clear = np.minimum(1.5 * np.abs(tau - 0.5) * longest + 2.0, min(MARGIN_PX, min(height, width) / 4))
    return np.flatnonzero(
        np.isfinite(longest) & (x >= clear) & (x <= width - 1 - clear) & (y >= clear) & (y <= height - 1 - clear)
    )


def _way_px(tau: Float64, flows: Float32) -> float:
    squares = (np.square(flows[:, 0]) + np.square(flows[:, 1])) * np.square(tau - 0.5)
    known = squares[np.isfinite(squares)]
    return float(np.sqrt(np.mean(known))) if len(known) else 0.0


def _vote_weights() -> Float32:
    """Return the weights (PARTS, 4) of a cubic B-spline on the nodes from 1 before to 2 behind one, of sum 1."""
    place = (np.arange(PARTS) + 0.5) / PARTS
    first, last = (1 - place) ** 3 / 6, place**3 / 6
    second = (3 * place**3 - 6 * place**2 + 4) / 6
    return np.stack((first, second, 1 - first - second - last, last), axis=-1).astype(np.float32)


def _shared_by_votes(weights: Float32) -> Float64:
    """Return what two votes on a line share at distances of 0, 1, ... parts of a node, until they share nothing."""
    spline = np.pad(weights[:, ::-1].T.ravel().astype(np.float64), PARTS)
    vote = (1 - 2 * _SIDE) * spline + _SIDE * (np.roll(spline, PARTS) + np.roll(spline, -PARTS))
    return np.asarray(np.correlate(vote, vote, "full")[len(vote) - 1 :] / PARTS)


_WEIGHTS: Final = _vote_weights()
_SHARED: Final = _shared_by_votes(_WEIGHTS)


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

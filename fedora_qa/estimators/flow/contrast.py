"""How sharp the image of warped events is, under a flow and under altered ones.

Events of one edge, carried along the true flow to one instant, meet in one line; carried otherwise they smear. The
sharpness is the mean, over events, of the density that they meet: the sum of squares of the image of warped events
over their number (G. Gallego, H. Rebecq, D. Scaramuzza, A unifying contrast maximization framework for event cameras,
CVPR (2018); mean square, as in G. Gallego, M. Gehrig, D. Scaramuzza, Focus is all you need, CVPR (2019)).

Events are carried to the middle of the interval, not to its start: in a flow that spreads, warping to one end lets all
events gather as the flow is overdone (S. Shiba, Y. Aoki, G. Gallego, Event collapse in contrast maximization
frameworks, Sensors 22 (2022)); to the middle those before it spread as those after it gather.

Votes are quadratic B-splines on nodes that are `NODE_PX` apart, three of them along either axis, and the image of them
is smoothed once, by three nodes, until the square of a vote is that of a Gaussian of `SIGMA_PX` on the average over
places: 0.8% more at some and less at others, along either axis.

Events of one pixel are never of one place on an edge that moves: they meet best where nothing is carried, and would
draw every gain towards 0. What they contribute to the sum of squares is taken off: of two votes that are d apart on a
line, the autocorrelation of the B-spline at d, on the average over places between nodes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.contrast_kernels import (
    PARTS,
    EventsInFlow,
    FoldedFlow,
    flow_as_seen,
    flows_of,
    meetings_with_oneself,
    squares_under,
    with_room,
)

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Columns = NDArray[np.uint16]

GAINS: Final = (0.5, 0.7, 0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25, 1.4, 2.0)
"""Gains that are tried for the best one, about evenly spread in their logarithm around 1."""

SIGMA_PX: Final = 1.0
"""Standard deviation of a vote in the image of warped events."""

NODE_PX: Final = 1.1
"""Distance of nodes."""

MARGIN_PX: Final = 12.0
"""Events farther from the border than this count however large the flow is."""

_MEMORY: Final = 16
"""Events of a pixel that later ones are compared with; only pixels without cause fire more often."""

_SQUARE_LEFT: Final = 11 / 20 - NODE_PX / (2 * np.sqrt(np.pi) * SIGMA_PX)
_SIDE: Final = float((80 / 60 - np.sqrt(80 / 60 * (80 / 60) - 4 * (95 / 60) * _SQUARE_LEFT)) / (2 * (95 / 60)))
"""What a node gives to either neighbour so that a vote's square is that of the Gaussian.

The square of a vote is, on the average over places, the sum of the autocorrelations of the quadratic B-spline, 11/20,
13/60, 1/120 at distances of 0, 1, 2 nodes, times those of the shares (s, 1 - 2 s, s): 95/60 s^2 - 80/60 s + 11/20.
"""

_NODES: Final = (np.arange(3 * PARTS) + 0.5) / PARTS - 1.5
_SPLINE: Final = np.pad(np.where(np.abs(_NODES) < 0.5, 0.75 - _NODES**2, 0.5 * (1.5 - np.abs(_NODES)) ** 2), PARTS)
"""Quadratic B-spline: 3/4 - x^2 within half a node, (3/2 - |x|)^2 / 2 from there to one and a half."""

_VOTE: Final = (1 - 2 * _SIDE) * _SPLINE + _SIDE * (np.roll(_SPLINE, PARTS) + np.roll(_SPLINE, -PARTS))
_SHARED: Final[Float64] = np.asarray(np.correlate(_VOTE, _VOTE, "full")[len(_VOTE) - 1 :] / PARTS)
"""What two votes on a line share at distances of 0, 1, ... parts of a node, until they share nothing: as the
autocorrelation is symmetric, only one side of it."""


@dataclass(frozen=True, slots=True)
class SensorView:
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

    def of(self, flow_px: Float32, wanted: NDArray[np.bool_], width: int) -> "SensorFlow":
        """Return a flow (H, W, 2), px of its grid, at the pixels (h, width) of an event camera, in its wanted rows."""
        view = np.array([self.across, self.left, self.down, self.top, self.wide, self.high])
        return SensorFlow(flow_as_seen(np.ascontiguousarray(flow_px, dtype=np.float32), view, wanted, width))

    def mirrored(self, flow: "SensorFlow", axis: int, shape: tuple[int, ...]) -> "SensorFlow":
        """Return a flow that ``of`` gave, its grid of a shape (H, W) turned over: 0 left to right, 1 top to bottom."""
        if axis:
            # H - 1 - (down r + top) = down r' + top gives r' = (H - 1 - 2 top) / down - r, and so along columns.
            return replace(flow, down=-1.0, top=(shape[0] - 1 - 2 * self.top) / self.down)
        return replace(flow, across=-1.0, left=(shape[1] - 1 - 2 * self.left) / self.across)


@dataclass(frozen=True, slots=True)
class SensorFlow:
    """A flow (h, w, 2) at the pixels of an event camera, in its px, NaN where there is none.

    The flow of a pixel stands at ``across`` times its column and ``left``, ``down`` times its row and ``top``.
    """

    flow_px: Float32
    across: float = 1.0
    left: float = 0.0
    down: float = 1.0
    top: float = 0.0

    @property
    def folded(self) -> FoldedFlow:
        """The flow, and the four numbers of where the flow of a pixel stands."""
        return FoldedFlow(self.flow_px, np.array([self.across, self.left, self.down, self.top], dtype=np.float32))

    def at(self, events: "WarpableEvents") -> "EventFlow":
        """Return the flow at the events' own pixels."""
        return EventFlow(self, *flows_of(events.x, events.y, self.folded))


@dataclass(frozen=True, slots=True)
class WarpableEvents:
    """Columns, rows (n,) and instants, in intervals of the flow after its start, of events, pixel by pixel."""

    x: Float32
    y: Float32
    tau: Float32

    @classmethod
    def pixel_by_pixel(cls, x: Columns, y: Columns, tau: Float64) -> "WarpableEvents":
        """Order events by rows, by columns, and leave those of one pixel as they came."""
        # One sort of integers: row, column and index of each event.
        keys = ((y.astype(np.int64) << 16) + x << 32) + np.arange(len(x))
        order = np.sort(keys) & 0xFFFFFFFF
        return cls(*(values.astype(np.float32)[order] for values in (x, y, tau)))

    def chosen(self, which: NDArray[np.int64]) -> "WarpableEvents":
        """Return some of the events, by index."""
        return WarpableEvents(self.x[which], self.y[which], self.tau[which])


@dataclass(frozen=True, slots=True)
class EventFlow:
    """The flow (2, n) at the pixels of events, NaN where none is known, and its index (n,) in the sensor's flow."""

    sensor: SensorFlow
    flows_px: Float32
    indices: NDArray[np.int32]

    def chosen(self, which: NDArray[np.int64]) -> "EventFlow":
        """Return the flow of some of the events, by index."""
        return EventFlow(self.sensor, self.flows_px.take(which, axis=1), self.indices[which])


@dataclass(frozen=True, slots=True)
class WarpedEvents:
    """Sharpness under each matrix of each candidate (k,), which events were carried, and their way.

    The last: root mean square, in px, along the first candidate's flow, of all events that have a flow in it.
    """

    sharpness: Float64
    carried: NDArray[np.int64]
    way_px: float


def sharpness_under(events: WarpableEvents, candidates: Sequence[tuple[EventFlow, Sequence[Float64]]]) -> WarpedEvents:
    """Carry the same events by every candidate: a flow, and the matrices (2, 2) that it is multiplied by.

    An event counts for all candidates or none: it must have a flow in every field, and lie farther from the border than
    one and a half times its way, or than ``MARGIN_PX``. All sensor flows are of one shape.

    Parameters
    ----------
    events
        Pixel by pixel, those of one pixel in order of time.
    candidates
        At least one: the flow at these events, and the matrices by which it is multiplied.

    Returns
    -------
    WarpedEvents
        With the sharpness (k,) per px^2, candidate by candidate and matrix by matrix.
    """
    height, width = candidates[0][0].sensor.flow_px.shape[:2]
    flows = np.stack([flow.flows_px for flow, _ in candidates])
    # A quarter of the shorter side at most: in small images the middle half still counts.
    margin_px = min(MARGIN_PX, min(height, width) / 4)
    usable, square_px2 = with_room(events.x, events.y, events.tau, flows, height, width, margin_px)
    events, squares = events.chosen(usable), []
    for flow, matrices in candidates:
        usable_flow, stacked = flow.chosen(usable), np.array(matrices, dtype=np.float32)
        in_flow = EventsInFlow(events.x, events.y, events.tau, usable_flow.flows_px, usable_flow.indices)
        # Events of one pixel are never of one place on a moving edge: what they contribute is taken off.
        met = meetings_with_oneself(in_flow, stacked, _SHARED, NODE_PX, _MEMORY)
        # Mean square of the image (Gallego et al. 2019), without the pairs that the events of one pixel form.
        squares.append(squares_under(in_flow, flow.sensor.folded, stacked, _SIDE, NODE_PX) - met)
    return WarpedEvents(np.concatenate(squares) / max(len(usable), 1), usable, float(np.sqrt(square_px2)))


def best_gain(sharpness: Float64) -> float:
    """Return the gain of the flow at which the sharpness (k,) under ``GAINS`` is largest.

    Between the gains, the parabola through the largest value and its neighbours in the logarithm of the gain decides.
    At the first and the last one the peak may lie beyond.

    Parameters
    ----------
    sharpness
        (k,) one value for each of ``GAINS``.

    Returns
    -------
    float
        Gain, 1 where the flow as given is the sharpest.
    """
    sharpest = int(np.argmax(sharpness))
    if sharpest in (0, len(GAINS) - 1):
        return GAINS[sharpest]
    logs = np.log(GAINS)[sharpest - 1 : sharpest + 2]
    # The vertex of bend x^2 + slope x + c lies at -slope / (2 bend), x being the logarithm from the middle gain.
    bend, slope, _ = np.polyfit(logs - logs[1], sharpness[sharpest - 1 : sharpest + 2], 2)
    step = -0.5 * slope / bend if bend < 0 else 0.0
    return float(np.exp(logs[1] + np.clip(step, logs[0] - logs[1], logs[2] - logs[1])))

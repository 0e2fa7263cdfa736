"""Sharpness of the image of warped events, under a flow and under altered ones.

Events of one edge that are warped along the true flow to one instant lie on one line; under another flow they spread.
The sharpness is the mean, over events, of the event density at their warped positions. It equals the sum of squares of
the image of warped events over their number (G. Gallego, H. Rebecq, D. Scaramuzza, A unifying contrast maximization
framework for event cameras, CVPR (2018); mean square, as in G. Gallego, M. Gehrig, D. Scaramuzza, Focus is all you
need, CVPR (2019)).

Events are warped to the middle of the interval, not to its start. In a diverging flow, a warp to one end concentrates
all events as the flow is exaggerated (S. Shiba, Y. Aoki, G. Gallego, Event collapse in contrast maximization
frameworks, Sensors 22 (2022)). In a warp to the middle, the events before it spread as those after it concentrate.

The image has nodes `NODE_PX` apart. Each event adds a vote to it, a quadratic B-spline over three nodes along either
axis. The image is then smoothed once, over three nodes, so that the square of a vote is that of a Gaussian of
`SIGMA_PX` on average over positions; it is 0.8% larger or smaller at some positions, along either axis.

Events of one pixel never come from one point of a moving edge. They coincide best if nothing is warped, and would bias
every gain towards 0. Their contribution to the sum of squares is therefore subtracted: for two votes at distance d on a
line it is the autocorrelation of the B-spline at d, on average over positions between nodes.
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
"""Gains among which the best one is searched, about evenly spaced in their logarithm around 1."""

SIGMA_PX: Final = 1.0
"""Standard deviation of a vote in the image of warped events."""

NODE_PX: Final = 1.1
"""Distance of the nodes of the image of warped events."""

MARGIN_PX: Final = 12.0
"""Events farther from the border than this count for any size of the flow."""

_MEMORY: Final = 16
"""Number of earlier events of its pixel with which each event is paired; only hot pixels fire more often."""

_SQUARE_LEFT: Final = 11 / 20 - NODE_PX / (2 * np.sqrt(np.pi) * SIGMA_PX)
_SIDE: Final = float((80 / 60 - np.sqrt(80 / 60 * (80 / 60) - 4 * (95 / 60) * _SQUARE_LEFT)) / (2 * (95 / 60)))
"""Share s of its value that a node adds to either neighbour, so that the square of a vote is that of the Gaussian.

On average over positions, the square of a vote is the sum of products of two autocorrelations: those of the quadratic
B-spline, 11/20, 13/60, 1/120 at distances of 0, 1, 2 nodes, and those of the shares (s, 1 - 2 s, s). This gives
95/60 s^2 - 80/60 s + 11/20.
"""

_NODES: Final = (np.arange(3 * PARTS) + 0.5) / PARTS - 1.5
_SPLINE: Final = np.pad(np.where(np.abs(_NODES) < 0.5, 0.75 - _NODES**2, 0.5 * (1.5 - np.abs(_NODES)) ** 2), PARTS)
"""Quadratic B-spline: 3/4 - x^2 for |x| up to half a node, (3/2 - |x|)^2 / 2 from there to one and a half nodes."""

_VOTE: Final = (1 - 2 * _SIDE) * _SPLINE + _SIDE * (np.roll(_SPLINE, PARTS) + np.roll(_SPLINE, -PARTS))
_SHARED: Final[Float64] = np.asarray(np.correlate(_VOTE, _VOTE, "full")[len(_VOTE) - 1 :] / PARTS)
"""Autocorrelation of a vote on a line, at distances of 0, 1, ... parts of a node, up to where it is 0. It is symmetric,
so that one side is enough."""


@dataclass(frozen=True, slots=True)
class SensorView:
    """Where the pixels of the event camera lie on the grid (H, W) of a flow.

    Attributes
    ----------
    across, left
        A column of the event camera lies at ``across`` times the column plus ``left`` on the grid, px.
    down, top
        A row of the event camera lies at ``down`` times the row plus ``top`` on the grid, px.
    wide, high
        Width and height of a pixel of the flow, in pixels of the event camera.
    """

    across: float = 1.0
    left: float = 0.0
    down: float = 1.0
    top: float = 0.0
    wide: float = 1.0
    high: float = 1.0

    def of(self, flow_px: Float32, wanted: NDArray[np.bool_], width: int) -> "SensorFlow":
        """Return a flow at the pixels of the event camera.

        Parameters
        ----------
        flow_px
            (H, W, 2) px of its own grid.
        wanted
            (h,) which rows of the event camera are filled.
        width
            Of the event camera, px.

        Returns
        -------
        SensorFlow
            (h, width, 2) px of the event camera; NaN beyond the grid and in rows that are not wanted.
        """
        view = np.array([self.across, self.left, self.down, self.top, self.wide, self.high])
        return SensorFlow(flow_as_seen(np.ascontiguousarray(flow_px, dtype=np.float32), view, wanted, width))

    def mirrored(self, flow: "SensorFlow", axis: int, shape: tuple[int, ...]) -> "SensorFlow":
        """Return a flow of ``of`` that is read at mirrored pixels of its grid.

        Parameters
        ----------
        flow
            From ``of``, not mirrored.
        axis
            0 mirrors left to right, 1 top to bottom.
        shape
            (H, W) of the grid of the flow, px.

        Returns
        -------
        SensorFlow
            With the same values; the signs of u and v are not changed.
        """
        if axis:
            # H - 1 - (down r + top) = down r' + top gives r' = (H - 1 - 2 top) / down - r, and so along columns.
            return replace(flow, down=-1.0, top=(shape[0] - 1 - 2 * self.top) / self.down)
        return replace(flow, across=-1.0, left=(shape[1] - 1 - 2 * self.left) / self.across)


@dataclass(frozen=True, slots=True)
class SensorFlow:
    """A flow at the pixels of an event camera.

    Attributes
    ----------
    flow_px
        (h, w, 2) px of the event camera, NaN where there is none.
    across, left
        The flow of a pixel is stored at ``across`` times its column plus ``left``.
    down, top
        The flow of a pixel is stored at ``down`` times its row plus ``top``.
    """

    flow_px: Float32
    across: float = 1.0
    left: float = 0.0
    down: float = 1.0
    top: float = 0.0

    @property
    def folded(self) -> FoldedFlow:
        """The flow with its four numbers as an array, as compiled loops take it."""
        return FoldedFlow(self.flow_px, np.array([self.across, self.left, self.down, self.top], dtype=np.float32))

    def at(self, events: "WarpableEvents") -> "EventFlow":
        """Return the flow at the pixels of the events."""
        return EventFlow(self, *flows_of(events.x, events.y, self.folded))


@dataclass(frozen=True, slots=True)
class WarpableEvents:
    """Events in the order of their pixels.

    Attributes
    ----------
    x, y
        (n,) columns and rows, px.
    tau
        (n,) instants after the start of the interval of the flow, in lengths of that interval.
    """

    x: Float32
    y: Float32
    tau: Float32

    @classmethod
    def pixel_by_pixel(cls, x: Columns, y: Columns, tau: Float64) -> "WarpableEvents":
        """Return events sorted by row, then by column; those of one pixel keep their order.

        Parameters
        ----------
        x, y
            (n,) columns and rows, px.
        tau
            (n,) instants after the start of the interval of the flow, in lengths of that interval.

        Returns
        -------
        WarpableEvents
            The same n events.
        """
        # One sort of integers: row, column and index of each event.
        keys = ((y.astype(np.int64) << 16) + x << 32) + np.arange(len(x))
        order = np.sort(keys) & 0xFFFFFFFF
        return cls(*(values.astype(np.float32)[order] for values in (x, y, tau)))

    def chosen(self, which: NDArray[np.int64]) -> "WarpableEvents":
        """Return the events at the indices (k,)."""
        return WarpableEvents(self.x[which], self.y[which], self.tau[which])


@dataclass(frozen=True, slots=True)
class EventFlow:
    """The flow at the pixels of events.

    Attributes
    ----------
    sensor
        The flow of all pixels.
    flows_px
        (2, n) u and v at the events, px, NaN where there is none.
    indices
        (n,) index of the pixel of ``sensor`` that each is read at, counted row by row.
    """

    sensor: SensorFlow
    flows_px: Float32
    indices: NDArray[np.int32]

    def chosen(self, which: NDArray[np.int64]) -> "EventFlow":
        """Return the flow of the events at the indices (k,)."""
        return EventFlow(self.sensor, self.flows_px.take(which, axis=1), self.indices[which])


@dataclass(frozen=True, slots=True)
class WarpedEvents:
    """Sharpness of warped events, and which events were warped.

    Attributes
    ----------
    sharpness
        (k,) per px^2, under each matrix of each candidate.
    carried
        (n,) indices of the events that were warped.
    way_px
        Root mean square displacement, px, to the middle of the interval along the flow of the first candidate, of
        all events that have a flow in it.
    """

    sharpness: Float64
    carried: NDArray[np.int64]
    way_px: float


def sharpness_under(events: WarpableEvents, candidates: Sequence[tuple[EventFlow, Sequence[Float64]]]) -> WarpedEvents:
    """Return the sharpness of the same events, warped by every candidate.

    An event counts for all candidates or for none. It must have a flow in every candidate. It must also lie farther
    from the border than one and a half times its largest displacement plus 2 px, or than ``MARGIN_PX``.

    Parameters
    ----------
    events
        Pixel by pixel, those of one pixel in order of time.
    candidates
        At least one: the flow at these events, and the matrices (2, 2) by which it is multiplied. All sensor flows
        have one shape.

    Returns
    -------
    WarpedEvents
        With the sharpness (k,) per px^2, candidate by candidate and matrix by matrix.
    """
    height, width = candidates[0][0].sensor.flow_px.shape[:2]
    flows = np.stack([flow.flows_px for flow, _ in candidates])
    # At most a quarter of the shorter side, so that in small images the middle half still counts.
    margin_px = min(MARGIN_PX, min(height, width) / 4)
    usable, square_px2 = with_room(events.x, events.y, events.tau, flows, height, width, margin_px)
    events, squares = events.chosen(usable), []
    for flow, matrices in candidates:
        usable_flow, stacked = flow.chosen(usable), np.array(matrices, dtype=np.float32)
        in_flow = EventsInFlow(events.x, events.y, events.tau, usable_flow.flows_px, usable_flow.indices)
        # Events of one pixel never come from one point of a moving edge: their contribution is subtracted.
        met = meetings_with_oneself(in_flow, stacked, _SHARED, NODE_PX, _MEMORY)
        # Mean square of the image (Gallego et al. 2019), without the pairs of events of one pixel.
        squares.append(squares_under(in_flow, flow.sensor.folded, stacked, _SIDE, NODE_PX) - met)
    return WarpedEvents(np.concatenate(squares) / max(len(usable), 1), usable, float(np.sqrt(square_px2)))


def best_gain(sharpness: Float64) -> float:
    """Return the gain of the flow at which the sharpness (k,) under ``GAINS`` is largest.

    Between the gains, the maximum is that of the parabola through the largest value and its neighbours in the logarithm
    of the gain. If the first or the last gain has the largest value, it is returned, although the maximum may lie
    beyond.

    Parameters
    ----------
    sharpness
        (k,) one value for each of ``GAINS``.

    Returns
    -------
    float
        Gain; 1 where the flow as given is the sharpest.
    """
    sharpest = int(np.argmax(sharpness))
    if sharpest in (0, len(GAINS) - 1):
        return GAINS[sharpest]
    logs = np.log(GAINS)[sharpest - 1 : sharpest + 2]
    # The vertex of bend x^2 + slope x + c lies at -slope / (2 bend), x being the logarithm of gain over middle gain.
    bend, slope, _ = np.polyfit(logs - logs[1], sharpness[sharpest - 1 : sharpest + 2], 2)
    step = -0.5 * slope / bend if bend < 0 else 0.0
    return float(np.exp(logs[1] + np.clip(step, logs[0] - logs[1], logs[2] - logs[1])))

"""Compiled loops over events that are warped along a flow: their warped positions, and the event density there."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Bools = NDArray[np.bool_]

PARTS = 128
"""Number of distances of votes that are distinguished within one node."""

_STEPS = 2
"""Number of iterations that find the pixel of an event's point at the start of the interval."""

_BEFORE = np.float32(3)
"""Number of nodes before the first pixel: events inside the image have no vote in the corner of three by three
nodes."""

_BEYOND = np.float32(-1)
"""Position that stands for events that leave the image."""


class EventsInFlow(NamedTuple):
    """Events and their flow.

    Attributes
    ----------
    x, y, tau
        (n,) columns and rows, px, and instants after the start of the interval of the flow, in lengths of that
        interval.
    flows_px
        (2, n) flow at the pixels of the events, px, NaN where there is none.
    indices
        (n,) index of the pixel that the flow is read at, counted row by row.
    """

    x: Float32
    y: Float32
    tau: Float32
    flows_px: Float32
    indices: Int32


class FoldedFlow(NamedTuple):
    """A flow at the pixels of the event camera, possibly mirrored.

    Attributes
    ----------
    flow_px
        (h, w, 2) px of the event camera.
    fold
        (4,) The flow of pixel (x, y) is stored in column ``fold[0] x + fold[1]`` and row ``fold[2] y + fold[3]``.
    """

    flow_px: Float32
    fold: Float32


@njit(cache=True)
def on_rows(
    x: NDArray[np.integer], y: NDArray[np.integer], span: tuple[int, int, int], width: int, rows: Bools
) -> Int64:
    """Return which events of a regular sample lie within the image and in the wanted rows.

    Parameters
    ----------
    x, y
        (n,) columns and rows of events, px.
    span
        First event, the one after the last, and the step between the events that are read.
    width
        Of the image, px.
    rows
        (h,) which rows of the image are wanted.

    Returns
    -------
    ndarray of int64
        (k,) indices of these events, ascending.
    """
    first, stop, step = span
    chosen, count = np.empty((stop - first + step - 1) // step, np.int64), 0
    for i in range(first, stop, step):
        # Without a branch: the next index overwrites one that does not count.
        chosen[count] = i
        count += int((0 <= x[i] < width) and (0 <= y[i] < len(rows)) and rows[y[i]])
    return chosen[:count]


@njit(cache=True)
def flow_as_seen(flow_px: Float32, view: Float64, wanted: Bools, width: int) -> Float32:
    """Return a flow at the pixels of the event camera, from the nearest pixel of its grid.

    Parameters
    ----------
    flow_px
        (H, W, 2) px of its own grid.
    view
        (6,) where the pixels of the event camera lie on that grid: scale and offset of columns, then of rows; then
        width and height of a pixel of the flow, in pixels of the event camera.
    wanted
        (height,) which rows of the event camera are filled.
    width
        Of the event camera, px.

    Returns
    -------
    ndarray of float32
        (height, width, 2) px of the event camera; NaN beyond the grid and in rows that are not wanted.
    """
    sensor_px = np.full((len(wanted), width, 2), np.nan, np.float32)
    first, stop, nearest = width, 0, np.empty(width, np.int64)
    for column in range(width):
        flow_column = np.rint(view[0] * column + view[1])
        if 0 <= flow_column < flow_px.shape[1]:
            first, stop, nearest[column] = min(first, column), column + 1, int(flow_column)
    across, down = np.float32(view[4]), np.float32(view[5])
    for row in range(len(wanted)):
        flow_row = np.rint(view[2] * row + view[3])
        if wanted[row] and 0 <= flow_row < flow_px.shape[0]:
            line, of_row = sensor_px[row], flow_px[int(flow_row)]
            for column in range(first, stop):
                index = np.uint64(nearest[column])  # unsigned: an index that may be negative costs a comparison
                line[column, 0], line[column, 1] = across * of_row[index, 0], down * of_row[index, 1]
    return sensor_px


@njit(cache=True)
def flows_of(x: Float32, y: Float32, flow: FoldedFlow) -> tuple[Float32, Int32]:
    """Return a flow at pixels of the event camera.

    Parameters
    ----------
    x, y
        (n,) columns and rows, px.
    flow
        The flow, and where the flow of a pixel is stored.

    Returns
    -------
    flows_px, indices
        (2, n) flow, px, NaN where there is none; (n,) index of the pixel that it is read at, counted row by row, 0
        where there is none.
    """
    fold, flow_px = flow.fold, flow.flow_px
    height, width = flow_px.shape[:2]
    flows, indices = np.full((2, len(x)), np.nan, np.float32), np.zeros(len(x), np.int32)
    for i in range(len(x)):
        column, row = np.rint(fold[0] * x[i] + fold[1]), np.rint(fold[2] * y[i] + fold[3])
        if 0 <= column < width and 0 <= row < height:
            u, v = flow_px[int(row), int(column)]
            if abs(u + v) < np.inf:
                flows[0, i], flows[1, i], indices[i] = u, v, int(row) * width + int(column)
    return flows, indices


@njit(cache=True)
def with_room(
    x: Float32, y: Float32, tau: Float32, flows: Float32, height: int, width: int, margin_px: float
) -> tuple[Int64, float]:
    """Return the events that have a flow in every field and enough distance from the border.

    Parameters
    ----------
    x, y, tau
        (n,) columns and rows, px, and instants after the start of the interval of the flow, in lengths of that
        interval.
    flows
        (m, 2, n) flow of the m fields at the events, px, NaN where there is none.
    height, width
        Of the image, px.
    margin_px
        Events farther from the border than this are far enough for any displacement. Others must be farther from it
        than 2 px plus one and a half times the displacement to the middle of the interval along the longest
        component.

    Returns
    -------
    chosen, mean_square_px2
        (k,) indices of these events; mean square displacement along the first field, px^2, of all events with a
        flow in it.
    """
    chosen, count = np.empty(len(x), np.int64), 0
    total, flow_count = 0.0, 0
    for i in range(len(x)):
        away, longest = abs(tau[i] - np.float32(0.5)), np.float32(0)
        for k in range(len(flows)):
            u, v = abs(flows[k, 0, i]), abs(flows[k, 1, i])
            # An infinite displacement excludes the event: it must have a flow in every field.
            longest = max(longest, u, v) if u + v < np.inf else np.float32(np.inf)
        u, v = flows[0, 0, i], flows[0, 1, i]
        if abs(u + v) < np.inf:
            total, flow_count = total + away * away * (u * u + v * v), flow_count + 1
        clear = min(1.5 * away * longest + 2.0, margin_px)
        chosen[count] = i
        inside = clear <= x[i] <= width - 1 - clear and clear <= y[i] <= height - 1 - clear
        count += int(inside and longest < np.inf)
    return chosen[:count], total / max(flow_count, 1)


@njit(cache=True)
def squares_under(events: EventsInFlow, flow: FoldedFlow, matrices: Float32, side: float, node_px: float) -> Float64:
    """Return the sum of squares of the image of warped events under altered flows.

    A vote is a quadratic B-spline. Events that are warped beyond the image have no vote.

    Parameters
    ----------
    events
        Events with the flow at their own pixels.
    flow
        The flow of all pixels.
    matrices
        (k, 2, 2) by which the flow is multiplied, one after the other.
    side
        Share of its votes that each node adds to either neighbour, along both axes.
    node_px
        Distance of nodes, px.

    Returns
    -------
    ndarray of float64
        (k,) integral of the squared event density, per px^2.
    """
    height, width = flow.flow_px.shape[:2]
    per_px = np.float32(1.0 / node_px)
    image = np.zeros((int((height - 1) * per_px) + 8, int((width - 1) * per_px) + 8), np.float32)
    voted = np.zeros(len(image), np.bool_)
    columns, rows = np.empty(len(events.x), np.float32), np.empty(len(events.x), np.float32)
    squares = np.empty(len(matrices))
    for k in range(len(matrices)):
        carry(events, flow, matrices[k], columns, rows)
        _vote(image, voted, columns, rows, per_px)
        image[:3, :3] = 0  # votes of events that were warped beyond the image
        squares[k] = _sum_of_squares(image, voted, np.float32(side)) * per_px * per_px
        for row in range(len(image)):
            if voted[row]:
                image[row], voted[row] = 0, False
    return squares


@njit(cache=True)
def carry(events: EventsInFlow, flow: FoldedFlow, matrix: Float32, columns: Float32, rows: Float32) -> None:
    """Write the positions of events at the middle of the interval.

    The flow, times a matrix, is read at the pixel of the event's point at the start of the interval. Where there is
    none, it is read at the event's own pixel. The loops are split so that all but the one that reads the flow handle
    many events at once.

    Parameters
    ----------
    events
        Events (n,) with the flow at their own pixels.
    flow
        The flow of all pixels.
    matrix
        (2, 2) by which the flow is multiplied.
    columns, rows
        (n,) written: positions, px; -1 where an event leaves the image.
    """
    x, y, tau, indices = events.x, events.y, events.tau, events.indices
    a, b, c, d = matrix[0, 0], matrix[0, 1], matrix[1, 0], matrix[1, 1]
    fold, height, wide = flow.fold, flow.flow_px.shape[0], np.int32(flow.flow_px.shape[1])
    right, bottom = np.float32(flow.flow_px.shape[1] - 1), np.float32(height - 1)
    zero, half, values = np.float32(0), np.float32(0.5), flow.flow_px.reshape(-1)
    own_u, own_v = events.flows_px[0], events.flows_px[1]
    for i in range(len(x)):
        columns[i], rows[i] = own_u[i], own_v[i]
    origins = np.empty(len(x), np.int32)
    # Fixed point of p = x - tau A flow(p): the flow is given at the pixels p of the start, the event lies at x at tau.
    for _ in range(_STEPS):
        for i in range(len(x)):
            u, v = columns[i], rows[i]
            column = fold[0] * (x[i] - tau[i] * (a * u + b * v)) + fold[1]
            row = fold[2] * (y[i] - tau[i] * (c * u + d * v)) + fold[3]
            inside = (column >= zero) & (column <= right) & (row >= zero) & (row <= bottom)
            index = np.int32(row + half) * wide + np.int32(column + half)
            origins[i] = index if inside else indices[i]
        for i in range(len(x)):
            first = np.uint64(2) * np.uint64(origins[i])
            columns[i], rows[i] = values[first], values[first + np.uint64(1)]
        for i in range(len(x)):
            is_finite = abs(columns[i] + rows[i]) < np.float32(np.inf)
            columns[i], rows[i] = (columns[i] if is_finite else own_u[i]), (rows[i] if is_finite else own_v[i])
    for i in range(len(x)):
        u, v = columns[i], rows[i]
        # x' = x + (1/2 - tau) A flow(p). The target is the middle, as in a warp to one end an exaggerated flow
        # collapses
        # the events and scores best (Shiba et al. 2022).
        column, row = x[i] + (half - tau[i]) * (a * u + b * v), y[i] + (half - tau[i]) * (c * u + d * v)
        stays = (column >= zero) & (column <= right) & (row >= zero) & (row <= bottom)
        columns[i], rows[i] = (column if stays else _BEYOND), (row if stays else _BEYOND)


@njit(cache=True)
def _vote(image: Float32, voted: Bools, columns: Float32, rows: Float32, per_px: np.float32) -> None:
    """Add the votes of events at positions (n,), px, and mark the rows that have any.

    Events beyond the image vote in its corner.
    """
    zero, unity, half = np.float32(0), np.float32(1), np.float32(0.5)
    for i in range(len(columns)):
        stays = columns[i] >= zero
        column, row = (columns[i] * per_px + _BEFORE, rows[i] * per_px + _BEFORE) if stays else (zero, zero)
        left, top = np.int32(column), np.int32(row)
        right, below = column - np.float32(left), row - np.float32(top)
        # Quadratic B-spline at the three nodes about a position: (1 - t)^2 / 2, the rest to 1, t^2 / 2.
        first, last = half * (unity - right) * (unity - right), half * right * right
        upper, lower = half * (unity - below) * (unity - below), half * below * below
        second, shares, index = unity - first - last, (upper, unity - upper - lower, lower), np.uint64(left)
        for k in range(3):
            line, share = image[np.uint64(top + k)], shares[k]
            voted[np.uint64(top + k)] = True
            before = (
                line[index],
                line[index + np.uint64(1)],
                line[index + np.uint64(2)],
            )  # read first, so that no read waits for a write
            line[index], line[index + np.uint64(1)] = before[0] + share * first, before[1] + share * second
            line[index + np.uint64(2)] = before[2] + share * last


@njit(cache=True, fastmath={"reassoc", "contract"})
def _sum_of_squares(image: Float32, voted: Bools, side: np.float32) -> float:
    """Return the sum of squares of an image of which each pixel adds a share to either neighbour along both axes.

    Only rows near one that is marked in ``voted`` (h,) are read; the others are 0.
    """
    total, middle = 0.0, np.float32(1) - side - side
    mixed = np.empty(image.shape[1], np.float32)
    for row in range(1, len(image) - 1):
        if not (voted[row - 1] | voted[row] | voted[row + 1]):
            continue
        above, here, below, of_row = image[row - 1], image[row], image[row + 1], np.float32(0)
        for column in range(len(mixed)):
            mixed[column] = middle * here[column] + side * (above[column] + below[column])
        left, right = mixed[:-2], mixed[2:]
        for column in range(len(left)):
            value = middle * mixed[column + 1] + side * (left[column] + right[column])
            of_row += value * value
        total += float(of_row)
    return total


@njit(cache=True)
def meetings_with_oneself(
    events: EventsInFlow, matrices: Float32, shared: Float64, node_px: float, memory: int
) -> Float64:
    """Return the part of the sum of squares that pairs of events of one pixel contribute.

    Parameters
    ----------
    events
        Pixel by pixel, those of one pixel in order of time. They are warped by the flow at the pixel itself.
    matrices
        (k, 2, 2) by which the flow is multiplied.
    shared
        Autocorrelation of a vote on a line, by the distance in parts of a node; 0 beyond.
    node_px
        Distance of nodes, px.
    memory
        Number of earlier events of its pixel with which each event is paired.

    Returns
    -------
    ndarray of float64
        (k,) per px^2, to be subtracted from the result of ``squares_under``.
    """
    x, y, tau, flows = events.x, events.y, events.tau, events.flows_px
    met = np.zeros(len(matrices))
    for i in range(1, len(x)):
        for j in range(i - 1, max(i - 1 - memory, -1), -1):
            if x[j] != x[i] or y[j] != y[i]:
                break
            parts = abs(tau[i] - tau[j]) * PARTS / node_px
            u, v = flows[0, i], flows[1, i]
            for k in range(len(matrices)):
                matrix = matrices[k]
                du, dv = matrix[0, 0] * u + matrix[0, 1] * v, matrix[1, 0] * u + matrix[1, 1] * v
                across, down = parts * abs(du) + 0.5, parts * abs(dv) + 0.5
                if across < len(shared) and down < len(shared):
                    # The square of a sum holds each pair twice; the unit is 1/px^2, as of `squares_under`.
                    met[k] += 2.0 * shared[int(across)] * shared[int(down)] / (node_px * node_px)
    return met

"""Fields of one rate, one after the other, composed to the displacement over a longer interval."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow_mask import flow_conflicts
from fedora_qa.sequence.facts import Clock, Facts
from fedora_qa.sequence.window import Window

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
Change = Callable[[Float32], NDArray[np.floating]]
"""What is done to a stored field (H, W, 2) before it is composed."""

_MOST_FIELDS: Final = 12
"""Fields that may make up a common interval: five of 50 Hz, or five of 25 Hz against two of 10 Hz, with room."""

_ROUNDING_PX: Final = 18 * 2.0**-24
"""Single-precision rounding of a flow, for each pixel of width and height; ``geometry.rigid_flow`` derives it in full.

Four roundings of 2 f (1 + |m|) and of pixel and principal point, with f = 0.87 W at 60 degrees: below 18 W.
"""

_OF_SECOND_DIFFERENCE: Final = 0.25
"""Twice the error of bilinear reading, which is an eighth of the second differences (Lagrange's remainder)."""

_OF_THIRD_DIFFERENCE: Final = 0.5
"""Where two surfaces meet, flow steps by s from one pixel to the next, and what is read between them errs by up to s.

The second difference is s before the step and -s behind it, the third 2 s; where flow is smooth it vanishes.
"""

_KNOWN, _BREAK, _CROWDED = np.uint8(1), np.uint8(2), np.uint8(4)


@dataclass(frozen=True, slots=True)
class Chain:
    """Consecutive fields of one rate, by row, that lead from one instant to another."""

    stream: str
    rows: tuple[int, ...]

    def shifted(self, fields: int) -> "Chain":
        """Return the chain of the fields so many rows later."""
        return Chain(self.stream, tuple(row + fields for row in self.rows))


@dataclass(frozen=True, slots=True)
class Segment:
    """An interval that two rates cover by whole fields, the slower one first; in ns from the file's origin."""

    slow: Chain
    fast: Chain
    start_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class Composed:
    """Where pixels are taken.

    Attributes
    ----------
    displacement_px
        (n, 2) sum of the fields along each pixel's path; worthless where the path does not stay.
    bound_px
        (n,) how far it may err by interpolation and rounding.
    clear
        (n,) whether flow is known all along the path, which keeps away from breaks of the flow and from places where
        surfaces meet. A single field is read at its pixels: there nothing need be kept away from.
    stays
        (n,) whether the path ends, and lies, within the image.
    """

    displacement_px: Float64
    bound_px: Float64
    clear: Mask
    stays: Mask


@dataclass(frozen=True, slots=True)
class _Field:
    """A field to read between its pixels.

    ``error_px`` (H, W) bounds what bilinear reading errs by; half floats resolve it to 6e-8 px. ``flags`` (H, W) say
    where flow is known, and where it is not to be read or not to lead to.
    """

    flow_px: Float32
    error_px: NDArray[np.float16]
    flags: NDArray[np.uint8]


def segments(window: Window, slow: str, fast: str) -> Iterator[Segment]:
    """Yield the shortest common intervals that begin with a field of the slower rate that the window owns."""
    slow_clock, fast_clock = window.facts.clocks[slow], window.facts.clocks[fast]
    for row in window.owned(slow):
        segment = _common(slow, slow_clock, row, fast, fast_clock)
        if segment is not None:
            yield segment


def _common(slow: str, slow_clock: Clock, row: int, fast: str, fast_clock: Clock) -> Segment | None:
    start_ns = int(slow_clock.times_ns[row])
    fast_row = row_at(fast_clock, start_ns)
    if fast_row is None or not slow_clock.advancing[row] or slow_clock.ends_ns is None or fast_clock.ends_ns is None:
        return None
    slow_rows, fast_rows = [row], [fast_row]
    while len(slow_rows) + len(fast_rows) <= _MOST_FIELDS:
        slow_end, fast_end = int(slow_clock.ends_ns[slow_rows[-1]]), int(fast_clock.ends_ns[fast_rows[-1]])
        if slow_end == fast_end:
            return Segment(Chain(slow, tuple(slow_rows)), Chain(fast, tuple(fast_rows)), start_ns, slow_end)
        clock, rows, end_ns = (
            (fast_clock, fast_rows, fast_end) if fast_end < slow_end else (slow_clock, slow_rows, slow_end)
        )
        following = row_at(clock, end_ns)
        if following is None or following == rows[-1]:
            return None
        rows.append(following)
    return None


def row_at(clock: Clock, start_ns: int) -> int | None:
    """Return the row of the field that begins at an instant; None where there is none."""
    rows = np.flatnonzero(clock.advancing)
    place = int(np.searchsorted(clock.times_ns[rows], start_ns))
    if place == len(rows) or clock.times_ns[rows[place]] != start_ns:
        return None
    return int(rows[place])


def exists(facts: Facts, chain: Chain) -> bool:
    """Whether the file holds every field of a chain."""
    return chain.rows[0] >= 0 and chain.rows[-1] < facts.sizes[f"path/{chain.stream}"]


def compose(window: Window, chain: Chain, columns: Float64, rows: Float64, change: Change | None = None) -> Composed:
    """Follow pixels (n,) of integer coordinates along a chain, each field changed as asked."""
    x, y, alone = columns, rows, len(chain.rows) == 1
    bound_px = np.zeros(len(x))
    clear, stays = np.ones(len(x), dtype=np.bool_), np.ones(len(x), dtype=np.bool_)
    for place, row in enumerate(chain.rows):
        field = _field(window, chain.stream, row, change)
        stays &= _inside(x, y, field.flags.shape)
        x, y = np.where(stays, x, 0.0), np.where(stays, y, 0.0)
        here = _nearest(x, y)
        flow_px, slope, known = _read(field, x, y)
        clear &= known & (alone | (field.flags[here] & _BREAK == 0))
        if place > 0:
            bound_px = bound_px * (1.0 + slope) + field.error_px[here].astype(np.float64)
        bound_px += _ROUNDING_PX * sum(field.flags.shape)
        x, y = x + flow_px[:, 0], y + flow_px[:, 1]
        lands = _inside(x, y, field.flags.shape)
        there = _nearest(np.where(lands, x, 0.0), np.where(lands, y, 0.0))
        clear &= alone | (field.flags[there] & _CROWDED == 0)
        stays &= lands
    return Composed(np.stack((x - columns, y - rows), axis=-1), bound_px, clear, stays)


def _field(window: Window, stream: str, row: int, change: Change | None) -> _Field:
    """Return a field ready to be read; kept for the window where it is as stored."""
    stored_px = window.flow_px(stream, row)
    if change is not None:
        return _prepared(np.ascontiguousarray(change(stored_px), dtype=np.float32))
    return window.once(("field to compose", stream, row), lambda: _prepared(stored_px))


def _prepared(flow_px: Float32) -> _Field:
    known = np.isfinite(flow_px[..., 0]) & np.isfinite(flow_px[..., 1])
    breaks, crowded = flow_conflicts(flow_px)
    with np.errstate(over="ignore", invalid="ignore"):  # beside unknown pixels nothing is read
        error_px = np.maximum(_reading_error(flow_px[..., 0]), _reading_error(flow_px[..., 1]))
        nearby_px = np.asarray(cv2.dilate(np.nan_to_num(error_px), np.ones((3, 3), np.uint8))).astype(np.float16)
    return _Field(flow_px, nearby_px, _KNOWN * known.astype(np.uint8) + _BREAK * breaks + _CROWDED * crowded)


def _reading_error(component_px: Float32) -> Float32:
    """Return how far reading one component between pixels may err, (H, W), by its bends and steps along both axes."""
    error_px = np.zeros_like(component_px)
    for flow_px, error in ((component_px, error_px), (component_px.T, error_px.T)):
        bends = flow_px[2:] - 2 * flow_px[1:-1] + flow_px[:-2]
        error[1:-1] += np.float32(_OF_SECOND_DIFFERENCE) * np.abs(bends)
        steps = np.float32(_OF_THIRD_DIFFERENCE) * np.abs(np.diff(bends, axis=0))
        error[1:-2] += steps
        error[2:-1] += steps
    return error_px


def _inside(x: Float64, y: Float64, shape: Sequence[int]) -> Mask:
    """Whether positions lie where four pixels surround them (the last column and row have none behind them)."""
    inside: Mask = (x >= 0) & (x < shape[1] - 1) & (y >= 0) & (y < shape[0] - 1)
    return inside


def _nearest(x: Float64, y: Float64) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return row and column of the nearest pixel."""
    return np.rint(y).astype(np.intp), np.rint(x).astype(np.intp)


def _read(field: _Field, x: Float64, y: Float64) -> tuple[Float64, Float64, Mask]:
    """Return the bilinear flow (n, 2), the sum of its absolute slopes (n,), and whether all it rests on is known."""
    column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    right, below = (x - column)[:, None], (y - row)[:, None]
    places = [(row + i, column + j) for i in (0, 1) for j in (0, 1)]
    # A pixel is read as it stands, whatever lies beside it.
    needed = [np.ones(len(x), dtype=np.bool_), x > column, y > row, (x > column) & (y > row)]
    known = np.all([~need | (field.flags[at] & _KNOWN > 0) for at, need in zip(places, needed, strict=True)], axis=0)
    corners = [np.nan_to_num(field.flow_px[at].astype(np.float64)) for at in places]
    above = corners[0] + right * (corners[1] - corners[0])
    under = corners[2] + right * (corners[3] - corners[2])
    slopes = np.abs(corners[1] - corners[0]) + np.abs(under - above)
    return above + below * (under - above), slopes.sum(axis=-1), known

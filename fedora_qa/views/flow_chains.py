"""Fields of one rate, one after the other, composed to the displacement over a longer interval."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.path_kernels import PathStates, interpolation_errors, spans_at_targets, step
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import frame_at

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
FieldTransform = Callable[[Float32], NDArray[np.floating]]
"""Change of a stored field (H, W, 2) before it is composed."""

_MOST_FIELDS: Final = 12
"""Most fields of a common interval: five of 50 Hz, or five of 25 Hz against two of 10 Hz, with a margin."""

_MANY: Final = 1 / 16
"""Number of paths per pixel above which evaluating all pixels of a field is faster than evaluating those about each
path."""

_ROUNDING_PX: Final = 18 * 2.0**-24
"""Single-precision rounding of a flow, for each pixel of width and height; ``geometry.rigid_flow`` derives it in full.

Four roundings of 2 f (1 + |m|) and of pixel and principal point, with f = 0.87 W at 60 degrees: below 18 W.
"""


@dataclass(frozen=True, slots=True)
class Chain:
    """Consecutive fields of one rate, by row, that lead from one instant to another.

    Attributes
    ----------
    stream
        ``flow/<rate>hz``.
    rows
        In the order of time; each field begins where the one before it ends.
    """

    stream: str
    rows: tuple[int, ...]

    def shifted(self, fields: int) -> "Chain":
        """Return the chain of the fields whose rows are larger by a number."""
        return Chain(self.stream, tuple(row + fields for row in self.rows))


@dataclass(frozen=True, slots=True)
class Segment:
    """An interval that two rates cover by whole fields.

    Attributes
    ----------
    slow, fast
        Fields of the lower and of the higher rate, from the start to the end.
    start_ns, end_ns
        Ns from the file's origin.
    """

    slow: Chain
    fast: Chain
    start_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class ComposedPaths:
    """Where pixels are taken by the fields of a chain.

    Attributes
    ----------
    displacement_px
        (n, 2) sum of the fields along each pixel's path, px (u right, v down); invalid where the path does not stay.
    bound_px
        (n,) bound of its error by interpolation and rounding, px.
    clear
        (n,) whether the flow is finite all along the path, and the path keeps away from breaks of the flow and from
        places where surfaces meet. A single field is read at its pixels, so its path need not keep away from either.
    stays
        (n,) whether the path ends, and lies, within the image.
    """

    displacement_px: Float64
    bound_px: Float64
    clear: Mask
    stays: Mask


def segments(window: Window, slow: str, fast: str) -> Iterator[Segment]:
    """Yield the shortest common intervals that begin with a field of the slower rate that the window owns.

    Parameters
    ----------
    window
        Owns the slower fields at which the segments begin.
    slow, fast
        Streams of flow, of the lower and of the higher rate.

    Yields
    ------
    Segment
        Segments of at most ``_MOST_FIELDS`` fields, in the order of time.
    """
    slow_clock, fast_clock = window.facts.clocks[slow], window.facts.clocks[fast]
    if slow_clock.ends_ns is None or fast_clock.ends_ns is None:
        return
    for row in window.owned(slow):
        start_ns = int(slow_clock.times_ns[row])
        fast_row = frame_at(fast_clock, start_ns)
        if fast_row is None or not slow_clock.advancing[row]:
            continue
        slow_rows, fast_rows = [row], [fast_row]
        # The rate that ends earlier takes its next field, until both end together.
        while len(slow_rows) + len(fast_rows) <= _MOST_FIELDS:
            slow_end, fast_end = int(slow_clock.ends_ns[slow_rows[-1]]), int(fast_clock.ends_ns[fast_rows[-1]])
            if slow_end == fast_end:
                yield Segment(Chain(slow, tuple(slow_rows)), Chain(fast, tuple(fast_rows)), start_ns, slow_end)
                break
            clock, rows, end_ns = (
                (fast_clock, fast_rows, fast_end) if fast_end < slow_end else (slow_clock, slow_rows, slow_end)
            )
            following = frame_at(clock, end_ns)
            if following is None or following == rows[-1]:
                break
            rows.append(following)


def exists(facts: Facts, chain: Chain) -> bool:
    """Whether the file holds every field of a chain.

    Parameters
    ----------
    facts
        With the number of fields of each stream.
    chain
        Its rows may lie outside the file.
    """
    return chain.rows[0] >= 0 and chain.rows[-1] < facts.sizes[f"path/{chain.stream}"]


def compose(
    window: Window, chain: Chain, columns: Float64, rows: Float64, transform: FieldTransform | None = None
) -> ComposedPaths:
    """Follow pixels along a chain of fields.

    Parameters
    ----------
    window
        The fields are read from it.
    chain
        Fields in the order of time.
    columns, rows
        (n,) integer coordinates of the pixels in the first field, px.
    transform
        Applied to each stored field (H, W, 2) before it is composed; none if None.

    Returns
    -------
    ComposedPaths
        Paths of the n pixels.
    """
    n = len(columns)
    paths = PathStates(columns.copy(), rows.copy(), np.zeros(n), np.ones(n, np.bool_), np.ones(n, np.bool_))
    last = len(chain.rows) - 1
    for number, row in enumerate(chain.rows):
        flow_px = window.flow_px(chain.stream, row)
        if transform is not None:
            flow_px = transform(flow_px)
        lines = _lines(flow_px)
        stored = None if transform is not None else (chain.stream, row)
        spans, errors_px = _NOT_TESTED, _NOT_COMPUTED
        # At the end of the last field nothing is read any more, so its targets need no test.
        if number < last:
            spans = _of_field(window, stored, spans_at_targets, lines)
        # A path reads few pixels: evaluating the whole field pays only with many paths to a pixel.
        if last > 0 and _MANY * lines.size < 2 * n:
            errors_px = _of_field(window, stored, interpolation_errors, lines)
        rounding_px = _ROUNDING_PX * (lines.shape[0] + lines.shape[1] // 2) + _storage_px(window, chain.stream, lines)
        step(lines, spans, errors_px, rounding_px, number == 0, last > 0, paths)
    displacement_px = np.stack((paths.x - columns, paths.y - rows), axis=-1)
    return ComposedPaths(displacement_px, paths.bound_px, paths.clear, paths.stays)


def _storage_px(window: Window, stream: str, lines: Float32) -> float:
    """Return the largest error of a flow vector of a field (H, 2 W) by the step in which flow is stored, px.

    Bilinear interpolation is a mean of stored values, and errs by no more than they do.
    """
    step = window.facts.steps.get(f"path/{stream}")
    if step is None or not step.is_coarse:
        return 0.0  # float32 is in ``_ROUNDING_PX``
    largest_px = float(np.nanmax(np.abs(lines), initial=0.0, where=np.isfinite(lines)))
    return float(np.hypot(*(step.component(axis).error_bounds(largest_px) for axis in range(2))))


def _of_field(
    window: Window, field: tuple[str, int] | None, compute: Callable[[Float32], Float32], lines: Float32
) -> Float32:
    """Return a result computed from a field. The window keeps the results of stored fields."""
    return compute(lines) if field is None else window.derived(_of_stored_field, compute, *field)


def _of_stored_field(window: Window, compute: Callable[[Float32], Float32], stream: str, row: int) -> Float32:
    return compute(_lines(window.flow_px(stream, row)))


def _lines(flow_px: Float32) -> Float32:
    """Return a field (H, W, 2) as rows of interleaved u and v, contiguous float32: the layout that kernels read."""
    return np.ascontiguousarray(flow_px, dtype=np.float32).reshape(len(flow_px), -1)


_NOT_TESTED: Final = np.empty((0, 0, 4), dtype=np.float32)
_NOT_COMPUTED: Final = np.empty((0, 0), dtype=np.float32)

"""Distributions of depth, luma, flow and events in each block of time, for comparisons of files.

Counts in fixed bins, 16 an octave, are integers. So windows merge exactly, blocks of time nest, and all files have the
same edges.
"""

from collections.abc import Sequence
from math import ceil, log2
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.causes import in_families
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.evidence.histograms import window_values
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.evidence.value_counts import add_counts, count_values, octave_counts, octave_edges
from fedora_qa.record.evidence import DISTRIBUTIONS, QUANTITIES, named
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span, Window

Int64 = NDArray[np.int64]
Blocks = dict[int, dict[str, Int64]]
"""Counts by quantity, by number of the block of time."""

LONGEST_INTERVAL_NS: Final = 100 * NS_PER_MS
"""Longest counted time between events of a pixel, ns: a window reads events up to this time before its start."""

_NEVER_NS: Final = np.iinfo(np.int64).min
_MOST_BLOCKS: Final = 128
_MOST_PIXELS: Final = 1 << 22
_RATE_BIN_NS: Final = 5 * NS_PER_MS
"""Length of a bin of the event rate, ns. It divides all lengths of windows down to 25 ms."""


class DistributionsCollector:
    """Count values by block: one window or, in long sequences, the windows of 2, 4, 8 ... cells of their grid.

    Parameters
    ----------
    spans
        All windows of the file: they alone decide how long a block is, so that it depends on nothing else.
    families
        Of which streams values are counted (``flow`` is every rate); None: all.
    """

    name = "distributions"

    def __init__(self, spans: Sequence[Span], families: frozenset[str] | None = None) -> None:
        self._families = families
        cell_ns = spans[0].stop_ns - spans[0].start_ns if spans else 1
        # A window times the power of two that leaves at most _MOST_BLOCKS blocks, so that blocks of files nest.
        self._block_ns = cell_ns << max(0, ceil(log2(max(len(spans), 1) / _MOST_BLOCKS)))

    def start(self, facts: Facts) -> Blocks:
        """Return the state of no windows."""
        return {}

    def update(self, state: Blocks, window: Window) -> None:
        """Add the counts of a window.

        Parameters
        ----------
        state
            Changed in place.
        """
        counts = window_values(window, self._families)
        if in_families("events", self._families):
            counts = {**counts, **_event_counts(window)}
        add_counts(state.setdefault(window.span.start_ns // self._block_ns, {}), counts)

    def merge(self, state: Blocks, later: Blocks) -> Blocks:
        """Return the counts of the windows of both; neither state is changed."""
        both = {block: dict(counts) for block, counts in state.items()}
        for block, counts in later.items():
            add_counts(both.setdefault(block, {}), counts)
        return both

    def conclude(self, state: Blocks, facts: Facts) -> TitledArrays:
        """Return the counts of every quantity that has any, with their edges.

        Returns
        -------
        TitledArrays
            Counts (blocks, bins) and edges (bins + 1,) by quantity, and the start and stop of each block.
        """
        blocks = sorted(state)
        starts_ns = np.array(blocks, np.int64) * self._block_ns
        entries: dict[str, tuple[NDArray[Any], str]] = {}
        for quantity in dict.fromkeys(name for counts in state.values() for name in counts):
            of_blocks = [state[block].get(quantity) for block in blocks]
            no_counts = np.zeros_like(next(counts for counts in of_blocks if counts is not None))
            by_block = octave_counts(np.stack([no_counts if counts is None else counts for counts in of_blocks]))
            # Only the bins from the first to the last with a count are kept.
            filled = np.flatnonzero(by_block.any(axis=0))
            if len(filled):
                first, last = int(filled[0]), int(filled[-1]) + 1
                name = quantity.replace("flow/", "flow_")
                title = QUANTITIES.get(name, f"Pixels by length of {quantity}, px over its interval")
                counts_name, edges_name = named(DISTRIBUTIONS, name, "counts"), named(DISTRIBUTIONS, name, "edges")
                entries[counts_name] = by_block[:, first:last], f"{title}: counts by block and bin"
                entries[edges_name] = octave_edges()[first : last + 1], "Edges of the bins"
        if entries:
            blocks_ns = np.stack([starts_ns, starts_ns + self._block_ns], axis=1)
            entries[named(DISTRIBUTIONS, "blocks_ns")] = blocks_ns, "Start and stop of each block, ns from the origin"
        return TitledArrays.titled(entries)


def pixel_intervals_ms(pixels: NDArray[np.integer[Any]], times_ns: Int64, start_ns: int) -> NDArray[np.float64]:
    """Return the times between successive events of each pixel that end from ``start_ns`` on, ms.

    Parameters
    ----------
    pixels
        (N,) number of the pixel of each event, in the order of time.
    times_ns
        (N,) timestamps, ns.
    start_ns
        Only intervals that end at this time or later count, ns.

    Returns
    -------
    ndarray of float64
        (M,) ms, at most ``LONGEST_INTERVAL_NS``.
    """
    count = int(pixels.max(initial=-1)) + 1
    if count <= _MOST_PIXELS and int(pixels.min(initial=0)) >= 0:
        numbers = pixels.astype(np.int32, copy=False)
    else:  # a table by these numbers would be too large: pixels with events are renumbered
        distinct, inverse = np.unique(pixels, return_inverse=True)
        count, numbers = len(distinct), inverse.astype(np.int32)
    times_ns = times_ns.view()
    times_ns.flags.writeable = False  # as decoded timestamps are, so that the loop is compiled once
    return _intervals_ns(numbers, times_ns, count, start_ns, LONGEST_INTERVAL_NS) / NS_PER_MS


def _event_counts(window: Window) -> dict[str, Int64]:
    """Count event rates of the whole sensor in 5 ms, and times between events of a pixel; nothing where unreadable."""
    scan = window.facts.events
    if "events" not in window.facts.streams or scan is None:
        return {}
    # A search by time needs timestamps in order. Without, only the rows of the window are read.
    before_ns = LONGEST_INTERVAL_NS if scan.decreases == 0 else 0
    try:
        events = window.events(before_ns=before_ns)
    except UnreadableRowsError:
        return {}
    span, times_ns = window.span, events.times_ns.astype(np.int64, copy=False)
    columns, rows = (axis - axis.min() if len(axis) else axis for axis in (events.x, events.y))
    width, height = (int(axis.max(initial=0)) + 1 for axis in (columns, rows))
    numbers = np.int32 if width * height <= _MOST_PIXELS else np.int64
    pixels = np.multiply(rows, width, dtype=numbers) + columns
    # Events per ms in each 5 ms of the window that lies wholly within the stream of events.
    edges_ns = np.arange(span.start_ns, span.stop_ns + 1, _RATE_BIN_NS)
    before = np.searchsorted(times_ns, edges_ns)
    # As in np.histogram the last bin includes its right edge.
    before[-1:] = np.searchsorted(times_ns, edges_ns[-1:], side="right")
    counts = np.diff(before)
    # A bin that the stream covers in part has too low a rate.
    within = (edges_ns[:-1] >= scan.first_ns) & (edges_ns[1:] <= scan.last_ns)
    rates_per_ms = np.asarray(counts[within] * (NS_PER_MS / _RATE_BIN_NS))
    return {
        "event_rate_per_ms": count_values(rates_per_ms),
        "pixel_interval_ms": count_values(pixel_intervals_ms(pixels, times_ns, span.start_ns)),
    }


@njit(cache=True)
def _intervals_ns(pixels: NDArray[np.int32], times_ns: Int64, count: int, start_ns: int, longest_ns: int) -> Int64:
    """Return the times (m,) between successive events of a pixel, that end from ``start_ns`` on.

    Parameters
    ----------
    pixels
        (N,) numbers from 0 to ``count`` of events in the order of time.
    longest_ns
        Longer times are left out.
    """
    latest_ns = np.full(count, _NEVER_NS)
    first = np.searchsorted(times_ns, start_ns)
    for i in range(first):
        latest_ns[pixels[i]] = times_ns[i]
    intervals_ns, ended = np.empty(len(pixels) - first, np.int64), 0
    for i in range(first, len(pixels)):
        pixel, time_ns = pixels[i], times_ns[i]
        # _NEVER_NS is the least int64: it is compared and never subtracted from, which would overflow.
        if latest_ns[pixel] >= time_ns - longest_ns:
            intervals_ns[ended] = time_ns - latest_ns[pixel]
            ended += 1
        latest_ns[pixel] = time_ns
    return intervals_ns[:ended]

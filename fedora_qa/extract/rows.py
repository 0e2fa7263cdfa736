"""Which rows of each stream a piece holds."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.extract.place import Piece, shared_time_ns
from fedora_qa.layout.canonical import FRAMES_OF_MAP, MS_TO_EVENT, spec_of, timestamps_of
from fedora_qa.sequence.scan import Runs, Scan
from fedora_qa.sequence.sequence import SequenceRows

MILLISECONDS: Final = spec_of(MS_TO_EVENT).stream
"""The map from milliseconds to events. It has no timestamps, and its entries are no rows of a stream."""

_ANOTHER_UNIT: Final = 100
"""Ratio of durations from which two streams are of different units.

Units differ by 1000; a stream that ends early, or a clock reset, rarely changes a duration by 100.
"""


@dataclass(frozen=True, slots=True)
class CutRows:
    """Rows of a stream of ``of`` rows. Where they reach its end, its longer datasets are copied to their own ends."""

    start: int
    stop: int
    of: int

    @property
    def to_the_end(self) -> bool:
        """Whether they reach the stream's end."""
        return self.stop >= self.of


def rows_kept(piece: Piece, sequence: SequenceRows, scanned: Scan, counts: Mapping[str, int]) -> dict[str, CutRows]:
    """Return the rows of every stream that lie in a piece.

    The time of a row is the latest timestamp up to it, as in windows, so that the rows of a piece are contiguous
    whatever the timestamps. Of flow, whole intervals are taken. A stream without usable timestamps, or with those of
    another time or unit, contributes the share of its rows that the piece is of the shared time.

    Parameters
    ----------
    counts
        Rows of each stream.
    """
    kept: dict[str, CutRows] = {}
    events = scanned.facts.events
    first_ns, last_ns = shared_time_ns(scanned)
    length_ns = max(last_ns - first_ns, 1)
    for stream, count in counts.items():
        if stream in {*FRAMES_OF_MAP, MILLISECONDS}:
            continue
        clock, runs = scanned.facts.clocks.get(stream), scanned.runs.get(stream)
        if clock is not None and clock.usable and _is_of(first_ns, last_ns, clock.times_ns[0], clock.times_ns.max()):
            # The envelope: binary search needs ascending values, and faulty timestamps do not ascend.
            starts = np.maximum.accumulate(clock.times_ns)
            stops = starts if clock.ends_ns is None else np.maximum.accumulate(clock.ends_ns)
            start = int(np.searchsorted(starts, piece.start_ns, "left"))
            # A flow interval is kept if it starts and ends within the piece; for others both times are the same.
            stop = max(start, int(np.searchsorted(stops, piece.stop_ns, "right")))
        elif stream == "events" and runs and events and _is_of(first_ns, last_ns, events.first_ns, events.last_ns):
            start = _event_row(runs, piece.start_ns, sequence, scanned)
            # A piece includes its stop: the first row at least 1 ns later ends the half-open range.
            stop = _event_row(runs, piece.stop_ns + 1, sequence, scanned)
        else:
            # Rows of unknown time are taken as evenly spread over the shared time, outwards to whole rows.
            start = int(count * (piece.start_ns - first_ns) / length_ns)
            stop = int(np.ceil(count * (piece.stop_ns - first_ns) / length_ns))
        if piece.rows is not None and FRAMES_OF_MAP.get(piece.rows[0], piece.rows[0]) == stream:
            _, first_row, stop_row = piece.rows
            # Rows that the finding names are kept even if their timestamps lie elsewhere: these may be its subject.
            start, stop = (min(start, first_row), max(stop, stop_row)) if start < stop else (first_row, stop_row)
        start = min(max(start, 0), count)
        kept[stream] = CutRows(start, min(max(stop, start), count), count)
    for stream, frames in FRAMES_OF_MAP.items():
        if stream in counts:
            # An index map has one entry for each frame, so that it keeps exactly the frames' rows.
            kept[stream] = kept.get(frames, CutRows(0, counts[stream], counts[stream]))
    if MILLISECONDS in counts:
        milliseconds, count = scanned.facts.millisecond_map, counts[MILLISECONDS]
        stop = count
        if milliseconds is not None and "events" in kept and not kept["events"].to_the_end:
            # Milliseconds count from 0 on the clock of the events, which a cut does not change: the first entry stays,
            # and the last is the first one that no event of the piece follows.
            stop = int(np.searchsorted(milliseconds.index_map.expected_left, kept["events"].stop)) + 1
        kept[MILLISECONDS] = CutRows(0, min(stop, count), count)
    return kept


def _is_of(first_ns: int, last_ns: int, own_first_ns: int, own_last_ns: int) -> bool:
    """Whether a stream's time is that of the others: both overlap, and their durations are of one unit."""
    length, own = max(last_ns - first_ns, 1), max(own_last_ns - own_first_ns, 1)
    meets = own_first_ns <= last_ns and own_last_ns >= first_ns
    return meets and 1 / _ANOTHER_UNIT < own / length < _ANOTHER_UNIT


def _event_row(runs: Runs, time_ns: int, sequence: SequenceRows, scanned: Scan) -> int:
    """Return the first row that lies at a time or later; the start of its window where timestamps cannot be decoded."""
    cell_start_ns = time_ns // scanned.cell_ns * scanned.cell_ns
    first = int(np.searchsorted(runs.cells, time_ns // scanned.cell_ns, "left"))
    bounds = np.append(runs.starts, runs.count)
    start = int(bounds[first])
    # The cell of the time holds no events: the answer is the first row of the next cell, without reading.
    if first == len(runs.cells) or int(runs.cells[first]) * scanned.cell_ns > cell_start_ns:
        return start
    try:
        times_ns = sequence.rows(timestamps_of("events"), start, int(bounds[first + 1]))
    except UnreadableRowsError:
        return start
    envelope = np.maximum.accumulate(times_ns)
    return start + int(np.searchsorted(envelope, time_ns, "left"))

"""Facts of a file that are known before any window is decoded: streams, timestamps, declarations."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_S, NS_PER_US
from fedora_qa.features import Feature
from fedora_qa.layout.binding import FARTHEST_TIMESTAMP_NS, INVALID_TIMESTAMP_NS
from fedora_qa.layout.canonical import in_file_order
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.stored_step import StoredStep

Int64 = NDArray[np.int64]

_SATURATED_NS: Final = FARTHEST_TIMESTAMP_NS - 2 * NS_PER_S
"""Timestamps saturate at whole units, of a second at most, and the origin lies within a unit."""


_FAR_SPANS: Final = 100
"""Times the others of its stream last, beyond which a single timestamp has no place in time. The value is not derived:
pauses of a recording, and wrong units of a part, leave more than two successive samples at either side."""

_MOST_FAR: Final = 2
"""Successive timestamps that may be far: three are those of a clock."""

_FEWEST_TO_COMPARE: Final = 5
"""Timestamps of which the middle half says how long the others last, with one of them far."""

_COMPARED: Final = 1001
"""Timestamps, evenly spaced among the rows, of which the middle half is taken."""


@dataclass(frozen=True, slots=True)
class Clock:
    """The timestamps of one stream (not of events: they are scanned, not kept).

    Attributes
    ----------
    times_ns
        (N,) timestamps, ns from the file's origin; for flow the start of each interval.
    ends_ns
        (N,) ends of the intervals of flow, ns; None for other streams.
    advancing
        (N,) True where a timestamp has a place in time and is later than all such before it. Only these samples may be
        used for interpolation.
    """

    times_ns: Int64
    ends_ns: Int64 | None
    advancing: NDArray[np.bool_]

    @property
    def envelope_ns(self) -> Int64:
        """(N,) latest timestamp up to each sample, ns; of samples before any with a place in time, the first such."""
        placed = has_place(self.times_ns)
        latest_ns: Int64 = np.maximum.accumulate(np.where(placed, self.times_ns, INVALID_TIMESTAMP_NS))
        first_ns: np.int64 = self.times_ns[int(np.argmax(placed))]
        return np.asarray(np.maximum(latest_ns, first_ns), dtype=np.int64)

    @property
    def usable(self) -> bool:
        """Whether most timestamps advance, so that the stream can be placed in time."""
        count = len(self.times_ns)
        # Where half of the timestamps or more step back, their running maximum places most samples wrongly.
        return count > 0 and 2 * int(np.count_nonzero(self.advancing)) > count


def has_place(times_ns: Int64) -> NDArray[np.bool_]:
    """Return where timestamps (N,), ns from the file's origin, have a place in time: neither NaN nor saturated."""
    return np.abs(times_ns) < _SATURATED_NS


def far_rows(times_ns: Int64) -> NDArray[np.intp]:
    """Return the rows (k,) of one or two successive timestamps that lie far from all others of a stream.

    Parameters
    ----------
    times_ns
        (N,) timestamps of a stream or of a block of events, ns from the file's origin.
    """
    if len(times_ns) < _FEWEST_TO_COMPARE:
        return np.empty(0, np.intp)
    rows = np.linspace(0, len(times_ns) - 1, min(len(times_ns), _COMPARED)).astype(np.intp)
    first_ns, middle_ns, last_ns = np.percentile(times_ns[rows], (25, 50, 75))
    # The middle half lasts half as long as all of a stream whose samples are evenly spaced.
    far_ns = 2 * _FAR_SPANS * (last_ns - first_ns)
    if not far_ns or max(times_ns.max() - middle_ns, middle_ns - times_ns.min()) <= far_ns:
        return np.empty(0, np.intp)
    far = np.flatnonzero(np.abs(times_ns - middle_ns) > far_ns)
    runs = np.split(far, np.flatnonzero(np.diff(far) > 1) + 1)
    short = [run for run in runs if len(run) <= _MOST_FAR]
    return np.concatenate(short) if short else far[:0]


def clock_of(times_ns: Int64, ends_ns: Int64 | None) -> Clock:
    """Return the clock of a stream from its timestamps; one that lies far from all others has no place in time.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns from the file's origin; for flow the start of each interval.
    ends_ns
        (N,) ends of the intervals of flow, ns; None for other streams.

    Returns
    -------
    Clock
        With the samples that advance.
    """
    times_ns = times_ns.copy()
    times_ns[far_rows(times_ns)] = INVALID_TIMESTAMP_NS
    if ends_ns is not None:
        ends_ns = ends_ns.copy()
        ends_ns[far_rows(ends_ns)] = INVALID_TIMESTAMP_NS
    advancing = has_place(times_ns)
    # Against the running maximum, not the neighbour: after a jump forwards and back, timestamps are behind until they
    # exceed the jump.
    latest_ns = np.maximum.accumulate(np.where(advancing, times_ns, INVALID_TIMESTAMP_NS))
    advancing[1:] &= times_ns[1:] > latest_ns[:-1]
    return Clock(times_ns, ends_ns, advancing)


@dataclass(frozen=True, slots=True)
class EventStep:
    """Two successive event timestamps.

    Attributes
    ----------
    row
        Row of the second event.
    before_ns, after_ns
        Timestamps of both, ns from the file's origin.
    """

    row: int
    before_ns: int
    after_ns: int

    @property
    def length_ns(self) -> int:
        """Length of the step, ns; negative for a step back."""
        return self.after_ns - self.before_ns


_FAR: Final = 0.5
"""Share of the duration of the other streams by which stray events lie outside of them, beyond a silence as long. The
value is not derived: a sensor that runs before the others, or behind them, gives events up to then."""


@dataclass(frozen=True, slots=True)
class StrayEvents(Feature):
    """Events far from the other streams and from all other events.

    Attributes
    ----------
    count
        Their number.
    step
        Between them and the others.
    distance_ns
        From the nearest end of the other streams, ns: negative before their begin.
    """

    count: int
    step: EventStep
    distance_ns: float


@dataclass(frozen=True, slots=True)
class EventScan:
    """One pass over the event timestamps.

    Attributes
    ----------
    count
        Number of events.
    first_ns, last_ns
        Earliest and latest timestamp, ns from the file's origin (0 without events).
    decreases
        Number of timestamps that are earlier than the one before them.
    first_decrease
        Row of the first such event, -1 without one.
    grid_ns
        Greatest common divisor of all steps between timestamps, ns (0 where all are equal).
    unreadable
        Rows (start, stop) that could not be decoded.
    largest_decrease_ns
        Length of the largest step back, ns, 0 without one.
    behind
        Number of events that are earlier than any event before them.
    longest_steps
        Up to eight of either direction, in the order of the file.
    unplaced, first_unplaced
        Number of events whose timestamp has no place in time, or lies far from all others, which nothing above counts
        but ``count``, and the row of the first, -1 without one.
    instants
        Number of steps forwards, and one: that of different timestamps where none decreases.
    shortest_step_ns
        The shortest of these steps, 0 without one.
    """

    count: int
    first_ns: int
    last_ns: int
    decreases: int
    first_decrease: int
    grid_ns: int
    unreadable: tuple[tuple[int, int], ...] = ()
    largest_decrease_ns: int = 0
    behind: int = 0
    longest_steps: tuple[EventStep, ...] = ()
    unplaced: int = 0
    first_unplaced: int = -1
    instants: int = 0
    shortest_step_ns: int = 0

    def placed(self, times_ns: Int64) -> NDArray[np.bool_]:
        """Return where timestamps (n,) of events, ns from the file's origin, have a place in time, near the others."""
        return has_place(times_ns) & (times_ns >= self.first_ns) & (times_ns <= self.last_ns)

    def strays(self, begin_ns: float, finish_ns: float) -> tuple[StrayEvents, ...]:
        """Return the events that lie far from the other streams, and from all other events.

        Sensors may run before and behind the others, and a still scene gives no events. A silence for half the duration
        of the other streams, whose far end lies outside of them by as much, is none of a sensor that runs.

        Parameters
        ----------
        begin_ns, finish_ns
            Span of the other streams, ns from the file's origin.
        """
        far_ns = _FAR * (finish_ns - begin_ns)
        strays = []
        for step in self.longest_steps:
            before_ns, behind_ns = begin_ns - step.before_ns, step.after_ns - finish_ns
            is_before = before_ns > behind_ns
            count = step.row if is_before else self.count - step.row
            # Most events elsewhere are those of another clock.
            if step.length_ns >= far_ns and max(before_ns, behind_ns) >= far_ns and 2 * count < self.count:
                strays.append(StrayEvents(count, step, -before_ns if is_before else behind_ns))
        return tuple(strays)

    def extent_ns(self, begin_ns: float, finish_ns: float) -> tuple[int, int]:
        """Return the earliest and the latest timestamp of events that are no strays; parameters as of ``strays``."""
        first_ns, last_ns = self.first_ns, self.last_ns
        for stray in self.strays(begin_ns, finish_ns):
            if stray.distance_ns < 0:
                first_ns = max(first_ns, stray.step.after_ns)
            else:
                last_ns = min(last_ns, stray.step.before_ns)
        return first_ns, last_ns


NEVER_NS: Final = 1 << 62
"""Farther than any event from any frame."""


@dataclass(frozen=True, slots=True)
class IndexMap:
    """A frame-to-event map as stored, with its correct entries.

    Attributes
    ----------
    stored
        (n,) entries as stored. Where the dialect states that the map is made by another definition, they are moved by
        the difference between both definitions, so that an entry which is right by its own equals ``expected_left``.
    expected_left
        (n,) number of events earlier than each frame, by the stored timestamps.
    expected_right
        (n,) number of events not later than each frame.
    by_definition
        (n,) correct entries by the definition that the dialect states; None where it states none.
    pointed_ns
        (n, 2) timestamps of the event before the one that each entry as stored points to, and of that one, ns from the
        file's origin; ``NEVER_NS`` behind and ahead of all where there is none. None where it was not read.
    """

    stored: Int64
    expected_left: Int64
    expected_right: Int64
    by_definition: Int64 | None = None
    pointed_ns: Int64 | None = None

    @property
    def correct(self) -> Int64:
        """(n,) entries that a correct map has in the file."""
        return self.expected_left if self.by_definition is None else self.by_definition


@dataclass(frozen=True, slots=True)
class MillisecondMap:
    """A map from milliseconds to events.

    Attributes
    ----------
    index_map
        As stored, with its correct entries.
    zero_ns
        Instant of the first entry, ns from the file's origin.
    """

    index_map: IndexMap
    zero_ns: int

    @property
    def instants_ns(self) -> Int64:
        """(n,) instants of the entries, ns from the file's origin."""
        return milliseconds_ns(len(self.index_map.stored), self.zero_ns)


def milliseconds_ns(count: int, zero_ns: int) -> Int64:
    """Return the instants (count,) of successive milliseconds, ns, from that of the first."""
    return zero_ns + NS_PER_MS * np.arange(count, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts of a file that need no window.

    Attributes
    ----------
    layout
        Paths of the datasets, and defects of the layout.
    declared
        Declarations of the metadata.
    streams
        Streams that exist and can be read.
    absent
        Reason why each other stream is absent, by stream.
    origin_us
        The file's origin on its own clock, us.
    clocks
        By stream, without events.
    events
        Scan of the event timestamps; None without events.
    index_maps
        ``rgb_to_event`` and ``depth_to_event``, where they exist.
    millisecond_map
        From milliseconds to events; None where there is none.
    sizes
        Number of rows of each dataset by key.
    steps
        Steps in which the values of datasets are stored, by key, in the canonical unit of each.
    """

    layout: Layout
    declared: Declared
    streams: frozenset[str]
    absent: Mapping[str, str]
    origin_us: float
    clocks: Mapping[str, Clock]
    events: EventScan | None
    index_maps: Mapping[str, IndexMap]
    sizes: Mapping[str, int] = field(default_factory=dict)
    steps: Mapping[str, StoredStep] = field(default_factory=dict)
    millisecond_map: MillisecondMap | None = None

    def to_file_us(self, time_ns: float) -> float:
        """Return a time from the origin, ns, as us on the file's own clock."""
        return self.origin_us + time_ns / NS_PER_US

    def from_file_us(self, time_us: float) -> int:
        """Return a time on the file's own clock, us, as whole ns from the origin."""
        return round((time_us - self.origin_us) * NS_PER_US)

    @property
    def maps_to_events(self) -> Mapping[str, IndexMap]:
        """The index maps of frames and, as ``ms_to_event``, that of milliseconds."""
        milliseconds = self.millisecond_map
        return {**self.index_maps, **({"ms_to_event": milliseconds.index_map} if milliseconds else {})}

    @property
    def flow_streams(self) -> tuple[str, ...]:
        """The flow streams of the file, the lowest rate first."""
        return tuple(stream for stream in in_file_order(self.streams) if stream.startswith("flow/"))

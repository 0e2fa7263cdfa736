"""What is known of a file before any window is decoded: streams, timestamps, declarations."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Declared

Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Clock:
    """The timestamps of one stream (not of events: they are scanned, not kept).

    Attributes
    ----------
    times_ns
        (N,) instants from the file's origin; for flow the start of each interval.
    ends_ns
        (N,) ends of the intervals of flow, otherwise None.
    advancing
        (N,) True where a timestamp is later than every one before it. Only these samples may be interpolated between.
    """

    times_ns: Int64
    ends_ns: Int64 | None
    advancing: NDArray[np.bool_]

    @property
    def usable(self) -> bool:
        """Whether most timestamps advance, so that the stream can be placed in time."""
        count = len(self.times_ns)
        # Where half of the timestamps or more step back, their running maximum places most samples wrongly.
        return count > 0 and 2 * int(np.count_nonzero(self.advancing)) > count


@dataclass(frozen=True, slots=True)
class EventStep:
    """Two successive event timestamps, from the file's origin; ``row`` is that of the second."""

    row: int
    before_ns: int
    after_ns: int

    @property
    def length_ns(self) -> int:
        """By how much time advances; negative where it steps back."""
        return self.after_ns - self.before_ns


@dataclass(frozen=True, slots=True)
class EventScan:
    """One pass over the event timestamps.

    Attributes
    ----------
    count
        Number of events.
    first_ns, last_ns
        Earliest and latest timestamp from the file's origin (0 where there are none).
    decreases
        How often a timestamp is earlier than the one before it.
    first_decrease
        Index of the first such event, -1 where there is none.
    largest_decrease_ns
        By how much the earliest of them lies before its predecessor, 0 where there is none.
    behind
        Events that are earlier than one before them, whether or not it is the one just before.
    longest_steps
        Of either direction up to eight, in the order of the file.
    grid_ns
        Greatest common divisor of all steps between timestamps (0 where all are equal).
    unreadable
        Rows (start, stop) that could not be decoded.
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


@dataclass(frozen=True, slots=True)
class IndexMap:
    """A frame-to-event map as stored, and what it should be.

    ``expected_left[i]`` is the number of events earlier than frame i, ``expected_right[i]`` the number of events not
    later; both on the raw timestamps.
    """

    stored: Int64
    expected_left: Int64
    expected_right: Int64


@dataclass(frozen=True, slots=True)
class Facts:
    """Everything that is cheap to know.

    Attributes
    ----------
    layout
        Where each dataset lies, and what is malformed.
    streams
        The streams that are there and whole enough to be read.
    absent
        Why each other stream is not there, by stream.
    origin_us
        The file's origin on its own clock.
    clocks
        By stream (not events).
    sizes
        Rows of each dataset by key.
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

    def to_file_us(self, time_ns: float) -> float:
        """Turn internal time into microseconds on the file's own clock."""
        return self.origin_us + time_ns / NS_PER_US

    @property
    def flow_streams(self) -> tuple[str, ...]:
        """The flow streams that are there, slowest first."""
        names = [name for name in self.streams if name.startswith("flow/")]
        # By number: as text, 10hz would come before 5hz.
        return tuple(sorted(names, key=lambda name: int(name.removeprefix("flow/").removesuffix("hz"))))

"""How many samples each stream has over time."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span

Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Timeline:
    """Equal bins from ``start_ns`` to ``stop_ns``, both included."""

    start_ns: int
    stop_ns: int
    bins: int

    @property
    def edges_ns(self) -> NDArray[np.float64]:
        """Edges of the bins (bins + 1,)."""
        return np.linspace(self.start_ns, self.stop_ns, self.bins + 1)

    def count(self, times_ns: Int64) -> Int64:
        """Count timestamps in each bin, those outside in none; in whole numbers, so that none moves by rounding."""
        within = times_ns[(times_ns >= self.start_ns) & (times_ns <= self.stop_ns)]
        length_ns = self.stop_ns - self.start_ns
        coarser = max(0, (length_ns * self.bins).bit_length() - 63)  # of decades the product would leave int64
        numbers = ((within - self.start_ns) >> coarser) * self.bins // max(length_ns >> coarser, 1)
        return np.bincount(np.minimum(numbers, self.bins - 1), minlength=self.bins).astype(np.int64)

    def spread(self, count: int, span: Span) -> Int64:
        """Spread samples of unknown times evenly over a window."""
        upto = np.interp(self.edges_ns, [span.start_ns, span.stop_ns], [0, count])
        upto[-1] = count if span.stop_ns > self.stop_ns >= span.start_ns else upto[-1]
        return cast(Int64, np.diff(np.rint(upto)).astype(np.int64))


def timeline_of(facts: Facts, spans: Sequence[Span], bins: int) -> Timeline:
    """Lay bins over the time in which at least half of the streams have samples.

    A timestamp in the far future, or a stream on another clock, does not put all other samples into one bin. Flow does
    not count, because it ends an interval before the rest.
    """
    present = [
        sum(start < stop and not stream.startswith("flow/") for stream, (start, stop) in span.owned.items())
        for span in spans
    ]
    most = max(present, default=0)
    usual = [span for span, streams in zip(spans, present, strict=True) if 2 * streams >= most]
    if not usual:
        return Timeline(0, 1, 1)
    low, high = usual[0].start_ns, usual[-1].stop_ns
    ends = [bound for clock in facts.clocks.values() for bound in _bounds_within(clock.times_ns, low, high)]
    if facts.events is not None and facts.events.count:
        ends += [end for end in (facts.events.first_ns, facts.events.last_ns) if low <= end < high]
    start_ns, stop_ns = (min(ends), max(ends)) if ends else (low, high)
    return Timeline(start_ns, max(stop_ns, start_ns + 1), bins if stop_ns > start_ns else 1)


def stream_counts(
    timeline: Timeline, facts: Facts, spans: Iterable[Span], event_counts: Mapping[int, Int64]
) -> dict[str, Int64]:
    """Return the samples of each stream in each bin.

    Parameters
    ----------
    spans
        All windows of the file.
    event_counts
        Events in each bin, by the number of each window whose timestamps were read. Of other windows only the number
        of events is known: they are spread evenly.
    """
    counts = {stream: timeline.count(clock.times_ns) for stream, clock in sorted(facts.clocks.items())}
    if "events" in facts.streams:
        by_window = []
        for span in spans:
            start, stop = span.owned.get("events", (0, 0))
            counted = event_counts.get(span.index)
            by_window.append(timeline.spread(stop - start, span) if counted is None else counted)
        counts["events"] = sum(by_window, np.zeros(timeline.bins, np.int64))
    return counts


def _bounds_within(times_ns: Int64, low: int, high: int) -> tuple[int, ...]:
    within = times_ns[(times_ns >= low) & (times_ns < high)]
    return (int(within.min()), int(within.max())) if len(within) else ()

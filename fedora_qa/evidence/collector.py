"""Keep evidence window by window, beside the checks, in the same pass: snapshots, timeline, histograms."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import in_families, stream_family
from fedora_qa.conventions import NS_PER_US
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.evidence.clouds import (
    EventCloud,
    PointCloud,
    cloud_times_ns,
    keep_event_clouds,
    keep_point_cloud,
    take_event_cloud,
    take_point_cloud,
)
from fedora_qa.evidence.histograms import (
    keep_histograms,
    padded_sum,
    seconds_of,
    window_values,
    with_events,
)
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.snapshot import Snapshot, fitting_width_px, keep_snapshots, snapshot_times_ns, take_snapshot
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.evidence.value_counts import add_counts
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.record.evidence import TIMELINE, UNMEASURED, named
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span, Window

Int64 = NDArray[np.int64]

_READ_WHOLE: Final = frozenset({"imu", "pose"})
"""Streams that are a thousandth of a file, and are read in full at every effort."""


@dataclass(frozen=True, slots=True)
class Timeline:
    """Equal bins of time.

    Attributes
    ----------
    start_ns, stop_ns
        Ends of the first and of the last bin, both included, ns from the file's origin.
    bins
        Number of bins.
    """

    start_ns: int
    stop_ns: int
    bins: int

    @property
    def edges_ns(self) -> NDArray[np.float64]:
        """Edges of the bins (bins + 1,)."""
        return np.linspace(self.start_ns, self.stop_ns, self.bins + 1)

    def count(self, times_ns: Int64) -> Int64:
        """Count timestamps (n,) in each bin (bins,), in integers without rounding; timestamps outside do not count."""
        within = times_ns[(times_ns >= self.start_ns) & (times_ns <= self.stop_ns)]
        length_ns = self.stop_ns - self.start_ns
        coarser = max(0, (length_ns * self.bins).bit_length() - 63)  # of decades the product would leave int64
        numbers = ((within - self.start_ns) >> coarser) * self.bins // max(length_ns >> coarser, 1)
        return np.bincount(np.minimum(numbers, self.bins - 1), minlength=self.bins).astype(np.int64)

    def spread(self, count: int, span: Span) -> Int64:
        """Spread samples of unknown times evenly over a window: (bins,) samples in each bin.

        Parameters
        ----------
        count
            Number of samples.
        """
        upto = np.interp(self.edges_ns, [span.start_ns, span.stop_ns], [0, count])
        upto[-1] = count if span.stop_ns > self.stop_ns >= span.start_ns else upto[-1]
        return cast(Int64, np.diff(np.rint(upto)).astype(np.int64))


@dataclass(frozen=True, slots=True)
class EvidencePlan:
    """Plan of the evidence of a file.

    Attributes
    ----------
    snapshot_times_ns
        Times of snapshots, ns from the file's origin, by the number of their window.
    point_cloud_times_ns
        Those of the snapshots whose depth is carried into the world.
    width_px
        Largest width of pictures, px.
    timeline
        Bins of the timeline.
    """

    snapshot_times_ns: Mapping[int, tuple[int, ...]]
    point_cloud_times_ns: frozenset[int]
    width_px: int
    timeline: Timeline


@dataclass(slots=True)
class EvidenceState:
    """Evidence of some windows, in integers or in the order of time, so that states merge exactly.

    Attributes
    ----------
    plan
        The same for all windows.
    snapshots, event_clouds, point_clouds
        In the order of time.
    values
        Counts of sampled pixels by quantity.
    pixels
        (H, W) events of each pixel, of the windows in ``counted_ns``; None without events.
    counted_ns
        Start and stop of each window whose events were counted, ns from the file's origin.
    events
        Events in each bin of the timeline, by number of the window.
    decoded
        Numbers of the windows that were decoded.
    """

    plan: EvidencePlan
    snapshots: list[Snapshot] = field(default_factory=list)
    event_clouds: list[EventCloud] = field(default_factory=list)
    point_clouds: list[PointCloud] = field(default_factory=list)
    values: dict[str, Int64] = field(default_factory=dict)
    pixels: NDArray[np.uint32] | None = None
    counted_ns: list[tuple[int, int]] = field(default_factory=list)
    events: dict[int, Int64] = field(default_factory=dict)
    decoded: list[int] = field(default_factory=list)


class EvidenceCollector:
    """Snapshots, clouds, timeline and histograms of a file.

    Parameters
    ----------
    spans
        All of its windows.
    chosen
        Those that the pass decodes; the snapshots are spread over them.
    families
        Which streams are kept (``flow`` is every rate); None: all.
    """

    name = "evidence"

    def __init__(
        self,
        spans: Sequence[Span],
        chosen: Sequence[Span],
        options: EvidenceOptions,
        families: frozenset[str] | None = None,
    ) -> None:
        self._families = families
        self._spans = tuple(spans)
        self._chosen = tuple(chosen)
        self._options = options

    def start(self, facts: Facts) -> EvidenceState:
        """Return the state of no windows."""
        options = self._options
        times_ns = snapshot_times_ns(self._chosen, facts, options.snapshots)
        return EvidenceState(
            EvidencePlan(
                snapshot_times_ns=times_ns,
                point_cloud_times_ns=cloud_times_ns(times_ns, options.point_clouds),
                width_px=fitting_width_px(facts, options, options.snapshots),
                timeline=timeline_of(facts, self._spans, options.timeline_bins),
            )
        )

    def update(self, state: EvidenceState, window: Window) -> None:
        """Add the evidence of a window. Windows come in the order of time.

        Parameters
        ----------
        state
            Changed in place.
        window
            Decoded by the plan.
        """
        state.decoded.append(window.span.index)
        times_ns = state.plan.snapshot_times_ns.get(window.span.index, ())
        width_px, families = state.plan.width_px, self._families
        state.snapshots += [take_snapshot(window, time_ns, width_px, families=families) for time_ns in times_ns]
        add_counts(state.values, window_values(window, self._families))
        for time_ns in times_ns:
            if time_ns in state.plan.point_cloud_times_ns:
                most_points = self._options.cloud_points // self._options.point_clouds
                points = take_point_cloud(window, time_ns, most_points, families)
                state.point_clouds += [points] if points is not None else []
        if not in_families("events", self._families):
            return
        clouds = (take_event_cloud(window, time_ns, self._options.cloud_events) for time_ns in times_ns)
        state.event_clouds += [cloud for cloud in clouds if cloud is not None]
        if "events" in window.facts.streams and (rows := window.owned("events")):
            try:
                events_ns = window.rows(timestamps_of("events"), rows.start, rows.stop)
                state.pixels = with_events(state.pixels, window)
            except UnreadableRowsError:
                # Windows whose events were not read count no time, or the rates of pixels would come out too low.
                return
            state.events[window.span.index] = state.plan.timeline.count(events_ns)
            state.counted_ns.append((window.span.start_ns, window.span.stop_ns))

    def merge(self, state: EvidenceState, later: EvidenceState) -> EvidenceState:
        """Return the state of the windows of both; neither state is changed."""
        both = EvidenceState(
            state.plan,
            snapshots=state.snapshots + later.snapshots,
            event_clouds=state.event_clouds + later.event_clouds,
            point_clouds=state.point_clouds + later.point_clouds,
            values=dict(state.values),
            pixels=state.pixels,
            counted_ns=state.counted_ns + later.counted_ns,
            events={**state.events, **later.events},
            decoded=state.decoded + later.decoded,
        )
        add_counts(both.values, later.values)
        if later.pixels is not None:
            both.pixels = later.pixels if both.pixels is None else padded_sum(both.pixels, later.pixels)
        return both

    def conclude(self, state: EvidenceState, facts: Facts) -> TitledArrays:
        """Return all evidence as arrays with titles."""
        snapshots = keep_snapshots(state.snapshots, facts, state.plan.width_px)
        timeline = state.plan.timeline
        edges_us = facts.origin_us + timeline.edges_ns / NS_PER_US
        step_ms = float(edges_us[1] - edges_us[0]) / 1e3
        over_time = {
            named(TIMELINE, "edges_us"): (edges_us, "Edges of the bins, us on the file's clock"),
            **{
                named(TIMELINE, stream): (samples, f"Samples of {stream} in each {step_ms:.4g} ms")
                for stream, samples in stream_counts(timeline, facts, self._spans, state.events).items()
            },
        }
        # Events of a window that was decoded without them could not be read.
        of_events = {span.index for span in self._spans if range(*span.owned.get("events", (0, 0)))}
        unread = of_events - state.events.keys()
        for stream in sorted(facts.streams):
            if stream_family(stream) in _READ_WHOLE:
                continue
            measured = frozenset(state.decoded if in_families(stream, self._families) else ())
            segments_ns = unmeasured_ns(self._spans, measured - unread if stream == "events" else measured)
            if len(segments_ns):
                title = f"Segments of time in which no {stream} was measured, us on the file's clock"
                over_time[named(TIMELINE, UNMEASURED, stream)] = (facts.origin_us + segments_ns / NS_PER_US, title)
        histograms = keep_histograms(state.values, state.pixels, seconds_of(facts, state.counted_ns))
        clouds = keep_event_clouds(state.event_clouds, facts, self._options.event_clouds)
        points = keep_point_cloud(state.point_clouds, facts)
        return merged([snapshots, clouds, points, TitledArrays.titled(over_time), histograms])


def timeline_of(facts: Facts, spans: Sequence[Span], bins: int) -> Timeline:
    """Return bins over the time in which at least half of the streams have samples.

    So a single timestamp far in the future, or a stream on another clock, does not put all other samples into one bin.
    Flow does not count, because it ends one interval before the other streams.

    Parameters
    ----------
    spans
        All windows of the file, in the order of time.
    bins
        Number of bins.

    Returns
    -------
    Timeline
        One bin of 1 ns where no stream has samples.
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
    ends: list[int] = []
    for clock in facts.clocks.values():
        within = clock.times_ns[(clock.times_ns >= low) & (clock.times_ns < high)]
        if len(within):
            ends += [int(within.min()), int(within.max())]
    if facts.events is not None and facts.events.count:
        ends += [end for end in (facts.events.first_ns, facts.events.last_ns) if low <= end < high]
    start_ns, stop_ns = (min(ends), max(ends)) if ends else (low, high)
    return Timeline(start_ns, max(stop_ns, start_ns + 1), bins if stop_ns > start_ns else 1)


def unmeasured_ns(spans: Sequence[Span], measured: frozenset[int]) -> NDArray[np.float64]:
    """Return start and stop (k, 2) of each segment of windows that are not among the numbers of those measured."""
    segments: list[list[int]] = []
    for span in spans:
        if span.index in measured:
            continue
        if segments and segments[-1][1] == span.start_ns:
            segments[-1][1] = span.stop_ns
        else:
            segments.append([span.start_ns, span.stop_ns])
    return np.array(segments, dtype=np.float64).reshape(-1, 2)


def stream_counts(
    timeline: Timeline, facts: Facts, spans: Iterable[Span], event_counts: Mapping[int, Int64]
) -> dict[str, Int64]:
    """Return the number of samples of each stream in each bin: (bins,) by stream.

    Parameters
    ----------
    event_counts
        (bins,) events in each bin, by the number of each window whose timestamps were read. Only the number of events
        is known of other windows: they are spread evenly over the window.
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

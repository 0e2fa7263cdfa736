"""Keep evidence window by window, beside the checks, in the same pass."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import in_families
from fedora_qa.conventions import NS_PER_US
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.evidence.histograms import (
    keep_histograms,
    padded_sum,
    seconds_of,
    window_values,
    with_events,
)
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.snapshot import Snapshot, take_snapshot
from fedora_qa.evidence.snapshot_arrays import keep_snapshots
from fedora_qa.evidence.snapshot_times import fitting_width_px, snapshot_times_ns
from fedora_qa.evidence.timeline import Timeline, stream_counts, timeline_of
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.layout.canonical import TIMESTAMPS_OF
from fedora_qa.record.evidence import MOMENTS, TIMELINE, named
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span, Window

Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class EvidencePlan:
    """What is kept: times of snapshots by number of their window, the width of pictures, the bins of the timeline."""

    snapshot_times_ns: Mapping[int, tuple[int, ...]]
    width_px: int
    timeline: Timeline


@dataclass(slots=True)
class EvidenceState:
    """Evidence of some windows. All of it is whole numbers or in the order of time, so that it merges exactly.

    Attributes
    ----------
    plan
        The same for all windows.
    values
        Counts of sampled pixels by quantity.
    pixels
        Events of each pixel, of the windows in ``counted_ns`` (start, stop).
    events
        Events in each bin of the timeline, by number of the window.
    """

    plan: EvidencePlan
    snapshots: list[Snapshot] = field(default_factory=list)
    values: dict[str, Int64] = field(default_factory=dict)
    pixels: NDArray[np.uint32] | None = None
    counted_ns: list[tuple[int, int]] = field(default_factory=list)
    events: dict[int, Int64] = field(default_factory=dict)


class EvidenceCollector:
    """Snapshots, timeline and histograms of a file.

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
        return EvidenceState(
            EvidencePlan(
                snapshot_times_ns=snapshot_times_ns(self._chosen, facts, options.snapshots),
                width_px=fitting_width_px(facts, options, options.snapshots),
                timeline=timeline_of(facts, self._spans, options.timeline_bins),
            )
        )

    def update(self, state: EvidenceState, window: Window) -> None:
        """Add what a window shows. Windows come in order."""
        times_ns = state.plan.snapshot_times_ns.get(window.span.index, ())
        width_px, families = state.plan.width_px, self._families
        state.snapshots += [take_snapshot(window, time_ns, width_px, families=families) for time_ns in times_ns]
        _add_values(state.values, window_values(window, self._families))
        counted = "events" in window.facts.streams and in_families("events", self._families)
        if counted and window.owned("events"):
            _count_events(state, window)

    def merge(self, state: EvidenceState, later: EvidenceState) -> EvidenceState:
        """Return the state of the windows of both, ``later`` being of later ones."""
        both = EvidenceState(
            state.plan,
            snapshots=state.snapshots + later.snapshots,
            values=dict(state.values),
            pixels=state.pixels,
            counted_ns=state.counted_ns + later.counted_ns,
            events={**state.events, **later.events},
        )
        _add_values(both.values, later.values)
        if later.pixels is not None:
            both.pixels = later.pixels if both.pixels is None else padded_sum(both.pixels, later.pixels)
        return both

    def conclude(self, state: EvidenceState, facts: Facts) -> TitledArrays:
        """Return everything that was kept, as arrays with titles."""
        return merged(
            [
                keep_snapshots(MOMENTS, state.snapshots, facts, state.plan.width_px),
                self._timeline_arrays(state, facts),
                keep_histograms(state.values, state.pixels, seconds_of(facts, state.counted_ns)),
            ]
        )

    def _timeline_arrays(self, state: EvidenceState, facts: Facts) -> TitledArrays:
        timeline = state.plan.timeline
        counts = stream_counts(timeline, facts, self._spans, state.events)
        edges_us = facts.origin_us + timeline.edges_ns / NS_PER_US
        step_ms = float(edges_us[1] - edges_us[0]) / 1e3
        return TitledArrays.titled(
            {
                named(TIMELINE, "edges_us"): (edges_us, "Edges of the bins, us on the file's clock"),
                **{
                    named(TIMELINE, stream): (samples, f"Samples of {stream} in each {step_ms:.4g} ms")
                    for stream, samples in counts.items()
                },
            }
        )


def _count_events(state: EvidenceState, window: Window) -> None:
    rows = window.owned("events")
    try:
        times_ns = window.rows(TIMESTAMPS_OF["events"], rows.start, rows.stop)
        state.pixels = with_events(state.pixels, window)
    except UnreadableRowsError:
        return
    state.events[window.span.index] = state.plan.timeline.count(times_ns)
    # Windows whose events were not read count no time, or the rates of pixels would come out too low.
    state.counted_ns.append((window.span.start_ns, window.span.stop_ns))


def _add_values(total: dict[str, Int64], part: Mapping[str, Int64]) -> None:
    for quantity, counts in part.items():
        total[quantity] = total[quantity] + counts if quantity in total else counts

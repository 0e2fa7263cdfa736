"""The timeline: the samples of each stream, the findings and the snapshots on one axis of time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_qa.record.evidence import TIMELINE, UNMEASURED, named
from fedora_qa.record.types import GRAVE, Finding
from fedora_qa.record.wording import number
from fedora_reports.charts import HEIGHT, WIDTH, steps_path
from fedora_reports.evidence import Array, Evidence
from fedora_reports.scales import Axis, Tick
from fedora_reports.strip import SnapshotRow

_LANES = 4
_LABEL_SHARE = 0.08
"""Width of a label as a share of the narrowest page."""

_ROUNDING = 1e-9
"""Bins and segments that end at one time do so but for rounding, as a share of the width."""

_FAR_US = 1e10
"""Times beyond some hours count from the beginning of the timeline: all their digits would not fit."""

WHOLE_FILE = "whole file"


@dataclass(frozen=True, slots=True)
class AnchoredFinding:
    """A finding at one of its places, and its identifier on the page; ``is_further``: it is worst at another place."""

    finding: Finding
    anchor: str
    is_further: bool = False


@dataclass(frozen=True, slots=True)
class TimelineMark:
    """A finding on the timeline, in one of a few lanes below the density; ``left``, ``width``: shares of the width."""

    anchor: str
    label: str
    message: str
    left: float
    width: float
    lane: int
    grave: bool


@dataclass(frozen=True, slots=True)
class TimelineRow:
    """One stream: the density of its samples, and its findings.

    ``count`` is the number of its samples; ``peak`` the greatest rate of events, empty for other streams.
    ``unmeasured`` are the segments of time in which only timestamps were read, as an SVG path. For ``more``
    findings, and for ``more_places`` of findings that are worst elsewhere, no lane was free; ``ticks`` marks their
    beginnings, as an SVG path in the width of the drawing.
    """

    stream: str
    count: str
    peak: str
    path: str
    unmeasured: str
    marks: tuple[TimelineMark, ...]
    lanes: int
    more: int
    more_places: int
    ticks: str


@dataclass(frozen=True, slots=True)
class SnapshotMark:
    """The time of a snapshot, as a share of the width."""

    anchor: str
    time: str
    share: float


@dataclass(frozen=True, slots=True)
class Timeline:
    """All rows on one axis of time, from ``low_us`` to ``high_us`` of the file's clock."""

    rows: tuple[TimelineRow, ...]
    snapshots: tuple[SnapshotMark, ...]
    ticks: tuple[Tick, ...]
    caption: str
    low_us: float
    high_us: float


@dataclass(frozen=True, slots=True)
class Sparkline:
    """A timeline in the height of a line: samples, what was not measured, and grave findings, as SVG paths."""

    path: str
    unmeasured: str
    findings: str
    alt: str


def sparkline_of(timeline: Timeline) -> Sparkline | None:
    """Return a timeline as one line: of events, else of its first stream; None where no stream has samples."""
    drawn = [row for row in timeline.rows if row.path]
    if not drawn:
        return None
    row = next((row for row in drawn if row.stream == "events"), drawn[0])
    spans = {
        f"M{mark.left * WIDTH:.0f} {HEIGHT}V0M{mark.left * WIDTH:.0f} {HEIGHT}h{mark.width * WIDTH:.0f}"
        for each in timeline.rows
        for mark in each.marks
        if mark.grave
    }
    marked = "; upright lines: where failures begin" if spans else ""
    return Sparkline(row.path, row.unmeasured, "".join(sorted(spans)), f"{row.stream} over time{marked}")


def timeline_of(
    evidence: Evidence, findings: Sequence[AnchoredFinding], snapshots: Sequence[SnapshotRow] = ()
) -> Timeline | None:
    """Return the timeline of a file.

    Returns
    -------
    Timeline or None
        None where the evidence holds no edges of bins, or there is neither a stream nor a finding.
    """
    edges_us = evidence.numbers(named(TIMELINE, "edges_us"), None)
    if edges_us is None or len(edges_us) < 2 or not np.isfinite(edges_us).all() or edges_us[-1] <= edges_us[0]:
        return None
    axis = Axis(float(edges_us[0]), float(edges_us[-1]))
    bin_s = (axis.high - axis.low) / (len(edges_us) - 1) / 1e6
    samples_by_stream: dict[str, Array | None] = {}
    for name in evidence.under(TIMELINE):
        samples = evidence.numbers(name, len(edges_us) - 1)
        if samples is not None:
            samples_by_stream[name.removeprefix(f"{TIMELINE}/")] = samples
    # Streams without samples have a row for their findings.
    for stream in sorted({located.finding.where.stream or "" for located in findings} - {""}):
        samples_by_stream.setdefault(stream, None)
    rows = []
    for stream, samples in samples_by_stream.items():
        segments_us = evidence.numbers(named(TIMELINE, UNMEASURED, stream), None, 2)
        of_stream = [located for located in findings if located.finding.where.stream == stream]
        rows.append(_row(stream, samples, axis, bin_s, of_stream, segments_us))
    without_stream = [located for located in findings if not located.finding.where.stream]
    if without_stream:
        rows.append(_row(WHOLE_FILE, None, axis, bin_s, without_stream))
    if not rows:
        return None
    far = max(abs(axis.low), abs(axis.high)) > _FAR_US
    origin_us = axis.low if far else 0.0
    clock = f"Seconds from {axis.low / 1e6:.6f} s of the file's clock." if far else "Seconds of the file's clock."
    marks = tuple(
        SnapshotMark(row.anchor, row.time, axis.share(row.time_us))
        for row in snapshots
        if row.time_us is not None and axis.low <= row.time_us <= axis.high
    )
    return Timeline(
        rows=tuple(rows),
        snapshots=marks,
        ticks=Axis((axis.low - origin_us) / 1e6, (axis.high - origin_us) / 1e6).ticks(5),
        caption=f"Samples within bins of {number(bin_s * 1e3)} ms, each row to its own greatest count. {clock}"
        + (" Hatched: only timestamps were read." if any(row.unmeasured for row in rows) else ""),
        low_us=axis.low,
        high_us=axis.high,
    )


def _row(
    stream: str,
    samples: Array | None,
    axis: Axis,
    bin_s: float,
    findings: Sequence[AnchoredFinding],
    unmeasured_us: Array | None = None,
) -> TimelineRow:
    # A finding without a time spans the whole width; one without an end is as wide as its label.
    spans = []
    for located in findings:
        start_us, stop_us = located.finding.where.start_us, located.finding.where.stop_us
        left, right = 0.0, 1.0
        if start_us is not None and math.isfinite(start_us):
            left = axis.share(start_us)
            right = max(axis.share(stop_us), left) if stop_us is not None and math.isfinite(stop_us) else left
        spans.append((left, right, located))
    # Each finding lies in the first lane in which its label touches no other.
    free_from = [-math.inf] * _LANES
    marks: list[TimelineMark] = []
    without_lane: list[tuple[float, bool]] = []
    for left, right, located in sorted(spans, key=lambda item: item[:2]):
        lane = next((lane for lane in range(_LANES) if free_from[lane] <= left), None)
        if lane is None:
            without_lane.append((left, located.is_further))
            continue
        free_from[lane] = max(right, left + _LABEL_SHARE)
        finding = located.finding
        grave = finding.severity in GRAVE
        marks.append(TimelineMark(located.anchor, finding.id, finding.message, left, right - left, lane, grave))
    places = sum(is_further for _, is_further in without_lane)
    starts = sorted({round(left, 3) for left, _ in without_lane})
    count, peak, path = "", "", ""
    segments = np.empty((0, 2))
    if unmeasured_us is not None and np.isfinite(unmeasured_us).all():
        segments = axis.shares(np.clip(unmeasured_us, axis.low, axis.high))
    if samples is not None and np.isfinite(samples).all():
        count = f"{int(samples.sum()):,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
        if stream == "events":
            # Of events that were not looked at only the number in each window is known: spread over its bins they would
            # look like a rate that never changes.
            edges = np.linspace(0.0, 1.0, len(samples) + 1)[:, None]
            low, high = segments.T
            is_flat = ((edges[:-1] >= low - _ROUNDING) & (edges[1:] <= high + _ROUNDING)).any(axis=1)
            samples = np.where(is_flat, 0, samples)
        most = float(samples.max())
        if stream == "events":
            rate = most / bin_s
            prefixes = ((1e9, " G"), (1e6, " M"), (1e3, " k"))
            size, prefix = next(((size, prefix) for size, prefix in prefixes if rate >= size), (1.0, ""))
            peak = f"up to {rate / size:.3g}{prefix} events/s"
        heights = np.clip(samples / most, 0.0, 1.0) * HEIGHT if most > 0 else np.zeros(len(samples))
        path = steps_path(list(np.linspace(0.0, WIDTH, len(samples) + 1)), list(heights))
    return TimelineRow(
        stream=stream,
        count=count,
        peak=peak,
        path=path,
        unmeasured="".join(f"M{left:.1f} 50H{right:.1f}" for left, right in WIDTH * segments),
        marks=tuple(marks),
        lanes=max((mark.lane + 1 for mark in marks), default=0),
        more=len(without_lane) - places,
        more_places=places,
        ticks="".join(f"M{left * WIDTH:.0f} 0v{HEIGHT}" for left in starts),
    )

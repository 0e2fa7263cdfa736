"""The timeline: when each stream has samples, where in time findings lie, and of which instants there are pictures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_qa.record.evidence import TIMELINE, named
from fedora_qa.record.types import Finding
from fedora_qa.record.wording import number
from fedora_reports.charts import HEIGHT, WIDTH, steps_path
from fedora_reports.evidence import Evidence
from fedora_reports.instants import Array
from fedora_reports.scales import Axis, Tick
from fedora_reports.strip import Row

_LANES = 4
_LABEL_SHARE = 0.08
"""Width that a label takes on the narrowest page."""

_FAR_US = 1e10
"""Beyond some hours, times are told from the beginning of the timeline, or their digits would not fit."""

ELSEWHERE = "whole file"


@dataclass(frozen=True, slots=True)
class Located:
    """A finding and the link to it."""

    finding: Finding
    anchor: str


@dataclass(frozen=True, slots=True)
class Mark:
    """A finding on the timeline: places as shares of its width, in one of a few lanes below the density."""

    anchor: str
    label: str
    words: str
    left: float
    width: float
    lane: int
    grave: bool


@dataclass(frozen=True, slots=True)
class TimelineRow:
    """One stream: its density of samples, and the findings that lie in it.

    ``words`` is how many samples it has, ``peak`` their greatest rate, where that tells something.
    ``more`` findings found no lane for their labels; ``ticks`` marks where they begin, an SVG path in the width of the
    drawing.
    """

    stream: str
    words: str
    peak: str
    path: str
    marks: tuple[Mark, ...]
    lanes: int
    more: int
    ticks: str


@dataclass(frozen=True, slots=True)
class Stop:
    """An instant of which there are pictures, as a share of the width."""

    anchor: str
    time: str
    share: float


@dataclass(frozen=True, slots=True)
class Timeline:
    """All rows on one time axis, from ``low_us`` to ``high_us`` of the file's clock."""

    rows: tuple[TimelineRow, ...]
    stops: tuple[Stop, ...]
    ticks: tuple[Tick, ...]
    caption: str
    low_us: float
    high_us: float


def timeline_of(evidence: Evidence, findings: Sequence[Located], moments: Sequence[Row] = ()) -> Timeline | None:
    """Return the timeline; None where the evidence holds no edges or no stream."""
    edges_us = evidence.numbers(named(TIMELINE, "edges_us"), None)
    if edges_us is None or len(edges_us) < 2 or not np.isfinite(edges_us).all() or edges_us[-1] <= edges_us[0]:
        return None
    axis = Axis(float(edges_us[0]), float(edges_us[-1]))
    counts = {name.removeprefix(f"{TIMELINE}/"): evidence.numbers(name, len(edges_us) - 1)
              for name in evidence.under(TIMELINE)}  # fmt: skip
    samples_by_stream = {stream: samples for stream, samples in counts.items() if samples is not None}
    named_findings = {located.finding.where.stream for located in findings}
    bin_s = (axis.high - axis.low) / (len(edges_us) - 1) / 1e6
    streams = [
        *samples_by_stream,
        *sorted(stream for stream in named_findings if stream and stream not in samples_by_stream),
    ]
    rows = [
        _row(
            stream,
            samples_by_stream.get(stream),
            axis,
            bin_s,
            [located for located in findings if located.finding.where.stream == stream],
        )
        for stream in streams
    ]
    homeless = [located for located in findings if not located.finding.where.stream]
    if homeless:
        rows.append(_row(ELSEWHERE, None, axis, bin_s, homeless))
    ticks, clock = _ticks(axis)
    caption = f"Samples within bins of {number(bin_s * 1e3)} ms, each row to its own greatest count. {clock}"
    return Timeline(tuple(rows), _stops(moments, axis), ticks, caption, axis.low, axis.high) if rows else None


def _stops(moments: Sequence[Row], axis: Axis) -> tuple[Stop, ...]:
    within = ((row, row.time_us) for row in moments if row.time_us is not None)
    return tuple(
        Stop(row.anchor, row.time, axis.share(time_us)) for row, time_us in within if axis.low <= time_us <= axis.high
    )


def _ticks(axis: Axis) -> tuple[tuple[Tick, ...], str]:
    far = max(abs(axis.low), abs(axis.high)) > _FAR_US
    origin_us = axis.low if far else 0.0
    ticks = Axis((axis.low - origin_us) / 1e6, (axis.high - origin_us) / 1e6).ticks(5)
    clock = "Seconds of the file's clock."
    return ticks, f"Seconds from {axis.low / 1e6:.6f} s of the file's clock." if far else clock


def _row(stream: str, samples: Array | None, axis: Axis, bin_s: float, findings: Sequence[Located]) -> TimelineRow:
    marks, left_over = _marks(findings, axis)
    words, peak, path = "", "", ""
    if samples is not None and np.isfinite(samples).all():
        total, most = int(samples.sum()), float(samples.max())
        words = f"{total:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
        if stream == "events":
            peak = f"up to {_in_thousands(most / bin_s)} events/s"
        heights = np.clip(samples / most, 0.0, 1.0) * HEIGHT if most > 0 else np.zeros(len(samples))
        path = steps_path(list(np.linspace(0.0, WIDTH, len(samples) + 1)), list(heights))
    lanes = max((mark.lane + 1 for mark in marks), default=0)
    ticks = "".join(f"M{left * WIDTH:.0f} 0v{HEIGHT}" for left in sorted({round(left, 3) for left in left_over}))
    return TimelineRow(stream, words, peak, path, marks, lanes, len(left_over), ticks)


def _in_thousands(rate: float) -> str:
    """Return a rate with two or three digits."""
    for size, letter in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if rate >= size:
            return f"{rate / size:.3g}{letter}"
    return f"{rate:.3g}"


def _marks(findings: Sequence[Located], axis: Axis) -> tuple[tuple[Mark, ...], list[float]]:
    """Place findings in the first lane where their labels do not touch; return where those begin that find none."""
    free_from = [-math.inf] * _LANES
    marks: list[Mark] = []
    left_over: list[float] = []
    for left, right, located in sorted(
        ((*_span(located.finding, axis), located) for located in findings), key=lambda item: item[:2]
    ):
        lane = next((lane for lane in range(_LANES) if free_from[lane] <= left), None)
        if lane is None:
            left_over.append(left)
            continue
        free_from[lane] = max(right, left + _LABEL_SHARE)
        finding = located.finding
        grave = finding.severity in {"critical", "error"}
        marks.append(Mark(located.anchor, finding.id, finding.message, left, right - left, lane, grave))
    return tuple(marks), left_over


def _span(finding: Finding, axis: Axis) -> tuple[float, float]:
    """Return where a finding begins and ends; the whole width where it has no time."""
    start_us, stop_us = finding.where.start_us, finding.where.stop_us
    if start_us is None or not math.isfinite(start_us):
        return 0.0, 1.0
    left = axis.share(start_us)
    right = axis.share(stop_us) if stop_us is not None and math.isfinite(stop_us) else left
    return left, max(right, left)

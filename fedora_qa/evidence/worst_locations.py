"""Where findings are worst: a window, an instant, images, and a box in the picture."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from fedora_qa.conventions import NS_PER_US
from fedora_qa.evidence.snapshot_times import snapshot_times_ns
from fedora_qa.record.types import Finding, Severity, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span

Box = tuple[float, float, float, float]

WHOLE: Final[Box] = (0.0, 0.0, 1.0, 1.0)

_SEVERITY_RANK: Final[Mapping[Severity, int]] = {"critical": 0, "error": 1, "warning": 2, "info": 3}
_FRAMES: Final = ("rgb", "depth")


@dataclass(frozen=True, slots=True)
class WorstLocation:
    """The window, instant and images that show a finding.

    Attributes
    ----------
    rows
        The image to show of a stream, where the finding names it.
    """

    finding: Finding
    span: Span
    time_ns: int
    rows: Mapping[str, int] = field(default_factory=dict)


def worst_locations(
    findings: Iterable[Finding], spans: Sequence[Span], facts: Facts, most: int
) -> tuple[WorstLocation, ...]:
    """Return the locations of the gravest findings that have one, each location once, at most so many."""
    locations: dict[object, WorstLocation] = {}
    for finding in sorted(findings, key=lambda finding: _SEVERITY_RANK[finding.severity]):
        location = location_of(finding, spans, facts)
        if location is not None:
            where = finding.where
            locations.setdefault((location.time_ns, where.pixel, where.tile), location)
    return tuple(locations.values())[:most]


def location_of(finding: Finding, spans: Sequence[Span], facts: Facts) -> WorstLocation | None:
    """Return the location of a finding; None where it is of the whole file, or no window shows it."""
    where = finding.where
    rows = _named_frame(where, facts)
    time_ns = _instant_ns(where, rows, facts)
    if time_ns is None and not rows and where.index_start is None:
        return _in_the_middle_of_file(finding, spans, facts) if where.pixel or where.tile else None
    rows |= _field(where, rows, time_ns, facts)
    first_row = {where.stream: where.index_start} if where.stream and where.index_start is not None else {}
    span = _owner({**first_row, **rows}, spans) or _nearest_span(time_ns, spans)
    if span is None:
        return None
    owned = {stream: row for stream, row in rows.items() if row in range(*span.owned.get(stream, (0, 0)))}
    return WorstLocation(finding, span, (span.start_ns + span.stop_ns) // 2 if time_ns is None else time_ns, owned)


def location_beside(location: WorstLocation, step: int, spans: Sequence[Span], facts: Facts) -> WorstLocation | None:
    """Return the location so many frames later, or earlier; None where there is no such frame or timestamp.

    Of a field of flow that the finding names the neighbour nearest to that frame is shown.
    """
    stream = next((name for name in _FRAMES if name in facts.clocks and facts.clocks[name].usable), None)
    if stream is None:
        return None
    times_ns = facts.clocks[stream].times_ns
    row = location.rows.get(stream, int(np.argmin(np.abs(times_ns - location.time_ns)))) + step
    if not _has_row(facts, stream, row):
        return None
    time_ns = int(times_ns[row])
    rows = {stream: row}
    for name in location.rows:
        if name in facts.flow_streams and facts.clocks[name].usable:
            rows[name] = int(np.argmin(np.abs(facts.clocks[name].times_ns - time_ns)))
    span = _owner({stream: row}, spans) or _nearest_span(time_ns, spans)
    return None if span is None else WorstLocation(location.finding, span, time_ns, rows)


def box_of(where: Where, height: int, width: int) -> Box:
    """Return a finding's tile or pixel as shares of an image of the stream named: left, top, right, bottom.

    It is clipped to the image, and the whole image where nothing of it lies within. The cameras of a file have one
    field of view, so that the shares hold for the pictures of all streams.
    """
    tile = where.tile or (where.pixel and (*where.pixel, where.pixel[0] + 1, where.pixel[1] + 1))
    if not tile:
        return WHOLE
    left, right = (min(max(column / width, 0.0), 1.0) for column in tile[::2])
    top, bottom = (min(max(row / height, 0.0), 1.0) for row in tile[1::2])
    return (left, top, right, bottom) if left < right and top < bottom else WHOLE


def _named_frame(where: Where, facts: Facts) -> dict[str, int]:
    """Return the frame that a finding names, of its stream or else of colour."""
    own = where.stream if where.stream in _FRAMES else None
    stream = own or next((name for name in _FRAMES if name in facts.clocks), None)
    row = where.frame if where.frame is not None or own is None else where.index_start
    if stream is None or stream not in facts.clocks or row is None or not _has_row(facts, stream, row):
        return {}
    return {stream: row}


def _field(where: Where, rows: Mapping[str, int], time_ns: int | None, facts: Facts) -> dict[str, int]:
    """Return the field of flow to show: of those that a finding names the one nearest to the instant."""
    if where.stream not in facts.flow_streams or where.index_start is None:
        return {}
    first = max(where.index_start, 0)
    stop = where.index_start + 1 if where.index_stop is None else where.index_stop
    starts_ns = facts.clocks[where.stream].times_ns[first : max(stop, 0)]
    if time_ns is None or not len(starts_ns):
        return {}
    # In floating point, as a finding may name a time that is beyond 64-bit nanoseconds.
    return {where.stream: first + int(np.argmin(np.abs(starts_ns - float(time_ns))))}


def _instant_ns(where: Where, rows: Mapping[str, int], facts: Facts) -> int | None:
    """Return the timestamp of the frame that is named, or else the time of the finding: the middle of an interval."""
    for stream, row in rows.items():
        if facts.clocks[stream].usable:
            return int(facts.clocks[stream].times_ns[row])
    if where.start_us is not None:
        first, stop = where.index_start, where.index_stop
        is_single_field = where.stream in facts.flow_streams and (stop is None or first is None or stop - first == 1)
        stop_us = where.start_us if where.stop_us is None or is_single_field else where.stop_us
        return round(((where.start_us + stop_us) / 2 - facts.origin_us) * NS_PER_US)
    clock = facts.clocks.get(where.stream or "")
    if clock is None or where.index_start is None or not _has_row(facts, where.stream or "", where.index_start):
        return None
    return int(clock.times_ns[where.index_start])


def _owner(rows: Mapping[str, int], spans: Iterable[Span]) -> Span | None:
    """Return the window that owns the first of these rows; rows lead to a window even where clocks are broken."""
    for stream, row in rows.items():
        for span in spans:
            if row in range(*span.owned.get(stream, (0, 0))):
                return span
    return None


def _nearest_span(time_ns: int | None, spans: Sequence[Span]) -> Span | None:
    """Return the window at an instant, or the one nearest to it."""
    if time_ns is None or not spans:
        return None
    return min(spans, key=lambda span: max(span.start_ns - time_ns, time_ns - span.stop_ns + 1, 0))


def _in_the_middle_of_file(finding: Finding, spans: Sequence[Span], facts: Facts) -> WorstLocation | None:
    for index, (time_ns, *_) in snapshot_times_ns(spans, facts, 1).items():
        return next(WorstLocation(finding, span, time_ns) for span in spans if span.index == index)
    return None


def _has_row(facts: Facts, stream: str, row: int) -> bool:
    return 0 <= row < len(facts.clocks[stream].times_ns)

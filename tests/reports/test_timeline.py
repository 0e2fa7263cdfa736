"""The timeline shows every stream, and every finding in its stream at its time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.record.types import Finding, Where
from fedora_reports.evidence import Evidence
from fedora_reports.strip import SnapshotRow
from fedora_reports.timeline import AnchoredFinding, Timeline, timeline_of
from tests.reports.evidence_samples import timeline


def drawn(*places: Where, edges_us: np.ndarray | None = None) -> Timeline:
    """The timeline of two streams with a finding at each place."""
    arrays = timeline() | ({} if edges_us is None else {"timeline/edges_us": edges_us})
    findings = [
        AnchoredFinding(Finding(f"F{k}", "x.y", "error", "Wrong.", where), f"a{k}") for k, where in enumerate(places)
    ]
    found = timeline_of(Evidence(arrays, {}), findings)
    assert found is not None
    return found


def test_rows_are_the_streams_with_their_samples() -> None:
    """Each stream has a row with the number of its samples; an empty bin is a gap."""
    events, frames = drawn().rows
    assert (events.stream, events.count) == ("events", "4\u202f500")
    assert (frames.stream, frames.count) == ("rgb", "90")
    assert "L300.0 100.0H400.0" in frames.path


def test_what_was_not_looked_at_is_hatched_and_empty() -> None:
    """Of events in such a segment no rate is drawn, and no greatest rate taken; frames have stamps there."""
    segments_us = {f"timeline/unmeasured/{stream}": np.array([[1e6, 2e6]]) for stream in ("events", "rgb")}
    found = timeline_of(Evidence(timeline() | segments_us, {}), [])
    assert found is not None
    events, frames = found.rows
    assert events.unmeasured == frames.unmeasured == "M500.0 50H1000.0"
    assert events.path.endswith("L400.0 0.0H500.0L500.0 100.0H600.0L600.0 100.0H700.0"
                                "L700.0 100.0H800.0L800.0 100.0H900.0L900.0 100.0H1000.0V100Z")  # fmt: skip
    assert (events.peak, events.count) == ("up to 2 k events/s", "4\u202f500")
    assert frames.path == drawn().rows[1].path
    assert "Hatched" in found.caption
    assert "Hatched" not in drawn().caption


def test_finding_lies_at_its_time() -> None:
    """Half a second into two is a quarter of the width."""
    (mark,) = drawn(Where("rgb", 500e3, 1500e3)).rows[1].marks
    assert (mark.anchor, mark.left, mark.width) == ("a0", 0.25, 0.5)


def test_finding_without_time_spans_its_stream() -> None:
    """What befalls a stream as a whole is marked along all of it."""
    (mark,) = drawn(Where("events")).rows[0].marks
    assert (mark.left, mark.width) == (0.0, 1.0)


def test_streams_without_samples_have_rows_for_their_findings() -> None:
    """A finding of the metadata, or of no stream, has a row too."""
    assert [row.stream for row in drawn(Where("metadata"), Where()).rows] == ["events", "rgb", "metadata", "whole file"]


def test_marks_that_would_touch_lie_below_each_other() -> None:
    """Labels of one time take lanes of their own."""
    marks = drawn(*[Where("rgb", 1e6, 1e6)] * 3).rows[1].marks
    assert [mark.lane for mark in marks] == [0, 1, 2]


@given(st.lists(st.tuples(st.floats(0, 2e6), st.floats(0, 1e6)), max_size=40))
def test_no_finding_is_lost(spans: list[tuple[float, float]]) -> None:
    """All findings are marked or counted, none lies outside, and in no lane do two begin at one place."""
    row = drawn(*(Where("rgb", start, start + length) for start, length in spans)).rows[1]
    assert len(row.marks) + row.more == len(spans)
    assert row.more_places == 0
    for mark in row.marks:
        assert 0.0 <= mark.left <= mark.left + mark.width <= 1.0 + 1e-12
    for lane in range(row.lanes):
        starts = [mark.left for mark in row.marks if mark.lane == lane]
        assert (np.diff(starts) > 0.07).all()


def test_far_clocks_are_told_from_the_beginning() -> None:
    """Seconds since 1970 would be unreadable: the axis counts from the beginning, and the caption says from when."""
    far = drawn(edges_us=np.linspace(0.0, 2e6, 11) + 1.7e15)
    assert [tick.label for tick in far.ticks] == ["0", "0.5", "1", "1.5", "2"]
    assert "1700000000.000000 s of the file's clock" in far.caption


@pytest.mark.parametrize("edges_us", [np.zeros(11), np.full(11, np.nan), np.linspace(2e6, 0.0, 11)])
def test_no_time_no_timeline(edges_us: np.ndarray) -> None:
    """Edges that do not span any time give no timeline."""
    assert timeline_of(Evidence(timeline() | {"timeline/edges_us": edges_us}, {}), []) is None


def test_findings_without_a_lane_are_ticks() -> None:
    """What finds no room for its label is still marked where it begins, once a place."""
    row = drawn(*[Where("rgb", 1e6, 1e6)] * 6).rows[1]
    assert (row.more, row.more_places, row.ticks) == (2, 0, "M500 0v100")


def test_places_of_a_finding_are_no_findings() -> None:
    """A finding at six places has four marks and two more places."""
    finding = Finding("F1", "x.y", "error", "Wrong.", Where("rgb", 1e6, 1e6))
    places = [AnchoredFinding(finding, "a", is_further=place > 0) for place in range(6)]
    timeline_drawn = timeline_of(Evidence(timeline(), {}), places)
    assert timeline_drawn is not None
    row = timeline_drawn.rows[1]
    assert (len(row.marks), row.more, row.more_places) == (4, 0, 2)


def test_events_tell_their_greatest_rate() -> None:
    """900 events in a bin of a fifth of a second are 4500 a second; frames need no rate."""
    events, frames = drawn().rows
    assert (events.peak, frames.peak) == ("up to 4.5 k events/s", "")


def test_snapshots_are_marked_within_the_timeline() -> None:
    """A snapshot in the middle is marked there; one outside, or without a time, is none."""
    rows = [SnapshotRow(f"m{k}", str(time), time, ()) for k, time in enumerate((1e6, 9e9, None))]
    found = timeline_of(Evidence(timeline(), {}), [], rows)
    assert found is not None
    assert [(mark.anchor, mark.share) for mark in found.snapshots] == [("m0", 0.5)]
    assert (found.low_us, found.high_us) == (0.0, 2e6)

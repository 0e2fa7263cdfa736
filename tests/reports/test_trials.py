"""A cause shows what undoing it changes: deviations, their course by size, arrays of checks and pictures."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fedora_qa.record.types import FileRecord, Finding, Where
from fedora_reports.anchors import Anchors
from fedora_reports.evidence import Evidence
from fedora_reports.html import render_html
from fedora_reports.page import AgreementCell, agreement_of
from fedora_reports.problems import problems_of
from fedora_reports.strip import pictures_of
from fedora_reports.trials import TrialView, trial_of
from tests.reports.evidence_samples import all_kinds, moments, trial
from tests.reports.page_reader import complaints_about, read_page
from tests.support.records import failed, file_record, late_events, passed, record


def drawn(arrays: dict[str, Any]) -> TrialView:
    """What is drawn of a trial whose arrays were kept."""
    titles = dict.fromkeys(arrays, "Lag; x lag [ms]; y deviation [ms]")
    evidence = Evidence(arrays, titles)
    view = trial_of(evidence, "D1", pictures_of(evidence, (), Anchors(0), ("D1",)).trials.get("D1"))
    assert view is not None
    return view


def test_the_largest_deviation_of_each_check_is_drawn() -> None:
    """On one axis of limits, 0.1 to 10 here: 10 limits lie at its end, 0.1 and less at its beginning."""
    view = drawn(trial("D1"))
    assert view.measured == 3
    gaps, offset = view.deviations
    # What must be exact is beyond all limits before, and in order after.
    assert (gaps.check, gaps.before, gaps.after) == ("event_stream.gaps", 1.0, 0.0)
    assert (offset.name, offset.before, offset.after) == ("time_offset", 1.0, pytest.approx(0.0))
    assert view.limit == pytest.approx(0.5)
    assert (offset.before_text, offset.after_text) == ("3 ms", "0.03 ms, limit 0.3 ms")


def test_what_a_check_no_longer_states_is_said() -> None:
    """Not a number: the check that passes does not state the part of the stream any more."""
    arrays = {name: array for name, array in trial("D1").items() if "late_region" in name}
    (part,) = drawn(arrays).deviations
    assert (part.after, part.after_text) == (0.0, "no longer stated, limit 0.3 ms")
    assert part.before == pytest.approx(math.log(20) / math.log(100))


def test_series_and_maps_lie_side_by_side() -> None:
    """Both series on the same axes; both maps in the same colours; the course from 0 on, with the limit."""
    view = drawn(trial("D1"))
    (chart,) = view.charts
    assert (chart.highest, chart.lowest) == ("4", "0")
    assert chart.before.endswith("L1000.0 0.0")
    assert chart.path.endswith("L1000.0 90.0")
    ((before, after),) = view.maps
    assert before.image.uri != after.image.uri
    assert before.bar is not None
    assert after.bar is not None
    assert [tick.label for tick in before.bar.ticks] == [tick.label for tick in after.bar.ticks]
    assert view.by_size is not None
    assert (view.by_size.lowest, view.by_size.level) == ("0", pytest.approx(0.9))


def test_only_pictures_that_differ_are_drawn() -> None:
    """Events differ; the frame below them, depth and flow do not."""
    view = drawn(trial("D1"))
    assert [(before.kind, after.kind) for before, after in view.panels] == [("events", "events")]
    assert view.is_part


def test_no_trial_no_picture() -> None:
    """A diagnosis of which nothing was kept has none."""
    assert trial_of(Evidence(moments(), {}), "D1", None) is None


def test_the_page_holds_the_pictures_of_a_cause() -> None:
    """Within the cause, with words and captions, and valid."""
    file = file_record(failed(), passed(), diagnoses=(late_events(),))
    page = read_page(render_html(record(file), all_kinds()))
    assert complaints_about(page) == []
    assert "Deviations before and after undoing" in page.text
    assert "a part of the image, its pixels as stored" in page.text


def test_a_report_opens_on_the_finding_that_the_first_cause_explains_best() -> None:
    """The finding at whose place the cause was measured, not the first of the record."""
    first, second = (Finding(f"F{k}", "a.b.c", "error", "Wrong.", Where("events", k * 1e6)) for k in (1, 2))
    result = replace(failed(), findings=(first, second))
    diagnosis = replace(late_events(), where=second.where, explains=("F1", "F2"))
    file = file_record(result, diagnoses=(diagnosis,))
    assert opening(file) == Anchors(0).finding(1)
    assert opening(file_record(passed())) == ""


def opening(file: FileRecord) -> str:
    """The anchor of the finding on which the report opens."""
    evidence = Evidence({}, {})
    return problems_of(file, evidence, pictures_of(evidence, (), Anchors(0)), Anchors(0)).opening


def test_streams_agree_in_both_directions() -> None:
    """Each pair stands in the row of either stream; no check compares a stream with itself, or depth with events."""
    kept = Evidence({"agreement/events/rgb": np.array([3, 1]), "agreement/depth/rgb": np.array([2, 0])}, {})
    table = agreement_of(kept)
    assert table is not None
    assert table.streams == ("depth", "events", "rgb")
    failing, agreeing = AgreementCell(3, 1), AgreementCell(2, 0)
    assert table.rows == ((None, None, agreeing), (None, None, failing), (agreeing, failing, None))
    assert agreement_of(Evidence({}, {})) is None

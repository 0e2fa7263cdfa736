"""The page of a score shows what the document holds, and takes nothing from it for markup."""

from fedora_qa.record.types import Tool
from fedora_qa.scoring.types import SCORE_VERSION, ErrorAtTime, FlowAccuracy, FlowScore, Score
from fedora_reports.score import render_score, score_page

NOTHING = FlowAccuracy("all", "all", 6, 0, 0.0, None, None, None, None, None, None, None, None, None)


def score(*flow: FlowScore, notes: tuple[str, ...] = ()) -> Score:
    return Score(SCORE_VERSION, Tool("fedora-qa", "0"), "out/<b>p.h5", "seq.h5", flow, None, None, notes)


def flow_score(rate_hz: float, *points: ErrorAtTime) -> FlowScore:
    return FlowScore(f"flow/{rate_hz:g}hz", rate_hz, 2, 1, (NOTHING,), points)


def test_time_begins_with_the_first_that_is_scored() -> None:
    """Charts of all streams have one origin of time; a constant error lies at the top of an axis that begins at 0."""
    late = flow_score(10, ErrorAtTime(2_000_000, 2_100_000, 0.5), ErrorAtTime(2_100_000, 2_200_000, 0.5))
    early = flow_score(50, ErrorAtTime(1_000_000, 1_020_000, 0.5))
    charts = score_page(score(late, early)).sections[0].charts
    assert [chart.title for chart in charts] == ["Endpoint error at 10 Hz", "Endpoint error at 50 Hz"]
    assert (charts[0].ticks[0].label, charts[0].ticks[-1].label) == ("1.06", "1.14")
    assert (charts[0].lowest, charts[0].highest) == ("0", "0.5")


def test_what_has_no_value_has_no_chart() -> None:
    """A stream without any prediction has its row, in which nothing stands for an error."""
    (section,) = score_page(score(flow_score(10))).sections
    assert section.charts == ()
    assert section.tables[0].rows == (("all", "0", *["-"] * 8),)
    assert score_page(score()).headline == "Nothing of the truth is valid"


def test_names_are_text() -> None:
    """Whatever a path or a note holds."""
    page = render_score(score(flow_score(10), notes=("<script>alert(1)</script>",)))
    assert "<b>p.h5" not in page
    assert "<script" not in page
    assert "&lt;script&gt;alert(1)" in page

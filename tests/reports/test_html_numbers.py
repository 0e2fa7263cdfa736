"""The report says what the record says, and nothing that it does not."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.record.types import Coverage, FileRecord, Measurement
from fedora_qa.record.wording import OUTCOME_WORDS, coverage_words, with_error, with_unit
from fedora_reports.html import render_html
from fedora_reports.page import verdict_of
from fedora_reports.statistics import all_statistics, paper_tables, split_unit
from tests.reports.page_reader import Element, ReadPage, read_page
from tests.support.records import crashed, failed, file_record, immaterial, late_events, not_observable, passed, record

FLIGHT = {
    "sequence": {"duration_s": 165.0, "event_rate_mean_per_s": 1.12e6},
    "motion": {
        "distance_m": 594.87,
        "distance_standard_error_m": 0.02,
        "speed_max_m_s": 5.032,
        "speed_max_standard_error_m_s": None,
        "angular_speed_max_rad_s": 1.233,
        "angular_speed_max_standard_error_rad_s": 0.004,
    },
    "flow/10hz": {"mean_px": 18.841, "variance_px2": 18.67, "max_px": 90.5, "valid_share": 0.75},
    "depth": {"min_m": 0.5, "max_m": 30.0, "mean_m": 9.5, "disparity_mean_per_m": 0.2566, "valid_share": 0.5},
    "rgb": {"brightness_mean_dn": 84.25},
}


def flown() -> FileRecord:
    """A file with the figures of the paper's first sequence."""
    return replace(file_record(passed()), statistics=FLIGHT)


def cells(row: Element) -> list[str]:
    """The words of a table's row."""
    return [" ".join(one.text.split()) for one in row.inside if one.tag in {"td", "th"}]


def page_of(*files: FileRecord) -> ReadPage:
    """The report of these files, without pictures."""
    return read_page(render_html(record(*files), {}))


def test_tables_hold_the_papers_figures() -> None:
    """Length, distance, greatest speeds, event rate; flow; depth: in the paper's units, with errors where known."""
    rows = [table.rows[0][1:] for table in paper_tables((flown(),), ("seq.h5",))]
    assert rows == [
        ("165", "594.87 ± 0.02", "5.032", "1.233 ± 0.004", "1.12"),
        ("10 Hz", "18.84", "18.67", "90.5", "75"),
        ("0.5 to 30", "9.5", "0.2566", "50", "84.25"),
    ]


def test_tables_are_on_the_page() -> None:
    """Each of their rows is a row of the page."""
    page = page_of(flown())
    shown = [cells(row) for row in page.all("tr")]
    for table in paper_tables((flown(),), ("seq.h5",)):
        assert list(table.head) in shown
        assert [list(row) for row in table.rows if list(row) in shown] == [list(row) for row in table.rows]


def test_everything_counted_is_listed_once() -> None:
    """Each statistic is a row, but for standard errors, which stand beside their values."""
    listed = [row for table in all_statistics(flown()) for row in table.rows]
    quantities = [key for group in FLIGHT.values() for key in group if "standard_error" not in key]
    assert len(listed) == len(quantities)
    assert ("distance", "594.87 ± 0.02 m") in listed
    assert ("angular speed max", "1.233 ± 0.004 rad/s") in listed


@pytest.mark.parametrize(
    ("key", "name", "unit"),
    [
        ("speed_max_m_s", "speed max", "m/s"),
        ("event_rate_mean_per_s", "event rate mean", "1/s"),
        ("variance_px2", "variance", "px²"),
        ("flow/10hz_hz", "flow/10hz", "Hz"),
        ("windows", "windows", ""),
        ("brightness_mean_dn", "brightness mean", "DN"),
    ],
)
def test_units_come_from_names(key: str, name: str, unit: str) -> None:
    """The ending of a statistic's name is its unit."""
    assert split_unit(key) == (name, unit)


@settings(max_examples=25, deadline=None)
@given(
    st.floats(-1e6, 1e6),
    st.floats(1e-6, 1e3),
    st.floats(-1e6, 1e6),
    st.floats(1e-6, 1e6),
    st.integers(0, 100),
)
def test_measurements_are_shown_as_the_record_words_them(
    value: float, error: float, expected: float, limit: float, seen: int
) -> None:
    """Value, error, expected, limit, least detectable and coverage agree with the record, in row and details."""
    one = Measurement("offset", value, "ms", error, expected, limit, 2 * limit)
    result = replace(passed(), measurements=(one,), coverage=Coverage(seen, 100, "frames"))
    page = page_of(file_record(result))
    words = [with_error(value, error, "ms"), with_unit(expected, "ms"), f"±{with_unit(limit, 'ms')}"]
    least = with_unit(2 * limit, "ms")
    assert ["offset", *words, least] in [cells(row)[:5] for row in page.all("tr")]
    (summary,) = [part for part in page.all("summary") if any(one.text == "clocks.order" for one in part.inside)]
    row = " ".join(summary.text.split())
    for part in (*words, least, coverage_words(result.coverage)):
        assert part in row


@pytest.mark.parametrize(("side", "limit"), [("both", "±1.5 ms"), ("upper", "+1.5 ms"), ("lower", "−1.5 ms")])
def test_limit_tells_which_side_counts(side: str, limit: str) -> None:
    """A one-sided limit has a sign."""
    one = Measurement("offset", 0.0, "ms", 0.1, 0.0, 1.5, 2.0, side)  # type: ignore[arg-type]
    page = page_of(file_record(replace(passed(), measurements=(one,))))
    assert ["offset", "0.00 ± 0.10 ms", "0 ms", limit, "2 ms"] in [cells(row)[:5] for row in page.all("tr")]


def test_verdict_counts_what_the_record_holds() -> None:
    """The bar holds each outcome by its share, gravest first, and fills the width."""
    words = verdict_of(file_record(passed("a.b"), passed("c.d"), failed(), not_observable()))
    assert [(one.outcome, one.count, one.left, one.width) for one in words.shares] == [
        ("failed", 1, 0.0, 0.25),
        ("passed", 2, 0.25, 0.5),
        ("not_observable", 1, 0.75, 0.25),
    ]


@pytest.mark.parametrize(
    ("file", "title", "sentence"),
    [
        (file_record(passed()), "Passed", "No check found a deviation from a correct file."),
        (
            file_record(passed(), immaterial()),
            "Passed",
            "No check found a deviation that matters; 1 is measurable and not material.",
        ),
        (file_record(failed()), "Failed", "1 check failed; no cause could be named."),
        (
            file_record(failed(), passed(), diagnoses=(late_events(),)),
            "Failed",
            "1 check failed; one probable cause is named.",
        ),
        (
            file_record(failed(), crashed()),
            "Incomplete",
            "No verdict can be given: crashed: imu.noise. 1 check failed.",
        ),
    ],
)
def test_verdict_is_one_sentence(file: FileRecord, title: str, sentence: str) -> None:
    """The verdict stands on top with the sentence that says why."""
    page = page_of(file)
    assert (verdict_of(file).title, verdict_of(file).sentence) == (title, sentence)
    assert page.text.index(sentence) < page.text.index("How to read this")


def test_diagnosis_has_cause_size_remedy_and_findings() -> None:
    """What is wrong is said in one sentence, with what to do about it and what it explains."""
    (cause,) = page_of(file_record(failed(), diagnoses=(late_events(),))).all("article", kind="cause")
    text = " ".join(cause.text.split())
    for part in (
        "events: timestamps are late by a constant, 2.06 ± 0.03 ms",
        "Subtract the offset from the stamps.",
        "events, 0 s to 2 s",
        "events:time_offset",
        "confirmed: undoing it clears 1 of 1 finding in 4 windows",
        "Explains F1",
    ):
        assert part in text.replace("Explains", "Explains ")
    assert "F2" not in text


def test_a_finding_that_two_causes_explain_is_shown_once() -> None:
    """It stands in the list of findings; both causes lead to it, and it leads to both."""
    causes = (late_events(), replace(late_events(), id="D2"))
    page = page_of(file_record(failed(), diagnoses=causes))
    first, second = page.all("article", kind="cause")
    for cause in (first, second):
        assert "#file-0-finding-0" in [one.attributes.get("href") for one in cause.inside if one.tag == "a"]
    (finding,) = [one for one in page.all("article", kind="finding") if one.attributes["id"] == "file-0-finding-0"]
    led_to = [one.attributes.get("href") for one in finding.inside if one.tag == "a"]
    assert {"#file-0-cause-0", "#file-0-cause-1"} <= set(led_to)


def test_findings_that_nothing_explains_are_apart() -> None:
    """Where no cause is known the heading says so, and else the finding itself; what only warns is a remark."""
    page = page_of(file_record(failed()))
    assert "Findings, of which no cause is known" in page.text
    remarks = next(one for one in page.all("section", kind="remarks"))
    assert "The frames are dark." in remarks.text
    assert "late" not in remarks.text


def test_every_outcome_is_explained() -> None:
    """The glossary has a word for each outcome."""
    text = page_of(file_record(passed())).text
    glossary = text[text.rindex("How to read this") :]
    assert [word for word in OUTCOME_WORDS.values() if word not in glossary] == []

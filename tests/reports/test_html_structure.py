"""The report is one well-formed page that asks for nothing beyond itself."""

import base64
import hashlib
from dataclasses import replace
from itertools import pairwise

import pytest

from fedora_qa.record.types import Canary, FileRecord, Finding, Outcome, Record, Result, Where
from fedora_qa.record.wording import cause_sentence
from fedora_reports.html import render_html, report_script
from fedora_reports.page import TITLES
from tests.reports.evidence_samples import all_kinds, timeline
from tests.reports.page_reader import ReadPage, complaints_about, read_page
from tests.support.records import crashed, failed, file_record, late_events, not_observable, passed, record


@pytest.fixture(scope="module")
def page() -> ReadPage:
    """The report of a file with every kind of result and evidence."""
    file = file_record(failed(), passed(), crashed(), not_observable(), diagnoses=(late_events(),))
    return read_page(render_html(record(file), all_kinds()))


def test_page_is_whole(page: ReadPage) -> None:
    """Ids are unique, links lead somewhere, pictures have words and captions, and nothing is asked for."""
    assert complaints_about(page) == []


def test_complaints_can_be_made() -> None:
    """The reader sees what it is to see."""
    bad = (
        "<body><p id='a'></p><p id='a'></p><img src='http://x/y.png' alt=''><a href='#b'>x</a><script></script></body>"
    )
    assert set(complaints_about(read_page(bad))) == {
        "id a occurs twice",
        "request: http://x/y.png",
        "a picture without words",
        "a picture without caption",
        "no place #b",
        "script",
    }


@pytest.mark.parametrize("html", ["<p><b></p></b>", "<div>", "</div>", "<p/>", "<p id='a' id='b'></p>"])
def test_reader_refuses_what_is_not_well_formed(html: str) -> None:
    """An element left open, closed twice, or with an attribute twice is an error."""
    with pytest.raises(ValueError, match="Expected"):
        read_page(html)


def test_policy_names_the_only_script(page: ReadPage) -> None:
    """The page's own policy allows its style, pictures that it carries, and one script by its digest, nothing else."""
    (script,) = page.all("script")
    assert script.text == report_script()
    digest = base64.b64encode(hashlib.sha256(script.text.encode()).digest()).decode()
    policies = [one.attributes.get("content") for one in page.all("meta")
                if one.attributes.get("http-equiv") == "Content-Security-Policy"]  # fmt: skip
    assert policies == [
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'"
    ]


def test_headings_step_down_one_by_one(page: ReadPage) -> None:
    """One first heading, and none that skips a level."""
    levels = [int(one.tag[1]) for one in page.elements if one.tag in {"h1", "h2", "h3", "h4", "h5", "h6"}]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(deeper <= level + 1 for level, deeper in pairwise(levels))


def test_tables_name_their_columns(page: ReadPage) -> None:
    """Each table has a caption, and each of its headings says whether it heads a column or a row."""
    assert page.all("table")
    for table in page.all("table"):
        assert any(one.tag == "caption" and one.text.strip() for one in table.inside)
        assert {one.attributes.get("scope") for one in table.inside if one.tag == "th"} <= {"col", "row"}


def test_failed_checks_are_open_and_passed_ones_are_not(page: ReadPage) -> None:
    """Details of what failed, crashed or warned are seen at once."""
    opened = {}
    for one in page.all("details", kind="check"):
        name = next(part.text for part in one.inside if part.tag == "b")
        opened[name] = "open" in one.attributes
    assert opened == {"event_response.timing": True, "clocks.order": False, "imu.noise": True, "imu.timing": False}


def test_strip_shows_the_streams_beside_each_other(page: ReadPage) -> None:
    """Three moments, one place and two frames beside it, each with all streams; first what a trial changed."""
    names = [next(part.text for part in one.inside if part.tag == "b") for one in page.all("figure", kind="panel")]
    assert names == ["Events"] * 2 + ["Colour frame", "Events", "Depth", "Flow", "Residual of flow"] * 6


def test_missing_flow_is_said(page: ReadPage) -> None:
    """A picture without any value has a caption that says so."""
    flows = [one.text for one in page.all("figcaption") if one.text.startswith("Flow ")]
    assert flows.count("Flow none here") == 2  # of the last moment, which is also the frame after the place


def test_finding_is_marked_on_the_timeline(page: ReadPage) -> None:
    """The mark leads to the finding and stands for its whole time."""
    marks = {one.inside[0].text: one for one in page.all("a", kind="mark")}
    mark = marks["F1: Events are 2.06 ± 0.03 ms late."]
    (target,) = [one for one in page.elements if one.attributes.get("id") == (mark.attributes["href"] or "")[1:]]
    assert "Events are 2.06 ± 0.03 ms late." in target.text
    span = next(one for one in mark.inside if one.tag == "rect")
    assert (span.attributes["x"], span.attributes["width"]) == ("0.00%", "100.00%")


def test_box_lies_where_the_finding_is_worst(page: ReadPage) -> None:
    """The box of the evidence is drawn over every picture of the place, in its shares."""
    boxes = [one.attributes for one in page.all("rect", kind="edge")]
    assert len(boxes) == 3 * 5
    assert {(box["x"], box["y"], box["width"], box["height"]) for box in boxes} == {("0.0", "0.0", "0.5", "0.5")}


def test_several_files_have_an_overview_and_sections_of_their_own() -> None:
    """Each file is linked from a table, and its evidence is found by its place in the record."""
    first = file_record(passed(), path="a/one.h5")
    second = file_record(failed(), path="a/two.h5", diagnoses=(late_events(),))
    arrays = {f"1/{name}": array for name, array in all_kinds().items()}
    page = read_page(render_html(record(first, second), arrays))
    assert complaints_about(page) == []
    assert [one.attributes["id"] for one in page.all("section", kind="file")] == ["file-0", "file-1"]
    (overview,) = page.all("table", kind="files")
    assert [one.text for one in overview.inside if one.tag == "a"] == ["one.h5", "two.h5"]
    sections = {one.attributes["id"]: one for one in page.all("section", kind="file")}
    panels = {name: sum(part.tag == "figure" for part in one.inside) for name, one in sections.items()}
    assert panels["file-0"] == 0
    assert panels["file-1"] > 0


def test_same_name_in_two_folders_is_told_apart() -> None:
    """Files of one name are shown with their folders."""
    page = read_page(render_html(record(file_record(path="a/x.h5"), file_record(path="b/x.h5")), {}))
    (overview,) = page.all("table", kind="files")
    assert [one.text for one in overview.inside if one.tag == "a"] == ["a/x.h5", "b/x.h5"]


def release(*sequences: FileRecord, rule: Outcome = "passed") -> Record:
    """The record of a gate over sequences in the folder ``out/v2``."""
    itself = file_record(Result("release.totals", rule, "Is it all there?"), path="out/v2")
    return record(*sequences, itself)


def test_a_gate_opens_with_the_verdict_of_the_release() -> None:
    """The gravest verdict of all, how many sequences have which, and a row a sequence with its folders and cause."""
    clean = file_record(passed(), path="out/v2/test/one.h5")
    late = file_record(failed(), path="out/v2/train/two.h5", diagnoses=(late_events(),))
    unnamed = file_record(failed(), path="out/v2/train/three.h5")
    page = read_page(render_html(release(clean, late, unnamed), {}))
    assert complaints_about(page) == []
    (opening, *_) = page.all("div", kind="verdict")
    words, classes = opening.text, opening.attributes["class"] or ""
    assert "is-findings" in classes
    assert TITLES["findings"] in words
    assert page.all("h1")[0].text == "Release v2"
    assert "3 sequences: 2 with findings, 1 clean. The release itself: 1 passed." in words
    (overview,) = page.all("table", kind="files")
    names = [part.text for part in overview.inside if part.tag == "a"]
    assert names == ["test/one.h5", "train/two.h5", "train/three.h5", "the release itself"]
    rows = [part.text for part in overview.inside if part.tag == "tr"]
    assert cause_sentence(late_events()) in rows[2]
    assert failed().findings[0].message in rows[3]


def test_sequences_have_sparklines_and_leaks_both_places() -> None:
    """A row shows the sequence over time with its failures; a leak is stated before any sequence, with a link."""
    message = "Expected splits that do not leak, got 12 of the poses of train/two.h5"
    leak = Finding("R1", "release.splits.leak", "error", message, Where(start_us=0.0, stop_us=1e6))
    sequence = file_record(failed(), Result("release.splits", "failed", "Leak?", findings=(leak,)), path="out/v2/a.h5")
    arrays = {f"0/{name}": array for name, array in timeline().items()}
    page = read_page(render_html(release(sequence, file_record(path="out/v2/train/two.h5")), arrays))
    assert complaints_about(page) == []
    (line,) = page.all("svg", kind="sparkline")
    assert line.attributes["aria-label"] == "events over time; upright lines: where failures begin"
    # The failure of F1 spans all of it, the leak the first half.
    (marks,) = (part.attributes["d"] for part in line.inside if part.attributes.get("class") == "crowd")
    assert marks == "M0 100V0M0 100h1000M0 100V0M0 100h500"
    (leaks,) = page.all("ul", kind="leaks")
    assert message in leaks.text
    assert [part.attributes["href"] for part in leaks.inside if part.tag == "a"] == ["#file-0-finding-1"]


@pytest.mark.parametrize(("rule", "verdict"), [("passed", "clean"), ("failed", "findings")])
def test_a_rule_about_the_release_decides_as_well(rule: Outcome, verdict: str) -> None:
    """Clean sequences are no clean release where a rule about it is broken."""
    page = read_page(render_html(release(file_record(passed(), path="out/v2/one.h5"), rule=rule), {}))
    (opening, *_) = page.all("div", kind="verdict")
    assert f"is-{verdict}" in (opening.attributes["class"] or "")


def test_a_record_of_no_gate_has_no_release() -> None:
    """Files of a check, and files outside of the folder that comes last, are no release."""
    for files in (record(file_record(), file_record(path="b.h5")), release(file_record(path="elsewhere/one.h5"))):
        assert "The release itself" not in render_html(files, {})


def test_report_is_deterministic() -> None:
    """The same record gives the same bytes."""
    digests = {hashlib.sha256(render_html(record(), all_kinds()).encode()).hexdigest() for _ in range(2)}
    assert len(digests) == 1


def test_arrays_that_are_not_given_are_missed() -> None:
    """A record whose arrays are gone says so, and is shown without pictures."""
    page = read_page(render_html(record(), {}))
    assert "The arrays that lay beside the record were not given" in page.text
    assert not page.all("img")


def test_nothing_promised_is_nothing_missing() -> None:
    """A record without evidence says that none was kept."""
    bare = replace(file_record(passed()), evidence={})
    assert "No evidence was kept of this file" in read_page(render_html(record(bare), {})).text


def test_canaries_are_said_beside_what_the_verdict_rests_on() -> None:
    """One sentence where canaries were planted, none where not."""
    plain = file_record(passed())
    proven = replace(plain, canaries=(Canary("clocks.order", "silent", "exchanged", 1),))
    said = "Canaries seen by 0 of 1 checks; not seen by clocks.order."
    assert said in render_html(record(proven), {})
    assert said not in render_html(record(plain), {})

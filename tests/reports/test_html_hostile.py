"""Whatever a file holds is shown as text, and no record is too strange for a page."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from fedora_qa.record.latex import LATEX_NEEDS
from fedora_qa.record.types import Finding, Result, Where
from fedora_reports.html import render_html
from tests.reports.evidence_samples import all_kinds, moments, timeline
from tests.reports.hostile_records import MARKUP, files
from tests.reports.page_reader import complaints_about, read_page
from tests.support.latex_reader import read_latex
from tests.support.records import crashed, failed, file_record, late_events, passed, record

KNOWN_TAGS = {one.tag for one in read_page(render_html(record(), all_kinds())).elements} | {"pre", "nav"}


@settings(max_examples=40, deadline=None)
@given(st.lists(files, max_size=2))
def test_every_record_gives_a_whole_page(hostile: list[Any]) -> None:
    """Any record within its types becomes a well-formed page with sound links, and only tags of our own."""
    page = read_page(render_html(replace(record(), files=tuple(hostile)), {}))
    assert complaints_about(page) == []
    assert {one.tag for one in page.elements} <= KNOWN_TAGS


@pytest.mark.parametrize("text", MARKUP[:-1])
def test_markup_from_a_file_is_text(text: str) -> None:
    """A path, a message, a title or a statistic that looks like markup or a template is shown letter by letter."""
    finding = Finding(text, text, "error", text, Where(stream=text))
    result = replace(failed(), check=text, question=text, reason=text, traceback=text, findings=(finding,))
    diagnosis = replace(late_events(), id=text, stream=text, unit=text, remedy=text, explains=(text,))
    file = replace(
        file_record(result, path=text, diagnoses=(diagnosis,)),
        dialect=text,
        inferred={text: text},
        statistics={text: {text: text}, "sequence": {"duration_s": 1.0}},
        evidence=dict.fromkeys(all_kinds(), text),
    )
    html = render_html(record(file), all_kinds() | {text: np.zeros((2, 2))})
    page = read_page(html)
    assert complaints_about(page) == []
    assert {one.tag for one in page.elements} <= KNOWN_TAGS
    assert page.all("h1")[0].text in {text, text.rsplit("/", maxsplit=1)[-1]}
    assert page.text.count(text) >= 10
    copies = [button.attributes.get("data-copy") or "" for button in page.all("button")]
    tables = [table for copy in copies if copy.startswith(LATEX_NEEDS) for table in read_latex(copy)]
    assert [len(table.rows) for table in tables] == [2]


def test_controls_and_turned_directions_are_shown_as_replacements() -> None:
    """NUL, escape sequences and right-to-left overrides neither reach the page nor hide what follows."""
    html = render_html(record(file_record(passed(), path="a\x00b\x1b[2J\u202ec\udcff.h5")), {})
    assert not {"\x00", "\x1b", "\u202e", "\udcff"} & set(html)
    assert "c\\udcff.h5" in read_page(html).all("h1")[0].text


def test_no_file_gives_a_page() -> None:
    """A record of no files says so."""
    page = read_page(render_html(replace(record(), files=()), {}))
    assert complaints_about(page) == []
    assert page.all("h1")[0].text == "No file was checked"


def test_unreadable_file_gives_a_page() -> None:
    """A file that cannot be opened has one failed check, no statistics and no pictures; the page says all that."""
    broken = Result("integrity.readable", "failed", "Can it be read?", findings=(
        Finding("F1", "integrity.readable.open", "critical", "The file cannot be opened: truncated.", Where()),
    ))  # fmt: skip
    file = replace(file_record(broken), statistics={}, evidence={}, dialect="", inferred={})
    page = read_page(render_html(record(file), {}))
    assert complaints_about(page) == []
    for words in ("The file cannot be opened", "No statistics were taken", "No evidence was kept", "not recognised"):
        assert words in page.text


def test_no_check_gives_a_page() -> None:
    """A file of which nothing was asked says that no check was run."""
    page = read_page(render_html(record(replace(file_record(), verdict="incomplete")), {}))
    assert "No check was run." in page.text


def test_traceback_of_a_crash_is_kept_line_by_line() -> None:
    """A crashed check shows its traceback, and the verdict names it."""
    page = read_page(render_html(record(file_record(passed(), crashed())), {}))
    (trace,) = page.all("pre")
    assert trace.text.splitlines() == ["Traceback (most recent call last):", "ZeroDivisionError: division by zero"]
    assert "No verdict can be given: crashed: imu.noise." in page.text


def test_two_hundred_findings_are_all_there() -> None:
    """Every finding has its article and most stand folded; the timeline counts those that found no room."""
    many = tuple(
        Finding(f"F{k}", "x.y", "error", f"Finding number {k}.", Where("events", 1e4 * k, 1e4 * k + 5e5))
        for k in range(200)
    )
    file = file_record(replace(failed(), findings=many))
    page = read_page(render_html(record(file), timeline()))
    assert complaints_about(page) == []
    articles = page.all("article", kind="finding")
    assert [one.attributes["id"] for one in articles] == [f"file-0-finding-{k}" for k in range(200)]
    marked = len(page.all("a", kind="mark"))
    assert 4 <= marked < 200
    assert f"and {200 - marked} more findings" in page.text


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, 3.4e38])
def test_evidence_of_one_value_is_drawn(value: float) -> None:
    """Pictures that hold nothing, or one value everywhere, break nothing."""
    flat = {
        name: np.full(array.shape, value, _of_range(array, value)) if array.dtype.kind == "f" else np.zeros_like(array)
        for name, array in all_kinds().items()
    }
    assert complaints_about(read_page(render_html(record(), flat))) == []


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_malformed_evidence_is_left_out(data: st.DataObject) -> None:
    """An array of any other shape or type than promised costs its own picture only."""
    arrays = all_kinds()
    for name in data.draw(st.lists(st.sampled_from(sorted(arrays)), min_size=1, max_size=4)):
        arrays[name] = data.draw(_any_array())
    page = read_page(render_html(record(), arrays))
    assert complaints_about(page) == []
    assert "Events are 2.06 ± 0.03 ms late." in page.text


def test_one_pixel_and_one_moment_are_enough() -> None:
    """The smallest pictures are pictures."""
    tiny = {
        name: array[:1, :1, :1] if array.ndim > 2 else array[:1]
        for name, array in moments().items()
    }  # fmt: skip
    page = read_page(render_html(record(), tiny))
    assert complaints_about(page) == []
    assert len(page.all("figure", kind="panel")) == 5


def _of_range(array: NDArray[Any], value: float) -> np.dtype[Any]:
    """The array's own type, or a wider one where that cannot hold the value."""
    held = not np.isfinite(value) or value <= float(np.finfo(array.dtype).max)
    return array.dtype if held else np.dtype(np.float32)


def _any_array() -> st.SearchStrategy[NDArray[Any]]:
    kinds = st.sampled_from([np.float32, np.float64, np.uint8, np.int64, np.complex128, np.bool_, "U3"])
    shapes = npst.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5)
    return kinds.flatmap(lambda kind: npst.arrays(kind, shapes))

"""The report can be read by everybody: no rule of axe-core is broken seriously."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from fedora_qa.comparison.subjects import SharedEvidence
from fedora_qa.record.types import Finding, Result, Where
from fedora_reports.comparison import render_comparison
from fedora_reports.html import render_html
from tests.browser.audit import axe_script, violations
from tests.browser.devtools import Browser
from tests.browser.sample_page import write_sample
from tests.browser.tab import Tab
from tests.comparison.test_compare import versions
from tests.reports.evidence_samples import all_kinds
from tests.support.records import failed, file_record, record


@pytest.fixture(scope="module")
def script() -> str:
    """The audit."""
    return axe_script()


@pytest.fixture(scope="module")
def browser(chromium: Path) -> Iterator[Browser]:
    """A browser for all tests."""
    with Browser(chromium) as running:
        yield running


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with every kind of part, and of each no more than the audit needs."""
    return write_sample(tmp_path_factory.mktemp("audit") / "report.html", findings=13)


@pytest.mark.parametrize(("width", "scheme", "look"), [(390, "light", "js"), (1200, "dark", "js"), (1200, "light", "")])
def test_report_breaks_no_rule_seriously(
    browser: Browser, page: Path, script: str, width: int, scheme: str, look: str
) -> None:
    """Phone and laptop, light and dark, as it looks with and without scripts, everything unfolded."""
    with Tab(browser, page, width=width, scheme=scheme) as tab:
        # The audit needs scripts itself, so that only the look of a page without them can be audited.
        tab.evaluate(f"document.documentElement.className = '{look}'")
        tab.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
        assert violations(tab, script) == {}


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1440, "light")])
def test_comparison_and_release_break_no_rule_seriously(
    browser: Browser, tmp_path: Path, script: str, width: int, scheme: str
) -> None:
    """Frames and paths beside each other, and a release with sparklines and a leak, everything unfolded."""
    shared = [SharedEvidence("a.h5", (all_kinds(), all_kinds()))]
    leak = Finding("R1", "release.splits.leak", "error", "Got the same rgb.", Where(start_us=0.0, stop_us=1e6))
    results = (failed(), Result("release.splits", "failed", "Is it unlike the others?", findings=(leak,)))
    sequences = [file_record(*results, path=f"v2/{name}.h5") for name in "ab"]
    itself = file_record(Result("release.totals", "passed", "Is it all there?"), path="v2")
    arrays = {f"0/{name}": array for name, array in all_kinds().items()}  # the pictures of one sequence are alike
    pages = {
        "comparison.html": render_comparison(versions(), shared),
        "release.html": render_html(record(*sequences, itself), arrays),
    }
    for name, html in pages.items():
        (tmp_path / name).write_text(html, encoding="utf-8")
        with Tab(browser, tmp_path / name, width=width, scheme=scheme) as tab:
            tab.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
            assert violations(tab, script) == {}
            assert tab.complaints == []


def test_the_audit_can_fail(browser: Browser, tmp_path: Path, script: str) -> None:
    """A picture without words, a field without a label and grey on grey are seen."""
    (tmp_path / "bad.html").write_text(
        "<!DOCTYPE html><html lang='en'><title>Bad</title><main><h1>Bad</h1><img src='data:,'><input>"
        "<p style='color: #bbb; background: #ccc'>pale</p></main></html>"
    )
    with Tab(browser, tmp_path / "bad.html") as tab:
        assert {"image-alt", "label", "color-contrast"} <= set(violations(tab, script))

"""The report of a comparison in a real browser: no complaint, no request, nothing wider than the window."""

from pathlib import Path

import pytest

from fedora_qa.comparison.subjects import SharedEvidence
from fedora_reports.comparison import render_comparison
from tests.browser.devtools import Browser
from tests.browser.visit import visit
from tests.comparison.test_compare import versions
from tests.reports.evidence_samples import all_kinds


def test_comparison(chromium: Path, tmp_path: Path) -> None:
    """Phone and laptop, light and dark: all of it is visible, and said in words too."""
    page = tmp_path / "comparison.html"
    shared = [SharedEvidence(f"{name}.h5", (all_kinds(), all_kinds())) for name in ("a", "b")]
    page.write_text(render_comparison(versions(), shared), encoding="utf-8")
    with Browser(chromium) as browser:
        for width, scheme in ((390, "light"), (1440, "dark")):
            shown = visit(browser, page, width=width, scheme=scheme)
            assert shown.complaints == []
            assert shown.requests == [page.resolve().as_uri()]
            assert shown.seen["sticking_out"] == []
            assert all(shown.seen["captions"])
            assert "1 differs" in shown.seen["text"]
            assert len(shown.seen["pictures"]) >= 2 * 3 * 4 * 2
            boxes = shown.seen["drawings"] + shown.seen["tables"]
            assert all(across > 0 and down > 0 for across, down in boxes)


@pytest.mark.parametrize("name", ["comparison.html.j2", "comparison.css"])
def test_templates_ask_for_nothing(name: str) -> None:
    """No script, font, picture or sheet is loaded; the script of the reports stands in the page."""
    text = (Path(__file__).parents[2] / "reports" / "fedora_reports" / "templates" / name).read_text(encoding="utf-8")
    assert not any(word in text for word in ("<script ", "url(", "@import", "http://", "https://"))

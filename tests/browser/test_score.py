"""The page of a score in a real browser: no complaint, no request, nothing wider than the window."""

from pathlib import Path

from fedora_qa.engine.progress import quiet
from fedora_qa.scoring.score import score_sequence
from fedora_reports.score import render_score
from tests.browser.devtools import Browser
from tests.browser.visit import visit
from tests.support.predictions import write_truth


def test_score(chromium: Path, tmp_path: Path) -> None:
    """Phone and laptop, light and dark: all of it is visible."""
    page, sequence = tmp_path / "score.html", write_truth(tmp_path / "seq.h5")
    page.write_text(render_score(score_sequence(sequence, sequence, None, None, (), quiet)), encoding="utf-8")
    with Browser(chromium) as browser:
        for width, scheme in ((390, "light"), (1440, "dark")):
            shown = visit(browser, page, width=width, scheme=scheme)
            assert shown.complaints == []
            assert shown.requests == [page.resolve().as_uri()]
            assert shown.seen["sticking_out"] == []
            assert all(shown.seen["captions"])
            assert "Flow at 50 Hz" in shown.seen["text"]
            boxes = shown.seen["drawings"] + shown.seen["tables"]
            assert len(boxes) > 6
            assert all(across > 0 and down > 0 for across, down in boxes)

"""A report stays small enough to be sent, whatever it is of."""

import pytest

from fedora_reports import trajectory
from fedora_reports.html import render_html
from tests.reports.long_sequence import FINDINGS, long_arrays, long_record

MOST_BYTES = 6_000_000


def test_half_an_hour_with_a_thousand_findings_stays_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of pure noise, all of them that are ever kept, and every finding: at most 6 MB, and nothing is lost."""
    largest = trajectory.TrajectoryPicture(b"\0" * 400_000, "Path.", "")
    monkeypatch.setattr(trajectory, "render_trajectory", lambda *_: largest)
    arrays = long_arrays()
    html = render_html(long_record(arrays), arrays)
    assert len(html.encode()) <= MOST_BYTES
    assert html.count('<article class="finding item"') == FINDINGS

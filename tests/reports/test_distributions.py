"""Distributions on a logarithmic axis show what was counted, by octaves."""

import re

import numpy as np
import pytest

from fedora_reports.charts import HEIGHT
from fedora_reports.distributions import distributions_of
from fedora_reports.evidence import Evidence
from tests.reports.evidence_samples import distributions, histograms

EDGES, COUNTS = "distributions/pixel_interval_ms/edges", "distributions/pixel_interval_ms/counts"


def test_counts_of_all_blocks_are_drawn_by_octave() -> None:
    """4, 4 and 4 in an octave each are equally high; what lies below the first octave is told, not drawn."""
    (chart,) = distributions_of(Evidence(distributions(), {}))
    tops = [float(y) for y in re.findall(r"L[\d.]+ ([\d.]+)H", chart.path)]
    assert tops == [0.0, 0.0, 0.0]
    assert (chart.highest, chart.up) == ("4", "number an octave")
    assert "1 below are not drawn" in chart.across
    assert "from 1 to 8" in chart.alt


def test_wide_bins_are_not_taller_for_it() -> None:
    """A bin of two octaves with twice the count is as high as one of one octave."""
    arrays = {EDGES: np.array([1.0, 2.0, 8.0]), COUNTS: np.array([[3, 6]])}
    (chart,) = distributions_of(Evidence(arrays, {}))
    assert chart.path.count(f" {HEIGHT - 100.0:.1f}H") == 2


def test_histograms_come_first() -> None:
    """Flow, depth and light, then events."""
    charts = distributions_of(Evidence(distributions() | histograms(), {}))
    assert [chart.title for chart in charts] == [
        "histograms/depth_m/counts",
        "Times between events of a pixel up to 100 ms, ms",
    ]


@pytest.mark.parametrize(
    "changed",
    [
        {EDGES: np.array([1.0, 1.0, 2.0, 4.0, 8.0])},
        {EDGES: np.array([0.0, np.nan, 2.0, 4.0, 8.0])},
        {EDGES: np.array([0.0, 1.0])},
        {COUNTS: np.zeros((2, 4))},
        {COUNTS: np.array([[5, 0, 0, 0]])},
        {COUNTS: np.array([[np.inf, 0, 1, 2]])},
        {COUNTS: np.array([[-1, 0, 1, 2]])},
    ],
)
def test_what_cannot_be_drawn_is_left_out(changed: dict[str, np.ndarray]) -> None:
    """Edges that do not rise, counts of another shape, of nothing, or of no number."""
    assert distributions_of(Evidence(distributions() | changed, {})) == ()

"""Charts show the numbers that the evidence holds."""

import re

import numpy as np
import pytest

from fedora_reports.charts import HEIGHT, WIDTH, distributions_of, histograms_of, series_chart
from fedora_reports.evidence import Evidence
from tests.reports.evidence_samples import distributions, histograms

EDGES, COUNTS = "distributions/pixel_interval_ms/edges", "distributions/pixel_interval_ms/counts"


def histogram(edges: list[float], counts: list[int]) -> Evidence:
    """Evidence with one histogram."""
    arrays = {"histograms/depth_m/edges": np.array(edges), "histograms/depth_m/counts": np.array(counts)}
    return Evidence(arrays, {"histograms/depth_m/counts": "Pixels by depth, m"})


def test_bars_stand_where_their_bins_are() -> None:
    """Each bar is as wide as its bin and as high as its count; the highest fills the drawing."""
    (chart,) = histograms_of(histogram([0.0, 1.0, 3.0, 4.0], [2, 4, 0]))
    assert chart.path == "M0.0 100L0.0 50.0H250.0L250.0 0.0H750.0L750.0 100.0H1000.0V100Z"
    assert (chart.highest, chart.title) == ("4", "Pixels by depth, m")
    assert "most between 1 and 3" in chart.alt


def test_growing_bins_have_a_logarithmic_axis() -> None:
    """Bins of equal ratio are drawn equally wide, and the caption says so."""
    (chart,) = histograms_of(histogram([1.0, 10.0, 100.0], [1, 1]))
    assert "H500.0" in chart.path
    assert chart.across == "logarithmic"


@pytest.mark.parametrize(
    ("edges", "counts"),
    [
        ([0.0, 1.0], [0]),
        ([0.0, 1.0], [1, 2]),
        ([1.0, 0.0, 2.0], [1, 2]),
        ([0.0, np.nan, 2.0], [1, 2]),
        ([1.0, 1.0], [3]),
    ],
)
def test_what_is_no_histogram_is_left_out(edges: list[float], counts: list[int]) -> None:
    """Empty, mismatched, falling, or undefined bins draw nothing."""
    assert histograms_of(histogram(edges, counts)) == ()


def test_series_breaks_where_a_point_is_missing() -> None:
    """The line runs from corner to corner and leaves out what is not finite."""
    chart = series_chart(np.array([[0.0, 5.0], [1.0, np.nan], [2.0, 7.0], [4.0, 9.0]]), "Offset; time [s]; offset [ms]")
    assert chart is not None
    assert chart.path == f"M0.0 {HEIGHT}.0M500.0 50.0L{WIDTH}.0 0.0"
    assert (chart.title, chart.across, chart.up) == ("Offset", "time [s]", "offset [ms]")
    assert (chart.lowest, chart.highest) == ("5", "9")


@pytest.mark.parametrize(
    ("title", "parts"),
    [
        ("Offset", ("Offset", "", "")),
        ("Offset; x time [s]; y offset [ms]", ("Offset", "time [s]", "offset [ms]")),
        ("Offset; x [px]; y [px]", ("Offset", "x [px]", "y [px]")),
        ("a; b; c; d", ("a; b; c; d", "", "")),
    ],
)
def test_title_names_the_axes(title: str, parts: tuple[str, str, str]) -> None:
    """A title in three parts names both axes; any other is a title."""
    chart = series_chart(np.zeros((2, 2)), title)
    assert chart is not None
    assert (chart.title, chart.across, chart.up) == parts


def test_series_without_any_number_is_not_drawn() -> None:
    """Nothing is drawn of nothing."""
    assert series_chart(np.full((3, 2), np.nan), "Offset") is None


def test_long_series_have_no_dots() -> None:
    """Hundreds of points are a line."""
    points = np.stack([np.arange(500.0), np.zeros(500)], axis=1)
    chart = series_chart(points, "Offset")
    assert chart is not None
    assert chart.dots == ""
    assert len(re.findall("[ML]", chart.path)) == 500


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

"""Distributions are drawn where they lie, in lines that can be told apart."""

import re
from importlib.resources import files

import numpy as np
import pytest

from fedora_qa.comparison.types import COMPARISON_VERSION, Comparison, Overlay, Subject
from fedora_qa.record.types import Tool
from fedora_reports.charts import HEIGHT, WIDTH
from fedora_reports.comparison import MOST_DRAWN, overlay_chart, page_of
from tests.reports.test_style import colours, contrast

CSS = (files("fedora_reports") / "templates" / "comparison.css").read_text(encoding="utf-8")


def comparison(*overlays: Overlay, subjects: int = 2) -> Comparison:
    """A comparison of so many subjects without files."""
    named = tuple(Subject(f"s{k}", ()) for k in range(subjects))
    return Comparison(COMPARISON_VERSION, Tool("fedora-qa", "0"), 0.01, 1, 0.01, named, overlays, (), (), ())


def depths(*shares: tuple[float, ...] | None, edges: tuple[float, ...] = (1.0, 2.0, 4.0, 16.0)) -> Overlay:
    return Overlay("depth_m", "Pixels by depth, m", "m", edges, shares)


def test_heights_are_shares_per_octave() -> None:
    """A bin of two octaves with half of the values is as high as one of one octave with a fourth of them."""
    one = depths((0.25, 0.25, 0.5), (0.0, 1.0, 0.0))
    chart = overlay_chart(one, comparison(one))
    assert chart is not None
    first, second = (re.findall(r"[ML]([\d.]+) ([\d.]+)H([\d.]+)", line.path) for line in chart.lines)
    assert [float(y) for _, y, _ in first] == [0.75 * HEIGHT] * 3
    assert [float(y) for _, y, _ in second] == [HEIGHT, 0.0, HEIGHT]
    assert [float(x) for x, _, _ in first] == pytest.approx([0, WIDTH / 4, WIDTH / 2])
    assert float(first[-1][2]) == WIDTH


def test_what_is_zero_lies_left_of_the_axis() -> None:
    """A logarithmic axis has no place for 0: its share is told in words."""
    one = depths((0.1, 0.4, 0.5), edges=(0.0, 1.0, 2.0, 4.0))
    chart = overlay_chart(one, comparison(one, subjects=1))
    assert chart is not None
    assert chart.aside == "At 0, left of the axis: s0 10.0%."
    assert (chart.ticks[0].label, chart.ticks[0].share) == ("1", 0.0)


def test_what_is_not_known_is_not_drawn() -> None:
    """A subject without the quantity has no line, a quantity that nobody has, or only 0, no chart."""
    one = depths(None, (0.5, 0.5, 0.0))
    chart = overlay_chart(one, comparison(one))
    assert chart is not None
    assert [line.place for line in chart.lines] == [1]
    for nothing in (depths(None, None), depths((1.0,), None, edges=(0.0, 1.0))):
        assert overlay_chart(nothing, comparison(nothing)) is None


def test_more_than_can_be_told_apart_are_named() -> None:
    """The seventh subject has no line, and the page says so."""
    many = depths(*((0.2, 0.3, 0.5) for _ in range(7)))
    page = page_of(comparison(many, subjects=7))
    assert len(page.charts[0].lines) == MOST_DRAWN
    assert page.undrawn == ("s6",)


def test_far_tails_do_not_flatten_the_rest() -> None:
    """A value in ten thousand beyond all others is beyond the axis too."""
    edges = tuple(2.0**k for k in range(13))
    shares = np.zeros(12)
    shares[[2, 3, 11]] = 0.5, 0.4999, 0.0001
    one = depths(tuple(float(share) for share in shares), edges=edges)
    chart = overlay_chart(one, comparison(one))
    assert chart is not None
    assert "from 4 to 16 m" in chart.alt


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_lines_stand_out(scheme: str) -> None:
    """Every line reaches 3 against the paper, as WCAG asks of graphics."""
    light, dark = (dict(re.findall(r"--(s\d): (#[0-9a-f]{6})", line)) for line in CSS.splitlines() if "--s0:" in line)
    lines = light if scheme == "light" else dark
    assert len(lines) == MOST_DRAWN
    assert all(contrast(colour, colours(scheme)["paper"]) >= 3 for colour in lines.values())

"""The report of a study shows its numbers, and draws curves where they are."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from fedora_qa.power.tables import power_of
from fedora_qa.record.power_study import CurvePoint, Power, tables_of
from fedora_reports.charts import HEIGHT, WIDTH
from fedora_reports.power import (
    band_path,
    curve_path,
    detection_chart,
    draw_power,
    drawing_of,
    limits_chart,
    page_of,
    render_power,
)
from fedora_reports.scales import Axis
from tests.reports.page_reader import PageReader
from tests.support.studies import ORIGIN, clean, faulty, study


@pytest.fixture(scope="module")
def power() -> Power:
    """A study of one cause."""
    return power_of(study(), ORIGIN)


def test_page_is_whole_and_asks_for_nothing(power: Power) -> None:
    """Every element is closed, nothing is fetched or run, and all tables stand in it, cell for cell."""
    html = render_power(power)
    reader = PageReader()
    reader.feed(html)
    reader.close()
    assert not re.search(r"(src|href)=\"(?!#|data:)", html)
    assert not any(one.tag == "script" for one in reader.elements)
    cells = [one.text for one in reader.elements if one.tag in {"td", "th"}]
    assert all(cell in cells for table in tables_of(power) for row in table.rows for cell in row)


def test_curve_stands_where_it_was_fitted(power: Power) -> None:
    """Half of the probability is drawn at half of the height, at the size found half of the time, inside its band."""
    curve, axis = power.detections[0].curve, Axis(0.1, 10.0, logarithmic=True)
    assert curve.at_50.value is not None
    point = CurvePoint(curve.at_50.value, 0.5, 0.3, 0.6)
    one = replace(curve, points=(point,))
    x = f"{axis.share(curve.at_50.value) * WIDTH:.1f}"
    assert curve_path(one, axis) == f"M{x} {HEIGHT / 2:.1f}"
    assert band_path(one, axis) == f"M{x} 40.0L{x} 70.0Z"


def test_every_group_of_sizes_is_a_dot(power: Power) -> None:
    """A dot and its interval stand for each share found."""
    chart = detection_chart(power.detections[0])
    assert chart is not None
    assert chart.dots.count("M") == chart.whiskers.count("M") == len(power.detections[0].tried)
    assert (chart.across, chart.level) == ("size in ms", pytest.approx(5.0))


def test_what_cannot_be_drawn_is_left_out() -> None:
    """A study of clean files, and of a fault without a size, has a page without drawings."""
    sizeless = tuple(
        replace(trial, item=replace(trial.item, faults=(replace(trial.item.faults[0], magnitude=None),)))
        for trial in study(trials=3)[1:]
    )
    page = page_of(power_of([clean(), *sizeless], ORIGIN))
    assert (page.charts, page.limits) == ((), None)
    assert limits_chart(()) is None
    assert "Detection power of the checks" in render_power(power_of([clean()], ORIGIN))


def test_limits_in_units_of_what_is_stated(power: Power) -> None:
    """A pair is one row, and the fair range ends at what is stated."""
    chart = limits_chart(power.stated)
    assert chart is not None
    assert (chart.height, chart.dots.count("M"), chart.path.count("M")) == (10, 1, 1)
    assert chart.fair[0] < chart.fair[1] < WIDTH


def test_names_from_a_manifest_are_text(power: Power) -> None:
    """A stream's name cannot become markup."""
    trial = study(trials=2)[1]
    fault = replace(trial.item.faults[0], stream="<b>events")
    html = render_power(power_of([clean(), faulty(1, fault)], ORIGIN))
    assert "<b>events" not in html
    assert "&lt;b&gt;events" in html


def test_drawing_is_whole_and_holds_every_curve(power: Power) -> None:
    """The SVG is well-formed, has a cell for each curve of the page with its name, and the pairs of stated limits."""
    root = ElementTree.fromstring(draw_power(power))
    texts = ["".join(one.itertext()) for one in root.iter("{http://www.w3.org/2000/svg}text")]
    page = page_of(power)
    assert {chart.title for chart in page.charts} <= set(texts)
    assert len(drawing_of(power).cells) == len(page.charts) == 1
    paths = [one.get("d") for one in root.iter("{http://www.w3.org/2000/svg}path")]
    assert page.limits is not None
    assert {page.charts[0].curve, page.limits.dots} <= set(paths)


def test_cells_do_not_overlap(power: Power) -> None:
    """Of nine curves each has a place of its own within the drawing, above the limits."""
    drawing = drawing_of(replace(power, detections=power.detections[:1] * 9))
    places = {(cell.x, cell.y) for cell in drawing.cells}
    assert len(places) == 9
    assert max(x for x, _ in places) < drawing.width
    assert max(y for _, y in places) < drawing.limits_top < drawing.height


def test_a_drawing_without_curves_is_a_drawing() -> None:
    """A study of clean files is drawn empty."""
    assert "<svg" in draw_power(power_of([clean()], ORIGIN))

"""A study of detection, drawn from the result of ``fedora-qa power``: as one HTML file, and its curves as one SVG file.

Curves of detection against size are drawn in the box of ``charts``: 1000 by 100, stretched. The SVG is for documents
that hold pictures and no HTML.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Final

from fedora_qa.record.power_study import (
    POWER,
    WHOLE_FILE,
    Curve,
    Detection,
    Power,
    StatedLimit,
    curve_words,
    share_words,
    tables_of,
)
from fedora_reports.charts import HEIGHT, WIDTH
from fedora_reports.html import environment
from fedora_reports.scales import Axis, Tick
from fedora_reports.statistics import Table

_ALMOST_SURE: Final = 0.95

_COLUMNS: Final = 4
_CELL_PX: Final = (240, 130)
_ROW_PX: Final = 4
"""Height of a pair of cause and check in the drawing of limits."""


@dataclass(frozen=True, slots=True)
class PowerChart:
    """Detection of one cause against its size: curve, its band, and the share of detected faults by size."""

    title: str
    caption: str
    curve: str
    band: str
    dots: str
    whiskers: str
    level: float
    ticks: tuple[Tick, ...]
    across: str
    alt: str


@dataclass(frozen=True, slots=True)
class LimitsChart:
    """The size of which 95% are detected, in units of the limit that each check states.

    A dot and a line stand for each pair of cause and check, one below another.
    """

    path: str
    dots: str
    height: int
    fair: tuple[float, float]
    ticks: tuple[Tick, ...]
    alt: str


@dataclass(frozen=True, slots=True)
class PowerPage:
    """Every value of the template."""

    title: str
    tool: str
    effort: str
    started: str
    facts: tuple[tuple[str, str], ...]
    tables: tuple[Table, ...]
    charts: tuple[PowerChart, ...]
    limits: LimitsChart | None
    not_comparable: Table


@dataclass(frozen=True, slots=True)
class PlacedChart:
    """A chart and the upper left corner of its cell, in px."""

    x: int
    y: int
    chart: PowerChart


@dataclass(frozen=True, slots=True)
class PowerDrawing:
    """Small charts in rows, and the drawing of limits beneath; sizes in px."""

    width: int
    height: int
    cells: tuple[PlacedChart, ...]
    limits: LimitsChart | None
    limits_top: int
    limits_height: int


def render_power(power: Power) -> str:
    """Return the report of a study as one HTML document, which runs no script and loads no other file."""
    return environment().get_template("power.html.j2").render(page=page_of(POWER.from_json(POWER.to_json(power))))


def draw_power(power: Power) -> str:
    """Return every fitted curve, and the chart of stated limits, as an SVG document."""
    return environment().get_template("power.svg.j2").render(drawing=drawing_of(POWER.from_json(POWER.to_json(power))))


def page_of(power: Power) -> PowerPage:
    """Return the page of a study."""
    facts = [
        ("Files", f"{power.files}, {power.clean} of them clean"),
        ("Clean files that failed", share_words(power.false_alarms.files)),
        *((f"{naming.kind} faults found".capitalize(), share_words(naming.found)) for naming in power.naming),
        *((f"{naming.kind} faults named first".capitalize(), share_words(naming.named_first))
          for naming in power.naming),
        ("Rules", power.ruleset_version),
        ("Code that was measured", f"sha256 {power.estimators_digest[:16]}"),
    ]  # fmt: skip
    if power.crashed:
        facts.append(("A check crashed in", ", ".join(power.crashed)))
    pairs = tuple((pair.cause, pair.check, pair.reason) for pair in power.not_comparable)
    note = "These checks find the cause, but state no limit that could be held against its size."
    charts = (detection_chart(row) for row in power.detections if row.check == WHOLE_FILE)
    return PowerPage(
        title=power.corpus,
        tool=f"{power.tool.name} {power.tool.version}",
        effort=power.effort,
        started=power.started,
        facts=tuple(facts),
        tables=tuple(
            Table(source.title, source.note, source.head, source.rows, numeric=source.words == 1)
            for source in tables_of(power)
        ),
        charts=tuple(chart for chart in charts if chart is not None),
        limits=limits_chart(power.stated),
        not_comparable=Table("Not compared", note, ("cause", "check", "why"), pairs, numeric=False),
    )


def drawing_of(power: Power) -> PowerDrawing:
    """Return the charts with their positions."""
    page, (across, down) = page_of(power), _CELL_PX
    curves = [chart for chart in page.charts if chart.curve]
    cells = tuple(PlacedChart(across * (k % _COLUMNS), down * (k // _COLUMNS), chart) for k, chart in enumerate(curves))
    top = down * -(-len(cells) // _COLUMNS)
    rows = page.limits.height // 10 if page.limits else 0
    beneath = rows * _ROW_PX + 70 if rows else 0
    return PowerDrawing(across * _COLUMNS, max(top + beneath, down), cells, page.limits, top, rows * _ROW_PX)


def detection_chart(detection: Detection) -> PowerChart | None:
    """Draw the detection of one cause; None where faults have no size, or all have the same."""
    if len({part.least for part in detection.tried}) < 2:
        return None
    axis = Axis(detection.tried[0].least, detection.tried[-1].most, logarithmic=True)
    places = [(axis.share(sqrt(part.least * part.most)) * WIDTH, part.found) for part in detection.tried]
    limit = f"; 95% at {curve_words(detection.curve, detection.unit)}" if detection.curve.points else ""
    caption = f"{share_words(detection.found)} found{limit}"
    return PowerChart(
        title=detection.cause,
        caption=caption,
        curve=curve_path(detection.curve, axis),
        band=band_path(detection.curve, axis),
        dots="".join(f"M{x:.1f} {_height(share.value or 0.0):.1f}h0" for x, share in places),
        whiskers="".join(f"M{x:.1f} {_height(share.low):.1f}V{_height(share.high):.1f}" for x, share in places),
        level=_height(_ALMOST_SURE),
        ticks=axis.ticks(4),
        across=f"size in {detection.unit}" if detection.unit not in {"", "1"} else "size",
        alt=f"Detection of {detection.cause} against size: {caption}",
    )


def curve_path(curve: Curve, axis: Axis) -> str:
    """Return the fitted curve as a line; empty where none was fitted."""
    return _path([(axis.share(point.magnitude) * WIDTH, _height(point.probability)) for point in curve.points])


def band_path(curve: Curve, axis: Axis) -> str:
    """Return the band around the curve as one outline: along its upper side, back along its lower side."""
    xs = [axis.share(point.magnitude) * WIDTH for point in curve.points]
    upper = list(zip(xs, (_height(point.high) for point in curve.points), strict=True))
    lower = list(zip(xs, (_height(point.low) for point in curve.points), strict=True))
    outline = _path(upper + lower[::-1])
    return f"{outline}Z" if outline else ""


def limits_chart(stated: Sequence[StatedLimit]) -> LimitsChart | None:
    """Draw the pairs whose curve was fitted, the largest ratio at the top; None where no curve was fitted."""
    bounded = [(limit.curve.at_95.value, limit) for limit in stated if limit.curve.at_95.value is not None]
    if not bounded:
        return None
    bounded.sort(key=lambda pair: -pair[0])
    bounds = [
        bound for value, limit in bounded for bound in (value, limit.curve.at_95.low, limit.curve.at_95.high) if bound
    ]
    axis = Axis(min(0.25, *bounds), max(2.0, *bounds), logarithmic=True)
    rows = [(10 * k + 5, axis.share(value) * WIDTH, limit.curve.at_95) for k, (value, limit) in enumerate(bounded)]
    return LimitsChart(
        path="".join(
            f"M{axis.share(at.low or axis.low) * WIDTH:.1f} {y}H{axis.share(at.high or axis.high) * WIDTH:.1f}"
            for y, _, at in rows
        ),
        dots="".join(f"M{x:.1f} {y}h0" for y, x, _ in rows),
        height=10 * len(rows),
        fair=(axis.share(0.5) * WIDTH, axis.share(1.0) * WIDTH),
        ticks=axis.ticks(),
        alt=f"Size found 95% of the time, in units of the stated limit, of {len(bounded)} pairs of cause and check",
    )


def _height(probability: float) -> float:
    return HEIGHT * (1 - probability)


def _path(places: Sequence[tuple[float, float]]) -> str:
    return "".join(f"{'L' if k else 'M'}{x:.1f} {y:.1f}" for k, (x, y) in enumerate(places))

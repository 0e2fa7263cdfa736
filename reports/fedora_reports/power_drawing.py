"""The curves of a study as one SVG drawing, for documents that hold pictures and no HTML."""

from dataclasses import dataclass
from typing import Final

from fedora_qa.record.power_types import POWER, Power
from fedora_reports.html import environment
from fedora_reports.power import LimitsChart, PowerChart, page_of

_COLUMNS: Final = 4
_CELL_PX: Final = (240, 130)
_ROW_PX: Final = 4
"""Height of a pair of cause and check in the drawing of limits."""


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


def draw_power(power: Power) -> str:
    """Return every fitted curve, and the chart of stated limits, as an SVG document."""
    return environment().get_template("power.svg.j2").render(drawing=drawing_of(POWER.from_json(POWER.to_json(power))))


def drawing_of(power: Power) -> PowerDrawing:
    """Return the charts with their positions."""
    page, (across, down) = page_of(power), _CELL_PX
    curves = [chart for chart in page.charts if chart.curve]
    cells = tuple(PlacedChart(across * (k % _COLUMNS), down * (k // _COLUMNS), chart) for k, chart in enumerate(curves))
    top = down * -(-len(cells) // _COLUMNS)
    rows = page.limits.height // 10 if page.limits else 0
    beneath = rows * _ROW_PX + 70 if rows else 0
    return PowerDrawing(across * _COLUMNS, max(top + beneath, down), cells, page.limits, top, rows * _ROW_PX)

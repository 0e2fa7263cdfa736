"""The arrays that checks keep, as charts and maps."""

from dataclasses import dataclass

import numpy as np

from fedora_qa.record.wording import number
from fedora_reports import colour_maps
from fedora_reports.charts import Chart, series_chart
from fedora_reports.colour_maps import Image, drawing
from fedora_reports.evidence import Array, Evidence, finite
from fedora_reports.panels import ColourBar, colour_bar
from fedora_reports.scales import Axis

_COARSE_PX = 160
"""The pixels of maps with fewer columns are displayed as squares, without interpolation."""


@dataclass(frozen=True, slots=True)
class ValueMap:
    """A map of values with its colour bar."""

    title: str
    image: Image
    caption: str
    bar: ColourBar | None
    coarse: bool


@dataclass(frozen=True, slots=True)
class Exhibits:
    """The drawings of some arrays, and the titles of those that cannot be drawn."""

    charts: tuple[Chart, ...] = ()
    maps: tuple[ValueMap, ...] = ()
    undrawn: tuple[str, ...] = ()


def exhibits(evidence: Evidence, names: tuple[str, ...]) -> Exhibits:
    """Draw the arrays of these names: (n, 2) as series, other (h, w) as maps."""
    charts, maps, undrawn = [], [], []
    for name in names:
        series, plane = evidence.numbers(name, None, 2), evidence.numbers(name, None, None)
        chart = None if series is None else series_chart(series, evidence.title(name))
        if chart is not None:
            charts.append(chart)
        elif plane is not None and series is None:
            maps.append(value_map(plane, evidence.title(name)))
        else:
            undrawn.append(evidence.title(name))
    return Exhibits(tuple(charts), tuple(maps), tuple(undrawn))


def value_map(plane: Array, title: str, others: Array | None = None) -> ValueMap:
    """Colour a map (h, w) of any numbers: on a scale about 0 if both signs occur, else from least to greatest.

    The scale also holds the values of ``others``, of a map beside it.
    """
    finite_values = finite(plane)
    coarse = plane.shape[1] < _COARSE_PX
    if not finite_values.size:
        grey = colour_maps.by_table(np.full(plane.shape, np.nan), colour_maps.SEQUENTIAL)
        return ValueMap(title, drawing(grey, f"{title}: no value"), "no value anywhere", None, coarse)
    low, high = float(finite_values.min()), float(finite_values.max())
    caption = f"{number(low)} to {number(high)}"
    if others is not None and (beside := finite(others)).size:
        low, high = min(low, float(beside.min())), max(high, float(beside.max()))
    signed = low < 0 < high
    reach = max(-low, high)
    axis = Axis(-reach, reach) if signed else Axis(low, high)
    table = colour_maps.DIVERGING if signed else colour_maps.SEQUENTIAL
    picture = colour_maps.by_table(axis.shares(np.where(np.isfinite(plane), plane, np.nan)), table)
    bar = colour_bar(axis, table, f"Colours from {number(axis.low)} to {number(axis.high)}")
    return ValueMap(title, drawing(picture, f"Map. {title}: {caption}"), caption, bar, coarse)

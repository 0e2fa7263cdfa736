"""Histograms and series as the geometry of small drawings.

Shapes are SVG paths in a box of 1000 by 100 that the page stretches; labels lie beside it, placed by shares of its
width, so that text keeps its size at any width.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fedora_qa.record.evidence import HISTOGRAMS, named
from fedora_qa.record.wording import number
from fedora_reports.evidence import Evidence, finite
from fedora_reports.instants import Array
from fedora_reports.scales import Axis, Tick

WIDTH, HEIGHT = 1000, 100

_TITLE = re.compile(r"^(?P<title>[^;]*)(?:;\s*(?:x (?=\w))?(?P<x>[^;]*))?(?:;\s*(?:y (?=\w))?(?P<y>[^;]*))?$")
_DOTTED_UP_TO = 120
"""Points that are few enough to be marked one by one."""


@dataclass(frozen=True, slots=True)
class Chart:
    """A drawing with its axes. ``across`` and ``up`` name what the axes show, with units."""

    title: str
    path: str
    filled: bool
    ticks: tuple[Tick, ...]
    across: str
    up: str
    lowest: str
    highest: str
    alt: str
    dots: str = ""


def histograms_of(evidence: Evidence) -> tuple[Chart, ...]:
    """Return every histogram that can be drawn."""
    quantities = dict.fromkeys(name.split("/", 1)[1].rsplit("/", 1)[0] for name in evidence.under(HISTOGRAMS))
    charts = (_histogram(evidence, quantity) for quantity in quantities)
    return tuple(chart for chart in charts if chart is not None)


def series_chart(points: Array, title: str) -> Chart | None:
    """Draw points (n, 2) in their order; the title reads ``TITLE; LABEL [UNIT]; LABEL [UNIT]``, across and up.

    A point that is not finite breaks the line. None where no point is finite.
    """
    values = np.asarray(points, dtype=np.float64)
    finite_points = values[np.isfinite(values).all(axis=1)]
    if not len(finite_points):
        return None
    words = _TITLE.match(title)
    name, across, up = (words["title"], words["x"], words["y"]) if words else (title, None, None)
    x_axis, y_axis = (Axis(float(finite_points[:, k].min()), float(finite_points[:, k].max())) for k in (0, 1))
    places = np.stack([x_axis.shares(values[:, 0]) * WIDTH, (1 - y_axis.shares(values[:, 1])) * HEIGHT], axis=1)
    places[~np.isfinite(values).all(axis=1)] = np.nan
    return Chart(
        title=name.strip(),
        path=_line(places),
        filled=False,
        ticks=x_axis.ticks(),
        across=(across or "").strip(),
        up=(up or "").strip(),
        lowest=number(y_axis.low),
        highest=number(y_axis.high),
        alt=f"{name.strip()}: {len(finite_points)} points, "
        f"{up or 'value'} from {number(y_axis.low)} to {number(y_axis.high)}",
        dots=_dots(places) if len(finite_points) <= _DOTTED_UP_TO else "",
    )


def steps_path(lefts: Sequence[float], heights: Sequence[float]) -> str:
    """Return bars as one outline: ``lefts`` (b + 1,) places of the edges, ``heights`` (b,), both in the box's units."""
    parts = [f"M{lefts[0]:.1f} {HEIGHT}"]
    for (left, right), height in zip(pairwise(lefts), heights, strict=True):
        parts.append(f"L{left:.1f} {HEIGHT - height:.1f}H{right:.1f}")
    return "".join([*parts, f"V{HEIGHT}Z"])


def _histogram(evidence: Evidence, quantity: str) -> Chart | None:
    counts = evidence.numbers(named(HISTOGRAMS, quantity, "counts"), None)
    edges = None if counts is None else evidence.numbers(named(HISTOGRAMS, quantity, "edges"), len(counts) + 1)
    if counts is None or edges is None or not _rising(edges) or not np.isfinite(counts).all() or counts.max() <= 0:
        return None
    axis = Axis(float(edges[0]), float(edges[-1]), logarithmic=_logarithmic(edges))
    heights = np.clip(counts / counts.max(), 0.0, 1.0) * HEIGHT
    most = int(counts.argmax())
    peak = f"between {number(float(edges[most]))} and {number(float(edges[most + 1]))}"
    title = evidence.title(named(HISTOGRAMS, quantity, "counts"))
    return Chart(
        title=title,
        path=steps_path(list(axis.shares(edges) * WIDTH), list(heights)),
        filled=True,
        ticks=axis.ticks(),
        across="logarithmic" if axis.logarithmic else "",
        up="",
        lowest="0",
        highest=number(float(counts.max())),
        alt=f"Histogram. {title}: from {number(axis.low)} to {number(axis.high)}, most {peak}",
    )


def _rising(edges: Array) -> bool:
    return len(finite(edges)) == len(edges) and bool((np.diff(edges) > 0).all())


def _logarithmic(edges: Array) -> bool:
    """Whether the bins are cut more evenly in the logarithm than as they are."""
    return bool(edges[0] > 0 and _unevenness(np.log(edges)) < _unevenness(edges))


def _unevenness(edges: Array) -> float:
    widths = np.diff(edges)
    return float(widths.std() / widths.mean())


def _line(places: Array) -> str:
    parts, pen = [], "M"
    for x, y in places:
        if np.isfinite(x):
            parts.append(f"{pen}{x:.1f} {y:.1f}")
            pen = "L"
        else:
            pen = "M"
    return "".join(parts)


def _dots(places: Array) -> str:
    """Return lines of no length, which round caps turn into dots that no stretching deforms."""
    return "".join(f"M{x:.1f} {y:.1f}h0" for x, y in places if np.isfinite(x))

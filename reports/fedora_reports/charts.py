"""Histograms, distributions and series as the geometry of small drawings.

Shapes are SVG paths in a box of 1000 by 100, which the page stretches. Labels lie beside the box at shares of its
width, so that text keeps its size at any width.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from fedora_qa.record.evidence import DISTRIBUTIONS, HISTOGRAMS, QUANTITIES, named
from fedora_qa.record.wording import number
from fedora_reports.evidence import Array, Evidence, finite
from fedora_reports.scales import Axis, Tick

WIDTH, HEIGHT = 1000, 100

_TITLE = re.compile(r"^(?P<title>[^;]*)(?:;\s*(?:x (?=\w))?(?P<x>[^;]*))?(?:;\s*(?:y (?=\w))?(?P<y>[^;]*))?$")
_DOTTED_UP_TO = 120
"""Largest number of points that are marked individually."""

_BY_OCTAVES: Final = ("event_rate_per_ms", "pixel_interval_ms")
"""Quantities of which only counts by block of time are kept."""


@dataclass(frozen=True, slots=True)
class Chart:
    """A drawing with its axes. ``across`` and ``up`` name the quantities of the axes, with units.

    ``before`` is the path of the same series before a fault was undone; ``level`` the height of a level line, as a
    share from the top.
    """

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
    before: str = ""
    level: float | None = None


def histograms_of(evidence: Evidence) -> tuple[Chart, ...]:
    """Return every histogram that can be drawn, on a linear axis or, where the bins grow, on a logarithmic one."""
    charts = []
    for quantity in dict.fromkeys(name.split("/", 1)[1].rsplit("/", 1)[0] for name in evidence.under(HISTOGRAMS)):
        counts = evidence.numbers(named(HISTOGRAMS, quantity, "counts"), None)
        edges = None if counts is None else evidence.numbers(named(HISTOGRAMS, quantity, "edges"), len(counts) + 1)
        if counts is None or edges is None or not np.isfinite(counts).all() or counts.max() <= 0:
            continue
        if len(finite(edges)) < len(edges) or not (np.diff(edges) > 0).all():
            continue
        # The axis is the one on which the widths of the bins vary less.
        logarithmic = edges[0] > 0 and _unevenness(np.log(edges)) < _unevenness(edges)
        axis = Axis(float(edges[0]), float(edges[-1]), logarithmic=bool(logarithmic))
        heights = np.clip(counts / counts.max(), 0.0, 1.0) * HEIGHT
        most = int(counts.argmax())
        peak = f"between {number(float(edges[most]))} and {number(float(edges[most + 1]))}"
        title = evidence.title(named(HISTOGRAMS, quantity, "counts"))
        chart = Chart(
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
        charts.append(chart)
    return tuple(charts)


def distributions_of(evidence: Evidence) -> tuple[Chart, ...]:
    """Return the histograms of flow, depth and light, then the distributions of events by octave."""
    charts = list(histograms_of(evidence))
    for quantity in _BY_OCTAVES:
        edges = evidence.numbers(named(DISTRIBUTIONS, quantity, "edges"), None)
        bins = 0 if edges is None else len(edges) - 1
        counts = evidence.numbers(named(DISTRIBUTIONS, quantity, "counts"), None, bins)
        if edges is None or counts is None or not np.isfinite(edges).all() or not (np.diff(edges) > 0).all():
            continue
        totals = np.asarray(counts, dtype=np.float64).sum(axis=0)  # over all blocks of time
        positive = edges[:-1] > 0  # a logarithmic axis has no place for the bin that begins at 0
        if not np.isfinite(totals).all() or (totals < 0).any() or not totals[positive].any():
            continue
        drawn_edges, drawn_counts = edges[-1 - int(positive.sum()) :], totals[positive]
        per_octave = drawn_counts / np.log2(drawn_edges[1:] / drawn_edges[:-1])
        axis = Axis(float(drawn_edges[0]), float(drawn_edges[-1]), logarithmic=True)
        most = int(per_octave.argmax())
        left_out = float(totals.sum() - drawn_counts.sum())
        below = f"; {number(left_out)} below are not drawn" if left_out else ""
        title = QUANTITIES[quantity]
        chart = Chart(
            title=title,
            path=steps_path(list(axis.shares(drawn_edges) * WIDTH), list(per_octave / per_octave.max() * HEIGHT)),
            filled=True,
            ticks=axis.ticks(),
            across=f"logarithmic{below}",
            up="number an octave",
            lowest="0",
            highest=number(float(per_octave.max())),
            alt=f"Histogram. {title}: from {number(axis.low)} to {number(axis.high)}, "
            f"most between {number(float(drawn_edges[most]))} and {number(float(drawn_edges[most + 1]))}",
        )
        charts.append(chart)
    return tuple(charts)


def series_chart(
    points: Array, title: str, before: Array | None = None, level: float | None = None, *, from_zero: bool = False
) -> Chart | None:
    """Draw a series as a line; None where no point is finite.

    Parameters
    ----------
    points
        (n, 2): across and up, in the order in which they are joined. A point that is not finite interrupts the line.
    title
        Reads ``TITLE; LABEL [UNIT]; LABEL [UNIT]``; the labels are of the axes across and up.
    before
        (m, 2): the same series before a fault was undone, on the same axes, from 0 on.
    level
        Height that a line marks, on an axis from 0 on.
    from_zero
        Whether the axis up begins at 0 without these as well.
    """
    values = np.asarray(points, dtype=np.float64)
    earlier = np.empty((0, 2)) if before is None else np.asarray(before, dtype=np.float64)
    finite_points = _finite_points(values)
    if not len(finite_points):
        return None
    of_axes = np.concatenate([finite_points, _finite_points(earlier)])
    parts = _TITLE.match(title)
    name, across, up = (parts["title"], parts["x"], parts["y"]) if parts else (title, None, None)
    x_axis, y_axis = (Axis(float(of_axes[:, k].min()), float(of_axes[:, k].max())) for k in (0, 1))
    if from_zero or level is not None or before is not None:
        y_axis = Axis(min(y_axis.low, 0.0), max(y_axis.high, level or 0.0))
    line, dots = _line(values, x_axis, y_axis)
    return Chart(
        title=name.strip(),
        path=line,
        filled=False,
        ticks=x_axis.ticks(),
        across=(across or "").strip(),
        up=(up or "").strip(),
        lowest=number(y_axis.low),
        highest=number(y_axis.high),
        alt=f"{name.strip()}: {len(finite_points)} points, "
        f"{up or 'value'} from {number(y_axis.low)} to {number(y_axis.high)}",
        dots=dots if len(finite_points) <= _DOTTED_UP_TO else "",
        before=_line(earlier, x_axis, y_axis)[0],
        level=None if level is None else 1 - y_axis.share(level),
    )


def _finite_points(values: Array) -> Array:
    return values[np.isfinite(values).all(axis=1)]


def _line(values: Array, x_axis: Axis, y_axis: Axis) -> tuple[str, str]:
    """Return the points (n, 2) as a line and as dots, SVG paths."""
    places = np.stack([x_axis.shares(values[:, 0]) * WIDTH, (1 - y_axis.shares(values[:, 1])) * HEIGHT], axis=1)
    places[~np.isfinite(values).all(axis=1)] = np.nan
    line, dots, pen = [], [], "M"
    for x, y in places:
        if np.isfinite(x):
            line.append(f"{pen}{x:.1f} {y:.1f}")
            # Round caps turn a line of no length into a dot, which stays round where the page stretches the box.
            dots.append(f"M{x:.1f} {y:.1f}h0")
            pen = "L"
        else:
            pen = "M"
    return "".join(line), "".join(dots)


def steps_path(lefts: Sequence[float], heights: Sequence[float]) -> str:
    """Return bars as one outline.

    Parameters
    ----------
    lefts
        (b + 1,) horizontal positions of the edges, in units of the box.
    heights
        (b,) in units of the box.
    """
    parts = [f"M{lefts[0]:.1f} {HEIGHT}"]
    for (left, right), height in zip(pairwise(lefts), heights, strict=True):
        parts.append(f"L{left:.1f} {HEIGHT - height:.1f}H{right:.1f}")
    return "".join([*parts, f"V{HEIGHT}Z"])


def _unevenness(edges: Array) -> float:
    """Return the standard deviation of the widths of bins, relative to their mean."""
    widths = np.diff(edges)
    return float(widths.std() / widths.mean())

"""Clouds of points in a box, in parallel projection, and clouds of single events.

The space of a drawing has Z up, the middle of the box at its origin, and the longest side of the box as its unit.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import combinations, product
from typing import Any, Final

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from fedora_qa.record.evidence import EVENT_CLOUDS, named
from fedora_qa.record.wording import number
from fedora_reports.evidence import Array, Evidence
from fedora_reports.panels import seconds
from fedora_reports.scales import Axis, Tick

Float64 = NDArray[np.float64]

WIDTH_PX: Final = 360
"""Width of a picture: on a phone its words keep nearly their size."""

_MARGINS_PX: Final = (50.0, 16.0, 24.0, 22.0)
"""Left, above, right and below the box, for the labels of its axes."""

_LABELS: Final = ((-5, 12, "end"), (5, 12, "start"), (-6, 4, "end"))
"""Right and down from a tick of X, Y and Z to its label, px, and the end of the label that lies there."""

_NEAR_PX: Final = 14
_FAR_PX: Final = 36
"""From the edge of a scene to the labels of its ticks, and to the name of its axis."""

_BANDS: Final = 4
"""Points are drawn in so many layers, the farthest first."""

_FINER: Final = 2
"""Points lie on a grid of half a pixel of the picture."""


@dataclass(frozen=True, slots=True)
class CloudAxis:
    """An axis of a box: its name with the unit, and its ticks as shares of the side."""

    name: str
    ticks: tuple[Tick, ...]


@dataclass(frozen=True, slots=True)
class CloudView:
    """Direction of a parallel projection: turned about Z by ``yaw_rad``, seen from ``pitch_rad`` above the ground."""

    yaw_rad: float
    pitch_rad: float

    def project(self, points: Float64) -> Float64:
        """Return points (..., 3) as right, down and toward the eye (..., 3), in the unit of the points."""
        x, y, z = np.moveaxis(points, -1, 0)
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        up, over = np.cos(self.pitch_rad), np.sin(self.pitch_rad)
        away = c * y - s * x
        return np.stack([c * x + s * y, -(up * z + over * away), over * z - up * away], axis=-1)


def draw_cloud(
    points: Float64,
    paint: NDArray[np.intp],
    paints: Sequence[str],
    sides: Float64,
    axes: tuple[CloudAxis, CloudAxis, CloudAxis],
    view: CloudView,
    label: str,
    lines: Sequence[tuple[Float64, str]] = (),
) -> str:
    """Return a picture of points in their box, with labelled axes.

    Parameters
    ----------
    points
        (n, 3) in the space of the drawing.
    paint
        (n,) indices of ``paints``.
    paints
        Attributes of SVG that give points their colour.
    sides
        (3,) of the box, the longest of them 1.
    axes
        X, Y and Z.
    view
        With a yaw between 0 and a right angle, so that X and Y both lead to the right.
    lines
        Places (m, 3) along each line that is drawn over the points, and its attributes of SVG.
    """
    corners = np.array(list(product((-0.5, 0.5), repeat=3))) * sides
    outline = view.project(corners)[:, :2]
    left, above, right, below = _MARGINS_PX
    low, high = outline.min(axis=0), outline.max(axis=0)
    scale_px = (WIDTH_PX - left - right) / (high[0] - low[0])
    height = above + below + (high[1] - low[1]) * scale_px

    def places_px(of: Float64) -> Float64:
        places: Float64 = (view.project(of)[..., :2] - low) * scale_px + (left, above)
        return places

    parts = []
    # Edges join corners that differ in one axis. Those of the nearest corner would cross the points.
    nearest = int(view.project(corners)[:, 2].argmax())
    edges = [(a, b) for a, b in combinations(range(8), 2) if (a ^ b) in (1, 2, 4) and nearest not in (a, b)]
    ends = places_px(corners)
    outline_px = "".join(f"M{ends[a, 0]:.1f} {ends[a, 1]:.1f}L{ends[b, 0]:.1f} {ends[b, 1]:.1f}" for a, b in edges)
    parts.append(f'<path class="edges" d="{outline_px}"/>')
    parts += _points(places_px(points), view.project(points)[:, 2], paint, paints)
    for places, attributes in lines:
        line = "L".join(f"{x:.1f} {y:.1f}" for x, y in places_px(places))
        parts.append(f'<path {attributes} d="M{line}"/>')
    for k, (axis, (dx, dy, anchor)) in enumerate(zip(axes, _LABELS, strict=True)):
        edge = _labelled_edge(k, sides)
        for tick in axis.ticks:
            edge[k] = (tick.share - 0.5) * sides[k]
            x, y = places_px(edge)
            parts.append(_text(x + dx, y + dy, tick.label, anchor))
        # Names stand at the middle of the edge, below its ticks; that of Z above the edge.
        edge[k] = sides[k] / 2 if k == 2 else 0.0
        x, y = places_px(edge)
        parts.append(
            _text(2.0, y - 8, axis.name, "start") if k == 2 else _text(x + 8 * dx, y + 34, axis.name, "middle")
        )
    return (
        f'<svg viewBox="0 0 {WIDTH_PX} {height:.0f}" role="img" aria-label="{escape(label)}" fill="none" '
        f'xmlns="http://www.w3.org/2000/svg">{"".join(parts)}</svg>'
    )


def box_scene(sides: Float64, view: CloudView, axes: tuple[CloudAxis, CloudAxis, CloudAxis]) -> dict[str, Any]:
    """Return the box of a scene that a reader can turn, as ``script/space.js`` takes it: for JSON.

    Parameters
    ----------
    sides
        (3,) of the box, the longest of them 1.
    view
        From which it is seen at first.
    axes
        X, Y and Z. Their labels stand at the edges that a picture labels.
    """
    names, ticks = [], []
    for k, axis in enumerate(axes):
        edge = _labelled_edge(k, sides)
        for tick in axis.ticks:
            edge[k] = (tick.share - 0.5) * sides[k]
            ticks.append([*edge.round(4).tolist(), tick.label, _NEAR_PX])
        edge[k] = sides[k] / 2 if k == 2 else 0.0
        names.append([*edge.round(4).tolist(), axis.name, _FAR_PX])
    return {
        "low": (-sides / 2).round(4).tolist(),
        "high": (sides / 2).round(4).tolist(),
        "yaw": view.yaw_rad,
        "pitch": view.pitch_rad,
        "labels": [*names, *ticks],
    }


def packed_points(points: Float64, paint: NDArray[np.integer[Any]]) -> str:
    """Return points of a scene in base64: four int16 a point, least byte first.

    Parameters
    ----------
    points
        (n, 3) in the space of the drawing, -1 to 1, kept to a 32767th.
    paint
        (n,) indices of the paints of the scene, or colours of five bits each for red, green and blue.
    """
    numbers = np.column_stack([np.rint(points * 32767), paint]).astype("<i2")
    return base64.b64encode(numbers.tobytes()).decode("ascii")


def _labelled_edge(axis: int, sides: Float64) -> Float64:
    """Return a point (3,) of the edge with the labels of an axis; its coordinate along that axis is free.

    X along the near edge on the left, Y along the near edge on the right, Z along the leftmost edge.
    """
    x_high, y_high, z_high = sides / 2
    return np.array([x_high if axis == 1 else -x_high, -y_high, -z_high])


def _points(places_px: Float64, toward: Float64, paint: NDArray[np.intp], paints: Sequence[str]) -> list[str]:
    """Return the points layer by layer, each place of a colour once a layer, as dots of relative coordinates."""
    if not len(places_px):
        return []
    places = np.rint(places_px * _FINER).astype(int)
    order = np.argsort(toward, kind="stable")
    drawn = []
    for band in np.array_split(order, _BANDS):
        for k in np.unique(paint[band]):
            # In the order of columns steps are small, and short to write.
            dots = np.unique(places[band[paint[band] == k]], axis=0)
            steps = np.diff(dots, axis=0, prepend=[[0, 0]])
            path = "".join(f"m{dx}{dy if dy < 0 else f' {dy}'}h0" for dx, dy in steps.tolist())
            drawn.append(f'<path {paints[k]} d="{path}"/>')
    return [f'<g class="points" transform="scale({1 / _FINER:g})">{"".join(drawn)}</g>']


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


_VIEW: Final = CloudView(yaw_rad=0.85, pitch_rad=0.42)
_TIME_SHARE: Final = 1.25
"""Length of the axis of time as a share of the longer side of the sensor."""

_PAINTS: Final = ('class="darker"', 'class="brighter"')
_LARGEST: Final = 1e12
"""No sensor and no interval has as many px or us."""

_VARIABLES: Final = ("--darker", "--brighter")
"""By polarity, of the picture and of the scene."""


@dataclass(frozen=True, slots=True)
class EventCloud:
    """A cloud of events: its instant, its picture in SVG, the same as JSON to be turned, and how many it shows."""

    time: str
    view: Markup
    space: str
    caption: str


def event_clouds_of(evidence: Evidence) -> tuple[EventCloud, ...]:
    """Return the event clouds of a file in the order of time; none where their arrays are missing or do not fit."""

    def array(name: str, *shape: int | None) -> Array | None:
        return evidence.numbers(named(EVENT_CLOUDS, name), *shape)

    times_us, instant = array("times_us", None), array("instant", None)
    if times_us is None or instant is None:
        return ()
    c, m = len(times_us), len(instant)
    intervals_us, counts, shapes_px = array("intervals_us", c, 2), array("counts", c), array("shapes_px", c, 2)
    offsets_us, x, y, polarities = (array(name, m) for name in ("offsets_us", "x", "y", "polarities"))
    if intervals_us is None or counts is None or shapes_px is None:
        return ()
    if offsets_us is None or x is None or y is None or polarities is None:
        return ()
    clouds = []
    for k in range(c):
        cloud = _cloud(
            float(times_us[k]),
            intervals_us[k].astype(np.float64),
            float(counts[k]),
            shapes_px[k].astype(np.float64),
            np.stack([events[instant == k].astype(np.float64) for events in (offsets_us, x, y)], axis=-1),
            polarities[instant == k],
        )
        clouds += [cloud] if cloud else []
    return tuple(clouds)


def _cloud(
    time_us: float, interval_us: Array, count: float, shape_px: Array, offsets_us_x_y: Array, polarities: Array
) -> EventCloud | None:
    """Draw a cloud; None where its numbers describe no box, or no event lies in it."""
    with np.errstate(invalid="ignore", over="ignore"):
        low_us, high_us = interval_us - time_us
        length_us = high_us - low_us
    height, width = shape_px
    if not (0 < length_us < _LARGEST and 0 < height < _LARGEST and 0 < width < _LARGEST and 0 <= count < _LARGEST):
        return None  # also for NaN
    # Shares of the box: time along X, columns along Y, rows down Z.
    with np.errstate(invalid="ignore", over="ignore"):
        shares = (offsets_us_x_y - (low_us, 0.0, 0.0)) / (length_us, width, height)
    within = ((shares >= 0) & (shares <= 1)).all(axis=1)  # False for NaN
    if not within.any():
        return None
    shares = np.where((False, False, True), 1.0 - shares, shares)[within]
    longer = max(height, width)
    sides = np.array([_TIME_SHARE, width / longer, height / longer]) / max(_TIME_SHARE, 1.0)
    down = tuple(replace(tick, share=1.0 - tick.share) for tick in Axis(0.0, height).ticks(3))
    axes = (
        CloudAxis("t, ms", Axis(low_us / 1e3, high_us / 1e3).ticks(4)),
        CloudAxis("x, px", Axis(0.0, width).ticks(3)),
        CloudAxis("y, px", down),
    )
    time, drawn = seconds(time_us), int(within.sum())
    thinned = f"{drawn} of {count:.0f} events" if drawn < count else f"{drawn} events"
    caption = f"{thinned} within {number(length_us / 1e3)} ms; t is counted from {time}"
    paint = (polarities[within] > 0).astype(np.intp)
    view = draw_cloud((shares - 0.5) * sides, paint, _PAINTS, sides, axes, _VIEW, f"Events at {time}: {caption}")
    scene = box_scene(sides, _VIEW, axes) | {
        "paints": _VARIABLES,
        "cloud": packed_points((shares - 0.5) * sides, paint),
    }
    return EventCloud(time, Markup(view), json.dumps(scene, allow_nan=False, separators=(",", ":")), caption)

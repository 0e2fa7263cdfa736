"""The path of a flight as two flat views, from above and from the side, in SVG that follows the page's colours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.record.wording import number
from fedora_reports.trajectory_path import Box, FlownPath, box_around, round_step_m, speed_colours

Float64 = NDArray[np.float64]

_WIDTH: Final = 860
_SPACE_BESIDE: Final = (640.0, 360.0)
_SPACE_BELOW: Final = (740.0, 480.0)
"""Largest size of both views together, px across and down, beside and below each other."""
_SPACE_ABOVE: Final = (460.0, 400.0)
"""Largest size of a view of several paths, px: on a phone its words stay legible."""
_MARGIN: Final = (70.0, 44.0)
"""Px left and below each view, for the labels of its axes."""
_ABOVE: Final = 30.0
_LEGEND: Final = 56.0
_COLOURS: Final = speed_colours(16)
_NO_SPEED: Final = "#8a949e"
_ARROWHEADS: Final = 10
_ARROWHEAD_PX: Final = 15.0
_LABEL_PX: Final = (34.0, 15.0)
"""Width and height of the word of a mark."""
_AXIS_NAMES: Final = ("X east, m", "Y north, m", "Z up, m")


@dataclass(frozen=True, slots=True)
class _View:
    """A view along one axis: the axes that go right and up, and the position of the low corner of the box, px."""

    title: str
    right: int
    up: int
    left_px: float
    bottom_px: float
    scale_px_m: float
    box: Box

    def places_px(self, points_m: Float64) -> Float64:
        """Return points (..., 3) of the world as (x, y) px (..., 2)."""
        low = self.box.low_m
        across = self.left_px + (points_m[..., self.right] - low[self.right]) * self.scale_px_m
        down = self.bottom_px - (points_m[..., self.up] - low[self.up]) * self.scale_px_m
        return np.stack([across, down], axis=-1)


@dataclass(frozen=True, slots=True)
class Mark:
    """A finding on the path: its word, its identifier on the page, and the position of the body, m (3,)."""

    word: str
    anchor: str
    position_world_m: Float64


def draw_views(path: FlownPath, marks: Sequence[Mark] = ()) -> str:
    """Return both views of a path at one scale, with a scale of speeds and one of lengths.

    Parameters
    ----------
    path
        At least one pose.
    marks
        Findings, each a link to its place on the page. Labels that would touch are left out; the link keeps its word.
    """
    box = box_around(path.positions_world_m)
    # The views lie beside or below each other, whichever gives the larger scale.
    sides_m = box.high_m - box.low_m
    across = 0 if sides_m[0] >= sides_m[1] else 1
    beside = min(_SPACE_BESIDE[0] / (sides_m[0] + sides_m[across]), _SPACE_BESIDE[1] / max(sides_m[1], sides_m[2]))
    below = min(_SPACE_BELOW[0] / max(sides_m[0], sides_m[across]), _SPACE_BELOW[1] / (sides_m[1] + sides_m[2]))
    scale_px_m = max(beside, below)
    left, top_bottom = _MARGIN[0], _ABOVE + float(sides_m[1]) * scale_px_m
    if beside >= below:
        bottom = _ABOVE + float(max(sides_m[1], sides_m[2])) * scale_px_m
        corners = ((left, bottom), (2 * left + float(sides_m[0]) * scale_px_m, bottom))
    else:
        corners = ((left, top_bottom), (left, top_bottom + _MARGIN[1] + _ABOVE + float(sides_m[2]) * scale_px_m))
    from_above = _View("from above", 0, 1, *corners[0], scale_px_m, box)
    from_the_side = _View("from the side", across, 2, *corners[1], scale_px_m, box)
    views = (from_above, from_the_side)
    height = corners[1][1] + _MARGIN[1] + _LEGEND

    parts = [part for view in views for part in (_axes(view), _path(view, path), _arrowheads(view, path))]
    # A ring at the first pose, and a square at the last.
    for view in views:
        first, last = view.places_px(path.positions_world_m[[0, -1]])
        parts.append(f'<circle cx="{first[0]:.1f}" cy="{first[1]:.1f}" r="6" stroke-width="2.5"/>')
        if len(path.positions_world_m) > 1:
            corner = f'x="{last[0] - 5:.1f}" y="{last[1] - 5:.1f}"'
            parts.append(f'<rect {corner} width="10" height="10" stroke-width="2.5"/>')
    parts += [_marks(view, marks) for view in views]

    # The scale of speeds, where they differ.
    y = height - 18.0
    speed_range_m_s = path.speed_range_m_s
    if speed_range_m_s is not None and path.speed_varies:
        start, width = _MARGIN[0] + 46, 9.0
        stop = start + len(_COLOURS) * width
        parts.append(_text(start - 6, y, number(speed_range_m_s[0]), "end"))
        for k, colour in enumerate(_COLOURS):
            bar = f'x="{start + k * width:.1f}" y="{y - 11}" width="9.5" height="12"'
            parts.append(f'<rect {bar} fill="{colour}" stroke="none"/>')
        parts.append(_text(stop + 6, y, f"{number(speed_range_m_s[1])} m/s", "start"))

    # A bar of a round length, at least 60 px.
    length_m = round_step_m(60.0 / scale_px_m)
    stop = _WIDTH - 110.0
    parts.append(f'<path d="M{stop - length_m * scale_px_m:.1f} {y - 9}v8H{stop:.1f}v-8" stroke-width="1.6"/>')
    parts.append(_text(stop + 8, y, f"{number(length_m)} m", "start"))
    return _svg(height, parts)


def draw_paths(path_by_place: Mapping[int, FlownPath]) -> str:
    """Return several paths from above in one picture, of one scale in both directions."""
    box = box_around(np.concatenate([path.positions_world_m for path in path_by_place.values()]))
    sides_m = box.high_m - box.low_m
    scale_px_m = min(_SPACE_ABOVE[0] / float(sides_m[0]), _SPACE_ABOVE[1] / float(sides_m[1]))
    bottom = _ABOVE + float(sides_m[1]) * scale_px_m
    view = _View("from above", 0, 1, _MARGIN[0], bottom, scale_px_m, box)
    parts = [_axes(view)]
    for place, path in path_by_place.items():
        places = view.places_px(path.positions_world_m)
        line = "".join(_line(places[start:stop]) for start, stop in path.runs)
        x, y = places[0]
        ring = f'<circle class="overlay s{place}" cx="{x:.1f}" cy="{y:.1f}" r="6"/>'
        parts.append(f'<path class="overlay s{place}" d="{line}"/>{ring}')
    width = _MARGIN[0] + float(sides_m[0]) * scale_px_m + _ABOVE
    return _svg(bottom + _MARGIN[1], parts, width, "Paths from above")


def without_path() -> str:
    """Return a picture that states that there is no path."""
    return _svg(70.0, [_text(_WIDTH / 2, 40, "No finite position", "middle")])


def _svg(height: float, parts: list[str], width: float = _WIDTH, label: str = "Two views of the path") -> str:
    return (
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="group" aria-label="{label}" fill="none" '
        f'stroke="currentColor" font-size="14" style="max-width: {width:.0f}px" '
        f'xmlns="http://www.w3.org/2000/svg">{"".join(parts)}</svg>'
    )


def _axes(view: _View) -> str:
    """Return the frame of a view with its title, lines of round metres and their labels."""
    low, high = view.places_px(view.box.low_m), view.places_px(view.box.high_m)
    lines, labels = [], [_text(low[0], high[1] - 10, view.title, "start")]
    for metres, label in view.box.ticks(view.right, most=6):
        x = low[0] + (metres - view.box.low_m[view.right]) * view.scale_px_m
        lines.append(f"M{x:.1f} {low[1]:.1f}V{high[1]:.1f}")
        labels.append(_text(x, low[1] + 17, label, "middle"))
    for metres, label in view.box.ticks(view.up, most=6):
        y = low[1] - (metres - view.box.low_m[view.up]) * view.scale_px_m
        lines.append(f"M{low[0]:.1f} {y:.1f}H{high[0]:.1f}")
        labels.append(_text(low[0] - 7, y + 5, label, "end"))
    labels.append(_text((low[0] + high[0]) / 2, low[1] + 35, _AXIS_NAMES[view.right], "middle"))
    middle = (low[1] + high[1]) / 2
    labels.append(
        f'<g transform="translate({low[0] - 54:.1f} {middle:.1f}) rotate(-90)">'
        f"{_text(0, 0, _AXIS_NAMES[view.up], 'middle')}</g>"
    )
    return f'<path d="{"".join(lines)}" stroke-opacity="0.22"/>{"".join(labels)}'


def _path(view: _View, path: FlownPath) -> str:
    """Return the path as one line for each segment of one colour, on a faint wider line that sets it off."""
    places = view.places_px(path.positions_world_m)
    # The colour of each pose as an index of the table; -1 where the speed is unknown.
    is_finite = np.isfinite(path.speeds_m_s)
    low, high = path.speed_range_m_s or (0.0, 0.0)
    if path.speed_varies:
        shares = (np.where(is_finite, path.speeds_m_s, low) - low) / (high - low)
        levels = np.where(is_finite, np.minimum(shares * len(_COLOURS), len(_COLOURS) - 1).astype(np.intp), -1)
    else:
        levels = np.where(is_finite, len(_COLOURS) // 2, -1)
    drawn = []
    for start, stop in path.runs:
        changes = np.flatnonzero(np.diff(levels[start : max(start + 1, stop - 1)])) + start + 1
        for a, b in pairwise([start, *changes.tolist(), max(start, stop - 1)]):
            colour = _COLOURS[levels[a]] if levels[a] >= 0 else _NO_SPEED
            drawn.append(f'<path d="{_line(places[a : b + 1])}" stroke="{colour}"/>')
    outline = "".join(_line(places[start:stop]) for start, stop in path.runs)
    return (
        f'<g stroke-linecap="round" stroke-linejoin="round"><path d="{outline}" stroke-width="6" stroke-opacity="0.3"/>'
        f'<g stroke-width="3.5">{"".join(drawn)}</g></g>'
    )


def _line(places_px: Float64) -> str:
    """Return a line through places (n, 2); one place is a dot."""
    points = places_px if len(places_px) > 1 else np.repeat(places_px, 2, axis=0)
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _arrowheads(view: _View, path: FlownPath) -> str:
    """Return arrowheads in the direction of the body, foreshortened as this view shows them."""
    rows = np.unique(np.linspace(0, len(path.positions_world_m) - 1, _ARROWHEADS).round().astype(np.intp))
    rows = rows[np.isfinite(path.forward_world[rows]).all(axis=1)]
    # Directions are normed, because arrows of a wrong length could cover the picture.
    lengths = np.maximum(np.linalg.norm(path.forward_world[rows], axis=1, keepdims=True), 1e-12)
    ahead = path.forward_world[rows] / lengths * (_ARROWHEAD_PX / view.scale_px_m)
    tails = view.places_px(path.positions_world_m[rows])
    tips = view.places_px(path.positions_world_m[rows] + ahead)
    aside = (tips - tails)[:, ::-1] * (0.3, -0.3)
    heads = "".join(_line(np.stack(corners)) + "Z" for corners in zip(tails - aside, tips, tails + aside, strict=True))
    return f'<path d="{heads}" fill="currentColor" stroke="none"/>'


def _marks(view: _View, marks: Sequence[Mark]) -> str:
    """Return a diamond at each finding, with its word where that touches no other."""
    drawn: list[str] = []
    labelled: list[tuple[float, float]] = []
    for mark in marks:
        x, y = view.places_px(mark.position_world_m)
        is_free = all(abs(x - other) > _LABEL_PX[0] or abs(y - below) > _LABEL_PX[1] for other, below in labelled)
        label = ""
        if is_free:
            labelled.append((x, y))
            label = _text(x + 9, y - 7, mark.word, "start")
        drawn.append(
            f'<a href="#{escape(mark.anchor)}" class="mark grave" aria-label="{escape(mark.word)}, {view.title}">'
            f'<path class="diamond" d="M{x:.1f} {y - 6:.1f}l6 6l-6 6l-6 -6z"/>{label}</a>'
        )
    return "".join(drawn)


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="currentColor" stroke="none">{escape(text)}</text>'
    )

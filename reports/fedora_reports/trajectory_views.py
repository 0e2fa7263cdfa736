"""The path of a flight as two flat views, from above and from the side, in SVG that follows the page's colours."""

from collections.abc import Sequence
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
_ROOM_BESIDE: Final = (640.0, 360.0)
_ROOM_BELOW: Final = (740.0, 480.0)
"""Most that both views together may take, px across and down, beside and below each other."""
_MARGIN: Final = (70.0, 44.0)
"""Px left and below each view, for the labels of its axes."""
_ABOVE: Final = 30.0
_LEGEND: Final = 56.0
_COLOURS: Final = speed_colours(16)
_NO_SPEED: Final = "#8a949e"
_NOSES: Final = 10
_NOSE_PX: Final = 15.0
_LABEL_PX: Final = (34.0, 15.0)
"""Room that the word of a mark takes."""
_AXIS_NAMES: Final = ("X east, m", "Y north, m", "Z up, m")


@dataclass(frozen=True, slots=True)
class _Panel:
    """A view along one axis: which axes go right and up, and where the low corner of the box lies, px."""

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
    """A finding on the path: its word, the identifier of its place on the page, and where the body was, m (3,)."""

    word: str
    anchor: str
    position_world_m: Float64


def draw_views(path: FlownPath, marks: Sequence[Mark] = ()) -> str:
    """Return both views of a path with at least one pose, at one scale, with a scale of speeds and one of lengths.

    Each mark is a link to its finding; labels that would touch are left out, and the link keeps its word.
    """
    box = box_around(path.positions_world_m)
    panels, height = _arranged(box)
    parts = [part for panel in panels for part in (_axes(panel), _path(panel, path), _noses(panel, path))]
    parts += [_ends(panel, path) for panel in panels]
    parts += [_marks(panel, marks) for panel in panels]
    parts += [_legend(path, height - 18.0), _scale_bar(panels[0], height - 18.0)]
    return _svg(height, parts)


def without_path() -> str:
    """Return a picture that says that there is nothing to see."""
    return _svg(70.0, [_text(_WIDTH / 2, 40, "No finite position", "middle")])


def _svg(height: float, parts: list[str]) -> str:
    return (
        f'<svg viewBox="0 0 {_WIDTH} {height:.0f}" role="group" aria-label="Two views of the path" fill="none" '
        f'stroke="currentColor" font-size="14" style="max-width: {_WIDTH}px" '
        f'xmlns="http://www.w3.org/2000/svg">{"".join(parts)}</svg>'
    )


def _arranged(box: Box) -> tuple[tuple[_Panel, _Panel], float]:
    """Put the views beside or below each other, whichever lets them be larger, and say how high it all gets."""
    sides = box.high_m - box.low_m
    across = 0 if sides[0] >= sides[1] else 1
    beside = min(_ROOM_BESIDE[0] / (sides[0] + sides[across]), _ROOM_BESIDE[1] / max(sides[1], sides[2]))
    below = min(_ROOM_BELOW[0] / max(sides[0], sides[across]), _ROOM_BELOW[1] / (sides[1] + sides[2]))
    scale = max(beside, below)
    left, top_bottom = _MARGIN[0], _ABOVE + float(sides[1]) * scale
    if beside >= below:
        bottom = _ABOVE + float(max(sides[1], sides[2])) * scale
        corners = ((left, bottom), (2 * left + float(sides[0]) * scale, bottom))
    else:
        corners = ((left, top_bottom), (left, top_bottom + _MARGIN[1] + _ABOVE + float(sides[2]) * scale))
    above = _Panel("from above", 0, 1, *corners[0], scale, box)
    side = _Panel("from the side", across, 2, *corners[1], scale, box)
    return (above, side), corners[1][1] + _MARGIN[1] + _LEGEND


def _axes(panel: _Panel) -> str:
    """Return the frame of a view with its title, lines of round metres and their labels."""
    low, high = panel.places_px(panel.box.low_m), panel.places_px(panel.box.high_m)
    lines, words = [], [_text(low[0], high[1] - 10, panel.title, "start")]
    for metres, label in panel.box.ticks(panel.right, most=6):
        x = low[0] + (metres - panel.box.low_m[panel.right]) * panel.scale_px_m
        lines.append(f"M{x:.1f} {low[1]:.1f}V{high[1]:.1f}")
        words.append(_text(x, low[1] + 17, label, "middle"))
    for metres, label in panel.box.ticks(panel.up, most=6):
        y = low[1] - (metres - panel.box.low_m[panel.up]) * panel.scale_px_m
        lines.append(f"M{low[0]:.1f} {y:.1f}H{high[0]:.1f}")
        words.append(_text(low[0] - 7, y + 5, label, "end"))
    words.append(_text((low[0] + high[0]) / 2, low[1] + 35, _AXIS_NAMES[panel.right], "middle"))
    middle = (low[1] + high[1]) / 2
    words.append(
        f'<g transform="translate({low[0] - 54:.1f} {middle:.1f}) rotate(-90)">'
        f"{_text(0, 0, _AXIS_NAMES[panel.up], 'middle')}</g>"
    )
    return f'<path d="{"".join(lines)}" stroke-opacity="0.22"/>{"".join(words)}'


def _path(panel: _Panel, path: FlownPath) -> str:
    """Return the path as one line for each stretch of one colour, before a faint wider line that sets it off."""
    places = panel.places_px(path.positions_world_m)
    levels = _levels(path)
    drawn = []
    for start, stop in path.runs:
        changes = np.flatnonzero(np.diff(levels[start : max(start + 1, stop - 1)])) + start + 1
        for a, b in pairwise([start, *changes.tolist(), max(start, stop - 1)]):
            colour = _COLOURS[levels[a]] if levels[a] >= 0 else _NO_SPEED
            drawn.append(f'<path d="{_line(places[a : b + 1])}" stroke="{colour}"/>')
    whole = "".join(_line(places[start:stop]) for start, stop in path.runs)
    return (
        f'<g stroke-linecap="round" stroke-linejoin="round"><path d="{whole}" stroke-width="6" stroke-opacity="0.3"/>'
        f'<g stroke-width="3.5">{"".join(drawn)}</g></g>'
    )


def _levels(path: FlownPath) -> NDArray[np.intp]:
    """Return the colour of each pose as a place in the table; -1 where the speed is unknown."""
    is_finite = np.isfinite(path.speeds_m_s)
    low, high = path.speed_range_m_s or (0.0, 0.0)
    if not path.speed_varies:
        return np.where(is_finite, len(_COLOURS) // 2, -1)
    shares = (np.where(is_finite, path.speeds_m_s, low) - low) / (high - low)
    return np.where(is_finite, np.minimum(shares * len(_COLOURS), len(_COLOURS) - 1).astype(np.intp), -1)


def _line(places_px: Float64) -> str:
    """Return a line through places (n, 2); one place is a dot."""
    points = places_px if len(places_px) > 1 else np.repeat(places_px, 2, axis=0)
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _noses(panel: _Panel, path: FlownPath) -> str:
    """Return arrowheads that show where the body points, as long as they look from this side."""
    rows = np.unique(np.linspace(0, len(path.positions_world_m) - 1, _NOSES).round().astype(np.intp))
    rows = rows[np.isfinite(path.forward_world[rows]).all(axis=1)]
    # Directions are normed here, so that a wrong length does not draw over the picture.
    lengths = np.maximum(np.linalg.norm(path.forward_world[rows], axis=1, keepdims=True), 1e-12)
    ahead = path.forward_world[rows] / lengths * (_NOSE_PX / panel.scale_px_m)
    heels = panel.places_px(path.positions_world_m[rows])
    tips = panel.places_px(path.positions_world_m[rows] + ahead)
    aside = (tips - heels)[:, ::-1] * (0.3, -0.3)
    heads = "".join(_line(np.stack(corners)) + "Z" for corners in zip(heels - aside, tips, heels + aside, strict=True))
    return f'<path d="{heads}" fill="currentColor" stroke="none"/>'


def _ends(panel: _Panel, path: FlownPath) -> str:
    """Return a ring at the first pose and a square at the last."""
    first, last = panel.places_px(path.positions_world_m[[0, -1]])
    ring = f'<circle cx="{first[0]:.1f}" cy="{first[1]:.1f}" r="6" stroke-width="2.5"/>'
    square = f'<rect x="{last[0] - 5:.1f}" y="{last[1] - 5:.1f}" width="10" height="10" stroke-width="2.5"/>'
    return ring + (square if len(path.positions_world_m) > 1 else "")


def _marks(panel: _Panel, marks: Sequence[Mark]) -> str:
    """Return a diamond at each finding, with its word where there is room."""
    drawn: list[str] = []
    labelled: list[tuple[float, float]] = []
    for mark in marks:
        x, y = panel.places_px(mark.position_world_m)
        room = all(abs(x - other) > _LABEL_PX[0] or abs(y - below) > _LABEL_PX[1] for other, below in labelled)
        words = ""
        if room:
            labelled.append((x, y))
            words = _text(x + 9, y - 7, mark.word, "start")
        drawn.append(
            f'<a href="#{escape(mark.anchor)}" class="mark grave" aria-label="{escape(mark.word)}, {panel.title}">'
            f'<path class="diamond" d="M{x:.1f} {y - 6:.1f}l6 6l-6 6l-6 -6z"/>{words}</a>'
        )
    return "".join(drawn)


def _legend(path: FlownPath, y: float) -> str:
    """Return the scale of speeds, or nothing where all are alike."""
    speed_range_m_s = path.speed_range_m_s
    if speed_range_m_s is None or not path.speed_varies:
        return ""
    left, width = _MARGIN[0] + 46, 9.0
    bars = (
        f'<rect x="{left + i * width:.1f}" y="{y - 11}" width="9.5" height="12" fill="{colour}" stroke="none"/>'
        for i, colour in enumerate(_COLOURS)
    )
    right = left + len(_COLOURS) * width
    return (
        _text(left - 6, y, number(speed_range_m_s[0]), "end")
        + "".join(bars)
        + _text(right + 6, y, f"{number(speed_range_m_s[1])} m/s", "start")
    )


def _scale_bar(panel: _Panel, y: float) -> str:
    """Return a bar of a round length, about 100 px."""
    metres = round_step_m(60.0 / panel.scale_px_m)
    right = _WIDTH - 110.0
    left = right - metres * panel.scale_px_m
    bar = f'<path d="M{left:.1f} {y - 9}v8H{right:.1f}v-8" stroke-width="1.6"/>'
    return bar + _text(right + 8, y, f"{number(metres)} m", "start")


def _text(x: float, y: float, words: str, anchor: str) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="currentColor" stroke="none">{escape(words)}</text>'
    )

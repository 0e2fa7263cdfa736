"""The path of a flight in space, drawn off-screen by pyvista.

Run as a process of its own, because VTK without OpenGL ends its process with a segmentation fault::

    python -m fedora_reports.trajectory_render PATH.npz PICTURE.png
"""

import math
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from fedora_reports.trajectory_path import (
    OUTLINE,
    Box,
    FlownPath,
    Frusta,
    View,
    box_around,
    flown_path,
    speed_colours,
    view_of,
)

Float64 = NDArray[np.float64]

SIZE_PX: Final = (960, 640)
"""On a phone, at 0.37 of this, the labels are still legible."""

_MOST_POINTS: Final = 4000
_FIELD_OF_VIEW_DEG: Final = 30.0
_LEFT: Final = 0.16
"""By how much the drawing stands left of the middle, in halves of the picture: the scale of speeds is on the right."""
_MARGINS: Final = (0.61, 0.8)
"""Shares of the picture, right and up, that the box may fill; the rest is for labels and the scale of speeds."""

# A dark ground of its own reads equally well on a light and on a dark page.
_BACKGROUND: Final = "#1c2127"
_GRID: Final = "#4a545f"
_SHADOW: Final = "#7b8794"
_INK: Final = "#e6e9ed"
_NO_SPEED: Final = "#9aa5b1"

# Sizes as shares of the box's longest side.
_TUBE: Final = 0.0055
_BALL: Final = 0.014
_CONE: Final = (0.045, 0.013)
"""Length and radius of the cones that show the direction of the body."""
_LABEL_OFFSET: Final = 0.055
_CONES: Final = 14
_CLOSEST: Final = 2e-4
"""Least distance of neighbouring points of a tube."""


def draw(path: FlownPath, target: Path, frusta: Frusta | None = None) -> None:
    """Write the picture of a path, SIZE_PX large, as PNG.

    Parameters
    ----------
    path
        At least one pose.
    target
        The file to be written.
    frusta
        Of a camera along the path; None: cones show the direction of the body.
    """
    box = box_around(path.positions_world_m)
    plotter: Any = pv.Plotter(off_screen=True, window_size=list(SIZE_PX), lighting="light kit")
    plotter.set_background(_BACKGROUND)
    plotter.enable_anti_aliasing("ssaa")
    places = _scaled(path.positions_world_m, box)

    corners = np.stack(np.meshgrid(*zip(box.low_m, box.high_m, strict=True)), axis=-1).reshape(-1, 3)
    slope_up = np.tan(np.radians(_FIELD_OF_VIEW_DEG / 2))
    slope_right = slope_up * SIZE_PX[0] / SIZE_PX[1]
    view = view_of(places, _scaled(corners, box), (_MARGINS[0] * slope_right, _MARGINS[1] * slope_up))
    plotter.camera.position, plotter.camera.focal_point = view.eye.tolist(), view.target.tolist()
    plotter.camera.up, plotter.camera.view_angle = (0.0, 0.0, 1.0), _FIELD_OF_VIEW_DEG
    plotter.camera.SetWindowCenter(_LEFT, 0.0)

    # Lines of round metres on the floor of the box.
    low, high = box.low_m, box.high_m
    along_y = [[(x, low[1], low[2]), (x, high[1], low[2])] for x, _ in box.ticks(0)]
    along_x = [[(low[0], y, low[2]), (high[0], y, low[2])] for y, _ in box.ticks(1)]
    lines = _scaled(np.array(along_x + along_y).reshape(-1, 3), box)
    plotter.add_mesh(pv.line_segments_from_points(lines), color=_GRID, line_width=3.0, lighting=False)
    _draw_labels(plotter, box, view)

    # The path on the floor, and plumb lines at both ends: without them height cannot be distinguished from distance.
    floor = (box.low_m[2] - box.centre_m[2]) / box.span_m
    below = np.column_stack([places[:, :2], np.full(len(places), floor + 1e-3)])
    for start, stop in path.runs:
        if stop - start > 1:
            plotter.add_mesh(pv.lines_from_points(below[start:stop]), color=_SHADOW, line_width=4.0, lighting=False)
    plumb = np.stack([places[0], below[0], places[-1], below[-1]])
    plotter.add_mesh(pv.line_segments_from_points(plumb), color=_SHADOW, line_width=3.0, lighting=False)

    _draw_speeds(plotter, path, places)

    if frusta is not None:
        for corners in frusta.places(box):
            line = pv.lines_from_points(corners[list(OUTLINE)])
            plotter.add_mesh(line, color=_INK, line_width=3.0, lighting=False)
    else:
        _draw_cones(plotter, path, places)
    _draw_ends(plotter, places)
    plotter.reset_camera_clipping_range()
    plotter.screenshot(str(target))
    plotter.close()


def _draw_cones(plotter: Any, path: FlownPath, places: Float64) -> None:
    """Draw cones in the direction of the body, at even distances along the path."""
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    wanted = np.linspace(0.0, travelled[-1], _CONES)
    rows = np.unique(np.searchsorted(travelled, wanted, side="left").clip(0, len(places) - 1))
    length, radius = _CONE
    for row in rows[np.isfinite(path.forward_world[rows]).all(axis=1)]:
        forward = path.forward_world[row]
        if np.linalg.norm(forward) > 0:
            cone = pv.Cone(resolution=24, center=places[row], direction=forward, height=length, radius=radius)
            plotter.add_mesh(cone, color=_INK, ambient=0.4)


def _scaled(points_m: Float64, box: Box) -> Float64:
    """Return points about the centre of the box in units of its longest side: OpenGL has only single precision."""
    scaled: Float64 = (points_m - box.centre_m) / box.span_m
    return scaled


def _draw_labels(plotter: Any, box: Box, view: View) -> None:
    """Label X and Y along the near edges of the floor, and Z along the leftmost upright edge, which is also drawn."""
    low, high = box.low_m, box.high_m
    near = np.where(view.eye > 0, high, low)
    outward = np.where(view.eye > 0, 1.0, -1.0) * _LABEL_OFFSET * box.span_m
    along_x = [((x, near[1] + outward[1], low[2]), label) for x, label in box.ticks(0)]
    along_y = [((near[0] + outward[0], y, low[2]), label) for y, label in box.ticks(1)]
    feet = np.array([(x, y, low[2]) for x in (low[0], high[0]) for y in (low[1], high[1])])
    foot = feet[np.argmin(view.project(_scaled(feet, box))[:, 0])]
    upright = np.stack([foot, [foot[0], foot[1], high[2]]])
    plotter.add_mesh(pv.lines_from_points(_scaled(upright, box)), color=_GRID, line_width=3.0, lighting=False)
    aside = -view.axes[0] * _LABEL_OFFSET * box.span_m
    along_z = [((foot[0] + aside[0], foot[1] + aside[1], z), label) for z, label in box.ticks(2)[1:]]
    middle = (low + high) / 2
    names = [
        ((middle[0], near[1] + 3.0 * outward[1], low[2]), "X east, m"),
        ((near[0] + 3.4 * outward[0], middle[1], low[2]), "Y north, m"),
        ((foot[0] + aside[0], foot[1] + aside[1], high[2] + 1.2 * _LABEL_OFFSET * box.span_m), "Z up, m"),
    ]
    for places, size in (([*along_x, *along_y, *along_z], 24), (names, 25)):
        points, words = zip(*places, strict=True)
        _write(plotter, _scaled(np.array(points), box), words, size)


def _draw_speeds(plotter: Any, path: FlownPath, places: Float64) -> None:
    """Draw the path as a tube in the colours of its speed, with a scale in m/s."""
    tubes = []
    for start, stop in path.runs:
        # A tube has no direction where neighbouring points coincide: such points are left out.
        kept = [start]
        for row in range(start + 1, stop):
            if np.linalg.norm(places[row] - places[kept[-1]]) > _CLOSEST:
                kept.append(row)
        # A run that stays in one place is a ball.
        if len(kept) == 1:
            tube = pv.Sphere(radius=2 * _TUBE, center=places[start])
            tube["speed"] = np.full(tube.n_points, path.speeds_m_s[start])
        else:
            line = pv.lines_from_points(places[kept])
            line["speed"] = path.speeds_m_s[kept]
            tube = line.tube(radius=_TUBE, n_sides=16, capping=True)
        tubes.append(tube)
    mesh = pv.merge(tubes)
    speed_range_m_s = path.speed_range_m_s
    if speed_range_m_s is None or not path.speed_varies:
        plotter.add_mesh(mesh, color=_NO_SPEED if speed_range_m_s is None else speed_colours(3)[1], ambient=0.35)
        return
    plotter.add_mesh(
        mesh,
        scalars="speed",
        clim=speed_range_m_s,
        cmap=list(speed_colours(64)),
        nan_color=_NO_SPEED,
        interpolate_before_map=True,
        ambient=0.35,
        show_scalar_bar=False,
    )
    # Labels have two digits of the step between them.
    step_m_s = (speed_range_m_s[1] - speed_range_m_s[0]) / 4
    decimals = max(0, 1 - math.floor(math.log10(step_m_s)))
    plotter.add_scalar_bar(
        "speed, m/s",
        vertical=True,
        position_x=0.89,
        position_y=0.2,
        width=0.07,
        height=0.6,
        n_labels=5,
        fmt=f"{{:.{decimals}f}}",
        color=_INK,
        title_font_size=25,
        label_font_size=24,
    )


def _draw_ends(plotter: Any, places: Float64) -> None:
    """Mark the first pose by a ball and the last by a cube."""
    plotter.add_mesh(pv.Sphere(radius=_BALL, center=places[0]), color=_INK, ambient=0.4)
    apart = np.linalg.norm(places[-1] - places[0])
    if len(places) > 1 and apart > _CLOSEST:
        side = 1.7 * _BALL
        plotter.add_mesh(
            pv.Cube(center=places[-1], x_length=side, y_length=side, z_length=side), color=_INK, ambient=0.4
        )
    above = np.array([0.0, 0.0, 3 * _BALL])
    if apart < 4 * _BALL:
        _write(plotter, places[:1] + above, ("start and end" if len(places) > 1 else "the only pose",), 25)
    else:
        _write(plotter, places[[0, -1]] + above, ("start", "end"), 25)


def _write(plotter: Any, points: Float64, words: Any, size: int) -> None:
    plotter.add_point_labels(
        points,
        list(words),
        font_size=size,
        text_color=_INK,
        bold=False,
        shape=None,
        show_points=False,
        always_visible=True,
        justification_horizontal="center",
        justification_vertical="center",
    )


def main(source: str, target: str) -> None:
    """Draw a path.

    Parameters
    ----------
    source
        An npz file with the arrays that ``render_trajectory`` gets.
    target
        The picture to be written, PNG.
    """
    with np.load(source) as stored:
        arrays = dict(stored)
    centres_m, rays = (arrays.pop(name, None) for name in ("frustum_centres_world_m", "frustum_rays_world"))
    frusta = None if centres_m is None or rays is None else Frusta("", centres_m, rays)
    draw(flown_path(**arrays, most=_MOST_POINTS), Path(target), frusta)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""The world as the file itself describes it: points of depth frames with their colours, and the path among them."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from fedora_qa.record.evidence import POINT_CLOUD, named
from fedora_reports.clouds import CloudAxis, CloudView, box_scene, draw_cloud, packed_points
from fedora_reports.evidence import Evidence
from fedora_reports.scales import Axis
from fedora_reports.trajectory_path import OUTLINE, Box, FlownPath, box_around, frusta_of

_VIEW: Final = CloudView(yaw_rad=0.6, pitch_rad=0.5)
_INNER_PERCENT: Final = (2.0, 98.0)
"""The box reaches as far as these shares of the points along each axis, so that a few far ones do not make it huge."""

_FARTHEST_M: Final = 1e9
"""What lies farther from the origin of the world is no place, and is left out."""

_LEVEL_DN: Final = 0x33
"""Step of red, green and blue in the still picture: six levels, each a doubled digit in SVG."""
_STILL_POINTS: Final = 4000
"""Most points of the still picture."""

_BRIGHT_DN: Final = 230.0
"""Points are brightened until a twentieth of them is brighter than this: dark ones would not show on a dark page."""
_MOST_GAIN: Final = 8.0


@dataclass(frozen=True, slots=True)
class World:
    """Points in a box around the path and most of them.

    Attributes
    ----------
    box
        Round metres.
    points
        (n, 3) of the points in the box, about its middle, in units of its longest side.
    rgb
        (n, 3) uint8, their colours, ``gain`` times as bright as stored.
    gain
        1 or more.
    frames
        Number of depth frames that they are from.
    beyond
        Number of points that lie outside of the box.
    frusta
        (f, 6, 3) corners of frusta, as ``Frusta.places`` returns them.
    views
        What the frusta are, in a sentence; empty where there are none.
    """

    box: Box
    points: NDArray[np.float64]
    rgb: NDArray[np.uint8]
    gain: float
    frames: int
    beyond: int
    frusta: NDArray[np.float64]
    views: str

    @property
    def sides(self) -> NDArray[np.float64]:
        """Sides of the box (3,), the longest of them 1."""
        sides: NDArray[np.float64] = (self.box.high_m - self.box.low_m) / self.box.span_m
        return sides


def world_of(evidence: Evidence, path: FlownPath) -> World | None:
    """Return the world around a path; None where no points were kept, or their arrays do not fit."""
    times_us = evidence.numbers(named(POINT_CLOUD, "times_us"), None)
    origin_m = evidence.numbers(named(POINT_CLOUD, "origin_world_m"), 3)
    offsets_m = evidence.numbers(named(POINT_CLOUD, "offsets_m"), None, 3)
    rgb = None if offsets_m is None else evidence.numbers(named(POINT_CLOUD, "rgb"), len(offsets_m), 3)
    if times_us is None or origin_m is None or offsets_m is None or rgb is None or rgb.dtype != np.uint8:
        return None
    with np.errstate(invalid="ignore", over="ignore"):
        points_m = origin_m.astype(np.float64) + offsets_m
    placed = (np.abs(points_m) < _FARTHEST_M).all(axis=1)  # False for NaN
    points_m, rgb = points_m[placed], rgb[placed]
    if not len(points_m) or not path.runs:
        return None
    box = box_around(np.concatenate([path.positions_world_m, np.percentile(points_m, _INNER_PERCENT, axis=0)]))
    if not (np.isfinite(box.span_m) and box.span_m > 0):
        return None
    within = ((points_m >= box.low_m) & (points_m <= box.high_m)).all(axis=1)
    points = (points_m[within] - box.centre_m) / box.span_m
    brightest_dn = max(float(np.percentile(rgb.max(axis=1), 95)), 1.0)
    # Grey stands for an unknown colour, and stays.
    gain = min(max(_BRIGHT_DN / brightest_dn, 1.0), _MOST_GAIN) if _is_coloured(rgb) else 1.0
    bright = np.rint(np.minimum(rgb[within] * gain, 255.0)).astype(np.uint8)
    frusta = frusta_of(evidence)
    corners = np.empty((0, 6, 3)) if frusta is None else frusta.places(box)
    views = frusta.sentence if frusta is not None and len(corners) else ""
    return World(box, points, bright, gain, len(times_us), int((~within).sum()), corners, views)


def draw_world(world: World, path: FlownPath) -> tuple[Markup, str]:
    """Return the still picture of a world with the path, and its caption."""
    places = (path.positions_world_m - world.box.centre_m) / world.box.span_m
    count = len(world.points)
    still = np.unique(np.linspace(0, count - 1, min(count, _STILL_POINTS)).round().astype(np.intp))
    levels = np.rint(world.rgb[still] / _LEVEL_DN).astype(int)
    codes, paint = np.unique(levels, axis=0, return_inverse=True)
    paints = ['stroke="#' + "".join(f"{3 * level:x}" for level in code) + '"' for code in codes.tolist()]
    coloured = "in their colours" if _is_coloured(world.rgb) else "in grey"
    coloured += f", {world.gain:.1f} times as bright" if world.gain > 1.05 else ""
    beyond = f" {world.beyond} points lie outside of the box." if world.beyond else ""
    views = f" {world.views}" if world.views else ""
    caption = (
        f"{count} points of {world.frames} depth frames, {coloured}, each carried into the world by its "
        f"pose and the camera; the line is the path.{views}{beyond} Where the frames do not join to one world, depth, "
        "pose, mounting or a convention of theirs is wrong."
    )
    lines = [(corners[list(OUTLINE)], 'class="frustum"') for corners in world.frusta]
    lines += [(places[start:stop], 'class="way"') for start, stop in path.runs]
    label = f"The world: {caption}"
    svg = draw_cloud(world.points[still], paint.reshape(-1), paints, world.sides, _axes(world.box), _VIEW, label, lines)
    return Markup(svg), caption


def world_scene(world: World) -> dict[str, Any]:
    """Return the box and the points of a world as ``script/space.js`` takes them: for JSON."""
    red, green, blue = (world.rgb.astype(np.int64) >> 3).T
    cloud = packed_points(world.points, (red << 10) | (green << 5) | blue)
    return box_scene(world.sides, _VIEW, _axes(world.box)) | {"cloud": cloud}


def _is_coloured(rgb: NDArray[np.uint8]) -> bool:
    return bool((rgb.max(axis=1) > rgb.min(axis=1)).any())


def _axes(box: Box) -> tuple[CloudAxis, CloudAxis, CloudAxis]:
    x, y, z = (Axis(float(low), float(high)) for low, high in zip(box.low_m, box.high_m, strict=True))
    return CloudAxis("X east, m", x.ticks(4)), CloudAxis("Y north, m", y.ticks(4)), CloudAxis("Z up, m", z.ticks(2))

"""The path of the flight as a section of the report. A failure of the graphics libraries does not affect the rest."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from markupsafe import Markup

from fedora_qa.record.evidence import TRAJECTORY, named
from fedora_qa.record.types import GRAVE
from fedora_qa.record.wording import number, printable
from fedora_reports import trajectory
from fedora_reports.clouds import CloudAxis, CloudView, box_scene
from fedora_reports.colour_maps import png_uri
from fedora_reports.evidence import Array, Evidence
from fedora_reports.scales import Tick
from fedora_reports.timeline import AnchoredFinding
from fedora_reports.trajectory import TrajectoryPicture
from fedora_reports.trajectory_path import MOST_POINTS, OUTLINE, box_around, flown_path, frusta_of, speed_colours
from fedora_reports.trajectory_views import Mark
from fedora_reports.world import draw_world, world_of, world_scene

_MOST_MARKS: Final = 80
_LEVELS: Final = 12
_VIEW: Final = CloudView(yaw_rad=0.6, pitch_rad=0.5)
_AXES: Final = (
    CloudAxis("", (Tick(1.0, "X east"),)),
    CloudAxis("", (Tick(1.0, "Y north"),)),
    CloudAxis("", (Tick(1.0, "Z up"),)),
)


@dataclass(frozen=True, slots=True)
class Flight:
    """The path in two flat views, in SVG, with marks of findings; and in space.

    ``uri`` is a picture in space. Where none could be drawn it is empty, and ``note`` gives the reason. ``space`` is
    the path as JSON, for a drawing that a reader can turn; empty where there is no path. ``world`` is the still picture
    of the path among the points of the world, which are then also in ``space``; empty where no points were kept.
    """

    views: Markup
    views_caption: str
    uri: str
    caption: str
    note: str
    space: str
    world: Markup
    world_caption: str


def flight_of(evidence: Evidence, findings: Sequence[AnchoredFinding]) -> Flight | None:
    """Return the pictures of the path; None where no path was kept.

    Parameters
    ----------
    findings
        The findings of the file; grave ones are marked where the body was when they begin.
    """
    poses = poses_of(evidence)
    if poses is None:
        return None
    path, frusta = flown_path(*poses, most=MOST_POINTS), frusta_of(evidence)
    # A mark stands for a grave finding whose time lies within the flight. One of most of the flight has no place on it.
    order = np.argsort(path.times_us, kind="stable")
    sorted_us = path.times_us[order]
    marks = []
    for located in findings:
        start_us, stop_us = located.finding.where.start_us, located.finding.where.stop_us
        if start_us is None or not len(sorted_us) or located.finding.severity not in GRAVE:
            continue
        if not sorted_us[0] <= start_us <= sorted_us[-1]:
            continue
        if stop_us is not None and stop_us - start_us > float(sorted_us[-1] - sorted_us[0]) / 2:
            continue
        position_m = np.array([np.interp(start_us, sorted_us, path.positions_world_m[order, k]) for k in range(3)])
        marks.append(Mark(printable(located.finding.id), located.anchor, position_m))
    marks = marks[:: max(1, -(-len(marks) // _MOST_MARKS))]
    views, views_caption = trajectory.flat_views(path, marks)
    try:
        picture = trajectory.render_trajectory(*poses, frusta)
    except Exception as problem:  # noqa: BLE001 - no failure of a graphics library may spoil the report
        picture = TrajectoryPicture(b"", "", f"No picture in space: {type(problem).__name__}: {problem}")
    # The path about the middle of its box, in units of its longest side, with a colour for each point.
    space, world_view, world_caption = "", Markup(), ""
    world = world_of(evidence, path)
    if world is not None:
        world_view, world_caption = draw_world(world, path)
    if path.runs:
        box = box_around(path.positions_world_m) if world is None else world.box
        low_m_s, high_m_s = path.speed_range_m_s or (0.0, 0.0)
        span_m_s = (high_m_s - low_m_s) if path.speed_varies else np.inf
        shares = (np.nan_to_num(path.speeds_m_s, nan=low_m_s) - low_m_s) / span_m_s
        levels = np.clip(shares * _LEVELS, 0, _LEVELS - 1).astype(int)
        scene: dict[str, Any] = {
            "points": _rounded((path.positions_world_m - box.centre_m) / box.span_m),
            "levels": levels.tolist(),
            "colours": list(speed_colours(_LEVELS)),
            "runs": [list(run) for run in path.runs],
            "frusta": [] if frusta is None else _rounded(frusta.places(box)),
            "outline": OUTLINE,
            "marks": [[*_rounded((mark.position_world_m - box.centre_m) / box.span_m), mark.word] for mark in marks],
        }
        if world is None:
            sides = (box.high_m - box.low_m) / box.span_m
            scene |= box_scene(sides, _VIEW, _AXES) | {"note": f"longest side of the box {number(box.span_m)} m"}
        else:
            scene |= world_scene(world)
        space = json.dumps(scene, allow_nan=False, separators=(",", ":"))
    return Flight(
        views=Markup(views),  # the views are numbers, and words of findings that are escaped where they are written
        views_caption=views_caption,
        uri=png_uri(picture.png) if picture.png else "",
        caption=picture.caption,
        note=picture.note,
        space=space,
        world=world_view,
        world_caption=world_caption,
    )


def poses_of(evidence: Evidence) -> tuple[Array, Array, Array, Array] | None:
    """Return times, positions, speeds and directions, as ``flown_path`` takes them; None where no path was kept."""
    times_us = evidence.numbers(named(TRAJECTORY, "times_us"), None)
    count = 0 if times_us is None else len(times_us)
    positions = evidence.numbers(named(TRAJECTORY, "positions_world_m"), count, 3)
    speeds = evidence.numbers(named(TRAJECTORY, "speeds_m_s"), count)
    forward = evidence.numbers(named(TRAJECTORY, "forward_world"), count, 3)
    if times_us is None or positions is None or speeds is None or forward is None:
        return None
    return times_us, positions, speeds, forward


def _rounded(values: Any) -> Any:
    return np.round(np.asarray(values, dtype=np.float64), 4).tolist()

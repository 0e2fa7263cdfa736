"""The path that was flown, drawn by whatever the machine has: nothing that graphics do can spoil a report."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from markupsafe import Markup

from fedora_qa.record.evidence import TRAJECTORY, named
from fedora_qa.record.wording import printable
from fedora_reports import trajectory
from fedora_reports.evidence import Evidence
from fedora_reports.pictures import png_uri
from fedora_reports.timeline import Located
from fedora_reports.trajectory import TrajectoryPicture
from fedora_reports.trajectory_path import FlownPath, box_around, flown_path, speed_colours
from fedora_reports.trajectory_views import Mark

_MOST_POINTS: Final = 600
_MOST_MARKS: Final = 80
_LEVELS: Final = 12


@dataclass(frozen=True, slots=True)
class Flight:
    """The path in two flat views, in SVG, with findings marked; and in space.

    ``uri`` is a picture in space, empty where none could be drawn, which ``note`` explains. ``space`` holds the path as
    JSON, for a drawing that can be turned; empty where there is no path.
    """

    views: Markup
    views_caption: str
    uri: str
    caption: str
    note: str
    space: str


def flight_of(evidence: Evidence, findings: Sequence[Located]) -> Flight | None:
    """Return the pictures of the path; None where no path was kept."""
    times_us = evidence.numbers(named(TRAJECTORY, "times_us"), None)
    count = 0 if times_us is None else len(times_us)
    positions = evidence.numbers(named(TRAJECTORY, "positions_world_m"), count, 3)
    speeds = evidence.numbers(named(TRAJECTORY, "speeds_m_s"), count)
    forward = evidence.numbers(named(TRAJECTORY, "forward_world"), count, 3)
    if times_us is None or positions is None or speeds is None or forward is None:
        return None
    path = flown_path(times_us, positions, speeds, forward, most=_MOST_POINTS)
    marks = _marks(path, findings)
    views, views_caption = trajectory.flat_views(path, marks)
    try:
        picture = trajectory.render_trajectory(times_us, positions, speeds, forward)
    except Exception as problem:  # noqa: BLE001 - whatever a graphics library does, the rest of the report stands
        picture = TrajectoryPicture(b"", "", "", f"No picture in space: {type(problem).__name__}: {problem}")
    # The views hold numbers of the path, and words of findings that are escaped where they are written.
    uri = png_uri(picture.png) if picture.png else ""
    return Flight(Markup(views), views_caption, uri, picture.caption, picture.note, _space(path, marks))


def _marks(path: FlownPath, findings: Sequence[Located]) -> tuple[Mark, ...]:
    """Return the grave findings that have a time within the flight, where the body was then; at most so many."""
    order = np.argsort(path.times_us, kind="stable")
    times_us = path.times_us[order]
    marks = []
    for located in findings:
        start_us = located.finding.where.start_us
        if start_us is None or not len(times_us) or located.finding.severity not in {"critical", "error"}:
            continue
        if times_us[0] <= start_us <= times_us[-1] and not _lasts(located, float(times_us[-1] - times_us[0])):
            at = np.array([np.interp(start_us, times_us, path.positions_world_m[order, k]) for k in range(3)])
            marks.append(Mark(printable(located.finding.id), located.anchor, at))
    step = max(1, -(-len(marks) // _MOST_MARKS))
    return tuple(marks[::step])


def _lasts(located: Located, whole_us: float) -> bool:
    """Whether a finding is of most of the flight, so that it has no place on the path."""
    start_us, stop_us = located.finding.where.start_us, located.finding.where.stop_us
    return start_us is not None and stop_us is not None and stop_us - start_us > whole_us / 2


def _space(path: FlownPath, marks: Sequence[Mark]) -> str:
    """Return the path about the middle of its box, in units of its longest side, with a colour for each point."""
    if not path.runs:
        return ""
    box = box_around(path.positions_world_m)
    low_m_s, high_m_s = path.speed_range_m_s or (0.0, 0.0)
    span_m_s = (high_m_s - low_m_s) if path.speed_varies else np.inf
    shares = (np.nan_to_num(path.speeds_m_s, nan=low_m_s) - low_m_s) / span_m_s
    levels = np.clip(shares * _LEVELS, 0, _LEVELS - 1).astype(int)
    scene: dict[str, Any] = {
        "points": _rounded((path.positions_world_m - box.centre_m) / box.span_m),
        "levels": levels.tolist(),
        "colours": list(speed_colours(_LEVELS)),
        "runs": [list(run) for run in path.runs],
        "low": _rounded((box.low_m - box.centre_m) / box.span_m),
        "high": _rounded((box.high_m - box.centre_m) / box.span_m),
        "span_m": round(box.span_m, 3),
        "marks": [[*_rounded((mark.position_world_m - box.centre_m) / box.span_m), mark.word] for mark in marks],
    }
    return json.dumps(scene, allow_nan=False, separators=(",", ":"))


def _rounded(values: Any) -> Any:
    return np.round(np.asarray(values, dtype=np.float64), 4).tolist()

"""The pictures of a flight: two flat views, and one in space where OpenGL works, else the reason."""

import io
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from fedora_qa.record.wording import number
from fedora_reports.trajectory_path import MOST_POINTS, FlownPath, Frusta, box_around, flown_path
from fedora_reports.trajectory_views import Mark, draw_views, without_path

TIME_LIMIT_S: Final = 120.0

_CRASHED: Final = "VTK ended without a word"
_NO_PATH: Final = "No pose has a finite position: there is no path to draw."
_CONES: Final = "White cones show where the body points."
_IN_SPACE: Final = "The thin line on the ground is the path seen from above; axes in metres."
_FLAT: Final = "Arrowheads show where the body points. Seen from above and from the side at one scale; axes in metres."


@dataclass(frozen=True, slots=True)
class TrajectoryPicture:
    """A picture of a path in space.

    ``caption`` describes the picture, with units. ``png`` is empty where none could be drawn; ``note`` is then
    the reason, and empty otherwise.
    """

    png: bytes
    caption: str
    note: str


def render_trajectory(
    times_us: Any,
    positions_world_m: Any,
    speeds_m_s: Any,
    forward_world: Any,
    frusta: Frusta | None = None,
    *,
    time_limit_s: float = TIME_LIMIT_S,
) -> TrajectoryPicture:
    """Draw the path of the body through the world, coloured by its speed.

    The picture in space is drawn by pyvista in a process of its own, because VTK without OpenGL crashes. Poses whose
    position is not finite are left out, and counted in the caption.

    Parameters
    ----------
    times_us
        (n,), on the file's clock.
    positions_world_m
        (n, 3), east, north, up.
    speeds_m_s
        (n,); poses of unknown speed (NaN) are grey.
    forward_world
        (n, 3), the body's X axis; rows of NaN have no arrow.
    frusta
        Of a camera along the path; they take the place of the arrows.
    time_limit_s
        For the picture in space.

    Raises
    ------
    ValueError
        Where the arrays have other shapes.
    """
    arrays = {
        "times_us": times_us,
        "positions_world_m": positions_world_m,
        "speeds_m_s": speeds_m_s,
        "forward_world": forward_world,
    }
    path = flown_path(**arrays, most=MOST_POINTS)
    if not path.runs:
        return TrajectoryPicture(b"", _NO_PATH, "")
    views = _CONES
    if frusta is not None and len(frusta.places(box_around(path.positions_world_m))):
        arrays |= {"frustum_centres_world_m": frusta.centres_world_m, "frustum_rays_world": frusta.rays_world}
        views = frusta.sentence
    png, reason = _render(arrays, time_limit_s)
    if png:
        return TrajectoryPicture(png, _caption(path, "ball", "cube", f"{views} {_IN_SPACE}"), "")
    return TrajectoryPicture(b"", "", reason)


def flat_views(path: FlownPath, marks: Sequence[Mark]) -> tuple[str, str]:
    """Return two views of a path as SVG, and their caption."""
    if not path.runs:
        return without_path(), _NO_PATH
    marked = " Diamonds mark findings, each where the body was when it begins." if marks else ""
    return draw_views(path, marks), f"{_caption(path, 'ring', 'square', _FLAT)}{marked}"


def _caption(path: FlownPath, start: str, end: str, rest: str) -> str:
    speed_range_m_s = path.speed_range_m_s
    if speed_range_m_s is None:
        speed = "speeds unknown"
    elif path.speed_varies:
        speed = f"coloured by speed, {number(speed_range_m_s[0])} to {number(speed_range_m_s[1])} m/s"
    elif speed_range_m_s[1] < 1e-6:
        speed = "at rest"
    else:
        speed = f"at {number(speed_range_m_s[1])} m/s"
    if len(path.times_us) == 1:
        return f"Place of the body at the only pose, the {start}, {speed}. {rest}"
    seconds = number((float(path.times_us[-1]) - float(path.times_us[0])) / 1e6)
    gaps = len(path.runs) - 1
    missing = f" Positions are missing in {gaps} place{'s' if gaps > 1 else ''}." if gaps else ""
    return f"Path of the body over {seconds} s, {speed}, from the {start} to the {end}. {rest}{missing}"


def _render(arrays: dict[str, Any], time_limit_s: float) -> tuple[bytes, str]:
    """Return the picture as PNG and an empty note, or no picture and the reason in one sentence."""
    if find_spec("pyvista") is None:
        return b"", "No picture in space, because pyvista is not installed: pip install 'fedora-qa[reports]'."
    with tempfile.TemporaryDirectory(prefix="fedora-trajectory-") as folder:
        source, target = Path(folder, "path.npz"), Path(folder, "path.png")
        packed = io.BytesIO()
        np.savez(packed, **arrays)
        source.write_bytes(packed.getvalue())
        # -P: a file in the current folder must not stand in for a module.
        command = [sys.executable, "-P", "-m", "fedora_reports.trajectory_render", str(source), str(target)]
        # EGL needs no display. Where there is no EGL, VTK uses OSMesa by itself.
        environment = {"VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow", **os.environ}
        try:
            done = subprocess.run(
                command, env=environment, capture_output=True, text=True, timeout=time_limit_s, check=False
            )
        except subprocess.TimeoutExpired:
            reason = f"the render took more than {number(time_limit_s)} s"
        else:
            if done.returncode == 0 and target.is_file():
                return target.read_bytes(), ""
            # A process that a signal ended leaves warnings of VTK at most; other failures end with a line of their own.
            lines = [line.strip() for line in done.stderr.splitlines()]
            warnings = [line.rsplit("WARN|", 1)[1].split("!")[0].strip() for line in lines if "WARN|" in line]
            if done.returncode < 0:
                reason = warnings[0] if warnings else _CRASHED
            else:
                reason = (lines[-1] if lines else _CRASHED).rstrip(".")
    note = f"No picture in space, because OpenGL could not be used: {reason}; install libegl1 and libgl1-mesa-dri."
    return b"", note

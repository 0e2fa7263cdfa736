"""Whether OpenGL renders on this computer.

Rendering is tried in a process of its own: an installed library may still not draw, and a driver that fails may end the
process.
"""

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Final

from fedora_qa.cli.host import package_version

GENERATOR_INSTALL: Final = "pip install 'fedora-qa[generator]'"
REPORTS_INSTALL: Final = "pip install 'fedora-qa[reports]'"
OPENGL_INSTALL: Final = "apt install libegl1 libgl1 libgl1-mesa-dri"

_TIME_LIMIT_S: Final = 60.0

# A triangle before a background of another colour. The layers keep pyrender out of this process, so it is text here.
_DRAW_A_TRIANGLE: Final = """
import numpy, pyrender
from OpenGL import GL
renderer = pyrender.OffscreenRenderer(16, 16)
scene = pyrender.Scene(bg_color=(1.0, 0.0, 0.0, 1.0), ambient_light=(1.0, 1.0, 1.0))
scene.add(pyrender.PerspectiveCamera(yfov=1.0))
corners = numpy.array([(-9.0, -9.0, -1.0), (9.0, -9.0, -1.0), (0.0, 9.0, -1.0)])
green = pyrender.MetallicRoughnessMaterial(baseColorFactor=(0.0, 1.0, 0.0, 1.0), metallicFactor=0.0)
scene.add(pyrender.Mesh([pyrender.Primitive(positions=corners, material=green)]))
colour, depth = renderer.render(scene)
red, green, _ = (int(value) for value in colour[8, 8])
if green <= red or abs(float(depth[8, 8]) - 1.0) > 0.01:
    raise RuntimeError(f"Expected a green triangle 1 m away, got {colour[8, 8]} at {depth[8, 8]} m")
print(GL.glGetString(GL.GL_RENDERER).decode(), "OpenGL", GL.glGetString(GL.GL_VERSION).decode())
"""


@dataclass(frozen=True, slots=True)
class DrawingTrial:
    """Outcome of a trial: ``detail`` names the renderer, or states why nothing was drawn and what to install."""

    works: bool
    detail: str


def try_pyrender(environment: Mapping[str, str] | None = None) -> DrawingTrial:
    """Draw a triangle off-screen through EGL with pyrender, as the mesh world does."""
    # EGL renders without a display server. PyOpenGL reads the variable when it is imported.
    variables = {**(os.environ if environment is None else environment), "PYOPENGL_PLATFORM": "egl"}
    try:
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", _DRAW_A_TRIANGLE],
            env=variables,
            capture_output=True,
            text=True,
            timeout=_TIME_LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return DrawingTrial(
            works=False, detail=f"OpenGL did not answer within {_TIME_LIMIT_S:.0f} s: {OPENGL_INSTALL}."
        )
    if done.returncode == 0:
        return DrawingTrial(works=True, detail=done.stdout.strip())
    # The last line of a traceback states the error.
    complaint = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"ended with {done.returncode}"
    if "No module named" in complaint:
        return DrawingTrial(works=False, detail=f"{complaint}: {GENERATOR_INSTALL}.")
    return DrawingTrial(works=False, detail=f"OpenGL could not be used ({complaint}): {OPENGL_INSTALL}.")


def try_pyvista() -> DrawingTrial:
    """Draw a short path as the report does."""
    try:
        trajectory = import_module("fedora_reports.trajectory")
    except ImportError as error:
        return DrawingTrial(works=False, detail=f"{error}: {REPORTS_INSTALL}.")
    # Two poses, 1 s (1e6 us) and 1 m apart, at 1 m/s; the body's X axis points east (ENU).
    east = ((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    picture = trajectory.render_trajectory((0.0, 1e6), ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)), (1.0, 1.0), east)
    if picture.note:
        return DrawingTrial(works=False, detail=picture.note)
    return DrawingTrial(works=True, detail=f"pyvista {package_version('pyvista')} draws")

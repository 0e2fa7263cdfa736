"""``fedora-qa doctor``: test whether this machine can run the checks, and draw pictures and mesh scenes."""

import io
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Final, Literal

import click
from rich.table import Table
from rich.text import Text

from fedora_qa import __version__
from fedora_qa.cli.console import stdout_console, text
from fedora_qa.cli.exit_codes import CLEAN, INCOMPLETE
from fedora_qa.cli.host import PACKAGES, host_facts, memory_mib, package_version, usable_cores

State = Literal["ok", "missing", "broken"]

_STYLES = {"ok": "green", "missing": "yellow", "broken": "bold red"}
_BROWSERS: Final = ("chromium", "chromium-browser", "google-chrome")

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
class Symptom:
    """One examined item and its state; ``needed`` where checks cannot run without it."""

    what: str
    state: State
    detail: str
    needed: bool = True


@dataclass(frozen=True, slots=True)
class DrawingTrial:
    """Outcome of a trial: ``detail`` names the renderer, or states why nothing was drawn and what to install."""

    works: bool
    detail: str


@click.command()
def doctor() -> int:
    """Examine versions, HDF5 filters, OpenCV, cores and memory, and draw through OpenGL. Exit 0 where checks can run.

    No check needs graphics; mesh scenes and the report's picture of the trajectory do.
    """
    symptoms = tuple(examine())
    console = stdout_console()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    for column in ("what", "state"):
        table.add_column(column, no_wrap=True)
    table.add_column("detail", overflow="fold")
    for symptom in symptoms:
        table.add_row(symptom.what, Text(symptom.state, style=_STYLES[symptom.state]), text(symptom.detail))
    console.print(table)
    healthy = all(symptom.state == "ok" for symptom in symptoms if symptom.needed)
    console.print(Text("Checks can run." if healthy else "Checks cannot run: see what is broken or missing above."))
    return CLEAN if healthy else INCOMPLETE


def examine() -> Iterator[Symptom]:
    """Examine everything, in the order in which it is shown."""
    facts = host_facts()
    yield Symptom("fedora-qa", "ok", f"{__version__}, Python {facts['python']}, {facts['system']} {facts['machine']}")
    for name in PACKAGES:
        version = package_version(name)
        yield Symptom(name, "ok" if version else "missing", version or f"install it: pip install {name}")
    # A dataset in memory is written and read with the canonical codec and checksum.
    try:
        h5py, hdf5plugin, np = (import_module(name) for name in ("h5py", "hdf5plugin", "numpy"))
        values = np.arange(4096, dtype=np.int64)
        # Chunks of 1024 rows, so that several chunks pass through the filters; in memory, so that no disk is involved.
        with h5py.File(io.BytesIO(), "w") as file:
            codec = hdf5plugin.Blosc(cname="zstd", clevel=5, shuffle=hdf5plugin.Blosc.SHUFFLE)
            dataset = file.create_dataset("t", data=values, chunks=(1024,), fletcher32=True, **codec)
            same = np.array_equal(dataset[:], values)
    except Exception as error:  # noqa: BLE001 - any error of a plugin is a symptom
        yield Symptom("HDF5 Blosc-Zstd", "broken", f"{type(error).__name__}: {error}")
    else:
        yield Symptom("HDF5 Blosc-Zstd", "ok" if same else "broken", f"HDF5 {h5py.version.hdf5_version}, decodes")
    # Remapping by a fraction of a pixel: some builds of OpenCV round coordinates to 1/32 px.
    try:
        cv2, np = (import_module(name) for name in ("cv2", "numpy"))
        ramp = np.tile(np.arange(8, dtype=np.float32), (8, 1))
        # 0.01 px is less than half a step of 1/32 px: a build that rounds coordinates reads 0.01 px too little. On a
        # ramp of 1 per px the error of the value is that of the coordinate, px.
        column, row = np.meshgrid(
            np.arange(1, 7, dtype=np.float32) + np.float32(0.01), np.arange(1, 7, dtype=np.float32)
        )
        error_px = float(np.max(np.abs(cv2.remap(ramp, column, row, cv2.INTER_LINEAR) - column)))
    except Exception as error:  # noqa: BLE001 - any error of an import is a symptom
        yield Symptom("OpenCV remap", "broken", f"{type(error).__name__}: {error}")
    else:
        # Between the resolution of float32 at 7, 5e-7, and the 1e-2 px of a build that rounds.
        exact = error_px < 1e-4
        precision = "coordinates are exact" if exact else f"coordinates are rounded by up to {error_px:.2g} px"
        yield Symptom("OpenCV remap", "ok", f"OpenCV {cv2.__version__}, {precision}")
    yield Symptom("cores", "ok", f"{usable_cores()} usable")
    memory = memory_mib()
    yield Symptom("memory", "ok", f"{memory} MiB" if memory else "unknown", needed=False)
    version = package_version("jinja2")
    detail = f"jinja2 {version}" if version else f"only `check --html` needs jinja2: {REPORTS_INSTALL}"
    yield Symptom("HTML report", "ok" if version else "missing", detail, needed=False)
    yield _drawing_symptom("trajectory render", try_pyvista(), "No check needs it.")
    yield _drawing_symptom("mesh scenes", try_pyrender(), "No check needs it, and no scene of the exact world.")
    path = next(filter(None, map(shutil.which, _BROWSERS)), None)
    detail = path or "only the tests of this project need it: apt install chromium"
    yield Symptom("Chromium", "ok" if path else "missing", detail, needed=False)


def _drawing_symptom(what: str, trial: DrawingTrial, consequence: str) -> Symptom:
    detail = trial.detail if trial.works else f"{trial.detail} {consequence}"
    return Symptom(what, "ok" if trial.works else "missing", detail, needed=False)


def try_pyrender() -> DrawingTrial:
    """Draw a triangle off-screen through EGL with pyrender, as the mesh world does.

    In a process of its own: an installed library may still not draw, and a driver that fails may end the process.
    """
    # EGL renders without a display server. PyOpenGL reads the variable when it is imported.
    variables = {**os.environ, "PYOPENGL_PLATFORM": "egl"}
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

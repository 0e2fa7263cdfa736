"""``fedora-qa doctor``: say whether this machine can run the checks, and what pictures and mesh scenes lack."""

import io
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Final, Literal

import click
from rich.table import Table
from rich.text import Text

from fedora_qa import __version__
from fedora_qa.cli.exit_codes import CLEAN, INCOMPLETE
from fedora_qa.cli.graphics import REPORTS_INSTALL, DrawingTrial, try_pyrender, try_pyvista
from fedora_qa.cli.host import PACKAGES, host_facts, memory_mib, package_version, usable_cores
from fedora_qa.cli.terminal import stdout_console, text

State = Literal["ok", "missing", "broken"]

_STYLES = {"ok": "green", "missing": "yellow", "broken": "bold red"}
_BROWSERS: Final = ("chromium", "chromium-browser", "google-chrome")


@dataclass(frozen=True, slots=True)
class Symptom:
    """One examined item and its state; ``needed`` where checks cannot run without it."""

    what: str
    state: State
    detail: str
    needed: bool = True


@click.command(short_help="Say whether this machine can run the checks.")
def doctor() -> int:
    """Look at versions, HDF5 filters, OpenCV, cores and memory, and draw through OpenGL. Exit 0 when checks can run.

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
    yield _blosc()
    yield _remap()
    yield Symptom("cores", "ok", f"{usable_cores()} usable")
    memory = memory_mib()
    yield Symptom("memory", "ok", f"{memory} MiB" if memory else "unknown", needed=False)
    yield _report()
    yield _drawn("trajectory render", try_pyvista(), "No check needs it.")
    yield _drawn("mesh scenes", try_pyrender(), "No check needs it, and no scene of the exact world.")
    path = next(filter(None, map(shutil.which, _BROWSERS)), None)
    detail = path or "only the tests of this project need it: apt install chromium"
    browser = Symptom("Chromium", "ok" if path else "missing", detail, needed=False)
    yield browser


def _blosc() -> Symptom:
    """Write and read a dataset in memory with the canonical codec and checksum."""
    try:
        h5py, hdf5plugin, np = (import_module(name) for name in ("h5py", "hdf5plugin", "numpy"))
        values = np.arange(4096, dtype=np.int64)
        # Chunks of 1024 rows, so that several chunks pass through the filters; in memory, so that no disk is involved.
        with h5py.File(io.BytesIO(), "w") as file:
            codec = hdf5plugin.Blosc(cname="zstd", clevel=5, shuffle=hdf5plugin.Blosc.SHUFFLE)
            dataset = file.create_dataset("t", data=values, chunks=(1024,), fletcher32=True, **codec)
            same = np.array_equal(dataset[:], values)
    except Exception as error:  # noqa: BLE001 - any error of a plugin is a symptom
        return Symptom("HDF5 Blosc-Zstd", "broken", f"{type(error).__name__}: {error}")
    return Symptom("HDF5 Blosc-Zstd", "ok" if same else "broken", f"HDF5 {h5py.version.hdf5_version}, decodes")


def _remap() -> Symptom:
    """Remap by a fraction of a pixel: some builds round coordinates to 1/32 px."""
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
        return Symptom("OpenCV remap", "broken", f"{type(error).__name__}: {error}")
    # Between the resolution of float32 at 7, 5e-7, and the 1e-2 px of a build that rounds.
    precision = "coordinates are exact" if error_px < 1e-4 else f"coordinates are rounded by up to {error_px:.2g} px"
    return Symptom("OpenCV remap", "ok", f"OpenCV {cv2.__version__}, {precision}")


def _report() -> Symptom:
    version = package_version("jinja2")
    detail = f"jinja2 {version}" if version else f"only `check --html` needs jinja2: {REPORTS_INSTALL}"
    return Symptom("HTML report", "ok" if version else "missing", detail, needed=False)


def _drawn(what: str, trial: DrawingTrial, without: str) -> Symptom:
    detail = trial.detail if trial.works else f"{trial.detail} {without}"
    return Symptom(what, "ok" if trial.works else "missing", detail, needed=False)

"""Small generated sequences, and edits that take a copy of one to an extreme."""

import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import hdf5plugin  # noqa: F401  makes filter 32001 known to HDF5
import numpy as np
from numpy.typing import NDArray

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import Scene
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import FileRecord
from tests.support.all_checks import CHECKS
from tests.support.sequences import small_scene

Edit = Callable[[h5py.File], None]

FLOW_HZ = (10, 25, 50)
FRAMES = ("rgb", "depth")


def park(name: str = "park-day") -> Scene:
    """Return a scene of the park, as small as still shows what is asked."""
    return small_scene(name, 180, 136)


def lit(scene: Scene, **changes: float) -> Scene:
    """Return the scene in another light."""
    return replace(scene, light=replace(scene.light, **changes))


def generated(scene: Scene, target: Path, duration_s: float = 0.5) -> Path:
    """Write half a second of a scene."""
    generate_sequence(scene, target, Request(duration_s=duration_s, quality="draft"))
    return target


def edited(source: Path, target: Path, edit: Edit) -> Path:
    """Write an edited copy."""
    shutil.copy(source, target)
    with h5py.File(target, "r+") as file:
        edit(file)
    return target


def replace_rows(file: h5py.File, key: str, rows: NDArray[Any]) -> None:
    """Store other rows under the same name, with the same attributes."""
    attributes = dict(file[key].attrs)
    del file[key]
    chunks = (1, *rows.shape[1:]) if rows.ndim > 2 and len(rows) else None
    file.create_dataset(key, data=rows, chunks=chunks).attrs.update(attributes)


def replace_events(file: h5py.File, x: NDArray[Any], y: NDArray[Any], t: NDArray[Any], p: NDArray[Any]) -> None:
    """Store other events, in the order of time, and the index maps that follow from them."""
    order = np.argsort(t, kind="stable")
    for name, rows, kind in (("x", x, np.uint16), ("y", y, np.uint16), ("t", t, np.int64), ("p", p, np.uint8)):
        replace_rows(file, f"path/events/{name}", rows[order].astype(kind))
    for stream in FRAMES:
        file[f"metadata/{stream}_to_event"][:] = np.searchsorted(t[order], file[f"path/{stream}_ts"][:])


def keep_events(file: h5py.File, count: int) -> None:
    """Keep the first events only."""
    replace_events(file, *(file[f"path/events/{name}"][:count] for name in "xytp"))


def keep_frames(file: h5py.File, count: int) -> None:
    """Keep the first frames only, and no flow."""
    for stream in FRAMES:
        for key in (f"path/{stream}", f"path/{stream}_ts", f"metadata/{stream}_to_event"):
            replace_rows(file, key, file[key][:count])
    del file["path/flow"], file["metadata/flow"]


def record_of(path: Path, *select: str) -> FileRecord:
    """Check a whole file, or what is selected."""
    return check_file(path, CheckOptions(select=select, evidence=None)).record


def outcomes(record: FileRecord) -> dict[str, str]:
    """Return the outcome of each check."""
    return {result.check: result.outcome for result in record.results}


def alarms(record: FileRecord) -> list[str]:
    """Return what failed or crashed, in words."""
    return [
        f"{r.check} {r.outcome}: {[finding.message for finding in r.findings]} {r.traceback}"
        for r in record.results
        if r.outcome in {"failed", "crashed"}
    ]


def named(record: FileRecord) -> list[tuple[str, str]]:
    """Return stream and cause of each diagnosis."""
    return [(diagnosis.stream, diagnosis.cause) for diagnosis in record.diagnoses]


def passed(record: FileRecord, checks: Iterable[str]) -> list[str]:
    """Return those of the checks that passed."""
    found = outcomes(record)
    return [check for check in checks if found[check] == "passed"]


def checks_of(*streams: str) -> list[str]:
    """Return the names of the checks that need any of the streams."""
    return [check.name for check in CHECKS if set(streams) & set(check.needs)]

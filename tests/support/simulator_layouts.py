"""Sequences laid out as simulators and logging scripts write them, with content of the reference generator.

Written by hand from those scripts, so that an error of a dialect is no error of the writer: github.com/SensorsINI/v2e,
v2ecore/emulator.py; github.com/uzh-rpg/rpg_vid2e, esim_torch/scripts/generate_events.py and the writer of DSEC's events
that it calls; and the description of the lab's logging scripts in the dialect ``purdue-lab``.
"""

from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np

from tests.support.dsec_folder import write_png
from tests.support.event_view import TwoViews

Array = np.ndarray[Any, Any]


def write_v2e_file(source: TwoViews, path: Path) -> Path:
    """Write a sequence of the generator as v2e writes HDF5: events t, x, y, p in 32 bits, and grey frames."""
    with h5py.File(source.sequence) as file, h5py.File(path, "w") as written:
        events = {name: file[f"path/events/{name}"][:] for name in "txyp"}
        rows = np.stack(list(events.values()), axis=1).astype(np.uint32)
        written.create_dataset("events", data=rows, maxshape=(None, 4), compression="gzip")
        with h5py.File(source.event_sized) as event_sized:
            frames = np.stack([cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in event_sized["path/rgb"]])
        written.create_dataset("frame", data=frames, compression="gzip")
        times = file["path/rgb_ts"][:]
        written.create_dataset("frame_ts", data=times.astype(np.uint32), compression="gzip")
        # Events are written up to the frame, and then counted.
        counted = np.searchsorted(events["t"], times, "right").astype(np.uint64)
        written.create_dataset("frame_idx", data=counted, compression="gzip")
    return path


def write_vid2e_folder(source: TwoViews, folder: Path) -> Path:
    """Write a sequence of the generator as vid2e does: images, seconds in text, and events."""
    (folder / "imgs").mkdir(parents=True)
    with h5py.File(source.sequence) as file, h5py.File(source.event_sized) as event_sized:
        for row, image in enumerate(event_sized["path/rgb"]):
            write_png(folder / f"imgs/{row:08d}.png", image)
        np.savetxt(folder / "timestamps.txt", file["path/rgb_ts"][:] / 1e6)
        times = file["path/events/t"][:]
        with h5py.File(folder / "events.h5", "w") as written:
            for name, dtype in (("x", np.uint16), ("y", np.uint16), ("p", np.uint8)):
                written[f"events/{name}"] = file[f"path/events/{name}"][:].astype(dtype)
            written["events/t"] = (times - times[0]).astype(np.uint32)
            written["t_offset"] = times[0]
            milliseconds = np.arange((times[-1] - times[0]) // 1000 + 1) * 1000
            written["ms_to_idx"] = np.searchsorted(times - times[0], milliseconds).astype(np.uint64)
    return folder


def write_purdue_lab_file(source: TwoViews, path: Path) -> Path:
    """Write a sequence of the generator as the lab's scripts do: float64 microseconds, metres, no attributes."""
    with h5py.File(source.sequence) as file, h5py.File(path, "w") as written:
        written["path/depth"] = (file["path/depth"][:] / 1000).astype(np.float32)
        written["path/depth_ts"] = file["path/depth_ts"][:].astype(np.float64)
        written["path/img"] = file["path/rgb"][:]
        written["path/imgts"] = file["path/rgb_ts"][:].astype(np.float64)
        written["path/events"] = np.stack(
            [file[f"path/events/{name}"][:].astype(np.float64) for name in "xytp"], axis=1
        )
        written["path/a"] = file["path/imu/linear_acceleration"][:]
        written["path/w"] = file["path/imu/angular_velocity"][:]
    return path


def write_shared_camera(source: TwoViews, path: Path) -> Path:
    """Declare the camera that frames and events of the stand-ins share, and how their sensor responds."""
    with h5py.File(source.sequence) as file:
        camera = file["metadata/cameras/events"].attrs
        sensor = file["metadata/events"].attrs
        lines = ["[metadata]"]
        for name in ("rgb", "events"):
            owner = f"metadata/cameras/{name}"
            lines += [f'"{owner}/{side}" = {int(camera[side])}' for side in ("width", "height")]
            lines += [f'"{owner}/{matrix}" = {camera[matrix].tolist()}' for matrix in ("K", "T_body_camera")]
        lines += ['"metadata/events/model" = "log"']
        lines += [f'"metadata/events/{name}" = {float(sensor[name])}' for name in ("threshold_on", "threshold_off")]
        path.write_text("\n".join([*lines, ""]), "utf-8")
    return path

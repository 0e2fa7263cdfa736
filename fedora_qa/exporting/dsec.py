"""The folder of a sequence as DSEC has it: events, images, flow and calibration.

Sources: https://dsec.ifi.uzh.ch/data-format (events in us from ``t_offset``, ``ms_to_idx``, images and their times),
https://dsec.ifi.uzh.ch/optical-flow-submission-format (16-bit flow). Disparity is left out: it would need a second
camera, which a sequence does not have.
"""

from pathlib import Path
from typing import Any, Final

import cv2
import h5py
import hdf5plugin
import numpy as np
import yaml
from numpy.typing import NDArray

from fedora_qa.engine.progress import Progress
from fedora_qa.errors import MisuseError
from fedora_qa.layout.canonical import flow_rate_hz, is_flow_stream
from fedora_qa.record.atomic import staging_path
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.sequence import Sequence, file_times_us, row_blocks

_US_PER_MS: Final = 1000
_MOST_US: Final = (1 << 32) - 1
"""Timestamps have 32 bits: 71 minutes from the first event."""

_FLOW_HZ: Final = 10.0
"""Rate of the flow of DSEC, which no name in the folder states: flow of another rate would be read as a fault."""

_CHUNK_ROWS: Final = 1 << 16
_FLOW_ZERO: Final = 1 << 15
_FLOW_PER_PX: Final = 128
_COMPRESSION: Final = [cv2.IMWRITE_PNG_COMPRESSION, 1]
_SAME_CENTRE_M: Final = 1e-9

_RECTIFIED: Final = "camRect0"
"""The view in which flow lies: that of the depth camera, or without one of the event camera."""


def write_dsec(sequence: Sequence, target: Path, report: Progress) -> dict[str, int]:
    """Write what DSEC has a place for into a new folder, and return the number of rows by stream.

    Raises
    ------
    MisuseError
        There is nothing to write, or it does not fit the layout.
    UnreadableRowsError
        Rows cannot be decoded.
    OSError
        The folder cannot be written.
    """
    layout = sequence.layout
    flow = next((name for name in layout.streams if is_flow_stream(name) and flow_rate_hz(name) == _FLOW_HZ), "")
    if not {"events", "rgb"} & layout.streams:
        raise MisuseError("Expected events or images to write as DSEC has them, got neither; check the file first")
    rows: dict[str, int] = {}
    with staging_path(target) as folder:
        folder.mkdir()
        if "events" in layout.streams:
            rows["events"] = _write_events(sequence, folder / "events/left", report)
        if "rgb" in layout.streams:
            rows["rgb"] = _write_images(sequence, folder / "images", report)
        if flow:
            rows[flow] = _write_flow(sequence, flow, folder / "optical_flow", report)
        calibration = _calibration(sequence.declared.cameras)
        if calibration is not None:
            (folder / "calibration").mkdir()
            (folder / "calibration/cam_to_cam.yaml").write_text(yaml.safe_dump(calibration), "utf-8")
        folder.rename(target)
    return rows


def _write_events(sequence: Sequence, folder: Path, report: Progress) -> int:
    folder.mkdir(parents=True)
    count = sequence.layout.bindings["path/events/t"].rows
    first_us = int(file_times_us(sequence, "path/events/t", 0, 1)[0]) if count else 0
    with h5py.File(folder / "events.h5", "w") as file:
        storage = hdf5plugin.Blosc(cname="zstd", clevel=3, shuffle=hdf5plugin.Blosc.SHUFFLE)
        datasets = {
            name: file.create_dataset(
                f"events/{name}", (count,), dtype, chunks=(min(count, _CHUNK_ROWS),) if count else None, **storage
            )
            for name, dtype in (("x", "u2"), ("y", "u2"), ("p", "u1"), ("t", "u4"))
        }
        file["t_offset"] = np.int64(first_us)
        by_millisecond = np.zeros(1, np.int64)
        for start, stop in row_blocks(count):
            times_us = file_times_us(sequence, "path/events/t", start, stop) - first_us
            if times_us.min() < 0 or times_us.max() > _MOST_US:
                raise MisuseError(
                    f"Expected events within 71 minutes of the first, got {times_us.min()} to {times_us.max()} us; "
                    "repair the timestamps, or export a part"
                )
            counts = np.bincount(times_us // _US_PER_MS)
            longer = max(len(counts), len(by_millisecond))
            by_millisecond = np.pad(by_millisecond, (0, longer - len(by_millisecond)))
            by_millisecond[: len(counts)] += counts
            datasets["t"][start:stop] = times_us
            for name in "xyp":
                datasets[name][start:stop] = _whole(sequence, f"path/events/{name}", start, stop, datasets[name].dtype)
            report("events", stop, count)
        # Entry k is the first event that is not earlier than k ms after the offset.
        file["ms_to_idx"] = np.concatenate([[0], np.cumsum(by_millisecond)[:-1]]).astype(np.uint64)
    return count


def _whole(sequence: Sequence, key: str, start: int, stop: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return rows of whole numbers; raises ``MisuseError`` where the layout cannot hold them."""
    values = sequence.rows(key, start, stop)
    if key == "path/events/p" and values.max() > 1:
        raise MisuseError(f"Expected polarity 0 or 1 in {key}, got another; repair the file first")
    if values.dtype.itemsize > dtype.itemsize and (values.min() < 0 or values.max() > np.iinfo(dtype).max):
        raise MisuseError(f"Expected {key} from 0 to {np.iinfo(dtype).max}, got {values.min()} to {values.max()}")
    return values


def _write_images(sequence: Sequence, folder: Path, report: Progress) -> int:
    (folder / "left/rectified").mkdir(parents=True)
    count = sequence.layout.bindings["path/rgb"].rows
    with (folder / "timestamps.txt").open("w", encoding="utf-8") as text:
        for row in range(count):
            image = sequence.rows("path/rgb", row, row + 1)[0]
            _write_png(folder / f"left/rectified/{row:06d}.png", image)
            text.write(f"{file_times_us(sequence, 'path/rgb_ts', row, row + 1)[0]}\n")
            report("images", row + 1, count)
    return count


def _write_flow(sequence: Sequence, stream: str, folder: Path, report: Progress) -> int:
    (folder / "forward").mkdir(parents=True)
    key = f"path/{stream}"
    count = sequence.layout.bindings[key].rows
    with (folder / "forward_timestamps.txt").open("w", encoding="utf-8") as text:
        text.write("# from_timestamp_us, to_timestamp_us\n")
        for row in range(count):
            _write_png(folder / f"forward/{row:06d}.png", _encoded_flow(sequence.rows(key, row, row + 1)[0]))
            first_us, last_us = file_times_us(sequence, f"{key}_ts", row, row + 1)[0]
            text.write(f"{first_us}, {last_us}\n")
            report("flow", row + 1, count)
    return count


def _encoded_flow(flow_px: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return (H, W, 3): 2^15 + 128 u, 2^15 + 128 v, valid; flow beyond 256 px does not fit and is invalid."""
    valid: NDArray[np.bool_] = np.all(np.isfinite(flow_px), axis=-1)
    # float64: the sum has more digits than float32 holds.
    values = np.rint(np.where(valid[..., np.newaxis], flow_px.astype(np.float64), 0.0) * _FLOW_PER_PX) + _FLOW_ZERO
    valid &= np.all((values >= 0) & (values <= np.iinfo(np.uint16).max), axis=-1)
    return np.dstack([np.where(valid[..., np.newaxis], values, 0), valid]).astype(np.uint16)


def _write_png(path: Path, image: NDArray[Any]) -> None:
    # OpenCV takes blue, green, red.
    if not cv2.imwrite(str(path), np.ascontiguousarray(image[..., ::-1]), _COMPRESSION):
        raise MisuseError(f"Expected {path.name} to be written, got no file; make room, or choose another folder")


def _calibration(cameras: Any) -> dict[str, Any] | None:
    """Return the calibration of the cameras, all pinholes; None where one is not declared, or is none.

    Raises
    ------
    MisuseError
        The event camera and the view of flow have different centres, which the layout cannot express.
    """
    if not {"events", "rgb"} <= set(cameras) or any(camera.model != "pinhole" for camera in cameras.values()):
        return None
    events, rgb = cameras["events"], cameras["rgb"]
    rectified = cameras.get("depth", events)
    T_rectified_events = np.linalg.inv(rectified.T_body_camera) @ events.T_body_camera
    if np.linalg.norm(T_rectified_events[:3, 3]) > _SAME_CENTRE_M:
        raise MisuseError(
            "Expected the event camera and that of depth and flow to share their centre, as DSEC has it, got "
            f"{np.linalg.norm(T_rectified_events[:3, 3]):.3g} m between them; leave flow out"
        )
    T_rgb_events = np.linalg.inv(rgb.T_body_camera) @ events.T_body_camera
    return {
        "intrinsics": {"cam0": _intrinsics(events), _RECTIFIED: _intrinsics(rectified), "camRect1": _intrinsics(rgb)},
        "extrinsics": {
            "R_rect0": T_rectified_events[:3, :3].tolist(),
            "R_rect1": np.eye(3).tolist(),
            "T_10": T_rgb_events.tolist(),
        },
    }


def _intrinsics(camera: Camera) -> dict[str, Any]:
    K = camera.K
    return {
        "camera_matrix": [float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])],
        "camera_model": "pinhole",
        "distortion_coeffs": [0.0, 0.0, 0.0, 0.0],
        "distortion_model": "radtan",
        "resolution": [camera.width, camera.height],
    }

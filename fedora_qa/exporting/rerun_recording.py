"""A recording for the viewer Rerun: every stream on one timeline, and the findings of a record beside them.

The timeline ``sequence`` counts from the origin of the file. Images are stored as PNG, without loss but for depth,
which is rounded to millimetres. Events between two colour frames make one picture of their net numbers.
"""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import rerun
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M, NS_PER_US
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import MisuseError
from fedora_qa.layout.canonical import is_flow_stream
from fedora_qa.record.atomic import replacing
from fedora_qa.record.types import FileRecord, Finding
from fedora_qa.sequence.sequence import Sequence, row_blocks

TIMELINE: Final = "sequence"

BODY: Final = "world/body"
EVENTS: Final = f"{BODY}/events/net"
FINDINGS: Final = "findings"
"""Paths of entities."""

_EVENT_PICTURE_NS: Final = 20_000_000
"""Time of one picture of events where there are no colour frames."""

_SATURATED_EVENTS: Final = 3
"""Net number of events from which on a pixel of their picture has its full colour."""

_ARROWS: Final = 40
"""Arrows of flow along the longer side of the image."""

_FULL_DN: Final = 255
_LEVELS: Final = {"critical": "CRITICAL", "error": "ERROR", "warning": "WARN", "info": "INFO"}


def write_rerun(
    sequence: Sequence, target: Path, record: FileRecord | None, report: Progress
) -> tuple[dict[str, int], tuple[str, ...]]:
    """Write a recording, and return the number of rows by stream, and what is left out.

    Parameters
    ----------
    sequence
        The sequence.
    target
        A new file.
    record
        What a check found in the sequence; None: no findings.
    report
        Called before each stream is written.

    Raises
    ------
    MisuseError
        The sequence has no stream.
    UnreadableRowsError
        Rows cannot be decoded.
    """
    streams = sequence.layout.streams
    if not streams:
        raise MisuseError("Expected streams to show, got none; check the file first")
    rows: dict[str, int] = {}
    with replacing(target) as temporary:
        stream = rerun.RecordingStream("fedora-qa", recording_id=sequence.path.name)
        stream.save(temporary)
        # The instant of the export is no time of the sequence.
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        _log_cameras(stream, sequence)
        writers: dict[str, Callable[[rerun.RecordingStream, Sequence], int]] = {
            "pose": _log_poses, "imu": _log_imu, "rgb": _log_colour, "depth": _log_depth, "events": _log_events,
            **{name: partial(_log_flow, name=name) for name in sorted(streams) if is_flow_stream(name)},
        }  # fmt: skip
        present = [name for name in writers if name in streams]
        for done, name in enumerate(present):
            report("writing", done, len(present))
            rows[name] = writers[name](stream, sequence)
        if record is not None:
            _log_findings(stream, sequence, record)
        # Closes the file: the recording has its footer before it gets its name.
        stream.disconnect()
    left_out = sorted(streams - rows.keys())
    return rows, tuple(f"{name} has no picture and is left out" for name in left_out)


def _log_cameras(stream: rerun.RecordingStream, sequence: Sequence) -> None:
    for name, camera in sequence.declared.cameras.items():
        mounting = camera.T_body_camera
        stream.log(
            f"{BODY}/{name}",
            rerun.Transform3D(translation=mounting[:3, 3], mat3x3=mounting[:3, :3]),
            rerun.Pinhole(
                image_from_camera=camera.K, width=camera.width, height=camera.height,
                camera_xyz=rerun.ViewCoordinates.RDF,
            ),
            static=True,
        )  # fmt: skip


def _log_poses(stream: rerun.RecordingStream, sequence: Sequence) -> int:
    count = sequence.layout.bindings["path/pose/ts"].rows
    for start, stop in row_blocks(count):
        positions = sequence.rows("path/pose/position", start, stop)
        orientations = sequence.rows("path/pose/orientation", start, stop)
        columns = rerun.Transform3D.columns(translation=positions, quaternion=orientations)
        stream.send_columns(BODY, indexes=[_times(sequence, "path/pose/ts", start, stop)], columns=columns)
    path = sequence.rows("path/pose/position", 0, count)
    stream.log("world/path", rerun.LineStrips3D([path]), static=True)
    return count


def _log_imu(stream: rerun.RecordingStream, sequence: Sequence) -> int:
    count = sequence.layout.bindings["path/imu/ts"].rows
    for key in ("angular_velocity", "linear_acceleration"):
        stream.log(f"imu/{key}", rerun.SeriesLines(names=["x", "y", "z"]), static=True)
        for start, stop in row_blocks(count):
            values = sequence.rows(f"path/imu/{key}", start, stop)
            stream.send_columns(
                f"imu/{key}",
                indexes=[_times(sequence, "path/imu/ts", start, stop)],
                columns=rerun.Scalars.columns(scalars=values),
            )
    return count


def _log_colour(stream: rerun.RecordingStream, sequence: Sequence) -> int:
    count = 0
    for time_ns, image in _images(sequence, "path/rgb"):
        _set_time(stream, time_ns)
        contents = _png(np.ascontiguousarray(image[..., ::-1]))
        stream.log(f"{BODY}/rgb", rerun.EncodedImage(contents=contents, media_type="image/png"))
        count += 1
    return count


def _log_depth(stream: rerun.RecordingStream, sequence: Sequence) -> int:
    count = 0
    for time_ns, depth_mm in _images(sequence, "path/depth"):
        _set_time(stream, time_ns)
        limits = np.iinfo(np.uint16)
        # 0 is drawn as no depth.
        whole_mm = np.clip(np.rint(np.nan_to_num(depth_mm, nan=0.0)), 0, limits.max).astype(np.uint16)
        stream.log(
            f"{BODY}/depth",
            rerun.EncodedDepthImage(blob=_png(whole_mm), media_type="image/png", meter=MM_PER_M),
        )
        count += 1
    return count


def _log_events(stream: rerun.RecordingStream, sequence: Sequence) -> int:
    count, camera = sequence.layout.bindings["path/events/t"].rows, sequence.declared.cameras.get("events")
    if camera is None or not count:
        return count
    if "rgb" in sequence.layout.streams:
        ends_ns = sequence.rows("path/rgb_ts", 0, sequence.layout.bindings["path/rgb_ts"].rows)
    else:
        first_ns, last_ns = (int(sequence.rows("path/events/t", row, row + 1)[0]) for row in (0, count - 1))
        ends_ns = np.arange(first_ns, last_ns + _EVENT_PICTURE_NS, _EVENT_PICTURE_NS)
    net, done = np.zeros((camera.height, camera.width), np.int16), 0
    for start, stop in row_blocks(count):
        x, y, t, p = (sequence.rows(f"path/events/{name}", start, stop).astype(np.int64) for name in "xytp")
        on_sensor = (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
        # Events at an end belong to the picture before it.
        pictures = np.where(on_sensor, np.searchsorted(ends_ns, t, side="left"), -1)
        for picture in np.unique(pictures[pictures >= 0]).tolist():
            done = _log_event_pictures(stream, net, ends_ns[done:picture], done)
            chosen = pictures == picture
            np.add.at(net, (y[chosen], x[chosen]), np.where(p[chosen] > 0, 1, -1))
    _log_event_pictures(stream, net, ends_ns[done:], done)
    return count


def _log_event_pictures(
    stream: rerun.RecordingStream, net: NDArray[np.int16], ends_ns: NDArray[np.int64], done: int
) -> int:
    """Write the picture of net numbers (h, w), which are then 0, at each end; return how many pictures are done."""
    for end_ns in ends_ns.tolist():
        _set_time(stream, end_ns)
        stream.log(EVENTS, rerun.EncodedImage(contents=_png(_event_picture(net)), media_type="image/png"))
        net[:] = 0
    return done + len(ends_ns)


def _event_picture(net: NDArray[np.int16]) -> NDArray[np.uint8]:
    """Return net numbers of events (h, w) as a picture (h, w, 3), B, G, R: red is brighter, blue darker, white none."""
    share = np.clip(net / _SATURATED_EVENTS, -1.0, 1.0)[..., np.newaxis]
    # Of a full colour the two other channels are dark.
    brighter, darker = np.array([1.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0])
    dark = np.maximum(share, 0) * brighter + np.maximum(-share, 0) * darker
    picture: NDArray[np.uint8] = np.rint(_FULL_DN * (1.0 - dark)).astype(np.uint8)
    return picture


def _log_flow(stream: rerun.RecordingStream, sequence: Sequence, name: str) -> int:
    key = f"path/{name}"
    count = sequence.layout.bindings[key].rows
    for row in range(count):
        flow_px = sequence.rows(key, row, row + 1)[0]
        start_ns = int(sequence.rows(f"{key}_ts", row, row + 1)[0, 0])
        step = max(max(flow_px.shape[:2]) // _ARROWS, 1)
        rows, columns = (axis.ravel() for axis in np.mgrid[0 : flow_px.shape[0] : step, 0 : flow_px.shape[1] : step])
        vectors = flow_px[rows, columns]
        valid = np.isfinite(vectors).all(axis=1)
        origins = np.stack([columns, rows], axis=1)[valid]
        _set_time(stream, start_ns)
        stream.log(f"{BODY}/depth/{name.replace('/', '_')}", rerun.Arrows2D(origins=origins, vectors=vectors[valid]))
    return count


def _log_findings(stream: rerun.RecordingStream, sequence: Sequence, record: FileRecord) -> None:
    """Write findings at the beginning of their places; those of the whole file at the origin."""
    findings = [(result.check, finding) for result in record.results for finding in result.findings]
    for check, finding in sorted(findings, key=lambda each: _start_ns(sequence, each[1])):
        _set_time(stream, _start_ns(sequence, finding))
        stream.log(FINDINGS, rerun.TextLog(f"{check}: {finding.message}", level=_LEVELS[finding.severity]))


def _start_ns(sequence: Sequence, finding: Finding) -> int:
    start_us = finding.where.start_us
    return 0 if start_us is None else round(start_us * NS_PER_US) - sequence.origin_ns


def _images(sequence: Sequence, key: str) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield time, ns from the origin, and image of each row."""
    for row in range(sequence.layout.bindings[key].rows):
        yield int(sequence.rows(f"{key}_ts", row, row + 1)[0]), sequence.rows(key, row, row + 1)[0]


def _times(sequence: Sequence, key: str, start: int, stop: int) -> Any:
    return rerun.TimeColumn(TIMELINE, duration=sequence.rows(key, start, stop).astype("timedelta64[ns]"))


def _set_time(stream: rerun.RecordingStream, time_ns: int) -> None:
    stream.set_time(TIMELINE, duration=np.timedelta64(time_ns, "ns"))


def _png(image: NDArray[Any]) -> bytes:
    return bytes(cv2.imencode(".png", image)[1])

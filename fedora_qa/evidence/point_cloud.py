"""The world as the file itself describes it: points of depth frames, carried into the world by the poses."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import in_families
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.evidence.snapshot import EVENTS_NS, nearest_row
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.geometry.lens import rays_of_pixels
from fedora_qa.record.evidence import POINT_CLOUD, named
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import why_not_one_view
from fedora_qa.views.flow_intervals import pose_track

Float64 = NDArray[np.float64]

_FARTHEST_FRAME_NS: Final = EVENTS_NS // 2
"""A colour frame farther from the depth frame shows another view, and colours no point."""

_GREY: Final = 128


@dataclass(frozen=True, slots=True)
class PointCloud:
    """Points of one depth frame.

    Attributes
    ----------
    time_ns
        Timestamp of the frame, ns from the file's origin.
    position_world_m
        (3,) of the body at that time, m.
    points_world_m
        (n, 3) m; all finite.
    rgb
        (n, 3) codes of the colour frame; grey where there is none of the same view.
    """

    time_ns: int
    position_world_m: Float64
    points_world_m: Float64
    rgb: NDArray[np.uint8]


def cloud_times_ns(snapshot_times_ns: Mapping[int, Iterable[int]], count: int) -> frozenset[int]:
    """Return ``count`` of the times of the snapshots, evenly chosen, the first and the last among them."""
    times_ns = sorted(time_ns for times in snapshot_times_ns.values() for time_ns in times)
    if not times_ns:
        return frozenset()
    return frozenset(times_ns[k] for k in np.linspace(0, len(times_ns) - 1, count).round().astype(int))


def take_point_cloud(
    window: Window, time_ns: int, most: int, families: frozenset[str] | None = None
) -> PointCloud | None:
    """Carry a grid of the pixels of a snapshot's depth frame into the world.

    Parameters
    ----------
    window
        A window of the sequence. The frames are those of the snapshot at this instant.
    time_ns
        The instant, ns from the file's origin.
    most
        Largest number of points.
    families
        The streams to take; None: all.

    Returns
    -------
    PointCloud or None
        None without depth, its pinhole camera of that size, or a pose at the frame's timestamp; and where rows cannot
        be decoded.
    """
    facts = window.facts
    camera, row = facts.declared.cameras.get("depth"), nearest_row(window, "depth", time_ns)
    needed = all(in_families(stream, families) and stream in facts.streams for stream in ("depth", "pose"))
    if not needed or camera is None or camera.model != "pinhole" or row is None or not facts.clocks["depth"].usable:
        return None
    frame_ns = int(facts.clocks["depth"].times_ns[row])
    try:
        depth_m = window.depth_m(row)
        track = pose_track(window, camera)
    except UnreadableRowsError:
        return None
    if depth_m.shape != (camera.height, camera.width):
        return None
    R_world_body, positions_m = track.poses_at(np.array([frame_ns]))
    # The middles of whole squares of pixels.
    step = math.ceil(math.sqrt(depth_m.size / most))
    rows, columns = (step * np.arange(side // step) + step // 2 for side in depth_m.shape)
    grid = np.ix_(rows, columns)
    z = depth_m[grid].astype(np.float64)
    with np.errstate(all="ignore"):
        # p_world = R_world_body T_body_camera (z ray) + position; z is along the optical axis.
        x, y = rays_of_pixels(camera.K, camera.lens, columns[None, :], rows[:, None])
        in_camera_m = np.stack(np.broadcast_arrays(x * z, y * z, z), axis=-1).reshape(-1, 3)
        in_body_m = in_camera_m @ camera.T_body_camera[:3, :3].T + camera.T_body_camera[:3, 3]
        points_m = in_body_m @ R_world_body[0].T + positions_m[0]
    finite = np.isfinite(points_m).all(axis=1)
    if not finite.any():
        return None
    frame = _colour_frame(window, time_ns, frame_ns, families)
    rgb = np.full((*z.shape, 3), _GREY, np.uint8) if frame is None else frame[grid]
    return PointCloud(frame_ns, positions_m[0], points_m[finite], rgb.reshape(-1, 3)[finite])


def keep_point_cloud(clouds: Sequence[PointCloud], facts: Facts) -> TitledArrays:
    """Return the points of all frames as arrays of the record.

    Parameters
    ----------
    clouds
        In the order of time.
    facts
        Convert times to the clock of the file.

    Returns
    -------
    TitledArrays
        Empty where there is no cloud.
    """
    if not clouds:
        return TitledArrays()
    # Single precision keeps a millimetre only near the origin.
    origin_m = clouds[0].position_world_m
    offsets_m = np.concatenate([cloud.points_world_m for cloud in clouds]) - origin_m
    times_us = np.array([facts.to_file_us(cloud.time_ns) for cloud in clouds])
    entries: dict[str, tuple[NDArray[Any], str]] = {
        "times_us": (times_us, "Instants of the depth frames, us on the file's clock"),
        "origin_world_m": (origin_m, "Position of the body at the first of these instants, m (east, north, up)"),
        "offsets_m": (
            offsets_m.astype(np.float32),
            "Points of these depth frames, carried into the world by pose and camera, from that position on, m",
        ),
        "rgb": (
            np.concatenate([cloud.rgb for cloud in clouds]),
            "Their colours, DN as stored; 128 where no colour frame of the same grid and time exists",
        ),
    }
    return TitledArrays.titled({named(POINT_CLOUD, name): entry for name, entry in entries.items()})


def _colour_frame(
    window: Window, time_ns: int, depth_ns: int, families: frozenset[str] | None
) -> NDArray[np.uint8] | None:
    """Return the colour frame of the snapshot; None where it has not the grid and the time of the depth frame."""
    facts = window.facts
    row = nearest_row(window, "rgb", time_ns)
    if row is None or not in_families("rgb", families) or "rgb" not in facts.streams:
        return None
    if abs(int(facts.clocks["rgb"].times_ns[row]) - depth_ns) > _FARTHEST_FRAME_NS:
        return None
    if why_not_one_view(facts, "rgb", "depth"):
        return None
    rgb, depth = facts.declared.cameras["rgb"], facts.declared.cameras["depth"]
    shape = (depth.height, depth.width)
    if (rgb.height, rgb.width) != shape or not np.array_equal(rgb.K, depth.K):
        return None
    try:
        frame = window.rgb(row)
    except UnreadableRowsError:
        return None
    return frame if frame.shape[:2] == shape else None

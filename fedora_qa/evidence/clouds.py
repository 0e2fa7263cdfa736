"""Clouds around snapshots: single events in x, y and t, and points of depth frames, carried into the world."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import in_families
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.evidence.snapshot import EVENTS_NS, ON_CLOCK, events_around, nearest_row, sensor_shape
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.geometry.lens import rays_of_pixels
from fedora_qa.record.evidence import EVENT_CLOUDS, POINT_CLOUD, named
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import why_not_one_view
from fedora_qa.views.flow_intervals import pose_track

Float64 = NDArray[np.float64]

_FARTHEST_FRAME_NS: Final = EVENTS_NS // 2
"""A colour frame farther from the depth frame shows another view, and colours no point."""

_GREY: Final = 128


@dataclass(frozen=True, slots=True)
class EventCloud:
    """Some of the events around an instant, in the order of time.

    Attributes
    ----------
    time_ns
        The instant, ns from the file's origin.
    count
        Number of all events on the sensor within ``EVENTS_NS`` around it.
    shape
        Height and width of the sensor, px.
    x, y
        (n,) columns and rows.
    offsets_us
        (n,) timestamps relative to the instant, us.
    polarities
        (n,) 1 brighter, 0 darker.
    """

    time_ns: int
    count: int
    shape: tuple[int, int]
    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    offsets_us: NDArray[np.int16]
    polarities: NDArray[np.uint8]


def take_event_cloud(window: Window, time_ns: int, most: int) -> EventCloud | None:
    """Take the events of the picture of a snapshot, which the window holds for that picture.

    Parameters
    ----------
    time_ns
        The instant, ns from the file's origin.
    most
        Largest number of events; of more, evenly many in the order of time.

    Returns
    -------
    EventCloud or None
        None where no event lies on the sensor around the instant, or where events cannot be decoded.
    """
    if "events" not in window.facts.streams:
        return None
    try:
        events = events_around(window, time_ns, EVENTS_NS)
    except UnreadableRowsError:
        return None
    height, width = sensor_shape(window.facts, events)
    within = (events.x >= 0) & (events.x < width) & (events.y >= 0) & (events.y < height)
    on_sensor = np.flatnonzero(within & (events.p >= 0) & (events.p <= 1))
    if not len(on_sensor):
        return None
    chosen = on_sensor[np.linspace(0, len(on_sensor) - 1, min(most, len(on_sensor))).round().astype(np.intp)]
    return EventCloud(
        time_ns=time_ns,
        count=len(on_sensor),
        shape=(height, width),
        x=events.x[chosen].astype(np.uint16),
        y=events.y[chosen].astype(np.uint16),
        # 10 ms on either side are 1e4 us, which fit int16.
        offsets_us=np.rint((events.times_ns[chosen] - time_ns) / NS_PER_US).astype(np.int16),
        polarities=events.p[chosen].astype(np.uint8),
    )


def keep_event_clouds(clouds: Sequence[EventCloud], facts: Facts, most: int) -> TitledArrays:
    """Return the clouds of the instants with most events as arrays of the record.

    Parameters
    ----------
    clouds
        Of all instants, in the order of time.
    facts
        Convert times to the clock of the file.
    most
        Largest number of clouds; of equally many events the earlier instant.

    Returns
    -------
    TitledArrays
        In the order of time; empty where there is no cloud.
    """
    if not clouds:
        return TitledArrays()
    busiest = sorted(range(len(clouds)), key=lambda k: (-clouds[k].count, k))[:most]
    kept = [clouds[k] for k in sorted(busiest)]
    times_us = np.array([facts.to_file_us(cloud.time_ns) for cloud in kept])
    within = f"within {EVENTS_NS / NS_PER_MS:g} ms around the instants"
    numbers = np.repeat(np.arange(len(kept), dtype=np.uint8), [len(cloud.x) for cloud in kept])
    entries: dict[str, tuple[NDArray[Any], str]] = {
        "times_us": (times_us, f"Instants with most events, {ON_CLOCK}"),
        "intervals_us": (
            times_us[:, None] + np.array([-1, 1]) * EVENTS_NS / 2 / NS_PER_US,
            f"Start and end of the time around each instant, {ON_CLOCK}",
        ),
        "counts": (np.array([cloud.count for cloud in kept]), f"Number of events {within}"),
        "shapes_px": (np.array([cloud.shape for cloud in kept]), "Height and width of the sensor at each instant, px"),
        "instant": (numbers, "Which of the instants each kept event belongs to, counted from 0"),
        "x": (np.concatenate([cloud.x for cloud in kept]), f"Columns of events {within}, evenly thinned, px"),
        "y": (np.concatenate([cloud.y for cloud in kept]), "Rows of these events, px"),
        "offsets_us": (np.concatenate([cloud.offsets_us for cloud in kept]), "Their times from their instant on, us"),
        "polarities": (
            np.concatenate([cloud.polarities for cloud in kept]),
            "Their polarities: 1 brighter, 0 darker",
        ),
    }
    return TitledArrays.titled({named(EVENT_CLOUDS, name): entry for name, entry in entries.items()})


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
    """Return the points of all frames as arrays of the record; empty where there is no cloud.

    Parameters
    ----------
    clouds
        In the order of time.
    facts
        Convert times to the clock of the file.
    """
    if not clouds:
        return TitledArrays()
    # Single precision keeps a millimetre only near the origin.
    origin_m = clouds[0].position_world_m
    offsets_m = np.concatenate([cloud.points_world_m for cloud in clouds]) - origin_m
    times_us = np.array([facts.to_file_us(cloud.time_ns) for cloud in clouds])
    entries: dict[str, tuple[NDArray[Any], str]] = {
        "times_us": (times_us, f"Instants of the depth frames, {ON_CLOCK}"),
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

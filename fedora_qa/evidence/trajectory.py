"""The trajectory: positions as stored, speeds smoothed as in the statistics, directions of the body, and frusta.

Frusta are of a camera along the path: the rays through the corners of its image, where the poses place it.
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.geometry.lens import rays_of_pixels
from fedora_qa.geometry.so3 import matrices_from_quaternions
from fedora_qa.record.evidence import FRUSTA, FRUSTUM_CAMERAS, TRAJECTORY, named
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import RowSource
from fedora_qa.statistics.trajectory import velocities

Float64 = NDArray[np.float64]

_BLOCK_ROWS: Final = 1 << 14


def keep_trajectory(facts: Facts, source: RowSource, points: int, frusta: int = 0) -> TitledArrays:
    """Return at most ``points`` poses, evenly chosen, as arrays of the record.

    All poses are read, also those outside of the plan: the poses of 1 s take less memory than a few rows of one
    picture.

    Parameters
    ----------
    points
        Greatest number of poses.
    frusta
        Greatest number of poses, evenly chosen, at which the view of a camera is kept.

    Returns
    -------
    TitledArrays
        Times (us, clock of the file), positions (m, world), speeds (m/s) and forward directions (world), and the frusta
        of a camera; empty where no pose advances and is finite.
    """
    if "pose" not in facts.clocks:
        return TitledArrays()
    # Timestamps (ns), positions (m) and orientations (xyzw) that advance and are finite, block by block.
    parts: list[tuple[NDArray[np.int64], Float64, Float64]] = []
    clock = facts.clocks["pose"]
    for start in range(0, len(clock.times_ns), _BLOCK_ROWS):
        stop = min(start + _BLOCK_ROWS, len(clock.times_ns))
        try:
            block_m = source.rows("path/pose/position", start, stop)
            block_xyzw = source.rows("path/pose/orientation", start, stop)
        except UnreadableRowsError:
            continue
        with np.errstate(over="ignore"):
            lengths = np.linalg.norm(block_xyzw, axis=1)
        usable = clock.advancing[start:stop] & np.isfinite(block_m).all(axis=1) & np.isfinite(lengths) & (lengths > 0)
        if usable.any():
            parts.append((clock.times_ns[start:stop][usable], block_m[usable], block_xyzw[usable]))
    if not parts:
        return TitledArrays()
    times_ns, positions_m, orientations_xyzw = (np.concatenate(column) for column in zip(*parts, strict=True))
    # Speeds (n,); NaN where there are too few poses to smooth.
    fitted = velocities((times_ns - times_ns[0]) / NS_PER_S, positions_m)
    speeds_m_s = np.full(len(times_ns), np.nan) if fitted is None else np.linalg.norm(fitted, axis=1)
    chosen = np.unique(np.linspace(0, len(times_ns) - 1, min(points, len(times_ns))).round().astype(np.intp))
    # The first column of R_world_body is the body's X axis, forward, in the world (east, north, up).
    forward = matrices_from_quaternions(orientations_xyzw[chosen])[:, :, 0]
    times_us = facts.origin_us + times_ns[chosen] / NS_PER_US
    views = {}
    if frusta:
        at = np.unique(np.linspace(0, len(times_ns) - 1, min(frusta, len(times_ns))).round().astype(np.intp))
        at_us = facts.origin_us + times_ns[at] / NS_PER_US
        R_world_body = matrices_from_quaternions(orientations_xyzw[at])
        views = frusta_of(facts.declared.cameras, at_us, positions_m[at], R_world_body)
    return TitledArrays.titled(
        {
            named(TRAJECTORY, "times_us"): (times_us, "Instants of the poses, us on the file's clock"),
            named(TRAJECTORY, "positions_world_m"): (
                positions_m[chosen],
                "Positions of the body in the world, m (east, north, up), as stored",
            ),
            named(TRAJECTORY, "speeds_m_s"): (
                speeds_m_s[chosen],
                "Speed, m/s, of quintic splines through the positions, so that noise does not add to it",
            ),
            named(TRAJECTORY, "forward_world"): (forward, "Direction of the body's X axis in the world, unit vectors"),
            **views,
        }
    )


def frusta_of(
    cameras: Mapping[str, Camera], times_us: Float64, positions_m: Float64, R_world_body: Float64
) -> dict[str, tuple[NDArray[Any], str]]:
    """Return the frusta of the first pinhole camera as arrays with titles.

    Parameters
    ----------
    cameras
        As declared, by stream.
    times_us
        (n,), on the file's clock.
    positions_m
        (n, 3) of the body in the world.
    R_world_body
        (n, 3, 3).

    Returns
    -------
    dict
        Centres of projection (n, 3), and rays (n, 4, 3) through the corners of the image: top left, top right, bottom
        right, bottom left, of length 1 along the optical axis, axes of the world. Empty where no pinhole camera is
        declared, or its lens images no ray at a corner.
    """
    for stream in FRUSTUM_CAMERAS:
        camera = cameras.get(stream)
        if camera is None or camera.model != "pinhole":
            continue
        # Integer coordinates are pixel centres: the image ends half a pixel beyond them.
        right, bottom = camera.width - 0.5, camera.height - 0.5
        with np.errstate(all="ignore"):
            x, y = rays_of_pixels(
                camera.K, camera.lens, np.array([-0.5, right, right, -0.5]), np.array([-0.5, -0.5, bottom, bottom])
            )
            # p_world = R_world_body T_body_camera p_camera + position; a direction is only turned.
            in_body = np.column_stack([x, y, np.ones(4)]) @ camera.T_body_camera[:3, :3].T
            rays = np.einsum("nij,kj->nki", R_world_body, in_body)
            centres_m = R_world_body @ camera.T_body_camera[:3, 3] + positions_m
        if not (np.isfinite(rays).all() and np.isfinite(centres_m).all()):
            continue
        return {
            named(FRUSTA, stream, "times_us"): (times_us, "Instants of the frusta, us on the file's clock"),
            named(FRUSTA, stream, "centres_world_m"): (
                centres_m,
                f"Centres of projection of the camera of {stream} in the world, m (east, north, up)",
            ),
            named(FRUSTA, stream, "rays_world"): (
                rays,
                f"Rays through the corners of the images of {stream}, of length 1 along the optical axis, in the world",
            ),
        }
    return {}

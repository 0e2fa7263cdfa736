"""The path of the camera over a short time, and how densely tiles are sampled along it.

Compiled code needs poses at millions of instants, and a flight is evaluated in Python. Its motion is smooth, so a few
Chebyshev polynomials represent it; where they do not, the time is halved. A moving body looks like a body at rest from
a camera that moves the other way, so that every body has its own place of the camera.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from fedora_generator.camera import Camera
from fedora_generator.errors import SceneError
from fedora_generator.flight import Flight
from fedora_generator.render import ExactWorld
from fedora_generator.surfaces.faces import Faces, moved, pixel_rays
from fedora_generator.surfaces.render_kernels import TILE, faces_around_tile, tile_origin
from fedora_generator.surfaces.visibility_kernels import LINES_PER_FACE, W, nearest_face, project_every_face, value
from fedora_generator.threads import fill_in_threads
from fedora_qa.conventions import NS_PER_S

Floats = NDArray[np.float64]

RAY_ENTRIES: Final = 9
"""A row of coefficients holds the matrix of rays (3, 3), row by row, then for each body the camera's place (3,)."""

NODES: Final = 16
ROUNDING: Final = 1e-13
"""Coefficients that are smaller than this share of their vector (a column of the rays, a place) are left out.

Of the vector, not of their own entry: one that crosses zero is rounded as its neighbours are, and the phase of a swing
of half a radian minutes after its start, thousands of radians on, is known to 1e-13.
"""
SHORTEST_NS: Final = 1_000

_NODES: Final = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
_TO_COEFFICIENTS: Final = (
    2 / NODES * chebyshev.chebvander(_NODES, NODES - 1).T * np.where(np.arange(NODES), 1, 0.5)[:, None]
)


@dataclass(frozen=True, slots=True)
class CameraPath:
    """Rays and places of a camera from ``start_ns`` to ``stop_ns`` of the flight's clock."""

    start_ns: int
    stop_ns: int
    coefficients: Floats
    """(terms, 9 + 3 bodies) of Chebyshev polynomials of -1 (start) to 1 (stop)"""

    def at(self, share: float) -> tuple[Floats, Floats]:
        """Rays (3, 3), which take (column, row, 1) to world directions of optical z = 1, and places (bodies, 3), m.

        A place is the camera's, less the body's displacement. ``share`` is 0 at the start and 1 at the end.
        """
        row = np.asarray(chebyshev.chebval(2 * share - 1, self.coefficients))
        return row[:RAY_ENTRIES].reshape(3, 3), row[RAY_ENTRIES:].reshape(-1, 3)


def camera_paths(world: ExactWorld, camera: Camera, flight: Flight, start_ns: int, stop_ns: int) -> list[CameraPath]:
    """Paths past the bodies of a world, each short enough for its polynomials; one after the other from start to stop.

    Parameters
    ----------
    start_ns, stop_ns
        Ends of the time, ns of the flight's clock.

    Raises
    ------
    SceneError
        The camera shakes faster than any polynomial over a microsecond.
    """
    middle_s, half_s = (start_ns + stop_ns) / 2 / NS_PER_S, (stop_ns - start_ns) / 2 / NS_PER_S
    times_s = middle_s + half_s * _NODES
    poses = camera.poses_between(flight, times_s)
    rays = np.array([pixel_rays(camera.K, pose).ravel() for pose in poses])
    places_m = [poses[:, :3, 3] - world.displacement_m(body, times_s) for body in range(1 + len(world.movements))]
    rows = np.concatenate([rays, *places_m], axis=1)
    coefficients = _TO_COEFFICIENTS @ rows
    lengths = [np.tile(np.linalg.norm(rays.reshape(-1, 3, 3), axis=1), 3)]
    lengths += [np.repeat(np.linalg.norm(place_m, axis=1)[:, None], 3, axis=1) for place_m in places_m]
    scales = np.concatenate(lengths, axis=1).max(axis=0)
    needed = np.flatnonzero((np.abs(coefficients) > ROUNDING * np.maximum(scales, 1e-3)).any(axis=1))
    terms = int(needed[-1]) + 1 if needed.size else 1
    if terms <= NODES - 2:  # the last two are nothing but rounding: so is all that is missing
        return [CameraPath(start_ns, stop_ns, coefficients[:terms])]
    if stop_ns - start_ns < SHORTEST_NS:
        raise SceneError(f"Expected a flight that moves smoothly, got a turn within a microsecond at {middle_s:g} s")
    middle_ns = (start_ns + stop_ns) // 2
    halves = ((start_ns, middle_ns), (middle_ns, stop_ns))
    return [path for half in halves for path in camera_paths(world, camera, flight, *half)]


PARTS: Final = 2
"""A path is looked at in equal parts; the motion of each counts as if all were as fast."""

STILL_PX: Final = 1e-9
"""Motion that is rounding: one sample at the end of the path will do."""

FEWEST_SAMPLES: Final = 2
"""Where something moves, second differences are needed."""

SHORTEST_STEP_NS: Final = 10_000
"""A point that passes close to the camera moves without bound."""


@dataclass(frozen=True, slots=True)
class TilePlan:
    """For each tile (16x16 px, in raster order): samples after the first, and its faces."""

    samples: NDArray[np.int64]
    """(tiles,)"""
    face_starts: NDArray[np.int64]
    """(tiles + 1,) where in ``faces`` those of a tile begin"""
    faces: NDArray[np.int64]
    """Faces that a tile can show at any time of the path"""


@dataclass(frozen=True, slots=True)
class _View:
    rays: Floats
    cameras_m: Floats
    lines: Floats
    front: NDArray[np.bool_]


def plan_tiles(initial_faces: Faces, path: CameraPath, height: int, width: int, bound_px: float) -> TilePlan:
    """Plan equal steps for each tile, in none of which its image moves farther than ``bound_px``.

    What moves into a tile comes from a neighbour: a tile is sampled as densely as the densest around it, and its faces
    are those of a square that is larger by the motion.

    Parameters
    ----------
    initial_faces
        Faces of the world before anything has moved.
    path
        Rays and places of the camera.
    height, width
        Of the image, px.
    bound_px
        Largest motion of the image in a step, px.
    """
    views = []
    for part in range(PARTS + 1):
        rays, cameras_m = path.at(part / PARTS)
        lines = np.empty((len(initial_faces.textures), LINES_PER_FACE, 3))
        faces = moved(initial_faces, cameras_m[0] - cameras_m)
        views.append(_View(rays, cameras_m, lines, project_every_face(faces.frames, cameras_m[0], rays, lines)))
    # Largest displacement (tiles,) from any view to the next or the one before, of a tile and its neighbours.
    rows, columns = math.ceil(height / TILE), math.ceil(width / TILE)
    motions_px = np.zeros(rows * columns)
    for start, end in itertools.chain(itertools.pairwise(views), itertools.pairwise(reversed(views))):
        to_end = np.linalg.inv(end.rays)
        H, ts = to_end @ start.rays, (start.cameras_m - end.cameras_m) @ to_end.T
        visible = (start.lines[start.front], initial_faces.bodies[start.front])
        fill_in_threads(largest_motions, rows * columns, *visible, H, ts, height, width, motions_px)
    motions_px = maximum_filter(motions_px.reshape(rows, columns), size=3, mode="nearest").ravel()
    motions_px = PARTS * np.asarray(motions_px)
    most_samples = max(FEWEST_SAMPLES, (path.stop_ns - path.start_ns) // SHORTEST_STEP_NS)
    samples = np.clip(np.ceil(motions_px / bound_px), FEWEST_SAMPLES, most_samples).astype(np.int64)
    samples[motions_px <= STILL_PX] = 1
    marked = np.zeros((samples.size, len(initial_faces.textures)), dtype=np.bool_)
    for view in views:
        front = np.flatnonzero(view.front)
        reach_px = motions_px / PARTS + 1
        fill_in_threads(mark_faces, samples.size, view.lines[front], front, reach_px, height, width, marked)
    starts = np.concatenate([[0], np.cumsum(marked.sum(axis=1))])
    return TilePlan(samples, starts.astype(np.int64), np.nonzero(marked)[1].astype(np.int64))


@njit(cache=True, error_model="numpy", nogil=True)
def largest_motions(
    lines: NDArray[np.float64],
    bodies: NDArray[np.int64],
    H: NDArray[np.float64],
    ts: NDArray[np.float64],
    height: int,
    width: int,
    motions_px: NDArray[np.float64],
    first_tile: int,
    stop_tile: int,
) -> None:
    """Raise ``motions_px`` (tiles,) to the largest displacement of any pixel of a tile to another pose.

    A point that passes behind the camera has no displacement.

    Parameters
    ----------
    lines
        (n, 7, 3) faces in the first pose.
    bodies
        (n,) body of each face.
    H, ts
        (3, 3) and (bodies, 3): (column, row, 1) is displaced to H p + t / z, with the t of its body.
    height, width
        Of the image, px.
    motions_px
        (tiles,) raised in place.
    """
    for tile in range(first_tile, stop_tile):
        column, row = tile_origin(tile, width)
        in_tile = np.empty(len(lines), np.int64)
        count, uniform = faces_around_tile(lines, column, row, 0.0, in_tile)
        squared = motions_px[tile] ** 2
        for y in range(row, min(row + TILE, height)):
            for x in range(column, min(column + TILE, width)):
                face = in_tile[0] if uniform else nearest_face(lines, in_tile, count, x, y)
                w = value(lines, face, W, x, y) if face >= 0 else 0.0
                t = ts[bodies[face] if face >= 0 else 0]
                ahead = H[2, 0] * x + H[2, 1] * y + H[2, 2] + w * t[2]
                if ahead > 0.0:
                    dx = (H[0, 0] * x + H[0, 1] * y + H[0, 2] + w * t[0]) / ahead - x
                    dy = (H[1, 0] * x + H[1, 1] * y + H[1, 2] + w * t[1]) / ahead - y
                    squared = max(squared, dx * dx + dy * dy)
        motions_px[tile] = math.sqrt(squared)


@njit(cache=True, error_model="numpy", nogil=True)
def mark_faces(
    lines: NDArray[np.float64],
    front: NDArray[np.int64],
    reach_px: NDArray[np.float64],
    height: int,
    width: int,
    marked: NDArray[np.bool_],
    first_tile: int,
    stop_tile: int,
) -> None:
    """Mark the faces that each tile can show.

    Parameters
    ----------
    lines
        (n, 7, 3) faces in front of the camera.
    front
        (n,) their numbers.
    reach_px
        (tiles,) by how much each tile is taken larger on every side, px.
    height, width
        Of the image, px.
    marked
        (tiles, faces) set in place.
    """
    for tile in range(first_tile, stop_tile):
        column, row = tile_origin(tile, width)
        faces = np.empty(len(lines), np.int64)
        count, _ = faces_around_tile(lines, column, row, reach_px[tile], faces)
        for index in range(count):
            marked[tile, front[faces[index]]] = True

"""How densely each tile of the image must be sampled over a path of the camera, and what it can show meanwhile."""

import itertools
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from fedora_generator.adaptive import tile_plan_kernels as kernels
from fedora_generator.adaptive.camera_path import CameraPath
from fedora_generator.surfaces.faces import Faces, moved
from fedora_generator.surfaces.projection_kernels import LINES_PER_FACE, project_every_face
from fedora_generator.surfaces.render_kernels import TILE

Floats = NDArray[np.float64]

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


def plan_tiles(standing: Faces, path: CameraPath, height: int, width: int, bound_px: float) -> TilePlan:
    """Equal steps in each tile, in none of which its image moves farther than ``bound_px``; faces as yet unmoved.

    What moves into a tile comes from a neighbour: a tile is sampled as densely as the densest around it, and its faces
    are those of a square that is larger by the motion.
    """
    views = [_view(standing, path, part / PARTS) for part in range(PARTS + 1)]
    motions_px = PARTS * _motions_px(views, standing.bodies, height, width)
    samples = np.clip(np.ceil(motions_px / bound_px), FEWEST_SAMPLES, _most_samples(path)).astype(np.int64)
    samples[motions_px <= STILL_PX] = 1
    marked = np.zeros((samples.size, len(standing.textures)), dtype=np.bool_)
    for view in views:
        front = np.flatnonzero(view.front)
        kernels.mark_faces(view.lines[front], front, motions_px / PARTS + 1, height, width, marked)
    starts = np.concatenate([[0], np.cumsum(marked.sum(axis=1))])
    return TilePlan(samples, starts.astype(np.int64), np.nonzero(marked)[1].astype(np.int64))


@dataclass(frozen=True, slots=True)
class _View:
    rays: Floats
    cameras_m: Floats
    lines: Floats
    front: NDArray[np.bool_]


def _view(standing: Faces, path: CameraPath, share: float) -> _View:
    rays, cameras_m = path.at(share)
    lines = np.empty((len(standing.textures), LINES_PER_FACE, 3))
    faces = moved(standing, cameras_m[0] - cameras_m)
    return _View(rays, cameras_m, lines, project_every_face(faces.frames, cameras_m[0], rays, lines))


def _motions_px(views: list[_View], bodies: NDArray[np.int64], height: int, width: int) -> Floats:
    """Largest displacement (tiles,) from any view to the next or the one before, of a tile and its neighbours."""
    rows, columns = math.ceil(height / TILE), math.ceil(width / TILE)
    motions_px = np.zeros(rows * columns)
    for here, there in itertools.chain(itertools.pairwise(views), itertools.pairwise(reversed(views))):
        to_there = np.linalg.inv(there.rays)
        H, ts = to_there @ here.rays, (here.cameras_m - there.cameras_m) @ to_there.T
        visible = (here.lines[here.front], bodies[here.front])
        kernels.largest_motions(*visible, H, ts, height, width, motions_px)
    return np.asarray(maximum_filter(motions_px.reshape(rows, columns), size=3, mode="nearest").ravel())


def _most_samples(path: CameraPath) -> int:
    return max(FEWEST_SAMPLES, (path.stop_ns - path.start_ns) // SHORTEST_STEP_NS)

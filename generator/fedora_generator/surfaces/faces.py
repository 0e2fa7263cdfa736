"""The world as arrays of faces, and their projection for a camera pose."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.surfaces.visibility_kernels import LINES_PER_FACE, FaceFrames, project_every_face
from fedora_generator.surfaces.world import World

Floats = NDArray[np.float64]

WAVE_SHIFT_M: Final = (17.3, 11.9)
"""Offset of the waves of a face, times the face's number, so that two boxes of the same texture look different.
Stripes, checkers and dashes stay centred on the face."""

# Axes u and v of the faces of a box, in the box's frame; the outward normal is u x v.
_BOX_FACES: Final = np.array(
    [
        [[0, 1, 0], [0, 0, 1]],  # +x
        [[0, -1, 0], [0, 0, 1]],  # -x
        [[-1, 0, 0], [0, 0, 1]],  # +y
        [[1, 0, 0], [0, 0, 1]],  # -y
        [[1, 0, 0], [0, 1, 0]],  # +z
        [[1, 0, 0], [0, -1, 0]],  # -z
    ],
    dtype=np.float64,
)


@dataclass(frozen=True, slots=True)
class Faces:
    """n one-sided rectangles in the world, float64; a point of face i is ``center + u u_axis + v v_axis``."""

    centers_m: Floats
    """(n, 3)"""
    u_axes: Floats
    """(n, 3), unit"""
    v_axes: Floats
    """(n, 3), unit"""
    normals: Floats
    """(n, 3), unit, to the front"""
    half_sizes_m: Floats
    """(n, 2), along u and v"""
    wave_offsets_m: Floats
    """(n, 2), added to (u, v) for the waves of the texture"""
    textures: NDArray[np.int64]
    """(n,), index into the world's textures"""
    bodies: NDArray[np.int64]
    """(n,), 0 for faces at rest, k for the world's k-th mover, counted from 1"""

    @property
    def frames(self) -> FaceFrames:
        """Where the faces lie, as compiled code takes it."""
        return FaceFrames(self.centers_m, self.u_axes, self.v_axes, self.normals, self.half_sizes_m)


def faces_of(world: World) -> Faces:
    """All faces of the world: the rectangles, then six for each box and for each mover, as described."""
    names, boxes = list(world.textures), (*world.boxes, *world.movers)
    parts, textures = [], []
    for rectangle in world.rectangles:
        axes = np.array([rectangle.u_axis, rectangle.v_axis], dtype=np.float64)
        parts.append((np.array(rectangle.center_m, dtype=np.float64), *axes, 0.5 * np.array(rectangle.size_m)))
        textures.append(names.index(rectangle.texture))
    for box in boxes:
        half_size_m = 0.5 * np.array(box.size_m)
        for u_axis, v_axis in _BOX_FACES:
            center_m = np.array(box.center_m) + box.axes_world @ (half_size_m * np.cross(u_axis, v_axis))
            half_uv_m = np.array([np.abs(u_axis) @ half_size_m, np.abs(v_axis) @ half_size_m])
            parts.append((center_m, box.axes_world @ u_axis, box.axes_world @ v_axis, half_uv_m))
            textures.append(names.index(box.texture))
    centers_m, u_axes, v_axes, half_sizes = (np.array(column) for column in zip(*parts, strict=True))
    faces_at_rest = np.zeros(len(world.rectangles) + len(world.boxes) * len(_BOX_FACES), np.int64)
    faces_of_movers = np.repeat(1 + np.arange(len(world.movers)), len(_BOX_FACES))
    return Faces(
        centers_m=centers_m,
        u_axes=u_axes,
        v_axes=v_axes,
        normals=np.cross(u_axes, v_axes),
        half_sizes_m=half_sizes,
        wave_offsets_m=np.outer(np.arange(len(parts)), WAVE_SHIFT_M),
        textures=np.array(textures, dtype=np.int64),
        bodies=np.concatenate([faces_at_rest, faces_of_movers]),
    )


def moved(faces: Faces, displacements_m: Floats) -> Faces:
    """Displace each body of the faces.

    Parameters
    ----------
    faces
        As described, at no displacement.
    displacements_m
        (1 + movers, 3) by body, in the world frame; row 0, of the faces at rest, is zero.
    """
    return replace(faces, centers_m=faces.centers_m + displacements_m[faces.bodies])


def project_faces(faces: Faces, K: Floats, T_world_camera: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Lines of the faces that turn their front to the camera.

    With p = (column, row, 1) the z-depth is 1 / W.p and the surface coordinates are U.p / W.p and V.p / W.p, metres
    from the face's centre. A pixel shows the face where all four borders ``a W -/+ U``, ``b W -/+ V`` are >= 0; each
    pair sums to a positive multiple of W, so that nothing behind the camera passes.

    Parameters
    ----------
    faces
        n faces in the world frame.
    K
        (3, 3) camera matrix, px.
    T_world_camera
        (4, 4) pose of the camera.

    Returns
    -------
    front
        (m,) indices of the faces.
    lines
        (m, 7, 3) rows U, V, W, a W - U, a W + U, b W - V, b W + V.
    """
    lines = np.empty((len(faces.textures), LINES_PER_FACE, 3))
    rays = pixel_rays(K, T_world_camera)
    front = project_every_face(faces.frames, np.ascontiguousarray(T_world_camera[:3, 3]), rays, lines)
    return np.flatnonzero(front), lines[front]


def pixel_rays(K: Floats, T_world_camera: Floats) -> Floats:
    """Matrix (3, 3) from (column, row, 1) to the ray's direction in the world frame, of optical z = 1.

    Parameters
    ----------
    K
        (3, 3) camera matrix, px.
    T_world_camera
        (4, 4) pose of the camera.
    """
    return np.asarray(T_world_camera[:3, :3] @ np.linalg.inv(K))

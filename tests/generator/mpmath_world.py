"""The exact world a third time, in mpmath at 50 digits: Cramer's rule, clipped polygons and numerical quadrature.

Nothing is shared with the renderer but the options and the constants of the description (the scale of DN, where the
waves of a face start, which axes a box's faces have). Numbers of the options are taken as they are in float64.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mpmath.ctx_mp import MPContext

from fedora_generator.camera import Camera
from fedora_generator.surfaces.faces import WAVE_SHIFT_M
from fedora_generator.surfaces.textures import StepPattern, Texture
from fedora_generator.surfaces.world import Box, Rectangle, World
from tests.generator.reference_world import BOX_FACES

MP = MPContext()
MP.dps = 50

EPS = float(np.finfo(np.float64).eps)

Vector = list  # of numbers of MP
Polygon = list  # of points, each a pair of numbers of MP


@dataclass(frozen=True, slots=True)
class Plane:
    """A face: centre and axes (3,), half sizes, all in metres; its texture, and its place in the description."""

    center: Vector
    u: Vector
    v: Vector
    half: tuple
    texture: Texture
    number: int

    @property
    def normal(self) -> Vector:
        return cross(self.u, self.v)


@dataclass(frozen=True, slots=True)
class Hit:
    """Where a ray of optical z = 1 meets a plane: z-depth and surface coordinates, metres.

    ``depth_error`` bounds the relative rounding of a float64 z-depth: the terms of its numerator and denominator, each
    with a few roundings of its own size. Close to 1 ulp face on, it grows where the ray grazes the plane and where the
    camera is close to the plane but both are far from the origin. ``surface_error_m`` is the same of u and v.
    """

    z: object
    u: object
    v: object
    depth_error: float
    surface_error_m: float


def vector(values: Sequence[float]) -> Vector:
    return [value if isinstance(value, MP.mpf) else MP.mpf(float(value)) for value in values]


def dot(a: Vector, b: Vector) -> object:
    return MP.fsum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def solve(columns: Sequence[Vector], right: Vector) -> Vector:
    """Cramer's rule for three unknowns; the determinant is the triple product of the columns."""
    a, b, c = columns
    whole = dot(a, cross(b, c))
    return [dot(right, cross(b, c)) / whole, dot(a, cross(right, c)) / whole, dot(a, cross(b, right)) / whole]


def planes_of(world: World) -> list[Plane]:
    """All faces in the order of the description."""
    planes = [_plane_of(flat, world.textures[flat.texture], i) for i, flat in enumerate(world.rectangles)]
    for box in world.boxes:
        planes += _planes_of_box(box, world.textures[box.texture], len(planes))
    return planes


def _plane_of(flat: Rectangle, texture: Texture, number: int) -> Plane:
    half = tuple(MP.mpf(size) / 2 for size in flat.size_m)
    return Plane(vector(flat.center_m), vector(flat.u_axis), vector(flat.v_axis), half, texture, number)


def _planes_of_box(box: Box, texture: Texture, first: int) -> list[Plane]:
    yaw = MP.mpf(box.yaw_deg) * MP.pi / 180
    cos, sin = MP.cos(yaw), MP.sin(yaw)

    def to_world(p: Vector) -> Vector:
        return [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2]]

    half, center = [MP.mpf(size) / 2 for size in box.size_m], vector(box.center_m)
    planes = []
    for i, (axis, sign, u, v) in enumerate(BOX_FACES):
        outward = [sign * half[k] if k == axis else MP.mpf(0) for k in range(3)]
        middle = [c + o for c, o in zip(center, to_world(outward), strict=True)]
        sides = tuple(dot([MP.mpf(abs(k)) for k in along], half) for along in (u, v))
        planes.append(Plane(middle, to_world(vector(u)), to_world(vector(v)), sides, texture, first + i))
    return planes


def ray_of(camera: Camera, T_world_camera: np.ndarray, column: object, row: object) -> Vector:
    """Direction (3,) in the world of the ray through a point of the image, of optical z = 1."""
    K = camera.K
    x = (MP.mpf(column) - MP.mpf(K[0, 2])) / MP.mpf(K[0, 0])
    y = (MP.mpf(row) - MP.mpf(K[1, 2])) / MP.mpf(K[1, 1])
    return [dot(vector(axes), [x, y, MP.mpf(1)]) for axes in T_world_camera[:3, :3]]


def meet(plane: Plane, camera: Camera, T_world_camera: np.ndarray, column: object, row: object) -> Hit:
    """Intersection of a ray with the plane of a face: camera + z ray = centre + u u_axis + v v_axis."""
    ray, origin = ray_of(camera, T_world_camera, column, row), vector(T_world_camera[:3, 3])
    offset = [c - o for c, o in zip(plane.center, origin, strict=True)]
    z, minus_u, minus_v = solve([ray, plane.u, plane.v], offset)
    u, v = (np.array([abs(float(x)) for x in axis]) for axis in (plane.u, plane.v))
    normal = np.roll(u, -1) * np.roll(v, 1) + np.roll(u, 1) * np.roll(v, -1)  # the terms of the cross product
    f, cx, cy = camera.K[0, 0], camera.K[0, 2], camera.K[1, 2]
    rotation, position_m = np.array(T_world_camera[:3, :3], float), np.array(T_world_camera[:3, 3], float)
    terms = np.abs(rotation) @ [(abs(float(column)) + cx) / f, (abs(float(row)) + cy) / f, 1.0]
    denominator = float(normal @ terms) / abs(float(dot(plane.normal, ray)))
    places = np.abs(position_m) + [abs(float(c)) for c in plane.center]
    numerator = float(normal @ places) / abs(float(dot(plane.normal, offset)))
    depth_error = 4 * EPS * (denominator + numerator)
    reach_m = float(np.linalg.norm(terms)) * abs(float(z))
    surface_error_m = reach_m * depth_error + 4 * EPS * (float(np.linalg.norm(places)) + reach_m)
    return Hit(z, -minus_u, -minus_v, depth_error, surface_error_m)


def project(camera: Camera, T_world_camera: np.ndarray, point_m: Vector) -> tuple:
    """Column, row and z-depth at which a point of the world appears; z-depth is not positive behind the camera."""
    offset = [p - c for p, c in zip(point_m, vector(T_world_camera[:3, 3]), strict=True)]
    x, y, z = solve([vector(axis) for axis in T_world_camera[:3, :3].T], offset)
    K = camera.K
    return MP.mpf(K[0, 0]) * x / z + MP.mpf(K[0, 2]), MP.mpf(K[1, 1]) * y / z + MP.mpf(K[1, 2]), z


def first_hit(
    planes: Sequence[Plane], camera: Camera, T_world_camera: np.ndarray, column: object, row: object
) -> tuple[Plane, Hit] | None:
    """Nearest face whose front a ray meets within its borders; None for the sky."""
    ray, found = ray_of(camera, T_world_camera, column, row), []
    for plane in planes:
        if dot(plane.normal, ray) < 0:
            hit = meet(plane, camera, T_world_camera, column, row)
            if hit.z > 0 and abs(hit.u) <= plane.half[0] and abs(hit.v) <= plane.half[1]:
                found.append((plane, hit))
    return min(found, key=lambda one: one[1].z, default=None)


def footprint(
    plane: Plane, camera: Camera, T_world_camera: np.ndarray, column: object, row: object
) -> tuple[Vector, Vector]:
    """Derivatives of (u, v) by column and by row at a point of the image, metres a pixel: central differences."""
    h = MP.mpf(10) ** -16  # leaves 32 digits of 50
    sides = []
    for dx, dy in ((h, MP.mpf(0)), (MP.mpf(0), h)):
        after = meet(plane, camera, T_world_camera, column + dx, row + dy)
        before = meet(plane, camera, T_world_camera, column - dx, row - dy)
        sides.append([(after.u - before.u) / (2 * h), (after.v - before.v) / (2 * h)])
    return sides[0], sides[1]


def waves_average(texture: Texture, number: int, u: object, v: object, a: Vector, b: Vector) -> object:
    """Average of the cosines of face ``number`` over the parallelogram of sides a and b around (u, v), by quadrature.

    cos(phase + alpha p + beta q) over the unit square around 0 is cos(phase) times the averages of cos(alpha p) and
    of cos(beta q), as their sines are odd.
    """
    u, v = u + number * MP.mpf(WAVE_SHIFT_M[0]), v + number * MP.mpf(WAVE_SHIFT_M[1])
    total = MP.mpf(0)
    for band in texture.waves:
        for amplitude, k_u, k_v, phase in (vector(row) for row in band.rows()):
            gains = [_cosine_average(2 * MP.pi * (k_u * side[0] + k_v * side[1])) for side in (a, b)]
            total += amplitude * gains[0] * gains[1] * MP.cos(2 * MP.pi * (k_u * u + k_v * v + phase))
    return total


def _cosine_average(alpha: object) -> object:
    parts = MP.linspace(MP.mpf(-0.5), MP.mpf(0.5), 2 + int(abs(alpha) / 6))
    return MP.quad(lambda p: MP.cos(alpha * p), parts, method="gauss-legendre", maxdegree=4)


def pattern_average(pattern: StepPattern, u: object, v: object, a: Vector, b: Vector) -> object:
    """Average, between -1 and 1, of a step pattern over the parallelogram of sides a and b around (u, v).

    The parallelogram is clipped to every light cell of the pattern, in the plane of its two phases.
    """
    corners = [phases(pattern, u + p * a[0] + q * b[0], v + p * a[1] + q * b[1]) for p, q in UNIT_SQUARE]
    light = MP.fsum(area(clipped_to_cell(corners, cell)) for cell in _light_cells(pattern, corners))
    return 2 * light / area(corners) - 1


UNIT_SQUARE = tuple((MP.mpf(p), MP.mpf(q)) for p, q in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)))


def phases(pattern: StepPattern, u: object, v: object) -> tuple:
    """Phases (turns) of the two square waves of a pattern at a point of the face."""
    angle = MP.mpf(pattern.angle_deg) * MP.pi / 180
    along = (MP.cos(angle) * u + MP.sin(angle) * v, -MP.sin(angle) * u + MP.cos(angle) * v)
    return tuple(w / MP.mpf(n) + MP.mpf(f) for w, n, f in zip(along, pattern.period_m, pattern.phase, strict=True))


def _light_cells(pattern: StepPattern, corners: Polygon) -> Iterator[tuple]:
    """Light rectangles (low, high, low, high) of the phases that the corners span."""
    one, two = ([corner[i] for corner in corners] for i in range(2))
    d_one, d_two = (MP.mpf(duty) for duty in pattern.duty)
    across = range(math.floor(min(one)), math.floor(max(one)) + 1)
    if pattern.kind == "stripes":
        yield from ((k, k + d_one, min(two), max(two)) for k in across)
        return
    for k in across:
        for m in range(math.floor(min(two)), math.floor(max(two)) + 1):
            yield k, k + d_one, m, m + d_two
            if pattern.kind == "checker":
                yield k + d_one, k + 1, m + d_two, m + 1


def clipped_to_cell(polygon: Polygon, cell: tuple) -> Polygon:
    for axis, low, high in ((0, *cell[:2]), (1, *cell[2:])):
        polygon = clipped(polygon, lambda p, axis=axis, low=low: p[axis] - low)
        polygon = clipped(polygon, lambda p, axis=axis, high=high: high - p[axis])
    return polygon


def clipped(polygon: Polygon, inside: object) -> Polygon:
    """The part of a convex polygon where the linear function ``inside`` is not negative."""
    kept = []
    for here, there in zip(polygon, [*polygon[1:], *polygon[:1]], strict=True):
        d_here, d_there = inside(here), inside(there)
        if d_here >= 0:
            kept.append(here)
        if (d_here < 0) != (d_there < 0):
            share = d_here / (d_here - d_there)
            kept.append(tuple(x + share * (y - x) for x, y in zip(here, there, strict=True)))
    return kept


def area(polygon: Polygon) -> object:
    """Shoelace formula, without its sign."""
    pairs = zip(polygon, [*polygon[1:], *polygon[:1]], strict=True)
    return abs(MP.fsum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)) / 2

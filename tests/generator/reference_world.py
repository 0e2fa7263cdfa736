"""The exact world a second time, in plain NumPy: rays against slabs, textures at points, pixels by many samples.

Nothing here is shared with the renderer but the options and the arbitrary constants of the description (the scale of
DN, where the waves of a face start).
"""

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.surfaces.faces import WAVE_SHIFT_M
from fedora_generator.surfaces.light import WHITE_DN, Light
from fedora_generator.surfaces.textures import Texture
from fedora_generator.surfaces.world import Box, Rectangle, World

Floats = NDArray[np.float64]

# In the box's frame, for each face in the order of the description: axis, sign of the outward normal, u and v.
BOX_FACES = (
    (0, 1, (0, 1, 0), (0, 0, 1)),
    (0, -1, (0, -1, 0), (0, 0, 1)),
    (1, 1, (-1, 0, 0), (0, 0, 1)),
    (1, -1, (1, 0, 0), (0, 0, 1)),
    (2, 1, (1, 0, 0), (0, 1, 0)),
    (2, -1, (1, 0, 0), (0, -1, 0)),
)


def radiance_rgb_dn(world: World, light: Light, camera: Camera, T_world_camera: Floats, samples: int) -> Floats:
    """Radiance (height, width, 3) averaged over ``samples`` x ``samples`` rays a pixel, unrounded DN."""
    share = (np.arange(samples) + 0.5) / samples - 0.5
    rows = (np.arange(camera.height)[:, None] + share).ravel()
    columns = (np.arange(camera.width)[:, None] + share).ravel()
    rgb = np.array([_radiance_of_row(world, light, camera, T_world_camera, columns, row) for row in rows])
    return rgb.reshape(camera.height, samples, camera.width, samples, 3).mean(axis=(1, 3))


def z_depth_m(world: World, camera: Camera, T_world_camera: Floats) -> Floats:
    """Z-depth (height, width) at the pixel centres, infinite for the sky."""
    grid = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1).astype(np.float64)
    rays = _rays(camera, T_world_camera, grid.reshape(-1, 2))
    return np.min([t for t, *_ in _hits(world, T_world_camera[:3, 3], rays)], axis=0).reshape(grid.shape[:2])


def _radiance_of_row(
    world: World, light: Light, camera: Camera, T_world_camera: Floats, columns: Floats, row: float
) -> Floats:
    rays = _rays(camera, T_world_camera, np.stack([columns, np.full_like(columns, row)], axis=-1))
    elevation = np.maximum(rays[:, 2], 0) / np.linalg.norm(rays, axis=1)
    horizon, zenith = np.array(light.sky_horizon_rgb), np.array(light.sky_zenith_rgb)
    radiance = WHITE_DN * (horizon + elevation[:, None] * (zenith - horizon))
    nearest = np.full(len(rays), np.inf)
    for t, normal, center, axes, texture, number in _hits(world, T_world_camera[:3, 3], rays):
        closer = t < nearest
        points = T_world_camera[:3, 3] + t[closer, None] * rays[closer]
        uv = (points - center) @ axes.T
        light_here = irradiance(world, light, points, normal)
        radiance[closer] = WHITE_DN * light_here[:, None] * albedo(world.textures[texture], uv, number)
        nearest[closer] = t[closer]
    return radiance


def irradiance(world: World, light: Light, points: Floats, normal: Floats) -> Floats:
    """Irradiance (n,) at points (n, 3) of a plane."""
    total = np.full(len(points), light.ambient + light.sun_strength * max(float(normal @ light.to_sun), 0.0))
    for lamp in world.lamps:
        to_lamp = np.array(lamp.position_m) - points
        cosine_distance = np.maximum(to_lamp @ normal, 0)
        softened = (to_lamp**2).sum(axis=1) + light.lamp_radius_m**2
        total += light.lamp_scale * lamp.strength * cosine_distance / softened**1.5
    return total


def albedo(texture: Texture, uv: Floats, face_number: int) -> Floats:
    """Albedo (n, 3) at points (n, 2) of a face, metres from its centre."""
    s = np.full(len(uv), 0.5)
    shifted = uv + face_number * np.array(WAVE_SHIFT_M)
    for band in texture.waves:
        for amplitude, k_u, k_v, phase in band.rows():
            s += amplitude * np.cos(2 * np.pi * (shifted @ np.array([k_u, k_v]) + phase))
    for step in texture.steps:
        angle = np.radians(step.angle_deg)
        turned = uv @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turns = turned / np.array(step.period_m) + np.array(step.phase)
        one, two = (turns % 1 < np.array(step.duty)).T
        value = {"stripes": one, "checker": one == two, "dashes": one & two}[step.kind]
        s += 0.5 * step.contrast * (2.0 * value - 1)
    dark, bright = np.array(texture.dark_rgb), np.array(texture.light_rgb)
    return dark + s[:, None] * (bright - dark)


def _rays(camera: Camera, T_world_camera: Floats, pixels: Floats) -> Floats:
    normalised = (pixels - camera.K[:2, 2]) / np.diag(camera.K)[:2]
    return np.concatenate([normalised, np.ones((len(pixels), 1))], axis=1) @ T_world_camera[:3, :3].T


def _hits(world: World, origin: Floats, rays: Floats) -> list[tuple[Floats, Floats, Floats, Floats, str, int]]:
    """For each face: z-depth of the rays' hits (infinite for a miss), normal, centre, u and v axes, texture, number."""
    found = [(*_rectangle_hit(flat, origin, rays), flat.texture, i) for i, flat in enumerate(world.rectangles)]
    for i, box in enumerate(world.boxes):
        first = len(world.rectangles) + len(BOX_FACES) * i
        found += [(*hit, box.texture, first + k) for k, hit in enumerate(_box_hits(box, origin, rays))]
    return found


def _rectangle_hit(flat: Rectangle, origin: Floats, rays: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    axes = np.array([flat.u_axis, flat.v_axis])
    normal, center = np.cross(*axes), np.array(flat.center_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = normal @ (center - origin) / (rays @ normal)
        uv = (origin + t[:, None] * rays - center) @ axes.T
    inside = (np.abs(uv) <= 0.5 * np.array(flat.size_m)).all(axis=1) & (rays @ normal < 0) & (t > 0)
    return np.where(inside, t, np.inf), normal, center, axes


def _box_hits(box: Box, origin: Floats, rays: Floats) -> list[tuple[Floats, Floats, Floats, Floats]]:
    """Slab method (Kay and Kajiya 1986): a ray enters through the last of the three slabs that it enters."""
    yaw = np.radians(box.yaw_deg)
    R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    half = 0.5 * np.array(box.size_m)
    start, direction = R.T @ (origin - np.array(box.center_m)), rays @ R
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (-half - start) / direction, (half - start) / direction
    enter, leave = np.minimum(low, high), np.maximum(low, high)
    t = enter.max(axis=1)
    hit = (t <= leave.min(axis=1)) & (t > 0)
    hits = []
    for axis, sign, u, v in BOX_FACES:
        here = hit & (enter.argmax(axis=1) == axis) & (np.sign(direction[:, axis]) == -sign)
        normal = R[:, axis] * sign
        center = np.array(box.center_m) + half[axis] * normal
        hits.append((np.where(here, t, np.inf), normal, center, np.array([R @ u, R @ v])))
    return hits

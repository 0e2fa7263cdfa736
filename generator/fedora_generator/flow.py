"""Optical flow in closed form, from depth, noise-free poses and the motion of moving bodies."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.threads import fill_in_threads
from fedora_qa.conventions import US_PER_S

Floats = NDArray[np.float64]


def flow_px(
    inverse_depth_per_m: Floats, K: Floats, T_world_camera_start: Floats, T_world_camera_end: Floats
) -> NDArray[np.float32]:
    """Displacement of what each pixel shows between two camera poses, where nothing in the world moves.

    Points that leave the image or become occluded keep their displacement.

    Parameters
    ----------
    inverse_depth_per_m
        (height, width) 1 / z-depth at the start; 0 at infinity.
    K
        (3, 3) intrinsics, px.
    T_world_camera_start, T_world_camera_end
        (4, 4) camera poses.

    Returns
    -------
    flow_px
        (height, width, 2), u right and v down. NaN where the depth is NaN or the point ends behind the camera.
    """
    # The paper's x* = K pi(R z K^-1 x + T) with [R|T] = T_end_start. Divided by z it is pi(K R K^-1 x + K T / z),
    # which also holds at infinity. Computed in float64, stored in float32.
    T_end_start = np.linalg.inv(T_world_camera_end) @ T_world_camera_start
    flow = np.empty((*inverse_depth_per_m.shape, 2), dtype=np.float32)
    H = K @ T_end_start[:3, :3] @ np.linalg.inv(K)
    fill_in_threads(displacements, len(flow), H, K @ T_end_start[:3, 3], inverse_depth_per_m, flow)
    return flow


def scene_flow_px(
    world: RenderedWorld,
    camera: Camera,
    inverse_depth_per_m: Floats,
    bodies: NDArray[np.int64],
    poses: tuple[Floats, Floats],
    times_us: tuple[int, int],
) -> NDArray[np.float32]:
    """Displacement of what each pixel shows, with the motion of moving bodies, between two camera poses at two times.

    Parameters
    ----------
    world
        Gives the displacements of its bodies.
    inverse_depth_per_m, bodies
        (height, width) what the pixels show at the first time.
    poses
        ``T_world_camera`` (4, 4) at both times.
    times_us
        Both times, us of the flight's clock.

    Returns
    -------
    flow_px
        (height, width, 2), as ``flow_px``.
    """
    start, end = poses

    def still_px(end: Floats) -> NDArray[np.float32]:
        if camera.lens is not None:
            return lens_flow_px(inverse_depth_per_m, camera, start, end)
        return flow_px(inverse_depth_per_m, camera.K, start, end)

    flow = still_px(end)
    for body in np.unique(bodies[bodies > 0]).tolist():
        start_m, end_m = world.displacement_m(body, np.array(times_us) / US_PER_S)
        # A body that moves by d looks like one at rest from a second camera that is displaced by -d.
        end_past_body = end.copy()
        end_past_body[:3, 3] -= end_m - start_m
        of_body = bodies == body
        flow[of_body] = still_px(end_past_body)[of_body]
    return flow


def lens_flow_px(
    inverse_depth_per_m: Floats, camera: Camera, T_world_camera_start: Floats, T_world_camera_end: Floats
) -> NDArray[np.float32]:
    """Displacement of what each pixel of a distorted camera shows, as ``flow_px``.

    Parameters
    ----------
    inverse_depth_per_m
        (height, width) 1 / z-depth at the start; 0 at infinity.
    T_world_camera_start, T_world_camera_end
        (4, 4) camera poses.
    """
    if camera.lens is None:
        raise ValueError("Expected a distorted camera, got a pinhole; use flow_px")
    height, width = inverse_depth_per_m.shape
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height), [1.0]), axis=-1)[:, :, 0].astype(np.float64)
    rays = np.einsum("hwij,hwj->hwi", camera.pixel_maps, pixels) @ np.linalg.inv(camera.K).T
    T_end_start = np.linalg.inv(T_world_camera_end) @ T_world_camera_start
    # As in flow_px divided by z, but between the rotation and K stands the lens.
    ends = rays @ T_end_start[:3, :3].T + inverse_depth_per_m[..., None] * T_end_start[:3, 3]
    ahead = ends[..., 2:] > 0.0  # false for NaN
    slopes = ends[..., :2] / np.where(ahead, ends[..., 2:], np.nan)
    imaged = camera.lens.imaged(slopes)
    return np.asarray(imaged * np.diag(camera.K)[:2] + camera.K[:2, 2] - pixels[..., :2], dtype=np.float32)


@njit(cache=True, nogil=True)
def displacements(
    H: NDArray[np.float64],
    t: NDArray[np.float64],
    inverse_depth: NDArray[np.float64],
    flow_px: NDArray[np.float32],
    first_row: int,
    stop_row: int,
) -> None:
    """Fill rows of ``flow_px`` (height, width, 2) with pi(H p + inverse_depth t) - p; NaN where a point is behind."""
    width = inverse_depth.shape[1]
    for y in range(first_row, stop_row):
        for x in range(width):
            w = inverse_depth[y, x]
            ahead = H[2, 0] * x + H[2, 1] * y + H[2, 2] + w * t[2]
            if ahead > 0.0:  # false for NaN
                flow_px[y, x, 0] = (H[0, 0] * x + H[0, 1] * y + H[0, 2] + w * t[0]) / ahead - x
                flow_px[y, x, 1] = (H[1, 0] * x + H[1, 1] * y + H[1, 2] + w * t[1]) / ahead - y
            else:
                flow_px[y, x, 0] = math.nan
                flow_px[y, x, 1] = math.nan

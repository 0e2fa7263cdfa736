"""Images of the colour and depth camera as the event camera would see them, which shares their centre."""

from dataclasses import dataclass
from typing import Any

import cv2
import h5py
import numpy as np

Array = np.ndarray[Any, Any]

_BLUR_PX = 0.9
"""Standard deviation of the blur before colour is sampled at 1 / 2.25 of its size, which keeps it free of aliases."""

_PLANE_TOLERANCE = 1e-3
"""Four neighbours whose inverse depths deviate from a plane by more than this share of it lie across an edge."""


@dataclass(frozen=True)
class EventView:
    """Samples images at the pixels of the event camera.

    Attributes
    ----------
    columns, rows
        (H, W) coordinates of these pixels in the images, px.
    scale
        Pixels of the event camera in one of the images.
    """

    columns: Array
    rows: Array
    scale: float

    def colour(self, image: Array) -> Array:
        """Return (H, W, ...) colour or grey."""
        blurred = cv2.GaussianBlur(image, (0, 0), _BLUR_PX)
        return np.asarray(cv2.remap(blurred, self.columns, self.rows, cv2.INTER_LINEAR))

    def depth(self, depth: Array) -> Array:
        """Return (H, W) depth in its unit: exact on planes, of which the inverse depth is linear; nearest at edges."""
        inverse = 1 / depth.astype(np.float64)
        x, y = np.floor(self.columns).astype(int), np.floor(self.rows).astype(int)
        x, y = np.minimum(x, depth.shape[1] - 2), np.minimum(y, depth.shape[0] - 2)
        fx, fy = self.columns - x, self.rows - y
        a, b, c, d = inverse[y, x], inverse[y, x + 1], inverse[y + 1, x], inverse[y + 1, x + 1]
        linear = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d)
        nearest = inverse[np.rint(self.rows).astype(int), np.rint(self.columns).astype(int)]
        return np.asarray(1 / np.where(np.abs(a + d - b - c) < _PLANE_TOLERANCE * a, linear, nearest))


def event_view(file: h5py.File) -> EventView:
    """Return the view of the event camera of a canonical file of the generator."""
    cameras = [file[f"metadata/cameras/{name}"].attrs for name in ("events", "depth")]
    K, K_image = (camera["K"] for camera in cameras)
    np.testing.assert_array_equal(cameras[0]["T_body_camera"], cameras[1]["T_body_camera"])
    scale = K[0, 0] / K_image[0, 0]
    columns = (np.arange(int(cameras[0]["width"])) - K[0, 2]) / scale + K_image[0, 2]
    rows = (np.arange(int(cameras[0]["height"])) - K[1, 2]) / scale + K_image[1, 2]
    return EventView(*(grid.astype(np.float32) for grid in np.meshgrid(columns, rows)), scale)


def rigid_flow_px(depth_m: Array, K: Array, T_after_before: Array) -> Array:
    """Return (H, W, 2) where the points of a depth image go, by the motion of the camera alone.

    Parameters
    ----------
    depth_m
        (H, W) z-depth, NaN invalid.
    K
        (3, 3) intrinsics.
    T_after_before
        (4, 4) takes points in the camera before to the camera after.
    """
    height, width = depth_m.shape
    pixels = np.dstack([*np.meshgrid(np.arange(width), np.arange(height)), np.ones_like(depth_m)])
    points = depth_m[..., np.newaxis] * (pixels @ np.linalg.inv(K).T)
    moved = (points @ T_after_before[:3, :3].T + T_after_before[:3, 3]) @ K.T
    return np.asarray(moved[..., :2] / moved[..., 2:] - pixels[..., :2])


def camera_poses(file: h5py.File, times_us: Array) -> Array:
    """Return the poses T_world_camera (n, 4, 4) of the depth camera at instants that poses are stored for."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    rows = np.searchsorted(file["path/pose/ts"][:], times_us)
    np.testing.assert_array_equal(file["path/pose/ts"][:][rows], times_us)
    T_world_body = np.tile(np.eye(4), (len(rows), 1, 1))
    T_world_body[:, :3, :3] = Rotation.from_quat(file["path/pose/orientation"][:][rows]).as_matrix()
    T_world_body[:, :3, 3] = file["path/pose/position"][:][rows]
    return np.asarray(T_world_body @ file["metadata/cameras/depth"].attrs["T_body_camera"])

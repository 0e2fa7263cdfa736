"""Optical flow of a rigid scene, in closed form from depth and noise-free poses."""

import numpy as np
from numpy.typing import NDArray

from fedora_generator.flow_kernels import displacements

Floats = NDArray[np.float64]


def flow_px(
    inverse_depth_per_m: Floats, K: Floats, T_world_camera_start: Floats, T_world_camera_end: Floats
) -> NDArray[np.float32]:
    """Displacement (height, width, 2), u right and v down, of what each pixel shows between two camera poses.

    The paper's x* = K pi(R z K^-1 x + T) with [R|T] = T_world_camera_end^-1 T_world_camera_start. Divided by z it is
    pi(K R K^-1 x + K T / z), which also holds at infinity (inverse depth 0). Float64 inside, float32 out.

    ``inverse_depth_per_m`` (height, width) is 1 / z at the start; NaN gives NaN, and so does a point that has gone
    behind the camera. Points that leave the image or become occluded keep their displacement.
    """
    T_end_start = np.linalg.inv(T_world_camera_end) @ T_world_camera_start
    flow = np.empty((*inverse_depth_per_m.shape, 2), dtype=np.float32)
    H = K @ T_end_start[:3, :3] @ np.linalg.inv(K)
    displacements(H, K @ T_end_start[:3, 3], inverse_depth_per_m, flow)
    return flow

"""Images between sparse renders, moved along the known flow: tried as a way to more images a second.

At each instant only the depth is rendered. It says where every pixel was at the render before and will be at the one
after; what both show there is mixed by the distance in time, where it is not hidden.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from fedora_generator.camera import Camera
from fedora_generator.flow import flow_px
from fedora_generator.rendered_world import RenderedWorld

Floats = NDArray[np.float64]

RETURN_PX: Final = 1.0
"""A pixel that there and back again ends farther away is hidden: what is seen there is another surface."""


@dataclass(frozen=True, slots=True)
class Key:
    """A render: where from, its luminance (height, width), DN, and 1/z, 1/m."""

    T_world_camera: Floats
    luma_dn: Floats
    inverse_depth_per_m: Floats


@dataclass(slots=True)
class FlowInterpolation:
    """Luminance at any time from renders every ``step_us``."""

    world: RenderedWorld
    camera: Camera
    pose_at: Callable[[int], Floats]
    step_us: int
    keys: dict[int, Key] = field(default_factory=dict)

    def luma_dn(self, time_us: int) -> Floats:
        """Luminance (height, width), DN."""
        before, rest_us = divmod(time_us, self.step_us)
        if rest_us == 0:
            return self._key(before).luma_dn
        T_world_camera = self.pose_at(time_us)
        inverse_depth = self.world.inverse_depth_per_m(self.camera, T_world_camera)
        share = rest_us / self.step_us
        total, weights = np.zeros_like(inverse_depth), np.zeros_like(inverse_depth)
        for number, weight in ((before, 1 - share), (before + 1, share)):
            seen_dn, hidden = self._look_up(self._key(number), T_world_camera, inverse_depth)
            here = weight * np.where(hidden, 1e-6, 1.0)  # seen by neither: the mixture all the same
            total += here * seen_dn
            weights += here
        return np.asarray(total / weights)

    def _look_up(self, key: Key, T_world_camera: Floats, inverse_depth: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Return what a key shows where each pixel lies in it, and where that is another surface."""
        flow = flow_px(inverse_depth, self.camera.K, T_world_camera, key.T_world_camera).astype(np.float64)
        rows, columns = np.indices(inverse_depth.shape)
        at = np.stack([rows + flow[..., 1], columns + flow[..., 0]])
        back = flow_px(key.inverse_depth_per_m, self.camera.K, key.T_world_camera, T_world_camera).astype(np.float64)
        returned = [map_coordinates(back[..., i], at, order=0, mode="nearest") for i in (0, 1)]
        away_px = np.hypot(flow[..., 0] + returned[0], flow[..., 1] + returned[1])
        return map_coordinates(key.luma_dn, at, order=3, mode="nearest"), ~(away_px <= RETURN_PX)

    def _key(self, number: int) -> Key:
        if number not in self.keys:
            T_world_camera = self.pose_at(number * self.step_us)
            depth = self.world.inverse_depth_per_m(self.camera, T_world_camera)
            self.keys[number] = Key(T_world_camera, self.world.luma_dn(self.camera, T_world_camera), depth)
        return self.keys[number]

"""Images between sparse renders, moved along the known flow: a trial to get more images a second.

At each instant only the depth is rendered. The flow that follows from it leads from every pixel to the render before
and to the render after. The luminances there are mixed by the distance in time, where the surface is not hidden.
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
"""Largest distance from a pixel to the end of its flow forth and back: farther away, another surface hides it."""


@dataclass(frozen=True, slots=True)
class Key:
    """A render: its pose, its luminance (height, width), DN, and 1/z (height, width), 1/m."""

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
        rows, columns = np.indices(inverse_depth.shape)
        for number, weight in ((before, 1 - share), (before + 1, share)):
            key = self._key(number)
            flow = flow_px(inverse_depth, self.camera.K, T_world_camera, key.T_world_camera).astype(np.float64)
            coordinates = np.stack([rows + flow[..., 1], columns + flow[..., 0]])
            # A pixel whose flow back from the key does not end near it is hidden in the key by another surface.
            back = flow_px(key.inverse_depth_per_m, self.camera.K, key.T_world_camera, T_world_camera)
            back_u, back_v = (
                map_coordinates(back[..., i].astype(np.float64), coordinates, order=0, mode="nearest") for i in (0, 1)
            )
            away_px = np.hypot(flow[..., 0] + back_u, flow[..., 1] + back_v)
            # Where both keys hide a pixel, the small weights still give the mixture.
            weight_px = weight * np.where(~(away_px <= RETURN_PX), 1e-6, 1.0)
            total += weight_px * map_coordinates(key.luma_dn, coordinates, order=3, mode="nearest")
            weights += weight_px
        return np.asarray(total / weights)

    def _key(self, number: int) -> Key:
        if number not in self.keys:
            T_world_camera = self.pose_at(number * self.step_us)
            depth = self.world.inverse_depth_per_m(self.camera, T_world_camera)
            self.keys[number] = Key(T_world_camera, self.world.luma_dn(self.camera, T_world_camera), depth)
        return self.keys[number]

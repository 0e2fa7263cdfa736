"""Mean flow and mean luma of a long flight, over instants spread evenly in time."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import colour_camera
from fedora_generator.flow import flow_px
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.scene import Scene
from fedora_generator.streams import in_range
from fedora_qa.conventions import FLOW_RATES_HZ, US_PER_S

Floats = NDArray[np.float64]

COARSER: Final = 30
"""Images are rendered so many times smaller; flow is scaled to the full size."""


@dataclass(frozen=True, slots=True)
class Images:
    """Sums over instants: |flow| of all valid pixels by rate (px at full size), their numbers, and the luma (DN)."""

    flow_sums_px: Floats
    """(3,) by rate"""
    pixels: Floats
    """(3,)"""
    luma_dn: float

    @property
    def mean_flow_px(self) -> Floats:
        """Mean of |flow| (3,) over valid pixels, px of the full size, by rate."""
        return self.flow_sums_px / self.pixels


def sample_images(scene: Scene, world: RenderedWorld, length_s: float, count: int, rng: np.random.Generator) -> Images:
    """Look at one instant at random in each of ``count`` equal parts of the flight."""
    full = scene.camera
    camera = colour_camera(scene.with_size(full.width // COARSER, full.height // COARSER).camera)
    flight = scene.fly()
    latest_s = length_s - 1 / min(FLOW_RATES_HZ)
    flow_sums_px, pixels, luma_dn = np.zeros(len(FLOW_RATES_HZ)), np.zeros(len(FLOW_RATES_HZ)), 0.0
    for start_s in ((np.arange(count) + rng.random(count)) / count * latest_s).tolist():
        start_us = round(start_s * US_PER_S)
        T_start = camera.pose_at(flight, start_us)
        inverse_depth = in_range(world.inverse_depth_per_m(camera, T_start), scene.depth_range_m)
        for rate, rate_hz in enumerate(FLOW_RATES_HZ):
            flow = flow_px(inverse_depth, camera.K, T_start, camera.pose_at(flight, start_us + US_PER_S // rate_hz))
            lengths_px = COARSER * np.hypot(flow[..., 0], flow[..., 1]).astype(np.float64)
            flow_sums_px[rate] += np.nansum(lengths_px)
            pixels[rate] += np.count_nonzero(np.isfinite(lengths_px))
        luma_dn += float(world.luma_dn(camera, T_start).mean()) / count
    return Images(flow_sums_px, pixels, luma_dn)

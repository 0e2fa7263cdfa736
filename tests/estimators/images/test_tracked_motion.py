"""Motion of an image from its corners."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.estimators.images.samples import RETURN_PX, tracked_motion_px
from tests.estimators.event_world import Checkers, Waves

SHAPE = (100, 140)


@pytest.mark.parametrize("motion_px", [0.0, 0.4, 1.3, 4.0, 9.5])
@pytest.mark.parametrize("world", [Waves(amplitude_dn=20.0, mean_dn=128.0, seed=3), Checkers(60.0, 50.0)])
def test_motion_is_that_of_the_texture(motion_px: float, world: Waves) -> None:
    """To a fifth of a pixel, and never above it by more than its error."""
    if isinstance(world, Checkers) and motion_px > 0.5 * world.side_px:
        pytest.skip("a checkerboard repeats itself")
    moving = replace(world, velocity_px_s=(0.8 * motion_px, 0.6 * motion_px))
    light_dn = np.stack([moving.luma(0.0, SHAPE), moving.luma(1.0, SHAPE)]).astype(np.float32)
    assert tracked_motion_px(light_dn) == pytest.approx(max(motion_px - RETURN_PX, 0.0), abs=0.2)


def test_nothing_is_stated_without_corners() -> None:
    """Of an even image, and of one that has nothing in common with the next."""
    rng = np.random.default_rng(2)
    assert tracked_motion_px(np.full((2, *SHAPE), 100, np.float32)) == 0.0
    assert tracked_motion_px(rng.uniform(0, 255, (2, *SHAPE)).astype(np.float32)) < 1.0

"""Colour frames on the grid of the flow."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.sequence.window import Sampling
from fedora_qa.views.frame_pairs import luma_on_flow_grid
from tests.support.flow_world import HEIGHT, WIDTH, K, make_world

DARK_DN, BRIGHT_DN = 40, 200


@pytest.mark.parametrize("step", [2, 3])
def test_a_coarser_grid_shows_the_mean_of_detail_that_it_cannot_hold(step: int) -> None:
    """Columns that alternate between dark and bright are grey on a grid of every second or third column."""
    world = make_world((50,))
    cameras = world.facts.declared.cameras
    size = {"width": -(-WIDTH // step), "height": -(-HEIGHT // step)}
    depth = replace(cameras["depth"], K=np.diag([1 / step, 1 / step, 1.0]) @ K, **size)
    stripes = np.where(np.arange(WIDTH) % 2, BRIGHT_DN, DARK_DN).astype(np.uint8)
    frames = np.empty_like(np.asarray(world.rows_by_key["path/rgb"]))
    frames[:] = stripes[:, None]
    world = world.declaring(cameras={**cameras, "depth": depth}).with_rows(path_rgb=frames)
    luma = luma_on_flow_grid(world.windows(Sampling())[0], 0)
    middle = luma[2:-2, 2:-2]
    assert middle == pytest.approx((DARK_DN + BRIGHT_DN) / 2, abs=0.03 * (BRIGHT_DN - DARK_DN))


def test_an_equal_grid_shows_the_frame() -> None:
    """Without a difference of scale nothing is averaged."""
    world = make_world((50,))
    window = world.windows(Sampling())[0]
    frame = np.asarray(world.rows_by_key["path/rgb"])[0]
    luma = luma_on_flow_grid(window, 0)
    assert luma.std() == pytest.approx(frame.mean(axis=-1).std(), rel=0.05)

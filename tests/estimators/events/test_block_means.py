"""Means of the signal and of events over blocks."""

import numpy as np
import pytest

from fedora_qa.estimators.events.block_means import level_blocks


@pytest.mark.parametrize("dark", [None, 0.0, 0.5])
@pytest.mark.parametrize("shape", [(24, 36), (23, 37), (3, 9)])
def test_block_means_are_those_of_the_signal(shape: tuple[int, int], dark: float | None) -> None:
    """Light or its logarithm, from black to white; NaN where the light is not above twice its error anywhere."""
    light = np.random.default_rng(3).uniform(0, 255, shape).astype(np.float32)
    light[:, :3], error = 255, np.zeros(shape, np.float32)
    signal = light.astype(np.float64) if dark is None else np.log(light.astype(np.float64) + dark)
    side = min(4, *shape)
    top, left = (shape[0] % side) // 2, (shape[1] % side) // 2
    error[top, left] = 255
    rows, columns = shape[0] // side, shape[1] // side
    inside = signal[top : top + rows * side, left : left + columns * side]
    expected = inside.reshape(rows, side, columns, side).mean(axis=(1, 3))
    found = level_blocks(light, error, dark)
    assert np.isnan(found[0, 0])
    assert np.count_nonzero(np.isnan(found)) == 1
    assert found.ravel()[1:] == pytest.approx(expected.ravel()[1:], rel=1e-7)

"""Shifts beyond the reach of single pixels are found on blocks of them."""

import numpy as np
import pytest

from fedora_qa.estimators.events.far_shift import FarSums, far_shift, far_sums, joined
from fedora_qa.estimators.events.shift import RADIUS_PX

SHAPE = (96, 128)
REACH_PX = RADIUS_PX - 1.0
LEAST = 0.1


def sums(right_px: int, down_px: int, intervals: int = 6) -> FarSums:
    """Sums of noise of several intervals, the second picture of each moved along."""
    rng = np.random.default_rng(3)
    parts = []
    for _ in range(intervals):
        change = rng.normal(size=SHAPE)
        moved = np.roll(change, (down_px, right_px), axis=(0, 1)) + 0.2 * rng.normal(size=SHAPE)
        parts.append(far_sums(change, moved, np.ones(SHAPE, np.bool_)))
    return joined(parts)


@pytest.mark.parametrize(("right_px", "down_px"), [(10, 0), (-12, 2), (0, 14), (9, -8)])
def test_far_shift_is_found_to_half_a_pixel(right_px: int, down_px: int) -> None:
    """Its standard errors are those of a place within a block, where intervals agree."""
    found = far_shift(sums(right_px, down_px), REACH_PX, LEAST)
    assert found is not None
    assert found.shift.right_px == pytest.approx(right_px, abs=1.0)
    assert found.shift.down_px == pytest.approx(down_px, abs=1.0)
    assert np.all((found.errors_px > 0.5) & (found.errors_px < 1.0))


@pytest.mark.parametrize("right_px", [0, 6, 40])
def test_what_is_near_or_out_of_reach_is_not_far(right_px: int) -> None:
    """Near shifts are for those who read single pixels; beyond sixteen pixels nothing correlates."""
    assert far_shift(sums(right_px, 0), REACH_PX, LEAST) is None


def test_pixels_that_are_not_usable_count_nothing() -> None:
    """Whatever stands in them."""
    rng = np.random.default_rng(5)
    change, usable = rng.normal(size=SHAPE), rng.random(SHAPE) < 0.7
    moved = np.roll(change, 10, axis=1)
    one, other = (far_sums(change, np.where(usable, moved, left_out), usable) for left_out in (0.0, 1e6))
    np.testing.assert_allclose(one.patches, other.patches)
    np.testing.assert_allclose(one.squares, other.squares)

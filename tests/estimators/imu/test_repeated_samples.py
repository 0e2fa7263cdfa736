"""Repeats while a body moves are counted, and rest is not."""

import numpy as np

from fedora_qa.estimators.imu.repeated_samples import repeated_samples
from tests.estimators.imu.smooth_motion import TIMES_S
from tests.support.motion_world import RESTLESS


def test_repeats_in_motion_are_stops_and_rest_is_not() -> None:
    """Values held for three samples are found; a body that slows down and rests holds none."""
    positions = RESTLESS.positions_m(TIMES_S)
    held = positions.copy()
    held[200:203] = held[199]
    assert repeated_samples(held, held, roundings=(1e-16, 1e-16)).tolist() == [200, 201, 202]
    resting = np.where(TIMES_S[:, None] < 1.0, (1.0 - TIMES_S[:, None]) ** 3 * positions[0], 0.0)
    assert repeated_samples(resting, resting, roundings=(1e-16, 1e-16)).tolist() == []
    assert repeated_samples(np.ones((50, 3)), roundings=(1e-16,)).tolist() == []


def test_repeats_between_roundings_are_no_stops() -> None:
    """A value that creeps by one unit of rounding now and then repeats in between; a step of many units shows."""
    creeping = np.floor(np.arange(50) / 4.0)[:, None]
    assert repeated_samples(creeping, roundings=(1.0,)).tolist() == []
    assert len(repeated_samples(creeping, roundings=(0.01,))) == 37


def test_a_repeat_of_one_array_alone_is_no_stop() -> None:
    """A body that turns on the spot repeats its position."""
    turning = np.outer(TIMES_S, [0.0, 0.0, 1.0])
    assert repeated_samples(np.zeros((601, 3)), turning, roundings=(1e-16, 1e-16)).tolist() == []

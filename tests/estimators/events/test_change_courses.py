"""Courses of frames and events over time, of a closed-form texture whose pixels fire at whole thresholds."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.events.change_courses import common_change, longest_unrelated, silent_tiles

Float64 = NDArray[np.float64]

INTERVALS, TILES, BLOCKS, STEP = 40, 16, 150, 0.05
WHILE = slice(12, 22)


def changes(seed: int = 0) -> tuple[Float64, Float64]:
    """Changes of frames and of events, (k, t, blocks): tiles have more and more motion."""
    random = np.random.default_rng(seed)
    d = random.normal(0, 1, (INTERVALS, TILES, BLOCKS)) * np.linspace(0.01, 0.1, TILES)[:, None]
    level = np.cumsum(d, axis=0)
    fired = STEP * np.round(level / STEP)
    return d, np.diff(fired, axis=0, prepend=0.0)


def moments(d: Float64, e: Float64) -> Float64:
    """The sums of 1, d, e, dd, ee and de over blocks."""
    return np.stack([values.sum(axis=-1) for values in (np.ones_like(d), d, e, d * d, e * e, d * e)], axis=-1)


def unrelated(d: Float64, e: Float64) -> int:
    return longest_unrelated(*moments(d, e).sum(axis=1).T[3:])


def halved(e: Float64) -> Float64:
    """Half of the events of the while are lost."""
    thinned = e.copy()
    thinned[WHILE] *= np.random.default_rng(1).random(e[WHILE].shape) < 0.5
    return thinned


def test_what_is_in_order_has_none_of_the_courses() -> None:
    d, e = changes()
    of_all = moments(d, e)
    assert (unrelated(d, e), common_change(of_all), silent_tiles(of_all).sum()) == (0, 0.0, 0)


def test_events_of_another_scene_for_a_while_are_unrelated() -> None:
    """Of as many events, from another world."""
    d, e = changes()
    e[WHILE] = changes(7)[1][WHILE]
    assert unrelated(d, e) >= 9
    assert not silent_tiles(moments(d, e)).any()


def test_losses_are_neither_unrelated_nor_silent_tiles() -> None:
    """Half of the events, and all of them, of a while: what is left follows the frames, or nothing is left anywhere."""
    d, e = changes()
    without = e.copy()
    without[WHILE] = 0.0
    for lossy in (halved(e), without):
        of_all = moments(d, lossy)
        assert (unrelated(d, lossy), common_change(of_all), silent_tiles(of_all).sum()) == (0, 0.0, 0)


def test_tiles_that_are_silent_for_a_while() -> None:
    """Three busy tiles without events, beside others that have them."""
    d, e = changes()
    e[WHILE, 12:15] = 0.0
    assert np.flatnonzero(silent_tiles(moments(d, e))).tolist() == [12, 13, 14]


def test_tiles_that_are_silent_at_different_times_are_none() -> None:
    """They share no interval, in which the others could have events."""
    d, e = changes()
    for tile, first in ((12, 2), (13, 14), (14, 26)):
        e[first : first + 10, tile] = 0.0
    assert not silent_tiles(moments(d, e)).any()


def test_noise_for_a_while_leaves_no_silent_tile() -> None:
    """Events of noise are there at one time alone, and the rest of the time lacks none."""
    d, e = changes()
    e[:, 13] = 0.0
    e[WHILE, 13] = STEP * np.random.default_rng(3).integers(-1, 2, e[WHILE, 13].shape)
    assert not silent_tiles(moments(d, e))[13]


@pytest.mark.parametrize("gain", [-0.2, 0.15])
def test_frames_that_change_as_a_whole_were_exposed_otherwise(gain: float) -> None:
    """A slow gain of all frames, without events; where darker events are lost, quiet tiles do not change."""
    d, e = changes()
    assert common_change(moments(d + gain / INTERVALS, e)) == pytest.approx(gain, rel=0.2)
    assert common_change(moments(d, np.where(e < 0, 0.0, e))) == 0.0

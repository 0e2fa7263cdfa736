"""The flight as a person sees it: noise does not speed it up, and what is broken is left out."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.evidence.trajectory import keep_trajectory
from fedora_qa.sequence.facts import Facts
from tests.support.facts import clock, exact_facts

RADIUS_M, TURN_RAD_S = 5.0, 0.8


class Poses:
    """Poses in memory; rows from one on cannot be decoded."""

    def __init__(self, positions_m: NDArray[Any], orientations: Rotation, readable: int = 10**9) -> None:
        self.columns = {"path/pose/position": positions_m, "path/pose/orientation": orientations.as_quat()}
        self.readable = readable

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        if stop > self.readable:
            raise UnreadableRowsError(key, start, stop, "damaged")
        return self.columns[key][start:stop]

    def event_index(self, time_ns: int) -> int:
        return 0


def circle(noise_m: float = 0.0, seconds: int = 4) -> tuple[Facts, Poses]:
    """A level circle at 4 m/s, looking along the path."""
    facts = exact_facts(seconds)
    angles = TURN_RAD_S * facts.clocks["pose"].times_ns / 1e9
    positions_m = RADIUS_M * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    positions_m += noise_m * np.random.default_rng(3).standard_normal(positions_m.shape)
    return facts, Poses(positions_m, Rotation.from_euler("Z", angles[:, None] + np.pi / 2))


@pytest.mark.parametrize(("noise_m", "within_m_s"), [(0.0, 1e-3), (0.005, 0.15)], ids=["exact", "noisy"])
def test_speed_is_that_of_the_motion(noise_m: float, within_m_s: float) -> None:
    """Differences of noisy poses would read 1.4 m/s of noise a component; the smoothed speed is 4 m/s throughout."""
    facts, poses = circle(noise_m)
    kept = keep_trajectory(facts, poses, 4000).arrays
    assert np.sqrt(np.mean((kept["trajectory/speeds_m_s"] - RADIUS_M * TURN_RAD_S) ** 2)) < within_m_s
    np.testing.assert_array_equal(kept["trajectory/positions_world_m"], poses.columns["path/pose/position"])


def test_forward_is_where_the_body_looks() -> None:
    """The X axis of the body in the world, as scipy rotates it."""
    facts, poses = circle()
    forward = keep_trajectory(facts, poses, 4000).arrays["trajectory/forward_world"]
    expected = Rotation.from_quat(poses.columns["path/pose/orientation"]).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(forward, expected, atol=1e-12)


def test_points_are_bounded_and_evenly_chosen() -> None:
    """Of many poses so many are kept as asked, the first and the last among them; times are on the file's clock."""
    facts, poses = circle()
    kept = keep_trajectory(replace(facts, origin_us=1_000_000), poses, 50).arrays
    assert all(len(array) == 50 for array in kept.values())
    times_us = kept["trajectory/times_us"]
    assert (times_us[0], times_us[-1]) == (1_000_000, 5_000_000)
    assert np.ptp(np.diff(times_us)) <= 5_000


def test_broken_poses_are_left_out() -> None:
    """NaN positions, zero quaternions and stamps that step back cost their own pose alone."""
    facts, poses = circle()
    poses.columns["path/pose/position"][10] = np.nan
    poses.columns["path/pose/orientation"][20] = 0.0
    times_ns = facts.clocks["pose"].times_ns.copy()
    times_ns[30] = times_ns[28]
    facts = replace(facts, clocks={**facts.clocks, "pose": clock(times_ns)})
    kept = keep_trajectory(facts, poses, 4000).arrays
    assert len(kept["trajectory/times_us"]) == len(times_ns) - 3
    assert all(np.isfinite(array).all() for array in kept.values())


def test_few_poses_have_no_speed() -> None:
    """Poses too few to smooth are shown with speeds unknown."""
    facts, poses = circle()
    facts = replace(facts, clocks={"pose": clock(facts.clocks["pose"].times_ns[:3])})
    kept = keep_trajectory(facts, poses, 4000).arrays
    assert len(kept["trajectory/positions_world_m"]) == 3
    assert np.isnan(kept["trajectory/speeds_m_s"]).all()


def test_nothing_to_show() -> None:
    """Without poses, or with none that can be decoded, there is no trajectory."""
    facts, poses = circle()
    assert not keep_trajectory(replace(facts, clocks={}), poses, 4000).arrays
    poses.readable = 0
    assert not keep_trajectory(facts, poses, 4000).arrays

"""When the event camera is rendered, and how the event columns and index maps grow."""

from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_generator.camera import event_camera
from fedora_generator.events.keys import EventBatch
from fedora_generator.flight import Flight
from fedora_generator.rates import intervals_us, timestamps_us
from fedora_generator.render import ExactWorld
from fedora_generator.sampling import MOTION_BOUND_PX, FixedSteps, MotionSteps
from fedora_generator.scene import load_scene
from fedora_generator.write import EventColumns, IndexMap
from fedora_qa.layout.canonical import EVENT_CHUNK_ROWS


@pytest.mark.parametrize("quality", MOTION_BOUND_PX)
def test_no_pixel_moves_farther_than_the_bound_in_a_step(quality: str) -> None:
    """In the fastest turn, every pixel projected with SciPy's rotations stays within 2% of the bound in each step.

    The bound is met for equal parts of the whole displacement; within a frame interval the pace changes a little.
    """
    scene = load_scene("fast-turn").with_size(72, 54)
    world, camera, flight = ExactWorld.of(scene.world, scene.light), event_camera(scene.camera), Flight(scene.flight)
    bound_px = MOTION_BOUND_PX[quality]  # type: ignore[index]
    start_us, stop_us = 980_000, 1_000_000
    times_us = [start_us, *MotionSteps(world, camera, flight, bound_px).times_us(start_us, stop_us).tolist()]
    assert times_us[-1] == stop_us
    pixels = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1).reshape(-1, 2)
    rays = np.concatenate([(pixels - camera.K[:2, 2]) / camera.K[0, 0], np.ones((len(pixels), 1))], axis=1)
    largest = []
    for time_us, next_us in pairwise(times_us):
        here, there = camera.pose_at(flight, time_us), camera.pose_at(flight, next_us)
        w = world.inverse_depth_per_m(camera, here).reshape(-1, 1)
        # Points at z rays, divided by z: the sky has w = 0.
        world_points = Rotation.from_matrix(here[:3, :3]).apply(rays) + w * (here[:3, 3] - there[:3, 3])
        seen = Rotation.from_matrix(there[:3, :3]).inv().apply(world_points)
        moved = camera.K[0, 0] * seen[:, :2] / seen[:, 2:] + camera.K[:2, 2] - pixels
        largest.append(np.hypot(*moved.T).max())
    assert max(largest) < 1.02 * bound_px
    assert max(largest) > 0.5 * bound_px  # and no more renders than that


def test_a_still_camera_is_rendered_twice_an_interval() -> None:
    """Where nothing moves, the end of the interval and its middle, so that events are not those of the frames alone."""
    scene = load_scene("hover").with_size(72, 54)
    world, camera, flight = ExactWorld.of(scene.world, scene.light), event_camera(scene.camera), Flight(scene.flight)
    np.testing.assert_array_equal(MotionSteps(world, camera, flight, 0.5).times_us(0, 20_000), [10_000, 20_000])


@given(st.integers(0, 10**7), st.integers(1, 10**5), st.integers(1, 5000))
def test_fixed_steps_lie_on_one_grid(start_us: int, length_us: int, step_us: int) -> None:
    """All multiples of the step after the start and before the end, then the end."""
    times = FixedSteps(step_us).times_us(start_us, start_us + length_us).tolist()
    grid = [time for time in range(0, start_us + length_us, step_us) if time > start_us] if step_us > 100 else None
    assert times[-1] == start_us + length_us
    assert all(time % step_us == 0 for time in times[:-1])
    assert grid is None or times[:-1] == grid


def test_timestamps_of_the_paper_rates() -> None:
    """2 s: 101 frames, 2001 IMU samples, 401 poses, 20 abutting intervals at 10 Hz, both ends included."""
    for rate_hz, count in ((50, 101), (1000, 2001), (200, 401)):
        timestamps = timestamps_us(2_000_000, rate_hz)
        assert (len(timestamps), timestamps[0], timestamps[-1]) == (count, 0, 2_000_000)
    intervals = intervals_us(2_000_000, 10)
    assert intervals.shape == (20, 2)
    np.testing.assert_array_equal(intervals[1:, 0], intervals[:-1, 1])


times = st.lists(st.integers(1, 60), max_size=40).map(sorted)


@given(times, st.lists(st.integers(0, 70), max_size=12).map(sorted), st.lists(st.integers(0, 40), max_size=6))
def test_an_index_map_does_not_depend_on_the_batches(events: list[int], frames: list[int], cuts: list[int]) -> None:
    """However the events are cut into batches, empty ones included, the map is ``searchsorted`` of all."""
    index_map = IndexMap(np.array(frames, dtype=np.int64))
    for batch in np.split(np.array(events, dtype=np.int64), sorted(cuts)):
        index_map.append(batch)
    np.testing.assert_array_equal(index_map.finish(), np.searchsorted(events, frames, side="left"))


def test_event_columns_hold_what_was_appended(tmp_path: Path) -> None:
    """Batches of any size, across chunk borders, arrive once and in order."""
    rng = np.random.default_rng(0)
    sizes = [0, 1, EVENT_CHUNK_ROWS - 2, 3, 5, EVENT_CHUNK_ROWS + 7, 0]
    batches = [
        EventBatch(
            rng.integers(0, 640, size).astype(np.uint16),
            rng.integers(0, 480, size).astype(np.uint16),
            rng.integers(0, 10**6, size),
            rng.integers(0, 2, size).astype(np.uint8),
        )
        for size in sizes
    ]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        columns = EventColumns(file)
        for batch in batches:
            columns.append(batch)
        columns.finish()
        assert columns.rows == sum(sizes)
        for name, field in (("x", "x"), ("y", "y"), ("t", "t_us"), ("p", "p")):
            expected = np.concatenate([getattr(batch, field) for batch in batches])
            np.testing.assert_array_equal(file[f"path/events/{name}"][:], expected)

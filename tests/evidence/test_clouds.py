"""Single events around the busiest instants: which they are, thinned evenly, and of one picture with the snapshot."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.evidence.clouds import (
    cloud_times_ns,
    keep_event_clouds,
    keep_point_cloud,
    take_event_cloud,
    take_point_cloud,
)
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.geometry.lens import pixels_of_rays
from fedora_qa.sequence.declared import Camera, Declared, Lens
from fedora_qa.sequence.facts import Facts
from tests.evidence.memory import HEIGHT, SENSOR_HEIGHT, SENSOR_WIDTH, WIDTH, Memory, memory
from tests.support.facts import MS, clock

INSTANT_NS = 500 * MS


def clouds_of(file: Memory, *times_ns: int, most: int = 3, events: int = 4000) -> TitledArrays:
    """What is kept of instants in the third window."""
    taken = [take_event_cloud(file.window(2), time_ns, events) for time_ns in times_ns]
    return keep_event_clouds([cloud for cloud in taken if cloud is not None], file.facts, most)


def test_events_are_those_of_the_file() -> None:
    """All events of 10 ms before and after the instant, with their pixel, time and polarity."""
    file = memory()
    kept = clouds_of(file, INSTANT_NS)
    rows = np.arange(490, 510)  # an event each ms
    for name, key in (("x", "x"), ("y", "y"), ("polarities", "p")):
        np.testing.assert_array_equal(kept.arrays[f"event_clouds/{name}"], file.columns[f"path/events/{key}"][rows])
    np.testing.assert_array_equal(kept.arrays["event_clouds/offsets_us"], (rows - 500) * 1000)
    assert kept.arrays["event_clouds/times_us"] == file.facts.origin_us + 500e3
    intervals_us = kept.arrays["event_clouds/intervals_us"] - file.facts.origin_us
    assert intervals_us.tolist() == [[490e3, 510e3]]
    assert kept.arrays["event_clouds/counts"].tolist() == [20]
    assert kept.arrays["event_clouds/shapes_px"].tolist() == [[SENSOR_HEIGHT, SENSOR_WIDTH]]
    dtypes = {"x": "u2", "y": "u2", "offsets_us": "i2", "polarities": "u1", "instant": "u1"}
    assert {name: kept.arrays[f"event_clouds/{name}"].dtype.str[1:] for name in dtypes} == dtypes
    assert kept.titles.keys() == kept.arrays.keys()


def test_events_are_thinned_evenly() -> None:
    """Of twenty events five, from the first to the last at nearly even steps; all are counted."""
    kept = clouds_of(memory(), INSTANT_NS, events=5).arrays
    assert kept["event_clouds/offsets_us"].tolist() == [-10_000, -5_000, 0, 4_000, 9_000]
    assert kept["event_clouds/counts"].tolist() == [20]


def test_instants_with_most_events_are_kept_in_the_order_of_time() -> None:
    """Without the events from 480 to 495 ms, the instants after them are the busiest; ties keep the earlier."""
    file = memory()
    silent = (file.columns["path/events/t"] >= 480 * MS) & (file.columns["path/events/t"] < 495 * MS)
    file.columns = {key: rows[~silent] if "events" in key else rows for key, rows in file.columns.items()}
    kept = clouds_of(file, 490 * MS, 505 * MS, 520 * MS, 540 * MS, most=2).arrays
    assert (kept["event_clouds/times_us"] - file.facts.origin_us).tolist() == [505e3, 520e3]
    assert kept["event_clouds/instant"].tolist() == [0] * 20 + [1] * 20


def test_events_beside_the_sensor_are_left_out() -> None:
    """An event beyond the declared size is in no cloud; without a declaration the events themselves give the size."""
    file = memory()
    x = file.columns["path/events/x"].copy()
    x[500] = 9
    file.columns = {**file.columns, "path/events/x": x}
    kept = clouds_of(file, INSTANT_NS).arrays
    assert kept["event_clouds/counts"].tolist() == [19]
    assert int(kept["event_clouds/x"].max()) < SENSOR_WIDTH
    file.facts = replace(file.facts, declared=Declared())
    assert clouds_of(file, INSTANT_NS).arrays["event_clouds/shapes_px"].tolist() == [[SENSOR_HEIGHT, 10]]


def test_nothing_to_keep() -> None:
    """Without events, with unreadable ones, and where none is near, there is no cloud."""
    file = memory()
    assert not clouds_of(file, 5000 * MS).arrays
    file.unreadable = {"path/events/x"}
    assert not clouds_of(file, INSTANT_NS).arrays
    file.facts = replace(file.facts, streams=frozenset({"rgb"}))
    assert not clouds_of(file, INSTANT_NS).arrays


ALL = HEIGHT * WIDTH
K = np.array([[5.0, 0.0, 3.5], [0.0, 5.0, 2.5], [0.0, 0.0, 1.0]])
LEVER_M = np.array([0.1, 0.2, -0.3])

T_BODY_CAMERA = np.eye(4)
# Optical Z is forward (body X), optical X is right (body -Y), optical Y is down (body -Z).
T_BODY_CAMERA[:3, :3] = [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
T_BODY_CAMERA[:3, 3] = LEVER_M


def yawing(lens: Lens | None = None) -> Memory:
    """A body that flies along (3, 4, 0) m/s and turns about Z at 0.5 rad/s; frame i has depth i m everywhere."""
    file = memory()
    camera = Camera(WIDTH, HEIGHT, K, T_BODY_CAMERA, lens=lens)
    file.facts = replace(file.facts, declared=Declared(cameras={"rgb": camera, "depth": camera}))
    yaws = 0.5 * file.facts.clocks["pose"].times_ns / 1e9
    file.columns = {**file.columns, "path/pose/orientation": Rotation.from_euler("Z", yaws[:, None]).as_quat()}
    return file


@pytest.mark.parametrize("lens", [None, Lens("radtan", (-0.1, 0.01, 1e-3, 0.0))])
def test_points_lie_where_the_pixels_look(lens: Lens | None) -> None:
    """Back through an independent chain of rotations, each point falls on its pixel, at the depth of its frame."""
    cloud = take_point_cloud(yawing(lens).window(2), INSTANT_NS, ALL)
    assert cloud is not None
    at_s = cloud.time_ns / 1e9
    np.testing.assert_allclose(cloud.position_world_m, [3 * at_s, 4 * at_s, 0.0], atol=1e-12)
    in_body_m = Rotation.from_euler("Z", -0.5 * at_s).apply(cloud.points_world_m - cloud.position_world_m) - LEVER_M
    forward_m, right_m, down_m = in_body_m[:, 0], -in_body_m[:, 1], -in_body_m[:, 2]
    np.testing.assert_allclose(forward_m, 25.0, rtol=1e-6)  # the frame at 0.5 s
    columns, rows = pixels_of_rays(K, lens, right_m / forward_m, down_m / forward_m)
    expected = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    np.testing.assert_allclose([columns, rows], [axis.ravel() for axis in expected], atol=1e-5)


def test_points_are_a_grid_and_invalid_depth_is_left_out() -> None:
    """Of 48 pixels at most 13 points: the middles of squares of two; a pixel without depth has none."""
    file = yawing()
    whole = take_point_cloud(file.window(2), INSTANT_NS, 13)
    assert whole is not None
    assert len(whole.points_world_m) == (HEIGHT // 2) * (WIDTH // 2)
    file.columns["path/depth"][25, 1, 1] = np.nan
    left = take_point_cloud(file.window(2), INSTANT_NS, 13)
    assert left is not None
    np.testing.assert_array_equal(left.points_world_m, whole.points_world_m[1:])
    assert len(left.rgb) == len(left.points_world_m)


def test_colours_are_those_of_the_pixels() -> None:
    """Frame 25 is 25 everywhere, but for one pixel."""
    file = yawing()
    file.columns["path/rgb"][25, 0, 2] = [200, 100, 50]
    cloud = take_point_cloud(file.window(2), INSTANT_NS, ALL)
    assert cloud is not None
    assert cloud.rgb[2].tolist() == [200, 100, 50]
    assert (np.delete(cloud.rgb, 2, axis=0) == 25).all()


def other_colours(facts: Facts, **changed: object) -> Facts:
    """Facts whose colour camera is another."""
    cameras = dict(facts.declared.cameras)
    cameras["rgb"] = replace(cameras["rgb"], **changed)
    return replace(facts, declared=replace(facts.declared, cameras=cameras))


@pytest.mark.parametrize("change", ["grid", "mounting", "lens", "time", "unreadable", "families"])
def test_points_are_grey_where_colour_is_of_another_grid_or_time(change: str) -> None:
    """Points stay, and are grey."""
    file, families = yawing(), None
    if change == "grid":
        file.facts = other_colours(file.facts, K=2 * K)
    elif change == "mounting":
        aside = T_BODY_CAMERA.copy()
        aside[1, 3] += 0.05
        file.facts = other_colours(file.facts, T_body_camera=aside)
    elif change == "lens":
        file.facts = other_colours(file.facts, lens=Lens("radtan", (-0.1, 0.0, 0.0, 0.0)))
    elif change == "time":
        late = clock(file.facts.clocks["rgb"].times_ns + 111 * MS)
        file.facts = replace(file.facts, clocks={**file.facts.clocks, "rgb": late})
    elif change == "unreadable":
        file.unreadable = {"path/rgb"}
    else:
        families = frozenset({"depth", "pose"})
    window = file.window(2)
    if change == "time":
        window.span = replace(window.span, owned={**window.span.owned, "rgb": (25, 26)})
    cloud = take_point_cloud(window, INSTANT_NS, ALL, families)
    assert cloud is not None
    assert (cloud.rgb == 128).all()


@pytest.mark.parametrize("lost", ["path/depth", "path/pose/position", "camera", "size", "families", "pose"])
def test_no_points_without_depth_pose_and_camera(lost: str) -> None:
    """What is unreadable, undeclared, of another size, or not asked for, leaves no cloud."""
    file, families = yawing(), None
    if lost == "camera":
        file.facts = replace(file.facts, declared=Declared())
    elif lost == "size":
        cameras = {"depth": replace(file.facts.declared.cameras["depth"], width=WIDTH + 1)}
        file.facts = replace(file.facts, declared=Declared(cameras=cameras))
    elif lost == "families":
        families = frozenset({"depth", "rgb"})
    elif lost == "pose":
        file.facts = replace(file.facts, streams=file.facts.streams - {"pose"})
    else:
        file.unreadable = {lost}
    assert take_point_cloud(file.window(2), INSTANT_NS, ALL, families) is None


def test_points_are_kept_relative_to_the_body() -> None:
    """Far from the origin of the world single precision would lose centimetres; relative to the body it keeps them."""
    file = yawing()
    file.columns["path/pose/position"] += [5e6, 0.0, 0.0]
    clouds = [take_point_cloud(file.window(2), time_ns, ALL) for time_ns in (INSTANT_NS, INSTANT_NS + 40 * MS)]
    taken = [cloud for cloud in clouds if cloud is not None]
    kept = keep_point_cloud(taken, file.facts)
    assert kept.arrays["point_cloud/offsets_m"].dtype == np.float32
    restored_m = kept.arrays["point_cloud/offsets_m"] + kept.arrays["point_cloud/origin_world_m"]
    np.testing.assert_allclose(restored_m, np.concatenate([cloud.points_world_m for cloud in taken]), atol=1e-5, rtol=0)
    assert (kept.arrays["point_cloud/times_us"] - file.facts.origin_us).tolist() == [500e3, 540e3]
    assert kept.arrays["point_cloud/rgb"].shape == (2 * ALL, 3)
    assert kept.titles.keys() == kept.arrays.keys()


def test_times_are_chosen_evenly() -> None:
    """The first and the last among them; fewer where there are fewer; none of none."""
    assert cloud_times_ns({0: (0, 10), 2: (20, 30, 40)}, 3) == {0, 20, 40}
    assert cloud_times_ns({0: (0,)}, 3) == {0}
    assert cloud_times_ns({}, 3) == frozenset()

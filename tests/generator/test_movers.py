"""Boxes that move: depth and flow against 50 digits, snapshots against worlds that stand, events, refusals."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from fedora_generator.camera import Camera, CameraOptions, colour_camera, event_camera
from fedora_generator.errors import SceneError
from fedora_generator.faults.plant import plant_fault
from fedora_generator.flight import FlightOptions
from fedora_generator.flow import scene_flow_px
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.render import ExactWorld
from fedora_generator.sampling import MotionSteps
from fedora_generator.scene import Scene, load_scene
from fedora_generator.streams import depth_mm
from fedora_generator.surfaces.world import Box, Movement, Mover, Sway, World
from tests.generator.mpmath_world import MP, Plane, Vector, first_hit, planes_of, project, ray_of, vector
from tests.generator.test_exact_flow import burst, exact_pose

SCENE = load_scene("park-traffic")
CAMERA = colour_camera(CameraOptions(width=48, height=36))
SWAYS = (
    Sway(axis="x", amplitude_m=0.2, frequency_hz=3.0, phase_deg=20.0),
    Sway(axis="z", amplitude_m=0.15, frequency_hz=5.0),
)
MOVER = Mover(
    name="mover",
    center_m=(3.0, 0.2, 1.4),
    size_m=(1.0, 1.4, 1.1),
    yaw_deg=25.0,
    texture="wood",
    movement=Movement(velocity_m_s=(-1.0, 2.5, 0.3), sways=SWAYS),
)


def standing() -> World:
    assert SCENE.world is not None
    return replace(SCENE.world, movers=())


def world_with(mover: Mover) -> World:
    return replace(standing(), movers=(mover,))


def stopped(mover: Mover, time_us: int) -> Box:
    """A box that stands where the mover is at a time."""
    center_m = np.array(mover.center_m) + mover.movement.displacement_m(np.array([time_us / 1e6]))[0]
    return Box(
        name="stopped",
        center_m=tuple(center_m.tolist()),
        size_m=mover.size_m,
        yaw_deg=mover.yaw_deg,
        texture=mover.texture,
    )


def exact_displacement(movement: Movement, time_us: int) -> Vector:
    t = MP.mpf(time_us) / 10**6
    displaced = [v * t for v in vector(movement.velocity_m_s)]
    for sway in movement.sways:
        turns = MP.mpf(sway.frequency_hz) * t + MP.mpf(sway.phase_deg) / 360
        displaced["xyz".index(sway.axis)] += MP.mpf(sway.amplitude_m) * MP.sin(2 * MP.pi * turns)
    return displaced


def exact_planes(mover: Mover, time_us: int) -> list[Plane]:
    """Ground and mover at a time; the mover's faces come last."""
    ground = replace(standing(), boxes=(), lamps=())
    at_rest = Box(
        name="rest", center_m=mover.center_m, size_m=mover.size_m, yaw_deg=mover.yaw_deg, texture=mover.texture
    )
    resting = replace(ground, boxes=(at_rest,))
    shift = exact_displacement(mover.movement, time_us)
    return [
        replace(plane, center=[c + s for c, s in zip(plane.center, shift, strict=True)]) if plane.number else plane
        for plane in planes_of(resting)
    ]


@settings(deadline=None, max_examples=12)
@given(start_us=st.integers(0, 300_000), interval_us=st.sampled_from([20_000, 40_000, 100_000]))
def test_depth_and_flow_of_a_mover_are_exact(start_us: int, interval_us: int) -> None:
    """From the sines of flight and mover to float32, at 10.7 rad/s: half a unit in the last place, 1e-8 px besides."""
    options, end_us = burst(2.0, "yaw", -0.5), start_us + interval_us
    flight = replace(SCENE, flight=options).fly()
    world = ExactWorld.of(replace(world_with(MOVER), boxes=()), SCENE.light).at(start_us)
    poses = tuple(CAMERA.poses_at(flight, np.array([start_us, end_us])))
    inverse_depth, bodies = world.inverse_depth_per_m(CAMERA, poses[0]), world.visible_bodies(CAMERA, poses[0])
    inverse_depth[inverse_depth == 0] = np.nan
    flow = scene_flow_px(world, CAMERA, inverse_depth, bodies, poses, (start_us, end_us))
    planes = exact_planes(MOVER, start_us)
    start_T, end_T = (exact_pose(options, CAMERA, time_us) for time_us in (start_us, end_us))
    ends = [exact_displacement(MOVER.movement, time_us) for time_us in (start_us, end_us)]
    for column, row in [(24, 18), (10, 25), (40, 12), (30, 30), (20, 10)]:
        seen = first_hit(planes, CAMERA, start_T, column, row)
        assert bodies[row, column] == (seen is not None and seen[0].number > 0)
        if seen is None:
            continue
        z_mm = float(1000 * seen[1].z)
        assert abs(float(depth_mm(inverse_depth)[row, column]) - z_mm) <= 0.51 * np.spacing(np.float32(z_mm))
        ray = ray_of(CAMERA, start_T, column, row)
        point = [c + seen[1].z * r for c, r in zip(start_T[:3, 3], ray, strict=True)]
        if seen[0].number:
            point = [p + after - before for p, before, after in zip(point, *ends, strict=True)]
        x, y, ahead = project(CAMERA, end_T, point)
        for found, exact in zip(flow[row, column].tolist(), (x - column, y - row), strict=True):
            if ahead <= 0:
                assert np.isnan(found)
            else:
                assert abs(found - exact) <= 0.5 * np.spacing(np.float32(abs(exact))) + 1e-8


@pytest.mark.parametrize("time_us", [0, 123_457, 700_000])
def test_a_snapshot_is_a_world_that_stands(time_us: int) -> None:
    """At any time, colours and depth are those of a world whose box stands where the mover is."""
    T_world_camera = CAMERA.pose_at(SCENE.fly(), time_us)
    snapshot = ExactWorld.of(world_with(MOVER), SCENE.light).at(time_us)
    stands = ExactWorld.of(replace(standing(), boxes=(*standing().boxes, stopped(MOVER, time_us))), SCENE.light)
    for one, two in (
        (snapshot.rgb_dn(CAMERA, T_world_camera), stands.rgb_dn(CAMERA, T_world_camera)),
        (snapshot.inverse_depth_per_m(CAMERA, T_world_camera), stands.inverse_depth_per_m(CAMERA, T_world_camera)),
    ):
        np.testing.assert_allclose(one, two, rtol=1e-9)
    assert (snapshot.at(0).faces.centers_m == ExactWorld.of(world_with(MOVER), SCENE.light).faces.centers_m).all()


def test_a_world_that_stands_is_its_own_snapshot() -> None:
    """Nothing is copied where nothing moves, and no pixel shows a body."""
    world = ExactWorld.of(standing(), SCENE.light)
    assert world.at(123) is world
    assert not world.visible_bodies(CAMERA, CAMERA.pose_at(SCENE.fly(), 0)).any()
    assert not world.faces.bodies.any()


def test_faces_know_their_body() -> None:
    """Bodies are counted from 1 in the order of the movers; what stands is 0, and each has its displacement."""
    world = ExactWorld.of(replace(standing(), movers=(replace(MOVER, movement=Movement()), MOVER)), SCENE.light)
    faces = 1 + 6 * len(standing().boxes)
    np.testing.assert_array_equal(world.faces.bodies, [0] * faces + [1] * 6 + [2] * 6)
    times_s = np.array([0.0, 0.25])
    np.testing.assert_array_equal(world.displacement_m(0, times_s), np.zeros((2, 3)))
    np.testing.assert_array_equal(world.displacement_m(1, times_s), np.zeros((2, 3)))
    expected = [[0.2 * np.sin(np.radians(20)), 0, 0], [-0.25 + 0.2 * np.sin(1.5 * np.pi + np.radians(20)), 0.625, 0]]
    expected[1][2] = 0.075 + 0.15 * np.sin(2.5 * np.pi)
    np.testing.assert_allclose(world.displacement_m(2, times_s), expected, atol=1e-15)


def still_camera(**changes: object) -> Scene:
    """A camera that does not move before a box that crosses its view."""
    mover = replace(MOVER, movement=Movement(velocity_m_s=(0.0, 3.0, 0.0)))
    return replace(
        SCENE,
        world=world_with(mover),
        flight=FlightOptions(position_m=(0.0, 0.0, 1.5)),
        camera=replace(SCENE.camera, width=72, height=54),
        **changes,
    )


def test_a_still_camera_sees_events_of_what_moves_only(tmp_path: Path) -> None:
    """Each pixel's events add up to its change of log luma; where the luma never changes there is none."""
    scene, threshold = still_camera(), 0.2
    generate_sequence(scene, tmp_path / "s.h5", Request(duration_s=0.2, streams=frozenset({"events"})))
    with h5py.File(tmp_path / "s.h5") as file:
        x, y, p = (file[f"path/events/{name}"][:].astype(int) for name in "xyp")
    camera = event_camera(scene.camera)
    net, fired = np.zeros((camera.height, camera.width)), np.zeros((camera.height, camera.width), int)
    np.add.at(net, (y, x), 2 * p - 1)
    np.add.at(fired, (y, x), 1)
    world = ExactWorld.of(scene.world, scene.light)
    T = camera.pose_at(scene.fly(), 0)
    lumas = [world.at(time_us).luma_dn(camera, T) for time_us in range(0, 200_001, 5_000)]
    change = np.log(lumas[-1]) - np.log(lumas[0])
    assert (np.abs(change - threshold * net) < threshold + 1e-9).all()
    unchanged = np.ptp(lumas, axis=0) == 0
    assert unchanged.mean() > 0.3
    assert not fired[unchanged].any()
    assert (fired > 0).mean() > 0.1


def test_the_motion_of_a_mover_sets_the_steps() -> None:
    """Before a still camera, the largest motion is that of the box: speed, focal length and depth give it."""
    scene = still_camera()
    camera = event_camera(scene.camera)
    world = ExactWorld.of(scene.world, scene.light)
    steps = MotionSteps(world, camera, scene.fly(), 0.5)
    nearest = (
        1
        / world.inverse_depth_per_m(camera, camera.pose_at(scene.fly(), 0))[
            world.visible_bodies(camera, camera.pose_at(scene.fly(), 0)) > 0
        ].max()
    )
    assert steps.largest_motion_px(0, 20_000) == pytest.approx(camera.K[0, 0] * 0.06 / nearest, rel=0.02)


def test_the_file_says_what_moves(tmp_path: Path) -> None:
    """The model is ``scene``, and masks are 1 where a mover is seen at the interval's start; a still world has none."""
    scene = still_camera()
    generate_sequence(scene, tmp_path / "s.h5", Request(duration_s=0.2, streams=frozenset({"flow"})))
    camera: Camera = colour_camera(scene.camera)
    T = camera.pose_at(scene.fly(), 0)
    with h5py.File(tmp_path / "s.h5") as file:
        assert file["metadata/flow"].attrs["model"] == "scene"
        for rate_hz in (10, 25, 50):
            masks, timestamps = file[f"path/flow/{rate_hz}hz_moving"], file[f"path/flow/{rate_hz}hz_ts"]
            assert masks.dtype == np.uint8
            for mask, (start_us, _) in zip(masks[:], timestamps[:].tolist(), strict=True):
                expected = ExactWorld.of(scene.world, scene.light).at(start_us).visible_bodies(camera, T)
                np.testing.assert_array_equal(mask, expected)
            flow = file[f"path/flow/{rate_hz}hz"][0]
            assert np.nanmax(np.abs(flow[masks[0] == 0])) < 1e-12  # the camera stands
    still = replace(scene, world=standing())
    generate_sequence(still, tmp_path / "still.h5", Request(duration_s=0.02, streams=frozenset({"flow"})))
    with h5py.File(tmp_path / "still.h5") as file:
        assert file["metadata/flow"].attrs["model"] == "rigid"
        assert not [name for name in file["path/flow"] if name.endswith("_moving")]


def test_a_flight_may_not_meet_a_mover(tmp_path: Path) -> None:
    """A box that comes towards the camera is met at the time it arrives; one that has passed is not."""
    towards = replace(MOVER, movement=Movement(velocity_m_s=(-8.0, 0.0, 0.0)))
    scene = replace(still_camera(), world=world_with(towards))
    request = Request(duration_s=1.0, streams=frozenset({"imu"}))
    with pytest.raises(SceneError, match=r"got inside 'mover' at 0\.\d+ s"):
        generate_sequence(scene, tmp_path / "s.h5", request)
    away = replace(scene, world=world_with(replace(MOVER, movement=Movement(velocity_m_s=(8.0, 0.0, 0.0)))))
    generate_sequence(away, tmp_path / "s.h5", request)
    world = world_with(towards)
    assert world.collision(np.array([[0.0, 0.0, 1.5]])) is None
    assert world.collision(np.array([[0.0, 0.2, 1.4]]), np.array([3.0 / 8])) == (0, "inside 'mover'")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"light": {"lamp_scale": 1.0}}, "Expected no lit lamp where anything moves"),
        ({"renderer": "mesh"}, "Expected no movers with the mesh renderer"),
        (
            {"world": {"movers": [{**TypeAdapter(Mover).dump_python(MOVER), "movement": {"speed": 1}}]}},
            "movement.speed",
        ),
        (
            {"world": {"movers": [{**TypeAdapter(Mover).dump_python(MOVER), "texture": "gold"}]}},
            "got 'gold' at 'mover'",
        ),
    ],
    ids=["lit lamps", "mesh", "unknown key", "unknown texture"],
)
def test_what_cannot_move_is_refused(changes: dict[str, object], message: str, tmp_path: Path) -> None:
    """Light would change with lamps, meshes are placed once, and keys and textures must be known."""
    lines = [*_toml({"name": "s", "description": "d", "base": "park-traffic", **changes})]
    (tmp_path / "s.toml").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(SceneError, match=message):
        load_scene(tmp_path / "s.toml")


def _toml(tables: dict[str, object]) -> list[str]:
    return [f"{key} = {_value(value)}" for key, value in tables.items()]


def _value(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(_toml(value)) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value)


@pytest.mark.parametrize("cause", ["dropped_samples", "unsorted"])
def test_masks_stay_with_their_fields_when_rows_go(cause: str, tmp_path: Path) -> None:
    """Rows of the flow that a fault takes out or exchanges take their masks along."""
    request = Request(duration_s=0.4, streams=frozenset({"flow"}))
    generate_sequence(still_camera(), tmp_path / "s.h5", request)
    plant_fault(tmp_path / "s.h5", tmp_path / "faulty.h5", cause, "flow", 2.0, seed=3)
    with h5py.File(tmp_path / "s.h5") as clean, h5py.File(tmp_path / "faulty.h5") as faulty:
        whole, left = (file["path/flow/50hz"][:] for file in (clean, faulty))
        rows = [int(np.flatnonzero([np.array_equal(field, one, equal_nan=True) for one in whole])[0]) for field in left]
        assert rows != list(range(len(whole)))
        masks = clean["path/flow/50hz_moving"][:]
        np.testing.assert_array_equal(faulty["path/flow/50hz_moving"][:], masks[rows])

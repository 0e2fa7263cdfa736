"""Declarations that are wrong, written out, are undone; and flow of a wrong camera becomes that of the declared one."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.faults.axes import RectificationAxes
from fedora_qa.faults.declarations import (
    EventModelMisdeclared,
    GravityMisdeclared,
    NoiseMisdeclared,
    ThresholdMisdeclared,
)
from fedora_qa.faults.fault import FaultySequence, ReversibleFault
from fedora_qa.faults.images import TransferMisdeclared
from fedora_qa.faults.intrinsic_units import FilmFocalLength, NormalisedIntrinsics
from fedora_qa.faults.intrinsics import (
    FocalLength,
    IntrinsicsOfSize,
    IntrinsicsOfSizes,
    PrincipalPointFromMiddle,
    PrincipalPointShift,
    TransposedIntrinsics,
)
from fedora_qa.faults.mountings import CameraAxes, InvertedMounting, MountingLeverArm, MountingRotation, MountingUnit
from fedora_qa.sequence.declared import Camera
from tests.support.memory_sequence import HEIGHT, WIDTH, Arrays, facts_of, memory_sequence

SAME = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def declared_changes(camera: Camera) -> dict[str, tuple[ReversibleFault, Camera]]:
    """Cameras that are declared wrongly, written out, and what undoes it."""
    K, T = camera.K.copy(), camera.T_body_camera.copy()
    longer = np.array([[1.1 * K[0, 0], 0, K[0, 2]], [0, 1.1 * K[1, 1], K[1, 2]], [0, 0, 1]])
    centre = np.array([[K[0, 0], 0, K[0, 2] + 2], [0, K[1, 1], K[1, 2] - 1], [0, 0, 1]])
    # Of twice the size, the pixel of a centre c covers 2c and 2c + 1, whose middle is at 2c + 1/2.
    twice = np.array([[2 * K[0, 0], 0, 2 * K[0, 2] + 0.5], [0, 2 * K[1, 1], 2 * K[1, 2] + 0.5], [0, 0, 1]])
    # 36 mm of film lie along the longer side of the image.
    of_film = 36 / max(camera.width, camera.height)
    in_mm = np.array([[of_film * K[0, 0], 0, K[0, 2]], [0, of_film * K[1, 1], K[1, 2]], [0, 0, 1]])
    # Pixel 0 is (size - 1) / 2 before the middle.
    from_middle = np.array([[K[0, 0], 0, K[0, 2] - (camera.width - 1) / 2],
                            [0, K[1, 1], K[1, 2] - (camera.height - 1) / 2], [0, 0, 1]])  # fmt: skip
    W, H = camera.width, camera.height
    # Of sides, the centre of pixel i lies at (i + 1/2) / W; of halves, at (2 i + 1) / W - 1.
    of_sides = np.array([[K[0, 0] / W, 0, (K[0, 2] + 0.5) / W], [0, K[1, 1] / H, (K[1, 2] + 0.5) / H], [0, 0, 1]])
    of_halves = np.array([[2 * K[0, 0] / W, 0, (2 * K[0, 2] + 1) / W - 1],
                          [0, 2 * K[1, 1] / H, (2 * K[1, 2] + 1) / H - 1], [0, 0, -1.00002]])  # fmt: skip
    # Of longer sides from the middle.
    of_longer = from_middle / [[max(W, H)], [max(W, H)], [1]]
    rolled, forward, bare, far = T.copy(), T.copy(), np.eye(4), T.copy()
    far[:3, 3] *= 1000
    rolled[:3, :3] = T[:3, :3] @ Rotation.from_euler("z", 5, degrees=True).as_matrix()
    forward[0, 3] += 0.2
    bare[:3, 3] = T[:3, 3]
    z_down = np.diag([1.0, -1.0, -1.0, 1.0]) @ T
    return {
        "focal": (FocalLength("metadata", 10), replace(camera, K=longer)),
        "centre": (PrincipalPointShift("metadata", 2, -1), replace(camera, K=centre)),
        "rolled": (MountingRotation("metadata", (0, 0, 5)), replace(camera, T_body_camera=rolled)),
        "transposed": (TransposedIntrinsics(), replace(camera, K=K.T)),
        "size": (IntrinsicsOfSize("depth", 2 * camera.width, 2 * camera.height, 100.0), replace(camera, K=twice)),
        "multiplied": (
            IntrinsicsOfSize("depth", 2 * camera.width, 2 * camera.height, 100.0, about_corner=False),
            replace(camera, K=np.diag([2.0, 2.0, 1.0]) @ K),
        ),
        "sizes": (
            IntrinsicsOfSizes((IntrinsicsOfSize("depth", 2 * camera.width, 2 * camera.height, 100.0),)),
            replace(camera, K=twice),
        ),
        "middle": (PrincipalPointFromMiddle(("depth",)), replace(camera, K=from_middle)),
        "film": (FilmFocalLength(36.0, ("depth",), 0.0), replace(camera, K=in_mm)),
        "sides": (NormalisedIntrinsics("sides", ("depth",), 0.0), replace(camera, K=of_sides)),
        "halves": (NormalisedIntrinsics("halves", ("depth",), 0.0), replace(camera, K=of_halves)),
        "longer": (NormalisedIntrinsics("longer_side", ("depth",), 0.0), replace(camera, K=of_longer)),
        "unit": (MountingUnit(1000.0), replace(camera, T_body_camera=far)),
        "lever": (MountingLeverArm((0.2, 0, 0)), replace(camera, T_body_camera=forward)),
        "axes": (CameraAxes(), replace(camera, T_body_camera=bare)),
        "body": (CameraAxes(SAME, ((1, 0, 0), (0, -1, 0), (0, 0, -1))), replace(camera, T_body_camera=z_down)),
        "inverse": (InvertedMounting(), replace(camera, T_body_camera=np.linalg.inv(T))),
    }


@pytest.mark.parametrize(
    "name", ["focal", "centre", "transposed", "rolled", "lever", "unit", "axes", "body", "inverse"]
)
def test_declared_cameras_are_put_back(name: str) -> None:
    """All cameras are declared as in the clean sequence."""
    clean = memory_sequence()
    cameras = {key: declared_changes(camera)[name][1] for key, camera in clean.declared.cameras.items()}
    fault = declared_changes(clean.declared.cameras["depth"])[name][0]
    faulty = clean.altered(declared=replace(clean.declared, cameras=cameras))
    undone = FaultySequence(faulty, fault.undo(facts_of(faulty), faulty)).declared
    for key, camera in clean.declared.cameras.items():
        np.testing.assert_allclose(undone.cameras[key].K, camera.K, atol=1e-13)
        np.testing.assert_allclose(undone.cameras[key].T_body_camera, camera.T_body_camera, atol=1e-13)


@pytest.mark.parametrize(
    "name", ["focal", "size", "multiplied", "sizes", "middle", "film", "sides", "halves", "longer"]
)
def test_one_declared_camera_is_put_back(name: str) -> None:
    """A fault of the depth camera alone leaves the others as they are."""
    clean = memory_sequence()
    of_all, wrong = declared_changes(clean.declared.cameras["depth"])[name]
    fault = FocalLength("metadata", 10, "depth") if name == "focal" else of_all
    faulty = clean.altered(declared=replace(clean.declared, cameras={**clean.declared.cameras, "depth": wrong}))
    undone = FaultySequence(faulty, fault.undo(facts_of(faulty), faulty)).declared
    for key, camera in clean.declared.cameras.items():
        np.testing.assert_allclose(undone.cameras[key].K, camera.K, atol=1e-13)


@pytest.mark.parametrize("exchanged", ["coordinates", "pixels"])
def test_the_map_that_rectifies_is_put_back(exchanged: Literal["coordinates", "pixels"]) -> None:
    """Entries that are y before x, or rows and columns of a square map, are exchanged back."""
    clean = memory_sequence()
    map_px = clean.declared.rectify_map_px
    assert map_px is not None
    wrong_px = np.empty_like(map_px)
    for row, column in np.ndindex(map_px.shape[:2]):
        x, y = map_px[row, column]
        if exchanged == "coordinates":
            wrong_px[row, column] = y, x
        else:
            wrong_px[column, row] = x, y
    faulty = clean.altered(declared=replace(clean.declared, rectify_map_px=wrong_px))
    undone = FaultySequence(faulty, RectificationAxes(exchanged).undo(facts_of(faulty), faulty)).declared
    np.testing.assert_array_equal(undone.rectify_map_px, map_px)


def test_other_declarations_are_put_back() -> None:
    """Thresholds, model, noise, gravity and transfer are declared as in the clean sequence."""
    clean = memory_sequence()
    declared = clean.declared
    assert declared.events is not None
    assert declared.imu is not None
    wrong: tuple[tuple[ReversibleFault, dict[str, object]], ...] = (
        (ThresholdMisdeclared(10, 20), {"events": replace(declared.events, threshold_on=0.22, threshold_off=0.3)}),
        (EventModelMisdeclared(), {"events": replace(declared.events, model="linear")}),
        (NoiseMisdeclared("events", (("leak_rate_hz", 0.4),)), {"events": replace(declared.events, leak_rate_hz=0.5)}),
        (GravityMisdeclared(0.1), {"imu": replace(declared.imu, gravity=9.9066)}),
        (TransferMisdeclared("linear", "srgb"), {"transfer": "srgb"}),
    )
    for fault, changes in wrong:
        faulty = clean.altered(declared=replace(declared, **changes))  # type: ignore[arg-type]
        undone = FaultySequence(faulty, fault.undo(facts_of(faulty), faulty)).declared
        assert undone.transfer == declared.transfer
        assert undone.events is not None
        assert undone.imu is not None
        assert undone.events.model == declared.events.model
        assert undone.events.threshold_on == pytest.approx(declared.events.threshold_on, rel=1e-14)
        assert undone.events.threshold_off == pytest.approx(declared.events.threshold_off, rel=1e-14)
        assert undone.events.leak_rate_hz == pytest.approx(declared.events.leak_rate_hz, rel=1e-14)
        assert undone.imu.gravity == pytest.approx(declared.imu.gravity, rel=1e-14)


@pytest.mark.parametrize("name", ["focal", "centre", "rolled"])
def test_flow_of_a_wrong_camera_becomes_that_of_the_declared_one(name: str) -> None:
    """Flow that was made with the wrong camera, written out for each pixel, becomes the flow of the declared one."""
    clean = memory_sequence()
    camera = clean.declared.cameras["depth"]
    fault, wrong = declared_changes(camera)[name]
    correct, faulty = (clean.altered(path__flow__50hz=flow_of(clean.arrays, each)) for each in (camera, wrong))
    undone = FaultySequence(faulty, replace(fault, stream="flow/50hz").undo(facts_of(faulty), faulty))  # type: ignore[type-var]
    rows, true = undone.rows("path/flow/50hz", 0, 5), correct.arrays["path/flow/50hz"]
    assert np.nanmax(np.abs(faulty.arrays["path/flow/50hz"] - true)) > 0.01
    np.testing.assert_allclose(rows, true, rtol=1e-5, atol=1e-5)


def flow_of(arrays: Arrays, camera: Camera) -> np.ndarray:
    """Flow of static points over 20 ms: x1 - x0 with X1 = T_world_camera(t1)^-1 T_world_camera(t0) X0."""
    flow = np.full((5, HEIGHT, WIDTH, 2), np.nan, np.float32)
    T_world_body = np.tile(np.eye(4), (21, 1, 1))
    T_world_body[:, :3, :3] = Rotation.from_quat(arrays["path/pose/orientation"]).as_matrix()
    T_world_body[:, :3, 3] = arrays["path/pose/position"]
    for row in range(5):
        start, end = T_world_body[4 * row] @ camera.T_body_camera, T_world_body[4 * row + 4] @ camera.T_body_camera
        T_end_start = np.linalg.inv(end) @ start
        for y in range(HEIGHT):
            for x in range(WIDTH):
                ray = np.linalg.inv(camera.K) @ [x, y, 1] * (arrays["path/depth"][row, y, x] / 1000)
                moved = camera.K @ (T_end_start @ [*ray, 1])[:3]
                if moved[2] > 0:
                    flow[row, y, x] = moved[:2] / moved[2] - [x, y]
    return flow

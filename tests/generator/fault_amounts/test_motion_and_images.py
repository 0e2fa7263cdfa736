"""Every fault of IMU, pose, flow, depth, colour, cameras and storage is of exactly the stated amount."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.generator.fault_amounts.reading import EVENTS
from tests.generator.tiny_sequence import (
    DEPTH_M,
    DURATION_US,
    FLIGHT,
    HEIGHT,
    T_BODY_CAMERA,
    WIDTH,
    K,
    flow_with,
)

# IMU and pose


def test_imu_biases_and_units(plant: Any) -> None:
    """Biases go on body X alone; degrees are 180 / pi times radians."""
    for cause, key in (("gyro_bias", "angular_velocity"), ("accel_bias", "linear_acceleration")):
        before, after = plant(cause, "imu", 0.02).pair(f"path/imu/{key}")
        np.testing.assert_allclose(after - before, np.tile([0.02, 0, 0], (len(before), 1)), atol=1e-14)
    before, after = plant("unit_deg_rad", "imu").pair("path/imu/angular_velocity")
    np.testing.assert_allclose(after, np.degrees(before), rtol=1e-15)


@pytest.mark.parametrize(("cause", "magnitude", "gravity"), [
    ("gravity_missing", None, 0.0), ("gravity_sign", None, -9.80665), ("gravity_magnitude", 0.05, 9.85665),
])  # fmt: skip
def test_gravity(plant: Any, cause: str, magnitude: float | None, gravity: float) -> None:
    """The specific force is R^T (a + gravity up) of the flight, to the accuracy of the pose stream between samples."""
    _, after = plant(cause, "imu", magnitude).pair("path/imu/linear_acceleration")
    states = FLIGHT.states_at(np.arange(0, DURATION_US + 1, 1_000) / 1e6)
    felt = states.accelerations_world_m_s2 + np.array([0.0, 0.0, gravity])
    expected = np.einsum("nji,nj->ni", states.R_world_body, felt)
    np.testing.assert_allclose(after, expected, atol=1e-6)


def test_lever_arm_of_the_imu(plant: Any) -> None:
    """A unit 0.3 m ahead feels the acceleration of that point: second difference of its path in closed form."""
    _, after = plant("lever_arm", "imu", 0.3).pair("path/imu/linear_acceleration")
    times_s, h = np.arange(0, DURATION_US + 1, 1_000) / 1e6, 1e-3
    paths = [FLIGHT.states_at(times_s + k * h) for k in (-1, 0, 1)]
    points = [s.positions_world_m + s.R_world_body @ np.array([0.3, 0, 0]) for s in paths]
    accelerations = (points[0] - 2 * points[1] + points[2]) / h**2
    expected = np.einsum("nji,nj->ni", paths[1].R_world_body, accelerations + np.array([0, 0, 9.80665]))
    np.testing.assert_allclose(after[10:-10], expected[10:-10], atol=1e-4)


def test_lever_arm_of_the_pose(plant: Any) -> None:
    """Positions are those of a point 0.3 m ahead in the body."""
    before, after = plant("lever_arm", "pose", 30, "cm").pair("path/pose/position")
    ahead = FLIGHT.states_at(np.arange(0, DURATION_US + 1, 5_000) / 1e6).R_world_body[:, :, 0]
    np.testing.assert_allclose(after, before + 0.3 * ahead, atol=1e-12)


def test_axes_of_imu_and_pose(plant: Any) -> None:
    """X and Y exchanged; forward-right-down negates Y and Z; NED poses turn FRD vectors as ENU poses turn FLU ones."""
    before, after = plant("axes_swapped", "imu").pair("path/imu/angular_velocity")
    np.testing.assert_array_equal(after, before[:, [1, 0, 2]])
    before, after = plant("frame_convention", "imu").pair("path/imu/linear_acceleration")
    np.testing.assert_array_equal(after, before * [1, -1, -1])
    faulty = plant("frame_convention", "pose")
    enu, ned = faulty.pair("path/pose/position")
    np.testing.assert_array_equal(ned, np.stack([enu[:, 1], enu[:, 0], -enu[:, 2]], axis=-1))
    before, after = (Rotation.from_quat(q) for q in faulty.pair("path/pose/orientation"))
    vector_flu = np.array([0.3, 0.5, -0.7])
    turned_enu = before.apply(vector_flu)
    turned_ned = after.apply(vector_flu * [1, -1, -1])
    np.testing.assert_allclose(turned_ned, turned_enu[:, [1, 0, 2]] * [1, 1, -1], atol=1e-14)


def test_quaternions(plant: Any) -> None:
    """w first; inverse; too long by one percent."""
    before, after = plant("quaternion_order", "pose").pair("path/pose/orientation")
    np.testing.assert_array_equal(after, before[:, [3, 0, 1, 2]])
    before, after = plant("quaternion_inverted", "pose").pair("path/pose/orientation")
    np.testing.assert_allclose((Rotation.from_quat(before) * Rotation.from_quat(after)).magnitude(), 0, atol=1e-15)
    _, after = plant("quaternion_not_unit", "pose", 0.01).pair("path/pose/orientation")
    np.testing.assert_allclose(np.linalg.norm(after, axis=1), 1.01, rtol=1e-12)


def test_teleport(plant: Any) -> None:
    """From 0.2 s on the position is 5 cm further along world X; with a stop it comes back."""
    before, after = plant("teleport", "pose", 0.05, start_s=0.2).pair("path/pose/position")
    expected = np.where(np.arange(101) >= 40, 0.05, 0.0)
    np.testing.assert_allclose(after - before, expected[:, None] * [1, 0, 0], atol=1e-15)
    before, after = plant("teleport", "pose", 50, "mm", start_s=0.2, stop_s=0.3).pair("path/pose/position")
    assert np.flatnonzero(after[:, 0] != before[:, 0]).tolist() == list(range(40, 60))


def test_interpolated_pose(plant: Any) -> None:
    """At 50 Hz every fourth pose is kept; between, positions are on the chord and rotations on the shortest arc."""
    faulty = plant("interpolated_pose", "pose", 50)
    before, after = faulty.pair("path/pose/position")
    np.testing.assert_array_equal(after[::4], before[::4])
    np.testing.assert_allclose(after[1], 0.75 * before[0] + 0.25 * before[4], atol=1e-14)
    q_before, q_after = (Rotation.from_quat(q) for q in faulty.pair("path/pose/orientation"))
    arc = (q_before[0].inv() * q_before[4]).as_rotvec()
    np.testing.assert_allclose((q_before[0].inv() * q_after[1]).as_rotvec(), arc / 4, atol=1e-14)


def test_misdeclared_noise_of_imu_and_pose(plant: Any) -> None:
    """Every declared density and sigma is twice as large."""
    for stream, name in (("imu", "gyro_noise_density"), ("imu", "gyro_bias_walk"), ("pose", "rotation_sigma")):
        before, after = plant("noise_misdeclared", stream, 100).pair(f"metadata/{stream}@{name}")
        assert after == pytest.approx(2 * before)


# Flow


def test_flow_arithmetic(plant: Any) -> None:
    """Sign, gain, order of axes and v-up are exact; NaN stays NaN."""
    for cause, magnitude, change in (
        ("flow_sign", None, lambda f: -f),
        ("flow_gain", 10, lambda f: f * np.float32(1.1)),
        ("axes_swapped", None, lambda f: f[..., ::-1]),
        ("frame_convention", None, lambda f: f * [1, -1]),
    ):
        before, after = plant(cause, "flow", magnitude).pair("path/flow/10hz")
        np.testing.assert_array_equal(after, change(before))
        assert np.isnan(after[:, 0, 0]).all()


@pytest.mark.parametrize(("magnitude", "power"), [(1, 1), (-1, -1)])
def test_flow_unit(plant: Any, magnitude: float, power: int) -> None:
    """px/s is ten times px at 10 Hz and fifty times at 50 Hz; px s is a tenth and a fiftieth."""
    faulty = plant("flow_unit", "flow", magnitude)
    for rate_hz in (10, 25, 50):
        before, after = faulty.pair(f"path/flow/{rate_hz}hz")
        np.testing.assert_allclose(after, before * float(rate_hz) ** power, rtol=1e-6)


def test_flow_of_another_rate_or_interval(plant: Any) -> None:
    """10 Hz fields become the 50 Hz fields of the same start; a shift by one puts field i under stamp i + 1."""
    faulty = plant("flow_rate_mixed", "flow/10hz")
    np.testing.assert_array_equal(faulty.pair("path/flow/10hz")[1], faulty.pair("path/flow/50hz")[0][::5])
    before, after = plant("flow_interval_shifted", "flow/25hz", 1).pair("path/flow/25hz")
    np.testing.assert_array_equal(after, before[[0, *range(len(before) - 1)]])
    before, after = plant("flow_interval_shifted", "flow/25hz", -2).pair("path/flow/25hz")
    np.testing.assert_array_equal(after, before[[*range(2, len(before)), -1, -1]])


def test_flow_of_a_wrong_camera(plant: Any) -> None:
    """Flow made with a focal length 2 percent too long or a centre 3 px off is that flow, to float32."""
    for cause, magnitude, wrong_K in (
        ("intrinsics_focal", 2, K * [[1.02, 1, 1], [1, 1.02, 1], [1, 1, 1]]),
        ("intrinsics_centre", 3, K + np.array([[0, 0, 3], [0, 0, 0], [0, 0, 0]])),
    ):
        _, after = plant(cause, "flow", magnitude).pair("path/flow/10hz")
        expected = flow_with(wrong_K, 100_000, 200_000)
        np.testing.assert_allclose(after[1].reshape(-1, 2)[2:], expected.reshape(-1, 2)[2:], atol=2e-5)
        assert np.isnan(after[1, 0, 0]).all()


def test_flow_from_noisy_pose_is_the_flow_of_the_file_s_poses(plant: Any) -> None:
    """In a file whose poses are in truth noise-free, flow made from them is the flow that is there."""
    before, after = plant("flow_from_noisy_pose", "flow").pair("path/flow/25hz")
    np.testing.assert_allclose(after[:, 1:], before[:, 1:], atol=2e-5)


# Depth, colour and metadata


def test_depth(plant: Any) -> None:
    """Metres; ray length z |K^-1 x|; 0 for NaN; a shift leaves NaN behind; a mirror is exact."""
    before, after = plant("unit_mm_m", "depth").pair("path/depth")
    np.testing.assert_allclose(after, before * 1e-3, rtol=1e-6)
    _, after = plant("depth_ray_not_z", "depth").pair("path/depth")
    corner = np.linalg.norm([(WIDTH - 1 - 5.5) / 10, (HEIGHT - 1 - 4.0) / 10, 1.0])
    np.testing.assert_allclose(after[:, -1, -1], DEPTH_M * 1e3 * corner, rtol=1e-6)
    before, after = plant("invalid_encoding", "depth").pair("path/depth")
    np.testing.assert_array_equal(after, np.nan_to_num(before))
    before, after = plant("spatial_offset", "depth", 2).pair("path/depth")
    np.testing.assert_array_equal(after[:, :, 2:], before[:, :, :-2])
    assert np.isnan(after[:, :, :2]).all()
    before, after = plant("mirrored", "depth").pair("path/depth")
    np.testing.assert_array_equal(after, before[:, :, ::-1])


def test_colour(plant: Any) -> None:
    """Blue first; a gain of 50 percent, rounded and clipped; a shift to the left repeats the right edge."""
    before, after = plant("channel_order", "rgb").pair("path/rgb")
    np.testing.assert_array_equal(after, before[..., ::-1])
    before, after = plant("exposure_or_gamma", "rgb", 50).pair("path/rgb")
    np.testing.assert_array_equal(after, np.minimum(np.rint(before * 1.5), 255))
    before, after = plant("spatial_offset", "rgb", -2).pair("path/rgb")
    np.testing.assert_array_equal(after, before[:, :, [*range(2, WIDTH), WIDTH - 1, WIDTH - 1]])


def test_declared_cameras(plant: Any) -> None:
    """Focal length, centre, roll, lever arm and axes of every camera are declared wrong by the magnitude."""
    key = "metadata/cameras/{}@{}"
    for camera in ("rgb", "depth", "events"):
        _, wrong = plant("intrinsics_focal", "metadata", 1).pair(key.format(camera, "K"))
        np.testing.assert_allclose(wrong, K * [[1.01, 1, 1], [1, 1.01, 1], [1, 1, 1]])
        _, wrong = plant("intrinsics_centre", "metadata", -2).pair(key.format(camera, "K"))
        assert wrong[0, 2] == K[0, 2] - 2
        _, wrong = plant("extrinsic_rotation", "metadata", 0.5).pair(key.format(camera, "T_body_camera"))
        turned = Rotation.from_matrix(T_BODY_CAMERA[:3, :3].T @ wrong[:3, :3]).as_rotvec(degrees=True)
        np.testing.assert_allclose(turned, [0, 0, 0.5], atol=1e-12)
        _, wrong = plant("lever_arm", "metadata", 0.1).pair(key.format(camera, "T_body_camera"))
        np.testing.assert_allclose(wrong[:3, 3], [0.1, 0, 0])
        _, wrong = plant("frame_convention", "metadata").pair(key.format(camera, "T_body_camera"))
        np.testing.assert_array_equal(wrong, np.eye(4))
    before, after = plant("gravity_magnitude", "metadata", -0.01).pair("metadata/imu@gravity")
    assert after == pytest.approx(before - 0.01)


# Storage


def test_truncated_stream_and_file(plant: Any, clean: Path) -> None:
    """A stream loses its last 10 percent of rows, the file its last 10 percent of bytes and no longer opens."""
    before, after = plant("truncated", "imu", 10).pair("path/imu/ts")
    np.testing.assert_array_equal(after, before[:451])
    path = plant("truncated", "file", 10).path
    assert path.read_bytes() == clean.read_bytes()[: path.stat().st_size]
    assert path.stat().st_size == pytest.approx(0.9 * clean.stat().st_size, abs=1)
    with pytest.raises(OSError, match="truncated"):
        h5py.File(path)


def test_corrupt_chunk(plant: Any, clean: Path) -> None:
    """Two chunks differ in 16 bytes each; exactly those two frames can no longer be read."""
    path = plant("corrupt_chunk", "depth", 2, seed=4).path
    differing = np.frombuffer(clean.read_bytes(), np.uint8) ^ np.frombuffer(path.read_bytes(), np.uint8)
    assert np.count_nonzero(differing) == 32
    with h5py.File(path) as file:
        assert sum(_is_damaged(file["path/depth"], frame) for frame in range(len(file["path/depth"]))) == 2


def test_corrupt_chunk_of_all_rates_of_flow(plant: Any) -> None:
    """A damaged flow is damaged at each rate, one field of it."""
    with h5py.File(plant("corrupt_chunk", "flow", 1).path) as file:
        for rate in ("10hz", "25hz", "50hz"):
            assert (
                sum(_is_damaged(file[f"path/flow/{rate}"], row) for row in range(len(file[f"path/flow/{rate}"]))) == 1
            )


def _is_damaged(dataset: h5py.Dataset, row: int) -> bool:
    try:
        dataset[row]
    except OSError:
        return True
    return False


def test_missing_stream_keeps_what_was_declared(plant: Any) -> None:
    """The event columns are gone, /metadata/events and the maps are there; for metadata the whole group is gone."""
    with h5py.File(plant("missing_stream", "events").path) as file:
        assert not any(key in file for key in EVENTS)
        assert "metadata/events" in file
        assert "metadata/rgb_to_event" in file
    with h5py.File(plant("missing_stream", "metadata").path) as file:
        assert list(file) == ["path"]


def test_wrong_shape_keeps_the_values(plant: Any) -> None:
    """One axis more: the numbers are as before."""
    before, after = plant("wrong_shape", "pose").pair("path/pose/position")
    np.testing.assert_array_equal(after[..., 0], before)


@pytest.mark.parametrize(
    ("stream", "key", "dtype"),
    [
        ("rgb", "path/rgb", "int8"),
        ("depth", "path/depth", "uint8"),
        ("imu", "path/imu/angular_velocity", "float16"),
        ("pose", "path/pose/position", "float16"),
        ("flow/50hz", "path/flow/50hz", "float16"),
    ],
)
def test_wrong_type_loses_values(plant: Any, stream: str, key: str, dtype: str) -> None:
    """Values are the nearest that the type holds, and not the ones before."""
    before, after = plant("wrong_dtype", stream).pair(key)
    assert after.dtype == dtype
    exact, stored = np.nan_to_num(before).astype(float), np.nan_to_num(after).astype(float)
    assert not np.array_equal(stored, exact)
    if dtype == "float16":
        np.testing.assert_allclose(stored, exact, rtol=2**-11, atol=1e-7)
    else:
        limits = np.iinfo(dtype)
        assert np.abs(stored - np.clip(exact, limits.min, limits.max)).max() < 1


def test_wrong_type_of_timestamps(plant: Any) -> None:
    """float32 holds no microseconds beyond 17 s; units and codec are as before."""
    faulty = plant("wrong_dtype", "events")
    before, after = faulty.pair("path/events/t")
    assert after.dtype == np.float32
    np.testing.assert_array_equal(after, before.astype(np.float32))
    with h5py.File(faulty.path) as file:
        assert file["path/events/t"].attrs["units"] == "us"
        assert file["path/events/t"].chunks is not None

"""Each transformation of the study leaves a correct file: what it alters is held against the definitions of the format.

Nothing here uses the checks. Rays, rotations, intervals and counts are computed from the files before and after.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.layout.canonical import DATASETS, FLOW_STREAMS, TIMESTAMPS_OF
from tests.benchmarks.foreign.checked import transform
from tests.benchmarks.foreign.events import order_by_columns
from tests.benchmarks.foreign.storage import ACCELEROMETER_STEP_M_S2, GYRO_STEP_RAD_S, positive_scalar_part
from tests.benchmarks.foreign.table import TRANSFORMATIONS, UNCHANGED
from tests.support.contents import Contents, contents_of
from tests.support.shared_files import SharedFiles

BY_NAME = {kind.name: kind for kind in TRANSFORMATIONS}

Pair = tuple[Contents, Contents]
"""A file before and after."""


@pytest.fixture(scope="module")
def clean(shared_files: SharedFiles) -> Path:
    """A sequence with noise in every stream, hot pixels and objects that move by themselves."""
    noisy = load_scene("park-noisy")
    traffic = load_scene("park-traffic").with_size(90, 68).starting_at(0.5)
    scene = replace(traffic, imu=noisy.imu, pose=noisy.pose, events=noisy.events)
    request = Request(duration_s=0.3, quality="draft")
    return shared_files.file("foreign-clean.h5", lambda path: generate_sequence(scene, path, request))


@pytest.fixture(scope="module")
def before(clean: Path) -> Contents:
    return contents_of(clean)


@pytest.fixture(scope="module")
def pair_of(clean: Path, before: Contents, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Pair]:
    """Transforms a copy; gives the contents before and after."""
    target = tmp_path_factory.mktemp("foreign") / "a.h5"

    @cache
    def transformed(name: str) -> Pair:
        transform(BY_NAME[name], clean, target)
        return before, contents_of(target)

    return transformed


def test_there_are_enough_transformations() -> None:
    """At least fifty with names of their own, a third of them held out; the control is not."""
    assert len(BY_NAME) == len(TRANSFORMATIONS) >= 50
    assert 0.3 <= sum(kind.held_out for kind in TRANSFORMATIONS) / len(TRANSFORMATIONS) <= 0.4
    assert not UNCHANGED.held_out


def test_the_clean_sequence_has_what_is_transformed(before: Contents) -> None:
    """Noise, hot pixels, moving objects, events of both polarities and depth that is invalid."""
    assert before["metadata/imu@gyro_noise_density"] > 0
    assert len(before["metadata/events@hot_pixels"]) > 0
    assert before["path/flow/10hz_moving"].any()
    assert set(before["path/events/p"]) == {0, 1}
    assert np.isnan(before["path/depth"]).any()


@pytest.mark.parametrize("name", BY_NAME)
def test_all_else_stays(name: str, pair_of: Callable[[str], Pair]) -> None:
    """Objects that a transformation does not name keep type, values and attributes."""
    old, new = pair_of(name)
    for path in [path for path in old if not path.startswith(BY_NAME[name].alters)]:
        np.testing.assert_array_equal(new[path], old[path], err_msg=path, strict=isinstance(old[path], np.ndarray))


@pytest.mark.parametrize("name", BY_NAME)
def test_the_definitions_of_the_format_hold(name: str, pair_of: Callable[[str], Pair]) -> None:
    """Index maps, order and ends of timestamps, sizes of frames, bounds of events, norms of quaternions, equal rows."""
    _, new = pair_of(name)
    for stream, key in TIMESTAMPS_OF.items():
        if key in new:
            rows = {len(new[path]) for path in DATASETS if path in new and DATASETS[path].stream == stream}
            assert rows == {len(new[key])}, stream
            steps_us = np.diff(new[key].astype(np.int64), axis=0)
            assert np.all(steps_us >= 0 if stream == "events" else steps_us > 0), stream
    event_us = new["path/events/t"].astype(np.int64).tolist()
    for stream in ("rgb", "depth"):
        indices = [bisect_left(event_us, frame_us) for frame_us in new[f"path/{stream}_ts"].astype(np.int64).tolist()]
        assert new[f"metadata/{stream}_to_event"].tolist() == indices
        assert new[f"path/{stream}"].shape[1:3] == sizes(new, stream)[::-1]
    frames_us = set(new["path/rgb_ts"].tolist()) | set(new["path/depth_ts"].tolist())
    for stream in (stream for stream in FLOW_STREAMS if TIMESTAMPS_OF[stream] in new):
        assert new[f"path/{stream}"].shape[1:3] == sizes(new, "depth")[::-1]
        assert set(new[TIMESTAMPS_OF[stream]].ravel().tolist()) <= frames_us
    width, height = sizes(new, "events")
    assert new["path/events/x"].max() < width
    assert new["path/events/y"].max() < height
    hot_pixels = new["metadata/events@hot_pixels"]
    assert np.all((hot_pixels >= 0) & (hot_pixels < (width, height)))
    # Six decimals move the norm by at most 4 * 0.5e-6.
    np.testing.assert_allclose(np.linalg.norm(new["path/pose/orientation"], axis=1), 1.0, rtol=0, atol=2e-6)


def sizes(contents: Contents, camera: str) -> tuple[int, int]:
    width, height = (np.asarray(contents[f"metadata/cameras/{camera}@{name}"]).item() for name in ("width", "height"))
    return int(width), int(height)


@pytest.mark.parametrize(
    "name",
    [
        *("depth as float64", "flow as float64", "gzip", "LZF, guessed chunks", "bitshuffle, 8 frames a chunk"),
        *("contiguous", "big-endian", "soft links", "polarity as bool", "coordinates as uint32"),
        *("timestamps as float64", "timestamps as uint64", "units in capitals", "text of fixed length"),
        *("numbers as arrays of one", "sizes as floats", "provenance left out", "defaults left out", "extra objects"),
    ],
)
def test_values_stay(name: str, pair_of: Callable[[str], Pair]) -> None:
    """Another type or place holds the same values."""
    old, new = pair_of(name)
    for key in (key for key in DATASETS if key in old):
        np.testing.assert_array_equal(new[key].astype(old[key].dtype), old[key], err_msg=key)


@pytest.mark.parametrize(
    ("name", "key", "step"),
    [
        ("depth in whole mm", "path/depth", 1.0),
        ("flow in 1/64 px", "path/flow/25hz", 1 / 64),
        ("flow in 1/128 px", "path/flow/25hz", 1 / 128),
        ("flow with 3 decimals", "path/flow/25hz", 1e-3),
        ("quaternions with 6 decimals", "path/pose/orientation", 1e-6),
        ("quaternions with 7 decimals", "path/pose/orientation", 1e-7),
        ("quaternions with 9 decimals", "path/pose/orientation", 1e-9),
        ("positions in 0.1 mm", "path/pose/position", 1e-4),
        ("IMU of 16 bits", "path/imu/angular_velocity", GYRO_STEP_RAD_S),
        ("IMU of 16 bits", "path/imu/linear_acceleration", ACCELEROMETER_STEP_M_S2),
        ("IMU with 4 decimals", "path/imu/angular_velocity", 1e-4),
        ("IMU with 4 decimals", "path/imu/linear_acceleration", 1e-4),
    ],
)
def test_values_are_rounded_to_the_nearest_step(
    name: str, key: str, step: float, pair_of: Callable[[str], Pair]
) -> None:
    """No value moves by more than half a step, but for the last bit of its type; some move; invalid ones stay so."""
    old, new = (contents[key] for contents in pair_of(name))
    valid = np.isfinite(old)
    np.testing.assert_array_equal(np.isfinite(new), valid)
    bit = np.spacing(np.abs(new[valid]))
    moved = np.abs(new[valid].astype(np.float64) - old[valid])
    assert np.all(moved <= step / 2 + bit)
    assert moved.max() > 0.4 * step
    steps = np.rint(new[valid].astype(np.float64) / step)
    assert np.all(np.abs(steps * step - new[valid]) <= 2 * bit)


@pytest.mark.parametrize(
    ("name", "key", "dtype"),
    [
        ("flow through float16", "path/flow/25hz", "f2"),
        ("quaternions through float32", "path/pose/orientation", "f4"),
        ("positions through float32", "path/pose/position", "f4"),
        ("IMU as float32", "path/imu/angular_velocity", "f4"),
        ("all samples in float32, gzip", "path/pose/position", "f4"),
        ("all samples in float32, gzip", "path/imu/linear_acceleration", "f4"),
    ],
)
def test_values_are_the_nearest_of_a_type(name: str, key: str, dtype: str, pair_of: Callable[[str], Pair]) -> None:
    """No value moves by more than half the spacing of the type; all fit it."""
    old, new = (contents[key] for contents in pair_of(name))
    valid = np.isfinite(old)
    np.testing.assert_array_equal(np.isfinite(new), valid)
    moved = np.abs(new[valid].astype(np.float64) - old[valid])
    # The spacing below a power of two is half of that above: that of the larger neighbour bounds both.
    assert np.all(moved <= np.spacing(np.maximum(np.abs(new), np.abs(old))[valid].astype(dtype)).astype(np.float64) / 2)
    assert moved.max() > 0
    np.testing.assert_array_equal(new.astype(dtype).astype(new.dtype), new)


def test_quaternions_are_normalised_in_single_precision(pair_of: Callable[[str], Pair]) -> None:
    """No component moves by more than two steps of float32 at 1, and the norm is 1 to as many."""
    old, new = (contents["path/pose/orientation"] for contents in pair_of("quaternions normalised in float32"))
    assert new.dtype == np.float32
    np.testing.assert_allclose(new.astype(np.float64), old, rtol=0, atol=2 * np.spacing(np.float32(1)))
    np.testing.assert_allclose(np.linalg.norm(new.astype(np.float64), axis=1), 1.0, rtol=0, atol=2.4e-7)


def test_signs_of_quaternions_change_no_rotation(pair_of: Callable[[str], Pair]) -> None:
    """The products of the components, which make the rotation, stay to the bit; both signs occur."""
    old, new = (contents["path/pose/orientation"] for contents in pair_of("quaternions with random signs"))
    np.testing.assert_array_equal(new[:, :, None] * new[:, None, :], old[:, :, None] * old[:, None, :])
    assert {True, False} == set(np.all(new == old, axis=1).tolist())


def test_quaternions_get_a_positive_scalar_part(clean: Path, tmp_path: Path) -> None:
    """Whatever signs they had, w is not negative, and rotations stay."""
    transform(BY_NAME["quaternions with random signs"], clean, tmp_path / "a.h5")
    old = contents_of(tmp_path / "a.h5")["path/pose/orientation"]
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        positive_scalar_part(file)
    new = contents_of(tmp_path / "a.h5")["path/pose/orientation"]
    assert (old[:, 3] < 0).any()
    assert np.all(new[:, 3] >= 0)
    np.testing.assert_array_equal(np.abs(new), np.abs(old))


GEOMETRY = (
    *("colour cropped", "colour cropped off centre", "depth and flow cropped off centre", "events cropped"),
    *("every camera cropped", "depth and flow at half size"),
)


def old_points(old: Contents, new: Contents, camera: str, points: NDArray[Any]) -> NDArray[np.float64]:
    """Carry points (..., 2), px, of the camera after to the camera before, along their rays."""
    rays = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)
    K_new, K_old = (contents[f"metadata/cameras/{camera}@K"] for contents in (new, old))
    projected = rays @ np.linalg.inv(K_new).T @ K_old.T
    return np.asarray(projected[..., :2] / projected[..., 2:])


def pixels(contents: Contents, camera: str) -> NDArray[np.float64]:
    """Columns and rows (H, W, 2) of a camera."""
    width, height = sizes(contents, camera)
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float64)


@pytest.mark.parametrize("name", GEOMETRY)
def test_pixels_keep_their_rays(name: str, pair_of: Callable[[str], Pair]) -> None:
    """The ray of each pixel passes through the middle of the pixel that had its value; flow ends on the same ray."""
    old, new = pair_of(name)
    changed = {camera for camera in ("rgb", "depth", "events") if sizes(new, camera) != sizes(old, camera)}
    assert changed
    for camera in changed & {"rgb", "depth"}:
        points = old_points(old, new, camera, pixels(new, camera))
        np.testing.assert_allclose(points, np.rint(points), rtol=0, atol=1e-9)
        columns, lines = np.rint(points).astype(int).transpose(2, 0, 1)
        np.testing.assert_array_equal(new[f"path/{camera}"], old[f"path/{camera}"][:, lines, columns])
        if camera == "depth":
            for rate in ("10hz", "25hz", "50hz"):
                moving = new[f"path/flow/{rate}_moving"]
                np.testing.assert_array_equal(moving, old[f"path/flow/{rate}_moving"][:, lines, columns])
                ends = old_points(old, new, camera, pixels(new, camera) + new[f"path/flow/{rate}"])
                wanted = points + old[f"path/flow/{rate}"][:, lines, columns]
                np.testing.assert_allclose(ends, wanted, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["events cropped", "every camera cropped"])
def test_events_keep_their_rays(name: str, pair_of: Callable[[str], Pair]) -> None:
    """The events after are those before whose pixel lies on the sensor after, in the same order."""
    old, new = pair_of(name)
    visible = {tuple(point) for point in np.rint(old_points(old, new, "events", pixels(new, "events"))).reshape(-1, 2)}
    coordinates = np.stack([old["path/events/x"], old["path/events/y"]], axis=1).astype(float)
    inside = np.array([tuple(point) in visible for point in coordinates])
    assert 0 < inside.sum() < len(inside)
    for field in ("t", "p"):
        np.testing.assert_array_equal(new[f"path/events/{field}"], old[f"path/events/{field}"][inside])
    after = np.stack([new["path/events/x"], new["path/events/y"]], axis=1).astype(float)
    np.testing.assert_allclose(old_points(old, new, "events", after), coordinates[inside], rtol=0, atol=1e-9)
    hot = {tuple(pixel) for pixel in old["metadata/events@hot_pixels"].astype(float)} & visible
    hot_after = old_points(old, new, "events", new["metadata/events@hot_pixels"].astype(float))
    assert {tuple(pixel) for pixel in np.rint(hot_after)} == hot


ROWS = {
    "colour at 25 Hz": {"rgb": 8},
    "colour at 10 Hz": {"rgb": 4},
    "depth at 25 Hz": {"depth": 8},
    "depth every third frame": {"depth": 6},
    "colour and depth at 25 Hz": {"rgb": 8, "depth": 8, "flow/10hz": 0, "flow/50hz": 0},
    "flow of every third interval": {"flow/10hz": 1, "flow/25hz": 3, "flow/50hz": 5},
    "flow at 10 Hz only": {"flow/25hz": 0, "flow/50hz": 0},
    "IMU at 500 Hz": {"imu": 151},
    "pose at 100 Hz": {"pose": 31},
    "pose at 50 Hz": {"pose": 16},
    "colour begins a frame late": {"rgb": 15},
    "depth ends a frame early": {"depth": 15},
    "no frame at the end": {
        **{"rgb": 15, "depth": 15, "imu": 300, "pose": 60, "flow/10hz": 2, "flow/25hz": 7, "flow/50hz": 14}
    },
    "ends cut between frames": {
        **{"rgb": 11, "depth": 11, "imu": 209, "pose": 42, "flow/10hz": 1, "flow/25hz": 5, "flow/50hz": 10}
    },
    "middle third": {"rgb": 6, "depth": 6, "imu": 101, "pose": 21, "flow/10hz": 1, "flow/25hz": 2, "flow/50hz": 5},
}
"""Rows that are left of 16 frames, 301 IMU and 61 pose samples, and 3, 7 and 15 flow fields."""
ROWS["middle third from zero"] = ROWS["middle third"]

ALL_ROWS = {"rgb": 16, "depth": 16, "imu": 301, "pose": 61, "flow/10hz": 3, "flow/25hz": 7, "flow/50hz": 15}
SPANS_US = {
    "no frame at the end": (0, 280_000),
    "ends cut between frames": (37_137, 246_589),
    "middle third": (100_000, 200_000),
    "middle third from zero": (100_000, 200_000),
}


@pytest.mark.parametrize("name", ROWS)
def test_rows_are_those_of_their_instants(name: str, pair_of: Callable[[str], Pair]) -> None:
    """As many rows as the rate or the cut leaves; each holds what the file before holds at its instant."""
    old, new = pair_of(name)
    origin_us = 100_000 if name == "middle third from zero" else 0
    for stream, count in {**ALL_ROWS, **ROWS[name]}.items():
        key = TIMESTAMPS_OF[stream]
        assert len(new.get(key, ())) == count, stream
        if count:
            numbers = {row: number for number, row in enumerate(map(tuple, np.atleast_2d(old[key].T).T.tolist()))}
            rows = [numbers[tuple(row)] for row in np.atleast_2d((new[key] + origin_us).T).T.tolist()]
            assert rows == sorted(rows)
            for path in (path for path in DATASETS if path in new and DATASETS[path].stream == stream):
                wanted = old[path][rows] - (origin_us if DATASETS[path].is_timestamps else 0)
                np.testing.assert_array_equal(new[path], wanted, err_msg=path)
    start_us, stop_us = SPANS_US.get(name, (-1, 300_000))
    inside = (old["path/events/t"] > start_us) & (old["path/events/t"] <= stop_us)
    assert inside.sum() > 0
    for field in "xyp":
        np.testing.assert_array_equal(new[f"path/events/{field}"], old[f"path/events/{field}"][inside])
    np.testing.assert_array_equal(new["path/events/t"] + origin_us, old["path/events/t"][inside])


def test_imu_at_half_the_rate_declares_its_noise(pair_of: Callable[[str], Pair]) -> None:
    """``density sqrt(rate)`` is the noise of a sample, which stays; so do the random walks, and gravity."""
    old, new = pair_of("IMU at 500 Hz")
    for name in ("gyro_noise_density", "accel_noise_density"):
        sigma_old, sigma_new = (
            contents[f"metadata/imu@{name}"] * np.sqrt(1e6 / np.diff(contents["path/imu/ts"]).mean())
            for contents in (old, new)
        )
        assert sigma_new == pytest.approx(sigma_old)
    for name in ("gyro_bias_walk", "accel_bias_walk", "gravity", "sampling"):
        assert new[f"metadata/imu@{name}"] == old[f"metadata/imu@{name}"]


@pytest.mark.parametrize("name", [name for name in SPANS_US if name != "no frame at the end"])
def test_a_cut_knows_no_reference_level(name: str, pair_of: Callable[[str], Pair]) -> None:
    """Pixels do not begin at the light of the first frame."""
    _, new = pair_of(name)
    assert new["metadata/events@initial_phase"] == "uniform"


@pytest.mark.parametrize(
    "name", ["world turned by 90 degrees", "world turned and moved", "world in UTM", "first pose as origin"]
)
def test_the_path_stays_relative_to_itself(name: str, pair_of: Callable[[str], Pair]) -> None:
    """Motions between poses, in the body, stay, and so does the vertical in the body."""
    motions = []
    for contents in pair_of(name):
        attitude = Rotation.from_quat(contents["path/pose/orientation"])
        positions_m = contents["path/pose/position"]
        motions.append(
            (
                (attitude[0].inv() * attitude).as_matrix(),
                attitude[0].inv().apply(positions_m - positions_m[0]),
                attitude.inv().apply([0.0, 0.0, 1.0]),
            )
        )
    for old, new in zip(*motions, strict=True):
        # Coordinates in UTM are 4e6 m, where float64 has steps of 1e-9 m.
        np.testing.assert_allclose(new, old, rtol=0, atol=2e-9)


def test_the_first_pose_is_the_origin(pair_of: Callable[[str], Pair]) -> None:
    """At zero, and headed along X."""
    _, new = pair_of("first pose as origin")
    forward = Rotation.from_quat(new["path/pose/orientation"][0]).apply([1.0, 0.0, 0.0])
    np.testing.assert_array_equal(new["path/pose/position"][0], 0.0)
    assert forward[1] == pytest.approx(0.0, abs=1e-12)
    assert forward[0] > 0


@pytest.mark.parametrize(
    ("name", "shift_us"),
    [("clock an hour on", 3_600_000_000), ("Unix time", 1_790_000_000_000_000), ("clock before zero", -5_000_123)],
)
def test_all_timestamps_move_alike(name: str, shift_us: int, pair_of: Callable[[str], Pair]) -> None:
    """By whole microseconds; all else stays."""
    old, new = pair_of(name)
    for key in (key for key in DATASETS if key in old):
        np.testing.assert_array_equal(new[key], old[key] + (shift_us if DATASETS[key].is_timestamps else 0))


def by_pixel(contents: Contents) -> list[NDArray[np.int64]]:
    """Column, row, polarity and timestamp of the events, sorted by pixel; those of a pixel in the order of the file."""
    fields = [contents[f"path/events/{field}"].astype(np.int64) for field in "xypt"]
    order = np.argsort(fields[1] * 100_000 + fields[0], kind="stable")
    return [field[order] for field in fields]


def test_events_of_an_instant_are_sorted_by_column(clean: Path, tmp_path: Path) -> None:
    """In packets, where many have one timestamp: each pixel has its events in their order, and columns rise."""
    transform(BY_NAME["packets of 200 us"], clean, tmp_path / "a.h5")
    old = contents_of(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        order_by_columns(file)
    new = contents_of(tmp_path / "a.h5")
    for after, earlier in zip(by_pixel(new), by_pixel(old), strict=True):
        np.testing.assert_array_equal(after, earlier)
    same = np.diff(new["path/events/t"]) == 0
    assert np.any(np.diff(old["path/events/x"].astype(int))[same] < 0)
    assert np.all(np.diff(new["path/events/x"].astype(int))[same] >= 0)


def test_packets_stamp_with_the_next_tick(pair_of: Callable[[str], Pair]) -> None:
    """Each event with the first tick of 200 us not before it, and the interval is declared."""
    old, new = pair_of("packets of 200 us")
    *after, after_us = by_pixel(new)
    *earlier, earlier_us = by_pixel(old)
    for new_values, old_values in zip(after, earlier, strict=True):
        np.testing.assert_array_equal(new_values, old_values)
    assert np.all(after_us % new["metadata/events@packet_interval_us"] == 0)
    assert np.all((after_us - earlier_us >= 0) & (after_us - earlier_us < 200))
    assert new["metadata/events@packet_interval_us"] == 200


def plain(value: Any) -> Any:
    """The value without its type: text as lower-case str, numbers as float."""
    item = np.asarray(value).item() if np.size(value) == 1 else np.asarray(value).tolist()
    text = item.decode() if isinstance(item, bytes) else item
    return text.lower() if isinstance(text, str) else text


@pytest.mark.parametrize(
    "name", ["units in capitals", "sizes as floats", "text of fixed length", "numbers as arrays of one"]
)
def test_declarations_say_the_same(name: str, pair_of: Callable[[str], Pair]) -> None:
    """In other types or letters; some are altered."""
    old, new = pair_of(name)
    attributes = [path for path in old if "@" in path]
    assert all(plain(new[path]) == plain(old[path]) for path in attributes)
    assert any(
        type(new[path]) is not type(old[path]) or not np.array_equal(new[path], old[path]) for path in attributes
    )


def test_intrinsics_in_single_precision(pair_of: Callable[[str], Pair]) -> None:
    """Nothing moves by more than half a step of float32."""
    old, new = pair_of("intrinsics in float32")
    for path in (path for path in old if path.endswith(("@K", "@T_body_camera"))):
        assert new[path].dtype == np.float32
        np.testing.assert_allclose(new[path].astype(np.float64), old[path], rtol=6e-8, atol=0)


def test_defaults_are_what_absence_means(pair_of: Callable[[str], Pair]) -> None:
    """What is left out was zero, a pinhole, instantaneous or linear, and what has another value stays."""
    old, new = pair_of("defaults left out")
    absent = [path for path in old if path not in new]
    assert {path.rpartition("@")[2] for path in absent} >= {"exposure_us", "camera_model", "sampling", "transfer"}
    assert all(plain(old[path]) in (0, "pinhole", "instant", "linear") for path in absent)
    assert not [path for path in absent if "threshold_o" in path or "density" in path or "walk" in path]


def test_provenance_is_left_out(pair_of: Callable[[str], Pair]) -> None:
    """Only attributes of the root, and not the format."""
    old, new = pair_of("provenance left out")
    absent = {path for path in old if path not in new}
    assert absent == {"@sequence", "@world", "@illumination", "@created_by", "@scene_digest", "@seed"}


def test_the_wider_range_holds_all_depth(pair_of: Callable[[str], Pair]) -> None:
    """It holds the range before, and every valid depth."""
    old, new = pair_of("wider depth range")
    nearest_m, farthest_m = new["metadata/depth_range"]
    assert nearest_m < old["metadata/depth_range"][0]
    assert farthest_m > old["metadata/depth_range"][1]
    assert nearest_m <= np.nanmin(new["path/depth"]) / 1000
    assert farthest_m >= np.nanmax(new["path/depth"]) / 1000


@pytest.mark.parametrize("name", ["extra objects", "index of milliseconds"])
def test_more_is_added(name: str, pair_of: Callable[[str], Pair]) -> None:
    """Nothing is lost, something is added."""
    old, new = pair_of(name)
    assert set(old) < set(new)


def test_the_index_of_milliseconds_is_that_of_dsec(pair_of: Callable[[str], Pair]) -> None:
    """Entry m is the first event not before m ms: ``t[i[m]] >= 1000 m`` and ``t[i[m] - 1] < 1000 m``."""
    _, new = pair_of("index of milliseconds")
    event_us = new["path/events/t"].tolist()
    for millisecond, index in enumerate(new["path/events/ms_to_idx"].tolist()):
        assert event_us[index] >= 1000 * millisecond
        assert index == 0 or event_us[index - 1] < 1000 * millisecond


def test_jpeg_moves_colour_by_little(pair_of: Callable[[str], Pair]) -> None:
    """Channels keep their order and their means, to half a step; pixels move by 3 DN or less on average."""
    old, new = (contents["path/rgb"].astype(np.float64) for contents in pair_of("colour through JPEG 95"))
    assert 0 < np.abs(new - old).mean() < 3
    np.testing.assert_allclose(new.mean(axis=(0, 1, 2)), old.mean(axis=(0, 1, 2)), rtol=0, atol=0.5)


def test_read_noise_has_its_size(pair_of: Callable[[str], Pair]) -> None:
    """1 DN, and that of rounding, far from black and white; no trend."""
    old, new = (contents["path/rgb"].astype(np.float64) for contents in pair_of("colour with read noise"))
    noise = (new - old)[(old > 6) & (old < 249)]
    assert noise.std() == pytest.approx(np.sqrt(1 + 1 / 12), rel=0.01)
    assert abs(noise.mean()) < 0.01

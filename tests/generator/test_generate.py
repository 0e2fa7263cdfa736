"""Whole sequences: everything that the layout names, consistent with each other, the same from the same seed."""

import math
from dataclasses import replace
from pathlib import Path

import h5py
import hdf5plugin  # noqa: F401  registers the codec
import numpy as np
import pytest

from fedora_generator import generate, rates
from fedora_generator.camera import event_camera
from fedora_generator.choices import SCENE_NAMES, STREAMS
from fedora_generator.errors import OutputError, SceneError
from fedora_generator.flight import Flight
from fedora_generator.flights.presets import PRESET_NAMES
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.render import ExactWorld
from fedora_generator.scene import Scene, load_scene
from fedora_generator.streams import as_8_bit
from fedora_generator.threads import NUMBA_CONFIG
from fedora_qa.layout.canonical import ATTRIBUTES, DATASETS
from tests.support.sequences import (
    CLEAN_PART_S,
    CLEAN_S,
    CLEAN_SIZE_PX,
    CLEAN_SIZES_PX,
    CleanSequence,
    small_scene,
)

KEYS = [key for key, spec in DATASETS.items() if not spec.optional]
SHORT = Request(duration_s=0.1, quality="draft")


def tiny(name: str) -> Scene:
    return small_scene(name, 72, 54)


@pytest.fixture(scope="module", params=SCENE_NAMES)
def generated(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, clean_sequence: CleanSequence
) -> Path:
    """0.1 s of each exact scene, tiny; of meshes, whose images cost the same at any size, the sequence of the run."""
    if load_scene(request.param).renderer == "mesh":
        return clean_sequence(request.param)
    path = tmp_path_factory.mktemp("scene") / f"{request.param}.h5"
    generate_sequence(tiny(request.param), path, SHORT)
    return path


def extent_of(name: str) -> tuple[float, int, int]:
    """Return the length of the sequence of a scene, s, and the width and height of its frames."""
    if load_scene(name).renderer == "mesh":
        return (CLEAN_S.get(name, CLEAN_PART_S["mesh"]), *CLEAN_SIZES_PX.get(name, CLEAN_SIZE_PX["mesh"]))
    return SHORT.duration_s, 72, 54


def test_every_dataset_of_the_layout_is_there(generated: Path) -> None:
    """Type, units and sizes are those of the layout, both ends of every stream are written."""
    with h5py.File(generated) as file:
        duration_s, width, height = extent_of(file.attrs["sequence"])
        intervals = {hz: math.floor(round(duration_s * hz, 6)) for hz in (10, 25, 50, 200, 1000)}
        sizes = {"N": intervals[50] + 1, "D": intervals[50] + 1, "M": intervals[1000] + 1, "P": intervals[200] + 1}
        sizes |= {"K10": intervals[10], "K25": intervals[25], "K50": intervals[50]}
        sizes |= {"H": height, "W": width, "H_rgb": height, "W_rgb": width, "E": len(file["path/events/t"])}
        moving = {key for key in DATASETS if key.endswith("_moving") and key in file}
        assert len(moving) == (3 if file.attrs["sequence"] == "park-traffic" else 0)
        for key in (*KEYS, *moving):
            assert key in file
            spec = DATASETS[key]
            assert file[key].dtype == spec.dtype
            assert file[key].attrs["units"] == spec.units
            assert file[key].shape == tuple(sizes.get(str(size), size) for size in spec.shape), key


def test_every_required_attribute_is_there(generated: Path) -> None:
    """What the format asks for is said, within its choices."""
    with h5py.File(generated) as file:
        for (owner, name), spec in ATTRIBUTES.items():
            if spec.required:
                assert name in file[owner or "/"].attrs, (owner, name)
            if spec.choices and name in file[owner or "/"].attrs:
                assert file[owner or "/"].attrs[name] in spec.choices


def test_the_event_columns_are_in_order_and_in_bounds(generated: Path) -> None:
    """Sorted by (t, y, x, p), inside the sensor, after the first and up to the last instant."""
    with h5py.File(generated) as file:
        x, y, t, p = (file[f"path/events/{name}"][:] for name in "xytp")
        attrs = file["metadata/cameras/events"].attrs
        assert (x < attrs["width"]).all()
        assert (y < attrs["height"]).all()
        assert set(p.tolist()) <= {0, 1}
        duration_s, _, _ = extent_of(file.attrs["sequence"])
        assert ((t > 0) & (t <= 1e6 * duration_s)).all()
        assert len(t) > 0 or file.attrs["sequence"] == "hover"  # a tenth of a second of hovering shows nothing
        np.testing.assert_array_equal(np.lexsort((p, x, y, t)), np.arange(len(t)))


def test_the_index_maps_are_searchsorted(generated: Path) -> None:
    """Index of the earliest event not before the frame; the number of events where none is left."""
    with h5py.File(generated) as file:
        for stream in ("rgb", "depth"):
            expected = np.searchsorted(file["path/events/t"][:], file[f"path/{stream}_ts"][:], side="left")
            np.testing.assert_array_equal(file[f"metadata/{stream}_to_event"][:], expected)


def test_flow_abuts_and_is_valid_where_depth_is(generated: Path) -> None:
    """Intervals start and end on frame stamps; NaN is the depth's at the start."""
    with h5py.File(generated) as file:
        timestamps = file["path/depth_ts"][:]
        for rate_hz in (10, 25, 50):
            intervals = file[f"path/flow/{rate_hz}hz_ts"][:]
            assert np.isin(intervals, timestamps).all()
            np.testing.assert_array_equal(np.diff(intervals, axis=1), 1_000_000 // rate_hz)
            np.testing.assert_array_equal(intervals[1:, 0], intervals[:-1, 1])
            for k, start in enumerate(intervals[:, 0]):
                depth_mm = file["path/depth"][np.searchsorted(timestamps, start)]
                flow = file[f"path/flow/{rate_hz}hz"][k]
                np.testing.assert_array_equal(np.isnan(flow), np.repeat(np.isnan(depth_mm)[..., None], 2, axis=-1))


def test_the_images_use_the_range_without_saturating(generated: Path) -> None:
    """By day up to 240 DN and above 5, at night dark but not black; only lamps of a mesh place are clipped.

    The paper's nights have as many events as its days: they are lit by floodlights, half as bright as a day.
    """
    with h5py.File(generated) as file:
        rgb = file["path/rgb"][:]
        most_bright = 0.01 if "mesh" in file.attrs["sequence"] else 0.0
        assert np.mean(rgb > 240) <= most_bright
        darkest_day = 120 if file.attrs["sequence"] in PRESET_NAMES else 70
        low, high = (0, darkest_day) if file.attrs["illumination"] == "night" else (5, 240)
        assert low < np.median(rgb) < high
        assert np.std(rgb) > 5


@pytest.mark.parametrize("name", ["park-noisy", "racetrack"])
def test_the_same_seed_gives_the_same_bytes(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On one thread and on two, all datasets are equal bit for bit, noise included."""
    for threads in (1, 2):
        monkeypatch.setattr(NUMBA_CONFIG, "NUMBA_NUM_THREADS", threads)
        generate_sequence(tiny(name), tmp_path / f"{threads}.h5", SHORT, overwrite=True)
    files = sorted(tmp_path.glob("*.h5"))
    with h5py.File(files[0]) as one, h5py.File(files[-1]) as two:
        for key in KEYS:
            np.testing.assert_array_equal(one[key][:], two[key][:])


def test_another_seed_gives_other_noise_only(tmp_path: Path) -> None:
    """Images, depth, flow and stamps stay; events, IMU and pose differ."""
    scene = tiny("park-noisy")
    for seed in (1, 2):
        generate_sequence(replace(scene, seed=seed), tmp_path / f"{seed}.h5", SHORT)
    with h5py.File(tmp_path / "1.h5") as one, h5py.File(tmp_path / "2.h5") as two:
        same = {key: np.array_equal(one[key][:], two[key][:], equal_nan=True) for key in KEYS if "events" not in key}
        noisy = {"path/imu/angular_velocity", "path/imu/linear_acceleration", "path/pose/position"}
        noisy |= {"path/pose/orientation", "metadata/rgb_to_event", "metadata/depth_to_event"}
        assert {key for key, equal in same.items() if not equal} == noisy
        assert one["path/events/t"].shape != two["path/events/t"].shape


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """0.1 s of the noisy park with all streams."""
    path = tmp_path_factory.mktemp("noisy") / "all.h5"
    generate_sequence(tiny("park-noisy"), path, SHORT)
    return path


@pytest.mark.parametrize("stream", STREAMS)
def test_a_stream_left_out_changes_no_other(tmp_path: Path, noisy: Path, stream: str) -> None:
    """Neither its datasets nor its metadata are written, and what remains is as it was."""
    generate_sequence(tiny("park-noisy"), tmp_path / "a.h5", replace(SHORT, streams=frozenset(STREAMS) - {stream}))
    with h5py.File(noisy) as whole, h5py.File(tmp_path / "a.h5") as less:
        gone = {key for key in KEYS if key not in less}
        also = {"events": {"metadata/rgb_to_event", "metadata/depth_to_event"}, "depth": {"metadata/depth_range"}}
        own = {key for key in KEYS if key.startswith((f"path/{stream}", f"metadata/{stream}_to_event"))}
        assert gone == own | also.get(stream, set())
        for group in (f"metadata/{stream}", f"metadata/cameras/{stream}", f"path/{stream}"):
            assert group not in less
        for key in set(KEYS) - gone:
            np.testing.assert_array_equal(whole[key][:], less[key][:])


def test_the_events_follow_the_logarithm_of_the_luminance(tmp_path: Path) -> None:
    """After every frame interval each pixel's L - L(0) - C (ON - OFF) lies strictly between -C and C."""
    scene = tiny("park-day")
    generate_sequence(scene, tmp_path / "a.h5", SHORT)
    camera, flight, world = event_camera(scene.camera), Flight(scene.flight), ExactWorld.of(scene.world, scene.light)
    first = np.log(world.luma_dn(camera, camera.pose_at(flight, 0)))
    with h5py.File(tmp_path / "a.h5") as file:
        x, y, t, p = (file[f"path/events/{name}"][:].astype(np.int64) for name in "xytp")
    for time_us in range(20_000, 100_001, 20_000):
        seen = t <= time_us
        net = np.zeros((camera.height, camera.width))
        np.add.at(net, (y[seen], x[seen]), 2 * p[seen] - 1)
        left = np.log(world.luma_dn(camera, camera.pose_at(flight, time_us))) - first - 0.2 * net
        assert np.abs(left).max() < 0.2 * (1 + 1e-9)


def test_a_duration_that_fits_no_grid_is_cut_down(tmp_path: Path) -> None:
    """0.0333 s: 2 frames, 34 IMU samples, 7 poses, one 50 Hz flow and no slower one; events run to the end."""
    generate_sequence(tiny("racetrack"), tmp_path / "a.h5", replace(SHORT, duration_s=0.0333))
    with h5py.File(tmp_path / "a.h5") as file:
        keys = ("path/rgb_ts", "path/imu/ts", "path/pose/ts", *(f"path/flow/{rate_hz}hz" for rate_hz in (50, 25, 10)))
        assert [len(file[key]) for key in keys] == [2, 34, 7, 1, 0, 0]
        assert 20_000 < file["path/events/t"][-1] <= 33_300


@pytest.mark.parametrize("error", [RuntimeError("broken"), KeyboardInterrupt()])
def test_nothing_is_left_of_a_sequence_that_breaks_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    """An error or an interrupt in the middle leaves neither the target nor a temporary file."""

    def interrupt(time_us: int) -> None:
        if time_us > 0:
            raise error

    with pytest.raises(type(error)):
        generate_sequence(tiny("park-day"), tmp_path / "a.h5", SHORT, progress=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_kept_unless_told_otherwise(tmp_path: Path) -> None:
    """Refused before any work; with overwrite it is replaced, and only by a whole file."""
    target = tmp_path / "a.h5"
    target.write_text("precious")
    imu_only = replace(SHORT, streams=frozenset({"imu"}))
    with pytest.raises(OutputError, match="which exists"):
        generate_sequence(tiny("park-day"), target, imu_only)
    assert target.read_text() == "precious"
    with pytest.raises(SceneError):
        generate_sequence(tiny("park-day"), target, replace(imu_only, duration_s=600.0), overwrite=True)
    assert target.read_text() == "precious"
    generate_sequence(tiny("park-day"), target, imu_only, overwrite=True)
    assert h5py.is_hdf5(target)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    """Nothing is created on the way to a target that cannot be."""
    with pytest.raises(OutputError, match="Expected an existing folder"):
        generate_sequence(tiny("park-day"), tmp_path / "no" / "a.h5", SHORT)
    with pytest.raises(OutputError, match="got the folder"):
        generate_sequence(tiny("park-day"), tmp_path, SHORT)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"duration_s": 0.0}, "Expected a duration above 0"),
        ({"duration_s": float("nan")}, "Expected a duration above 0"),
        ({"streams": frozenset({"rgb", "lidar"})}, "Expected streams among rgb, .* got lidar"),
        ({"streams": frozenset()}, "Expected streams among rgb, .* got none"),
        ({"quality": "best"}, "Expected a quality among draft, standard, reference, got 'best'"),
    ],
)
def test_an_impossible_request_is_refused(change: dict[str, object], message: str) -> None:
    """One sentence each, before any work."""
    with pytest.raises(SceneError, match=message):
        replace(SHORT, **change)


def test_the_frame_stores_rounded_radiance() -> None:
    """``rint(clip(Y))``: half to even, nothing wraps."""
    np.testing.assert_array_equal(as_8_bit(np.array([-3.0, 0.5, 1.5, 2.4, 254.6, 300.0])), [0, 0, 2, 2, 255, 255])


def test_the_flight_is_looked_at_in_pieces_from_end_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A collision is found at the same instant however the times are cut."""
    monkeypatch.setattr(rates, "PIECE", 1000)
    scene = load_scene("park-day")
    with pytest.raises(SceneError, match="got inside") as in_pieces:
        generate.require_free_flight(scene, 60_000_000)
    monkeypatch.setattr(rates, "PIECE", 1 << 20)
    with pytest.raises(SceneError) as at_once:
        generate.require_free_flight(scene, 60_000_000)
    assert str(in_pieces.value) == str(at_once.value)

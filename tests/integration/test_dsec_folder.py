"""A folder as DSEC has them is one sequence: clean where it is correct, and its faults are found and named."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.layout.dialect import load_choice
from fedora_qa.record.types import FileRecord
from fedora_qa.sequence.sequence import open_sequence
from tests.support.dsec_folder import T_OFFSET_US, encode_flow, write_dsec_folder, write_png, write_side_metadata


@pytest.fixture(scope="module")
def clean(small_park_day: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dsec") / "zurich"
    return write_dsec_folder(small_park_day, folder)


@pytest.fixture(scope="module")
def side(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_side_metadata(tmp_path_factory.mktemp("side") / "side.toml")


@pytest.fixture
def folder(clean: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(clean, tmp_path / "zurich"))


def check(folder: Path, side: Path | None = None) -> FileRecord:
    choice = load_choice(None, str(side) if side else None)
    return check_file(folder, CheckOptions(dialect=choice, profile="release", evidence=None)).record


def failed(record: FileRecord) -> set[str]:
    return {result.check for result in record.results if result.outcome == "failed"}


def test_rows_are_those_of_the_source(small_park_day: Path, clean: Path) -> None:
    """Every stream comes out in canonical units, within half a step of its 16 bits."""
    with open_sequence(small_park_day) as before, open_sequence(clean) as after:
        assert after.layout.streams == {"rgb", "depth", "events", "flow/10hz"}
        assert not after.layout.problems
        assert after.origin_ns - before.origin_ns >= T_OFFSET_US * 1000
        shift_ns = after.origin_ns - before.origin_ns - T_OFFSET_US * 1000
        count = after.layout.bindings["path/events/t"].rows
        for key in ("path/events/x", "path/events/y", "path/events/p"):
            np.testing.assert_array_equal(after.rows(key, 0, count), before.rows(key, 0, count))
        np.testing.assert_array_equal(
            after.rows("path/events/t", 0, count) + shift_ns, before.rows("path/events/t", 0, count)
        )
        np.testing.assert_array_equal(after.rows("path/rgb", 3, 5), before.rows("path/rgb", 3, 5))
        np.testing.assert_allclose(
            after.rows("path/flow/10hz", 2, 3), before.rows("path/flow/10hz", 2, 3), atol=0.5 / 128 + 2e-5
        )
        depth_mm, stored_mm = before.rows("path/depth", 5, 6), after.rows("path/depth", 1, 2)
        # d = f B / Z in steps of 1/256 px: dZ = Z^2 / (f B) / 512.
        focal_px = before.declared.cameras["depth"].K[0, 0]
        step_mm = depth_mm**2 / (focal_px * 600) / 512
        assert np.nanmax(np.abs(stored_mm - depth_mm) / step_mm) < 1.05
        np.testing.assert_array_equal(np.isnan(stored_mm), np.isnan(depth_mm))
        # The body is another one: that of the depth camera.
        own, other = (np.linalg.inv(each.declared.cameras["depth"].T_body_camera) for each in (before, after))
        for name in ("rgb", "depth", "events"):
            camera, expected = after.declared.cameras[name], before.declared.cameras[name]
            np.testing.assert_allclose(camera.K, expected.K)
            np.testing.assert_allclose(other @ camera.T_body_camera, own @ expected.T_body_camera, atol=1e-12)


def test_properties_of_a_sensor_are_no_faults(folder: Path, tmp_path: Path) -> None:
    """A hot pixel and a grid of 1 ms are stated of what is recorded, and judged of what is synthetic."""
    with h5py.File(folder / "events/left/events.h5", "a") as file:
        events = {name: file[f"events/{name}"][:] for name in "xytp"}
        hot = np.arange(0, int(events["t"][-1]), 5000)
        added = {"x": np.full(len(hot), 40), "y": np.full(len(hot), 30), "t": hot, "p": np.arange(len(hot)) % 2}
        order = np.argsort(np.concatenate([events["t"], hot]), kind="stable")
        for name, values in events.items():
            joined = np.concatenate([values, added[name].astype(values.dtype)])[order]
            del file[f"events/{name}"]
            file[f"events/{name}"] = joined // 1000 * 1000 if name == "t" else joined
        file["ms_to_idx"][...] = np.searchsorted(file["events/t"][:], 1000 * np.arange(len(file["ms_to_idx"])))
    recorded = check(folder)
    assert recorded.verdict == "clean"
    assert recorded.inferred["events.grid_us"] == 1000
    assert str(recorded.inferred["events.hot_pixels"]).startswith("1, the loudest (40, 30) with 1")
    side = tmp_path / "side.toml"
    side.write_text('[metadata]\nkind = "synthetic"\n')
    assert failed(check(folder, side)) == {"clocks.resolution", "event_stream.rates"}


def test_a_correct_folder_is_clean(clean: Path, side: Path) -> None:
    """As it comes, with the lens that its calibration states, and with the side file, which takes no check away."""
    record = check(clean)
    assert record.verdict == "clean"
    assert {result.check for result in record.results if result.outcome == "warned"} == set()
    more = check(clean, side)
    assert more.verdict == "clean"
    asked = [
        {result.check for result in each.results if result.outcome not in {"not_applicable", "not_observable"}}
        for each in (record, more)
    ]
    assert asked[0] <= asked[1]
    by_name = {result.check: result for result in record.results}
    assert by_name["index_maps.milliseconds"].outcome == "passed"
    assert "events.rectify_map" in {m.name for m in by_name["metadata.cameras"].measurements}
    projecting = {"alignment.depth", "alignment.events", "flow_photometric.residual", "flow_geometry.validity"}
    assert projecting <= asked[0]
    assert record.size == sum(path.stat().st_size for path in clean.rglob("*") if path.is_file())
    assert record.inferred["kind"] == "recorded"
    assert record.inferred["files.images"] == "images/left/rectified/*.png (31 files)"


def swap_components_of_flow(folder: Path) -> None:
    for path in (folder / "optical_flow/forward").iterdir():
        stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]
        write_png(path, stored[..., [1, 0, 2]])


def halve_flow(folder: Path) -> None:
    for path in (folder / "optical_flow/forward").iterdir():
        stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]
        flow_px = (stored[..., :2].astype(np.float64) - 2**15) / 128
        flow_px[stored[..., 2] == 0] = np.nan
        write_png(path, encode_flow(flow_px / 2))


def write_nanoseconds(folder: Path) -> None:
    path = folder / "images/timestamps.txt"
    path.write_text("".join(f"{1000 * int(line)}\n" for line in path.read_text().splitlines()))


def forget_the_offset(folder: Path) -> None:
    with h5py.File(folder / "events/left/events.h5", "a") as file:
        file["t_offset"][()] = 0


def shift_disparity(folder: Path) -> None:
    for path in (folder / "disparity/event").iterdir():
        write_png(path, np.roll(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), 6, axis=1))


def damage_an_image(folder: Path) -> None:
    path = folder / "images/left/rectified/000007.png"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(bytes(content))


def crop_an_image(folder: Path) -> None:
    path = folder / "images/left/rectified/000007.png"
    write_png(path, cv2.imread(str(path))[:-1, :, ::-1])


def point_to_the_next_event(folder: Path) -> None:
    with h5py.File(folder / "events/left/events.h5", "a") as file:
        file["ms_to_idx"][5:] += 1


def exchange_coordinates_of_the_map(folder: Path) -> None:
    with h5py.File(folder / "events/left/rectify_map.h5", "a") as file:
        file["rectify_map"][...] = file["rectify_map"][:][..., ::-1]


def leave_the_map_out(folder: Path) -> None:
    with h5py.File(folder / "events/left/rectify_map.h5", "a") as file:
        height, width = file["rectify_map"].shape[:2]
        file["rectify_map"][...] = np.dstack(np.meshgrid(np.arange(width), np.arange(height)))


def move_the_map(folder: Path) -> None:
    with h5py.File(folder / "events/left/rectify_map.h5", "a") as file:
        file["rectify_map"][...] += np.float32(0.5)


@pytest.mark.parametrize(
    ("plant", "check_name", "cause"),
    [
        (point_to_the_next_event, "index_maps.milliseconds", "index_off_by_one"),
        (exchange_coordinates_of_the_map, "metadata.cameras", "axes_swapped"),
        (leave_the_map_out, "metadata.cameras", "rectification_misdeclared"),
        (move_the_map, "metadata.cameras", "rectification_misdeclared"),
        (swap_components_of_flow, "flow_photometric.residual", "axes_swapped"),
        (halve_flow, "flow_photometric.residual", "flow_gain"),
        (write_nanoseconds, "clocks.unit", "time_unit"),
        (forget_the_offset, "clocks.span", "time_offset"),
        (shift_disparity, "alignment.depth", "spatial_offset"),
        (damage_an_image, "integrity.readable", "corrupt_chunk"),
        (crop_an_image, "integrity.readable", "wrong_shape"),
    ],
)
def test_a_planted_fault_is_found(
    plant: Callable[[Path], None], check_name: str, cause: str, folder: Path, side: Path
) -> None:
    """The check that measures it fails, and a cause is named for it."""
    plant(folder)
    record = check(folder, side)
    assert record.verdict == "findings"
    assert check_name in failed(record)
    assert cause in {diagnosis.cause for diagnosis in record.diagnoses}

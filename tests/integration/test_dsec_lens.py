"""A folder as DSEC has them, with events through a lens, compared with flow and depth in the rectified view."""

from collections.abc import Callable
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
import yaml

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.layout.dialect import load_choice
from fedora_qa.record.types import FileRecord
from tests.support.distorted_events import SIZE_PX, write_distorted_events
from tests.support.dsec_folder import encode_flow, write_dsec_folder, write_png
from tests.support.shared_files import SharedFiles

SIZES_PX = dict.fromkeys(("racetrack-drive", "fast-turn"), (200, 150))
"""Of the scenes that show a gain and a delay in smaller images as well as in those of the others."""

EVENTS, MAP = "events/left/events.h5", "events/left/rectify_map.h5"


@pytest.fixture
def folder_of(shared_files: SharedFiles, tmp_path: Path) -> Callable[[str], Path]:
    """Write a second of a scene; colour lies 5 cm beside the events, as in DSEC."""

    def write(scene: str) -> Path:
        source = shared_files.file(
            f"{scene}-distorted-events.h5",
            lambda path: write_distorted_events(path, scene, size_px=SIZES_PX.get(scene, SIZE_PX)),
        )
        return write_dsec_folder(source, tmp_path / "zurich", depth_stride=1)

    return write


def check(folder: Path, *, canary: bool = False) -> FileRecord:
    options = CheckOptions(dialect=load_choice(None, None), profile="release", evidence=None, canary=canary)
    return check_file(folder, options).record


def test_a_correct_folder_is_clean(folder_of: Callable[[str], Path]) -> None:
    """Events are compared with flow and with depth. Where parallax forbids a comparison with colour, that is said."""
    record = check(folder_of("park-day"), canary=True)
    assert record.verdict == "clean"
    by_name = {result.check: result for result in record.results}
    asked = {name: by_name[name].outcome for name in ("flow_events.sharpness", "alignment.events", "metadata.cameras")}
    assert asked == dict.fromkeys(asked, "passed")
    conservation = by_name["event_response.conservation"]
    assert (conservation.outcome, "parallax" in conservation.reason) == ("not_applicable", True)
    assert record.inferred["events.share_in_view_of_flow"] == 1.0
    assert set(record.uncompared) == set()
    outcomes = {canary.check: (canary.outcome, canary.fault) for canary in record.canaries}
    assert outcomes["flow_events.sharpness"][0] == "seen"
    # Colour, in which others plant, does not locate the events.
    assert outcomes["alignment.events"][0] == "seen"
    assert outcomes["alignment.events"][1].startswith("depth lies")


def test_a_correct_drive_is_clean(folder_of: Callable[[str], Path]) -> None:
    """Scale changes by two fifths within a field, whose displacement exceeds the slope in the middle by 7%."""
    record = check(folder_of("racetrack-drive"))
    (result,) = (result for result in record.results if result.check == "flow_events.sharpness")
    (gain,) = (measurement for measurement in result.measurements if measurement.name == "gain_10hz")
    assert gain.value is not None
    assert (5.0 < gain.value < 10.0, gain.exceeds_limit, record.verdict) == (True, False, "clean")


def test_a_correct_fast_turn_is_clean(folder_of: Callable[[str], Path]) -> None:
    """Steps of depth do not locate its events, but their delay is measured, and a planted one is detected."""
    record = check(folder_of("fast-turn"), canary=True)
    assert record.verdict == "clean"
    (result,) = (result for result in record.results if result.check == "alignment.events")
    (delay,) = (measurement for measurement in result.measurements if measurement.name == "time_offset")
    assert delay.value == pytest.approx(0.0, abs=1.0)
    assert delay.least_detectable is not None
    assert delay.least_detectable < 6
    (canary,) = (canary for canary in record.canaries if canary.check == "alignment.events")
    assert (canary.outcome, canary.fault.startswith("events")) == ("seen", True)


def move_events(folder: Path) -> None:
    """By a pixel to the right; those of the last column leave the sensor."""
    with h5py.File(folder / EVENTS, "a") as file:
        x = file["events/x"][:]
        file["events/x"][...] = np.minimum(x + 1, x.max())


def ignore_the_lens(folder: Path) -> None:
    """In the calibration and in the map, which then agree."""
    path = folder / "calibration/cam_to_cam.yaml"
    document = yaml.safe_load(path.read_text("utf-8"))
    document["intrinsics"]["cam0"]["distortion_coeffs"] = [0.0] * 4
    path.write_text(yaml.safe_dump(document), "utf-8")
    K_camera, K_view = (
        np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        for fx, fy, cx, cy in (document["intrinsics"][name]["camera_matrix"] for name in ("cam0", "camRect0"))
    )
    with h5py.File(folder / MAP, "a") as file:
        height, width = file["rectify_map"].shape[:2]
        pixels = np.dstack(np.meshgrid(np.arange(float(width)), np.arange(float(height)))).reshape(-1, 1, 2)
        R = np.array(document["extrinsics"]["R_rect0"])
        rectified = cv2.undistortPoints(pixels, K_camera, np.zeros(4), R=R, P=K_view)
        file["rectify_map"][...] = rectified.reshape(height, width, 2)


def exchange_coordinates_of_the_map(folder: Path) -> None:
    with h5py.File(folder / MAP, "a") as file:
        file["rectify_map"][...] = file["rectify_map"][:][..., ::-1]


def shorten_flow(folder: Path) -> None:
    for path in (folder / "optical_flow/forward").iterdir():
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert image is not None
        stored = image[..., ::-1]
        flow_px = (stored[..., :2].astype(np.float64) - 2**15) / 128
        flow_px[stored[..., 2] == 0] = np.nan
        write_png(path, encode_flow(0.7 * flow_px))


def delay_events(folder: Path) -> None:
    """By 5 ms: the offset of their clock. Indices of milliseconds count on the clock before it."""
    with h5py.File(folder / EVENTS, "a") as file:
        file["t_offset"][...] = file["t_offset"][()] + 5000


def advance_images(folder: Path) -> None:
    """By 5 ms, against depth and flow as against the events."""
    path = folder / "images/timestamps.txt"
    path.write_text("".join(f"{int(line) - 5000}\n" for line in path.read_text("utf-8").split()), "utf-8")


@pytest.mark.parametrize(
    ("scene", "plant", "check_name", "stream", "cause"),
    [
        ("park-day", move_events, "alignment.events", "events", "spatial_offset"),
        ("park-night", ignore_the_lens, "alignment.events", "metadata", "rectification_misdeclared"),
        ("park-day", exchange_coordinates_of_the_map, "metadata.cameras", "metadata", "axes_swapped"),
        ("park-day", shorten_flow, "flow_events.sharpness", "flow", "flow_gain"),
        ("fast-turn", delay_events, "alignment.events", "events", "time_offset"),
        ("fast-turn", advance_images, "alignment.events", "rgb", "time_offset"),
    ],
)
def test_a_planted_fault_is_found(
    scene: str, plant: Callable[[Path], None], check_name: str, stream: str, cause: str,
    folder_of: Callable[[str], Path],
) -> None:  # fmt: skip
    """The check that measures it fails, and the cause is named."""
    folder = folder_of(scene)
    plant(folder)
    record = check(folder)
    assert check_name in {result.check for result in record.results if result.outcome == "failed"}
    assert (stream, cause) in {(diagnosis.stream, diagnosis.cause) for diagnosis in record.diagnoses}

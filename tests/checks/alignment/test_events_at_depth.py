"""Events of another lens than depth, and of another centre than colour, are located by the steps of depth."""

from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.checks.event_file import log_file
from tests.estimators.event_world import MS, Stream, camera_matrix
from tests.support.checked import measured_record, rules, run_check

CHECK = "alignment.events"
LENS = (-0.37, 0.16, 4e-4, -3e-4)
HEIGHT, WIDTH = 150, 200
DURATION_MS = 800
TURN, _ = cv2.Rodrigues(np.array([0.004, -0.008, 0.01]))
K = camera_matrix(WIDTH, HEIGHT)
Floats = NDArray[np.float64]


def boxes() -> tuple[Floats, Floats]:
    """Depth of boxes before a wall, mm, and points (n, 2) on their outlines, px, in the view of a pinhole."""
    rng = np.random.default_rng(3)
    depth_mm, points = np.full((HEIGHT, WIDTH), 8000.0), []
    for top in range(8, HEIGHT - 20, 24):
        for left in range(8, WIDTH - 20, 26):
            right, bottom = left + int(rng.integers(9, 16)), top + int(rng.integers(9, 16))
            depth_mm[top:bottom, left:right] = rng.uniform(2000, 5000)
            # The outline of a box lies half a pixel before its first pixel, and half a pixel behind its last one.
            across, down = (rng.uniform(first - 0.5, stop - 0.5, 200) for first, stop in ((left, right), (top, bottom)))
            points += [np.column_stack([across, np.full(200, edge - 0.5)]) for edge in (top, bottom)]
            points += [np.column_stack([np.full(200, edge - 0.5), down]) for edge in (left, right)]
    return depth_mm, np.concatenate(points)


def write(
    path: Path, shift_px: tuple[float, float] = (0.0, 0.0), lens: tuple[float, ...] = LENS, zoom: float = 1.0
) -> Path:
    """Two events of one polarity at each of the points, in random order, and three times as many anywhere."""
    rng = np.random.default_rng(5)
    depth_mm, points = boxes()
    rays = np.column_stack([points, np.ones(len(points))]) @ np.linalg.inv(K).T @ TURN
    pixels = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(LENS))[0].reshape(-1, 2)
    anywhere = rng.uniform(-0.5, (WIDTH - 0.5, HEIGHT - 0.5), (len(points), 2))
    x, y = np.rint(np.concatenate([np.repeat(pixels + shift_px, 20, axis=0), anywhere])).astype(int).T
    inside = (x >= 0) & (x < WIDTH) & (y >= 0) & (y < HEIGHT)
    x, y = x[inside].astype(np.uint16), y[inside].astype(np.uint16)
    order, times_ns = rng.permutation(len(x)), np.sort(rng.integers(1, DURATION_MS * MS, len(x)))
    events = Stream(x[order], y[order], times_ns, np.ones(len(x), np.uint8))
    log_file().altered(events=events, rgb_moved_m=0.05).write(path)
    times_us = np.arange(0, 1000 * DURATION_MS + 1, 50_000)
    with h5py.File(path, "r+") as file:
        file["path/depth"] = np.broadcast_to(depth_mm, (len(times_us), HEIGHT, WIDTH)).astype(np.float32)
        file["path/depth_ts"] = times_us
        camera = file["metadata/cameras/events"].attrs
        camera.update({"width": WIDTH, "height": HEIGHT, "K": K})
        file.create_group("metadata/cameras/depth").attrs.update(dict(camera.items()))
        camera["distortion_model"], camera["distortion"] = "radtan", lens
        camera["K"] = K * [[zoom, 1, 1], [1, zoom, 1], [1, 1, 1]]
        T_body_camera = camera["T_body_camera"].copy()
        T_body_camera[:3, :3] = T_body_camera[:3, :3] @ TURN
        camera["T_body_camera"] = T_body_camera
    return path


def test_events_at_the_outlines_pass(tmp_path: Path) -> None:
    """To a few hundredths of a pixel, though their lens displaces corners by many pixels, and they are turned."""
    result = run_check(write(tmp_path / "clean.h5"), CHECK)
    assert result.outcome == "passed"
    shifts = {m.name: m for m in result.measurements if m.name.startswith("shift")}
    assert set(shifts) == {"shift_right", "shift_down", "shift_outwards"}
    for shift in shifts.values():
        assert shift.value == pytest.approx(0.0, abs=0.1)
        assert shift.limit is not None
        assert shift.limit < 1.0


def test_a_shift_of_a_pixel_is_found(tmp_path: Path) -> None:
    """With its size, as a shift of the events."""
    record = measured_record(write(tmp_path / "shifted.h5", (1.0, 0.0)), "alignment")
    (result,) = (result for result in record.results if result.check == CHECK)
    assert set(rules(result)) == {"shift"}
    (right,) = (m for m in result.measurements if m.name == "shift_right")
    assert right.value == pytest.approx(1.0, abs=0.1)
    assert ("events", "spatial_offset") in {(each.stream, each.cause) for each in record.diagnoses}


@pytest.mark.parametrize(
    ("lens", "cause"),
    # Without a lens nothing explains that the event camera is turned.
    [((0.0, 0.0, 0.0, 0.0), "extrinsic_rotation"), ((2 * LENS[0], *LENS[1:]), "rectification_misdeclared")],
    ids=["none", "twice"],
)
def test_another_lens_is_found(lens: tuple[float, ...], cause: str, tmp_path: Path) -> None:
    """One that is declared as none, or with twice its first coefficient."""
    record = measured_record(write(tmp_path / "lens.h5", lens=lens), "alignment")
    (result,) = (result for result in record.results if result.check == CHECK)
    assert set(rules(result)) == {"lens"}
    assert (record.diagnoses[0].stream, record.diagnoses[0].cause) == ("metadata", cause)


def test_another_focal_length_is_found(tmp_path: Path) -> None:
    """One that is 2% too long: events lie inwards of where depth is projected to."""
    record = measured_record(write(tmp_path / "zoom.h5", zoom=1.02), "alignment")
    (result,) = (result for result in record.results if result.check == CHECK)
    (outwards,) = (m for m in result.measurements if m.name == "shift_outwards")
    assert outwards.value == pytest.approx(-0.8, abs=0.4)
    assert "outward" in rules(result)
    assert (record.diagnoses[0].stream, record.diagnoses[0].cause) == ("metadata", "intrinsics_focal")


def test_without_depth_colour_of_another_centre_is_not_compared(tmp_path: Path) -> None:
    """Parallax displaces colour by its depth: not applicable, with the reason."""
    path = write(tmp_path / "file.h5")
    with h5py.File(path, "r+") as file:
        del file["path/depth"], file["path/depth_ts"]
    result = run_check(path, CHECK)
    assert (result.outcome, result.reason) == (
        "not_applicable", "the cameras events and rgb do not share one centre",
    )  # fmt: skip

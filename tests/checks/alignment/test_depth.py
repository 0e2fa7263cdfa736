"""Depth against colour: shifts and mirrored frames are found, sized and told from what is allowed."""

from pathlib import Path

import h5py
import pytest

from fedora_qa.record.types import Result
from tests.support.checked import diagnoses_of, rules, run_check
from tests.support.outline_world import OutlineWorld

CHECK = "alignment.depth"
CLEAN = OutlineWorld()


def value_of(result: Result, name: str) -> float:
    return next(m.value for m in result.measurements if m.name == name and m.value is not None)


def test_clean_file_passes(tmp_path: Path) -> None:
    """Boxes lie where depth says, and half a pixel would have been seen."""
    result = run_check(CLEAN.write(tmp_path / "clean.h5"), CHECK)
    assert result.outcome == "passed"
    for name in ("shift_right", "shift_down"):
        (measured,) = (m for m in result.measurements if m.name == name)
        assert measured.least_detectable is not None
        assert measured.least_detectable < 0.5


@pytest.mark.parametrize(("right_px", "down_px"), [(0.5, 0.0), (-4.0, 0.0), (0.0, 1.0)])
def test_shift_is_found_and_sized(right_px: float, down_px: float, tmp_path: Path) -> None:
    """Half a pixel to the right, several to the left, one down."""
    path = CLEAN.altered(shift_px=(right_px, down_px)).write(tmp_path / "shifted.h5")
    result = run_check(path, CHECK)
    assert rules(result) == ["shift"]
    assert value_of(result, "shift_right") == pytest.approx(right_px, abs=0.1)
    assert value_of(result, "shift_down") == pytest.approx(down_px, abs=0.1)
    (diagnosis,) = diagnoses_of(path, "alignment")
    assert diagnosis.cause == "spatial_offset"
    assert diagnosis.magnitude is not None
    assert abs(diagnosis.magnitude) == pytest.approx(abs(right_px + down_px), abs=0.1)


def test_mirrored_colour_is_named(tmp_path: Path) -> None:
    """Frames that are mirrored left to right agree with depth when they are turned back."""
    path = CLEAN.write(tmp_path / "mirrored.h5", colour_mirrored=True)
    assert rules(run_check(path, CHECK)) == ["mirrored"]
    assert diagnoses_of(path, "alignment")[0].cause == "mirrored"


def test_colour_camera_elsewhere_is_looked_at_through_depth(tmp_path: Path) -> None:
    """A baseline that is declared is undone by depth; one that is not shows as a shift."""
    path = CLEAN.altered(baseline_m=0.08).write(tmp_path / "beside.h5")
    assert run_check(path, CHECK).outcome == "passed"
    with h5py.File(path, "r+") as file:
        camera = file["metadata/cameras"]
        camera["rgb"].attrs["T_body_camera"] = camera["depth"].attrs["T_body_camera"]
    assert "shift" in rules(run_check(path, CHECK))


def test_too_little_to_see_is_said(tmp_path: Path) -> None:
    """A wall has no outlines, and cameras of another model or without K cannot be compared."""
    path = CLEAN.altered(boxes=0).write(tmp_path / "wall.h5")
    assert run_check(path, CHECK).outcome == "not_observable"
    with h5py.File(path, "r+") as file:
        file["metadata/cameras/rgb"].attrs["camera_model"] = "fisheye"
    assert run_check(path, CHECK).outcome == "not_applicable"


def test_frames_of_other_instants_are_not_compared(tmp_path: Path) -> None:
    """Depth between colour frames shows another moment: nothing is stated."""
    path = CLEAN.write(tmp_path / "between.h5")
    with h5py.File(path, "r+") as file:
        file["path/rgb_ts"][:] = file["path/rgb_ts"][:] + 7_000
    result = run_check(path, CHECK)
    assert (result.outcome, result.reason) == ("not_observable", "no depth frame has the timestamp of a colour frame")

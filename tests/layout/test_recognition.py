"""A folder of which a dialect reads little is named so, with the command that drafts a dialect."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from fedora_qa.layout.folder import OpenFolder, match_folder, matched_folder, misfit, recognise_folder
from fedora_qa.layout.resolve import Layout, resolve
from tests.support.dsec_folder import write_dsec_folder, write_png
from tests.support.handmade import write_handmade

UNUSED = "integrity.layout.unused_files"


@pytest.fixture
def dsec(tmp_path: Path) -> Path:
    write_handmade(tmp_path / "source.h5")
    return write_dsec_folder(tmp_path / "source.h5", tmp_path / "dsec")


def layout_of(folder: Path) -> Layout:
    matched = matched_folder(folder, None)
    assert matched is not None
    with closing(OpenFolder(matched)) as opened:
        return resolve(opened)


def notes_of(layout: Layout) -> list[str]:
    return [problem.message for problem in layout.problems if problem.code == UNUSED]


def write_images(folder: Path, count: int) -> None:
    folder.mkdir(parents=True)
    for number in range(count):
        write_png(folder / f"{number:06d}.png", np.zeros((2, 3, 3), np.uint8))


def test_one_name_identifies_no_dialect(tmp_path: Path) -> None:
    """Events at the place of DSEC, among many other files, are no folder of DSEC; alone they are."""
    folder = tmp_path / "000 123"
    (folder / "events_left").mkdir(parents=True)
    write_handmade(folder / "events_left/events.h5")
    assert recognise_folder(folder) is not None
    write_images(folder / "clean_uint8", 12)
    assert recognise_folder(folder) is None
    assert misfit(folder) == (
        f"Expected more of the dialect dsec in {folder} than events (events_left/events.h5), got 12 files without a "
        f"role, such as clean_uint8/000000.png; draft a dialect with `fedora-qa layout '{folder}' --draft-dialect "
        "mine.toml`"
    )


def test_images_elsewhere_are_named(dsec: Path) -> None:
    """A folder of DSEC whose images have another place says that they were not recognised."""
    assert not notes_of(layout_of(dsec))
    (dsec / "images/left/rectified").rename(dsec / "images/left/frames")
    (note,) = notes_of(layout_of(dsec))
    assert note.startswith("Expected images at images/left/rectified/*.png or images_rectified_left/*.png or *_images_")
    assert "images elsewhere that are not read, such as images/left/frames/" in note
    assert f"draft a dialect with `fedora-qa layout {dsec} --draft-dialect mine.toml`" in note


def test_a_folder_that_is_mostly_unused_is_named(dsec: Path) -> None:
    """The right camera of DSEC is no reason for a note; ten times as many files are."""
    used = len(list(dsec.rglob("*.png")))
    write_images(dsec / "images/right/rectified", used)
    assert not notes_of(layout_of(dsec))
    write_images(dsec / "labels", 10 * used)
    (note,) = notes_of(layout_of(dsec))
    assert note.startswith("Expected the files of the dialect dsec, by which the folder was recognised, got")
    # Who names the dialect knows.
    with closing(OpenFolder(match_folder(dsec, matched_folder(dsec, None).dialect))) as opened:  # type: ignore[union-attr]
        assert not notes_of(resolve(opened))


@pytest.mark.parametrize(
    ("text", "name"),
    [("", None), ("timestamps.txt", None), ("images_timestamps.txt", "eds"), ("stamped_groundtruth.txt", "eds")],
)
def test_events_beside_images_are_not_of_eds(text: str, name: str | None, tmp_path: Path) -> None:
    """Two of its names are those of many folders; a third that is its own tells it from them."""
    folder = tmp_path / "flight"
    write_images(folder / "images", 2)
    for number in range(2):
        (folder / f"images/{number:06d}.png").rename(folder / f"images/frame_{number:010d}.png")
    write_handmade(folder / "events.h5")
    if text:
        (folder / text).write_text("0\n40000\n")
    matched = recognise_folder(folder)
    assert (matched and matched.dialect.name) == name


def test_a_name_of_tum_vie_is_not_that_of_dsec(tmp_path: Path) -> None:
    """Events of two cameras in one folder are no sequence of TUM-VIE; beside its IMU those of the left one are."""
    folder = tmp_path / "mocap-desk"
    folder.mkdir()
    for side in ("left", "right"):
        write_handmade(folder / f"mocap-desk-events_{side}.h5")
    assert recognise_folder(folder) is None
    (folder / "imu_data.txt").write_text("# t g a temp\n0.5 0 0 0 0 0 9.81 41\n5000.5 0 0 0 0 0 9.81 41\n")
    matched = recognise_folder(folder)
    assert matched is not None
    assert matched.dialect.name == "tum-vie"
    assert matched.place("events") == "mocap-desk-events_left.h5"

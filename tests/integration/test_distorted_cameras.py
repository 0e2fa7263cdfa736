"""Cameras with distorted lenses: clean as declared, and faults of camera, lens and clock are found through them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copy

import h5py
import pytest

from fedora_generator.generate import Request, generate_sequence
from tests.support.checked import measured_record, run_check
from tests.support.sequences import small_scene
from tests.support.shared_files import SharedFiles

LENSES = {
    "radtan": (-0.37, 0.16, 4e-4, -3e-4),
    "equidistant": (0.19, 0.004, 0.0007, -0.0004),
}
PROJECTING = ("flow_geometry.endpoint", "flow_geometry.validity", "depth.consistency", "depth.projection",
              "alignment.depth", "alignment.events", "event_response.alignment", "event_response.conservation",
              "flow_photometric.residual", "images.vignetting")  # fmt: skip
CAMERAS = ("rgb", "depth", "events")

Change = Callable[[h5py.AttributeManager], None]


@pytest.fixture(params=LENSES)
def clean(request: pytest.FixtureRequest, shared_files: SharedFiles) -> Path:
    """The park by day through a lens. Tests must not write into it."""
    return written(shared_files, request.param)


def written(shared_files: SharedFiles, model: str) -> Path:
    scene = small_scene("park-day", 198, 147)
    scene = replace(scene, camera=replace(scene.camera, distortion_model=model, distortion=LENSES[model]))
    request = Request(duration_s=0.6, quality="draft")
    return shared_files.file(f"park-{model}.h5", lambda path: generate_sequence(scene, path, request))


@pytest.fixture
def changed(shared_files: SharedFiles, tmp_path: Path) -> Callable[[Change], Path]:
    """Copy the sequence of the radial-tangential lens, with another declaration of all cameras."""

    def change(alter: Change) -> Path:
        path = tmp_path / "changed.h5"
        copy(written(shared_files, "radtan"), path)
        with h5py.File(path, "r+") as file:
            for name in CAMERAS:
                alter(file[f"metadata/cameras/{name}"].attrs)
        return path

    return change


def test_a_distorted_sequence_is_clean(clean: Path) -> None:
    """Everything that projects applies, and nothing is found."""
    record = measured_record(clean)
    assert record.verdict == "clean", [finding.code for result in record.results for finding in result.findings]
    outcomes = {result.check: result.outcome for result in record.results}
    assert {name: outcomes[name] for name in PROJECTING} == dict.fromkeys(PROJECTING, "passed")


def without_lens(attributes: h5py.AttributeManager) -> None:
    attributes["distortion_model"] = "none"
    del attributes["distortion"]


def with_larger_k1(attributes: h5py.AttributeManager) -> None:
    attributes["distortion"] = [1.1 * LENSES["radtan"][0], *LENSES["radtan"][1:]]


@pytest.mark.parametrize("alter", [without_lens, with_larger_k1])
def test_another_lens_than_declared_is_found(changed: Callable[[Change], Path], alter: Change) -> None:
    """A lens that is not declared, or whose k1 is a tenth too large, is not that of flow and depth."""
    results = measured_record(changed(alter), "flow_geometry.endpoint", "depth.consistency").results
    assert [result.outcome for result in results] == ["failed", "failed"]


def test_the_focal_length_is_told_from_the_lens(changed: Callable[[Change], Path]) -> None:
    """One percent too long is named, with its size."""

    def longer(attributes: h5py.AttributeManager) -> None:
        attributes["K"] = attributes["K"] * [[1.01, 1, 1], [1, 1.01, 1], [1, 1, 1]]

    (diagnosis,) = measured_record(changed(longer), "flow_geometry", "depth").diagnoses
    assert (diagnosis.stream, diagnosis.cause) == ("metadata", "intrinsics_focal")
    assert diagnosis.magnitude == pytest.approx(1.0, abs=0.05)


def test_frames_are_not_compared_with_events_of_another_lens_by_a_scale(changed: Callable[[Change], Path]) -> None:
    """Frames are not resampled to events of another lens: not applicable, with the reason. Depth locates them."""
    path = changed(lambda attributes: None)
    with h5py.File(path, "r+") as file:
        without_lens(file["metadata/cameras/events"].attrs)
    result = run_check(path, "event_response.alignment")
    assert (result.outcome, "different lenses" in result.reason) == ("not_applicable", True)
    for name in ("alignment.events", "flow_events.sharpness"):
        assert run_check(path, name).outcome != "not_applicable"

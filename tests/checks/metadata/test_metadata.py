"""What the file declares: complete, labelled, and as its profile promises."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.causes import allowed
from fedora_qa.checks.metadata.units import label_agrees
from fedora_qa.layout.binding import Binding
from tests.support.checked import diagnoses_of, rules, run_check
from tests.support.foreign import write_mvsec, write_purdue_lab
from tests.support.handmade import write_handmade


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The handmade file, to be altered."""
    return write_handmade(tmp_path / "hand.h5")


@pytest.mark.parametrize("name", ["metadata.complete", "metadata.units", "metadata.cameras"])
def test_clean_file(path: Path, name: str) -> None:
    """The handmade file declares all that the format asks for, correctly."""
    result = run_check(path, name)
    assert result.outcome == "passed", result
    assert result.coverage is not None
    assert result.coverage.seen == result.coverage.of > 0


@pytest.mark.parametrize(
    ("owner", "name"),
    [("", "format_version"), ("metadata/events", "threshold_on"), ("metadata/cameras/depth", "K"),
     ("metadata/imu", "gravity"), ("metadata/flow", "unit")],
)  # fmt: skip
def test_missing_required_attribute(path: Path, owner: str, name: str) -> None:
    """A required attribute that is absent fails and is named."""
    with h5py.File(path, "r+") as file:
        del (file[owner] if owner else file).attrs[name]
    result = run_check(path, "metadata.complete")
    assert (result.outcome, rules(result)) == ("failed", ["missing"])
    assert name in result.findings[0].message
    (diagnosis,) = diagnoses_of(path, "metadata.complete")
    assert (diagnosis.cause, diagnosis.stream) == ("missing_stream", "metadata")


def test_malformed_required_attribute(path: Path) -> None:
    """A width that is text fails as a wrong type."""
    with h5py.File(path, "r+") as file:
        file["metadata/cameras/rgb"].attrs["width"] = "36"
    assert rules(run_check(path, "metadata.complete")) == ["malformed"]
    (diagnosis,) = diagnoses_of(path, "metadata.complete")
    assert (diagnosis.cause, diagnosis.stream) == ("wrong_dtype", "metadata")


def test_polarity_that_is_declared_the_other_way(path: Path) -> None:
    """The opposite of the only code is a fault of the polarities, if the declaration is true."""
    with h5py.File(path, "r+") as file:
        file["metadata/events"].attrs["polarity"] = "0 = brighter"
    assert rules(run_check(path, "metadata.complete")) == ["malformed"]
    (diagnosis,) = diagnoses_of(path, "metadata.complete")
    assert (diagnosis.cause, diagnosis.stream) == ("polarity_inverted", "events")


def test_malformed_optional_attribute_is_noted(path: Path) -> None:
    """An optional attribute that cannot be used is a warning."""
    with h5py.File(path, "r+") as file:
        file["metadata/events"].attrs["leak_rate_hz"] = "often"
    result = run_check(path, "metadata.complete")
    assert (result.outcome, rules(result)) == ("warned", ["malformed"])


def test_missing_group_is_noted(path: Path) -> None:
    """A group that is absent as a whole makes checks weaker: a warning."""
    with h5py.File(path, "r+") as file:
        del file["metadata/pose"]
    assert run_check(path, "metadata.complete").outcome == "warned"


def test_absent_stream_needs_no_declaration(path: Path) -> None:
    """Neither stream nor declaration: nothing to say."""
    with h5py.File(path, "r+") as file:
        del file["path/imu"], file["metadata/imu"]
    assert run_check(path, "metadata.complete").outcome == "passed"


def test_no_metadata_at_all(path: Path) -> None:
    """A canonical file without /metadata fails once."""
    with h5py.File(path, "r+") as file:
        del file["metadata"]
    (diagnosis,) = diagnoses_of(path, "metadata.complete")
    assert (diagnosis.cause, diagnosis.stream) == ("missing_stream", "metadata")


def test_motion_alone_needs_no_metadata(path: Path) -> None:
    """An imported trajectory declares nothing; its noise is measured."""
    with h5py.File(path, "r+") as file:
        del file["metadata"]
        for name in set(file["path"]) - {"pose"}:
            del file["path"][name]
    assert run_check(path, "metadata.complete").outcome == "warned"


def test_foreign_file_is_warned_not_failed(tmp_path: Path) -> None:
    """Files of other makers declare nothing in our words: weak tests, not failures."""
    path = write_purdue_lab(tmp_path / "lab.h5")
    assert run_check(path, "metadata.complete").outcome == "warned"
    assert run_check(path, "metadata.units").outcome == "not_applicable"
    assert run_check(path, "metadata.cameras").outcome == "not_applicable"


@pytest.mark.parametrize(
    ("key", "label", "cause", "magnitude"),
    [
        ("path/depth", "m", "unit_mm_m", 0.001),
        ("path/pose/position", "mm", "unit_mm_m", 1000.0),
        ("path/imu/angular_velocity", "deg/s", "unit_deg_rad", 180 / np.pi),
        ("path/events/t", "ns", "time_unit", 1000.0),
        ("path/imu/ts", "s", "time_unit", 1e-6),
        ("path/flow/10hz", "px/s", "flow_unit", None),
    ],
)
def test_contradicting_labels(path: Path, key: str, label: str, cause: str, magnitude: float | None) -> None:
    """A label of another unit fails, and what it would confess to is suspected (stored over canonical values)."""
    with h5py.File(path, "r+") as file:
        file[key].attrs["units"] = label
    result = run_check(path, "metadata.units")
    assert (result.outcome, rules(result)) == ("failed", ["label"])
    diagnosis = diagnoses_of(path, "metadata.units")[0]
    assert diagnosis.cause == cause
    assert diagnosis.magnitude == (None if magnitude is None else pytest.approx(magnitude))
    assert allowed(cause, diagnosis.stream)


@pytest.mark.parametrize(("key", "label"), [("path/events/t", "µs"), ("path/imu/linear_acceleration", "m/s2"),
                                            ("path/events/p", ""), ("path/events/x", "pixels")])  # fmt: skip
def test_spellings(path: Path, key: str, label: str) -> None:
    """Other spellings of the same unit agree."""
    with h5py.File(path, "r+") as file:
        file[key].attrs["units"] = label
    assert run_check(path, "metadata.units").outcome == "passed"


def test_missing_label_is_noted(path: Path) -> None:
    """A dataset without a label is a warning that names it, and the coverage counts it."""
    with h5py.File(path, "r+") as file:
        del file["path/depth"].attrs["units"]
    result = run_check(path, "metadata.units")
    assert (result.outcome, rules(result)) == ("warned", ["missing"])
    assert "path/depth" in result.findings[0].message
    assert result.coverage is not None
    assert result.coverage.seen == result.coverage.of - 1


def test_labels_are_held_to_the_dialect(tmp_path: Path) -> None:
    """In a dialect of seconds, a label of seconds is right and one of microseconds wrong."""
    path = write_mvsec(tmp_path / "mvsec.h5")
    with h5py.File(path, "r+") as file:
        file["davis/left/image_raw_ts"].attrs["units"] = "s"
    assert run_check(path, "metadata.units").outcome == "warned"
    with h5py.File(path, "r+") as file:
        file["davis/left/image_raw_ts"].attrs["units"] = "us"
    assert run_check(path, "metadata.units").outcome == "failed"


def test_label_of_scaled_values() -> None:
    """Values that are scaled on reading are labelled with the unit they are stored in."""
    metres = Binding("path/depth", "d", 1, (1, 2, 2), np.dtype(np.float32), scale=1000.0)
    assert label_agrees(metres, "m")
    assert not label_agrees(metres, "mm")
    assert not label_agrees(metres, "fathom")


def promise(file: h5py.File) -> None:
    """Declare the paper's profile and its numbers; the small images then break it."""
    file.attrs["profile"] = "fedora-paper"
    file["metadata/events"].attrs.update({"model": "linear", "threshold_on": 30.0, "threshold_off": 30.0,
                                          "packet_interval_us": 200})  # fmt: skip


def declare_paper_sizes(file: h5py.File) -> None:
    for name, width, height in (("rgb", 1440, 1080), ("depth", 1440, 1080), ("events", 640, 480)):
        focal = round(width / (2 * np.tan(np.pi / 6)), 4)
        attrs = file[f"metadata/cameras/{name}"].attrs
        attrs.update({"width": width, "height": height})
        attrs["K"] = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])


def test_profile_is_not_asked_of_others(path: Path) -> None:
    """Only files that promise the paper's numbers are held to them."""
    assert run_check(path, "metadata.profile").outcome == "not_applicable"


def test_profile_kept(path: Path) -> None:
    """A file with the paper's sizes, rates, range, threshold and packets keeps its promise."""
    with h5py.File(path, "r+") as file:
        promise(file)
        declare_paper_sizes(file)
    result = run_check(path, "metadata.profile")
    assert result.outcome == "passed", result.findings


def without_flow(file: h5py.File) -> None:
    del file["path/flow/25hz"], file["path/flow/25hz_ts"]


def threshold_of_20(file: h5py.File) -> None:
    file["metadata/events"].attrs["threshold_on"] = 20.0


def asynchronous(file: h5py.File) -> None:
    file["metadata/events"].attrs["packet_interval_us"] = 0


def logarithmic(file: h5py.File) -> None:
    file["metadata/events"].attrs["model"] = "log"


def imu_at_500_hz(file: h5py.File) -> None:
    for name in ("ts", "angular_velocity", "linear_acceleration"):
        values = file[f"path/imu/{name}"][::2]
        del file[f"path/imu/{name}"]
        file[f"path/imu/{name}"] = values


def wide_view(file: h5py.File) -> None:
    K = file["metadata/cameras/events"].attrs["K"]
    K[0, 0] = K[1, 1] = 320.0
    file["metadata/cameras/events"].attrs["K"] = K


def deep(file: h5py.File) -> None:
    file["metadata/depth_range"][1] = 60.0


@pytest.mark.parametrize(
    ("edit", "rule"),
    [(without_flow, "stream"), (threshold_of_20, "threshold_on"), (asynchronous, "packet_too_short"),
     (logarithmic, "model"), (imu_at_500_hz, "period"), (wide_view, "field_of_view"), (deep, "farthest")],
)  # fmt: skip
def test_profile_broken(path: Path, edit: Callable[[h5py.File], None], rule: str) -> None:
    """Each promise can be broken, and is then the one that is named."""
    with h5py.File(path, "r+") as file:
        promise(file)
        declare_paper_sizes(file)
        edit(file)
    assert rules(run_check(path, "metadata.profile")) == [rule]


def test_sizes_of_the_profile(path: Path) -> None:
    """Six declared sizes of the handmade file are not the paper's."""
    with h5py.File(path, "r+") as file:
        promise(file)
    assert sorted(rules(run_check(path, "metadata.profile"))) == ["height"] * 3 + ["width"] * 3


@pytest.mark.parametrize("bounds", [(30.0, 0.1), (-1.0, 30.0), (np.nan, 30.0), (5.0, 5.0)])
def test_an_impossible_range_fails(path: Path, bounds: tuple[float, float]) -> None:
    """A range that is inverted, empty, negative or NaN is a wrong declaration, although none need be made."""
    with h5py.File(path, "r+") as file:
        file["metadata/depth_range"][...] = bounds
    assert run_check(path, "metadata.complete").outcome == "failed"


@pytest.mark.parametrize("bounds", [(0.0, 30.0), (0.1, np.inf)])
def test_a_vague_range_is_noted(path: Path, bounds: tuple[float, float]) -> None:
    """A range from the camera on, or without an end, tells little and contradicts nothing."""
    with h5py.File(path, "r+") as file:
        file["metadata/depth_range"][...] = bounds
    assert run_check(path, "metadata.complete").outcome == "warned"


@pytest.mark.parametrize(("name", "value"), [("leak_rate_hz", -0.1), ("refractory_us", np.nan)])
def test_an_impossible_number_fails(path: Path, name: str, value: float) -> None:
    """A rate below zero is impossible, whether or not it has to be declared."""
    with h5py.File(path, "r+") as file:
        file["metadata/events"].attrs[name] = value
    assert run_check(path, "metadata.complete").outcome == "failed"


@pytest.mark.parametrize(
    ("owner", "name", "value"),
    [("metadata/cameras/rgb", "width", 36.0), ("metadata/events", "model", "LOG"), ("metadata/flow", "unit", "PX"),
     ("path/rgb", "transfer", "Linear"), ("", "format", "FEDORA")],
)  # fmt: skip
def test_another_form_of_a_declaration_is_noted(path: Path, owner: str, name: str, value: object) -> None:
    """A width as a float and a name in upper case mean what they mean."""
    with h5py.File(path, "r+") as file:
        (file[owner] if owner else file).attrs[name] = value
    result = run_check(path, "metadata.complete")
    assert (result.outcome, rules(result)) == ("warned", ["malformed"])
    assert repr(str(value)) in result.findings[0].message


@pytest.mark.parametrize("key", ["path/depth", "path/rgb_ts", "path/events/x", "path/imu/linear_acceleration"])
def test_labels_in_upper_case_are_noted(path: Path, key: str) -> None:
    """Case distinguishes no two units of the layout."""
    with h5py.File(path, "r+") as file:
        file[key].attrs["units"] = file[key].attrs["units"].upper()
    result = run_check(path, "metadata.units")
    assert (result.outcome, rules(result)) == ("warned", ["case"])


def test_another_unit_in_upper_case_is_still_another(path: Path) -> None:
    """Depth that is labelled M is labelled in metres."""
    with h5py.File(path, "r+") as file:
        file["path/depth"].attrs["units"] = "M"
    assert run_check(path, "metadata.units").outcome == "failed"


@pytest.mark.parametrize(
    ("sequence", "world", "illumination", "contradicts"),
    [
        ("park-day", "park", "night", True),
        ("baylands-ngt1", "baylands", "day", True),
        ("one", "city at night", "Day", True),
        ("park-night", "park by day", "", True),
        ("park-night", "park", "night", False),
        ("Baylands Day1", "baylands", "day", False),
        ("holiday", "sundayton", "night", False),
        ("day-and-night", "knights", "night", False),
        ("park-day", "park", "overcast", False),
        ("park-day", "racetrack", "day", True),
        ("Racetrack Day", "baylands", "day", True),
        ("racetrack-day", "speedway", "day", False),
        ("baylands-day1", "park", "day", False),
        ("parking-lot", "racetrack", "day", False),
        ("park-beside-racetrack", "racetrack", "day", False),
        ("hover", "park", "day", False),
    ],
)
def test_a_light_or_a_place_that_contradicts_the_name(
    path: Path, sequence: str, world: str, illumination: str, contradicts: bool
) -> None:
    """A sequence that is named after the day, or a park, is not one of the night, or a racetrack; whole words count."""
    with h5py.File(path, "r+") as file:
        file.attrs.update({"sequence": sequence, "world": world, "illumination": illumination})
    result = run_check(path, "metadata.complete")
    assert (result.outcome, rules(result)) == (("warned", ["contradiction"]) if contradicts else ("passed", []))


@pytest.mark.parametrize(
    ("model", "noted"), [("pinhole", []), ("PinHole", ["malformed"]), ("fisheye", ["camera_model"]), ("unknown", [])]
)
def test_a_camera_model_that_nothing_projects_by_is_noted(path: Path, model: str, noted: list[str]) -> None:
    """What that camera images is compared with no other stream; an uncalibrated one says so itself."""
    with h5py.File(path, "r+") as file:
        file["metadata/cameras/rgb"].attrs["camera_model"] = model
    result = run_check(path, "metadata.complete")
    assert (result.outcome, rules(result)) == ("warned" if noted else "passed", noted)

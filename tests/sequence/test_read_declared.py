"""Declarations are read as typed values; whatever cannot be used is a problem, never an exception."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fedora_qa.causes import allowed
from fedora_qa.layout.canonical import ATTRIBUTES, AttributeSpec
from fedora_qa.layout.resolve import resolve
from fedora_qa.sequence.attributes import ImpossibleError, MalformedError, read_attribute
from fedora_qa.sequence.declared import Declared, Lens
from fedora_qa.sequence.read_declared import read_declared
from tests.support.handmade import write_handmade


@pytest.fixture
def file(tmp_path: Path) -> Iterator[h5py.File]:
    """The handmade file, open for changes."""
    with h5py.File(write_handmade(tmp_path / "hand.h5"), "r+") as opened:
        yield opened


def declared_in(file: h5py.File) -> Declared:
    declared = read_declared(file, resolve(file))
    assert all(allowed(problem.cause, problem.stream) for problem in declared.problems)
    return declared


def test_handmade_file(file: h5py.File) -> None:
    """Every declaration of the file written by hand comes out as it went in."""
    declared = declared_in(file)
    assert declared.problems == ()
    assert set(declared.cameras) == {"rgb", "depth", "events"}
    events = declared.cameras["events"]
    assert (events.width, events.height, events.model, events.exposure_us) == (16, 12, "pinhole", 0.0)
    assert events.K[0, 0] == pytest.approx(8 / np.tan(np.pi / 6))
    assert declared.events is not None
    assert (declared.events.model, declared.events.threshold_on) == ("log", 0.2)
    assert (declared.events.shot_rate_hz, declared.events.hot_pixels) == (4.0, ())
    assert declared.imu is not None
    assert (declared.imu.gravity, declared.imu.sampling) == (9.81, "instant")
    assert declared.pose is not None
    assert declared.flow_model == "rigid"
    assert declared.depth_range_m == (0.1, 30.0)
    assert declared.transfer == "linear"
    assert declared.profile is None
    assert declared.units["path/depth"] == "mm"


def test_hot_pixels(file: h5py.File) -> None:
    """Hot pixels are columns and rows."""
    file["metadata/events"].attrs["hot_pixels"] = np.array([[3, 4], [5, 6]])
    events = declared_in(file).events
    assert events is not None
    assert events.hot_pixels == ((3, 4), (5, 6))


def test_bytes_and_arrays_of_one_are_read(file: h5py.File) -> None:
    """Text as bytes and scalars as arrays of one, as other languages write them, are what they say."""
    file["metadata/events"].attrs["model"] = np.bytes_(b"linear")
    file["metadata/imu"].attrs["gravity"] = np.array([9.8])
    declared = declared_in(file)
    assert declared.problems == ()
    assert declared.events is not None
    assert declared.events.model == "linear"
    assert declared.imu is not None
    assert declared.imu.gravity == 9.8


@pytest.mark.parametrize(
    ("owner", "name", "value", "cause"),
    [
        ("", "format_version", "2.0", "unknown"),
        ("metadata/cameras/rgb", "width", "36", "wrong_dtype"),
        ("metadata/cameras/rgb", "width", 36.5, "wrong_dtype"),
        ("metadata/cameras/rgb", "width", 0, "wrong_shape"),
        ("metadata/cameras/rgb", "K", np.ones(9), "wrong_shape"),
        ("metadata/cameras/rgb", "K", np.full((3, 3), np.nan), "nan_in_stream"),
        ("metadata/cameras/rgb", "T_body_camera", np.eye(3), "wrong_shape"),
        ("metadata/events", "model", "cubic", "unknown"),
        ("metadata/events", "model", 3, "wrong_dtype"),
        ("metadata/events", "threshold_on", np.nan, "nan_in_stream"),
        ("metadata/events", "threshold_on", -0.2, "threshold_misdeclared"),
        ("metadata/events", "hot_pixels", np.ones((2, 3), dtype=int), "wrong_shape"),
        ("metadata/imu", "gravity", [9.8, 9.8], "wrong_dtype"),
        ("metadata/imu", "gravity", [0.0, 0.0, -9.8], "gravity_magnitude"),
        ("metadata/imu", "gravity", -9.80665, "gravity_magnitude"),
        ("metadata/imu", "gyro_noise_density", -1e-3, "noise_misdeclared"),
        ("metadata/pose", "position_sigma", -1.0, "noise_misdeclared"),
        ("metadata/flow", "unit", "px/s", "flow_unit"),
        ("metadata/flow", "unit", "pixels", "unknown"),
        ("path/rgb", "transfer", "log", "unknown"),
    ],
)
def test_malformed(file: h5py.File, owner: str, name: str, value: Any, cause: str) -> None:
    """One malformed attribute is one problem, which names it."""
    (file[owner] if owner else file).attrs[name] = value
    (problem,) = declared_in(file).problems
    assert (problem.owner, problem.name) == (owner, name)
    assert problem.cause == cause


@pytest.mark.parametrize(
    ("model", "coefficients", "lens"),
    [
        ("radtan", [-0.3, 0.1, 1e-4, 2e-4], Lens("radtan", (-0.3, 0.1, 1e-4, 2e-4))),
        ("radtan", [-0.3, 0.1, 1e-4, 2e-4, 0.01], Lens("radtan", (-0.3, 0.1, 1e-4, 2e-4, 0.01))),
        ("Equidistant", [[0.1], [0.0], [0.0], [0.0]], Lens("equidistant", (0.1, 0.0, 0.0, 0.0))),
        ("equidistant", [0.0] * 4, Lens("equidistant", (0.0,) * 4)),
        ("radtan", [0.0] * 4, None),
        ("none", [0.0] * 5, None),
        ("none", None, None),
    ],
)
def test_lenses(file: h5py.File, model: str, coefficients: Any, lens: Lens | None) -> None:
    """Coefficients in OpenCV's order, as a list or a column; without distortion the camera is a pinhole."""
    attributes = file["metadata/cameras/depth"].attrs
    attributes["distortion_model"] = model
    if coefficients is not None:
        attributes["distortion"] = coefficients
    declared = declared_in(file)
    assert declared.cameras["depth"].lens == lens
    assert [problem for problem in declared.problems if not problem.usable] == []


@pytest.mark.parametrize(
    ("attributes", "name", "text"),
    [
        ({"distortion_model": "division", "distortion": [0.1]}, "distortion_model", "Expected 'none' or 'radtan'"),
        ({"distortion_model": "radtan", "distortion": [-0.3, 0.1]}, "distortion", "4 or 5 coefficients of the radtan"),
        ({"distortion_model": "equidistant"}, "distortion", "4 coefficients of the equidistant"),
        ({"distortion": [-0.3, 0.1, 0.0, 0.0]}, "distortion", "without distortion_model, got 4; declare"),
        ({"distortion_model": "radtan", "distortion": [np.nan] * 4}, "distortion", "Expected finite"),
        ({"distortion_model": "radtan", "distortion": "0.1"}, "distortion", "Expected a list of numbers"),
        ({"distortion_model": "radtan", "distortion": np.zeros((2, 2))}, "distortion", "Expected a list"),
    ],
)
def test_a_lens_that_is_not_known_is_no_pinhole(
    file: h5py.File, attributes: dict[str, Any], name: str, text: str
) -> None:
    """One problem says what is expected; nothing is projected through a camera of an unknown lens."""
    for key, value in attributes.items():
        file["metadata/cameras/depth"].attrs[key] = value
    declared = declared_in(file)
    (problem,) = declared.problems
    assert (problem.owner, problem.name) == ("metadata/cameras/depth", name)
    assert text in problem.message
    assert set(declared.cameras) == {"rgb", "events"}


def test_camera_without_k_is_not_declared(file: h5py.File) -> None:
    """A camera that misses what the format requires is None for who needs it, and named."""
    del file["metadata/cameras/depth"].attrs["K"]
    declared = declared_in(file)
    assert set(declared.cameras) == {"rgb", "events"}
    assert [(problem.owner, problem.name) for problem in declared.problems] == [("metadata/cameras/depth", "K")]


def test_missing_group_is_one_problem(file: h5py.File) -> None:
    """A group that is absent is named once, not once an attribute."""
    del file["metadata/imu"]
    declared = declared_in(file)
    assert declared.imu is None
    assert [(problem.owner, problem.name) for problem in declared.problems] == [("metadata/imu", "")]


def test_dataset_in_place_of_a_group(file: h5py.File) -> None:
    """A dataset where a group of attributes belongs carries none of them."""
    del file["metadata/pose"]
    file["metadata/pose"] = [1, 2]
    assert {problem.name for problem in declared_in(file).problems} == {"position_sigma", "rotation_sigma"}


@pytest.mark.parametrize("bounds", [(0.0, 30.0), (30.0, 0.1), (np.nan, 3.0), (0.1, np.inf), (1e-9, 30.0), (0.1, 1e20)])
def test_impossible_depth_range(file: h5py.File, bounds: tuple[float, float]) -> None:
    """A range that is empty, reaches zero, does not end or ends beyond the Earth is no range."""
    file["metadata/depth_range"][...] = bounds
    declared = declared_in(file)
    assert declared.depth_range_m is None
    assert [problem.name for problem in declared.problems] == ["depth_range"]


def test_external_group_is_not_followed(file: h5py.File) -> None:
    """Declarations are not taken from another file."""
    del file["metadata/imu"]
    file["metadata/imu"] = h5py.ExternalLink("other.h5", "/")
    assert any("other.h5" in problem.message for problem in declared_in(file).problems)


ANY_VALUE = st.one_of(
    st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=8),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.booleans(),
    hnp.arrays(
        st.sampled_from([np.float32, np.float64, np.int64, np.uint8, np.bool_]),
        hnp.array_shapes(max_dims=3, max_side=4, min_side=0),
    ),
)


def read_or_refuse(file: h5py.File, spec: AttributeSpec) -> Any:
    try:
        return read_attribute(file, spec)
    except MalformedError as malformed:
        return malformed


@given(spec=st.sampled_from(list(ATTRIBUTES.values())), value=ANY_VALUE)
def test_any_value_is_read_or_malformed(spec: AttributeSpec, value: Any) -> None:
    """Whatever an attribute holds, it is a value of the right kind, or malformed for a cause that metadata can have."""
    with h5py.File("any.h5", "w", driver="core", backing_store=False) as file:
        file.attrs[spec.name] = value
        read = read_or_refuse(file, spec)
    if isinstance(read, MalformedError):
        assert str(read).startswith("Expected")
        assert allowed(read.cause, read.stream)
        return
    assert isinstance(
        read, {"text": str, "int": int, "float": float, "pixels": tuple, "numbers": tuple}.get(spec.kind, np.ndarray)
    )
    assert not spec.choices or spec.is_open or read in spec.choices


@pytest.mark.parametrize(
    ("stored", "read"),
    [("Pinhole", "pinhole"), (" PINHOLE", "pinhole"), ("fisheye", "fisheye"), ("unknown", "unknown")],
)
def test_camera_models_are_read_in_any_case_and_others_are_kept(stored: str, read: str) -> None:
    """A name that is not quite that of the pinhole left a camera out of all checks, without a word."""
    spec = ATTRIBUTES["metadata/cameras/rgb", "camera_model"]
    with h5py.File("any.h5", "w", driver="core", backing_store=False) as file:
        file.attrs["camera_model"] = stored
        assert read_or_refuse(file, spec) == read


@pytest.mark.parametrize("value", [255.5, 1e9])
def test_no_change_of_light_reaches_such_a_threshold(value: float) -> None:
    spec = ATTRIBUTES["metadata/events", "threshold_on"]
    with h5py.File("any.h5", "w", driver="core", backing_store=False) as file:
        file.attrs["threshold_on"] = value
        refused = read_or_refuse(file, spec)
    assert isinstance(refused, ImpossibleError)
    assert (refused.cause, refused.stream) == ("threshold_misdeclared", "events")


def ragged(file: h5py.File, holder: h5py.HLObject, name: str) -> None:
    values = np.empty(1, dtype=object)
    values[0] = np.array([1, 2])
    holder.attrs.create(name, values, dtype=h5py.vlen_dtype(np.int64))


def reference(file: h5py.File, holder: h5py.HLObject, name: str) -> None:
    holder.attrs[name] = file["path"].ref


def compound(file: h5py.File, holder: h5py.HLObject, name: str) -> None:
    holder.attrs[name] = np.zeros(1, dtype=[("a", "i8")])


@pytest.mark.parametrize("write", [ragged, reference, compound])
def test_types_of_no_attribute_are_never_read(
    file: h5py.File, write: Callable[[h5py.File, h5py.HLObject, str], None]
) -> None:
    """Ragged arrays, references and compounds are malformed before a single value of them is read."""
    del file["metadata/events"].attrs["model"], file["path/depth"].attrs["units"]
    write(file, file["metadata/events"], "model")
    write(file, file["path/depth"], "units")
    declared = declared_in(file)
    (problem,) = declared.problems
    assert problem.name == "model"
    assert "neither numbers nor text" in problem.message
    assert "path/depth" not in declared.units

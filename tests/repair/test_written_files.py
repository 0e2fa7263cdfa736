"""A repaired file holds what the clean one held, dataset for dataset, and all else as it was, byte for byte."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_generator.faults.plant import plant_fault
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.declarations import NoiseMisdeclared
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.faults.gravity import ForceSign, GravityAlongBody
from fedora_qa.faults.images import TransferMisdeclared
from fedora_qa.faults.index_maps import IndexSide
from fedora_qa.faults.intrinsic_units import NormalisedIntrinsics
from fedora_qa.faults.intrinsics import IntrinsicsOfAnotherImage, PrincipalPointFromMiddle, TransposedIntrinsics
from fedora_qa.faults.motion import AngleOrder, AngleSense, PoseInversion
from fedora_qa.faults.mountings import InvertedMounting, MountingUnit
from fedora_qa.faults.name_order import FramesInOrderOfNames
from fedora_qa.faults.row_order import DuplicatedSamples, RotatedFrames, SwappedFrames, Unsorted
from fedora_qa.faults.sorted_clock import ClockSetBackAndSorted
from fedora_qa.faults.table import FAULTS, WithoutInverse
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.repairs.mechanical import MECHANICAL, why_not_mechanical
from fedora_qa.repairs.repair import repair
from fedora_qa.repairs.result import Repair
from fedora_qa.sequence.sequence import open_sequence
from tests.faults.test_undo_generated import CASES, Case, noise_too_large
from tests.support.memory_sequence import facts_of
from tests.support.repairs import given_check


@pytest.fixture(scope="module")
def clean(tiny_park_day: Path) -> Path:
    """A small clean file."""
    return tiny_park_day


def repaired(source: Path, *faults: ReversibleFault, target: Path | None = None) -> Repair:
    """Repair a file whose faults are given, without measuring."""
    target = target or source.with_name("repaired.h5")
    return repair(source, target, CheckOptions(), quiet, check=given_check(source, *faults))


def contents(path: Path) -> dict[str, Any]:
    """Every dataset and attribute of a file but its provenance, by path."""
    values: dict[str, Any] = {}

    def note(name: str, member: h5py.Group | h5py.Dataset) -> None:
        if name.startswith("provenance"):
            return
        values.update({f"{name}.{attribute}": member.attrs[attribute] for attribute in member.attrs})
        if isinstance(member, h5py.Dataset):
            values[name] = member[()]

    with h5py.File(path) as file:
        values.update({f".{attribute}": file.attrs[attribute] for attribute in file.attrs})
        file.visititems(note)
    return values


def require_equal(path: Path, clean: Path, tolerance: float = 0.0) -> None:
    """Fail unless two files hold the same: exactly, or floating-point values and timestamps within a tolerance."""
    actual, expected = contents(path), contents(clean)
    assert actual.keys() == expected.keys()
    for name, true in expected.items():
        if isinstance(true, str | bytes):
            assert actual[name] == true, name
            continue
        stored, value = np.asarray(actual[name]), np.asarray(true)
        assert (stored.shape, stored.dtype) == (value.shape, value.dtype), name
        spec = DATASETS.get(name)
        if name == "path/pose/orientation":
            stored = stored * np.sign(np.sum(stored * value, axis=1, keepdims=True))
        if spec and spec.is_timestamps:
            # Timestamps are microseconds, the tolerance nanoseconds.
            np.testing.assert_allclose(stored, value, rtol=0, atol=tolerance / 1000, err_msg=name)
        elif value.dtype.kind == "f" and "." in name:
            # An attribute, whose change was multiplied and divided, or turned there and back.
            np.testing.assert_allclose(stored, value, rtol=1e-12, atol=1e-15, err_msg=name)
        elif value.dtype.kind == "f" and tolerance:
            np.testing.assert_allclose(stored, value, rtol=0, atol=tolerance, err_msg=name)
        else:
            np.testing.assert_array_equal(stored, value, err_msg=name)


MECHANICAL_CASES = [case for case in CASES if not why_not_mechanical(case.undoing)]


@pytest.mark.parametrize("case", MECHANICAL_CASES, ids=str)
def test_repaired_file_is_the_clean_one(case: Case, clean: Path, tmp_path: Path) -> None:
    """The generator planted the fault, by code of its own."""
    faulty = tmp_path / "faulty.h5"
    plant_fault(clean, faulty, case.cause, case.stream, case.magnitude, case.unit)
    before = faulty.read_bytes()
    result = repaired(faulty, case.undoing)
    assert not result.refusal
    require_equal(tmp_path / "repaired.h5", clean, case.tolerance)
    assert faulty.read_bytes() == before


def test_every_fault_that_can_be_undone_is_mechanical_or_not_for_a_reason() -> None:
    """The table is complete, and holds nothing else; each mechanical one has a case."""
    classes = {each for entry in FAULTS.values() if not isinstance(entry, WithoutInverse) for each in entry}
    assert set(MECHANICAL) == classes
    # Tests of their own: below, and in ``test_repair``.
    beside = {ClockSetBackAndSorted, SwappedFrames, RotatedFrames, FramesInOrderOfNames, TransferMisdeclared, IndexSide,
              NoiseMisdeclared, PoseInversion, MountingUnit, AngleOrder, AngleSense, ForceSign, GravityAlongBody,
              TransposedIntrinsics, PrincipalPointFromMiddle, NormalisedIntrinsics, IntrinsicsOfAnotherImage,
              InvertedMounting}  # fmt: skip
    mechanical = {each for each in MECHANICAL if MECHANICAL[each] == "" or callable(MECHANICAL[each])}
    assert mechanical == {type(case.undoing) for case in MECHANICAL_CASES} | beside


def test_angles_are_combined_in_their_order_again(clean: Path, tmp_path: Path) -> None:
    """Orientations whose angles of ``ZYX`` were applied as ``XYZ``, by scipy."""
    faulty = tmp_path / "faulty.h5"
    faulty.write_bytes(clean.read_bytes())
    with h5py.File(faulty, "r+") as file:
        angles = Rotation.from_quat(file["path/pose/orientation"][()]).as_euler("ZYX")
        file["path/pose/orientation"][...] = Rotation.from_euler("XYZ", angles[:, ::-1]).as_quat()
    assert not repaired(faulty, AngleOrder()).refusal
    require_equal(tmp_path / "repaired.h5", clean, 1e-12)


def test_yaw_counts_to_the_left_again(clean: Path, tmp_path: Path) -> None:
    """Yaw was counted clockwise from north, by scipy."""
    faulty = tmp_path / "faulty.h5"
    faulty.write_bytes(clean.read_bytes())
    with h5py.File(faulty, "r+") as file:
        yaw, pitch, roll = Rotation.from_quat(file["path/pose/orientation"][()]).as_euler("ZYX").T
        angles = np.stack((np.pi / 2 - yaw, pitch, roll), axis=1)
        file["path/pose/orientation"][...] = Rotation.from_euler("ZYX", angles).as_quat()
    assert not repaired(faulty, AngleSense((-1, 1, 1), ((0, -1, 0), (1, 0, 0), (0, 0, 1)))).refusal
    require_equal(tmp_path / "repaired.h5", clean, 1e-12)


@pytest.mark.parametrize(("sign", "upward", "fault"), [(-1, 0, ForceSign()), (1, -1, GravityAlongBody())])
def test_specific_forces_are_those_of_the_format_again(
    sign: int, upward: int, fault: ReversibleFault, clean: Path, tmp_path: Path
) -> None:
    """Their sign was reversed, or gravity was subtracted along the body."""
    faulty = tmp_path / "faulty.h5"
    faulty.write_bytes(clean.read_bytes())
    with h5py.File(faulty, "r+") as file:
        gravity = float(file["metadata/imu"].attrs["gravity"])
        forces = file["path/imu/linear_acceleration"]
        forces[...] = sign * forces[()] + [0.0, 0.0, upward * gravity]
    assert not repaired(faulty, fault).refusal
    require_equal(tmp_path / "repaired.h5", clean, 1e-12)


@pytest.mark.parametrize(
    ("cause", "magnitude", "fault"),
    [
        ("time_offset", 3.0, ClockShift("events", 3_000_000)),
        ("unsorted", 20, Unsorted("events", 0, 20)),
        ("duplicated_samples", 5.0, DuplicatedSamples("events")),
    ],
)
def test_milliseconds_follow_the_repaired_events(
    cause: str, magnitude: float, fault: ReversibleFault, clean: Path, tmp_path: Path
) -> None:
    """A recorder made the map from the faulty events: the repaired file has that of the clean ones."""
    mapped, faulty = tmp_path / "mapped.h5", tmp_path / "faulty.h5"
    mapped.write_bytes(clean.read_bytes())
    with h5py.File(mapped, "r+") as file:
        instants_us = np.arange(0, int(file["path/events/t"][-1]), 1000)
        file["metadata/ms_to_event"] = np.searchsorted(file["path/events/t"][()], instants_us)
    plant_fault(mapped, faulty, cause, "events", magnitude)
    with h5py.File(faulty, "r+") as file:
        times_us = np.sort(file["path/events/t"][()])
        file["metadata/ms_to_event"][...] = np.searchsorted(times_us, instants_us)
    assert not repaired(faulty, fault).refusal
    require_equal(tmp_path / "repaired.h5", mapped)


def test_exchanged_frames_return(clean: Path, tmp_path: Path) -> None:
    """Only both frames are altered."""
    faulty = tmp_path / "faulty.h5"
    faulty.write_bytes(clean.read_bytes())
    with h5py.File(faulty, "r+") as file:
        file["path/depth"][3], file["path/depth"][5] = file["path/depth"][5], file["path/depth"][3]
    result = repaired(faulty, SwappedFrames("depth", ((3, 5),)))
    assert [(each.path, each.rows) for each in result.datasets] == [("path/depth", 2)]
    require_equal(tmp_path / "repaired.h5", clean)


def test_frames_of_a_ring_return_to_their_order(clean: Path, tmp_path: Path) -> None:
    """The ring was read from its second frame on."""
    faulty = tmp_path / "faulty.h5"
    faulty.write_bytes(clean.read_bytes())
    with h5py.File(faulty, "r+") as file:
        file["path/depth"][3:6] = file["path/depth"][()][[4, 5, 3]]
    result = repaired(faulty, RotatedFrames("depth", (3, 6), -1))
    assert [(each.path, each.rows) for each in result.datasets] == [("path/depth", 3)]
    require_equal(tmp_path / "repaired.h5", clean)


def test_indices_point_to_the_first_of_equal_timestamps(clean: Path, tmp_path: Path) -> None:
    """Two events have the timestamp of a frame."""
    tied, faulty = tmp_path / "tied.h5", tmp_path / "faulty.h5"
    tied.write_bytes(clean.read_bytes())
    with h5py.File(tied, "r+") as file:
        index = int(file["metadata/rgb_to_event"][5])
        file["path/events/t"][index : index + 2] = file["path/rgb_ts"][5]
    faulty.write_bytes(tied.read_bytes())
    with h5py.File(faulty, "r+") as file:
        file["metadata/rgb_to_event"][5] += 2
    assert not repaired(faulty, IndexSide("rgb_to_event")).refusal
    require_equal(tmp_path / "repaired.h5", tied)


def test_the_transfer_curve_is_declared(clean: Path, tmp_path: Path) -> None:
    """An attribute of the frames, of which no value changes."""
    faulty, true = tmp_path / "faulty.h5", tmp_path / "true.h5"
    for path, curve in ((faulty, "linear"), (true, "srgb")):
        path.write_bytes(clean.read_bytes())
        with h5py.File(path, "r+") as file:
            file["path/rgb"].attrs["transfer"] = curve
    result = repaired(faulty, TransferMisdeclared("srgb", "linear"))
    assert (result.datasets, result.attributes) == ((), ("path/rgb.transfer = srgb",))
    require_equal(tmp_path / "repaired.h5", true)


def test_matrices_of_cameras_are_declared(clean: Path, tmp_path: Path) -> None:
    """K is transposed back, has its centre or is in pixels, and mountings are in metres or inverted back."""

    def moved(K: np.ndarray, camera: h5py.Group) -> np.ndarray:
        K[:2, 2] -= (camera.attrs["width"] - 1) / 2, (camera.attrs["height"] - 1) / 2
        return K

    def of_projection(K: np.ndarray, camera: h5py.Group) -> np.ndarray:
        sides = camera.attrs["width"], camera.attrs["height"]
        (fx, fy), (right, down) = K[[0, 1], [0, 1]] / sides, (2 * K[:2, 2] + 1) / sides - 1
        return np.array([[2 * fx, 0, right], [0, 2 * fy, down], [0, 0, -1.00002]])

    def in_mm(T: np.ndarray, _: h5py.Group) -> np.ndarray:
        T[:3, 3] *= 1000.0
        return T

    def names(path: Path) -> tuple[str, ...]:
        with h5py.File(path) as file:
            return tuple(file["metadata/cameras"])

    for fault, attribute, change in (
        (TransposedIntrinsics(), "K", lambda K, _: np.ascontiguousarray(K.T)),
        (PrincipalPointFromMiddle(names(clean)), "K", moved),
        (NormalisedIntrinsics("halves", names(clean), 0.0), "K", of_projection),
        (MountingUnit(1000.0), "T_body_camera", in_mm),
        (InvertedMounting(), "T_body_camera", lambda T, _: np.linalg.inv(T)),
    ):
        faulty = tmp_path / "faulty.h5"
        faulty.write_bytes(clean.read_bytes())
        with h5py.File(faulty, "r+") as file:
            for camera in file["metadata/cameras"].values():
                camera.attrs[attribute] = change(np.array(camera.attrs[attribute]), camera)
        assert not repaired(faulty, fault).refusal
        require_equal(tmp_path / "repaired.h5", clean)
        (tmp_path / "repaired.h5").unlink()


@pytest.mark.parametrize("stream", ["imu", "pose", "events"])
def test_noise_is_declared(stream: str, tiny_park_noisy: Path, tmp_path: Path) -> None:
    """Each noise by its own attribute."""
    faulty = tmp_path / "faulty.h5"
    with open_sequence(tiny_park_noisy) as sequence:
        fault = noise_too_large(facts_of(sequence), stream, 40.0)
    plant_fault(tiny_park_noisy, faulty, "noise_misdeclared", stream, 40.0)
    assert not repaired(faulty, fault).refusal
    require_equal(tmp_path / "repaired.h5", tiny_park_noisy)

"""Undoing a fault of a generated file gives the rows of the clean file; the generator's code of faults is its own."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_generator.faults.plant import plant_fault
from fedora_qa.causes import stream_family
from fedora_qa.conventions import NS_PER_US
from fedora_qa.faults.axes import VectorAxes
from fedora_qa.faults.clocks import ClockRate, ClockShift, TimeUnit
from fedora_qa.faults.declarations import (
    EventModelMisdeclared,
    GravityMisdeclared,
    NoiseMisdeclared,
    ThresholdMisdeclared,
)
from fedora_qa.faults.fault import FaultySequence, ReversibleFault
from fedora_qa.faults.flow import FlowIntervalShift
from fedora_qa.faults.gravity import GravityError
from fedora_qa.faults.images import ChannelOrder, ExposureGain, InvalidCode, PowerCurve, RayLength, Vignetting
from fedora_qa.faults.index_maps import IndexShift, IndexSide
from fedora_qa.faults.intrinsics import FocalLength, PrincipalPointShift
from fedora_qa.faults.motion import (
    AccelBias,
    GyroBias,
    PoseLeverArm,
    QuaternionInversion,
    QuaternionLength,
    QuaternionOrder,
    Teleport,
)
from fedora_qa.faults.mountings import CameraAxes, MountingLeverArm, MountingRotation
from fedora_qa.faults.pixels import Mirroring, PixelShift, PolarityInversion, SwappedPixelAxes
from fedora_qa.faults.row_order import DuplicatedSamples, SwappedFrames, Unsorted
from fedora_qa.faults.units import AngleUnit, FlowGain, FlowSign, FlowUnit, LengthUnit
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import Sequence, SequenceRows, open_sequence
from tests.faults.test_round_trips import compare_declared
from tests.support.memory_sequence import MS, all_rows, facts_of

Rows = dict[str, NDArray[Any]]
XY: Any = ((0, 1, 0), (1, 0, 0), (0, 0, 1))
FORWARD_RIGHT_DOWN: Any = ((1, 0, 0), (0, -1, 0), (0, 0, -1))
NORTH_EAST_DOWN: Any = ((0, 1, 0), (1, 0, 0), (0, 0, -1))
NOISES = {
    "imu": ("gyro_noise_density", "accel_noise_density", "gyro_bias_walk", "accel_bias_walk"),
    "pose": ("position_sigma_m", "rotation_sigma_rad"),
    "events": ("threshold_sigma", "leak_rate_hz", "shot_rate_hz", "hot_pixel_rate_hz"),
}
"""Declared noises, by stream: fields of ``ImuModel``, ``PoseModel`` and ``EventModel``."""


@dataclass(frozen=True)
class Case:
    """A fault of the generator, what undoes it, and by how much the rows may differ from the clean ones.

    ``tolerance`` is absolute, in the unit of the stream (ns of timestamps); ``lost`` is the share of values that may be
    NaN, or of colour that may differ, because the faulty file does not hold them.
    """

    cause: str
    stream: str
    magnitude: float | None
    undoing: ReversibleFault
    tolerance: float = 0.0
    lost: float = 0.0
    unit: str | None = None

    def __str__(self) -> str:
        return f"{self.stream}-{self.cause}"


TIMED = ("rgb", "depth", "events", "imu", "pose", "flow")
CASES = [
    *(Case("time_offset", stream, 7.0, ClockShift(stream, 7 * MS)) for stream in TIMED),
    *(Case("time_offset", stream, -7.0, ClockShift(stream, -7 * MS)) for stream in ("imu", "events")),
    # The planted rate is rounded to a microsecond.
    *(Case("clock_rate", stream, 800.0, ClockRate(stream, 800.0), NS_PER_US) for stream in TIMED if stream != "events"),
    *(Case("time_unit", stream, 1000.0, TimeUnit(stream, 1000)) for stream in TIMED),
    Case("time_unit", "imu", 0.001, TimeUnit("imu", 0.001), MS / 2),
    *(Case("unsorted", stream, 3, Unsorted(stream, 0, 3)) for stream in (*TIMED[:5], "flow/50hz")),
    *(Case("duplicated_samples", stream, 2, DuplicatedSamples(stream)) for stream in TIMED if stream != "events"),
    Case("duplicated_samples", "events", 5.0, DuplicatedSamples("events")),
    *(Case("index_off_by_one", f"{frames}_to_event", 1, IndexShift(f"{frames}_to_event", 1)) for frames in TIMED[:2]),
    Case("polarity_inverted", "events", None, PolarityInversion()),
    Case("axes_swapped", "events", None, SwappedPixelAxes("events")),
    Case("axes_swapped", "flow", None, SwappedPixelAxes("flow")),
    Case("axes_swapped", "imu", None, VectorAxes("imu", XY, cause="axes_swapped")),
    Case("axes_swapped", "pose", None, VectorAxes("pose", XY, turns_orientations=False, cause="axes_swapped")),
    *(Case("mirrored", stream, None, Mirroring(stream)) for stream in ("events", "rgb", "depth", "flow")),
    *(Case("spatial_offset", stream, 3, PixelShift(stream, 3), lost=0.05) for stream in ("rgb", "depth", "flow")),
    Case("threshold_misdeclared", "events", 20.0, ThresholdMisdeclared(20, 20)),
    Case("event_model_misdeclared", "events", None, EventModelMisdeclared()),
    Case("unit_mm_m", "depth", 0.001, LengthUnit("depth", 0.001), 30_000 * 2.0**-23),
    Case("unit_mm_m", "pose", 1000.0, LengthUnit("pose", 1000), 1e-12),
    Case("unit_deg_rad", "imu", None, AngleUnit(180 / np.pi), 1e-14),
    Case("flow_unit", "flow", 1.0, FlowUnit("flow", "px/s"), 100 * 2.0**-22),
    Case("flow_unit", "flow", -1.0, FlowUnit("flow", "px s"), 100 * 2.0**-22),
    Case("flow_sign", "flow", None, FlowSign()),
    Case("flow_gain", "flow", 5.0, FlowGain("flow", 5), 100 * 2.0**-22),
    Case("flow_interval_shifted", "flow/50hz", 1, FlowIntervalShift("flow/50hz", 1), lost=0.1),
    # The generator interpolates by other splines; both agree at the stamps of poses, where intervals begin and end.
    Case("intrinsics_focal", "flow", 5.0, FocalLength("flow", 5), 1e-4),
    Case("intrinsics_centre", "flow", 3.0, PrincipalPointShift("flow", 3), 1e-4),
    Case("extrinsic_rotation", "flow", 2.0, MountingRotation("flow", (0, 0, 2)), 1e-4),
    Case("intrinsics_focal", "metadata", 5.0, FocalLength("metadata", 5)),
    Case("intrinsics_centre", "metadata", 3.0, PrincipalPointShift("metadata", 3)),
    Case("extrinsic_rotation", "metadata", 2.0, MountingRotation("metadata", (0, 0, 2))),
    Case("lever_arm", "metadata", 0.2, MountingLeverArm((0.2, 0, 0))),
    Case("lever_arm", "pose", 0.2, PoseLeverArm((0.2, 0, 0)), 1e-12),
    Case("frame_convention", "imu", None, VectorAxes("imu", FORWARD_RIGHT_DOWN)),
    Case("frame_convention", "pose", None, VectorAxes("pose", NORTH_EAST_DOWN, FORWARD_RIGHT_DOWN), 1e-12),
    Case("frame_convention", "flow", None, VectorAxes("flow", FORWARD_RIGHT_DOWN)),
    Case("frame_convention", "metadata", None, CameraAxes()),
    Case("quaternion_order", "pose", None, QuaternionOrder()),
    Case("quaternion_inverted", "pose", None, QuaternionInversion()),
    Case("quaternion_not_unit", "pose", 0.01, QuaternionLength(0.01), 1e-12),
    # Attitudes between poses, by a cubic spline of quaternions there and a polynomial of degree 5 here.
    Case("gravity_missing", "imu", None, GravityError("gravity_missing"), 1e-3),
    Case("gravity_sign", "imu", None, GravityError("gravity_sign"), 2e-3),
    Case("gravity_magnitude", "imu", 0.1, GravityError("gravity_magnitude", 0.1), 1e-5),
    Case("gravity_magnitude", "metadata", 0.1, GravityMisdeclared(0.1)),
    Case("gyro_bias", "imu", 0.05, GyroBias((0.05, 0, 0)), 1e-14),
    Case("accel_bias", "imu", 0.3, AccelBias((0.3, 0, 0)), 1e-13),
    Case("channel_order", "rgb", None, ChannelOrder("BGR")),
    Case("exposure_or_gamma", "rgb", -20.0, ExposureGain(-20), 1),
    # Half a code times the slope of the inverse, 2.2 at white, and half a code.
    Case("exposure_or_gamma", "rgb", 2.2, PowerCurve(1 / 2.2), 2, unit="gamma"),
    # The generator's gain is 1 - 0.2 u, the measured law 0.8^u: they differ by 0.0056, 1.6 DN of a white pixel.
    Case("vignetting", "rgb", 20.0, Vignetting(20), 3),
    Case("depth_ray_not_z", "depth", None, RayLength(), 30_000 * 2.0**-23),
    Case("invalid_encoding", "depth", None, InvalidCode("depth")),
    Case("invalid_encoding", "flow", None, InvalidCode("flow")),
]


@pytest.fixture(scope="module")
def clean(tiny_park_day: Path) -> Any:
    """A small clean file without pose noise, open."""
    with open_sequence(tiny_park_day) as sequence:
        yield sequence


def rows_of_file(sequence: SequenceRows) -> Rows:
    """All rows, timestamps on the file's own clock: a stream that begins early moves the origin."""
    rows = all_rows(sequence)
    return {key: rows[key] + sequence.origin_ns if DATASETS[key].is_timestamps else rows[key] for key in rows}


def undone_file(
    clean: Sequence,
    folder: Path,
    undoing: ReversibleFault,
    cause: str,
    stream: str,
    magnitude: float | None,
    unit: str | None = None,
) -> tuple[Rows, FaultySequence]:
    """Plant a fault by the generator, and undo it."""
    assert isinstance(clean.path, Path)
    path = folder / "faulty.h5"
    plant_fault(clean.path, path, cause, stream, magnitude, unit)
    with open_sequence(path) as faulty:
        facts = facts_of(faulty)
        view = FaultySequence(faulty, undoing.undo(facts, faulty))
        return rows_of_file(view), view


@pytest.mark.parametrize("case", CASES, ids=str)
def test_undone_file_has_the_rows_of_the_clean_one(case: Case, clean: Sequence, tmp_path: Path) -> None:
    """Every dataset and declaration is that of the clean file, within the stated tolerance."""
    assert (case.undoing.cause, stream_family(case.undoing.stream)) == (case.cause, stream_family(case.stream))
    undone, view = undone_file(clean, tmp_path, case.undoing, case.cause, case.stream, case.magnitude, case.unit)
    true = rows_of_file(clean)
    assert undone.keys() == true.keys()
    for key, stored in true.items():
        rows = undone[key]
        assert (rows.shape, rows.dtype) == (stored.shape, stored.dtype)
        if key == "path/pose/orientation":
            rows = rows * np.sign(np.sum(rows * stored, axis=1, keepdims=True))
        differs = ~np.isclose(rows.astype(float), stored.astype(float), rtol=0, atol=case.tolerance, equal_nan=True)
        assert np.mean(differs) <= case.lost, key
    compare_declared(view.declared, clean.declared)


def test_a_clock_of_events_that_began_with_the_first_event_returns(clean: Sequence, tmp_path: Path) -> None:
    """The planted rate is rounded to a microsecond, and pivots about the first event."""
    first_ns = int(clean.rows("path/events/t", 0, 1)[0])
    fault = ClockRate("events", 800.0, pivot_ns=first_ns)
    undone, _ = undone_file(clean, tmp_path, fault, "clock_rate", "events", 800.0)
    true = rows_of_file(clean)
    np.testing.assert_allclose(undone["path/events/t"], true["path/events/t"], rtol=0, atol=NS_PER_US)
    # Roundings move an event over a frame now and then.
    np.testing.assert_allclose(undone["metadata/rgb_to_event"], true["metadata/rgb_to_event"], rtol=0, atol=10)


def test_events_that_left_the_sensor_are_lost_and_others_return(clean: Sequence, tmp_path: Path) -> None:
    """The generator removes events that a shift moves off the sensor."""
    undone, _ = undone_file(clean, tmp_path, PixelShift("events", 2), "spatial_offset", "events", 2)
    true = rows_of_file(clean)
    stays = true["path/events/x"] < clean.declared.cameras["events"].width - 2
    for column in "xytp":
        np.testing.assert_array_equal(undone[f"path/events/{column}"], true[f"path/events/{column}"][stays])


def test_frames_that_were_exchanged_return(clean: Sequence, tmp_path: Path) -> None:
    """The rows that the generator chose are in the file: where it differs from the clean one."""
    for stream in ("rgb", "depth"):
        path = tmp_path / f"{stream}.h5"
        plant_fault(clean.path, path, "swapped_frames", stream, 2)  # type: ignore[arg-type]
        with open_sequence(path) as faulty:
            true, stored = rows_of_file(clean)[f"path/{stream}"], rows_of_file(faulty)[f"path/{stream}"]
            differs = ~np.isclose(true, stored, equal_nan=True).reshape(len(true), -1).all(axis=1)
            first, second = np.flatnonzero(differs)
            fault = SwappedFrames(stream, ((int(first), int(second)),))
            assert fault.magnitude == 2
            undone = FaultySequence(faulty, fault.undo(facts_of(faulty), faulty))
            np.testing.assert_array_equal(all_rows(undone)[f"path/{stream}"], true)


def test_positions_after_a_jump_return(clean: Sequence, tmp_path: Path) -> None:
    """The jump begins in the middle of the poses, along world X."""
    count = clean.layout.bindings["path/pose/position"].rows
    fault = Teleport((0.5, 0, 0), (count // 2, None))
    undone, _ = undone_file(clean, tmp_path, fault, "teleport", "pose", 0.5)
    np.testing.assert_allclose(undone["path/pose/position"], rows_of_file(clean)["path/pose/position"], atol=1e-12)


def test_indices_point_to_the_first_of_equal_timestamps_again(clean: Sequence, tmp_path: Path) -> None:
    """The fault can be planted only where an event has the timestamp of a frame: it is given one."""
    source = tmp_path / "source.h5"
    source.write_bytes(Path(str(clean.path)).read_bytes())
    with h5py.File(source, "r+") as file:
        frame, index = int(file["path/rgb_ts"][5]), int(file["metadata/rgb_to_event"][5])
        file["path/events/t"][index] = frame
    with open_sequence(source) as tied:
        undone, _ = undone_file(tied, tmp_path, IndexSide("rgb_to_event"), "index_side", "rgb_to_event", None)
        np.testing.assert_array_equal(undone["metadata/rgb_to_event"], rows_of_file(tied)["metadata/rgb_to_event"])


def noise_too_large(facts: Facts, stream: str, percent: float) -> NoiseMisdeclared:
    """Every noise that a correct file declares of a stream is too large by one ratio."""
    model = getattr(facts.declared, stream)
    declared = ((name, getattr(model, name)) for name in NOISES[stream])
    return NoiseMisdeclared(stream, tuple((name, percent / 100 * value) for name, value in declared if value), percent)


@pytest.mark.parametrize("stream", ["imu", "pose", "events"])
def test_declared_noise_returns(stream: str, tiny_park_noisy: Path, tmp_path: Path) -> None:
    """Every noise that is declared is as in the clean file."""
    with open_sequence(tiny_park_noisy) as true:
        fault = noise_too_large(facts_of(true), stream, 40.0)
        _, view = undone_file(true, tmp_path, fault, "noise_misdeclared", stream, 40.0)
        compare_declared(view.declared, true.declared)

"""A fault that is planted and undone leaves the rows as they were."""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.faults.axes import RectificationAxes, VectorAxes
from fedora_qa.faults.clocks import ClockRate, ClockShift, TimeUnit
from fedora_qa.faults.declarations import (
    EventModelMisdeclared,
    GravityMisdeclared,
    NoiseMisdeclared,
    ThresholdMisdeclared,
)
from fedora_qa.faults.fault import FaultySequence, ReversibleFault
from fedora_qa.faults.flow import FlowIntervalShift
from fedora_qa.faults.gravity import ForceSign, GravityAlongBody, GravityError, SensorsInWorld
from fedora_qa.faults.images import (
    ChannelOrder,
    DecodedTwice,
    ExposureGain,
    InvalidCode,
    PowerCurve,
    RayLength,
    TransferMisdeclared,
    Vignetting,
)
from fedora_qa.faults.index_maps import IndexShift, IndexSide
from fedora_qa.faults.intrinsic_units import FilmFocalLength, NormalisedIntrinsics
from fedora_qa.faults.intrinsics import (
    FocalLength,
    IntrinsicsOfAnotherImage,
    IntrinsicsOfSize,
    IntrinsicsOfSizes,
    PrincipalPointFromMiddle,
    PrincipalPointShift,
    TransposedIntrinsics,
)
from fedora_qa.faults.motion import (
    AccelBias,
    AngleOrder,
    AngleSense,
    GyroBias,
    PoseInversion,
    PoseLeverArm,
    QuaternionInversion,
    QuaternionLength,
    QuaternionOrder,
    Teleport,
)
from fedora_qa.faults.mountings import CameraAxes, InvertedMounting, MountingLeverArm, MountingRotation, MountingUnit
from fedora_qa.faults.name_order import FramesInOrderOfNames
from fedora_qa.faults.pixels import Mirroring, PixelShift, PolarityInversion, SwappedPixelAxes
from fedora_qa.faults.row_order import DelayedFrames, DuplicatedSamples, RotatedFrames, SwappedFrames, Unsorted
from fedora_qa.faults.sorted_clock import ClockSetBackAndSorted
from fedora_qa.faults.table import FAULTS, WithoutInverse
from fedora_qa.faults.units import LENGTHS, AngleUnit, FlowGain, FlowSign, FlowUnit, LengthUnit
from tests.support.memory_sequence import FLOW_STRIDES, MS, MemorySequence, all_rows, facts_of, memory_sequence

FLOWS = ("flow", *(f"flow/{rate}" for rate in FLOW_STRIDES))
TIMED = ("rgb", "depth", "events", "imu", "pose", *FLOWS)
MAPS = ("rgb_to_event", "depth_to_event", "ms_to_event")

Tolerance = Callable[[str, NDArray[Any], NDArray[Any]], None]


def exact(key: str, undone: NDArray[Any], stored: NDArray[Any]) -> None:
    """Each bit is as before."""
    np.testing.assert_array_equal(undone, stored)


def rounded(key: str, undone: NDArray[Any], stored: NDArray[Any]) -> None:
    """Values differ by roundings of their type: times by 1 ns, float32 by 2^-23, float64 by 1e-13 of the largest."""
    if stored.dtype.kind in "iu":
        assert np.abs(undone.astype(np.int64) - stored.astype(np.int64)).max(initial=0) <= 1
    else:
        tolerance = 3 * 2.0**-24 if stored.dtype == np.float32 else 1e-13
        np.testing.assert_allclose(undone, stored, rtol=tolerance, atol=tolerance * np.nanmax(np.abs(stored)))


@dataclass(frozen=True)
class Codes:
    """Codes differ by half a code of the faulty frame, which undoing magnifies up to twice, and by half a code."""

    most: float

    def __call__(self, key: str, undone: NDArray[Any], stored: NDArray[Any]) -> None:
        if key == "path/rgb":
            assert np.abs(undone.astype(float) - stored.astype(float)).max() <= self.most
        else:
            exact(key, undone, stored)


def kept(key: str, undone: NDArray[Any], stored: NDArray[Any]) -> None:
    """What is not lost is as before: where a value differs it is NaN now, in half of the values at most."""
    lost = np.isnan(undone) & ~np.isnan(stored)
    np.testing.assert_array_equal(undone[~lost], stored[~lost])
    assert np.mean(lost) < 0.5


unit = st.floats(-1.0, 1.0, allow_nan=False)
vectors = st.tuples(unit, unit, unit)
ranges = st.one_of(st.none(), st.tuples(st.integers(0, 4), st.one_of(st.none(), st.integers(4, 90))))
permutations3 = st.permutations(range(3))


@st.composite
def signed_permutations(draw: st.DrawFn) -> Any:
    """Matrices that exchange axes and change their signs, without changing the handedness."""
    matrix = np.eye(3)[draw(permutations3)] * draw(st.sampled_from([-1.0, 1.0]))
    matrix[0] *= np.sign(np.linalg.det(matrix))
    return tuple(map(tuple, matrix.tolist()))


axes_of_plane = st.sampled_from([
    ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
])  # fmt: skip

sensors = st.sampled_from([("gyro",), ("accelerometer",), ("gyro", "accelerometer")])
signs = st.sampled_from([1, -1])
quarter_turns = st.sampled_from([
    ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
])  # fmt: skip

timed, flows = st.sampled_from(TIMED), st.sampled_from(FLOWS)
images = st.sampled_from(["events", "rgb", "depth", *FLOWS])
made_with_camera = st.sampled_from(["metadata", *FLOWS])
few_or_all = st.one_of(st.none(), st.integers(0, 3))
CASES: list[tuple[Any, Tolerance]] = [
    (st.builds(ClockShift, timed, st.floats(-50 * MS, 50 * MS), ranges), exact),
    (st.builds(ClockRate, timed, st.floats(-5e4, 5e4), st.integers(-MS, 90 * MS), ranges), rounded),
    (st.builds(ClockSetBackAndSorted, st.just("imu"), st.just(-2.3 * MS), st.integers(20, 80)), exact),
    (st.builds(TimeUnit, timed, st.sampled_from([1000.0, 1e6]), st.sampled_from([None, 0]), ranges), exact),
    (st.builds(TimeUnit, timed, st.sampled_from([0.5, 31.7])), rounded),
    (st.builds(Unsorted, st.sampled_from(TIMED[:5]), st.integers(0, 3), st.integers(2, 3), st.booleans()), exact),
    (st.builds(Unsorted, st.sampled_from(["imu", "pose"]), st.integers(0, 9), st.integers(2, 12)), exact),
    (st.builds(Unsorted, st.just("flow/50hz"), st.integers(0, 1), st.just(3)), exact),
    (st.builds(DuplicatedSamples, st.sampled_from(TIMED[:5]), st.integers(0, 3), few_or_all, st.booleans()), exact),
    (st.builds(DuplicatedSamples, flows), exact),
    (st.builds(SwappedFrames, st.sampled_from(["rgb", "depth", "flow/50hz"]), st.just(((0, 2), (1, 3)))), exact),
    (st.builds(RotatedFrames, images, st.sampled_from([(0, 3), (1, 5), (2, None)]), st.integers(-3, 3)), exact),
    (st.builds(FramesInOrderOfNames, st.sampled_from(["rgb", "depth", "flow/50hz"]), st.integers(0, 9)), exact),
    (st.builds(DelayedFrames, st.sampled_from([1, -1]), st.just(20.0), st.just((2, 5))), kept),
    (st.builds(IndexShift, st.sampled_from(MAPS), st.integers(-9, 9), ranges), exact),
    (st.builds(IndexSide, st.sampled_from(["rgb_to_event", "depth_to_event"])), exact),
    (st.just(PolarityInversion()), exact),
    (st.builds(SwappedPixelAxes, st.sampled_from(["events", *FLOWS])), exact),
    (st.builds(Mirroring, images, st.sampled_from(["horizontal", "vertical", "both"])), exact),
    (st.builds(PixelShift, st.just("events"), st.integers(-9, 9), st.integers(-7, 7)), exact),
    (st.builds(PixelShift, st.sampled_from(["depth", *FLOWS]), st.integers(-2, 2), st.integers(-2, 2)), kept),
    (st.builds(ThresholdMisdeclared, st.floats(-50, 90), st.floats(-50, 90)), rounded),
    (st.builds(EventModelMisdeclared, st.sampled_from([1.0, 100.0, 0.01])), rounded),
    (st.builds(NoiseMisdeclared, st.just("imu"), st.tuples(st.tuples(st.just("gyro_noise_density"), unit))), rounded),
    (st.builds(NoiseMisdeclared, st.just("pose"), st.tuples(st.tuples(st.just("rotation_sigma_rad"), unit))), rounded),
    (st.builds(NoiseMisdeclared, st.just("events"), st.tuples(st.tuples(st.just("leak_rate_hz"), unit))), rounded),
    (st.builds(LengthUnit, st.sampled_from(["depth", "pose"]), st.sampled_from([1e-3, 1e3, 1.013]), ranges), rounded),
    (st.builds(AngleUnit, st.just(180 / np.pi), ranges), rounded),
    (st.builds(FlowUnit, flows, st.sampled_from(["px/s", "px/ms", "px s", "px per frame", *LENGTHS])), rounded),
    (st.builds(FlowUnit, flows, st.just("fractions"), st.sampled_from([64.0, 1000.0])), rounded),
    (st.builds(FlowSign, flows), exact),
    (st.builds(FlowGain, flows, st.floats(-50, 90), ranges, st.none() | st.floats(-50, 90)), rounded),
    (st.builds(FlowIntervalShift, st.just("flow/50hz"), st.integers(-2, 2)), kept),
    (st.builds(FocalLength, made_with_camera, st.floats(-20, 20)), rounded),
    (st.builds(PrincipalPointShift, made_with_camera, st.floats(-3, 3), st.floats(-3, 3)), rounded),
    (st.builds(MountingRotation, made_with_camera, vectors), rounded),
    (st.builds(MountingLeverArm, vectors), rounded),
    (st.builds(MountingUnit, st.sampled_from([100.0, 1000.0])), rounded),
    (st.just(TransposedIntrinsics()), exact),
    (st.builds(NormalisedIntrinsics, st.sampled_from(["sides", "halves", "longer_side"]), st.just(("rgb", "events")),
               st.just(0.0)), rounded),
    (st.builds(FilmFocalLength, st.sampled_from([36.0, 23.76]), st.just(("rgb", "events")), st.just(0.0)), rounded),
    (st.builds(IntrinsicsOfSize, st.just("events"), st.integers(20, 900), st.integers(20, 900), st.just(0.0)), rounded),
    (st.builds(IntrinsicsOfSize, st.just("rgb"), st.just(9), st.just(9), st.floats(-50, 90), st.just(False)), rounded),
    (st.builds(IntrinsicsOfSizes, st.tuples(
        st.builds(IntrinsicsOfSize, st.just("events"), st.integers(20, 900), st.integers(20, 900), st.just(0.0)),
        st.builds(IntrinsicsOfSize, st.just("rgb"), st.integers(20, 900), st.integers(20, 900), st.just(9.0)),
    )), rounded),
    (st.builds(PrincipalPointFromMiddle, st.just(("rgb", "events"))), rounded),
    (st.builds(IntrinsicsOfAnotherImage, st.just("events"), st.floats(-20, 20), unit, unit), rounded),
    (st.builds(PoseLeverArm, vectors), rounded),
    (st.builds(QuaternionOrder, st.permutations(range(4)).map(tuple), st.booleans()), exact),
    (st.just(QuaternionInversion()), exact),
    (st.just(PoseInversion()), rounded),
    (st.builds(AngleOrder, st.booleans()), rounded),
    (st.builds(AngleSense, st.tuples(signs, signs, signs), quarter_turns), rounded),
    (st.just(ForceSign()), exact),
    (st.just(GravityAlongBody()), rounded),
    (st.builds(SensorsInWorld, sensors), rounded),
    (st.builds(QuaternionLength, st.floats(-0.5, 0.9)), rounded),
    (st.builds(VectorAxes, st.just("imu"), signed_permutations(), sensors=sensors), exact),
    (st.builds(VectorAxes, flows, axes_of_plane), exact),
    (st.builds(VectorAxes, st.just("pose"), axes_of_plane, turns_orientations=st.just(False)), exact),
    (st.builds(VectorAxes, st.just("pose"), signed_permutations(), signed_permutations()), rounded),
    (st.just(CameraAxes()), exact),
    (st.builds(CameraAxes, signed_permutations(), signed_permutations()), exact),
    (st.builds(InvertedMounting, st.sampled_from([None, "rgb", "events"])), rounded),
    (st.builds(RectificationAxes, st.sampled_from(["coordinates", "pixels"])), exact),
    (st.builds(GravityError, st.sampled_from(["gravity_missing", "gravity_sign", "gravity_magnitude"]), unit), rounded),
    (st.builds(GravityMisdeclared, unit), rounded),
    (st.builds(GyroBias, vectors, ranges), rounded),
    (st.builds(AccelBias, vectors, ranges), rounded),
    (st.builds(Teleport, vectors, ranges.filter(bool)), rounded),
    (st.builds(ChannelOrder, st.permutations("RGB").map("".join)), exact),
    (st.builds(ExposureGain, st.floats(-50, 0), ranges), Codes(2 * 0.5 + 0.5)),
    (st.builds(PowerCurve, st.floats(0.5, 1.0)), Codes(2 * 0.5 + 0.5)),
    (st.builds(DecodedTwice, st.just("gamma2.2")), Codes(16.0)),
    (st.builds(TransferMisdeclared, st.just("linear"), st.sampled_from(["srgb", "gamma2.2"])), exact),
    (st.builds(Vignetting, st.floats(0, 50)), Codes(2 * 0.5 + 0.5)),
    (st.builds(RayLength, st.sampled_from([-1.0, 1.0, 2.0]), ranges), rounded),
    (st.builds(InvalidCode, st.sampled_from(["depth", *FLOWS]), st.sampled_from([0.0, np.inf])), exact),
]  # fmt: skip
"""Strategies of faults, and how far the rows may differ after planting and undoing."""


def compare_declared(undone: Any, declared: Any) -> None:
    """Declarations differ by roundings of float64 at most."""
    if is_dataclass(declared):
        for field in fields(declared):
            compare_declared(getattr(undone, field.name), getattr(declared, field.name))
    elif isinstance(declared, dict):
        assert undone.keys() == declared.keys()
        for name in declared:
            compare_declared(undone[name], declared[name])
    elif isinstance(declared, np.ndarray | float):
        np.testing.assert_allclose(undone, declared, rtol=1e-13, atol=1e-13)
    else:
        assert undone == declared


def differs(view: FaultySequence, sequence: MemorySequence) -> bool:
    """Whether anything of the view is not as in the sequence."""
    if view.declared is not sequence.declared:
        return True
    rows = all_rows(view)
    return any(not np.array_equal(rows[key].astype(float), sequence.arrays[key], equal_nan=True) for key in rows)


@pytest.mark.parametrize(("strategy", "compare"), CASES)
@settings(max_examples=10)
@given(data=st.data())
def test_round_trip(strategy: Any, compare: Tolerance, data: st.DataObject) -> None:
    """Rows, shapes, types and declarations are as before, in whatever pieces they are read."""
    fault: ReversibleFault = data.draw(strategy)
    sequence = memory_sequence(data.draw(st.integers(0, 3)), data.draw(st.sampled_from([0, 1_700_000 * MS])))
    planted = FaultySequence(sequence, fault.plant(facts_of(sequence), sequence))
    undone = FaultySequence(planted, fault.undo(facts_of(planted), planted))
    cut = data.draw(st.floats(0, 1))
    rows, faulty = all_rows(undone), all_rows(planted)
    assert rows.keys() == sequence.arrays.keys()
    for key, stored in sequence.arrays.items():
        assert (rows[key].shape, rows[key].dtype) == (stored.shape, stored.dtype)
        assert faulty[key].dtype == stored.dtype
        compare(key, rows[key], stored)
        middle = round(cut * len(stored))
        parts = [undone.rows(key, 0, middle), undone.rows(key, middle, len(stored))]
        rounded(key, np.concatenate(parts), rows[key])
    compare_declared(undone.declared, sequence.declared)


@settings(max_examples=20)
@given(st.integers(-4, 4), st.integers(-4, 4), st.integers(0, 3))
def test_colour_keeps_what_stays_in_the_image(columns: int, rows: int, seed: int) -> None:
    """Of shifted colour frames, all pixels are as before but those that had left the image."""
    sequence, fault = memory_sequence(seed), PixelShift("rgb", columns, rows)
    planted = FaultySequence(sequence, fault.plant(facts_of(sequence), sequence))
    undone = all_rows(FaultySequence(planted, fault.undo(facts_of(planted), planted)))["path/rgb"]
    height, width = undone.shape[1:3]
    stays = np.s_[:, max(-rows, 0) : height - max(rows, 0), max(-columns, 0) : width - max(columns, 0)]
    np.testing.assert_array_equal(undone[stays], sequence.arrays["path/rgb"][stays])


def test_every_class_of_the_table_makes_a_round_trip() -> None:
    """No class is left out above, and each case alters something."""
    sequence = memory_sequence()
    of_table = {fault for entry in FAULTS.values() if not isinstance(entry, WithoutInverse) for fault in entry}
    once = settings(max_examples=1, database=None, phases=[Phase.generate])  # a type needs no smallest example
    tried = {type(find(strategy, lambda fault: True, settings=once)) for strategy, _ in CASES}
    assert tried == of_table
    gross: tuple[ReversibleFault, ...] = (
        ClockShift("events", MS), ClockRate("imu", 100), TimeUnit("flow", 1000), Unsorted("events", 5, 9),
        DuplicatedSamples("rgb", 1, 2), FlowUnit("flow"), GravityError("gravity_missing"), RayLength(),
        IndexSide("rgb_to_event"), Mirroring("rgb", "vertical"), FocalLength("flow", 3.0),
        VectorAxes("imu", ((0, 1, 0), (1, 0, 0), (0, 0, 1))),
    )  # fmt: skip
    for fault in gross:
        assert differs(FaultySequence(sequence, fault.plant(facts_of(sequence), sequence)), sequence)

"""Faults of a part of the sequence: found, located and named as the same faults of the whole are."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.imu.samples import InertialNoise
from fedora_qa.record.types import Diagnosis
from tests.support.motion_world import EXACT, GRAVITY_M_S2, NOISY, RESTLESS, MotionFile, sample_motion

Float64 = NDArray[np.float64]

START_S, STOP_S = 0.6, 1.4


def altered_in_part(**changes: Callable[[Float64], Float64]) -> MotionFile:
    """Change fields between two instants; what lies outside stays."""
    samples = sample_motion()
    altered = {}
    for name, change in changes.items():
        pose_like = name in ("positions_world_m", "orientations_xyzw")
        times_s = samples.pose_times_s if pose_like else samples.imu_times_s
        values = getattr(samples, name).copy()
        part = (times_s >= START_S) & (times_s < STOP_S)
        values[part] = change(values[part])
        altered[name] = values
    return MotionFile().altered(**altered)


def swapped(values: Float64) -> Float64:
    return values[:, [1, 0, 2]]


def right_down(values: Float64) -> Float64:
    return values * [1.0, -1.0, -1.0]


def without_gravity(_: Float64) -> Float64:
    times_s = sample_motion().imu_times_s
    part = (times_s >= START_S) & (times_s < STOP_S)
    return RESTLESS.specific_forces(times_s[part], 0.0)


NED = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
FRD = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))

FAULTS = {
    "sensor axes": (
        {"angular_velocities_body_rad_s": swapped, "specific_forces_body_m_s2": swapped},
        ("axes_swapped", "imu"),
    ),
    "sensor right-down": (
        {"angular_velocities_body_rad_s": right_down, "specific_forces_body_m_s2": right_down},
        ("frame_convention", "imu"),
    ),
    "degrees": ({"angular_velocities_body_rad_s": np.degrees}, ("unit_deg_rad", "imu")),
    "no gravity": ({"specific_forces_body_m_s2": without_gravity}, ("gravity_missing", "imu")),
    "world axes": ({"positions_world_m": swapped}, ("axes_swapped", "pose")),
    "wxyz": ({"orientations_xyzw": lambda q: q[:, [3, 0, 1, 2]]}, ("quaternion_order", "pose")),
    "inverse": ({"orientations_xyzw": lambda q: q * [-1, -1, -1, 1]}, ("quaternion_inverted", "pose")),
    "north-east-down": (
        {
            "positions_world_m": NED.apply,
            "orientations_xyzw": lambda q: (NED * Rotation.from_quat(q) * FRD).as_quat(),
        },
        ("frame_convention", "pose"),
    ),
}


def first_diagnosis(file: MotionFile, path: Path, select: tuple[str, ...] = ("imu", "pose")) -> Diagnosis:
    file.write(path)
    return check_file(path, CheckOptions(select=select, evidence=None)).record.diagnoses[0]


def is_at_an_edge(diagnosis: Diagnosis) -> bool:
    """Whether it is placed where the fault begins or ends."""
    start_us = diagnosis.where.start_us
    return start_us is not None and min(abs(start_us / 1e6 - edge_s) for edge_s in (START_S, STOP_S)) < 0.03


@pytest.mark.parametrize(("changes", "cause"), FAULTS.values(), ids=FAULTS)
def test_a_gross_fault_of_a_part_is_named_and_located(
    tmp_path: Path, changes: dict[str, Callable[[Float64], Float64]], cause: tuple[str, str]
) -> None:
    """Odd axes, units and conventions between two instants are one diagnosis, placed where they begin or end."""
    diagnosis = first_diagnosis(altered_in_part(**changes), tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == cause
    assert is_at_an_edge(diagnosis)


@pytest.mark.parametrize("factor", [100.0, 1000.0, 0.01, 1 / 0.3048])
def test_a_unit_of_length_of_a_part_is_undone_there(tmp_path: Path, factor: float) -> None:
    """Positions go on across a jump once they are multiplied by the ratio of two units, whichever these are.

    One diagnosis is placed where they begin or end.
    """
    diagnosis = first_diagnosis(altered_in_part(positions_world_m=lambda p: factor * p), tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == ("unit_mm_m", "pose")
    assert is_at_an_edge(diagnosis)
    assert diagnosis.status in ("confirmed", "supported")
    assert diagnosis.magnitude == pytest.approx(factor)


OF_POSES = ("north-east-down", "inverse", "world axes")


@pytest.mark.parametrize(("changes", "cause"), [FAULTS[name] for name in OF_POSES], ids=OF_POSES)
def test_poses_of_a_part_in_another_convention_are_named_in_noise(
    tmp_path: Path, changes: dict[str, Callable[[Float64], Float64]], cause: tuple[str, str]
) -> None:
    """They jump at the edges of the part, and go on under the convention within noise."""
    samples = sample_motion(noise=NOISY)
    part = (samples.pose_times_s >= START_S) & (samples.pose_times_s < STOP_S)
    altered = {}
    for field, change in changes.items():
        altered[field] = getattr(samples, field).copy()
        altered[field][part] = change(altered[field][part])
    diagnosis = first_diagnosis(MotionFile(samples, NOISY).altered(**altered), tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == cause


@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_timestamps_of_a_part_that_are_late_are_named_to_size(tmp_path: Path, stream: str) -> None:
    """A third of a millisecond in the middle disturbs every fit; the stamps themselves show it, exactly."""
    times_s = getattr(sample_motion(), f"{stream}_times_s").copy()
    times_s[(times_s >= START_S) & (times_s < STOP_S)] += 300e-6
    diagnosis = first_diagnosis(MotionFile().altered(**{f"{stream}_times_s": times_s}), tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == ("time_offset", stream)
    assert diagnosis.magnitude == pytest.approx(0.3)


def test_a_bias_of_a_part_does_not_average_out(tmp_path: Path) -> None:
    """A gyro bias of 10 urad/s in the middle is placed, and sized as far as it fills a stretch of half a second."""
    part = altered_in_part(angular_velocities_body_rad_s=lambda w: w + np.array([0.0, 1e-5, 0.0]))
    part.write(tmp_path / "motion.h5")
    record = check_file(tmp_path / "motion.h5", CheckOptions(select=("imu",), evidence=None)).record
    diagnosis = record.diagnoses[0]
    assert (diagnosis.cause, diagnosis.stream) == ("gyro_bias", "imu")
    assert diagnosis.magnitude == pytest.approx(1e-5, rel=0.25)
    assert "imu.rotation.local_bias" in {one.code for result in record.results for one in result.findings}
    assert START_S <= (diagnosis.where.start_us or 0.0) / 1e6 + 0.5 <= STOP_S


def test_a_bias_that_drifts_is_a_bias(tmp_path: Path) -> None:
    """A gyro that warms up has at its end the bias that is named, not a turned sensor."""
    rates_rad_s = sample_motion().angular_velocities_body_rad_s
    warming = np.linspace(0.0, 1.0, len(rates_rad_s))[:, np.newaxis] * np.array([0.0, 0.04, 0.02])
    diagnosis = first_diagnosis(
        MotionFile().altered(angular_velocities_body_rad_s=rates_rad_s + warming), tmp_path / "motion.h5", ("imu",)
    )
    assert (diagnosis.cause, diagnosis.stream) == ("gyro_bias", "imu")
    assert diagnosis.magnitude == pytest.approx(np.hypot(0.04, 0.02), rel=0.05)


def test_an_imu_that_is_held_is_not_late(tmp_path: Path) -> None:
    """Samples of a lower rate that are repeated are late by half of the time for which they are: they are repeats."""
    motion = sample_motion()
    rows = np.arange(len(motion.imu_times_s)) // 8 * 8
    held = MotionFile().altered(
        angular_velocities_body_rad_s=motion.angular_velocities_body_rad_s[rows],
        specific_forces_body_m_s2=motion.specific_forces_body_m_s2[rows],
    )
    diagnosis = first_diagnosis(held, tmp_path / "motion.h5", ("imu",))
    assert (diagnosis.cause, diagnosis.stream) == ("frozen_frames", "imu")


def test_a_gyro_that_is_late_alone_has_its_own_delay(tmp_path: Path) -> None:
    """Its samples are ten milliseconds late; the accelerometer is not, and their mean is the delay of neither."""
    rates_rad_s = sample_motion().angular_velocities_body_rad_s
    late = rates_rad_s[np.clip(np.arange(len(rates_rad_s)) - 10, 0, None)]
    diagnosis = first_diagnosis(
        MotionFile().altered(angular_velocities_body_rad_s=late), tmp_path / "motion.h5", ("imu", "pose")
    )
    assert (diagnosis.cause, diagnosis.stream) == ("time_offset", "imu")
    assert diagnosis.magnitude == pytest.approx(10.0, rel=0.02)


def test_lone_poses_are_jumps_and_no_noise(tmp_path: Path) -> None:
    """Positions that lie off one by one jump there and back, with the largest distance for a size."""
    positions_m = sample_motion().positions_world_m.copy()
    for row, distance_m in zip(np.linspace(9, len(positions_m) - 9, 12).astype(int), [0.1, 0.3] * 6, strict=True):
        positions_m[row, 1] += distance_m
    diagnosis = first_diagnosis(MotionFile().altered(positions_world_m=positions_m), tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == ("teleport", "pose")
    assert diagnosis.magnitude == pytest.approx(0.3, rel=0.02)


def test_a_teleport_and_back_is_no_reading(tmp_path: Path) -> None:
    """A jump that no exchange of axes or units explains stays a teleport, with its size."""
    away = altered_in_part(positions_world_m=lambda p: p + np.array([0.3, 0.0, 0.0]))
    diagnosis = first_diagnosis(away, tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == ("teleport", "pose")
    assert abs(diagnosis.magnitude or 0.0) == pytest.approx(0.3, rel=1e-3)


@pytest.mark.parametrize(("noise", "arm_m"), [(EXACT, 6e-4), (NOISY, 0.4)], ids=["exact", "noisy"])
def test_another_point_of_the_body_for_a_while_is_a_lever_arm(
    tmp_path: Path, noise: InertialNoise, arm_m: float
) -> None:
    """A jump and its return that undo each other in the body's axes, not in the world's, are a lever arm, sized."""
    samples = sample_motion(noise=noise)
    part = (samples.pose_times_s >= START_S) & (samples.pose_times_s < STOP_S)
    arm_world_m = Rotation.from_quat(samples.orientations_xyzw[part]).apply([arm_m, 0.0, 0.0])
    positions_m = samples.positions_world_m.copy()
    positions_m[part] += arm_world_m
    file = MotionFile(samples, noise).altered(positions_world_m=positions_m)
    diagnosis = first_diagnosis(file, tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == ("lever_arm", "pose")
    of_the_jumps = first_diagnosis(file, tmp_path / "motion.h5", ("pose.continuity",))
    assert of_the_jumps.magnitude == pytest.approx(arm_m, rel=0.1)


def test_the_gravity_of_the_world_is_the_test_files_own() -> None:
    """The part without gravity differs from the whole by nothing else."""
    times_s = sample_motion().imu_times_s
    up = RESTLESS.orientations(times_s).inv().apply([0.0, 0.0, GRAVITY_M_S2])
    np.testing.assert_allclose(RESTLESS.specific_forces(times_s, 0.0) + up, RESTLESS.specific_forces(times_s))


def test_an_imu_that_sits_elsewhere_for_a_while_is_no_bias(tmp_path: Path) -> None:
    """A lever arm that ends early leaves something to bias and gravity: it explains them, and is all there is."""
    file = MotionFile()
    times_s = file.samples.imu_times_s
    rates = file.samples.angular_velocities_body_rad_s
    arm_m = np.array([1e-3, 0.0, 0.0])
    turning = np.cross(np.gradient(rates, times_s, axis=0), arm_m) + np.cross(rates, np.cross(rates, arm_m))
    forces = file.samples.specific_forces_body_m_s2 + (times_s < 1.7)[:, None] * turning
    diagnosis = first_diagnosis(file.altered(specific_forces_body_m_s2=forces), tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == ("lever_arm", "imu")


@pytest.mark.parametrize(
    ("field", "cause"),
    [("angular_velocities_body_rad_s", "gyro_bias"), ("specific_forces_body_m_s2", "accel_bias")],
)
def test_a_bias_of_a_part_is_undone_in_that_part(tmp_path: Path, field: str, cause: str) -> None:
    """A second is too short for segments: residuals place the bias, and it clears all that they show."""
    bias = np.array([0.02, -0.03, 0.05])
    part = altered_in_part(**{field: lambda values: values + bias})
    diagnosis = first_diagnosis(part, tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream, diagnosis.status) == (cause, "imu", "confirmed")
    assert diagnosis.magnitude == pytest.approx(float(np.linalg.norm(bias)), rel=1e-2)


def test_positions_of_two_sets_are_jumps_and_no_noise(tmp_path: Path) -> None:
    """After 12 to 40 poses positions change to others, and back, by 5 cm: noise would be in every pose."""
    samples = sample_motion()
    count = len(samples.positions_world_m)
    begins = np.cumsum(np.random.default_rng(3).integers(12, 41, count // 12))
    other = np.searchsorted(begins, np.arange(count), "right") % 2
    positions_m = samples.positions_world_m + 0.05 * np.outer(other, [0.0, 1.0, 0.0])
    diagnosis = first_diagnosis(MotionFile().altered(positions_world_m=positions_m), tmp_path / "motion.h5")
    assert (diagnosis.cause, diagnosis.stream) == ("teleport", "pose")


@pytest.mark.parametrize("name", ["orientations_xyzw", "positions_world_m"])
def test_one_half_of_a_pose_that_stands_still_is_frozen(tmp_path: Path, name: str) -> None:
    """Where it goes on it jumps; the other half moves all the time."""
    frozen = altered_in_part(**{name: lambda values: np.repeat(values[:1], len(values), axis=0)})
    diagnosis = first_diagnosis(frozen, tmp_path / "motion.h5", ("pose.continuity",))
    assert (diagnosis.cause, diagnosis.stream) == ("frozen_frames", "pose")

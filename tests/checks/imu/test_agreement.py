"""IMU against pose, all checks together, on files of a motion in closed form."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from fedora_qa.checks.imu.agreement import ROTATION_TEXTS, TIMING_TEXTS, TRANSLATION_TEXTS
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.fitting.grouped_fit import group_of
from fedora_qa.estimators.imu.preintegration import ROTATION_PARAMETERS
from fedora_qa.estimators.imu.specific_force import TRANSLATION_PARAMETERS
from fedora_qa.judgement.materiality import materiality_row
from tests.support.checked import diagnoses_of, measured_record, rules, run_check
from tests.support.motion_world import (
    GRAVITY_M_S2,
    HOVER,
    NOISY,
    RESTLESS,
    Motion,
    MotionFile,
    sample_motion,
)

CHECKS = ("imu.rotation", "imu.translation", "imu.timing", "imu.noise")


Change = Callable[[MotionFile], MotionFile]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def outcomes(path: Path) -> dict[str, str]:
    """Run all four checks; one that crashed shows as that."""
    results = measured_record(path, *CHECKS).results
    return {result.check: result.outcome for result in results}


def rates(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(angular_velocities_body_rad_s=change(f.samples.angular_velocities_body_rad_s))


def forces(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(specific_forces_body_m_s2=change(f.samples.specific_forces_body_m_s2))


def imu_timestamps(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(imu_times_s=change(f.samples.imu_times_s))


def pose_timestamps(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(pose_times_s=change(f.samples.pose_times_s))


def quaternions(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(orientations_xyzw=change(f.samples.orientations_xyzw))


def positions(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda f: f.altered(positions_world_m=change(f.samples.positions_world_m))


def gravity(share: float) -> Change:
    return lambda f: f.altered(
        specific_forces_body_m_s2=RESTLESS.specific_forces(f.samples.imu_times_s, share * GRAVITY_M_S2)
    )


def lever(arm_m: float) -> Change:
    def change(f: MotionFile) -> MotionFile:
        arm = Rotation.from_quat(f.samples.orientations_xyzw).apply([arm_m, 0.0, 0.0])
        return f.altered(positions_world_m=f.samples.positions_world_m - arm)

    return change


CLEAN = {
    "restless": MotionFile(),
    "one second": MotionFile(sample_motion(duration_s=1.0)),
    "slow IMU": MotionFile(sample_motion(imu_rate_hz=100.0)),
    "slow poses": MotionFile(sample_motion(pose_rate_hz=20.0)),
    "more poses than IMU": MotionFile(sample_motion(imu_rate_hz=200.0, pose_rate_hz=400.0)),
    "hover": MotionFile(sample_motion(HOVER)),
    "long and noisy": MotionFile(sample_motion(noise=NOISY, duration_s=12.0), NOISY),
}


SMALL = {
    "imu late": (imu_timestamps(lambda t: t + 0.001), "imu.timing", "time_offset", ("time_offset", "imu", 1.0)),
    "imu early": (imu_timestamps(lambda t: t - 0.007), "imu.timing", "time_offset", ("time_offset", "imu", -7.0)),
    "imu fast": (imu_timestamps(lambda t: t * 1.0005), "imu.timing", "clock_rate", ("clock_rate", "imu", 500.0)),
    "poses slow": (
        pose_timestamps(lambda t: t * 0.999),
        "imu.timing",
        "pose_clock_rate",
        ("clock_rate", "pose", -1000.0),
    ),
    "gyro bias": (rates(lambda w: w + np.array([0.0, 0.0, -0.01])), "imu.rotation", "bias",
                  ("gyro_bias", "imu", -0.01)),
    "accel bias": (forces(lambda f: f + np.array([0.0, 0.05, 0.0])), "imu.translation", "bias",
                   ("accel_bias", "imu", 0.05)),
    "heavier": (gravity(1.002), "imu.translation", "gravity", ("gravity_magnitude", "imu", 0.002 * GRAVITY_M_S2)),
    "lever": (lever(0.05), "imu.translation", "lever", ("lever_arm", "imu", 0.05)),
}  # fmt: skip


GROSS = {
    "degrees": (rates(np.degrees), ("unit_deg_rad", "imu")),
    "sensor axes": (lambda f: forces(lambda v: v[:, [1, 0, 2]])(rates(lambda v: v[:, [1, 0, 2]])(f)),
                    ("axes_swapped", "imu")),
    "sensor right-down": (lambda f: forces(lambda v: v * [1, -1, -1])(rates(lambda v: v * [1, -1, -1])(f)),
                          ("frame_convention", "imu")),
    "world axes": (positions(lambda p: p[:, [1, 0, 2]]), ("axes_swapped", "pose")),
    "millimetres": (positions(lambda p: 1000 * p), ("unit_mm_m", "pose")),
    "wxyz": (quaternions(lambda q: q[:, [3, 0, 1, 2]]), ("quaternion_order", "pose")),
    "inverse": (quaternions(lambda q: q * [-1, -1, -1, 1]), ("quaternion_inverted", "pose")),
    "no gravity": (gravity(0.0), ("gravity_missing", "imu")),
    "gravity up": (gravity(-1.0), ("gravity_sign", "imu")),
}  # fmt: skip


@pytest.mark.parametrize("clean", CLEAN.values(), ids=CLEAN)
def test_clean_streams_pass(path: Path, clean: MotionFile) -> None:
    """Fast and slow motion, other rates and all declared noise pass every check."""
    assert outcomes(clean.write(path)) == dict.fromkeys(CHECKS, "passed")


def test_what_noise_hides_is_never_a_failure(path: Path) -> None:
    """What hovering cannot show in noise is not observable: timing says what it would take."""
    results = measured_record(MotionFile(sample_motion(HOVER, NOISY), NOISY).write(path), *CHECKS).results
    assert {result.outcome for result in results} == {"passed", "not_observable"}
    timing = next(result for result in results if result.check == "imu.timing")
    assert timing.outcome == "not_observable"
    assert "detection limit too large" in timing.reason


def test_perfect_rest_is_never_a_failure(path: Path) -> None:
    """A body that does not move at all, without noise, cannot show its timing and passes the rest."""
    still = MotionFile(sample_motion(replace(RESTLESS, amplitudes=(0.0,) * 6)))
    found = outcomes(still.write(path))
    assert found.pop("imu.timing") == "not_observable"
    assert set(found.values()) == {"passed"}


@pytest.mark.parametrize(("change", "check", "rule", "cause"), SMALL.values(), ids=SMALL)
def test_a_small_fault_fails_one_check_and_is_diagnosed_to_size(
    path: Path, change: Change, check: str, rule: str, cause: tuple[str, str, float]
) -> None:
    """Each fault breaks its own rule and no other, and the diagnosis gives cause, stream, size and sign."""
    change(MotionFile()).write(path)
    record = check_file(path, CheckOptions(select=CHECKS[:3], evidence=None)).record
    for result in record.results:
        assert set(rules(result)) == ({rule} if result.check == check else set())
    diagnosis = record.diagnoses[0]
    assert (diagnosis.cause, diagnosis.stream) == cause[:2]
    assert diagnosis.magnitude == pytest.approx(cause[2], rel=0.01)
    assert diagnosis.standard_error is not None


@pytest.mark.parametrize(("change", "cause"), GROSS.values(), ids=GROSS)
def test_a_gross_fault_is_named_by_one_diagnosis(path: Path, change: Change, cause: tuple[str, str]) -> None:
    """Axes, units, conventions and gravity: one cause explains every finding of rotation and translation."""
    change(MotionFile()).write(path)
    (diagnosis,) = diagnoses_of(path, "imu")
    assert (diagnosis.cause, diagnosis.stream) == cause


def test_north_east_down_poses_are_told_from_a_turned_sensor(path: Path) -> None:
    """Poses in another world and body convention also turn gravity over: it is the poses that are named."""
    ned = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    s = sample_motion()
    turned = ned * Rotation.from_quat(s.orientations_xyzw) * Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))
    file = MotionFile().altered(positions_world_m=ned.apply(s.positions_world_m), orientations_xyzw=turned.as_quat())
    file.write(path)
    (diagnosis,) = diagnoses_of(path, "imu")
    assert (diagnosis.cause, diagnosis.stream) == ("frame_convention", "pose")


@pytest.mark.parametrize("count", [0, 1, 2, 9])
@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_a_handful_of_samples_is_not_observable(path: Path, stream: str, count: int) -> None:
    """Few samples of either stream: every comparison states that it cannot be made, and none breaks.

    An empty stream is absent, which integrity.layout reports.
    """
    s = sample_motion()
    names = {
        "imu": ("imu_times_s", "angular_velocities_body_rad_s", "specific_forces_body_m_s2"),
        "pose": ("pose_times_s", "positions_world_m", "orientations_xyzw"),
    }[stream]
    MotionFile().altered(**{name: getattr(s, name)[:count] for name in names}).write(path)
    results = measured_record(path, *CHECKS[:3]).results
    assert {result.outcome for result in results} == {"not_observable" if count else "not_applicable"}


def test_values_that_are_no_numbers_leave_the_rest_to_be_checked(path: Path) -> None:
    """NaN in some samples of both streams changes no outcome; other checks count them."""
    s = sample_motion()
    gyro, where = s.angular_velocities_body_rad_s.copy(), s.positions_world_m.copy()
    gyro[500:503], where[100] = np.nan, np.inf
    MotionFile().altered(angular_velocities_body_rad_s=gyro, positions_world_m=where).write(path)
    assert outcomes(path) == dict.fromkeys(CHECKS, "passed")


def test_lost_samples_with_their_timestamps_are_bridged_by_nothing(path: Path) -> None:
    """A gap in the IMU's stamps is another check's finding: intervals across it are left out here."""
    s, kept = sample_motion(), np.r_[0:800, 830:2001]
    MotionFile().altered(
        imu_times_s=s.imu_times_s[kept],
        angular_velocities_body_rad_s=s.angular_velocities_body_rad_s[kept],
        specific_forces_body_m_s2=s.specific_forces_body_m_s2[kept],
    ).write(path)
    assert outcomes(path) == dict.fromkeys(CHECKS, "passed")


@pytest.mark.parametrize("lost", [1, 3, 60])
def test_lost_poses_are_bridged_while_the_gap_is_narrow(path: Path, lost: int) -> None:
    """Poses that are missing together with their stamps disturb nothing, be it one or a third of a second."""
    s, kept = sample_motion(), np.r_[0:150, 150 + lost : 401]
    MotionFile().altered(
        pose_times_s=s.pose_times_s[kept],
        positions_world_m=s.positions_world_m[kept],
        orientations_xyzw=s.orientations_xyzw[kept],
    ).write(path)
    assert outcomes(path) == dict.fromkeys(CHECKS, "passed")
    assert run_check(path, "pose.continuity").outcome == "passed"


@pytest.mark.parametrize("kind", ["rotation", "translation"])
def test_detection_limits_are_useful_up_to_the_sizes_of_the_table(kind: str) -> None:
    """The fit and the table of material sizes name the same limits."""
    parameters = ROTATION_PARAMETERS if kind == "rotation" else TRANSLATION_PARAMETERS
    texts = ROTATION_TEXTS if kind == "rotation" else TRANSLATION_TEXTS
    for name, useful in zip(parameters.names, parameters.useful, strict=True):
        group = group_of(name)
        check, text = ("timing", TIMING_TEXTS[group]) if group in TIMING_TEXTS else (kind, texts[group])
        row = materiality_row(f"imu.{check}.{group}", text.unit)
        assert row is not None
        assert row.blind_from == pytest.approx(useful * text.factor)


def smoothed_poses(file: MotionFile, sigma_s: float) -> MotionFile:
    """Positions and orientations behind a Gaussian low-pass filter."""
    samples = file.samples
    width = sigma_s / float(np.median(np.diff(samples.pose_times_s)))
    quaternions = gaussian_filter1d(samples.orientations_xyzw, width, axis=0, mode="nearest")
    return file.altered(
        positions_world_m=gaussian_filter1d(samples.positions_world_m, width, axis=0, mode="nearest"),
        orientations_xyzw=quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
    )


STEADY = replace(RESTLESS, amplitudes=(0.02, 0.02, 0.02, 0.6, 0.5, 0.2))
"""Flight that hardly turns: gravity, biases and lever arm are nearly collinear."""


@pytest.mark.parametrize("motion", [RESTLESS, STEADY, HOVER], ids=["restless", "steady", "hover"])
@pytest.mark.parametrize("sigma_s", [0.02, 0.05, 0.2])
def test_smoothed_poses_fail_without_parameters_of_absurd_size(path: Path, motion: Motion, sigma_s: float) -> None:
    """What no parameter describes is found, and no parameter fails whose detection limit is of no use."""
    smoothed_poses(MotionFile(sample_motion(motion)), sigma_s).write(path)
    record = measured_record(path, *CHECKS[:3])
    assert record.verdict == "findings"
    for result in record.results:
        for measurement in result.measurements:
            row = materiality_row(measurement.code, measurement.unit)
            if row is None or row.blind_from is None or measurement.name.startswith("local"):
                continue
            assert measurement.value is not None
            assert measurement.allowed is not None
            assert measurement.least_detectable is not None
            # The limit of the table counts from the limit of the file; a material size is added to both.
            if abs(measurement.value) > measurement.allowed:
                assert measurement.least_detectable - measurement.material < 1.1 * row.blind_from


def test_a_gravity_fault_is_found_where_nothing_separates_it_from_a_bias(path: Path) -> None:
    """In steady flight excess gravity is stated to size, and the bias that could imitate it."""
    samples = sample_motion(STEADY)
    heavy = replace(samples, specific_forces_body_m_s2=STEADY.specific_forces(samples.imu_times_s, 1.05 * GRAVITY_M_S2))
    found = run_check(MotionFile(heavy).write(path), "imu.translation")
    gravity_excess = next(m for m in found.measurements if m.name == "gravity")
    assert found.outcome == "failed"
    assert gravity_excess.value == pytest.approx(0.05 * GRAVITY_M_S2, rel=0.01)

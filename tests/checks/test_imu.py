"""IMU against pose, on files of a motion in closed form."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.record.types import Measurement, Result
from tests.support.checked import diagnoses_of, rules, run_check
from tests.support.motion_world import (
    EXACT,
    GRAVITY_M_S2,
    HOVER,
    NOISY,
    RESTLESS,
    MotionFile,
    sample_motion,
)

CHECKS = ("imu.rotation", "imu.translation", "imu.timing", "imu.noise")
Change = Callable[[MotionFile], MotionFile]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a file goes."""
    return tmp_path / "motion.h5"


def measured(result: Result, name: str) -> Measurement:
    return next(one for one in result.measurements if one.name == name)


def outcomes(path: Path) -> dict[str, str]:
    """Run all four checks; one that crashed shows as that."""
    results = check_file(path, CheckOptions(select=CHECKS)).record.results
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


def held(first: int, count: int) -> Change:
    def change(f: MotionFile) -> MotionFile:
        gyro, force = f.samples.angular_velocities_body_rad_s.copy(), f.samples.specific_forces_body_m_s2.copy()
        gyro[first : first + count], force[first : first + count] = gyro[first - 1], force[first - 1]
        return f.altered(angular_velocities_body_rad_s=gyro, specific_forces_body_m_s2=force)

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


@pytest.mark.parametrize("clean", CLEAN.values(), ids=CLEAN)
def test_clean_streams_pass(path: Path, clean: MotionFile) -> None:
    """Fast and slow motion, other rates and all declared noise pass every check."""
    assert outcomes(clean.write(path)) == dict.fromkeys(CHECKS, "passed")


def test_what_noise_hides_is_never_a_failure(path: Path) -> None:
    """What hovering cannot show in noise is not observable: timing says what it would take."""
    found = outcomes(MotionFile(sample_motion(HOVER, NOISY), NOISY).write(path))
    assert set(found.values()) == {"passed", "not_observable"}
    assert found["imu.timing"] == "not_observable"
    assert "could not be seen where it matters" in run_check(path, "imu.timing").reason


def test_two_restless_seconds_show_timing_in_noise(path: Path) -> None:
    """In poses with 5 mm and 0.2 deg of noise, two seconds at 5 rad/s tell offsets of half a millisecond."""
    MotionFile(sample_motion(noise=NOISY), NOISY).write(path)
    assert outcomes(path) == dict.fromkeys(CHECKS, "passed")
    assert (measured(run_check(path, "imu.timing"), "time_offset").least_detectable or np.inf) < 0.5


def test_perfect_rest_is_never_a_failure(path: Path) -> None:
    """A body that does not move at all, without noise, cannot show its timing and passes the rest."""
    still = MotionFile(sample_motion(replace(RESTLESS, amplitudes=(0.0,) * 6)))
    found = outcomes(still.write(path))
    assert found.pop("imu.timing") == "not_observable"
    assert set(found.values()) == {"passed"}


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


@pytest.mark.parametrize(("change", "check", "rule", "cause"), SMALL.values(), ids=SMALL)
def test_a_small_fault_fails_one_check_and_is_diagnosed_to_size(
    path: Path, change: Change, check: str, rule: str, cause: tuple[str, str, float]
) -> None:
    """Each fault breaks its own rule and no other, and the diagnosis gives cause, stream, size and sign."""
    change(MotionFile()).write(path)
    record = check_file(path, CheckOptions(select=CHECKS[:3])).record
    for result in record.results:
        assert set(rules(result)) == ({rule} if result.check == check else set())
    diagnosis = record.diagnoses[0]
    assert (diagnosis.cause, diagnosis.stream) == cause[:2]
    assert diagnosis.magnitude == pytest.approx(cause[2], rel=0.01)
    assert diagnosis.standard_error is not None


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


def test_an_offset_is_told_no_more_surely_than_timestamps_are_rounded(path: Path) -> None:
    """An IMU that is 3.4 us late is stamped 3 us late: what is told is off by a part of a microsecond, and says so."""
    imu_timestamps(lambda t: t + 3.4e-6)(MotionFile()).write(path)
    diagnosis = check_file(path, CheckOptions(select=("imu.timing",), evidence=None)).record.diagnoses[0]
    assert (diagnosis.cause, diagnosis.stream) == ("time_offset", "imu")
    assert diagnosis.magnitude is not None
    assert diagnosis.standard_error is not None
    assert abs(diagnosis.magnitude - 3.4e-3) < 2 * diagnosis.standard_error < 1e-3


def averaged(f: MotionFile) -> MotionFile:
    """Every sample the mean over the interval before its stamp."""
    times_s = f.samples.imu_times_s

    def mean(values: np.ndarray) -> np.ndarray:
        sums = CubicSpline(times_s, values).antiderivative()(times_s)
        return np.concatenate((values[:1], np.diff(sums, axis=0) / np.diff(times_s)[:, None]))

    return forces(mean)(rates(mean)(f))


def test_averaged_samples_are_said_not_failed(path: Path) -> None:
    """Means over the preceding interval read as half of it late: a warning with the declaration that is missing."""
    result = run_check(averaged(MotionFile()).write(path), "imu.timing")
    assert result.outcome == "warned"
    assert measured(result, "time_offset").value == pytest.approx(0.5, abs=1e-3)
    assert "interval_mean" in result.reason


def test_averaged_samples_that_are_declared_pass(path: Path) -> None:
    """With the declaration they are put back in their place, and nothing is left to see."""
    file = replace(averaged(MotionFile()), sampling="interval_mean")
    assert outcomes(file.write(path)) == dict.fromkeys(CHECKS, "passed")


def test_a_jump_of_the_poses_is_the_worst_translation(path: Path) -> None:
    """A jump of 1 mm moves no parameter; the place and the probable cause are named."""
    s = sample_motion()
    jumped = s.positions_world_m.copy()
    jumped[250:, 2] += 0.001
    result = run_check(MotionFile().altered(positions_world_m=jumped).write(path), "imu.translation")
    assert rules(result) == ["worst"]
    assert result.findings[0].where.start_us == pytest.approx(1_250_000, abs=5_000)
    assert diagnoses_of(path, "imu")[0].cause == "teleport"


def test_held_samples_are_counted(path: Path) -> None:
    """IMU samples that are held while the body moves are counted and located."""
    result = run_check(held(700, 6)(MotionFile()).write(path), "imu.noise")
    assert "frozen" in rules(result)
    frozen = next(one for one in result.findings if one.code.endswith("frozen"))
    assert (frozen.where.index_start, measured(result, "frozen").value) == (700, 6)
    assert diagnoses_of(path, "imu")[0].cause == "frozen_frames"


def steady(file: MotionFile) -> MotionFile:
    """At rest, rounded: forces flicker by the last digit and rates by what differences of orientations have."""
    random = np.random.default_rng(5)
    count = len(file.samples.imu_times_s)
    repeats = np.repeat(random.integers(-1, 2, (count // 3 + 1, 3)), 3, axis=0)[:count]
    return file.altered(
        specific_forces_body_m_s2=[0.0, 0.0, GRAVITY_M_S2] + repeats * np.spacing(GRAVITY_M_S2),
        angular_velocities_body_rad_s=repeats * 1e-14,
    )


def test_samples_that_repeat_in_steady_flight_are_not_held(path: Path) -> None:
    """Where nothing but rounding changes, samples repeat because they are the same."""
    assert run_check(steady(MotionFile()).write(path), "imu.noise").outcome == "passed"


def test_held_samples_are_counted_in_hover(path: Path) -> None:
    """The least of motions is far above rounding: held samples are counted there too."""
    result = run_check(held(700, 6)(MotionFile(sample_motion(HOVER))).write(path), "imu.noise")
    assert measured(result, "frozen").value == 6


@pytest.mark.parametrize("excess", [0.5, -0.3])
def test_imu_noise_that_is_declared_wrongly_is_found_to_size(path: Path, excess: float) -> None:
    """Densities that are declared too large or small by a share are found, with that share."""
    declared = replace(
        NOISY, gyro_density=NOISY.gyro_density * (1 + excess), accel_density=NOISY.accel_density * (1 + excess)
    )
    file = MotionFile(sample_motion(noise=NOISY), declared)
    assert rules(run_check(file.write(path), "imu.noise")) == ["gyro", "accelerometer"]
    (diagnosis,) = diagnoses_of(path, "imu.noise")
    assert (diagnosis.cause, diagnosis.stream) == ("noise_misdeclared", "imu")
    assert diagnosis.magnitude == pytest.approx(100 * excess, abs=4 * (diagnosis.standard_error or 0.0))


def test_noise_where_none_is_declared_is_found(path: Path) -> None:
    """Gyro noise in a file that declares none fails, with its size."""
    noise = replace(EXACT, gyro_density=1e-5)
    result = run_check(MotionFile(sample_motion(noise=noise)).write(path), "imu.noise")
    assert rules(result) == ["gyro"]
    assert measured(result, "gyro_noise").value == pytest.approx(1e-5 * np.sqrt(1000), rel=0.15)


@pytest.mark.parametrize("count", [0, 1, 2, 9])
@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_a_handful_of_samples_is_not_observable(path: Path, stream: str, count: int) -> None:
    """Few samples of either stream: every comparison says that it cannot be made, and none breaks."""
    s = sample_motion()
    names = {
        "imu": ("imu_times_s", "angular_velocities_body_rad_s", "specific_forces_body_m_s2"),
        "pose": ("pose_times_s", "positions_world_m", "orientations_xyzw"),
    }[stream]
    MotionFile().altered(**{name: getattr(s, name)[:count] for name in names}).write(path)
    results = check_file(path, CheckOptions(select=CHECKS[:3])).record.results
    assert {result.outcome for result in results} == {"not_observable"}


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


def test_without_declarations_exact_samples_are_held_to_the_defaults(path: Path) -> None:
    """A file that declares nothing of IMU and pose is held to standard gravity, and the finding says so."""
    MotionFile().write(path)
    with h5py.File(path, "r+") as file:
        del file["metadata"]
    result = run_check(path, "imu.translation")
    assert rules(result) == ["gravity"]
    assert measured(result, "gravity").value == pytest.approx(GRAVITY_M_S2 - 9.80665, abs=1e-4)
    assert run_check(path, "imu.rotation").outcome == "passed"


def test_streams_that_do_not_overlap_are_not_compared(path: Path) -> None:
    """An IMU stamped minutes later shares no instant with the poses."""
    result = run_check(imu_timestamps(lambda t: t + 300.0)(MotionFile()).write(path), "imu.rotation")
    assert result.outcome == "not_observable"
    assert "overlap" in result.reason

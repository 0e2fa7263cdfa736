"""Hypotheses for alarms of the IMU: rivals of a cause, turned axes, the gravity that deviates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.checks.imu.agreement import InertialParameter, ResidualSmoothness
from fedora_qa.diagnosis.imu import (
    TimingCues,
    convention_hypotheses,
    gravity_likelihoods,
    parameter_hypotheses,
    timing_cues_of,
)
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.imu.conventions import InertialConvention
from fedora_qa.estimators.imu.samples import InertialNoise
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.sample_defect_detection import clipped_samples, held_components
from fedora_qa.views.sample_defects import HeldComponent
from tests.support.facts import MS, clock, exact_facts, with_clock
from tests.support.motion_world import EXACT, GRAVITY_M_S2, HOVER, NOISY, MotionFile, sample_motion
from tests.support.proposals import proposed

TURN = Rotation.from_rotvec(np.radians([8.0, -6.0, 3.0]))


def support_of_bias(delay_explains: float, bias_explains: float) -> float:
    """Support of a gyro's bias behind a delay of 8 ms, by how much either explains."""
    explained = {"time_offset": delay_explains, "bias": bias_explains}
    delay = InertialParameter("rotation", "time_offset", 0.008, 1e-6, 1.0, explained)
    hypotheses = parameter_hypotheses(delay, TimingCues(), GRAVITY_M_S2)
    return next(hypothesis.support for hypothesis in hypotheses if hypothesis.cause == "gyro_bias")


@pytest.mark.parametrize("rule", ["residual", "worst"])
def test_what_no_bias_fits_and_is_smooth_may_be_one_that_walks(rule: str) -> None:
    """Of the gyro; another motion is as smooth, and ruled out by the gain."""
    walking = proposed(f"imu.rotation.{rule}", ResidualSmoothness(0.9), stream="imu")
    assert max(h.support for h in walking if h.cause == "gyro_bias") == pytest.approx(0.45)
    of_force = proposed(f"imu.translation.{rule}", ResidualSmoothness(0.9), stream="imu")
    assert all(hypothesis.cause != "gyro_bias" for hypothesis in of_force)


def test_a_rival_that_leaves_what_the_cause_explains_is_contradicted() -> None:
    """Of 90% that a bias explains nothing counts where a delay explains everything to a millionth."""
    assert support_of_bias(1.0 - 1e-6, 0.9) < 0.01
    assert support_of_bias(1.0, 0.9) == 0.0


@pytest.mark.parametrize("rival", [0.9, 0.95, 1.0])
def test_a_rival_that_leaves_no_more_counts_in_full(rival: float) -> None:
    """It is then as good an explanation as the cause itself."""
    assert support_of_bias(0.9, rival) == pytest.approx(0.9 * rival)


def test_a_rival_that_leaves_little_more_stays_likely() -> None:
    """Twice as much is left: by one sample's likelihood, a factor of the square root of two."""
    assert support_of_bias(0.9, 0.8) == pytest.approx(0.9 * 0.8 / 2**0.5)


def test_a_turned_imu_beside_noisy_poses_is_blamed_and_not_the_poses(tmp_path: Path) -> None:
    """What the gyro shows as a turn, and forces as a slope of gravity, is one convention of the IMU."""
    samples = sample_motion(noise=NOISY)
    turned = replace(
        samples,
        angular_velocities_body_rad_s=TURN.apply(samples.angular_velocities_body_rad_s),
        specific_forces_body_m_s2=TURN.apply(samples.specific_forces_body_m_s2),
    )
    path = MotionFile(samples=turned, declared=NOISY).write(tmp_path / "motion.h5")
    first = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record.diagnoses[0]
    assert (first.cause, first.stream) == ("frame_convention", "imu")


@pytest.mark.parametrize("limit", [0.97, 0.995])
def test_forces_at_a_limit_are_no_bias(tmp_path: Path, limit: float) -> None:
    """A clip leaves samples below it as they were; a bias moves all. No cause names a limit."""
    samples = sample_motion()
    largest = limit * np.abs(samples.specific_forces_body_m_s2).max()
    clipped = replace(samples, specific_forces_body_m_s2=samples.specific_forces_body_m_s2.clip(-largest, largest))
    path = MotionFile(samples=clipped).write(tmp_path / "motion.h5")
    record = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record
    assert {diagnosis.cause for diagnosis in record.diagnoses} == {"unknown"}


def test_an_imu_without_weight_is_of_no_other_flight(tmp_path: Path) -> None:
    """Every vehicle has its weight: angles and velocities gained in a millisecond are another unit."""
    samples = sample_motion(duration_s=1.0)
    gained = replace(
        samples,
        angular_velocities_body_rad_s=samples.angular_velocities_body_rad_s / 1000,
        specific_forces_body_m_s2=samples.specific_forces_body_m_s2 / 1000,
    )
    path = MotionFile(samples=gained).write(tmp_path / "motion.h5")
    record = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record
    assert {diagnosis.cause for diagnosis in record.diagnoses} == {"unknown"}


@pytest.mark.parametrize(("taken", "noise"), [("mean", EXACT), ("first", EXACT), ("mean", NOISY)])
def test_a_weight_that_was_taken_off_as_a_constant_is_missing(tmp_path: Path, taken: str, noise: InertialNoise) -> None:
    """The mean of all samples, or the first one, is gravity in the body: no sensor has a bias of its weight."""
    samples = sample_motion(HOVER, noise)
    forces = samples.specific_forces_body_m_s2
    constant = forces.mean(axis=0) if taken == "mean" else forces[0]
    path = MotionFile(replace(samples, specific_forces_body_m_s2=forces - constant), noise).write(tmp_path / "m.h5")
    record = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record
    (cause,) = record.diagnoses
    assert (cause.cause, cause.stream) == ("gravity_missing", "imu")
    assert cause.status == "confirmed" or noise is NOISY


@pytest.mark.parametrize("noise", [EXACT, NOISY])
def test_a_gravity_that_nothing_on_earth_has_is_declared_wrongly(tmp_path: Path, noise: InertialNoise) -> None:
    """Samples with the weight of a body on Earth are in the right unit, whatever gravity is declared."""
    declared = replace(noise, gravity_m_s2=1.0)
    path = MotionFile(sample_motion(noise=noise), declared).write(tmp_path / "motion.h5")
    cause = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record.diagnoses[0]
    assert (cause.cause, cause.stream, cause.status) == ("gravity_magnitude", "metadata", "confirmed")
    assert cause.magnitude == pytest.approx(1.0 - GRAVITY_M_S2, abs=0.01)


def test_a_weight_in_units_of_g_is_not_missing(tmp_path: Path) -> None:
    """It is as steady as any weight."""
    samples = sample_motion(HOVER)
    in_g = replace(samples, specific_forces_body_m_s2=samples.specific_forces_body_m_s2 / GRAVITY_M_S2)
    path = MotionFile(samples=in_g).write(tmp_path / "motion.h5")
    record = check_file(path, CheckOptions(select=("imu", "pose"), evidence=None)).record
    assert "gravity_missing" not in {diagnosis.cause for diagnosis in record.diagnoses}


def test_a_unit_of_a_part_is_named_by_its_noise(tmp_path: Path) -> None:
    """A gyro that writes deg/s for a while has 57.3 times the noise there: no declaration is wrong, nor all samples."""
    samples = sample_motion(noise=NOISY)
    rates = samples.angular_velocities_body_rad_s.copy()
    first, stop = len(rates) // 5, len(rates) // 2
    rates[first:stop] = np.degrees(rates[first:stop])
    file = MotionFile(samples=replace(samples, angular_velocities_body_rad_s=rates), declared=NOISY)
    record = check_file(file.write(tmp_path / "motion.h5"), CheckOptions(select=("imu", "pose"), evidence=None)).record
    (cause,) = record.diagnoses
    assert (cause.cause, cause.stream, cause.status) == ("unit_deg_rad", "imu", "confirmed")


def test_samples_end_at_a_limit_where_they_repeat_it_alone() -> None:
    """Rounded samples repeat other values as well; a motion repeats none, and a level flight has one value alone."""
    motion = np.random.default_rng(0).normal(size=(400, 3))
    assert clipped_samples(motion) == ()
    assert clipped_samples(np.rint(motion * 4) / 4) == ()
    assert clipped_samples(motion.clip(None, 1.5)) != ()
    assert clipped_samples(motion.clip(-1.5, None)) != ()
    assert clipped_samples(motion * [1, 1, 0]) == ()


@pytest.mark.parametrize("value", [0.0, None], ids=["zero", "the value before"])
@pytest.mark.parametrize("noise", [None, NOISY], ids=["exact", "noisy"])
def test_a_component_that_stands_still_for_a_while_is_frozen(
    value: float | None, noise: InertialNoise | None, tmp_path: Path
) -> None:
    """Neither a bias nor a turn, which the fit makes of the motion that is lacking."""
    samples = sample_motion(noise=noise)
    rates = samples.angular_velocities_body_rad_s.copy()
    rows = slice(len(rates) // 3, len(rates) // 2)
    rates[rows, 1] = rates[rows.start, 1] if value is None else value
    held = MotionFile(samples=replace(samples, angular_velocities_body_rad_s=rates), declared=noise or EXACT)
    record = check_file(held.write(tmp_path / "motion.h5"), CheckOptions(select=("imu", "pose"), evidence=None)).record
    first = record.diagnoses[0]
    assert (first.cause, first.stream) == ("frozen_frames", "imu")
    assert first.magnitude == rows.stop - rows.start


def test_components_that_rest_or_never_vary_or_are_coarse_are_not_held() -> None:
    """A hold begins or ends with a jump, and is longer than chance makes it."""
    motion = np.cumsum(np.random.default_rng(0).normal(size=(1000, 3)), axis=0)
    held = motion.copy()
    held[300:400, 2] = 0.5 + motion[300, 2]
    assert held_components(held, 1e-16) == (HeldComponent(100),)
    assert held_components(motion, 1e-16) == ()
    assert held_components(motion * [1, 1, 0], 1e-16) == ()
    assert held_components(np.rint(motion / 8) * 8, 1e-16) == ()
    # A body that slows down, rests and speeds up.
    resting = np.minimum(np.maximum(np.abs(np.arange(1000) - 500) - 60, 0) ** 2 / 1e4, 9.0)
    assert held_components(np.column_stack((resting, motion[:, :2])), 1e-16) == ()
    # A sensor at its limit.
    assert held_components(np.minimum(motion, np.quantile(motion, 0.7, axis=0)), 1e-16) == ()


def test_a_slope_of_gravity_alone_is_the_world_of_the_poses() -> None:
    """A sensor would be turned in its rates as well."""
    slope = InertialParameter("translation", "slope_x", 0.3, 0.01, 1.0, {"slope": 1.0})
    first, second = parameter_hypotheses(slope, TimingCues(), GRAVITY_M_S2)
    assert (first.stream, second.stream) == ("pose", "imu")
    assert first.support > second.support


@pytest.mark.parametrize(("name", "lesser"), [("bias_x", 1.0), ("bias_y", 0.5)])
def test_a_smaller_component_of_a_vector_supports_its_cause_less(name: str, lesser: float) -> None:
    """The largest component shows the size of the fault."""
    ratio = 2 * lesser - 1.0
    bias = InertialParameter("rotation", name, 0.01 * ratio, 1e-6, ratio, {"bias": 1.0})
    (hypothesis,) = parameter_hypotheses(bias, TimingCues(), GRAVITY_M_S2)
    assert hypothesis.support == pytest.approx(lesser)


US = 1000


def moved(stream: str, offset_ns: int, facts: Facts | None = None) -> Facts:
    facts = facts or exact_facts()
    return with_clock(facts, stream, clock(facts.clocks[stream].times_ns + offset_ns))


def later_of(timing_cues: TimingCues) -> str:
    """The stream that the clues blame, or neither."""
    if timing_cues.imu_offset == timing_cues.pose_offset:
        return "neither"
    return "imu" if timing_cues.imu_offset > timing_cues.pose_offset else "pose"


@pytest.mark.parametrize("offset_ns", [3 * US, -7 * US, 1 * MS, 10 * MS, 40 * MS])
@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_the_clock_that_left_the_frames_is_the_late_one(stream: str, offset_ns: int) -> None:
    """Frames fall on the stamps of the stream that stayed, or begin with it where the offset is a whole period."""
    assert later_of(timing_cues_of(moved(stream, offset_ns))) == stream


@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_without_frames_the_grid_of_timestamps_tells(stream: str) -> None:
    """With IMU and pose alone, the stream whose stamps are multiples of its period stayed."""
    facts = exact_facts()
    alone = replace(facts, clocks={name: facts.clocks[name] for name in ("imu", "pose")})
    assert later_of(timing_cues_of(moved(stream, 3 * US, alone))) == stream


def test_clocks_that_all_stay_or_all_left_tell_nothing() -> None:
    """Equal treatment leaves both alike: a synchronous file, and one whose every clock has its own phase."""
    assert later_of(timing_cues_of(exact_facts())) == "neither"
    assert later_of(timing_cues_of(moved("imu", 3 * US, moved("pose", 17 * US)))) == "neither"


@pytest.mark.parametrize(("declared", "excess", "error", "blamed"), [
    (9.80665, 5e-5, 2e-6, "imu"),
    (9.80670, -5e-5, 2e-6, "metadata"),
    (9.80665, 0.3, 0.03, "imu"),
    (10.1, -0.3, 0.03, "metadata"),
])  # fmt: skip
def test_an_unusual_gravity_is_the_wrong_one(declared: float, excess: float, error: float, blamed: str) -> None:
    """Of measured and declared gravity the one that nobody uses is blamed; an uncertain one gets the benefit."""
    sensor, declaration = gravity_likelihoods(declared, excess, error)
    assert ("imu" if sensor >= declaration else "metadata") == blamed


@pytest.mark.parametrize(
    ("convention", "named"),
    [
        (InertialConvention(sensor_axes=((-1, 0, 0), (0, -1, 0), (0, 0, -1))), {("gravity_sign", "imu")}),
        (InertialConvention(gravity="subtracted along z"), {("gravity_missing", "imu")}),
        (InertialConvention(up=(0, 1, 0)), {("frame_convention", "pose")}),
        (InertialConvention(angle_signs=(-1, 1, 1)), {("frame_convention", "pose")}),
        (
            InertialConvention(sensor_axes=((1, 0, 0), (0, -1, 0), (0, 0, 1)), length_unit=100.0),
            {("frame_convention", "pose"), ("frame_convention", "imu"), ("unit_mm_m", "pose")},
        ),
    ],
)
def test_a_convention_of_forces_names_the_stream_that_is_written_in_it(
    convention: InertialConvention, named: set[tuple[str, str]]
) -> None:
    """The vertical is that of the poses; all axes reversed are the sign of the accelerometer."""
    hypotheses = convention_hypotheses("translation", replace(convention, declared_residual=1e4))
    assert {(hypothesis.cause, hypothesis.stream) for hypothesis in hypotheses} == named

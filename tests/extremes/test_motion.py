"""Motion from a hundred-millionth of a radian to a hundred radians a second."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_generator.faults import plant_fault
from fedora_qa.estimators.imu.samples import InertialSamples
from tests.extremes.files import alarms, generated, named, outcomes, park, record_of
from tests.support.checked import checks_that_read
from tests.support.motion_world import RESTLESS, MotionFile, sample_motion

OF_MOTION = (
    "pose.orientation",
    "pose.continuity",
    "pose.noise",
    "imu.rotation",
    "imu.translation",
    "imu.timing",
    "imu.noise",
)
FOCAL_PX = 180 / (2 * np.tan(np.radians(30)))


def turning(rate_rad_s: float, axis: tuple[float, float, float], start: Rotation | None = None) -> InertialSamples:
    """A second of steady rotation about an axis of the body, which sways a little, in closed form."""
    unit = np.array(axis) / np.linalg.norm(axis)
    imu_s, pose_s = np.arange(1001) / 1000, np.arange(201) / 200
    amplitudes, omega = np.array([0.06, 0.02, 0.01]), np.array([3.0, 4.0, 5.0])

    def attitude(times_s: np.ndarray) -> Rotation:
        return (start or Rotation.identity()) * Rotation.from_rotvec(np.outer(times_s * rate_rad_s, unit))

    accelerations = -amplitudes * omega**2 * np.sin(np.outer(imu_s, omega)) + [0.0, 0.0, 9.81]
    return InertialSamples(
        imu_times_s=imu_s,
        angular_velocities_body_rad_s=np.tile(rate_rad_s * unit, (len(imu_s), 1)),
        specific_forces_body_m_s2=attitude(imu_s).inv().apply(accelerations),
        pose_times_s=pose_s,
        positions_world_m=amplitudes * np.sin(np.outer(pose_s, omega)),
        orientations_xyzw=attitude(pose_s).as_quat(),
    )


WHIRLED = replace(RESTLESS, amplitudes=(20.0, *RESTLESS.amplitudes[1:]))
"""Yaw to and fro at up to 100 rad/s."""

HONEST = {
    "1e-8 rad in a second": turning(1e-8, (1, 2, 3)),
    "1e-8 rad a step": turning(1e-8 * 200, (1, 2, 3)),
    "through pi about z": turning(0.5, (0, 0, 1), Rotation.from_rotvec([0, 0, np.pi - 0.25])),
    "a nanoradian short of pi about x": turning(0.5, (1, 0, 0), Rotation.from_rotvec([np.pi - 1e-9, 0, 0])),
    "100 rad/s": turning(100.0, (1, 2, 3)),
    "up to 100 rad/s to and fro": sample_motion(WHIRLED, duration_s=1.0),
    "no rotation at all": turning(0.0, (0, 0, 1)),
}


@pytest.mark.parametrize("samples", HONEST.values(), ids=HONEST)
def test_any_rotation_is_clean(samples: InertialSamples, tmp_path: Path) -> None:
    """Right: exact streams agree whatever the angle; where a parameter cannot be seen the reason names it."""
    record = record_of(MotionFile(samples).write(tmp_path / "motion.h5"), "pose", "imu")
    assert not alarms(record)
    assert set(outcomes(record).values()) <= {"passed", "not_observable"}


def test_what_a_steady_axis_hides_is_named(tmp_path: Path) -> None:
    """Right: turning about one axis, a tilt of the IMU about that axis cannot be seen, and the pass says so."""
    record = record_of(MotionFile(turning(100.0, (0, 0, 1))).write(tmp_path / "motion.h5"), "imu.rotation")
    (result,) = record.results
    assert result.outcome == "passed"
    assert "tilt_z" in result.reason
    assert "tilt_x" not in result.reason


@pytest.mark.parametrize("name", ["100 rad/s", "up to 100 rad/s to and fro", "through pi about z"])
def test_a_late_imu_is_measured_at_any_rate(name: str, tmp_path: Path) -> None:
    """Right: 0.3 ms late is found and measured within its error, at any angle and rate.

    In a steady turn of 100 rad/s what the fit of the offset leaves reads as a lever arm of 70 nm too, which the motion
    tells to 3 nm: the offset is then named second.
    """
    samples = HONEST[name]
    late = replace(samples, imu_times_s=samples.imu_times_s + 0.0003)
    diagnoses = record_of(MotionFile(late).write(tmp_path / "late.h5"), "imu").diagnoses
    late_by = [one for one in diagnoses if one.cause == "time_offset" and one.stream in {"imu", "pose"}]
    assert diagnoses.index(late_by[0]) <= (name == "100 rad/s")
    assert late_by[0].magnitude is not None
    assert abs(late_by[0].magnitude) == pytest.approx(0.3, rel=0.02)


def test_quaternions_of_either_sign_are_one_rotation(tmp_path: Path) -> None:
    """Right: q and -q by turns are clean, near a half turn too."""
    samples = HONEST["through pi about z"]
    signs = np.where(np.arange(len(samples.pose_times_s)) % 2, 1.0, -1.0)[:, None]
    turned = replace(samples, orientations_xyzw=signs * samples.orientations_xyzw)
    assert not alarms(record_of(MotionFile(turned).write(tmp_path / "signs.h5"), "pose", "imu"))


def test_a_thousand_kilometres_out_is_as_good_as_here(tmp_path: Path) -> None:
    """Right: float64 positions far out are clean, at a sensitivity that is stated."""
    samples = sample_motion(duration_s=1.0)
    far = replace(samples, positions_world_m=samples.positions_world_m + np.array([1e6, -1e6, 1e3]))
    assert not alarms(record_of(MotionFile(far).write(tmp_path / "far.h5"), "pose", "imu"))


@pytest.fixture(scope="module")
def whirl(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of the park from a camera that turns by 60 px in 40 ms, and by 150 px in 0.1 s."""
    rate_deg_s = float(np.degrees(60 / FOCAL_PX / 0.04))
    scene = park()
    return generated(
        replace(scene, flight=replace(scene.flight, yaw_rate_deg_s=rate_deg_s)),
        tmp_path_factory.mktemp("motion") / "whirl.h5",
    )


def test_sixty_pixels_of_flow_are_clean(whirl: Path) -> None:
    """Right: no check that holds streams against each other alarms, though most of the image leaves it."""
    record = record_of(whirl)
    crossing = [text for text in alarms(record) if not text.startswith("event_stream.duplicates")]
    assert not crossing


WHIRLED_FAULTS = {
    "flow of 10% too much": ("flow_gain", "flow", 10.0, 10.0),
    "flow backwards": ("flow_sign", "flow", None, None),
    "events 5 ms late": ("time_offset", "events", 5.0, 5.0),
}


@pytest.mark.parametrize(("cause", "stream", "planted", "found"), WHIRLED_FAULTS.values(), ids=WHIRLED_FAULTS)
def test_faults_in_sixty_pixels_of_flow_are_named(
    cause: str, stream: str, planted: float | None, found: float | None, whirl: Path, tmp_path: Path
) -> None:
    """Right: cause, stream and size, as in slow flight, by all checks that read the stream."""
    faulty = tmp_path / "faulty.h5"
    plant_fault(whirl, faulty, cause, stream, planted, "ms" if cause == "time_offset" else None)
    record = record_of(faulty, *checks_that_read(stream))
    first = record.diagnoses[0]
    assert named(record)[0] == (stream, cause)
    if found is not None:
        assert first.magnitude == pytest.approx(found, rel=0.05)

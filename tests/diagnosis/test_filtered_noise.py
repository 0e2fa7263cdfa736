"""Noise that a filter or an interpolation has taken is no wrong declaration; white noise is one."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation, RotationSpline

from fedora_qa.diagnosis.filtered_noise import NoiseTaken
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import Diagnosis
from tests.support.motion_world import NOISY, MotionFile, sample_motion

Filter = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def first_of(file: MotionFile, tmp_path: Path, *select: str) -> Diagnosis:
    """Return the first diagnosis of a file, by all checks of IMU and poses or by some."""
    path = file.write(tmp_path / "motion.h5")
    return check_file(path, CheckOptions(select=select or ("imu", "pose"), evidence=None)).record.diagnoses[0]


def backwards(count: int) -> Filter:
    """Return the mean over the last samples."""
    return lambda values: np.asarray(lfilter(np.full(count, 1 / count), 1.0, values - values[0], axis=0) + values[0])


@pytest.mark.parametrize(
    ("altered", "cause"),
    [
        (backwards(12), "time_offset"),
        (lambda values: gaussian_filter1d(values, 8.0, axis=0, mode="nearest"), "noise_misdeclared"),
    ],
    ids=["looks back", "has no delay"],
)
def test_an_imu_behind_a_filter_is_late_where_the_filter_looks_back(
    altered: Filter, cause: str, tmp_path: Path
) -> None:
    """Both take most of the noise between neighbours; the offset that is measured tells them apart."""
    samples = sample_motion(noise=NOISY)
    filtered = replace(
        samples,
        angular_velocities_body_rad_s=altered(samples.angular_velocities_body_rad_s),
        specific_forces_body_m_s2=altered(samples.specific_forces_body_m_s2),
    )
    first = first_of(MotionFile(filtered, NOISY), tmp_path)
    assert (first.cause, first.stream) == (cause, "imu")


def test_poses_on_cubic_curves_between_noisy_ones_are_interpolated(tmp_path: Path) -> None:
    """Every tenth pose has its noise, and those between have no own."""
    samples = sample_motion(noise=NOISY)
    times_s = samples.pose_times_s
    kept = np.unique(np.r_[0 : len(times_s) : 10, len(times_s) - 1])
    attitudes = Rotation.from_quat(samples.orientations_xyzw[kept])
    smooth = replace(
        samples,
        positions_world_m=CubicSpline(times_s[kept], samples.positions_world_m[kept])(times_s),
        orientations_xyzw=RotationSpline(times_s[kept], attitudes)(times_s).as_quat(),
    )
    first = first_of(MotionFile(smooth, NOISY), tmp_path, "pose")
    assert (first.cause, first.stream) == ("interpolated_pose", "pose")
    rate_hz = (len(times_s) - 1) / (times_s[-1] - times_s[0])
    assert first.magnitude == pytest.approx(rate_hz / 10, rel=1e-3)


@pytest.mark.parametrize("factor", [4.0, 0.25])
def test_white_noise_that_is_declared_wrongly_stays_so(factor: float, tmp_path: Path) -> None:
    """It is the same between neighbours and samples far apart, however much the declared one differs."""
    declared = replace(NOISY, gyro_density=factor * NOISY.gyro_density, accel_density=factor * NOISY.accel_density)
    first = first_of(MotionFile(sample_motion(noise=NOISY), declared), tmp_path)
    assert (first.cause, first.stream) == ("noise_misdeclared", "imu")


def test_only_a_declaration_that_is_too_large_is_shared() -> None:
    """More noise than declared is taken by no filter, and that of another stream not by this one."""
    taken = NoiseTaken("time_offset", "imu", 0.75)
    too_large = Hypothesis("noise_misdeclared", "imu", 0.8, 300.0, "percent")
    others = [
        Hypothesis("noise_misdeclared", "imu", 0.8, -50.0, "percent"),
        Hypothesis("noise_misdeclared", "pose", 0.8, 300.0, "percent"),
        Hypothesis("unit_deg_rad", "imu", 0.8, 57.3, "1"),
    ]
    kept, shared, *rest = taken.divided([too_large, *others])
    assert (kept.cause, shared.cause) == ("noise_misdeclared", "time_offset")
    assert [kept.support, shared.support] == pytest.approx([0.2, 0.6])
    assert rest == others

"""Three checks conclude from the same samples of IMU and pose: they compute once what they share."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.imu.sequence_fit import fit_inertial
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.sequence.window import ImuSamples, PoseSamples
from fedora_qa.views import inertial_agreement
from fedora_qa.views.inertial_agreement import WindowMotion, streams_of
from tests.support.facts import exact_facts
from tests.support.motion_world import NOISY, MotionFile, sample_motion

CHECKS = ("imu.rotation", "imu.translation", "imu.timing")
TIMES_NS = np.arange(100) * 5_000_000
IMU = ImuSamples(TIMES_NS, np.zeros((100, 3)), np.zeros((100, 3)))
POSES = PoseSamples(TIMES_NS, np.zeros((100, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (100, 1)))


def measured(path: Path, *checks: str) -> dict[str, list[tuple[str, float, float]]]:
    """What each check measures: names, values, and errors. Limits depend on how many checks share the alarms."""
    results = check_file(path, CheckOptions(select=checks, evidence=None)).record.results
    return {one.check: [(m.name, m.value, m.standard_error) for m in one.measurements] for one in results}


def test_each_comparison_is_fitted_once_and_measures_what_each_check_does_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two fits for three checks, where each alone takes one, one and two; what is measured is equal to the last bit."""
    path = MotionFile(samples=sample_motion(noise=NOISY), declared=NOISY).write(tmp_path / "motion.h5")
    fitted: list[object] = []

    def counted(*args: Any, **options: Any) -> InertialFit | None:
        fitted.append(args)
        return fit_inertial(*args, **options)

    monkeypatch.setattr(inertial_agreement, "fit_inertial", counted)
    together = measured(path, *CHECKS)
    assert len(fitted) == 2
    for check in CHECKS:
        assert together[check]
        assert measured(path, check)[check] == together[check]
    assert len(fitted) == 2 + 4


def test_only_equal_samples_of_the_same_file_share() -> None:
    """Other samples, another file's facts, and samples that came from another process are looked at anew."""
    facts, others = exact_facts(), exact_facts()
    known = streams_of([WindowMotion(IMU, POSES)], facts)
    motion = WindowMotion(IMU, POSES)
    first = streams_of([motion], facts)
    assert streams_of([motion], facts) is first
    assert known is not first
    assert streams_of([WindowMotion(IMU, None), motion], facts) is not first
    again = streams_of([motion], facts)
    assert streams_of([motion], others) is not again
    assert pickle.loads(pickle.dumps(motion)).cache.streams is None

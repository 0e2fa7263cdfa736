"""Measurements that are in order contradict a cause only where they would have measured it."""

import pytest

from fedora_qa.diagnosis.vetoes import contradicts
from fedora_qa.record.types import Measurement, Result


@pytest.mark.parametrize(("length_m", "is_contradicted"), [(1.6e-5, False), (1.8e-5, True)])
def test_a_jump_may_lie_where_the_motion_hides_it_best(length_m: float, is_contradicted: bool) -> None:
    """A jump has three components, each of which is known to 10 um where the body turns most: sqrt(3) 10 um = 17 um."""
    jump = Measurement("position_jump", 1e-7, "m", 4e-7, 0.0, 6e-6, 8e-6, tests=90, least_detectable_range=(3e-6, 1e-5))
    results = {"pose.continuity": Result("pose.continuity", "passed", "continuous", measurements=(jump,))}
    assert contradicts("teleport", "pose", length_m, results, {}) == is_contradicted


def test_jumps_that_fail_contradict_no_teleport() -> None:
    jump = Measurement("position_jump", 1e-3, "m", 4e-7, 0.0, 6e-6, 8e-6)
    results = {"pose.continuity": Result("pose.continuity", "failed", "jumps", measurements=(jump,))}
    assert not contradicts("teleport", "pose", 1e-3, results, {})

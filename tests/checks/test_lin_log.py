"""A sensor that is linear in the dark is compared by its declared response."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.checks.event_file import DURATION_MS, LOG_WORLD, SHAPE, EventFile, frames_of
from tests.estimators.event_world import MS, log_events
from tests.support.checked import run_check

BELOW_DN = 80.0
WORLD = replace(LOG_WORLD, mean_dn=70.0, amplitude_dn=8.0)
"""Light on both sides of ``BELOW_DN``."""


@cache
def lin_log_file(threshold: float = 0.2) -> EventFile:
    def response(luma_dn: np.ndarray) -> np.ndarray:
        line = luma_dn * np.log(BELOW_DN) / BELOW_DN
        return np.where(luma_dn < BELOW_DN, line, np.log(np.maximum(luma_dn, 1.0)))

    events = log_events(WORLD, SHAPE, DURATION_MS * MS, threshold, threshold, response=response)
    return EventFile(events, frames_of(WORLD))


@pytest.mark.parametrize("check", ["conservation", "orientation", "alignment", "timing", "threshold"])
def test_a_declared_response_is_clean(check: str, tmp_path: Path) -> None:
    path = lin_log_file().declaring(linear_below_dn=BELOW_DN).write(tmp_path / "declared.h5")
    assert run_check(path, f"event_response.{check}").outcome == "passed"


@pytest.mark.parametrize("check", ["conservation", "threshold"])
def test_a_response_that_is_not_declared_is_a_fault(check: str, tmp_path: Path) -> None:
    """Below T the slope of the line, ln(T) / T, is more than 1 / Y near T, and less in the dark."""
    path = lin_log_file().write(tmp_path / "undeclared.h5")
    assert run_check(path, f"event_response.{check}").outcome == "failed"


@pytest.mark.parametrize("wrong", [1.1, 0.8])
def test_thresholds_are_those_of_the_response(wrong: float, tmp_path: Path) -> None:
    """A declaration that is off by a tenth or a fifth is measured, whatever the light."""
    file = lin_log_file().declaring(linear_below_dn=BELOW_DN, threshold_on=0.2 * wrong, threshold_off=0.2 * wrong)
    result = run_check(file.write(tmp_path / "wrong.h5"), "event_response.threshold")
    assert [measurement.value for measurement in result.measurements] == pytest.approx([100 / wrong - 100] * 2, abs=2.0)

"""Every proposal is a fault of the table, of its own cause and stream, with the size that was fitted."""

import pytest

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.diagnosis.proposed_faults import faults_for, is_length_unit, is_testable
from fedora_qa.faults.table import faults_of
from fedora_qa.record.types import Measurement, Result
from tests.support.memory_sequence import facts_of, memory_sequence

NEED_ROWS = {"teleport", "swapped_frames", "noise_misdeclared"}
"""Causes whose faults need rows, or numbers, that no check states yet: they are not undone."""


def result(check: str, **values: float) -> tuple[str, Result]:
    measurements = tuple(Measurement(name, value, "1", 0.1, 0.0, 0.2, 0.3) for name, value in values.items())
    return check, Result(check, "failed", "?", measurements=measurements)


RESULTS = dict(
    [
        result("imu.rotation", bias_x=0.1, bias_y=-0.2, bias_z=0.05),
        result("imu.translation", bias_x=0.1, bias_y=-0.2, bias_z=0.05, lever_x=0.3, lever_y=0.0, lever_z=-0.1),
        result("event_response.threshold", threshold_on=25.0, threshold_off=-20.0),
        result("images.channels", towards_BGR=0.9, towards_RBG=0.2),
        result("images.transfer", exponent=2.2),
    ]
)


def size_of(cause: str) -> float:
    """Return a size that is legal for a cause."""
    return 1000.0 if CAUSES[cause].unit == "1" and cause != "quaternion_not_unit" else 2.0


@pytest.mark.parametrize(
    ("cause", "stream"),
    [(cause, stream) for cause in CAUSES for stream in CAUSES[cause].streams if faults_of(cause, stream)],
)
def test_proposals_are_of_the_table(cause: str, stream: str) -> None:
    """Causes with an inverse are proposed, in each stream, but for those that need rows."""
    facts = facts_of(memory_sequence())
    faults = list(faults_for(cause, stream, size_of(cause), (), RESULTS, facts))
    # Axes are known from a trial of conventions only, which has no alarm here.
    without = cause in NEED_ROWS or (cause in ("axes_swapped", "frame_convention") and stream in ("imu", "pose"))
    assert bool(faults) or without or (cause, stream) == ("lever_arm", "metadata")
    for fault in faults:
        assert isinstance(fault, faults_of(cause, stream))
        assert (fault.cause, stream_family(fault.stream)) == (cause, stream)


def test_a_size_that_was_not_fitted_is_not_undone() -> None:
    """A late stream without a delay; a mirrored one needs no size."""
    facts = facts_of(memory_sequence())
    assert not is_testable("time_offset", "events", None)
    assert not is_testable("time_offset", "events", 0.0)
    assert not list(faults_for("time_offset", "events", float("nan"), (), RESULTS, facts))
    assert is_testable("mirrored", "events", None)
    assert not is_testable("dropped_samples", "events", 3.0)


def test_thresholds_are_those_that_were_fitted() -> None:
    """Steps 25% larger than declared: the declaration is a fifth too small; 20% smaller: a quarter too large."""
    (fault,) = faults_for("threshold_misdeclared", "events", 2.0, (), RESULTS, facts_of(memory_sequence()))
    assert fault.on_percent == pytest.approx(-20.0)  # type: ignore[attr-defined]  # of this class of faults
    assert fault.off_percent == pytest.approx(25.0)  # type: ignore[attr-defined]


def test_units_of_length() -> None:
    """Millimetres, feet and nautical miles; a calibration that is off by some percent is none."""
    assert all(is_length_unit(factor) for factor in (1000.0, 0.001, 0.3048, 1 / 0.3048, 1852.0, 1000.4))
    assert not any(is_length_unit(factor) for factor in (1.0, 1.016, 0.95, 2.0, 500.0))

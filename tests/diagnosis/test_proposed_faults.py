"""Each proposal is a fault of the table, of its own cause and stream, with the fitted size."""

import numpy as np
import pytest

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.proposed_faults import faults_for, is_testable
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.fault import is_of_part
from fedora_qa.faults.images import DecodedTwice, PowerCurve, RayLength
from fedora_qa.faults.row_order import DelayedFrames
from fedora_qa.faults.table import faults_of
from fedora_qa.faults.units import FlowGain, LengthUnit
from fedora_qa.record.types import Measurement, Result
from fedora_qa.views.flow_conventions import ConventionTrial
from tests.support.memory_sequence import facts_of, memory_sequence
from tests.support.proposed_faults import RESULTS, alarm, failed_result, pairs_alarm

NEED_ROWS = {"teleport", "noise_misdeclared"}
"""Causes whose faults need rows or numbers that no check states. They are not undone."""


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


@pytest.mark.parametrize(("fitted", "first"), [(0.9, 1.0), (-0.9, -1.0), (0.0, 1.0)])
def test_rays_are_undone_in_the_direction_that_was_fitted(fitted: float, first: float) -> None:
    """Depth that was divided by the length of the ray is multiplied first; the other direction is tried as well."""
    results = dict([failed_result("depth.projection", ray_exponent=fitted)])
    faults = list(faults_for("depth_ray_not_z", "depth", None, (), results, facts_of(memory_sequence())))
    assert faults == [RayLength(first), RayLength(-first)]


@pytest.mark.parametrize(
    ("first", "last", "part"),
    [(1, 3, (2, 3)), (0, 3, (0, 3)), (1, -1, (2, None)), (0, -1, None)],
    ids=["within", "from the first frame", "to the last frame", "all"],
)
def test_a_fault_of_depth_is_undone_between_the_pairs_that_deviate(
    first: int, last: int, part: tuple[int, int | None] | None
) -> None:
    """Where a fault begins and ends, one frame of a pair has it; at an end of the file no pair shows that."""
    facts = facts_of(memory_sequence())
    count = len(facts.clocks["depth"].times_ns)
    alarms = (pairs_alarm(first, last % count),)
    period_ms = float(np.median(np.diff(facts.clocks["depth"].times_ns))) / NS_PER_MS

    def faults_of_part(cause: str, size: float | None) -> list[object]:
        return [fault for fault in faults_for(cause, "depth", size, alarms, {}, facts) if is_of_part(fault)]

    of_part = [part] if part else []
    assert faults_of_part("depth_ray_not_z", None) == [RayLength(1.0, rows) for rows in of_part]
    assert faults_of_part("unit_mm_m", 1000.0) == [LengthUnit("depth", 1000.0, rows) for rows in of_part]
    # Frames that were lost before the part leave the timestamps of all that follow too early.
    lost = [ClockShift("depth", -2 * period_ms * NS_PER_MS, rows) for rows in of_part if rows[1] is None]
    delayed = [DelayedFrames(-2, -2 * period_ms, rows) for rows in of_part]
    assert faults_of_part("time_offset", -2.01 * period_ms) == [*lost, *delayed]
    assert faults_of_part("time_offset", 2.0 * period_ms) == [DelayedFrames(2, 2 * period_ms, rows) for rows in of_part]
    assert not faults_of_part("time_offset", -1.5 * period_ms)


@pytest.mark.parametrize(("fitted", "exact"), [(0.3034, 0.3048), (994.2, 1000.0), (0.0995, 0.1)])
def test_a_ratio_of_units_is_exact(fitted: float, exact: float) -> None:
    """The ratio is undone first, then the one that was fitted."""
    for stream in ("depth", "pose"):
        faults = list(faults_for("unit_mm_m", stream, fitted, (), {}, facts_of(memory_sequence())))
        assert faults == [LengthUnit(stream, exact), LengthUnit(stream, fitted)]


@pytest.mark.parametrize(
    ("farthest_m", "error", "undone"), [(120.0, 0.1, 4.0), (120.0, 0.001, 3.95), (60.0, 0.1, 3.95)]
)
def test_a_factor_leaves_depths_in_their_range(farthest_m: float, error: float, undone: float) -> None:
    """Of the factors within three errors of the fitted one that with which the farthest depth is 30 m at most."""
    scale = Measurement("scale", 3.95, "1", error, 1.0, 0.2, 0.3)
    farthest = Measurement("farthest", farthest_m, "m", 0.0, 30.0, 0.0, 0.0, side="upper")
    results = {
        "depth.scale": Result("depth.scale", "failed", "off", measurements=(scale,)),
        "depth.range": Result("depth.range", "failed", "off", measurements=(farthest,)),
    }
    (fault,) = faults_for("unit_mm_m", "depth", 3.9, (), results, facts_of(memory_sequence()))
    assert fault == LengthUnit("depth", undone)


def test_factors_of_both_axes_are_undone_first() -> None:
    """Those of the field that follows them most closely; the fitted gain of both axes is tried as well."""
    features = [
        ConventionTrial("flow/10hz", "scaled_by_axis", "flow", share, v_percent, (0.0, v_percent))
        for share, v_percent in ((0.7, 13.0), (0.99, 14.0), (0.4, 15.0))
    ]
    faults = list(
        faults_for("flow_gain", "flow", 4.0, (alarm("toy.toy.off", *features),), {}, facts_of(memory_sequence()))
    )
    assert faults == [FlowGain("flow", 0.0, v_percent=14.0), FlowGain("flow", 4.0)]
    assert (
        list(
            faults_for("flow_gain", "flow", 4.0, (alarm("toy.toy.off", features[2]),), {}, facts_of(memory_sequence()))
        )
        == faults[1:]
    )


def test_thresholds_are_those_that_were_fitted() -> None:
    """Steps 25% larger than declared: the declaration is a fifth too small; 20% smaller: a quarter too large."""
    (fault,) = faults_for("threshold_misdeclared", "events", 2.0, (), RESULTS, facts_of(memory_sequence()))
    assert fault.on_percent == pytest.approx(-20.0)  # type: ignore[attr-defined]  # of this class of faults
    assert fault.off_percent == pytest.approx(25.0)  # type: ignore[attr-defined]


def test_no_threshold_has_the_sign_that_a_fit_of_another_cause_has() -> None:
    """A fit that is -0.3 of the declared threshold is 130% too small, and none is undone."""
    fitted = dict([failed_result("event_response.threshold", threshold_on=-130.0, threshold_off=4.0)])
    assert not list(faults_for("threshold_misdeclared", "events", 2.0, (), fitted, facts_of(memory_sequence())))


def test_codes_that_get_brighter_may_have_been_decoded_once_too_often() -> None:
    """An exponent that may be that of a display has the exact curve first; one far from it has a power alone."""
    facts = facts_of(memory_sequence())
    for exponent, first in ((0.5, DecodedTwice("srgb")), (0.9, PowerCurve(1 / 0.9)), (2.2, PowerCurve(1 / 2.2))):
        bent = dict([failed_result("images.transfer", exponent_at_declared_thresholds=exponent)])
        assert next(iter(faults_for("exposure_or_gamma", "rgb", None, (), bent, facts))) == first

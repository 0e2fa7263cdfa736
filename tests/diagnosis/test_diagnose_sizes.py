"""The size of a cause: signs, vectors, units and scales."""

from dataclasses import replace
from typing import Any

import pytest

from fedora_qa.diagnosis.conclusion import UndoTrial
from fedora_qa.diagnosis.hypothesis import Hypothesis
from tests.support.explained_alarms import UnplantedFault, alarm, candidates_of, diagnoses_of, undo_trial


def test_sizes_of_either_sign_are_no_one_fault() -> None:
    """An offset that is late by one finding and early by another explains only those that agree."""
    late, early = (Hypothesis("time_offset", "rgb", 0.45, size, "ms") for size in (20.0, -20.0))
    frozen = Hypothesis("frozen_frames", "rgb", 0.95, 3.0, "samples")
    diagnoses = diagnoses_of([alarm(1, late), alarm(2, late), alarm(3, early), alarm(4, frozen)])
    assert [(d.cause, d.explains) for d in diagnoses[:2]] == [("frozen_frames", ("F4",)), ("time_offset", ("F1", "F2"))]
    assert diagnoses[1].magnitude == 20.0


def test_a_finding_keeps_the_size_of_the_sign_that_the_others_have() -> None:
    """Two measurements of a rate by one finding, of which the weaker one agrees with the other findings, explain it."""
    fast, slow = (Hypothesis("clock_rate", "imu", 0.8, size, "ppm") for size in (60.0, -90.0))
    weaker = Hypothesis("clock_rate", "imu", 0.6, 50.0, "ppm")
    diagnoses = diagnoses_of([alarm(1, fast), alarm(2, fast), alarm(3, slow, weaker)])
    assert [(d.cause, d.explains) for d in diagnoses] == [("clock_rate", ("F1", "F2", "F3"))]
    assert (diagnoses[0].magnitude or 0) > 0


def test_a_size_that_is_not_known_contradicts_nothing() -> None:
    """A hypothesis without a size stands beside those of either sign."""
    early, some = Hypothesis("time_offset", "rgb", 0.9, -2.0, "ms"), Hypothesis("time_offset", "rgb", 0.3)
    assert diagnoses_of([alarm(1, early), alarm(2, some)])[0].explains == ("F1", "F2")


@pytest.mark.parametrize(
    ("factor", "trial", "cause"),
    [
        pytest.param(0.4, undo_trial("F1"), "truncated", id="by construction"),
        pytest.param(
            0.4, replace(undo_trial("F1"), agreeing=frozenset({"imu.timing"})), "time_unit", id="content agrees"
        ),
        pytest.param(
            0.4, replace(undo_trial("F1"), agreeing=frozenset({"imu.noise"})), "truncated", id="no comparison"
        ),
        pytest.param(0.4, undo_trial("F1", "F2"), "time_unit", id="clears content"),
        pytest.param(
            0.4, undo_trial("F1", "F2", caused=("imu.timing.time_offset",)), "truncated", id="brings some about"
        ),
        pytest.param(1e3, undo_trial("F1"), "time_unit", id="known unit"),
    ],
)
def test_a_stream_that_is_short_has_another_unit_where_its_content_agrees_with_it_undone(
    factor: float, trial: UndoTrial, cause: str
) -> None:
    """Stretched to the span of the others, a stream that was cut off ends with them, and agrees with none of them."""
    unit, cut = Hypothesis("time_unit", "imu", 0.7, factor, "1"), Hypothesis("truncated", "imu", 0.8, 60.0, "percent")
    explained = [alarm(1, unit, cut, code="clocks.span.ends_early")]
    if "F2" in trial.cleared:
        explained.append(alarm(2, Hypothesis("other_sequence", "imu", 0.3), code="imu.rotation.residual"))
    of_imu: Any = UnplantedFault("time_unit", "imu", factor)
    assert diagnoses_of(explained, {("time_unit", "imu"): replace(trial, fault=of_imu)})[0].cause == cause


def test_a_vector_has_its_length_for_a_size() -> None:
    """Three findings state one component each; the fault that was undone states the vector."""
    components = [alarm(i, Hypothesis("gyro_bias", "imu", 0.9, 0.01 * i, "rad/s", 0.001)) for i in (1, 2, 3)]
    diagnoses = diagnoses_of(components, {("gyro_bias", "imu"): undo_trial("F1", "F2", "F3", size=0.0374)})
    assert (diagnoses[0].magnitude, diagnoses[0].unit) == (0.0374, "rad/s")


def test_components_of_a_vector_have_signs_of_their_own() -> None:
    """A bias towards +x and -z is one fault, whose undoing explains both findings."""
    components = [alarm(i, Hypothesis("gyro_bias", "imu", 0.9, size, "rad/s")) for i, size in ((1, 0.05), (2, -0.09))]
    assert [d.explains for d in diagnoses_of(components)] == [("F1", "F2")]
    rates = [alarm(i, Hypothesis("clock_rate", "imu", 0.9, size, "ppm")) for i, size in ((1, 50.0), (2, -90.0))]
    assert [d.explains for d in diagnoses_of(rates) if d.cause == "clock_rate"] == [("F1",)]


def test_a_factor_that_is_no_ratio_of_units_is_no_unit() -> None:
    """Lengths that are 2% too large are not in another unit."""
    assert diagnoses_of([alarm(1, Hypothesis("unit_mm_m", "depth", 0.9, 1.021, "1"))])[0].cause == "unknown"
    assert diagnoses_of([alarm(1, Hypothesis("unit_mm_m", "depth", 0.9, 1003.0, "1"))])[0].cause == "unit_mm_m"


def test_a_size_counts_once_a_check() -> None:
    """Three rates that one check measures have one voice on the sign of a size, as one finding of another check has."""
    of_frames = Hypothesis("intrinsics_focal", "metadata", 0.6, 7.0, "percent")
    of_depth = Hypothesis("intrinsics_focal", "metadata", 0.9, -8.0, "percent")
    rates = [alarm(i, of_frames, code="flow_photometric.residual.template", stream="flow") for i in (1, 2, 3)]
    first = diagnoses_of([*rates, alarm(4, of_depth, code="flow_geometry.endpoint.error", stream="flow")])[0]
    assert (first.magnitude, first.explains) == (-8.0, ("F4",))


@pytest.mark.parametrize(
    ("trial", "is_named"),
    [
        (undo_trial("F1", "F2"), True),
        (undo_trial("F1", left={"F2": 1e-3}), True),
        (undo_trial("F1", left={"F2": 0.3}), False),
        (undo_trial("F1", "F2", caused=("depth.projection.ray",)), False),
        (None, False),
    ],
)
def test_a_scale_of_lengths_that_is_no_unit_is_named_where_undoing_it_proves_it(
    trial: UndoTrial | None, is_named: bool
) -> None:
    """Any misfit of depths and path has a factor that fits best; the factor of a unit needs no proof."""
    explained = [
        alarm(1, Hypothesis("unit_mm_m", "depth", 0.9, 0.256, "1", 1e-5), code="depth.scale.factor", stream="depth"),
        alarm(2, Hypothesis("unit_mm_m", "depth", 0.9), code="depth.consistency.frame", stream="depth"),
    ]
    trials = {} if trial is None else {("unit_mm_m", "depth"): trial}
    assert any(diagnosis.cause == "unit_mm_m" for diagnosis in diagnoses_of(explained, trials)) == is_named


def test_a_scale_near_one_is_no_unit_whatever_undoing_it_proves() -> None:
    """Depths that are 2% too large are those of a wrong baseline."""
    scaled = alarm(1, Hypothesis("unit_mm_m", "depth", 0.9, 1.02, "1", 1e-5), code="depth.scale.factor", stream="depth")
    (diagnosis,) = diagnoses_of([scaled], {("unit_mm_m", "depth"): undo_trial("F1")})
    assert diagnosis.cause == "unknown"


def test_a_factor_that_another_fault_has_bent_gives_no_size_beside_that_of_a_unit() -> None:
    """Positions in feet beside another fault: the one fit is 3.2808, and the other, with a smaller error, 2.9."""
    explained = [
        alarm(
            1, Hypothesis("unit_mm_m", "pose", 0.9, 3.2808, "1", 1e-3), code="imu.translation.residual", stream="imu"
        ),
        alarm(2, Hypothesis("unit_mm_m", "pose", 0.9, 2.9, "1", 1e-6), code="depth.scale.factor", stream="depth"),
    ]
    (candidate,) = candidates_of(explained, {})
    assert candidate.size.magnitude == 3.2808

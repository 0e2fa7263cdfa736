"""Findings are explained by the fewest causes."""

import math
from collections.abc import Sequence

import pytest

from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.diagnose import SHARPNESS, UNTHOUGHT, choose_causes, share_of_first
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Diagnosis, Finding, Where

Explained = tuple[Alarm, tuple[Hypothesis, ...]]
"""An alarm with its hypotheses."""


def alarm(number: int, *hypotheses: Hypothesis, code: str = "toy.rule", stream: str = "events") -> Explained:
    where = Where(stream=stream)
    statistic = Statistic("toy", 1.0, "1", 0.0, "off", code, where)
    return Alarm(Finding(f"F{number}", code, "error", "off", where), statistic), hypotheses


def diagnosed(explained: Sequence[Explained]) -> tuple[Diagnosis, ...]:
    return choose_causes([one for one, _ in explained], {one.finding.id: hypotheses for one, hypotheses in explained})


def test_one_cause_is_preferred_over_several() -> None:
    """A late event clock that explains three findings is one diagnosis, not three."""
    late = Hypothesis("time_offset", "events", 0.8, 2.06, "ms", 0.03)
    found = diagnosed(
        [
            alarm(1, Hypothesis("threshold_misdeclared", "events", 0.85), late),
            alarm(2, Hypothesis("index_off_by_one", "rgb_to_event", 0.9), late),
            alarm(3, late),
        ]
    )
    assert (found[0].cause, found[0].stream) == ("time_offset", "events")
    assert found[0].explains == ("F1", "F2", "F3")
    assert (found[0].magnitude, found[0].unit, found[0].standard_error) == (2.06, "ms", 0.03)
    assert len(found) == 1


def test_sizes_of_either_sign_are_no_one_fault() -> None:
    """An offset that is late by one finding and early by another explains only those that agree."""
    late, early = (Hypothesis("time_offset", "rgb", 0.45, size, "ms") for size in (20.0, -20.0))
    frozen = Hypothesis("frozen_frames", "rgb", 0.95, 3.0, "samples")
    found = diagnosed([alarm(1, late), alarm(2, late), alarm(3, early), alarm(4, frozen)])
    assert [(d.cause, d.explains) for d in found[:2]] == [("frozen_frames", ("F4",)), ("time_offset", ("F1", "F2"))]
    assert found[1].magnitude == 20.0


def test_a_size_that_is_not_known_contradicts_nothing() -> None:
    """A hypothesis without a size stands beside those of either sign."""
    early, some = Hypothesis("time_offset", "rgb", 0.9, -2.0, "ms"), Hypothesis("time_offset", "rgb", 0.3)
    assert diagnosed([alarm(1, early), alarm(2, some)])[0].explains == ("F1", "F2")


def test_two_faults_are_two_diagnoses() -> None:
    """What one cause does not explain is left to another."""
    found = diagnosed(
        [alarm(1, Hypothesis("polarity_inverted", "events", 0.9)), alarm(2, Hypothesis("teleport", "pose", 0.9))]
    )
    assert {(d.cause, d.stream) for d in found} == {("polarity_inverted", "events"), ("teleport", "pose")}


def test_all_rates_of_flow_together_are_flow() -> None:
    """A gain that one rate and the flow as a whole show is one fault of the flow."""
    found = diagnosed(
        [
            alarm(1, Hypothesis("flow_gain", "flow", 0.8, 10.0, "percent")),
            alarm(2, Hypothesis("flow_gain", "flow/10hz", 0.8, 10.0, "percent")),
        ]
    )
    assert [(d.stream, d.explains) for d in found] == [("flow", ("F1", "F2"))]


def test_one_check_with_many_findings_is_one_witness() -> None:
    """A check that states its misfit for every rate, as a mean and at its worst, does not outvote three others."""
    inverted, shifted = (
        Hypothesis("quaternion_inverted", "pose", 0.95),
        Hypothesis("flow_interval_shifted", "flow", 1.0),
    )
    of_flow = [alarm(i, shifted, code="flow_geometry.endpoint.error") for i in range(1, 7)]
    of_pose = [alarm(7 + i, inverted, code=f"{check}.rule") for i, check in enumerate(("pose.a", "imu.b", "imu.c"))]
    found = diagnosed([*of_flow, *of_pose])
    assert [(d.cause, len(d.explains)) for d in found] == [("quaternion_inverted", 3), ("flow_interval_shifted", 6)]


def test_what_any_fault_of_a_stream_explains_goes_to_the_one_that_is_named() -> None:
    """Flow that another pose would mend is explained by what else is wrong with the pose, and by nothing of the IMU."""
    another_pose = Hypothesis("teleport", "pose", 0.6, 0.5, "m"), Hypothesis(ANY_CAUSE, "pose", 0.5)
    named = Hypothesis("lever_arm", "pose", 0.9, 0.2, "m"), Hypothesis("accel_bias", "imu", 0.4)
    alarms = [alarm(1, *another_pose, code="flow.rule"), alarm(2, *named, code="pose.rule")]
    found = diagnosed(alarms)[0]
    assert (found.cause, set(found.explains), found.magnitude) == ("lever_arm", {"F1", "F2"}, 0.2)


def test_what_is_hardly_hypothesised_is_not_drawn_in() -> None:
    """A cause that no check names in earnest gains nothing from what any would explain."""
    another_pose = Hypothesis("teleport", "pose", 0.6), Hypothesis(ANY_CAUSE, "pose", 0.55)
    weak = tuple(Hypothesis(cause, "pose", 0.02) for cause in ("unsorted", "time_unit"))
    found = diagnosed([alarm(1, *another_pose, code="flow.rule"), alarm(2, *another_pose, *weak, code="depth.rule")])
    assert [d.cause for d in found] == ["teleport"]
    assert found[0].confidence == pytest.approx(1 - UNTHOUGHT)


def test_one_finding_of_many_is_still_named() -> None:
    """What one of thirty findings of a check needs a cause of its own for gets it."""
    many = [alarm(i, Hypothesis("flow_gain", "flow", 0.9)) for i in range(30)]
    found = diagnosed([*many, alarm(30, Hypothesis("teleport", "pose", 0.9))])
    assert [d.cause for d in found] == ["flow_gain", "teleport"]


def test_nothing_fits_is_unknown() -> None:
    """A finding without a hypothesis is not passed over in silence."""
    found = diagnosed([alarm(1), alarm(2, Hypothesis("teleport", "pose", 0.9))])
    assert [d.cause for d in found] == ["teleport", "unknown"]
    assert found[1].explains == ("F1",)


def test_what_is_unknown_of_all_rates_is_unknown_of_flow() -> None:
    """What nothing explains in two rates is one thing that is not known; in one rate, that rate is named."""
    found = diagnosed([alarm(1, stream="flow/10hz"), alarm(2, stream="flow/25hz"), alarm(3, stream="pose")])
    assert [(d.stream, d.explains) for d in found] == [("flow", ("F1", "F2")), ("pose", ("F3",))]
    assert diagnosed([alarm(1, stream="flow/10hz")])[0].stream == "flow/10hz"


def test_no_alarm_no_diagnosis() -> None:
    """Diagnosis runs only after an alarm."""
    assert diagnosed([]) == ()


def test_confidence_is_shared_by_rivals() -> None:
    """Two causes that explain the same finding equally well are equally probable, and together never certain."""
    found = diagnosed([alarm(1, Hypothesis("time_offset", "imu", 0.5), Hypothesis("time_offset", "pose", 0.5))])
    assert found[0].confidence == pytest.approx((1 - UNTHOUGHT) / 2)


def shared(own: float, *others: float) -> float:
    """What a cause of weight ``own`` is told with beside others."""
    return (1 - UNTHOUGHT) / (1 + sum(math.pow(other / own, SHARPNESS) for other in others))


def test_several_witnesses_are_more_certain_than_one() -> None:
    """A cause that two checks support strongly is nearly certain, however many others each would have too."""
    others = tuple(Hypothesis(f"other {i}", "events", 0.3) for i in range(10))
    found = diagnosed(
        [
            alarm(1, Hypothesis("time_offset", "events", 0.9), code="timing.offset"),
            alarm(2, Hypothesis("time_offset", "events", 0.3), *others, code="conservation.pixels"),
        ]
    )
    # Each other: 0.02 where it is not known, times 0.3.
    assert found[0].confidence == pytest.approx(shared(0.27, *[0.006] * 10))


def test_findings_of_one_check_are_one_witness() -> None:
    """Many findings of one check make a cause no more certain than one."""
    hypotheses = Hypothesis("flow_gain", "flow", 0.8), Hypothesis("flow_unit", "flow", 0.7)
    found = diagnosed([alarm(i, *hypotheses, code="rule.gain") for i in range(1, 9)])
    assert found[0].confidence == pytest.approx(shared(0.8, 0.7))


def test_what_leaves_a_part_unexplained_is_no_equal() -> None:
    """A late IMU whose offset explains all is told with confidence beside causes that would leave a sixth or more."""
    late = Hypothesis("time_offset", "imu", 1.0, 8.0, "ms", 0.0011)
    left = (("gyro_bias", 0.84), ("clock_rate", 0.81), ("frame_convention", 0.75), ("axes_swapped", 0.6))
    found = diagnosed([alarm(1, late, *(Hypothesis(cause, "imu", weight) for cause, weight in left))])
    assert (found[0].cause, found[0].magnitude) == ("time_offset", 8.0)
    assert 0.6 < found[0].confidence < 0.9


def test_shares_of_any_number_of_witnesses() -> None:
    """Shares are numbers however far plausibilities lie apart, and those of all rivals add up."""
    far = [-400.0, 0.0, -1.0]
    shares = [share_of_first([one, *(other for other in far if other is not one)]) for one in far]
    assert shares[0] < 1e-300
    assert sum(shares) == pytest.approx(1 - UNTHOUGHT)

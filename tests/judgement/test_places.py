"""One deviation in several places is one finding; deviations of other rules, streams or causes stay apart."""

from dataclasses import replace

from fedora_qa.checks.protocol import Statistic
from fedora_qa.judgement.judge import Alarm, Judged
from fedora_qa.judgement.places import join_places
from fedora_qa.record.types import Coverage, Diagnosis, Finding, Result, Where

CHECK = "flow_geometry.endpoint"
NOTICE = Finding("F5", f"{CHECK}.note", "warning", "A notice.", Where())


def alarm(identifier: str, stream: str, value: float, rule: str = "error") -> Alarm:
    """A deviation of 1 px of scatter in a stream, as a finding."""
    code, where = f"{CHECK}.{rule}", Where(stream=stream)
    statistic = Statistic(f"{stream} {rule}", value, "px", 1.0, f"{stream} is off.", code, where=where)
    return Alarm(Finding(identifier, code, "error", f"{stream} is off.", where), statistic)


def judged(*alarms: Alarm) -> Judged:
    """A failed check with these alarms and a notice."""
    findings = (*(each.finding for each in alarms), NOTICE)
    return Judged(Result(CHECK, "failed", "Is it right?", (), Coverage(1, 1, "fields"), findings), alarms)


def diagnosis(*explains: str, cleared: tuple[str, ...] = ()) -> Diagnosis:
    """A cause of some findings."""
    return Diagnosis(
        "D1",
        "flow_sign",
        "flow",
        None,
        "",
        None,
        0.0,
        Where(),
        "Turn it.",
        explains,
        status="confirmed",
        cleared=cleared,
    )


ALARMS = (
    alarm("F1", "flow/10hz", 20.0),
    alarm("F2", "flow/25hz", 50.0),
    alarm("F3", "flow/25hz", 9.0, "tile"),
    alarm("F4", "flow/50hz", 30.0),
)


def test_rates_of_one_deviation_are_places_of_one_finding() -> None:
    """The rate that is farthest off stays, with the others as places; another rule is another finding."""
    (result,), (cause,) = join_places(
        [judged(*ALARMS)], [diagnosis("F1", "F2", "F3", "F4", cleared=("F1", "F2", "F4"))]
    )
    error, tile, notice = result.result.findings
    assert (error.id, error.where.stream, error.code) == ("F1", "flow/25hz", f"{CHECK}.error")
    assert [where.stream for where in error.places] == ["flow/10hz", "flow/50hz"]
    assert error.message == "flow/25hz is off. Likewise at 2 more places: flow/10hz, flow/50hz."
    assert (tile.id, tile.places, notice) == ("F2", (), replace(NOTICE, id="F3"))
    assert [each.finding for each in result.alarms] == [error, tile]
    assert (cause.explains, cause.cleared) == (("F1", "F2"), ("F1",))


def test_what_is_cleared_in_some_places_only_is_not_cleared() -> None:
    """Undoing the cause clears two of three rates: the joined finding is not cleared."""
    _, (cause,) = join_places([judged(*ALARMS)], [diagnosis("F1", "F2", "F4", cleared=("F1", "F4"))])
    assert (cause.explains, cause.cleared) == (("F1",), ())


def test_findings_of_several_causes_stay_apart() -> None:
    """What a cause explains is not joined with what it does not."""
    (result,), (cause,) = join_places([judged(*ALARMS)], [diagnosis("F1")])
    assert [(finding.id, finding.where.stream) for finding in result.result.findings[:3]] == [
        ("F1", "flow/10hz"),
        ("F2", "flow/25hz"),
        ("F3", "flow/25hz"),
    ]
    assert cause.explains == ("F1",)


def test_findings_of_several_streams_stay_apart() -> None:
    """Depth and colour are no rates of each other."""
    both = judged(alarm("F1", "depth", 5.0), alarm("F2", "rgb", 5.0))
    (result,), _ = join_places([both], [])
    assert [finding.where.stream for finding in result.result.findings[:2]] == ["depth", "rgb"]


def test_places_without_a_rate_are_named_by_time() -> None:
    """Two gaps of one stream are named by when they are."""
    gaps = [alarm(f"F{i}", "imu", float(i)) for i in (1, 2)]
    placed = [
        replace(each, finding=replace(each.finding, where=Where("imu", start_us=i * 1e6)))
        for i, each in enumerate(gaps)
    ]
    (result,), _ = join_places([judged(*placed)], [])
    assert result.result.findings[0].message.endswith("Likewise at 1 more place: imu, at 0 s.")


def test_of_many_places_three_are_named() -> None:
    """All stand in the record; the deviation without any scatter is the largest, and equal places are one."""
    rates = [alarm(f"F{i}", f"flow/{i}hz", 10.0 * i) for i in range(1, 6)]
    exact = replace(rates[1], statistic=replace(rates[1].statistic, value=1.0, standard_error=0.0))
    twice = alarm("F6", "flow/3hz", 1.0)
    (result,), _ = join_places([judged(rates[0], exact, *rates[2:], twice)], [])
    head = result.result.findings[0]
    assert head.where.stream == "flow/2hz"
    assert [where.stream for where in head.places] == ["flow/1hz", "flow/3hz", "flow/4hz", "flow/5hz"]
    assert head.message.endswith("Likewise at 4 more places: flow/1hz, flow/3hz, flow/4hz, ....")


def test_equal_places_add_none() -> None:
    """A rule that is broken twice at one place is one finding, which says nothing of places."""
    (result,), _ = join_places([judged(alarm("F1", "rgb", 5.0), alarm("F2", "rgb", 9.0))], [])
    head = result.result.findings[0]
    assert (head.places, head.message) == ((), "rgb is off.")

"""The span of events beside the other streams: silent ends, no events and strays."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.sequence.facts import EventStep, Facts
from tests.support.altered_clocks import as_recording, hypotheses_for, judgement_of
from tests.support.facts import MS, exact_facts


@given(st.integers(-1999, 1999), st.integers(0, 2000))
def test_events_may_begin_late_and_end_early(shift_ms: int, length_ms: int) -> None:
    """While any instant is common, a still scene explains what is missing."""
    facts = exact_facts()
    assert facts.events is not None
    first_ms = max(shift_ms, -length_ms)
    events = replace(facts.events, first_ns=first_ms * MS, last_ns=(first_ms + length_ms) * MS)
    assert not judgement_of("clocks.span", replace(facts, events=events)).alarms


def test_no_event_at_all_is_noted() -> None:
    """A still scene gives no event, which no timestamp shows. The check warns."""
    facts = exact_facts()
    assert facts.events is not None
    result = judgement_of("clocks.span", replace(facts, events=replace(facts.events, count=0))).result
    assert (result.outcome, [finding.code for finding in result.findings]) == ("warned", ["clocks.span.no_events"])


@pytest.mark.parametrize(("count", "is_few"), [(0, True), (2, True), (3, False)])
def test_without_frames_no_scene_is_known_to_be_still(count: int, is_few: bool) -> None:
    """Nothing else would state that a declared stream of events is empty."""
    facts = exact_facts()
    assert facts.events is not None
    alone = replace(facts, clocks={s: c for s, c in facts.clocks.items() if s != "rgb"})
    alarms = judgement_of("clocks.span", replace(alone, events=replace(facts.events, count=count))).alarms
    assert [alarm.finding.code for alarm in alarms] == ["clocks.span.few_samples"] * is_few


@pytest.mark.parametrize(
    ("first_ms", "last_ms", "codes"),
    [
        (400, 1990, ["clocks.span.events_begin_late"]),
        (10, 1500, ["clocks.span.events_end_early"]),
        (400, 1500, ["clocks.span.events_begin_late", "clocks.span.events_end_early"]),
        (90, 1950, []),
    ],
)
def test_without_frames_silent_ends_are_noted(first_ms: int, last_ms: int, codes: list[str]) -> None:
    """The scene may have been still; with frames the conservation of light decides."""
    facts = exact_facts()
    assert facts.events is not None
    cut = replace(facts, events=replace(facts.events, first_ns=first_ms * MS, last_ns=last_ms * MS))
    alone = replace(cut, clocks={s: c for s, c in facts.clocks.items() if s != "rgb"})
    result = judgement_of("clocks.span", alone).result
    assert [finding.code for finding in result.findings] == codes
    assert result.outcome == ("warned" if codes else "passed")
    assert not judgement_of("clocks.span", cut).result.findings


def with_stray(row: int, before_ms: int, after_ms: int) -> Facts:
    """Events of which those before a row, or from it on, lie elsewhere: between both there is none."""
    facts = exact_facts()
    assert facts.events is not None
    step = EventStep(row, before_ms * MS, after_ms * MS)
    first_ns, last_ns = min(facts.events.first_ns, before_ms * MS), max(facts.events.last_ns, after_ms * MS)
    return replace(
        facts, events=replace(facts.events, first_ns=first_ns, last_ns=last_ns, longest_steps=(step,), count=1000)
    )


@pytest.mark.parametrize(
    ("row", "before_ms", "after_ms", "is_stray"),
    [
        (1, -1_000_000, 4, True),  # one absurd timestamp, of 2 s
        (999, 1990, 10**12, True),
        (50, -1000, 4, True),
        (950, 1990, 3100, True),
        (50, -990, 4, False),  # not as far as half of the duration
        (950, 1990, 2990, False),
        (50, -1500, -1400, False),  # a sensor that runs before the others
        (700, 500, 1600, False),  # a silence within
        (5, 1990, 10**6, False),  # most events lie elsewhere: another clock
    ],
)
def test_events_far_from_all_others_are_strays(row: int, before_ms: int, after_ms: int, is_stray: bool) -> None:
    """They are counted, and no duration is theirs; recorders begin and end as they like."""
    facts = with_stray(row, before_ms, after_ms)
    alarms = judgement_of("clocks.span", facts).alarms
    assert [alarm.finding.code for alarm in alarms] == ["clocks.span.far"] * is_stray
    assert not judgement_of("clocks.span", as_recording(facts)).alarms
    if is_stray:
        assert alarms[0].statistic.value == (row if before_ms < 0 else 1000 - row)
        assert not judgement_of("clocks.unit", facts).alarms
        assert [h.cause for h in hypotheses_for("clocks.span", facts)] == ["time_offset"]

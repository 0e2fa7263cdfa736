"""Measured values become outcomes as design.md tells them apart."""

from typing import Any

import pytest

from fedora_qa.checks.protocol import FactsCheck, Measured, Notice, Observation
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts


class Toy(FactsCheck):
    """Is the toy whole?"""

    name = "toy.whole"

    def examine(self, facts: Facts) -> Observation:
        raise NotImplementedError


SEEN = Coverage(10, 10, "rows")


def measured(**changes: Any) -> Measured:
    defaults: dict[str, Any] = {
        "name": "offset",
        "value": 0.0,
        "unit": "ms",
        "standard_error": 1.0,
        "statement": "It is off.",
        "code": "toy.whole.offset",
    }
    return Measured(**(defaults | changes))


def judged(observation: Observation) -> Judged:
    return judge({"toy.whole": observation}, [Toy()], 1e-4)[0]


CASES = {
    "a value within its error": (measured(value=3.0), "passed"),
    "a value far outside": (measured(value=6.0), "failed"),
    "a value far below": (measured(value=-6.0), "failed"),
    "below, where only above counts": (measured(value=-6.0, side="upper"), "passed"),
    "above, where only below counts": (measured(value=6.0, side="lower"), "passed"),
    "within the allowance": (measured(value=6.0, allowance=3.0), "passed"),
    "a count that must be zero": (measured(value=1.0, standard_error=0.0, resolution=1.0), "failed"),
    "a count that is zero": (measured(value=0.0, standard_error=0.0, resolution=1.0), "passed"),
    "not a number": (measured(value=float("nan")), "failed"),
    "too blunt to be of use": (measured(matters=2.0), "not_observable"),
    "blunt, and off all the same": (measured(value=9.0, matters=2.0), "failed"),
}


@pytest.mark.parametrize(("value", "outcome"), CASES.values(), ids=CASES)
def test_outcome_of_one_value(value: Measured, outcome: str) -> None:
    """One value decides the outcome."""
    assert judged(Observation(SEEN, (value,))).result.outcome == outcome


def test_one_sharp_value_among_blunt_ones_can_pass() -> None:
    """A check is not observable only where none of its values is."""
    observation = Observation(SEEN, (measured(matters=2.0), measured(name="other", matters=20.0)))
    assert judged(observation).result.outcome == "passed"


def test_unobservable_and_notice() -> None:
    """A reason makes not_observable, a notice makes warned, a broken value outweighs both."""
    notice = Notice("toy.whole.odd", "odd but legal")
    assert judged(Observation(SEEN, unobservable="hovering")).result.reason == "hovering"
    assert judged(Observation(SEEN, (measured(),), (notice,))).result.outcome == "warned"
    broken = judged(Observation(SEEN, (measured(value=9.0),), (notice,), unobservable="hovering"))
    assert broken.result.outcome == "failed"
    assert [finding.severity for finding in broken.result.findings] == ["error", "warning"]
    assert [alarm.finding.id for alarm in broken.alarms] == ["F1"]


def test_more_comparisons_widen_every_limit() -> None:
    """A worst of a million honest values is no alarm where a single one would be."""
    assert judged(Observation(SEEN, (measured(value=5.5),))).result.outcome == "failed"
    assert judged(Observation(SEEN, (measured(value=5.5, tests=10**6),))).result.outcome == "passed"


def test_passed_value_states_what_it_would_have_seen() -> None:
    """Limit and least detectable fault stand in the record."""
    stated = judged(Observation(SEEN, (measured(),))).result.measurements[0]
    assert stated.limit == pytest.approx(3.89, abs=0.01)
    assert stated.least_detectable == pytest.approx(3.89 + 1.645, abs=0.01)


@pytest.mark.parametrize("side", ["both", "upper", "lower"])
def test_record_says_which_side_counts(side: str) -> None:
    """A reader can tell that a value below what is expected is fine."""
    assert judged(Observation(SEEN, (measured(side=side),))).result.measurements[0].side == side

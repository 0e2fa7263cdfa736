"""Measured values become outcomes as design.md tells them apart."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest, norm

from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.judgement.judge import Judged, exceeds_limit, judge, tolerance_for
from fedora_qa.judgement.materiality import Materiality
from fedora_qa.judgement.verdict import DEFAULT_FALSE_ALARM_RATE
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts


class Toy(FactsCheck):
    """Is the toy whole?"""

    name = "toy.whole"

    def examine(self, facts: Facts) -> Observation:
        raise NotImplementedError


SEEN = Coverage(10, 10, "rows")


def measured(**changes: Any) -> Statistic:
    defaults: dict[str, Any] = {
        "name": "offset",
        "value": 0.0,
        "unit": "ms",
        "standard_error": 1.0,
        "statement": "It is off.",
        "code": "toy.whole.offset",
    }
    return Statistic(**(defaults | changes))


def judged(observation: Observation) -> Judged:
    return judge({"toy.whole": observation}, [Toy()], 1e-4)[0]


CASES = {
    "a value within its error": (measured(value=3.0), "passed"),
    "a value far outside": (measured(value=6.0), "failed"),
    "a value far below": (measured(value=-6.0), "failed"),
    "below, where only above counts": (measured(value=-6.0, side="upper"), "passed"),
    "above, where only below counts": (measured(value=6.0, side="lower"), "passed"),
    "within the allowance": (measured(value=6.0, model_error_bound=3.0), "passed"),
    "a count that must be zero": (measured(value=1.0, standard_error=0.0, resolution=1.0), "failed"),
    "a count that is zero": (measured(value=0.0, standard_error=0.0, resolution=1.0), "passed"),
    "not a number": (measured(value=float("nan")), "failed"),
    "too blunt to be of use": (measured(blind_from=2.0), "not_observable"),
    "blunt, and off all the same": (measured(value=9.0, blind_from=2.0), "failed"),
}


@pytest.mark.parametrize(("value", "outcome"), CASES.values(), ids=CASES)
def test_outcome_of_one_value(value: Statistic, outcome: str) -> None:
    """One value decides the outcome."""
    assert judged(Observation(SEEN, (value,))).result.outcome == outcome


SHARP, BLUNT = measured(blind_from=20.0), measured(name="drift", unit="ppm", blind_from=2.0)


def test_a_pass_names_what_it_could_not_see() -> None:
    """One sharp value among blunt ones can pass; the reason says which faults would have gone unseen, with numbers."""
    result = judged(Observation(SEEN, (SHARP, BLUNT))).result
    assert result.outcome == "passed"
    assert result.reason == "detection limit too large: drift (5.7 ppm; at most 2 ppm is of use)"


def test_a_warning_names_what_it_could_not_see() -> None:
    """What is blind does not get lost behind what is unusual."""
    result = judged(Observation(SEEN, (SHARP, BLUNT), (Notice("toy.whole.odd", "odd but legal"),))).result
    assert result.outcome == "warned"
    assert result.reason.startswith("odd but legal; detection limit too large: drift")


def test_a_reason_stays_short() -> None:
    """Of many blind values the first are named, and the others counted."""
    result = judged(Observation(SEEN, (SHARP, *(replace(BLUNT, name=f"axis_{i}") for i in range(7))))).result
    assert "axis_2" in result.reason
    assert result.reason.endswith("; and 4 more")


WITHOUT_AN_ANSWER = {
    "all are blunt": (BLUNT, replace(BLUNT, name="other")),
    "all that say what matters are blunt": (BLUNT, measured(name="count", standard_error=0.0, resolution=1.0)),
}


@pytest.mark.parametrize("values", WITHOUT_AN_ANSWER.values(), ids=WITHOUT_AN_ANSWER)
def test_blind_to_the_question_is_no_pass(values: tuple[Statistic, ...]) -> None:
    """A check that sees nothing of what matters is not observable, whatever else it counts."""
    result = judged(Observation(SEEN, values)).result
    assert result.outcome == "not_observable"
    assert "drift" in result.reason


@pytest.mark.parametrize("error", [float("inf"), float("nan")])
def test_an_error_that_could_not_be_estimated_is_blindness(error: float) -> None:
    """No error bar is no sharpness."""
    result = judged(
        Observation(SEEN, (SHARP, measured(standard_error=error, blind_from=2.0, model_error_bound=1.0)))
    ).result
    assert result.outcome == "passed" if error > 1 else "failed"


@pytest.mark.parametrize("of", [0, 10])
def test_a_pass_has_seen_something(of: int) -> None:
    """No check passes on rows that are not there, or that it did not see."""
    result = judged(Observation(Coverage(0, of, "rows"), (measured(),))).result
    assert (result.outcome, result.reason) == (
        "not_observable", "none of 10 rows could be measured" if of else "there are no rows"
    )  # fmt: skip


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


def test_a_limit_that_depends_on_place_is_a_range() -> None:
    """The range is stated where the places differ by a factor of two, with the material size in both ends."""
    alike = judged(Observation(SEEN, (measured(sensitivity=((1.0, 0.0), (1.9, 0.0))),))).result.measurements[0]
    assert alike.least_detectable_range is None
    apart = judged(Observation(SEEN, (measured(sensitivity=((1.0, 0.0), (2.0, 3.0))),))).result.measurements[0]
    assert apart.least_detectable_range == pytest.approx((5.535, 2 * 5.535 + 6), abs=0.01)


@pytest.mark.parametrize("side", ["both", "upper", "lower"])
def test_record_says_which_side_counts(side: str) -> None:
    """A reader can tell that a value below what is expected is fine."""
    assert judged(Observation(SEEN, (measured(side=side),))).result.measurements[0].side == side


def test_all_comparisons_of_a_file_keep_its_rate() -> None:
    """Honest files with single values, worst of many, and one-sided worst alarm at most at the stated rate.

    The rate is kept nearly in full by what counts on both sides, and at half by what counts on one.
    """
    random, files, rate, kinds = np.random.default_rng(3), 1000, 0.2, ((1, "both"), (40, "both"), (40, "upper"))
    alarms = 0
    for _ in range(files):
        worst = (max(random.standard_normal(n), key=abs if side == "both" else float) for n, side in kinds)
        values = tuple(measured(value=value, tests=n, side=side) for value, (n, side) in zip(worst, kinds, strict=True))
        alarms += judge({"toy.whole": Observation(SEEN, values)}, [Toy()], rate)[0].result.outcome == "failed"
    due = rate * (41 / 81 + 40 / 81 / 2)
    assert binomtest(alarms, files, due).pvalue > 1e-3
    assert alarms < rate * files


class OtherToy(Toy):
    """Is the other toy whole?"""

    name = "toy.other"


def test_findings_are_numbered_over_all_checks() -> None:
    """Of a check the material ones first, then the immaterial, then its notices; checks without an observation lack."""
    offset = measured(value=0.02, standard_error=0.001, code="event_response.timing.offset")
    notices = tuple(Notice("toy.whole.odd", f"odd {i}") for i in range(4))
    values = (offset, replace(offset, value=9.0), measured(value=9.0))
    observations = {"toy.other": Observation(SEEN, values, notices), "toy.whole": Observation(SEEN, values[2:])}
    first, second = judge(observations, [OtherToy(), Toy()], 1e-4, Materiality("release"))
    assert [finding.id for finding in (*first.result.findings, *second.result.findings)] == [
        f"F{i}" for i in range(1, 9)
    ]
    assert [finding.severity for finding in first.result.findings] == ["error"] * 2 + ["info"] + ["warning"] * 4
    assert [alarm.statistic for alarm in first.alarms] == list(values[1:])
    assert judge({"toy.whole": observations["toy.whole"]}, [OtherToy(), Toy()], 1e-4)[0].result.check == "toy.whole"
    warned = judge({"toy.other": Observation(SEEN, (), notices)}, [OtherToy()], 1e-4)[0].result
    assert (warned.outcome, warned.reason) == ("warned", "odd 0; odd 1; odd 2")


def test_what_does_not_vary_takes_no_share_of_the_rate() -> None:
    """Limits beside a thousand counts that must be zero are those of one value alone."""
    count = measured(name="lost", standard_error=0.0, resolution=1.0, tests=1000)
    alone = judged(Observation(SEEN, (measured(),))).result.measurements[0]
    beside = judged(Observation(SEEN, (measured(), count))).result.measurements[0]
    assert beside.limit == alone.limit


def test_sides_and_sizes_of_a_deviation() -> None:
    """A deviation of just its limit and the material size passes, on the side that counts."""
    tolerance = tolerance_for(1, 1e-4)
    limit = tolerance.limit(1.0, 0.5)
    for side, sign in (("upper", 1), ("lower", -1), ("both", 1), ("both", -1)):
        just = measured(value=7.0 + sign * (limit + 0.25), expected=7.0, model_error_bound=0.5, side=side)
        assert exceeds_limit(just, tolerance, 0.2499)
        assert not exceeds_limit(just, tolerance, 0.2501)


@given(st.integers(1, 10**7), st.floats(1e-8, 0.1))
def test_all_comparisons_share_one_rate(comparisons: int, rate: float) -> None:
    """The two-sided tails of all comparisons add up to the file's rate."""
    z = tolerance_for(comparisons, rate).z_limit
    assert 2 * norm.sf(z) * comparisons == pytest.approx(rate, rel=1e-6)


def test_by_default_one_honest_file_in_ten_thousand_alarms() -> None:
    """A single two-sided comparison is allowed 3.89 standard errors."""
    z = tolerance_for(1, DEFAULT_FALSE_ALARM_RATE).z_limit
    assert z == pytest.approx(3.8906, abs=1e-4)
    assert 2 * norm.sf(z) == pytest.approx(1e-4, rel=1e-6)


def test_false_alarms_of_honest_files_keep_the_rate() -> None:
    """Files of 20 honest Gaussian values alarm at the stated rate, within its binomial interval."""
    files, rate = 20_000, 0.02
    limit = tolerance_for(20, rate).limit(standard_error=1.0, model_error_bound=0.0)
    values = np.random.default_rng(1).standard_normal((files, 20))
    alarms = int(np.sum(np.any(np.abs(values) > limit, axis=1)))
    assert binomtest(alarms, files, rate).pvalue > 1e-3


MODEL_ERROR_BOUNDS = [0.0, 0.1, 1.0, 30.0]


@pytest.mark.parametrize("model_error_bound", MODEL_ERROR_BOUNDS)
@pytest.mark.parametrize("model_error", [-1.0, 0.0, 1.0], ids=["hides", "absent", "feigns"])
def test_least_detectable_is_seen_with_the_stated_power(model_error_bound: float, model_error: float) -> None:
    """A fault of the stated size is seen in 95% of files or more, whichever way the model errs, in either direction."""
    tolerance, files = tolerance_for(100, 1e-4), 20_000
    least = tolerance.least_detectable(standard_error=0.3, model_error_bound=model_error_bound, resolution=0.0)
    values = least + model_error * model_error_bound + 0.3 * np.random.default_rng(2).standard_normal(files)
    seen = int(np.sum(values > tolerance.limit(0.3, model_error_bound)))
    assert seen / files >= 0.95 or binomtest(seen, files, 0.95).pvalue > 1e-3
    if model_error < 0 or not model_error_bound:
        assert binomtest(seen, files, 0.95).pvalue > 1e-3  # no less would do


@given(st.integers(1, 10**6), st.floats(1e-3, 10), st.floats(0, 10))
def test_honest_values_rarely_exceed(comparisons: int, standard_error: float, model_error_bound: float) -> None:
    """Whatever the model error within its bound, an honest value exceeds with its share of the rate at most."""
    tolerance = tolerance_for(comparisons, 1e-4)
    margin = tolerance.limit(standard_error, model_error_bound) - model_error_bound
    exceeds = 2 * norm.sf(margin / standard_error)
    assert exceeds <= 1e-4 / comparisons * (1 + 1e-6)


@given(st.integers(0, 5), st.integers(1, 50))
def test_a_count_is_seen_from_the_first_beyond_its_bound(model_error_bound: int, lost: int) -> None:
    """Where up to ``allowance`` may be lost without fault, twice that and one more is seen, even if none was."""
    tolerance = tolerance_for(1, 1e-4)
    least = tolerance.least_detectable(standard_error=0.0, model_error_bound=model_error_bound, resolution=1.0)
    seen = lost - model_error_bound > tolerance.limit(0.0, model_error_bound)
    assert seen == (lost >= least)


@pytest.mark.parametrize("rate", [0.0, 1.0, -1.0, float("nan")])
def test_a_rate_that_is_none_is_refused(rate: float) -> None:
    """No silent nonsense."""
    with pytest.raises(ValueError, match="between 0 and 1"):
        tolerance_for(1, rate)

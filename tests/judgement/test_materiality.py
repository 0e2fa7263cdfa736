"""The table of material sizes, and how deviations are judged by it."""

import ast
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks.imu.agreement import ROTATION_TEXTS, TIMING_TEXTS, TRANSLATION_TEXTS
from fedora_qa.checks.protocol import Observation, Statistic
from fedora_qa.conventions import NS_PER_S
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.judgement.materiality import (
    MATERIALITY,
    Materiality,
    MaterialityRow,
    Profile,
    materiality_of,
    materiality_row,
)
from fedora_qa.layout.binding import INVALID_TIMESTAMP_NS
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import clock_of
from tests.judgement.test_judge import Toy
from tests.support.facts import exact_facts

CHECKS: Final = Path(__file__).parents[2] / "fedora_qa" / "checks"

OFFSET: Final = Statistic(
    name="time_offset", value=0.0, unit="ms", standard_error=0.001, statement="Events are late.",
    code="event_response.timing.offset",
)  # fmt: skip


def codes_of_checks() -> tuple[str, ...]:
    """Return the text of each ``code=`` of a check, with ``*`` for what a formatted string fills in."""
    codes = set()
    for path in CHECKS.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.keyword) and node.arg == "code":
                if isinstance(node.value, ast.Constant):
                    codes.add(str(node.value.value))
                elif isinstance(node.value, ast.JoinedStr):
                    parts = (str(p.value) if isinstance(p, ast.Constant) else "*" for p in node.value.values)
                    codes.add("".join(parts))
    return tuple(sorted(codes))


CODES: Final = codes_of_checks()


def judged(statistic: Statistic, profile: Profile, duration_s: float = 1.0) -> Judged:
    return judge({"toy.whole": Observation(Coverage(1, 1, "rows"), (statistic,))}, [Toy()], 1e-4,
                 Materiality(profile, duration_s))[0]  # fmt: skip


def fits(first: str, second: str) -> bool:
    """Return whether one text with ``*`` stands for what the other stands for."""
    return fnmatchcase(first.replace("*", "x"), second) or fnmatchcase(second.replace("*", "x"), first)


@pytest.mark.parametrize("code", CODES)
def test_every_code_has_a_row(code: str) -> None:
    """A rule that a check states fits a row, whole or as one of the codes that its formatted text stands for."""
    assert any(fits(code, pattern) for row in MATERIALITY for pattern in row.codes)


@pytest.mark.parametrize("row", MATERIALITY, ids=lambda row: f"{row.codes[0]} {row.unit}")
def test_a_row_has_a_use_and_a_reason(row: MaterialityRow) -> None:
    """Each of its codes is one of a check; sizes grow from release to training, and have a reason and a source."""
    assert all(any(fits(code, pattern) for code in CODES) for pattern in row.codes)
    assert len(row.reason.split()) >= 4
    if row.exact:
        assert (row.unit, row.release, row.training) == ("", 0, 0)
    else:
        assert "" not in {row.unit, row.source}
        assert 0 < row.release <= row.training
        assert (row.release_px is None) == (row.training_px is None)
        assert 0 <= (row.release_px or 0.0) <= (row.training_px or 0.0)


@given(st.floats(0, 1), st.sampled_from(["release", "training"]))
def test_what_is_certain_fails_only_where_it_matters(deviation_ms: float, profile: Profile) -> None:
    """Beyond its limit by less than 0.1 ms an offset passes with an information that states both numbers."""
    result = judged(replace(OFFSET, value=deviation_ms), profile).result
    measured = result.measurements[0]
    assert measured.limit is not None
    excess = deviation_ms - measured.limit
    assert result.outcome == ("failed" if excess - 0.1 > 0 else "passed")
    codes = [(finding.code, finding.severity) for finding in result.findings]
    if excess <= 0:
        assert codes == []
    elif excess <= 0.1:
        assert codes == [("toy.whole.immaterial", "info")]
        assert "Measurable, not material" in result.findings[0].message
        assert "0.1 ms more would be material" in result.findings[0].message
    else:
        assert codes == [("event_response.timing.offset", "error")]


@given(st.floats(-1, 1))
def test_strict_has_no_sizes(deviation_ms: float) -> None:
    """Every deviation beyond its limit fails."""
    result = judged(replace(OFFSET, value=deviation_ms), "strict").result
    measured = result.measurements[0]
    assert measured.limit is not None
    assert measured.material == 0
    assert (result.outcome == "failed") == (abs(deviation_ms) > measured.limit)


def test_a_fault_of_the_stated_size_fails() -> None:
    """What the record states as detectable fails under the profile of the record, and not only measurably."""
    stated = judged(OFFSET, "release").result.measurements[0]
    assert stated.least_detectable is not None
    assert stated.material == 0.1
    assert judged(replace(OFFSET, value=stated.least_detectable), "release").result.outcome == "failed"


def test_immaterial_deviations_have_no_alarm() -> None:
    """Diagnosis names no cause of what does not matter."""
    assert judged(replace(OFFSET, value=0.05), "release").alarms == ()
    assert len(judged(replace(OFFSET, value=0.05), "strict").alarms) == 1


def test_a_rate_matters_by_its_drift() -> None:
    """1 ppm is 1 us in a second, and 0.1 ms in 100 s."""
    rate = Statistic("rate_error", 0.0, "ppm", 0.0, "The clock is fast.", "clocks.rate.error")
    assert Materiality("release", 1.0).size(rate.code, rate.unit, rate.expected) == pytest.approx(100.0)
    assert Materiality("release", 100.0).size(rate.code, rate.unit, rate.expected) == pytest.approx(1.0)
    assert Materiality("release", 0.0).size(rate.code, rate.unit, rate.expected) == 0.0


def test_a_timestamp_without_a_place_in_time_makes_no_file_longer() -> None:
    """The drift that matters is that of the second that the file lasts."""
    facts = exact_facts()
    rgb = facts.clocks["rgb"]
    times_ns = rgb.times_ns.copy()
    times_ns[0] = INVALID_TIMESTAMP_NS
    absurd = replace(facts, clocks={**facts.clocks, "rgb": clock_of(times_ns, None)})
    duration_s = materiality_of("release", facts).duration_s
    assert materiality_of("release", absurd).duration_s == pytest.approx(duration_s, abs=0.021)


def test_a_file_lasts_as_long_as_its_streams() -> None:
    """One stream that lasts longer makes no drift matter less or more; without any timestamp a file has no length."""
    facts = exact_facts()
    assert facts.events is not None
    events = replace(facts.events, first_ns=-NS_PER_S, last_ns=5 * NS_PER_S)
    empty = replace(events, count=0)
    assert materiality_of("release", replace(facts, events=None)).duration_s == 2.0
    assert materiality_of("release", replace(facts, events=empty)).duration_s == 2.0
    assert materiality_of("release", replace(facts, events=events)).duration_s == 2.0
    stretched = {**facts.clocks, "imu": clock_of(1000 * facts.clocks["imu"].times_ns, None)}
    assert materiality_of("release", replace(facts, clocks=stretched)).duration_s == 2.0
    assert materiality_of("release", replace(facts, clocks={}, events=events)).duration_s == 6.0
    assert materiality_of("release", replace(facts, clocks={}, events=None)).duration_s == 0.0


def test_a_share_of_what_is_expected() -> None:
    """Depth beyond its declared range matters from a thousandth of its end."""
    depth = Statistic("farthest", 100.0, "m", 0.0, "Too far.", "depth.range.farthest", expected=100.0)
    assert Materiality("release", 1.0).size(depth.code, depth.unit, depth.expected) == pytest.approx(0.1)


@pytest.mark.parametrize("end_m", [float("inf"), float("nan")])
def test_no_share_of_what_is_no_number(end_m: float) -> None:
    """Depth that is declared to reach to infinity has no share that could be stated."""
    assert Materiality("release", 1.0).size("depth.range.farthest", "m", end_m) == 0.0


GAIN: Final = Statistic("gain", 0.0, "percent", 0.0, "Flow is too large.", "flow_photometric.residual.gain")


@pytest.mark.parametrize(
    ("profile", "flow_px", "percent"),
    [
        ("release", 1.0, 2.0),
        ("release", 20.0, 0.1),
        ("release", 100.0, 0.1),
        ("training", 1.0, 10.0),
        ("strict", 1.0, 0.0),
    ],
)
def test_a_gain_matters_by_its_effect_on_the_flow(profile: Profile, flow_px: float, percent: float) -> None:
    """From the percentage that makes 0.02 px (training: 0.1 px) of the flow of the file on, 0.1% at least."""
    statistic = replace(GAIN, effect_px=0.01 * flow_px)
    size = Materiality(profile, 1.0).size(statistic.code, statistic.unit, statistic.expected, statistic.effect_px)
    assert size == pytest.approx(percent)
    below, above = (judged(replace(statistic, value=-factor * size), profile).result for factor in (0.99, 1.01))
    assert above.measurements[0].material == pytest.approx(percent)
    assert above.measurements[0].effect_px == 0.01 * flow_px
    if profile != "strict":
        assert (below.outcome, above.outcome) == ("passed", "failed")
        assert [finding.code for finding in below.findings] == ["toy.whole.immaterial"]


@pytest.mark.parametrize("effect_px", [None, 0.0, float("nan"), float("inf")])
def test_without_an_effect_the_size_is_that_of_the_table(effect_px: float | None) -> None:
    """A flow that is zero everywhere excuses no gain."""
    assert Materiality("release", 1.0).size(GAIN.code, GAIN.unit, GAIN.expected, effect_px) == 0.1


def test_exact_measurements_have_no_size() -> None:
    """A count that must be zero fails at one, whatever the profile."""
    count = Statistic("missing", 1.0, "samples", 0.0, "One is lost.", "clocks.gaps.missing", resolution=1.0)
    for profile in ("release", "training", "strict"):
        assert judged(count, profile).result.outcome == "failed"


def test_every_deviation_of_a_code_without_a_row_matters() -> None:
    """A rule that was added without a size is judged by its limit, and ends no check of a file."""
    assert materiality_row("toy.whole.offset", "ms") is None
    assert judged(replace(OFFSET, value=0.05), "release").result.outcome == "passed"
    assert judged(replace(OFFSET, value=0.05, code="toy.whole.offset"), "release").result.outcome == "failed"


@pytest.mark.parametrize("subject", ["rotation", "translation", "timing"])
def test_parameters_of_the_imu_have_rows(subject: str) -> None:
    """Each parameter of a fit has a row in its unit; the codes are made of the names of the parameters."""
    texts = {"rotation": ROTATION_TEXTS, "translation": TRANSLATION_TEXTS, "timing": TIMING_TEXTS}[subject]
    for name, text in texts.items():
        assert materiality_row(f"imu.{subject}.{name}", text.unit) is not None, name
    local = "time_offset" if subject == "timing" else "bias"
    assert materiality_row(f"imu.{subject}.local_{local}", texts[local].unit) is not None

"""Numbers, places and verdicts in words."""

import unicodedata
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.record.types import Canary, Coverage, Finding, Measurement, Result, Where
from fedora_qa.record.wording import (
    basis_of_clean,
    canaries_seen,
    cause_sentence,
    coverage_words,
    explained_checks,
    findings_of,
    headline,
    least_detectable_text,
    number,
    place,
    principal,
    printable,
    reasons,
    tally,
    why_incomplete,
    with_error,
    with_unit,
)
from tests.support.records import crashed, failed, file_record, immaterial, late_events, not_observable, passed

ERRORS = {
    "one digit": (2.0634, 0.031, "ms", "2.06 ± 0.03 ms"),
    "two digits after a one": (2.0634, 0.0131, "ms", "2.063 ± 0.013 ms"),
    "large": (12345.6, 230.0, "events", "12300 ± 200 events"),
    "negative": (-0.05, 0.002, "m/s^2", "-0.050 ± 0.002 m/s^2"),
    "pure number": (57.3, 0.3, "1", "57.3 ± 0.3"),
    "tiny": (3.1e-9, 2.2e-10, "rad", "3.1e-09 ± 2e-10 rad"),
    "no error": (3.0, 0.0, "samples", "3 samples"),
    "unknown error": (0.25, None, "px", "0.25 px"),
    "no value": (None, 0.1, "ms", "not a number ms"),
}


@pytest.mark.parametrize(("value", "error", "unit", "words"), ERRORS.values(), ids=ERRORS.keys())
def test_with_error(value: float | None, error: float | None, unit: str, words: str) -> None:
    """A value is shown to the digits that its error allows."""
    assert with_error(value, error, unit) == words


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(1e-300, 1e300))
def test_with_error_takes_any_number(value: float, error: float) -> None:
    """No magnitude breaks the rounding, and none fills the screen."""
    assert len(with_error(value, error, "ms")) < 40


@pytest.mark.parametrize(("value", "words"), [(3.0, "3"), (58139, "58139"), (0.123456, "0.1235"), (1e9, "1e+09")])
def test_number(value: float, words: str) -> None:
    """Counts are shown in full, measurements with four digits."""
    assert number(value) == words


PLACES = {
    "nothing": (Where(), ""),
    "time of an epoch clock": (Where(stream="rgb", start_us=1.7e15 + 1), "rgb, at 1700000000.000001 s"),
    "interval": (Where(stream="events", start_us=0.0, stop_us=2e6), "events, 0 s to 2 s"),
    "half-open rows": (Where(stream="pose", index_start=98, index_stop=101), "pose, rows 98 to 100"),
    "one row": (Where(stream="pose", index_start=98, index_stop=99), "pose, row 98"),
    "pixel and frame": (Where(frame=5, pixel=(17, 4)), "frame 5, pixel (17, 4)"),
    "tile": (Where(tile=(32, 0, 64, 32)), "tile (32, 0) to (64, 32)"),
}


@pytest.mark.parametrize(("where", "words"), PLACES.values(), ids=PLACES.keys())
def test_place(where: Where, words: str) -> None:
    """A place names the stream, the time to the microsecond, rows, frame and pixel, as far as known."""
    assert place(where) == words


@given(st.text(st.characters(codec=None)))
def test_printable_is_one_harmless_line(content: str) -> None:
    """No character that moves the cursor, hides text or turns its direction survives."""
    shown = printable(content)
    assert not {"Cc", "Cf", "Cs", "Zl", "Zp"} & {unicodedata.category(character) for character in shown}


def test_printable_removes_escape_sequences_whole() -> None:
    """Colours, titles and links of a hostile name leave no rubbish behind."""
    assert printable("\x1b[31mred\x1b[0m \x1b]0;title\x07\x1b]8;;http://x\x1b\\a\nb") == "red a b"


def test_printable_keeps_letters_of_all_languages() -> None:
    """Only what is invisible goes."""
    assert printable("Flug über 東京 ± 0.1") == "Flug über 東京 ± 0.1"


def test_principal_is_the_farthest_out() -> None:
    """Of several measurements the one is shown that lies farthest out for its limit."""
    found = principal(failed())
    assert found is not None
    assert found.name == "offset"


def test_principal_of_a_passed_check_is_within_its_limit() -> None:
    """A one-sided measurement that is far out on the harmless side is not the news."""
    one_sided = Measurement("focal", 311.8, "px", 0.0, 0.0, 0.0, None, side="lower")
    usual = Measurement("skew", 0.1, "px", 0.1, 0.0, 0.6, 0.8)
    assert principal(replace(passed(), measurements=(one_sided, usual))) == usual


def test_a_limit_that_depends_on_place_is_shown_as_a_range() -> None:
    """Both ends stand in the summary in place of the one of the worst place."""
    jump = Measurement("jump", 0.1, "px", 0.1, 0.0, 0.6, 0.8, least_detectable_range=(0.75, 4.0))
    assert least_detectable_text(jump) == "0.75 to 4"
    assert least_detectable_text(replace(jump, least_detectable_range=None)) == "0.8"
    assert least_detectable_text(replace(jump, least_detectable=None)) == ""


def test_principal_of_nothing() -> None:
    """A check that measured nothing has no principal measurement."""
    assert principal(crashed()) is None


def test_cause_in_one_sentence() -> None:
    """A diagnosis reads as stream, fault and size with its error."""
    assert cause_sentence(late_events()) == "events: timestamps are late by a constant, 2.06 ± 0.03 ms"


def test_cause_of_a_later_version_is_still_shown() -> None:
    """An identifier that this version does not know is shown as it is."""
    assert cause_sentence(replace(late_events(), cause="new_fault", magnitude=None)) == "events: new fault"


def test_explained_checks() -> None:
    """A diagnosis names the checks whose findings it explains, no others."""
    assert explained_checks(late_events(), file_record(passed(), failed())) == ("event_response.timing",)


def test_failures_come_before_warnings() -> None:
    """A warning of an early check does not stand above a failure of a later one."""
    warned = Result("a.b", "warned", "?", findings=(replace(failed().findings[1], id="F0"),))
    assert [finding.id for _, finding in findings_of(file_record(warned, failed()))] == ["F1", "F0", "F2"]


def test_headline_counts_the_gravest_first() -> None:
    """The verdict stands before what it rests on."""
    file = file_record(passed(), failed(), not_observable(), passed("a.b"))
    assert headline(file) == "FINDINGS: 1 failed, 2 passed, 1 not observable"


COVERAGES = {
    "all": (Coverage(101, 101, "frames"), "all 101 frames"),
    "some": (Coverage(12, 101, "frames"), "12 of 101 frames (11.9%)"),
    "nothing to see": (Coverage(0, 0, "events"), "all 0 events"),
    "unknown": (None, ""),
}


@pytest.mark.parametrize(("coverage", "words"), COVERAGES.values(), ids=COVERAGES.keys())
def test_coverage(coverage: Coverage | None, words: str) -> None:
    """Coverage says what was seen, and the share where it is not all."""
    assert coverage_words(coverage) == words


def test_checks_with_one_reason_stand_together() -> None:
    """What is missing is said once, with the checks that it concerns; what a check warns of is said elsewhere."""
    blind = not_observable()
    unusual = (Finding("F1", "a.b.c", "warning", "unusual", Where()),)
    warned = Result("a.b", "warned", "?", reason="unusual", findings=unusual)
    assert reasons((blind, passed(), warned, crashed(), replace(blind, check="imu.rotation"))) == (
        "imu.timing, imu.rotation (not observable): the vehicle hovers",
        "imu.noise (crashed): the check itself failed: ZeroDivisionError: division by zero",
    )


def test_what_went_unseen_is_said_beside_passes_and_warnings() -> None:
    """A pass that could not see all of what matters says so, and so does a warning, beyond what it warns of."""
    unusual = (Finding("F1", "a.b.c", "warning", "unusual", Where()),)
    warned = Result("a.b", "warned", "?", reason="unusual; detection limit too large: drift", findings=unusual)
    assert reasons((replace(passed(), reason="detection limit too large: drift"), warned)) == (
        f"{passed().check} (passed): detection limit too large: drift",
        "a.b (warned): detection limit too large: drift",
    )


def test_incomplete_says_why() -> None:
    """A verdict that is incomplete names the crashed check; without one, that nothing was compared."""
    assert why_incomplete(file_record(crashed())) == "crashed: imu.noise"
    assert "no stream" in why_incomplete(replace(file_record(passed()), verdict="incomplete"))
    assert why_incomplete(file_record(failed())) == ""


@pytest.mark.parametrize(
    ("value", "unit", "said"), [(1, "chunks", "1 chunk"), (2, "chunks", "2 chunks"), (1, "ms", "1 ms"), (1, "1", "1")]
)
def test_one_of_what_is_counted_is_singular(value: float, unit: str, said: str) -> None:
    """One chunk, two chunks; units of physics have no plural."""
    assert with_unit(value, unit) == said


def test_canaries_are_said_in_one_line() -> None:
    """How many were seen, which not, and for how many there was none; nothing where none was asked for."""
    seen, silent = Canary("imu.timing", "seen", "late", 1), Canary("imu.noise", "silent", "noisy", 6)
    none = Canary("imu.rotation", "not_planted", reason="it failed on the file itself")
    withheld = Canary("imu.translation", "withheld", "biased", 6, "the vehicle hovers")
    file = replace(file_record(passed()), canaries=(seen, silent, none, withheld))
    said = "canaries seen by 1 of 3 checks; not seen by imu.noise; no answer from imu.translation; none planted for 1"
    assert canaries_seen(file) == said
    assert canaries_seen(replace(file, canaries=(seen,))) == "canaries seen by 1 of 1 checks"
    assert canaries_seen(file_record(passed())) == ""


@pytest.mark.parametrize(
    ("comparisons", "said"),
    [
        (None, ""),
        (0, "clean: rests on no comparisons between streams"),
        (1, "clean: rests on 1 comparison between streams"),
        (21, "clean: rests on 21 comparisons between streams"),
    ],
)
def test_clean_says_what_it_rests_on(comparisons: int | None, said: str) -> None:
    """A clean verdict counts its comparisons, where they were counted; other verdicts rest on findings."""
    file = replace(file_record(passed()), verdict="clean", comparisons=comparisons)
    assert basis_of_clean(file) == said
    assert basis_of_clean(replace(file, verdict="findings")) == ""


def test_clean_names_the_streams_that_nothing_compared() -> None:
    file = replace(file_record(passed()), verdict="clean", comparisons=6, uncompared=("events", "rgb"))
    said = "clean: rests on 6 comparisons between streams; compared with no other stream: events, rgb"
    assert basis_of_clean(file) == said


def test_an_index_map_alone_is_said_to_be_no_comparison() -> None:
    """An incomplete verdict states what was compared, and why that is not enough."""
    file = replace(file_record(passed()), verdict="incomplete", comparisons=1)
    assert "index map" in why_incomplete(file)
    assert "index map" not in why_incomplete(replace(file, comparisons=0))


def test_deviations_that_do_not_matter_are_counted_apart() -> None:
    """The counts of outcomes stay, and a reader sees that something was measured."""
    assert tally((passed(), immaterial())) == "2 passed; 1 measurable, not material"
    assert tally((passed(),)) == "1 passed"

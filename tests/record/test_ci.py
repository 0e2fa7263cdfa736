"""JUnit XML is read by a real reader, and holds what the record holds."""

import json
import re
from dataclasses import replace

import pytest
from hypothesis import given
from junitparser import Error, Failure, JUnitXml, Skipped, TestCase

from fedora_qa.record.ci import record_to_badge, record_to_github, record_to_junit, silenced
from fedora_qa.record.types import FileRecord, Record
from tests.support.documented import blocks
from tests.support.random_records import records, unhurried
from tests.support.records import crashed, failed, file_record, late_events, not_observable, passed, record


def cases_of(shown: Record) -> dict[str, TestCase]:
    """The cases of a record of one file, by name, as the reader sees them."""
    (suite,) = JUnitXml.fromstring(record_to_junit(shown).encode())
    return {case.name: case for case in suite}


def test_a_finding_is_a_failure() -> None:
    """A failed check is a failure with rule, message, cause and remedy; its warning stands in the output."""
    case = cases_of(record())["event_response.timing"]
    (failure,) = case.result
    assert isinstance(failure, Failure)
    assert failure.type == "event_response.timing.offset"
    assert failure.message.startswith("Events are 2.06 ± 0.03 ms late. Probable cause: events: timestamps are late")
    assert "Subtract the offset from the stamps." in failure.message
    assert "The frames are dark." in case.system_out
    assert "offset 2.06 ± 0.03 ms" in case.system_out


def test_what_could_not_be_told_is_skipped() -> None:
    """A check that the sequence cannot answer is skipped with its reason; one that passed has no result."""
    cases = cases_of(record())
    (skipped,) = cases["imu.timing"].result
    assert isinstance(skipped, Skipped)
    assert skipped.message == "not observable: the vehicle hovers"
    assert cases["clocks.order"].is_passed


def test_a_crash_is_an_error_and_makes_the_file_incomplete() -> None:
    """The crashed check has its traceback, and a case of its own says that the file is incomplete."""
    cases = cases_of(record(file_record(passed(), crashed())))
    (error,) = cases["imu.noise"].result
    assert isinstance(error, Error)
    assert "ZeroDivisionError: division by zero" in error.text
    (incomplete,) = cases["complete"].result
    assert isinstance(incomplete, Error)
    assert incomplete.message == "The check is incomplete: crashed: imu.noise."


def test_counts_and_facts() -> None:
    """Suites count their cases, and name digest, version and verdict."""
    file = file_record(failed(), passed(), crashed(), not_observable(), diagnoses=(late_events(),))
    suites = JUnitXml.fromstring(record_to_junit(record(file)).encode())
    assert (suites.tests, suites.failures, suites.errors, suites.skipped) == (5, 1, 2, 1)
    (suite,) = suites
    properties = {item.name: item.value for item in suite.properties()}
    assert properties["sha256"] == file.sha256
    assert properties["verdict"] == "incomplete"


@unhurried
@given(records())
def test_any_text_is_carried(shown: Record) -> None:
    """Whatever stands in names and messages, the document parses, and has every file and every check."""
    suites = list(JUnitXml.fromstring(record_to_junit(shown).encode()))
    assert len(suites) == len(shown.files)
    for suite, file in zip(suites, shown.files, strict=True):
        assert len([case for case in suite if case.name != "complete"]) == len(file.results)


@pytest.mark.parametrize("hostile", ["\x00\x1b[31m", "]]></failure><x/>", '" onload="', "\ud800\ufffe\x0b"])
def test_hostile_text_makes_no_markup(hostile: str) -> None:
    """Control characters, ends of sections, quotes and lone surrogates come out as text."""
    finding = replace(failed().findings[0], message=f"a{hostile}b", code=hostile)
    (failure,) = cases_of(record(file_record(replace(failed(), findings=(finding,)), path=hostile)))[
        "event_response.timing"
    ].result
    assert failure.message[0] == "a"
    assert failure.message[-1] == "b"


COMMAND = re.compile(r"::(error|warning|notice) file=([^:,\r\n]*),title=([^:,\r\n]*)::([^\r\n]*)")


def decoded(text: str) -> str:
    """Text as GitHub's runner decodes it (actions/runner, ActionCommand.cs)."""
    for escape, character in (("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ","), ("%25", "%")):
        text = text.replace(escape, character)
    return text


def test_a_finding_is_an_annotation() -> None:
    """An error and a warning of one file, with rule, message and place."""
    error, warning = record_to_github(record()).splitlines()
    found = COMMAND.fullmatch(error)
    assert found
    assert found.groups()[:3] == ("error", "seq.h5", "event_response.timing.offset")
    assert found[4].startswith("Events are 2.06 ± 0.03 ms late.")
    assert found[4].endswith("(events, 0 s to 2 s)")
    assert warning.startswith("::warning file=seq.h5,")


def test_clean_is_silent() -> None:
    """A clean file has no annotation."""
    assert record_to_github(record(file_record(passed()))) == ""


@unhurried
@given(records())
def test_every_line_is_one_command(shown: Record) -> None:
    """No text ends a property, begins a line, or gives another command."""
    for line in record_to_github(shown).split("\n")[:-1]:
        assert COMMAND.fullmatch(line)


@pytest.mark.parametrize("hostile", ["100%0A::error::x", "50%, a:b,c", "::stop-commands::x"])
def test_text_comes_back(hostile: str) -> None:
    """Escapes, colons and commas in a file's text are shown as they are."""
    finding = replace(failed().findings[0], message=hostile, code=hostile)
    shown = record(file_record(replace(failed(), findings=(finding,)), path=hostile))
    found = COMMAND.fullmatch(record_to_github(shown).removesuffix("\n"))
    assert found
    assert [decoded(part) for part in found.groups()[1:3]] == [hostile, hostile]
    assert decoded(found[4]).startswith(hostile)


def test_a_line_break_begins_no_command() -> None:
    """A message of two lines, the second a command, stays one line."""
    finding = replace(failed().findings[0], message="one\n::error::two\r\nthree")
    (line,) = record_to_github(record(file_record(replace(failed(), findings=(finding,))))).splitlines()
    assert "::error::two" in line


def test_silence_ends_with_its_own_token() -> None:
    """The summary stands between a stop and the token that ends it, a new one each time."""
    lines = silenced("::error::hello").splitlines()
    token = lines[0].removeprefix("::stop-commands::")
    assert lines == [f"::stop-commands::{token}", "::error::hello", f"::{token}::"]
    assert silenced("x") != silenced("x")


@pytest.mark.parametrize(
    ("files", "message", "color"),
    [
        ((file_record(passed()),), "clean", "brightgreen"),
        ((file_record(passed()), file_record(failed(), path="b.h5")), "findings", "red"),
        ((file_record(crashed()), file_record(failed(), path="b.h5")), "incomplete", "orange"),
    ],
)
def test_the_gravest_verdict_has_its_colour(files: tuple[FileRecord, ...], message: str, color: str) -> None:
    """One file that is not clean is enough; nothing but a clean record is green."""
    shown = json.loads(record_to_badge(record(*files)))
    assert shown == {"schemaVersion": 1, "label": "fedora-qa", "message": message, "color": color}


def test_the_documentation_has_the_badge_of_a_clean_record() -> None:
    """The page on CI shows what is written."""
    assert json.loads(blocks("ci.md", "json")[0]) == json.loads(record_to_badge(record(file_record(passed()))))

"""Annotations are one command a line, whatever the text, and the text comes back as GitHub decodes it."""

import re
from dataclasses import replace

import pytest
from hypothesis import given

from fedora_qa.record.ci import record_to_github, silenced
from fedora_qa.record.types import Record
from tests.support.random_records import records, unhurried
from tests.support.records import failed, file_record, passed, record

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

"""What a person sees: at any width, in any terminal, whatever a file holds."""

import io
from dataclasses import replace
from typing import Literal

import pytest
from rich.console import Console

from fedora_qa.cli.summary import Detail, show_record
from fedora_qa.record.types import Record, Where
from tests.support.records import crashed, failed, file_record, late_events, not_observable, passed, record

HOSTILE = "[bold red]x[/] \x1b[31m\x1b]0;owned\x07 \r\n\u202eevil [link=http://x]"


def shown(what: Record, width: int = 120, *, terminal: bool = False, detail: Detail = "normal") -> str:
    """The summary as a console of a width prints it."""
    buffer = io.StringIO()
    system: Literal["truecolor"] | None = "truecolor" if terminal else None
    console = Console(
        file=buffer, width=width, markup=False, highlight=False, force_terminal=terminal, color_system=system
    )
    show_record(console, what, detail)
    return buffer.getvalue()


def words(text: str) -> str:
    """The text on one line."""
    return " ".join(text.split())


@pytest.mark.parametrize("detail", ["normal", "verbose"])
@pytest.mark.parametrize("width", [50, 80, 109, 110, 160])
def test_everything_is_said_at_every_width(width: int, detail: Detail) -> None:
    """Verdict, cause with size and error, place, remedy, what it explains, findings, each check: nothing is cut off."""
    text = shown(record(), width, detail=detail)
    assert max(map(len, text.splitlines())) <= width
    for part in (
        "FINDINGS",
        "1 failed, 1 passed, 1 not observable",
        "events: timestamps are late by a constant, 2.06 ± 0.03 ms",
        "confirmed: undoing it clears 1 of 1 finding in 4 windows",
        "events, 0 s to 2 s",
        "Subtract the offset from the stamps.",
        "event_response.timing (F1)",
        "Events are 2.06 ± 0.03 ms late.",
        "the vehicle hovers",
        "flow_unit px",
    ):
        assert part in words(text)


def test_a_pipe_gets_a_line_a_file() -> None:
    """However long the path is: programs count and split lines. A terminal gets lines of its width."""
    (late,) = record().files
    long = record(replace(late, path="/data/" + "long/" * 40 + "late.h5"), late)
    lines = shown(long, 80, detail="quiet").splitlines()
    assert len(lines) == 2
    assert lines[0].split()[:2] == ["findings", long.files[0].path]
    assert len(shown(long, 80, terminal=True, detail="quiet").splitlines()) > 2


def test_verdict_comes_last_after_causes() -> None:
    """A terminal shows its last lines: the verdict, above it the causes, above them the findings."""
    text = shown(record())
    order = [text.index(part) for part in ("Checks\n", "Findings\n", "Probable causes", "slowest checks", "FINDINGS")]
    assert order == sorted(order)
    assert "FINDINGS" in text.splitlines()[-1]


def test_passed_checks_of_a_subject_are_one_line() -> None:
    """Their numbers stand in the verbose summary."""
    what = record(file_record(passed("clocks.order"), passed("clocks.rate"), failed()))
    assert "passed  clocks: order, rate" in shown(what)
    assert "backward_steps" not in shown(what)
    assert "clocks.rate" in shown(what, detail="verbose")
    assert shown(what, detail="verbose").count("backward_steps 0 samples") == 2


def test_quiet_is_a_line_a_file() -> None:
    """Verdict, path, and the first cause or the number of checks."""
    lines = shown(record(file_record(passed(), path="a.h5"), *record().files), detail="quiet").splitlines()
    assert lines[0].split()[:2] == ["clean", "a.h5"]
    assert lines[1].split()[0] == "findings"
    assert "timestamps are late by a constant" in lines[1]
    assert len(lines) == 2


@pytest.mark.parametrize("width", [60, 140])
def test_text_from_a_file_is_shown_as_it_is(width: int) -> None:
    """Markup and escape sequences in names and messages neither colour, nor link, nor move the cursor."""
    finding = replace(failed().findings[0], message=HOSTILE, where=Where(stream=HOSTILE))
    hostile = file_record(replace(failed(), findings=(finding,), reason=HOSTILE), path=HOSTILE)
    hostile = replace(hostile, inferred={HOSTILE: HOSTILE}, dialect=HOSTILE, diagnoses=(late_events(),))
    text = shown(record(hostile), width)
    assert "\x1b" not in text
    assert "\x07" not in text
    assert "\u202e" not in text
    assert "[bold red]x[/]" in words(text)


def test_colour_in_a_terminal_only() -> None:
    """The verdict is coloured where somebody looks, and only there."""
    assert "\x1b[" in shown(record(), terminal=True)
    assert "\x1b[" not in shown(record())


def test_incomplete_says_why() -> None:
    """A crashed check is named beside the verdict."""
    lines = shown(record(file_record(passed(), crashed()))).splitlines()
    assert "INCOMPLETE" in lines[-1]
    assert lines[-2] == "incomplete: crashed: imu.noise"


def test_many_findings_are_counted_not_listed() -> None:
    """A file with a thousand findings does not scroll the verdict away."""
    finding = failed().findings[0]
    many = replace(failed(), findings=tuple(replace(finding, id=f"F{i}") for i in range(1000)))
    text = shown(record(file_record(many)))
    assert len(text.splitlines()) < 60
    assert "988 more" in text


def test_several_files_end_in_a_table_and_a_verdict() -> None:
    """After the details of each file, one line a file sums up; below, the gravest verdict. Quiet, these lines alone."""
    both = record(file_record(failed(), path="one.h5"), file_record(passed(), path="two.h5"))
    last = shown(both).splitlines()[-4:]
    assert last[0].split()[:2] == ["findings", "one.h5"]
    assert last[1].split()[:2] == ["clean", "two.h5"]
    assert last[2:] == ["", " FINDINGS   1 of 2, first one.h5"]
    assert [line.split()[1] for line in shown(both, detail="quiet").splitlines()] == ["one.h5", "two.h5"]
    clean = record(*(file_record(passed(), path=path) for path in ("one.h5", "two.h5")))
    assert shown(clean).splitlines()[-1] == " CLEAN   2 of 2"


def test_no_head_without_checks() -> None:
    """Where no check applies, there is no head of a list of checks."""
    text = shown(record(file_record(replace(not_observable(), outcome="not_applicable"))))
    assert "Checks" not in text


def test_a_file_without_checks() -> None:
    """A record that holds nothing is shown, not crashed on."""
    assert "no check was run" in shown(record(file_record()))

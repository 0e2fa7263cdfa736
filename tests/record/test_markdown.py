"""Markdown says what the record says, and shows what comes from a file as it is."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from fedora_qa.record.markdown import escape, record_to_markdown, table
from fedora_qa.record.types import Canary
from tests.support.records import crashed, failed, file_record, late_events, passed, record

RENDERER = MarkdownIt("gfm-like", {"html": True, "linkify": False})


def test_a_reader_finds_verdict_cause_remedy_and_finding() -> None:
    """The summary holds the verdict, the cause with its size, the remedy, the finding, and every check."""
    text = record_to_markdown(record())
    for part in (
        "FINDINGS: 1 failed, 1 passed, 1 not observable",
        "timestamps are late by a constant, 2.06 ± 0.03 ms",
        "Subtract the offset from the stamps.",
        "Events are 2.06 ± 0.03 ms late.",
        "| clocks.order | passed | backward\\_steps 0 samples | 0 | 1 | all 101 frames |",
        "the vehicle hovers",
    ):
        assert part in text


def test_tables_are_tables() -> None:
    """A CommonMark renderer with GitHub's tables sees one of findings and one of checks."""
    assert RENDERER.render(record_to_markdown(record())).count("<table>") == 2


def test_several_files_begin_with_what_came_of_each() -> None:
    """Of two files a table of both comes first, with verdict, tally and cause; of one there is none."""
    both = record(
        file_record(passed(), path="good.h5"), file_record(failed(), path="late.h5", diagnoses=(late_events(),))
    )
    first = record_to_markdown(both).split("\n\n")[0].splitlines()
    assert first[2] == "| good.h5 | clean | 1 passed |  |"
    assert first[3] == "| late.h5 | findings | 1 failed | events: timestamps are late by a constant, 2.06 ± 0.03 ms |"
    assert record_to_markdown(record()).startswith("## ")


def test_incomplete_says_why() -> None:
    """A crashed check is named under the verdict."""
    assert "crashed: imu.noise" in record_to_markdown(record(file_record(passed(), crashed())))


def test_canaries_are_named_under_the_verdict() -> None:
    """Where canaries were planted one line says how many were seen."""
    file = replace(file_record(passed()), canaries=(Canary("clocks.order", "seen", "exchanged", 1),))
    assert "canaries seen by 1 of 1 checks" in record_to_markdown(record(file))


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126)))
def test_escaped_text_renders_as_itself(content: str) -> None:
    """Whatever is printable reads the same after rendering: no markup, HTML, entity or table cell comes of it."""
    rendered = RENDERER.render(f"- x{escape(content)}x").replace("\u200b", "")
    for character, entity in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;")):
        content = content.replace(character, entity)
    assert rendered == f"<ul>\n<li>x{content}x</li>\n</ul>\n"


def test_hostile_message_makes_no_markup() -> None:
    """A message with HTML, a pipe, a link and a mention stays one cell of plain text."""
    message = "<img src=x> | [click](http://x) https://x.y www.x.y @someone #1 `code`"
    finding = replace(failed().findings[0], message=message)
    text = record_to_markdown(record(file_record(replace(failed(), findings=(finding,)))))
    rendered = MarkdownIt("gfm-like", {"html": True, "linkify": False}).render(text)
    assert "<img" not in rendered
    assert "<a " not in rendered
    assert "<code>" not in rendered
    assert "https://" not in text
    assert "@someone" not in text


def test_table_escapes_cells() -> None:
    """A pipe in a cell does not end it."""
    assert table(("a", "b"), [("x|y", "z")]) == "| a | b |\n| --- | --- |\n| x\\|y | z |"

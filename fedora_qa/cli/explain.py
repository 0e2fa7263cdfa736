"""``fedora-qa checks`` and ``fedora-qa explain``: the question of each check and how it answers it; what a cause is."""

import re
import sys
from dataclasses import replace
from typing import Final

import click
from rich.table import Table
from rich.text import Text

from fedora_qa.causes import CAUSES, allowed
from fedora_qa.check_names import check_of_rule, require_check_names, subject_of
from fedora_qa.checks.explanation import Explanation, published_explanations
from fedora_qa.cli.console import stdout_console
from fedora_qa.cli.options import complete_explained
from fedora_qa.errors import MisuseError
from fedora_qa.record.wording import capitalised

_NUMBERED: Final = re.compile(r"[FD]\d+")
"""Numbers of findings and diagnoses, which people copy from a summary."""


@click.command()
def checks() -> int:
    """List the checks in the order in which they run. Piped, one a line: name, tab, question."""
    # Tabs and no wrapping: `cut` and `awk` then split the lines.
    if not sys.stdout.isatty():
        for explained in published_explanations():
            click.echo(f"{explained.check}\t{explained.question}")
        return 0
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for explained in published_explanations():
        table.add_row(explained.check, Text(explained.question))
    stdout_console().print(table)
    return 0


@click.command()
@click.argument("name", metavar="CHECK|CAUSE", shell_complete=complete_explained)
def explain(name: str) -> int:
    """Explain what CHECK, or every check of a subject, measures, how, and what it cannot detect.

    A CAUSE, such as events:time_offset or time_offset, is explained with its size and its remedy. For the code of a
    finding, such as clocks.order.backward_steps, its check is explained.
    """
    console = stdout_console()
    stream, colon, identifier = name.rpartition(":")
    cause = CAUSES.get(identifier)
    if cause is not None:
        if colon and not allowed(identifier, stream):
            raise MisuseError(f"Expected a stream of {identifier} ({', '.join(cause.streams)}), got {stream!r}")
        console.print(Text(cause.identifier, style="bold"))
        console.print(Text(f"befalls: {', '.join(cause.streams)}", style="dim"))
        size = "a pure number" if cause.unit == "1" else f"in {cause.unit}"
        sign = f"{size}; positive means timestamps too late, or values too large" if cause.unit else "it has none"
        for title, sentence in (("What is wrong", cause.meaning), ("Size", sign), ("Remedy", cause.remedy)):
            console.print(Text.assemble("\n", (title, "bold"), f"\n{capitalised(sentence).rstrip('.')}."))
        return 0
    if _NUMBERED.fullmatch(name):
        raise MisuseError(
            f"Expected a subject, a check or the code of a finding, got {name!r}, which numbers a finding or diagnosis "
            "of one record; use the code beside it"
        )
    if check := check_of_rule(name):
        console.print(Text(f"{name} is a rule or a measurement of the check {check}.\n"))
    else:
        require_check_names([name], also=CAUSES)
    for explained in explanations_of(name):
        console.print(Text(explained.check, style="bold"))
        console.print(Text(needs_words(explained), style="dim"))
        content = Text(f"\n{explained.question}\n\n{explained.measured}\n")
        for title, section in explained.sections.items():
            content.append(f"\n{title}\n", style="bold").append(f"{section}\n")
        console.print(content)
    return 0


def explanations_of(name: str) -> tuple[Explanation, ...]:
    """Return the explanations of a check, of that of a rule, or of every check of a subject, with power and price.

    Raises
    ------
    MisuseError
        There is no such check or subject.
    """
    name = check_of_rule(name) or name
    require_check_names([name])
    explanations = [each for each in published_explanations() if name in {each.check, subject_of(each.check)}]
    # Loads pydantic, which `checks` does not need.
    from fedora_qa.cli.published_studies import measured_sections  # noqa: PLC0415

    return tuple(replace(each, sections={**each.sections, **measured_sections(each.check)}) for each in explanations)


def needs_words(explained: Explanation) -> str:
    """Return which streams a check needs, in words."""
    return f"needs: {', '.join(explained.needs) or 'no stream'}"

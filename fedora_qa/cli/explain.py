"""``fedora-qa checks`` and ``fedora-qa explain``: the question of each check, and how the check answers it."""

import sys

import click
from rich.table import Table
from rich.text import Text

from fedora_qa.catalogue import CHECKS
from fedora_qa.checks.explanation import explanation
from fedora_qa.cli.console import stdout_console
from fedora_qa.cli.detection_power import TITLE, detection_power_text
from fedora_qa.cli.material_sizes import TITLE as MATERIAL_SIZES
from fedora_qa.cli.material_sizes import material_sizes_text
from fedora_qa.cli.options import complete_check
from fedora_qa.errors import MisuseError


@click.command()
def checks() -> int:
    """List the checks in the order in which they run. Piped, one a line: name, tab, question."""
    # Tabs and no wrapping: `cut` and `awk` then split the lines.
    if not sys.stdout.isatty():
        for check in CHECKS:
            click.echo(f"{check.name}\t{check.question}")
        return 0
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for check in CHECKS:
        table.add_row(check.name, Text(check.question))
    stdout_console().print(table)
    return 0


@click.command()
@click.argument("name", metavar="CHECK", shell_complete=complete_check)
def explain(name: str) -> int:
    """Explain what CHECK, or every check of a subject, measures, how, and what it cannot detect."""
    checks = [check for check in CHECKS if name in {check.name, check.name.split(".")[0]}]
    if not checks:
        raise MisuseError(f"Expected a check or subject, got {name!r}; `fedora-qa checks` lists them")
    console = stdout_console()
    for check in checks:
        console.print(Text(check.name, style="bold"))
        console.print(Text(f"needs: {', '.join(check.needs) or 'no stream'}", style="dim"))
        explained = explanation(check)
        content = Text(f"\n{explained.question}\n\n{explained.measured}\n")
        power = detection_power_text(check.name)
        sizes = {MATERIAL_SIZES: material_sizes_text(check.name)}
        sections = {**explained.sections, **sizes, **({TITLE: power} if power else {})}
        for title, section in sections.items():
            content.append(f"\n{title}\n", style="bold").append(f"{section}\n")
        console.print(content)
    return 0

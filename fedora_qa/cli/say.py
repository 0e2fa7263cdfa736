"""Print a record: the summary for people, and annotations for GitHub if they are asked for."""

import click

from fedora_qa.cli.summary import show_record
from fedora_qa.cli.terminal import stdout_console
from fedora_qa.record.github import record_to_github, silenced
from fedora_qa.record.types import Record


def say_record(record: Record, *, github: bool) -> None:
    """Print the summary, and then the annotations; GitHub obeys no command that a file contains."""
    console = stdout_console()
    if not github:
        show_record(console, record)
        return
    # Captured whole, because GitHub obeys commands in any line that is printed outside the silenced part.
    with console.capture() as captured:
        show_record(console, record)
    click.echo(silenced(captured.get()) + record_to_github(record), nl=False)

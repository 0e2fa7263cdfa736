"""Consoles for results and messages; text from files is never interpreted as markup."""

import os
import re
import sys
from typing import Final

from rich.console import Console
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from fedora_qa.record.tables import ABSENT, SOURCE, TextTable
from fedora_qa.record.wording import unobeyed

# Columns. rich assumes 80 for a pipe, which is too narrow for the table of checks.
_PIPED_WIDTH: Final = 132

_ANY_WIDTH: Final = 1 << 16
"""Columns, more than any table has."""


class _PipedConsole(Console):
    """A console that raises when its reader has closed the pipe; rich itself would end the process."""

    def on_broken_pipe(self) -> None:
        """Raise ``BrokenPipeError``, which ``run`` turns into an exit code."""
        raise BrokenPipeError


def stdout_console() -> Console:
    """Return the console for results."""
    return _console(stderr=False)


def stderr_console() -> Console:
    """Return the console for progress and messages."""
    return _console(stderr=True)


def text(content: str, style: str = "") -> Text:
    """Return text made printable: never read as markup, nor as a command by a CI system that reads the log."""
    return Text(unobeyed(content), style=style)


def print_table(console: Console, source: TextTable) -> None:
    """Print a table between its title and its note, and a blank line after it."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column, name in enumerate(source.head):
        # Text is aligned on the left, and numbers on the right, so that their digits stand below each other.
        is_text = column < source.words or name == SOURCE
        table.add_column(name, justify="left" if is_text else "right", overflow="fold")
    for row in source.rows:
        table.add_row(*(text(cell) for cell in row))
    console.print(Text(source.title, style="bold"))
    needed = Measurement.get(console, console.options.update(max_width=_ANY_WIDTH), table)
    if needed.minimum > console.width:
        # Not even the longest words fit beside each other: the cells of each row, with their names.
        for row in source.rows:
            named = zip(source.head[1:], row[1:], strict=True)
            content = "; ".join(f"{name} {cell}" for name, cell in named if cell not in {"", ABSENT})
            console.print(text(row[0], "bold"))
            console.print(Padding(text(content), (0, 0, 0, 4), expand=False))
    else:
        if needed.maximum > console.width:
            # rich would break the longest names within a word; units below the names leave them room.
            for drawn, name in zip(table.columns, source.head, strict=True):
                drawn.header = re.sub(r" (?=[\[(])", "\n", name)
        console.print(table)
    if source.note:
        console.print(text(source.note, "dim"))
    console.print()


def _console(*, stderr: bool) -> Console:
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() or "COLUMNS" in os.environ else _PIPED_WIDTH
    # Square brackets and colons occur in messages and paths; rich would take them for markup and emoji.
    return _PipedConsole(stderr=stderr, width=width, markup=False, highlight=False, emoji=False)

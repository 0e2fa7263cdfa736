"""Consoles: colour and width of a terminal only on one, and no text of a file interpreted as markup."""

import os
import sys
from collections.abc import Iterable, Sequence
from typing import Final

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fedora_qa.record.wording import unobeyed

# Columns. rich assumes 80 for a pipe, which is too narrow for the table of checks.
_PIPED_WIDTH: Final = 132


class _PipedConsole(Console):
    """A console that raises when its reader has closed the pipe; rich itself would end the process."""

    def on_broken_pipe(self) -> None:
        """Raise ``BrokenPipeError``, which ``run`` turns into an exit code."""
        raise BrokenPipeError


def stdout_console() -> Console:
    """Return the console for results."""
    return _console(stderr=False)


def stderr_console() -> Console:
    """Return the console for progress and complaints."""
    return _console(stderr=True)


def text(content: str, style: str = "") -> Text:
    """Return text made printable: never read as markup, nor as a command by a CI system that reads the log."""
    return Text(unobeyed(content), style=style)


def print_table(
    console: Console, title: str, head: Sequence[str], rows: Iterable[Sequence[str]], *, is_text: Sequence[bool]
) -> None:
    """Print a table under its title.

    Parameters
    ----------
    is_text
        Of each column whether it holds text, which is aligned on the left. Numbers are aligned on the right, so that
        their digits stand below each other.
    """
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name, is_left in zip(head, is_text, strict=True):
        table.add_column(name, justify="left" if is_left else "right", overflow="fold")
    for row in rows:
        table.add_row(*(text(cell) for cell in row))
    console.print(Text(title, style="bold"))
    console.print(table)


def _console(*, stderr: bool) -> Console:
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() or "COLUMNS" in os.environ else _PIPED_WIDTH
    # Square brackets and colons occur in messages and paths; rich would take them for markup and emoji.
    return _PipedConsole(stderr=stderr, width=width, markup=False, highlight=False, emoji=False)

"""Consoles: colour and width only where somebody looks, and nothing from a file ever taken for markup."""

import os
import sys
from typing import Final

from rich.console import Console
from rich.text import Text

from fedora_qa.record.wording import unobeyed

_PIPED_WIDTH: Final = 132


class _PipedConsole(Console):
    """A console that tells its caller when the reader has gone, rather than leave the process on its own."""

    def on_broken_pipe(self) -> None:
        """Raise on."""
        raise BrokenPipeError


def stdout_console() -> Console:
    """Return the console for results."""
    return _console(stderr=False)


def stderr_console() -> Console:
    """Return the console for progress and complaints."""
    return _console(stderr=True)


def text(content: str, style: str = "") -> Text:
    """Return text as it is: made printable, never read as markup, and obeyed by nobody who reads a log."""
    return Text(unobeyed(content), style=style)


def _console(*, stderr: bool) -> Console:
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() or "COLUMNS" in os.environ else _PIPED_WIDTH
    return _PipedConsole(stderr=stderr, width=width, markup=False, highlight=False, emoji=False)

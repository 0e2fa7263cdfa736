"""The record as GitHub's workflow commands: annotations of the files in a run's summary and in a pull request.

Escapes are those of GitHub's own toolkit (actions/toolkit, command.ts).
"""

import secrets
from typing import Final

from fedora_qa.record.problems import Level, problems_of
from fedora_qa.record.types import Record
from fedora_qa.record.wording import place, printable

_COMMANDS: Final[dict[Level, str]] = {"error": "error", "warning": "warning", "note": "notice"}


def record_to_github(record: Record) -> str:
    """Return one annotation a line; empty without problems."""
    lines: list[str] = []
    for problem in (problem for file in record.files for problem in problems_of(file)):
        where = place(problem.where)
        message = problem.message + (f" ({where})" if where else "")
        properties = f"file={_property(problem.path)},title={_property(problem.code)}"
        lines.append(f"::{_COMMANDS[problem.level]} {properties}::{_data(message)}\n")
    return "".join(lines)


def silenced(text: str) -> str:
    """Return text between commands that keep GitHub from executing any command in it.

    The token resumes commands, so that it is random and cannot be predicted.
    """
    token = secrets.token_hex(16)
    return f"::stop-commands::{token}\n{text}\n::{token}::\n"


def _data(text: str) -> str:
    """Return a message as the end of a command can carry it."""
    # The percent sign first: the escapes that follow contain it (actions/toolkit, escapeData).
    return printable(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    """Return the value of a property, in which colons and commas must be escaped as well."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")

"""Documents that commands write: each into a file, or at most one on stdout, alone."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import click

from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import write_text

STDOUT: Final = Path("-")
"""As the path of a document: stdout. What people read is then printed on stderr."""


def document_paths(form: str | None, paths: Mapping[str, Path | None]) -> dict[str, Any]:
    """Return the path of each document or None, with stdout for the format that is to be printed.

    Parameters
    ----------
    form
        Format of ``--format``; None: it was not given.

    Raises
    ------
    MisuseError
        A format is requested twice, or stdout would get two documents.
    """
    if form and paths.get(form):
        raise MisuseError(f"Expected either --{form} OUT or --format {form}, got both")
    whole = {**paths, form: STDOUT} if form else dict(paths)
    printed = [name for name, path in whole.items() if path == STDOUT]
    if len(printed) > 1:
        raise MisuseError(f"Expected one document on stdout, got {' and '.join(printed)}; write the others into files")
    return whole


def write_document(target: Path, content: str | Iterable[str]) -> None:
    """Write a document, or the parts of one, entirely or not at all, in UTF-8; on stdout whatever its encoding is."""
    if target == STDOUT:
        content = "".join(content)
        click.echo(content.encode(), nl=not content.endswith("\n"))
    else:
        write_text(target, content)

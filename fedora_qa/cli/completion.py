"""Completion of arguments in shells. A shell waits for it at every key: it loads no numerical library."""

from importlib import resources

import click
from click.shell_completion import CompletionItem

from fedora_qa.causes import CAUSES
from fedora_qa.check_names import check_names


def complete_check(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects and checks that begin with ``incomplete``."""
    return [name for name in check_names() if name.startswith(incomplete)]


def complete_explained(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects, checks and causes that begin with ``incomplete``."""
    causes = [cause for cause in CAUSES if cause.startswith(incomplete)]
    return [*complete_check(context, parameter, incomplete), *causes]


def complete_file(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Leave it to the shell to complete a path."""
    return [CompletionItem(incomplete, type="file")]


def complete_dialect(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the dialects of the package that begin with ``incomplete``, and leave files to the shell."""
    # By the names of their files: the module of dialects loads numerical libraries.
    files = (resources.files("fedora_qa") / "layout" / "dialects").iterdir()
    names = sorted(file.name.removesuffix(".toml") for file in files if file.name.endswith(".toml"))
    items = [CompletionItem(name) for name in names if name.startswith(incomplete)]
    return [*items, *complete_file(context, parameter, incomplete)]

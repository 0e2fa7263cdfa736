"""Completion of arguments in shells. A shell waits for it at every key: it loads no numerical library."""

import click

from fedora_qa.check_names import check_names


def complete_check(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects and checks that begin with ``incomplete``."""
    return [name for name in check_names() if name.startswith(incomplete)]

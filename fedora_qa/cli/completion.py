"""Completion of arguments in shells. A shell waits for it at every key: it loads no numerical library."""

import click

from fedora_qa.checks.explanation import published_explanations


def complete_check(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects and checks that begin with ``incomplete``."""
    checks = [explained.check for explained in published_explanations()]
    names = dict.fromkeys(name for check in checks for name in (check.split(".")[0], check))
    return [name for name in names if name.startswith(incomplete)]

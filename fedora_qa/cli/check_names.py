"""Names of subjects and checks, for the completion of shells."""

import click


def complete_check(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects and checks that begin so."""
    from fedora_qa.checks import CHECKS  # noqa: PLC0415 - loads every check

    names = dict.fromkeys(name for check in CHECKS for name in (check.name.split(".")[0], check.name))
    return [name for name in names if name.startswith(incomplete)]

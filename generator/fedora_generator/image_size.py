"""The value ``WIDTHxHEIGHT`` of commands."""

import re

import click


def read_size(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int] | None:
    """Read ``WIDTHxHEIGHT``, px.

    Raises
    ------
    click.BadParameter
        Not two whole numbers with an x between.
    """
    if value is None:
        return None
    match = re.fullmatch(r"([0-9]{1,6})x([0-9]{1,6})", value, flags=re.IGNORECASE)
    if match is None:
        raise click.BadParameter(f"Expected WIDTHxHEIGHT such as 720x540, got {value!r}")
    return int(match[1]), int(match[2])

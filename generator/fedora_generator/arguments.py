"""Arguments of the commands: sizes, regions and lists of names, and completion of names in shells.

A shell waits for completion at every key: this file loads nothing that draws.
"""

import re
from collections.abc import Callable, Sequence

import click
from click.shell_completion import CompletionItem

from fedora_generator.choices import SCENE_NAMES, STREAMS
from fedora_qa.causes import CAUSES

CAUSE_NAMES = tuple(cause for cause in CAUSES if cause != "unknown")
"""Causes that can be planted."""

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


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


def read_region(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int, int, int] | None:
    """Read ``x0,y0,x1,y1``."""
    if value is None:
        return None
    match = re.fullmatch(r"([0-9]{1,6}),([0-9]{1,6}),([0-9]{1,6}),([0-9]{1,6})", value)
    if match is None:
        raise click.BadParameter(f"Expected x0,y0,x1,y1 such as 0,0,320,240, got {value!r}")
    left, top, right, bottom = (int(digits) for digits in match.groups())
    return left, top, right, bottom


def read_list(_: click.Context, __: click.Parameter, value: str) -> tuple[str, ...]:
    """Read names with commas between."""
    return tuple(dict.fromkeys(name.strip() for name in value.split(",") if name.strip()))


def complete_scene(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the scenes that begin so, and leave files of scenes to the shell."""
    return [*_beginning(SCENE_NAMES, incomplete), CompletionItem(incomplete, type="file")]


def complete_cause(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the causes that begin so."""
    return _beginning(CAUSE_NAMES, incomplete)


def complete_stream(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the streams that begin so, of those that the cause on the command line can befall."""
    # click parses no arguments behind an option that still lacks its value, and leaves them in `args`.
    names = (str(context.params.get("cause")), *context.args)
    streams = next((CAUSES[name].streams for name in names if name in CAUSES), STREAMS)
    return _beginning(streams, incomplete)


def list_completion(names: Sequence[str]) -> Complete:
    """Return what completes the last of several names with commas between."""

    def complete(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
        before, comma, last = incomplete.rpartition(",")
        return [CompletionItem(before + comma + item.value) for item in _beginning(names, last)]

    return complete


def _beginning(names: Sequence[str], incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(name) for name in names if name.startswith(incomplete)]

"""Completion of names in shells. A shell waits for it at every key: it loads nothing that draws."""

from collections.abc import Callable, Sequence

import click
from click.shell_completion import CompletionItem

from fedora_generator.choices import STREAMS
from fedora_generator.scene_names import SCENE_NAMES
from fedora_qa.causes import CAUSES

CAUSE_NAMES = tuple(cause for cause in CAUSES if cause != "unknown")
"""Causes that can be planted."""

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


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

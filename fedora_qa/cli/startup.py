"""What happens before a command runs: its module is found, workers and modules begin to load."""

import gc
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from itertools import pairwise
from types import MappingProxyType
from typing import Any, Final, cast

import click
from click.shell_completion import CompletionItem

from fedora_qa.errors import did_you_mean

# Monotonic time in s: a correction of the wall clock must not shorten or lengthen a budget.
START_TIME: Final = "fedora_qa.began"
"""Key of the start of the command (``time.monotonic``) in ``click.Context.meta``, for a budget of time."""

IN_PROCESS_VARIABLE: Final = "FEDORA_QA_IN_PROCESS"
"""If set, a single job runs in the process of the command: for debuggers and profilers."""

_WITH_WORKERS: Final = frozenset({"check", "gate"})

_WITHOUT_WORKERS: Final = frozenset({"-h", "--help", "--dask"})
"""Options with which these commands start no workers."""


def preload_workers(arguments: Sequence[str]) -> None:
    """Begin to load what workers need, if the command will probably start some.

    Loading takes longer than parsing the command line, so both are done at once. A wrong guess costs only time.
    """
    # Both `--dask ADDRESS` and `--dask=ADDRESS` are legal.
    options = {argument.split("=")[0] for argument in arguments}
    if (
        arguments
        and arguments[0] in _WITH_WORKERS
        and not options & _WITHOUT_WORKERS
        and IN_PROCESS_VARIABLE not in os.environ
    ):
        from fedora_qa.engine.executors.fork_server import begin_preloading  # noqa: PLC0415 - other commands need none of it

        begin_preloading(_selected(arguments))


def _selected(arguments: Sequence[str]) -> list[str]:
    """Return what follows each ``--select``: names of checks and subjects, if the command line is right."""
    joined = [argument.partition("=")[2] for argument in arguments if argument.startswith("--select=")]
    return joined + [name for option, name in pairwise(arguments) if option == "--select"]


@contextmanager
def loading_modules() -> Iterator[None]:
    """Import modules without collecting garbage.

    Modules stay loaded. Scanning them while more are loaded, and again at the end, takes a fifth of the time of loading
    (3.1 and 2.4 s, medians of three imports of everything that ``check`` needs, with and without).
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


class LazyGroup(click.Group):
    """A group that imports a command only when it runs or shows its own help.

    Parameters
    ----------
    package
        Where the modules of the commands are.
    table
        Of each command its module and name in it, such as ``check:check``, and what it does, in the order of the help.
    elsewhere
        Commands of other programs that people look for here, by the name that they try.
    """

    def __init__(
        self,
        *arguments: Any,
        package: str,
        table: Mapping[str, tuple[str, str]],
        elsewhere: Mapping[str, str] = MappingProxyType({}),
        **options: Any,
    ) -> None:
        super().__init__(*arguments, **options)
        self._package = package
        self._table = table
        self._elsewhere = elsewhere

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        return list(self._table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if cmd_name not in self._table:
            return None
        module, name = self._table[cmd_name][0].split(":")
        with loading_modules():
            return cast(click.Command, getattr(import_module(f"{self._package}.{module}"), name))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the arguments name, and what follows; an unknown name is a usage error."""
        if other := self._elsewhere.get(args[0]):
            ctx.fail(f"No such command {args[0]!r}; use {other}")
        hint = did_you_mean(args[0], self._table)
        if hint and args[0] not in self._table and not ctx.resilient_parsing:
            ctx.fail(f"No such command {args[0]!r}{hint}")
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands and options that begin so, without importing any command."""
        commands = [CompletionItem(name, help=meaning) for name, (_, meaning) in self._table.items()]
        options = click.Command.shell_complete(self, ctx, incomplete)
        return [*(item for item in commands if item.value.startswith(incomplete)), *options]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what each command does, without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, meaning) for name, (_, meaning) in self._table.items()])

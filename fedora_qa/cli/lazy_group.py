"""A group of commands of which each is imported when it is used."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any, cast

import click
from click.shell_completion import CompletionItem

from fedora_qa.cli.startup import loading_modules
from fedora_qa.errors import did_you_mean


class LazyGroup(click.Group):
    """A group that imports a command only when it runs or shows its own help.

    Parameters
    ----------
    package
        Where the modules of the commands are.
    table
        Of each command its module and name in it, such as ``check:check``, and what it does, in the order of the help.
    """

    def __init__(self, *arguments: Any, package: str, table: Mapping[str, tuple[str, str]], **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._package = package
        self._table = table

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

"""The command ``fedora-qa``.

Commands are imported when they are used, so that ``--help`` does not load numerical libraries.
"""

import errno
import importlib
import os
import sys
import time
import traceback
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final, cast

import click
from click.shell_completion import CompletionItem, shell_complete

from fedora_qa import __version__
from fedora_qa.cli.exit_codes import FINDINGS, INCOMPLETE, INTERRUPTED, MISUSE, OUTPUT_CLOSED
from fedora_qa.cli.startup import START_TIME, loading_modules, preload_workers
from fedora_qa.errors import FedoraError, MisuseError, UnreadableFileError
from fedora_qa.record.wording import unobeyed

COMMANDS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "check": ("fedora_qa.cli.check:check", "Check files and report what is wrong, where, by how much and why."),
        "power": ("fedora_qa.cli.power:power", "Measure which faults of a corpus the checks detect."),
        "gate": ("fedora_qa.cli.gate:gate", "Check a release of sequences against a policy, for CI."),
        "verify": ("fedora_qa.cli.verify:verify", "Verify that a release is still the one that was certified."),
        "stats": ("fedora_qa.cli.stats:stats", "Print the sequence and flow tables of files."),
        "compare": ("fedora_qa.cli.compare:compare", "Compare sequences, datasets or two versions of a release."),
        "extract": ("fedora_qa.cli.extract:extract", "Cut out the smallest file that shows a finding."),
        "repair": ("fedora_qa.cli.repair:repair", "Write a copy in which confirmed faults are undone."),
        "import": ("fedora_qa.cli.import_:import_", "Write a canonical file from a recording of an event camera."),
        "export": ("fedora_qa.cli.export:export", "Write a sequence in a layout of others: a trajectory, a folder."),
        "report": ("fedora_qa.cli.report:report", "Render a record again, without the data."),
        "checks": ("fedora_qa.cli.explain:checks", "List the checks, each with its question."),
        "explain": ("fedora_qa.cli.explain:explain", "Explain what a check measures, how, and what it cannot detect."),
        "layout": ("fedora_qa.cli.layout:layout", "Describe what a file holds, where, and what was inferred."),
        "schema": ("fedora_qa.cli.schema:schema", "Print the JSON schema of a document or configuration."),
        "doctor": ("fedora_qa.cli.doctor:doctor", "Test whether this machine can run the checks."),
    }
)
"""Where each command is, and what it does, in the order in which help shows them."""

PROGRAM: Final = "fedora-qa"
COMPLETION_VARIABLE: Final = "_FEDORA_QA_COMPLETE"
"""Set by a shell that requests completions, and by a person who requests the script of completion."""

_FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})
"""Errors of a disk that cannot be written to: full, over quota, file too large, read-only."""

TRACEBACK_VARIABLE: Final = "FEDORA_QA_TRACEBACK"


class LazyGroup(click.Group):
    """A group that imports a command only when it runs or shows its own help."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if cmd_name not in COMMANDS:
            return None
        ctx.meta.setdefault(START_TIME, time.monotonic())  # a budget of time includes the import
        module, name = COMMANDS[cmd_name][0].split(":")
        with loading_modules():
            return cast(click.Command, getattr(importlib.import_module(module), name))

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands and options that begin so, without importing any command."""
        commands = [CompletionItem(name, help=meaning) for name, (_, meaning) in COMMANDS.items()]
        options = click.Command.shell_complete(self, ctx, incomplete)
        return [*(item for item in commands if item.value.startswith(incomplete)), *options]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what each command does, without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, meaning) for name, (_, meaning) in COMMANDS.items()])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name=PROGRAM)
def fedora_qa() -> None:
    """Recompute what must hold between the streams of an event-camera sequence, and report what does not.

    Exit codes: 0 clean; 1 findings; 2 misuse; 3 incomplete (a check crashed, required coverage was not reached, or
    nothing could be checked across streams).
    """


def main() -> None:
    """Run the command line, or print completions for a shell, and exit with the exit code."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # A path may hold characters that the encoding of the terminal lacks; printing must not raise.
            stream.reconfigure(errors="replace")
    instruction = os.environ.get(COMPLETION_VARIABLE)
    if instruction:
        sys.exit(shell_complete(fedora_qa, {}, PROGRAM, COMPLETION_VARIABLE, instruction))
    arguments = sys.argv[1:]
    preload_workers(arguments)
    sys.exit(run(arguments))


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code. No error prints a traceback unless it is requested."""
    try:
        return _invoke(list(arguments))
    except click.exceptions.Exit as request:  # --help and --version end here
        return request.exit_code
    except (click.ClickException, FedoraError) as error:
        # The message states the error; its type determines the exit code.
        if isinstance(error, click.ClickException):
            error.show()
        else:
            click.echo(f"fedora-qa: {unobeyed(str(error))}", err=True)
        if isinstance(error, click.ClickException | MisuseError):
            return MISUSE
        # An unreadable file is a finding about the file; any other error leaves open whether there are findings.
        return FINDINGS if isinstance(error, UnreadableFileError) else INCOMPLETE
    except (click.Abort, KeyboardInterrupt):
        click.echo("fedora-qa: interrupted", err=True)
        return INTERRUPTED
    except BrokenPipeError:
        # At exit Python flushes stdout, and would report the closed pipe once more.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OUTPUT_CLOSED
    except Exception as error:  # noqa: BLE001 - the user gets one sentence for any error
        if isinstance(error, OSError) and error.errno in _FULL:
            # A disk cannot be written to. No partial output is left: a file gets its name when it is complete.
            place = f" {unobeyed(str(error.filename))}" if error.filename else ""
            click.echo(f"fedora-qa: Expected to be able to write{place}, got: {error.strerror}", err=True)
            return MISUSE
        if os.environ.get(TRACEBACK_VARIABLE):
            traceback.print_exc()
        first_line = (str(error).splitlines() or ["no message"])[0]
        click.echo(
            f"fedora-qa: internal error, {type(error).__name__}: {unobeyed(first_line)} "
            f"(set {TRACEBACK_VARIABLE}=1 and run again for the traceback)",
            err=True,
        )
        return INCOMPLETE


def _invoke(arguments: list[str]) -> int:
    """Run a command without click's own ending, which gives a closed pipe the code that means findings."""
    with fedora_qa.make_context(PROGRAM, arguments) as context:
        code: int = fedora_qa.invoke(context)
    # Within `run`, where a closed pipe is handled; at exit Python itself would report it.
    sys.stdout.flush()
    return code


if __name__ == "__main__":
    main()

"""``fedora-generate``: sequences whose truth is known.

Commands are imported when they are used, so that ``--help`` does not load what renders.
"""

import signal
import sys
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import click

from fedora_generator.errors import GeneratorError
from fedora_qa.cli.startup import LazyGroup

MISUSE_EXIT_CODE = 2
INTERRUPT_EXIT_CODE = 130

COMMANDS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "scenes": ("commands:scenes", "List the scenes of the package."),
        "sequence": ("commands:sequence", "Generate one sequence of a scene."),
        "fault": ("commands:fault", "Plant a fault in a copy of a file."),
        "corpus": (
            "commands:corpus",
            "Make clean sequences of several scenes, and copies of them with every fault.",
        ),
    }
)
"""Where each command is in ``fedora_generator``, and what it does, in the order in which help shows them."""


@click.group(
    cls=LazyGroup,
    package="fedora_generator",
    table=COMMANDS,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="fedora-qa")
def commands() -> None:
    """Generate event-camera sequences whose truth is known, and plant faults in copies of them."""


def main() -> None:
    """Entry point: an error that people can act on is one line on stderr and exit code 2."""
    for number in (signal.SIGTERM, signal.SIGHUP):  # so that temporary files are removed
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup has it
            signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        commands.main(prog_name="fedora-generate", standalone_mode=False)
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "fedora-generate"
        message = error.format_message()
        _fail(f"{message}{'' if message.endswith(('.', '?')) else '.'} Try `{command} -h`")
    except click.ClickException as error:
        _fail(error.format_message())
    except GeneratorError as error:
        _fail(str(error))
    except MemoryError as error:
        _fail(f"Expected enough memory, got none left ({error or 'out of memory'}); use a smaller --size")
    except (click.Abort, KeyboardInterrupt):
        click.echo("Interrupted; no file was left that is not whole", err=True)
        sys.exit(INTERRUPT_EXIT_CODE)


def _fail(message: str) -> None:
    line = f"Error: {message}"
    if sys.stderr.isatty():
        from rich.console import Console  # noqa: PLC0415 - other commands need none of it

        # Lines end between words, at the width of the terminal.
        Console(stderr=True, markup=False, highlight=False, emoji=False).print(line)
    else:
        click.echo(line, err=True)
    sys.exit(MISUSE_EXIT_CODE)

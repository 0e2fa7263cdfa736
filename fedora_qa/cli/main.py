"""The command ``fedora-qa``.

Commands are imported when they are used, so that ``--help`` does not load numerical libraries.
"""

import errno
import os
import sys
import time
import traceback
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

import click
from click.shell_completion import shell_complete

from fedora_qa import TEMPORARY_CACHE, __version__
from fedora_qa.cli.exit_codes import FINDINGS, INCOMPLETE, INTERRUPTED, MISUSE, OUTPUT_CLOSED
from fedora_qa.cli.startup import START_TIME, LazyGroup, preload_workers
from fedora_qa.compiled_cache import CACHE_VARIABLE
from fedora_qa.errors import FedoraError, MisuseError, UnreadableFileError
from fedora_qa.record.wording import unobeyed

COMMANDS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "check": ("commands:check", "Check files and report what is wrong, where, by how much and why."),
        "power": ("commands:power", "Measure which faults of a corpus the checks detect."),
        "gate": ("commands:gate", "Check a release of sequences against a policy, for CI."),
        "verify": ("commands:verify", "Verify that a release is still the one that was certified."),
        "stats": ("commands:stats", "Print the sequence and flow tables of files."),
        "compare": ("commands:compare", "Compare sequences, datasets or two versions of a release."),
        "score": ("commands:score", "Score predictions of flow, depth or pose against a sequence."),
        "extract": ("commands:extract", "Cut out the smallest file that shows a finding."),
        "repair": ("commands:repair", "Write a copy in which confirmed faults are undone."),
        "import": ("commands:import_", "Write a canonical file from a recording of an event camera."),
        "export": ("commands:export", "Write a sequence in a layout of others: a trajectory, a folder."),
        "report": ("commands:report", "Render a record again, without the data."),
        "checks": ("explain:checks", "List the checks, each with its question."),
        "explain": ("explain:explain", "Explain a check and what it cannot detect, or a cause."),
        "layout": ("commands:layout", "Describe what a file holds, where, and what was inferred."),
        "schema": ("schema:schema", "Print the JSON schema of a document or configuration."),
        "doctor": ("doctor:doctor", "Test whether this machine can run the checks."),
    }
)
"""Where each command is in ``fedora_qa.cli``, and what it does, in the order in which help shows them."""

_ELSEWHERE: Final[Mapping[str, str]] = MappingProxyType(
    {name: f"`fedora-generate {name}`" for name in ("fault", "corpus", "scenes", "sequence")}
)
"""Commands of the generator, which people look for here."""

PROGRAM: Final = "fedora-qa"
COMPLETION_VARIABLE: Final = "_FEDORA_QA_COMPLETE"
"""Set by a shell that requests completions, and by a person who requests the script of completion."""

_FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})
"""Errors of a disk that cannot be written to: full, over quota, file too large, read-only."""

TRACEBACK_VARIABLE: Final = "FEDORA_QA_TRACEBACK"


@click.group(
    cls=LazyGroup,
    package="fedora_qa.cli",
    table=COMMANDS,
    elsewhere=_ELSEWHERE,
    context_settings={"help_option_names": ["-h", "--help"]},
)
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
    if TEMPORARY_CACHE and arguments and arguments[0] in COMMANDS:
        click.echo(
            "fedora-qa: compiled loops cannot be kept on this machine, so that each run compiles them anew; set "
            f"{CACHE_VARIABLE} to a folder of your own",
            err=True,
        )
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
            _print_error(str(error))
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


def _print_error(message: str) -> None:
    """Print an error on stderr: in a terminal its lines end between words, elsewhere it is one line."""
    line = f"{PROGRAM}: {unobeyed(message)}"
    if not sys.stderr.isatty():
        click.echo(line, err=True)
        return
    from fedora_qa.cli.console import stderr_console, text  # noqa: PLC0415 - other commands need none of it

    stderr_console().print(text(line))


def _invoke(arguments: list[str]) -> int:
    """Run a command without click's own ending, which gives a closed pipe the code that means findings."""
    with fedora_qa.make_context(PROGRAM, arguments) as context:
        context.meta[START_TIME] = time.monotonic()  # a budget of time includes the import of the command
        code: int = fedora_qa.invoke(context)
    # Within `run`, where a closed pipe is handled; at exit Python itself would report it.
    sys.stdout.flush()
    return code


if __name__ == "__main__":
    main()

"""Options that several commands share, each with the same help; the types of arguments and their completion.

A type raises ``MisuseError`` for illegal text. A shell waits for completion at every key, so that this file loads no
numerical library.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import click
from click.shell_completion import CompletionItem

from fedora_qa.causes import CAUSES
from fedora_qa.check_names import check_names
from fedora_qa.cli.documents import document_paths
from fedora_qa.errors import MisuseError
from fedora_qa.storage.place import Place, place_of

if TYPE_CHECKING:  # loads NumPy, which the help of a command need not
    from fedora_qa.importing.recording import Resolution


_SECONDS_PER_UNIT: Final[Mapping[str, float]] = {"s": 1.0, "m": 60.0, "h": 3600.0}

_LARGEST_SIDE: Final = 1 << 14
"""px."""


class PlaceParam(click.ParamType):  # type: ignore[type-arg]  # generic only from click 8.4 on
    """Turns an argument into a place; raises ``MisuseError`` for a URL that cannot be read."""

    name = "place"

    def convert(self, value: str | Place, param: click.Parameter | None, ctx: click.Context | None) -> Place:
        """Return the place that the argument names."""
        return place_of(value) if isinstance(value, str) else value

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Leave it to the shell to complete paths."""
        return [CompletionItem(incomplete, type="file")]


@dataclass(frozen=True, slots=True)
class Budget:
    """An amount of time, as it was given and in seconds."""

    text: str
    seconds: float


class BudgetParam(click.ParamType):  # type: ignore[type-arg]  # generic only from click 8.4 on
    """Turns an amount such as ``60s`` into a budget; raises ``MisuseError``."""

    name = "time"

    def convert(self, value: str | Budget, param: click.Parameter | None, ctx: click.Context | None) -> Budget:
        """Return the budget that the argument states."""
        return parse_budget(value) if isinstance(value, str) else value


class ResolutionParam(click.ParamType):  # type: ignore[type-arg]  # generic only from click 8.4 on
    """Turns ``640x480`` into a width and a height."""

    name = "resolution"

    def convert(
        self, value: "str | Resolution", param: click.Parameter | None, ctx: click.Context | None
    ) -> "Resolution":
        """Return width and height, px; raises ``MisuseError``."""
        if not isinstance(value, str):
            return value
        sides = re.fullmatch(r"([0-9]{1,6})x([0-9]{1,6})", value.strip())
        size = (int(sides[1]), int(sides[2])) if sides else (0, 0)
        if not all(0 < side <= _LARGEST_SIDE for side in size):
            raise MisuseError(f"Expected --resolution WxH of 1 to {_LARGEST_SIDE} px each way, got {value!r}")
        return size


def parse_budget(text: str) -> Budget:
    """Return an amount of time such as ``60s``, ``5m`` or ``0.5h``; raises ``MisuseError``."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([smh])\s*", text.lower())
    seconds = float(match[1]) * _SECONDS_PER_UNIT[match[2]] if match else 0.0
    # 0s is refused like text that does not match: no window fits into it.
    if seconds <= 0:
        raise MisuseError(f"Expected a time with a unit, such as 60s, 5m or 0.5h, got {text!r}")
    return Budget(text.strip(), seconds)


def _complete_check(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects and checks that begin with ``incomplete``."""
    return [name for name in check_names() if name.startswith(incomplete)]


def complete_explained(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects, checks and causes that begin with ``incomplete``."""
    causes = [cause for cause in CAUSES if cause.startswith(incomplete)]
    return [*_complete_check(context, parameter, incomplete), *causes]


def _complete_file(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Leave it to the shell to complete a path."""
    return [CompletionItem(incomplete, type="file")]


def complete_dialect(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the dialects of the package that begin with ``incomplete``, and leave files to the shell."""
    # By the names of their files: the module of dialects loads numerical libraries.
    files = (resources.files("fedora_qa") / "layout" / "dialects").iterdir()
    names = sorted(file.name.removesuffix(".toml") for file in files if file.name.endswith(".toml"))
    items = [CompletionItem(name) for name in names if name.startswith(incomplete)]
    return [*items, *_complete_file(context, parameter, incomplete)]


PATH: Final = click.Path(path_type=Path)


select_option: Final = click.option(
    "--select",
    multiple=True,
    metavar="SUBJECT[.PROPERTY]",
    shell_complete=_complete_check,
    help="Run only these checks. May be repeated.",
)

ignore_option: Final = click.option(
    "--ignore",
    multiple=True,
    metavar="SUBJECT[.PROPERTY]",
    shell_complete=_complete_check,
    help="Leave these checks out. May be repeated.",
)

config_option: Final = click.option(
    "--config", type=PATH, help="Read options from a fedora-qa.toml; the command line overrides it."
)

dialect_option: Final = click.option(
    "--dialect",
    metavar="NAME|FILE.toml",
    shell_complete=complete_dialect,
    help="How the files name and scale their data; recognised from each file where absent.",
)

metadata_option: Final = click.option(
    "--metadata",
    metavar="FILE.toml",
    shell_complete=_complete_file,
    help="Declarations that the files lack, in a table [metadata]: cameras, thresholds, noise. They take precedence.",
)

memory_option: Final = click.option(
    "--memory", metavar="AMOUNT", default="1GB", show_default=True, help="Memory to aim at."
)

allow_external_option: Final = click.option(
    "--allow-external",
    multiple=True,
    metavar="DIR",
    help="Read other files that a file links to or is made of, if they lie in DIR; none otherwise. May be repeated.",
)

_OUTPUT_OPTIONS: Final = (
    click.option("--html", type=PATH, metavar="OUT", help="Write a report with pictures, in one HTML file."),
    click.option("--markdown", type=PATH, metavar="OUT", help="Write a summary for a pull request."),
    click.option("--junit", type=PATH, metavar="OUT", help="Write JUnit XML, for the test pages of CI systems."),
    click.option("--sarif", type=PATH, metavar="OUT", help="Write SARIF 2.1.0, for code scanning."),
    click.option("--badge", type=PATH, metavar="OUT", help="Write the verdict as JSON for a badge of shields.io."),
    click.option("--csv", type=PATH, metavar="DIR", help="Write tables as CSV files into a folder."),
    click.option("--parquet", type=PATH, metavar="DIR", help="Write the same tables as Parquet files into a folder."),
    click.option("--github", is_flag=True, help="Print annotations for GitHub Actions after the summary."),
)

Decorator = Callable[[Callable[..., int]], Callable[..., int]]
"""Adds options to a command."""

_json_option = click.option(
    "--json", type=PATH, metavar="OUT", help="Write the record, and its evidence to OUT.arrays.npz; - is stdout."
)

_TABLE_OPTIONS: Final = {
    "json": click.option("--json", type=PATH, metavar="OUT", help="Write every number; - is stdout."),
    "html": click.option("--html", type=PATH, metavar="OUT", help="Write tables and plots, in one HTML file."),
    "markdown": click.option("--markdown", type=PATH, metavar="OUT", help="Write the tables."),
    "latex": click.option("--latex", type=PATH, metavar="OUT", help="Write the tables for a paper."),
}


def _format_option(*formats: str) -> Decorator:
    return click.option(
        "--format",
        "form",
        type=click.Choice(formats),
        help="Print this alone on stdout, and what people read on stderr.",
    )


def _with_options(command: Callable[..., int], options: Sequence[Decorator]) -> Callable[..., int]:
    """Add options to a command, in the order of its help."""
    # click lists options in the order of decorators from top to bottom, and the last one applied is the top one.
    for option in reversed(options):
        command = option(command)
    return command


def detail_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add the options that set how detailed the summary in the terminal is; the command gets them as ``detail``."""

    @click.option("--quiet", "-q", is_flag=True, help="Print one line a file: verdict and first cause.")
    @click.option("--verbose", "-v", is_flag=True, help="Print every check with its numbers.")
    @wraps(command)
    def with_detail(*, quiet: bool, verbose: bool, **others: Any) -> int:
        if quiet and verbose:
            raise MisuseError("Expected either --quiet or --verbose, got both")
        return command(detail="quiet" if quiet else "verbose" if verbose else "normal", **others)

    return with_detail


def output_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add the options that render a record; the command gets them as ``outputs``."""

    @wraps(command)
    def with_outputs(
        *,
        html: Path | None,
        markdown: Path | None,
        junit: Path | None,
        sarif: Path | None,
        badge: Path | None,
        csv: Path | None,
        parquet: Path | None,
        github: bool,
        form: str | None,
        json: Path | None = None,
        **others: Any,
    ) -> int:
        from fedora_qa.cli.outputs import Outputs  # noqa: PLC0415 - loads NumPy, which no help needs

        documents = {"json": json, "html": html, "markdown": markdown, "junit": junit, "sarif": sarif, "badge": badge}
        paths = document_paths(form, documents)
        # Annotations are no file of their own: on stdout alone, they take the place of the summary.
        alone = paths.pop("github", None) is not None
        outputs = Outputs(**paths, csv=csv, parquet=parquet, github=github or alone, summary=not alone)
        return command(outputs=outputs, **others)

    return _with_options(
        with_outputs, (*_OUTPUT_OPTIONS, _format_option("json", "markdown", "junit", "sarif", "github"))
    )


def record_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add ``--json`` and the options that render a record; the command gets them as ``outputs``."""
    return _json_option(output_options(command))


def table_options(*documents: Literal["json", "html", "markdown", "latex"], has_format: bool = True) -> Decorator:
    """Return what adds the options that write tables; the command gets them as ``outputs``.

    Parameters
    ----------
    documents
        What the command can write, in the order of its help.
    has_format
        Whether to add ``--format``, which prints a document; without it, ``-`` is the path of stdout all the same.
    """

    def decorator(command: Callable[..., int]) -> Callable[..., int]:
        @wraps(command)
        def with_outputs(**others: Any) -> int:
            from fedora_qa.cli.outputs import Outputs  # noqa: PLC0415 - loads NumPy, which no help needs

            form = others.pop("form") if has_format else None
            paths = document_paths(form, {name: others.pop(name) for name in documents})
            return command(outputs=Outputs(**paths), **others)

        options: list[Decorator] = [_TABLE_OPTIONS[name] for name in documents]
        if has_format:
            options.append(_format_option(*(name for name in documents if name != "html")))
        return _with_options(with_outputs, options)

    return decorator

"""Options that several commands share, each with the same help everywhere."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, Final

import click

from fedora_qa.cli.completion import complete_check
from fedora_qa.errors import MisuseError

PATH: Final = click.Path(path_type=Path)


select_option: Final = click.option(
    "--select",
    multiple=True,
    metavar="SUBJECT[.PROPERTY]",
    shell_complete=complete_check,
    help="Run only these checks. May be repeated.",
)

ignore_option: Final = click.option(
    "--ignore",
    multiple=True,
    metavar="SUBJECT[.PROPERTY]",
    shell_complete=complete_check,
    help="Leave these checks out. May be repeated.",
)

config_option: Final = click.option(
    "--config", type=PATH, help="Read options from a fedora-qa.toml; the command line overrides it."
)

dialect_option: Final = click.option(
    "--dialect",
    metavar="NAME|FILE.toml",
    help="How the files name and scale their data; recognised from each file where absent.",
)

metadata_option: Final = click.option(
    "--metadata",
    metavar="FILE.toml",
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

_OPTIONS: Final = (
    click.option("--html", type=PATH, metavar="OUT", help="Write a report with pictures, in one HTML file."),
    click.option("--markdown", type=PATH, metavar="OUT", help="Write a summary for a pull request."),
    click.option("--junit", type=PATH, metavar="OUT", help="Write JUnit XML, for the test pages of CI systems."),
    click.option("--sarif", type=PATH, metavar="OUT", help="Write SARIF 2.1.0, for code scanning."),
    click.option("--badge", type=PATH, metavar="OUT", help="Write the verdict as JSON for a badge of shields.io."),
    click.option("--csv", type=PATH, metavar="DIR", help="Write tables as CSV files into a folder."),
    click.option("--parquet", type=PATH, metavar="DIR", help="Write the same tables as Parquet files into a folder."),
    click.option("--github", is_flag=True, help="Print annotations for GitHub Actions after the summary."),
)

_json_option = click.option(
    "--json", type=PATH, metavar="OUT", help="Write the record, and its evidence to OUT.arrays.npz."
)


def detail_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add how much the summary in the terminal says; the command gets it as ``detail``."""

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
        json: Path | None = None,
        **others: Any,
    ) -> int:
        from fedora_qa.cli.outputs import Outputs  # noqa: PLC0415 - loads NumPy, which no help needs

        outputs = Outputs(
            json=json, markdown=markdown, html=html, junit=junit, sarif=sarif, badge=badge, csv=csv, parquet=parquet,
            github=github,
        )  # fmt: skip
        return command(outputs=outputs, **others)

    # click lists options in the order of decorators from top to bottom, and the last one applied is the top one.
    for option in reversed(_OPTIONS):
        with_outputs = option(with_outputs)
    return with_outputs


def record_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add ``--json`` and the options that render a record; the command gets them as ``outputs``."""
    return _json_option(output_options(command))

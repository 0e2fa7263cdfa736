"""The options that write a record, the same for every command that has one."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, Final

import click

from fedora_qa.cli.outputs import Outputs

PATH: Final = click.Path(path_type=Path)

allow_external_option: Final = click.option(
    "--allow-external",
    multiple=True,
    metavar="DIR",
    help="Read other files that a file links to or is made of, if they lie in DIR. May be repeated; else none is.",
)

_OPTIONS: Final = (
    click.option("--html", type=PATH, metavar="OUT", help="Write a report with pictures, in one HTML file."),
    click.option("--markdown", type=PATH, metavar="OUT", help="Write a summary for a pull request."),
    click.option("--junit", type=PATH, metavar="OUT", help="Write JUnit XML, for the test pages of CI systems."),
    click.option("--sarif", type=PATH, metavar="OUT", help="Write SARIF 2.1.0, for code scanning."),
    click.option("--csv", type=PATH, metavar="DIR", help="Write tables as CSV files into a folder."),
    click.option("--parquet", type=PATH, metavar="DIR", help="Write the same tables as Parquet files into a folder."),
    click.option("--github", is_flag=True, help="Print annotations for GitHub Actions after the summary."),
)

_json_option = click.option(
    "--json", type=PATH, metavar="OUT", help="Write the record, and its evidence to OUT.arrays.npz."
)


def output_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add the options that render a record; the command gets them as ``outputs``."""

    @wraps(command)
    def with_outputs(
        *,
        html: Path | None,
        markdown: Path | None,
        junit: Path | None,
        sarif: Path | None,
        csv: Path | None,
        parquet: Path | None,
        github: bool,
        json: Path | None = None,
        **others: Any,
    ) -> int:
        outputs = Outputs(
            json=json, markdown=markdown, html=html, junit=junit, sarif=sarif, csv=csv, parquet=parquet, github=github
        )  # fmt: skip
        return command(outputs=outputs, **others)

    # click lists options in the order of decorators from top to bottom, and the last one applied is the top one.
    for option in reversed(_OPTIONS):
        with_outputs = option(with_outputs)
    return with_outputs


def record_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add ``--json`` and the options that render a record; the command gets them as ``outputs``."""
    return _json_option(output_options(command))

"""``fedora-qa power``: which faults the checks detect, measured over a corpus with a manifest."""

from typing import Any

import click

from fedora_qa.cli.options import PATH, config_option, ignore_option, select_option, table_options
from fedora_qa.cli.startup import loading_modules


@click.command()
@click.argument("corpora", nargs=-1, required=True, type=PATH, metavar="CORPUS...")
@click.option("--effort", type=click.Choice(["quick", "standard", "full", "exhaustive"]), help="How much to look at.")
@select_option
@ignore_option
@config_option
@click.option("--jobs", type=click.IntRange(min=1), help="Files checked at once.  [default: as many as cores]")
@click.option(
    "--state", type=PATH, metavar="DIR", help="Where to keep results of files.  [default: beside each CORPUS]"
)
@table_options("json", "html", "markdown")
@click.option("--svg", "svg_path", type=PATH, metavar="OUT", help="Draw the curves, for documents.")
@click.option("--publish", type=PATH, metavar="OUT", help="Write the detection power of each check, for the package.")
@click.option(
    "--publish-confidence", type=PATH, metavar="OUT", help="Write how often diagnoses are right, for the package."
)
def power(**arguments: Any) -> int:
    """Check every file of each CORPUS, whose manifest.json lists the planted faults, and tabulate what was found.

    Run again after an interrupt, it continues. Exit codes: 0 measured; 2 misuse; 3 a check crashed.
    """
    with loading_modules():
        from fedora_qa.cli.power import run_power  # noqa: PLC0415 - loads what measures

    return run_power(**arguments)

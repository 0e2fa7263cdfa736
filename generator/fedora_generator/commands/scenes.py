"""``fedora-generate scenes``: the scenes of the package."""

import sys

import click
from rich.console import Console
from rich.table import Table

from fedora_generator.scene_names import scene_descriptions


@click.command()
def scenes() -> None:
    """List the scenes of the package, one a line, its name first."""
    descriptions = scene_descriptions()
    if sys.stdout.isatty():
        table = Table("scene", "description", box=None)
        for name, description in descriptions.items():
            table.add_row(name, description)
        Console().print(table)
        return
    width = max(map(len, descriptions))
    for name, description in descriptions.items():
        click.echo(f"{name:<{width}}  {description}")

"""``fedora-qa schema``: the published schemas of documents and configurations, for programs and editors."""

from collections.abc import Mapping
from importlib import resources
from types import MappingProxyType
from typing import Final

import click

SCHEMAS: Final[Mapping[str, tuple[str, str, str]]] = MappingProxyType(
    {
        "record": ("fedora_qa.record", "record.schema.json", "what `check --json` and `gate --json` write"),
        "comparison": ("fedora_qa.comparison", "comparison.schema.json", "what `compare --json` writes"),
        "score": ("fedora_qa.scoring", "score.schema.json", "what `score --json` writes"),
        "power": ("fedora_qa.record", "power.schema.json", "what `power --json` writes"),
        "certificate": ("fedora_qa.gating", "certificate.schema.json", "what `gate --certificate` writes"),
        "config": ("fedora_qa", "config.schema.json", "what a fedora-qa.toml may say"),
        "policy": ("fedora_qa.gating", "policy.schema.json", "what a policy.toml may say"),
    }
)
"""Of each document the package and file that hold its schema, and what it is."""


@click.command()
@click.argument("name", metavar="NAME", type=click.Choice(list(SCHEMAS)), required=False)
def schema(name: str | None) -> int:
    """Print the JSON schema (draft 2020-12) of NAME; without a name, list what there is. Piped, tabs stand between."""
    if name is None:
        for each, (_, _, meaning) in SCHEMAS.items():
            click.echo(f"{each}\t{meaning}")
        return 0
    package, file, _ = SCHEMAS[name]
    # The file ends with a newline of its own; the output is then the published file to the byte.
    click.echo((resources.files(package) / file).read_text("utf-8"), nl=False)
    return 0

"""A parameter that is a file, on this machine or behind a URL."""

import click
from click.shell_completion import CompletionItem

from fedora_qa.storage.place import Place, place_of


class PlaceParam(click.ParamType):  # type: ignore[type-arg]  # generic only from click 8.4 on
    """Turns an argument into a place; raises ``MisuseError`` for a URL that cannot be read."""

    name = "place"

    def convert(self, value: str | Place, param: click.Parameter | None, ctx: click.Context | None) -> Place:
        """Return the place that the text means."""
        return place_of(value) if isinstance(value, str) else value

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Leave it to the shell to complete paths."""
        return [CompletionItem(incomplete, type="file")]

"""Types of arguments (a place, an amount of time, a size of images), and the completion of arguments in shells.

Each type raises ``MisuseError`` for other text. A shell waits for completion at every key, so that this file loads no
numerical library.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Final

import click
from click.shell_completion import CompletionItem

from fedora_qa.causes import CAUSES
from fedora_qa.check_names import check_names
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


def complete_check(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects and checks that begin with ``incomplete``."""
    return [name for name in check_names() if name.startswith(incomplete)]


def complete_explained(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the subjects, checks and causes that begin with ``incomplete``."""
    causes = [cause for cause in CAUSES if cause.startswith(incomplete)]
    return [*complete_check(context, parameter, incomplete), *causes]


def complete_file(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Leave it to the shell to complete a path."""
    return [CompletionItem(incomplete, type="file")]


def complete_dialect(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the dialects of the package that begin with ``incomplete``, and leave files to the shell."""
    # By the names of their files: the module of dialects loads numerical libraries.
    files = (resources.files("fedora_qa") / "layout" / "dialects").iterdir()
    names = sorted(file.name.removesuffix(".toml") for file in files if file.name.endswith(".toml"))
    items = [CompletionItem(name) for name in names if name.startswith(incomplete)]
    return [*items, *complete_file(context, parameter, incomplete)]

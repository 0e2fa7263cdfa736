"""What the functions share: options as Python gives them, where None is not given; results as their own types."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from fedora_qa.config import CheckConfig, read_config, with_options
from fedora_qa.errors import MisuseError, did_you_mean

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

AnyPath = str | PathLike[str]

Kind = TypeVar("Kind")


def settings_of(config: AnyPath | None, options: Mapping[str, object]) -> CheckConfig:
    """Return the configuration of a file, if there is one, with the options that are given in its place.

    Parameters
    ----------
    options
        By the key of ``fedora-qa.toml``; None is not given.

    Raises
    ------
    MisuseError
        There is no such configuration, or an option has an illegal value.
    """
    given = {key: value for key, value in options.items() if value is not None}
    return with_options(read_config(Path(config)) if config else CheckConfig(), given)


def require_choice(option: str, value: str | None, choices: Sequence[str]) -> None:
    """Raise ``MisuseError`` where a value is none of the choices; None is not given."""
    if value is not None and value not in choices:
        hint = did_you_mean(value, choices)
        raise MisuseError(f"Expected {option} to be one of {', '.join(map(repr, choices))}, got {value!r}{hint}")


def path_text(path: AnyPath | None) -> str | None:
    """Return a path as text."""
    return None if path is None else fspath(path)


def folder_texts(folders: Sequence[AnyPath] | None) -> tuple[str, ...] | None:
    """Return folders as text; raises ``MisuseError`` where a single one is given in place of several."""
    if isinstance(folders, str | PathLike):
        raise MisuseError(f"Expected folders in a list, got {folders!r}; pass [{fspath(folders)!r}]")
    return None if folders is None else tuple(fspath(folder) for folder in folders)


def copied_as(kind: type[Kind], value: "DataclassInstance", **others: Any) -> Kind:
    """Return the fields of a value, and others, as a subclass of its type."""
    return kind(**{field.name: getattr(value, field.name) for field in fields(value)}, **others)

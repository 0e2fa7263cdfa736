"""Values in documents: calibrations and the like in YAML, TOML or JSON."""

import json
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import yaml

from fedora_qa.sources.source import SourceError

LARGEST_BYTES: Final = 1 << 20
"""Largest document: a calibration has some kilobytes."""


def document_value(path: Path, keys: str) -> Any:
    """Return the value at a path of keys, joined by slashes; None where there is none.

    Raises
    ------
    SourceError
        The document is too large, or not of the format that its name states.
    OSError
        It cannot be read.
    """
    value = _document(path, path.stat().st_mtime_ns)
    for key in filter(None, keys.split("/")):
        if isinstance(value, list) and key.isdigit() and int(key) < len(value):
            value = value[int(key)]
        elif isinstance(value, dict) and key in value:
            value = value[key]
        else:
            return None
    return value


@lru_cache(maxsize=4)
def _document(path: Path, changed_ns: int) -> Any:
    size = path.stat().st_size
    if size > LARGEST_BYTES:
        raise SourceError("too_large", "unknown", f"Expected {path.name} in {LARGEST_BYTES} bytes at most, got {size}")
    try:
        text = path.read_text("utf-8")
        if path.suffix.lower() == ".toml":
            return tomllib.loads(text)
        # The safe loader makes numbers, text, lists and tables, and runs nothing.
        return json.loads(text) if path.suffix.lower() == ".json" else yaml.load(text, Loader=_Loader)
    except (ValueError, yaml.YAMLError, RecursionError) as error:
        first = (str(error).splitlines() or [type(error).__name__])[0]
        raise SourceError("unreadable", "unknown", f"Expected a document in {path.name}, got: {first}") from None


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML publishes no types
    """Refuses aliases: a few lines of them stand for any number of values."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Return the next node; raises ``YAMLError`` for an alias."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("an alias, which is not read")
        return super().compose_node(parent, index)

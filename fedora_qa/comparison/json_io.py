"""A comparison as JSON, and its published schema.

``python -m fedora_qa.comparison.json_io`` writes ``comparison.schema.json`` anew beside this file.
"""

import json
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from fedora_qa.comparison.types import COMPARISON_VERSION, Comparison
from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import write_text

COMPARISON_ADAPTER: Final[TypeAdapter[Comparison]] = TypeAdapter(Comparison)
"""Turns a comparison into plain values and back, checking every type."""

SCHEMA_PATH: Final = Path(__file__).with_name("comparison.schema.json")


def comparison_to_json(comparison: Comparison) -> str:
    """Return a comparison as a JSON document; what UTF-8 cannot carry (an undecodable byte in a path) as an escape."""
    values = COMPARISON_ADAPTER.dump_python(comparison)
    text = json.dumps(values, ensure_ascii=False, allow_nan=False, indent=1) + "\n"
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def comparison_from_json(text: str | bytes) -> Comparison:
    """Return the comparison that a JSON document holds.

    Raises
    ------
    MisuseError
        The text is no JSON, is of another version, or does not fit the schema; names the offending place.
    """
    try:
        document = json.loads(text)
    except ValueError as problem:
        raise MisuseError(
            f"Expected a comparison as JSON, got: {problem}; give what `fedora-qa compare --json` wrote"
        ) from None
    version = document.get("comparison_version") if isinstance(document, dict) else None
    if version != COMPARISON_VERSION:
        raise MisuseError(
            f"Expected comparison_version {COMPARISON_VERSION!r}, got {version!r}; compare again with this version"
        )
    try:
        return COMPARISON_ADAPTER.validate_json(text)
    except ValidationError as problem:
        first = problem.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the document"
        raise MisuseError(f"Expected a valid comparison, got at {place}: {first['msg']}; compare again") from None


def comparison_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a comparison as it is written."""
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:fedora-qa:comparison:{COMPARISON_VERSION}",
    }
    return head | COMPARISON_ADAPTER.json_schema(mode="serialization")


def schema_text() -> str:
    """Return the schema as it is published."""
    return json.dumps(comparison_schema(), indent=1) + "\n"


if __name__ == "__main__":
    write_text(SCHEMA_PATH, schema_text())

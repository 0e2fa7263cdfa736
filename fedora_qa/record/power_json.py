"""A study of detection as JSON, and its published schema.

``python -m fedora_qa.record.power_json`` writes ``power.schema.json`` anew beside this file.
"""

import json
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import write_text
from fedora_qa.record.power_types import POWER_VERSION, Power

POWER_ADAPTER: Final[TypeAdapter[Power]] = TypeAdapter(Power)
"""Turns a study into plain values and back, checking every type."""

SCHEMA_PATH: Final = Path(__file__).with_name("power.schema.json")


def power_to_json(power: Power) -> str:
    """Return a study as a JSON document; what UTF-8 cannot carry (an undecodable byte in a path) as an escape."""
    text = json.dumps(POWER_ADAPTER.dump_python(power), ensure_ascii=False, allow_nan=False, indent=1) + "\n"
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def power_from_json(text: str | bytes) -> Power:
    """Return the study that a JSON document holds.

    Raises
    ------
    MisuseError
        The text is no JSON, is of another version, or does not fit the schema; names the offending place.
    """
    try:
        document = json.loads(text)
    except ValueError as problem:
        raise MisuseError(
            f"Expected a study as JSON, got: {problem}; give what `fedora-qa power --json` wrote"
        ) from None
    version = document.get("power_version") if isinstance(document, dict) else None
    if version != POWER_VERSION:
        raise MisuseError(f"Expected power_version {POWER_VERSION!r}, got {version!r}; measure again with this version")
    try:
        return POWER_ADAPTER.validate_json(text)
    except ValidationError as problem:
        first = problem.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the document"
        raise MisuseError(f"Expected a valid study, got at {place}: {first['msg']}; measure again") from None


def power_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a study as it is written."""
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:fedora-qa:power:{POWER_VERSION}",
    }
    return head | POWER_ADAPTER.json_schema(mode="serialization")


def schema_text() -> str:
    """Return the schema as it is published."""
    return json.dumps(power_schema(), indent=1) + "\n"


if __name__ == "__main__":
    write_text(SCHEMA_PATH, schema_text())

"""Published JSON schemas, made from the types that read and write."""

import json
from typing import Any, Literal

from pydantic import TypeAdapter


def schema_of(urn: str, adapter: TypeAdapter[Any], mode: Literal["validation", "serialization"]) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a type.

    Parameters
    ----------
    urn
        What the schema is called, below ``urn:fedora-qa:``: name and version.
    mode
        ``serialization``: of what is written; ``validation``: of what is read.
    """
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"urn:fedora-qa:{urn}"}
    return head | adapter.json_schema(mode=mode)


def schema_text(schema: dict[str, Any]) -> str:
    """Return a schema as it is published."""
    return json.dumps(schema, indent=1) + "\n"

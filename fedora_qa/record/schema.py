"""The published schema of the record, made from its types.

``python -m fedora_qa.record.schema`` writes ``record.schema.json`` anew beside this file.
"""

import json
from pathlib import Path
from typing import Any, Final

from fedora_qa.record.atomic import write_text
from fedora_qa.record.json_io import RECORD_ADAPTER
from fedora_qa.record.types import RECORD_VERSION

SCHEMA_PATH: Final = Path(__file__).with_name("record.schema.json")


def record_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a record as it is written."""
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:fedora-qa:record:{RECORD_VERSION}",
    }
    return head | RECORD_ADAPTER.json_schema(mode="serialization")


def schema_text() -> str:
    """Return the schema as it is published."""
    return json.dumps(record_schema(), indent=1) + "\n"


if __name__ == "__main__":
    write_text(SCHEMA_PATH, schema_text())

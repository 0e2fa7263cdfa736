"""The verdict of a record as a badge: the JSON that shields.io reads from an address (shields.io, "Endpoint Badge")."""

import json
from typing import Final

from fedora_qa.record.several_files import gravest_verdict
from fedora_qa.record.types import Record, Verdict

_COLOURS: Final[dict[Verdict, str]] = {"clean": "brightgreen", "findings": "red", "incomplete": "orange"}


def record_to_badge(record: Record) -> str:
    """Return the gravest verdict of all files as the JSON of a badge."""
    verdict = gravest_verdict(record.files)
    badge = {"schemaVersion": 1, "label": "fedora-qa", "message": verdict, "color": _COLOURS[verdict]}
    return json.dumps(badge, indent=1) + "\n"

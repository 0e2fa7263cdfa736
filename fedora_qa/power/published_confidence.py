"""The file of measured confidences, which diagnosis reads."""

import json
from pathlib import Path

from fedora_qa.record.atomic import write_text
from fedora_qa.record.power_types import Power


def write_confidence(power: Power, target: Path) -> None:
    """Write how many diagnoses of each status and cause are right, entirely or not at all; one line a row."""
    rows = [(row.status, row.cause, row.right.count, row.right.of) for row in power.statuses]
    write_text(target, "[\n" + ",\n".join(f"  {json.dumps(row)}" for row in rows) + "\n]\n")

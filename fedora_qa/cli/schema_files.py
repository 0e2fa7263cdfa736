"""The files of the published schemas, made from the types.

``python -m fedora_qa.cli.schema_files`` writes them anew.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

import fedora_qa
from fedora_qa.cli.schema import SCHEMAS
from fedora_qa.comparison.types import COMPARISON
from fedora_qa.config import CONFIG_READER
from fedora_qa.gating.certificate import CERTIFICATE
from fedora_qa.gating.policy import POLICY_READER
from fedora_qa.record.atomic import write_text
from fedora_qa.record.documents import DocumentKind, schema_of, schema_text
from fedora_qa.record.json_io import RECORD
from fedora_qa.record.power_types import POWER
from fedora_qa.scoring.types import SCORE

_DOCUMENTS: tuple[DocumentKind[Any], ...] = (RECORD, COMPARISON, SCORE, POWER, CERTIFICATE)
_READERS: Mapping[str, TypeAdapter[Any]] = {"config": CONFIG_READER, "policy": POLICY_READER}


def schemas() -> dict[str, dict[str, Any]]:
    """Return every published schema by its name."""
    # Documents as they are written: every field is there. Configurations as they are read: fields may be absent.
    written = {kind.name: kind.schema() for kind in _DOCUMENTS}
    read = {name: schema_of(name, reader, "validation") for name, reader in _READERS.items()}
    return written | read


def schema_path(name: str) -> Path:
    """Return where a schema lies in the package."""
    package, file, _ = SCHEMAS[name]
    root = Path(fedora_qa.__file__).parent
    return root.joinpath(*package.split(".")[1:], file)


if __name__ == "__main__":
    for name, schema in schemas().items():
        write_text(schema_path(name), schema_text(schema))

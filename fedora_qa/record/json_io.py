"""The record as JSON."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter

from fedora_qa.record.atomic import write_text
from fedora_qa.record.documents import DocumentKind, json_text
from fedora_qa.record.types import OLDER_RECORD_VERSIONS, RECORD_VERSION, FileRecord, Record

RECORD: Final = DocumentKind(
    name="record",
    noun="a record",
    version=RECORD_VERSION,
    older=OLDER_RECORD_VERSIONS,
    adapter=TypeAdapter(Record),
    written_by="fedora-qa check --json",
    again="check the file again with this version",
)

record_from_json = RECORD.from_json
read_record = RECORD.read

_FILE: Final = TypeAdapter(FileRecord)
_NO_FILES: Final = '"files": []'
"""The list of files in the document of a record without any. No text holds this: quotes in a text are escaped."""


def record_parts(record: Record) -> Iterator[str]:
    """Yield the document of a record in parts, one a file: as plain values, each file takes a megabyte.

    Raises
    ------
    ValidationError
        As ``DocumentKind.to_json``.
    """
    before, after = RECORD.to_json(replace(record, files=())).split(_NO_FILES)
    if not record.files:
        yield f"{before}{_NO_FILES}{after}"
        return
    yield f'{before}"files": ['
    for number, file in enumerate(record.files):
        # Lines of a file are indented by its two levels. Line feeds within texts are escaped.
        lines = json_text(file, _FILE).rstrip("\n").replace("\n", "\n  ")
        yield f"{',' if number else ''}\n  {lines}"
    yield f"\n ]{after}"


def record_to_json(record: Record) -> str:
    """Return the document of a record; raises as ``record_parts``."""
    return "".join(record_parts(record))


def write_record(record: Record, path: Path) -> None:
    """Write the document of a record entirely or not at all; raises as ``record_parts``."""
    write_text(path, record_parts(record))

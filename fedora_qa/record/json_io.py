"""The record as JSON."""

from typing import Final

from pydantic import TypeAdapter

from fedora_qa.record.documents import DocumentKind
from fedora_qa.record.types import OLDER_RECORD_VERSIONS, RECORD_VERSION, Record

RECORD: Final = DocumentKind(
    name="record",
    noun="a record",
    version=RECORD_VERSION,
    older=OLDER_RECORD_VERSIONS,
    adapter=TypeAdapter(Record),
    written_by="fedora-qa check --json",
    again="check the file again with this version",
)

record_to_json = RECORD.to_json
record_from_json = RECORD.from_json
write_record = RECORD.write
read_record = RECORD.read

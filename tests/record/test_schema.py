"""The published schema is that of the types, and records validate against it."""

import json

import jsonschema
import pytest

from fedora_qa.record.json_io import record_to_json
from fedora_qa.record.schema import SCHEMA_PATH, record_schema, schema_text
from tests.support.records import crashed, failed, file_record, late_events, not_observable, passed, record


def test_schema_is_current() -> None:
    """The file in the tree is what the types give; ``python -m fedora_qa.record.schema`` writes it anew."""
    assert SCHEMA_PATH.read_text(encoding="utf-8") == schema_text()


def test_records_validate() -> None:
    """A record with every kind of result fits the schema, checked by another library."""
    every = file_record(failed(), passed(), crashed(), not_observable(), diagnoses=(late_events(),))
    jsonschema.Draft202012Validator.check_schema(record_schema())
    jsonschema.validate(json.loads(record_to_json(record(every))), record_schema())


@pytest.mark.parametrize("field", ["record_version", "files", "run", "tool"])
def test_schema_refuses_what_lacks_a_field(field: str) -> None:
    """Fields without a default are required, so the schema can fail."""
    document = json.loads(record_to_json(record()))
    del document[field]
    with pytest.raises(jsonschema.ValidationError, match=field):
        jsonschema.validate(document, record_schema())

"""The published schemas are those of the types, and what is written and read validates against them."""

import json
import tomllib
from dataclasses import fields
from datetime import date
from typing import Any

import jsonschema
import pytest

from fedora_qa.cli.generated_files import schema_path, schemas
from fedora_qa.cli.schema import SCHEMAS
from fedora_qa.config import CONFIG_READER, CheckConfig
from fedora_qa.gating.certificate import CERTIFICATE
from fedora_qa.gating.policy import POLICY_READER, Policy
from fedora_qa.record.documents import schema_text
from fedora_qa.record.json_io import RECORD, record_to_json
from tests.support.certificates import CERTIFIED
from tests.support.documented import CONFIG_EXAMPLE, POLICY_EXAMPLE
from tests.support.records import crashed, failed, file_record, late_events, not_observable, passed, record


@pytest.mark.parametrize("name", SCHEMAS)
def test_schema_is_current(name: str) -> None:
    """The file in the tree is what the types give; ``python -m fedora_qa.cli.generated_files`` writes it anew."""
    made = schemas()[name]
    jsonschema.Draft202012Validator.check_schema(made)
    assert schema_path(name).read_text(encoding="utf-8") == schema_text(made)


def test_every_schema_is_listed() -> None:
    """What is made is what the command prints."""
    assert schemas().keys() == SCHEMAS.keys()


def test_records_validate() -> None:
    """A record with every kind of result fits the schema, checked by another library."""
    every = file_record(failed(), passed(), crashed(), not_observable(), diagnoses=(late_events(),))
    jsonschema.validate(json.loads(record_to_json(record(every))), RECORD.schema())


def test_certificates_validate() -> None:
    """A certificate with waivers fits its schema; one with a key more does not."""
    document = json.loads(CERTIFICATE.to_json(CERTIFIED))
    jsonschema.validate(document, CERTIFICATE.schema(), format_checker=jsonschema.FormatChecker())
    assert not jsonschema.Draft202012Validator(CERTIFICATE.schema()).is_valid(document | {"more": 1})


@pytest.mark.parametrize("field", ["record_version", "files", "run", "tool"])
def test_schema_refuses_what_lacks_a_field(field: str) -> None:
    """Fields without a default are required, so the schema can fail."""
    document = json.loads(record_to_json(record()))
    del document[field]
    with pytest.raises(jsonschema.ValidationError, match=field):
        jsonschema.validate(document, RECORD.schema())


READ = {
    "config": (CONFIG_READER, CheckConfig, CONFIG_EXAMPLE),
    "policy": (POLICY_READER, Policy, POLICY_EXAMPLE),
}


@pytest.mark.parametrize("name", READ)
def test_documented_configurations_fit_their_schema(name: str) -> None:
    """The example of the documentation shows every key; reader and schema accept it, and refuse a key that is not."""
    reader, declared, example = READ[name]
    schema, values = schemas()[name], tomllib.loads(example)
    assert set(schema["properties"]) == {field.name for field in fields(declared)} == set(values)
    for refused, document in ((False, values), (True, values | {"efort": 1})):
        assert fits(schema, document) is not refused
        assert is_read(reader, document) is not refused


@pytest.mark.parametrize("name", READ)
def test_every_key_says_what_it_is(name: str) -> None:
    """An editor that shows the schema has something to say of every key, nested ones too."""
    schema = schemas()[name]
    for described in (schema, *schema.get("$defs", {}).values()):
        for key, value in described.get("properties", {}).items():
            assert value.get("description"), key


def fits(schema: dict[str, Any], document: dict[str, Any]) -> bool:
    """Whether a document fits, as an editor sees it: dates of TOML as text."""
    seen = json.loads(json.dumps(document, default=date.isoformat))
    return jsonschema.Draft202012Validator(schema).is_valid(seen)


def is_read(reader: Any, document: dict[str, Any]) -> bool:
    """Whether the reader accepts a document."""
    try:
        reader.validate_python(document)
    except ValueError:
        return False
    return True

"""A study of detection survives being written and read, and fits its published schema."""

import json

import jsonschema
import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.power.tables import power_of
from fedora_qa.record.power_study import POWER as STUDY
from fedora_qa.record.power_study import Estimate, estimate_words, tables_of
from tests.support.studies import ORIGIN, study

POWER = power_of(study(), ORIGIN)


def test_studies_validate_and_come_back() -> None:
    """A study fits the schema, checked by another library, and is read as it was written."""
    jsonschema.validate(json.loads(STUDY.to_json(POWER)), STUDY.schema())
    assert STUDY.from_json(STUDY.to_json(POWER)) == POWER


@pytest.mark.parametrize(
    ("change", "said"),
    [({"power_version": "9"}, "power_version '1.0', got '9'"), ({"clean": "many"}, "at clean"), ({"x": 1}, None)],
)
def test_what_is_no_study(change: dict[str, object], said: str | None) -> None:
    """Another version and wrong values are refused by name; fields that are not known are ignored."""
    text = json.dumps(json.loads(STUDY.to_json(POWER)) | change)
    if said is None:
        assert STUDY.from_json(text) == POWER
        return
    with pytest.raises(MisuseError, match=said):
        STUDY.from_json(text)


def test_tables_say_what_was_measured() -> None:
    """The cause stands with its unit and interval; what was not found is no confusion."""
    tables = {table.title: table for table in tables_of(POWER)}
    first = tables["Detection"].rows[0]
    assert first[:2] == ("events:time_offset", "any check")
    assert first[3] == estimate_words(POWER.detections[0].curve.at_95, "ms")
    assert "Wrong names" not in tables
    assert tables["Limits that the checks state, against what they find"].rows[0][2] == "true"


@pytest.mark.parametrize(
    ("estimate", "words"),
    [
        (Estimate(2.1234, 1.5, None), "2.12 (1.5 to ?) ms"),
        (Estimate(None, 1.5, None), "beyond what was tried"),
    ],
)
def test_estimates_in_words(estimate: Estimate, words: str) -> None:
    """Three digits, the interval, the unit; what is unknown is said to be."""
    assert estimate_words(estimate, "ms") == words

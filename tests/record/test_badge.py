"""The badge has the fields that an endpoint of shields.io must have."""

import json

import pytest

from fedora_qa.record.ci import record_to_badge
from fedora_qa.record.types import FileRecord
from tests.support.documented import blocks
from tests.support.records import crashed, failed, file_record, passed, record


@pytest.mark.parametrize(
    ("files", "message", "color"),
    [
        ((file_record(passed()),), "clean", "brightgreen"),
        ((file_record(passed()), file_record(failed(), path="b.h5")), "findings", "red"),
        ((file_record(crashed()), file_record(failed(), path="b.h5")), "incomplete", "orange"),
    ],
)
def test_the_gravest_verdict_has_its_colour(files: tuple[FileRecord, ...], message: str, color: str) -> None:
    """One file that is not clean is enough; nothing but a clean record is green."""
    shown = json.loads(record_to_badge(record(*files)))
    assert shown == {"schemaVersion": 1, "label": "fedora-qa", "message": message, "color": color}


def test_the_documentation_has_the_badge_of_a_clean_record() -> None:
    """The page on CI shows what is written."""
    assert json.loads(blocks("ci.md", "json")[0]) == json.loads(record_to_badge(record(file_record(passed()))))

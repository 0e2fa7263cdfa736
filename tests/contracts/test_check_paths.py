"""The path of a check is its name."""

from pathlib import Path
from typing import Any

import pytest

from fedora_qa.checks.protocol import Check
from tests.support.all_checks import CHECKS

CHECKS_FOLDER = Path(__file__).parents[2] / "fedora_qa" / "checks"


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
def test_a_check_lies_where_its_name_says(check: Check[Any]) -> None:
    """``event_stream.gaps`` is ``checks/event_stream/gaps.py``, and its class is ``EventStreamGaps``."""
    subject, _, name = check.name.partition(".")
    assert type(check).__module__ == f"fedora_qa.checks.{subject}.{name}"
    assert type(check).__name__ == f"{subject}_{name}".replace("_", " ").title().replace(" ", "")


def test_every_subject_folder_holds_checks() -> None:
    """No folder below ``checks`` is anything but a subject of checks."""
    subjects = {check.name.partition(".")[0] for check in CHECKS}
    assert {path.name for path in CHECKS_FOLDER.iterdir() if path.is_dir() and path.name != "__pycache__"} == subjects

"""Every hand-set number of diagnosis has a reason and a user."""

import re
from pathlib import Path

import pytest

from fedora_qa.diagnosis.support import SUPPORT, support

DIAGNOSIS = Path(__file__).parents[2] / "fedora_qa" / "diagnosis"
CODE = "\n".join(path.read_text(encoding="utf-8") for path in sorted(DIAGNOSIS.rglob("*.py")))


@pytest.mark.parametrize("name", SUPPORT)
def test_a_number_is_a_support_and_has_a_reason(name: str) -> None:
    """It lies between 0 and 1, and its reason is a sentence."""
    assert 0.0 < SUPPORT[name].value <= 1.0
    assert len(SUPPORT[name].reason.split()) >= 4


@pytest.mark.parametrize("name", SUPPORT)
def test_a_number_is_used(name: str) -> None:
    """Code of diagnosis names it, whole or behind the name of its subject."""
    _, _, row = name.partition(".")
    assert re.search(rf"""["'](.*\\.)?({re.escape(name)}|{re.escape(row)})["']""", CODE)


def test_an_unknown_name_is_an_error() -> None:
    with pytest.raises(KeyError):
        support("clocks.no_such_row")

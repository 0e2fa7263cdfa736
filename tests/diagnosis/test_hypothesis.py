"""Every hand-set number of diagnosis has a reason and a user."""

import ast
import re
from pathlib import Path
from typing import Final

import pytest

from fedora_qa.diagnosis.hypothesis import SUPPORT, support

DIAGNOSIS = Path(__file__).parents[2] / "fedora_qa" / "diagnosis"


def named_rows() -> list[re.Pattern[str]]:
    """Return a pattern for each string of diagnosis' code; what a formatted string fills in may be anything."""
    patterns = []
    for path in DIAGNOSIS.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = [re.escape(part.value) if isinstance(part, ast.Constant) else r"\w+" for part in node.values]
                if any(isinstance(part, ast.Constant) and len(part.value) > 3 for part in node.values):
                    patterns.append(re.compile("".join(parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                patterns.append(re.compile(re.escape(node.value)))
    return patterns


NAMED: Final = named_rows()


@pytest.mark.parametrize("name", SUPPORT)
def test_a_number_is_a_support_and_has_a_reason(name: str) -> None:
    """It lies between 0 and 1, and its reason is a sentence."""
    assert 0.0 < SUPPORT[name].value <= 1.0
    assert len(SUPPORT[name].reason.split()) >= 4


@pytest.mark.parametrize("name", SUPPORT)
def test_a_number_is_used(name: str) -> None:
    """Code of diagnosis names it, whole or behind the name of its subject and check."""
    parts = name.split(".")
    suffixes = [".".join(parts[first:]) for first in range(len(parts))]
    assert any(pattern.fullmatch(suffix) for pattern in NAMED for suffix in suffixes)


def test_an_unknown_name_is_an_error() -> None:
    with pytest.raises(KeyError):
        support("clocks.no_such_row")

"""Checks of tests in place of those of the catalogue, in the process of the test."""

from typing import Any

import pytest

from fedora_qa.check_names import is_selected
from fedora_qa.checks.explanation import explanation
from fedora_qa.checks.protocol import Check


def replace_checks(monkeypatch: pytest.MonkeyPatch, *checks: Check[Any]) -> None:
    """Run these checks in place of the real ones, by names that options may name."""
    explanations = tuple(explanation(check) for check in checks)

    def selected(select: tuple[str, ...], ignore: tuple[str, ...]) -> tuple[Check[Any], ...]:
        return tuple(check for check in checks if is_selected(check.name, select, ignore))

    monkeypatch.setattr("fedora_qa.check_names.published_explanations", lambda: explanations)
    monkeypatch.setattr("fedora_qa.engine.tasks.select_checks", selected)

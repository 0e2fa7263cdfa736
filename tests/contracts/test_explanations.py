"""Every check explains itself, and the documentation says the same."""

from pathlib import Path
from typing import Any

import pytest

from fedora_qa.checks.explanation import PUBLISHED, SECTIONS, explanation, explanations_text, published_explanations
from fedora_qa.checks.protocol import Check
from fedora_qa.cli.generated_files import check_pages, explanations
from tests.support.all_checks import CHECKS

PAGES = Path(__file__).parents[2] / "docs" / "checks"


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
def test_every_check_says_all_there_is_to_say(check: Check[Any]) -> None:
    """A question, what is measured, and every section in its place; nothing under another heading."""
    said = explanation(check)
    assert said.question.endswith("?")
    assert said.measured
    assert not said.missing
    assert tuple(said.sections) == SECTIONS


def test_a_missing_section_is_noticed() -> None:
    """The test above can fail: a check that says less is told what is missing."""

    class Terse(type(CHECKS[0])):  # type: ignore[misc]
        """Is it so?

        What is measured.

        How
        ---
        Somehow.

        Sources
        -------
        """

    said = explanation(Terse())
    assert said.missing == ("Why it matters", "Noise model", "Cannot detect", "Sources")
    assert said.sections["How"] == "Somehow."


@pytest.mark.parametrize("name", sorted(check_pages()))
def test_the_documentation_is_the_same_text(name: str) -> None:
    """The pages are as ``make docs`` writes them."""
    assert (PAGES / name).read_text(encoding="utf-8") == check_pages()[name], "run `make docs`"


def test_no_page_is_left_over() -> None:
    """A subject that is gone takes its page with it."""
    assert {path.name for path in PAGES.iterdir()} == set(check_pages())


def test_the_package_holds_the_same_text() -> None:
    """``explain`` reads what the checks state of themselves."""
    assert PUBLISHED.read_text(encoding="utf-8") == explanations_text(explanations()), "run `make docs`"
    assert published_explanations() == explanations()

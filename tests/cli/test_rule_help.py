"""Every check has a help for code scanning."""

from fedora_qa.causes import CAUSES
from fedora_qa.checks.explanation import published_explanations
from fedora_qa.cli.outputs import rule_helps

LONGEST_DESCRIPTION = 1024
"""Characters; code scanning accepts no longer ones (GitHub, "SARIF support for code scanning")."""


def test_every_check_has_a_help() -> None:
    """It says what is checked, why it matters and what to do, in both forms, without marks of reStructuredText."""
    helps = rule_helps()
    for explained in published_explanations():
        shown = helps[explained.check]
        assert 0 < len(shown.description) <= LONGEST_DESCRIPTION
        assert "``" not in shown.text + shown.markdown + shown.description
        for title in ("What is checked", "Why it matters", "What it cannot detect", "What to do"):
            assert f"\n{title}\n" in shown.text
            assert f"\n## {title}\n\n" in shown.markdown
    assert set(helps) == {explained.check for explained in published_explanations()}


def test_the_help_has_the_remedies_of_the_causes() -> None:
    """A check that measures causes directly states the remedy of each."""
    order = rule_helps()["clocks.order"]
    for cause in ("unsorted", "duplicated_samples"):
        assert CAUSES[cause].remedy in order.text
        assert CAUSES[cause].remedy in order.markdown

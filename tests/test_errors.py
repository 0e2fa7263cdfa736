"""Errors in one line."""

import pytest

from fedora_qa.errors import first_line


@pytest.mark.parametrize(
    ("text", "line"), [("no space", "no space"), ("bad\nat 3", "bad"), ("\n bad", "bad"), ("", "OSError")]
)
def test_first_line(text: str, line: str) -> None:
    """It is the first that holds text; an error without text is named by its type."""
    assert first_line(OSError(text)) == line

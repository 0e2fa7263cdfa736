"""Markdown of the pages that the code writes."""

import re
from collections.abc import Iterable

from fedora_qa.check_names import subject_of


def markdown_of(text: str) -> str:
    """Turn a docstring's marks into Markdown's: code in single backticks, blocks of formulas indented as they are."""
    # `::` announces an indented literal block in reStructuredText. Markdown needs the indentation only.
    return re.sub(r"::$", ":", text.replace("``", "`"), flags=re.MULTILINE)


def code_list(names: Iterable[str]) -> str:
    """Return names as code, separated by commas."""
    return ", ".join(f"`{name}`" for name in names)


def check_link(check: str) -> str:
    """Return a link from a page beside the folder of the checks' pages to the section of a check."""
    return f"[`{check}`](../checks/{subject_of(check)}.md#{heading_anchor(check)})"


def heading_anchor(heading: str) -> str:
    """Return the anchor of a heading, as GitHub and the site name it."""
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.lower()).strip())

"""The pages of the documentation on the checks, made from the docstrings of the checks.

``python -m fedora_qa.cli.check_pages docs/checks`` writes one page a subject, and an index.
"""

import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from fedora_qa.checks import CHECKS
from fedora_qa.checks.explanation import explanation
from fedora_qa.checks.protocol import Check
from fedora_qa.record.atomic import write_text


def check_pages() -> Mapping[str, str]:
    """Return the text of every page, Markdown, by its file's name."""
    subjects = dict.fromkeys(_subject(check) for check in CHECKS)
    pages = {f"{subject}.md": "".join(_page(subject)) for subject in subjects}
    return {"README.md": "".join(_index(list(subjects))), **pages}


def _index(subjects: list[str]) -> Iterator[str]:
    yield "# Checks\n\nEach page holds what `fedora-qa explain` says of a subject's checks; `make docs` writes them.\n"
    for subject in subjects:
        yield f"\n## [{subject}]({subject}.md)\n\n"
        for check in _of(subject):
            yield f"- [`{check.name}`]({subject}.md#{_anchor(check.name)}): {check.question}\n"


def _page(subject: str) -> Iterator[str]:
    yield f"# {subject}\n"
    for check in _of(subject):
        said = explanation(check)
        yield f"\n## {check.name}\n\n**{said.question}**\n\nNeeds: {', '.join(check.needs) or 'no stream'}.\n"
        yield f"\n{_markdown(said.measured)}\n"
        for title, text in said.sections.items():
            yield f"\n### {title}\n\n{_markdown(text)}\n"


def _of(subject: str) -> list[Check[Any]]:
    return [check for check in CHECKS if _subject(check) == subject]


def _subject(check: Check[Any]) -> str:
    return check.name.split(".")[0]


def _anchor(name: str) -> str:
    # GitHub leaves dots out of the anchor of a heading.
    return name.replace(".", "")


def _markdown(text: str) -> str:
    """Turn a docstring's marks into Markdown's: code in single backticks, blocks of formulas indented as they are."""
    # `::` announces an indented literal block in reStructuredText. Markdown needs the indentation only.
    return re.sub(r"::$", ":", text.replace("``", "`"), flags=re.MULTILINE)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in check_pages().items():
        write_text(folder / name, text)

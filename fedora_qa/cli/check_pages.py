"""The pages of the documentation on the checks, made from the docstrings of the checks.

``python -m fedora_qa.cli.check_pages docs/checks`` writes one page a subject, and an index.
"""

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fedora_qa.catalogue import CHECKS
from fedora_qa.checks.explanation import explanation
from fedora_qa.checks.protocol import Check
from fedora_qa.cli.material_sizes import TITLE as MATERIAL_SIZES
from fedora_qa.cli.material_sizes import material_sizes_text
from fedora_qa.record.atomic import write_text


def check_pages() -> Mapping[str, str]:
    """Return the text of every page, Markdown, by its file's name."""
    checks_of: dict[str, list[Check[Any]]] = {}
    for check in CHECKS:
        checks_of.setdefault(check.name.split(".")[0], []).append(check)
    index = (
        "# Checks\n\nEach page holds what `fedora-qa explain` says of a subject's checks; `make docs` writes them.\n"
    )
    pages: dict[str, str] = {}
    for subject, checks in checks_of.items():
        index += f"\n## [{subject}]({subject}.md)\n\n"
        page = f"# {subject}\n"
        for check in checks:
            # GitHub leaves dots out of the anchor of a heading.
            anchor = check.name.replace(".", "")
            index += f"- [`{check.name}`]({subject}.md#{anchor}): {check.question}\n"
            answer = explanation(check)
            page += f"\n## {check.name}\n\n**{answer.question}**\n\nNeeds: {', '.join(check.needs) or 'no stream'}.\n"
            page += f"\n{_markdown(answer.measured)}\n"
            sizes = "\n".join(f"- {line}" for line in material_sizes_text(check.name).splitlines())
            for title, text in {**answer.sections, MATERIAL_SIZES: sizes}.items():
                page += f"\n### {title}\n\n{_markdown(text)}\n"
        pages[f"{subject}.md"] = page
    return {"README.md": index, **pages}


def _markdown(text: str) -> str:
    """Turn a docstring's marks into Markdown's: code in single backticks, blocks of formulas indented as they are."""
    # `::` announces an indented literal block in reStructuredText. Markdown needs the indentation only.
    return re.sub(r"::$", ":", text.replace("``", "`"), flags=re.MULTILINE)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in check_pages().items():
        write_text(folder / name, text)

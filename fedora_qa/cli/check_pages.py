"""The pages of the documentation on the checks, made from the docstrings of the checks.

``python -m fedora_qa.cli.check_pages docs/checks`` writes one page a subject, an index, and the explanations that the
package holds. Beside the folder it writes the pages of the causes and that of the layout.
"""

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from fedora_qa.catalogue import CHECKS
from fedora_qa.checks.explanation import PUBLISHED, Explanation, explanation, explanations_text
from fedora_qa.cli.cause_pages import cause_pages
from fedora_qa.cli.layout_page import layout_page
from fedora_qa.cli.markdown import heading_anchor, markdown_of
from fedora_qa.cli.material_sizes import TITLE as MATERIAL_SIZES
from fedora_qa.cli.material_sizes import material_sizes_text
from fedora_qa.record.atomic import write_text


def explanations() -> tuple[Explanation, ...]:
    """Return the explanation of every check, with its material sizes as the last section."""
    explained = [explanation(check) for check in CHECKS]
    return tuple(
        replace(each, sections={**each.sections, MATERIAL_SIZES: material_sizes_text(each.check)}) for each in explained
    )


def check_pages() -> Mapping[str, str]:
    """Return the text of every page, Markdown, by its file's name."""
    explanations_of: dict[str, list[Explanation]] = {}
    for each in explanations():
        explanations_of.setdefault(each.check.split(".")[0], []).append(each)
    index = (
        "# Checks\n\nEach page has the text of `fedora-qa explain` for the checks of a subject. "
        "`make docs` writes these pages.\n"
    )
    pages: dict[str, str] = {}
    for subject, explained in explanations_of.items():
        index += f"\n## [{subject}]({subject}.md)\n\n"
        page = f"# {subject}\n"
        for each in explained:
            index += f"- [`{each.check}`]({subject}.md#{heading_anchor(each.check)}): {each.question}\n"
            page += f"\n## {each.check}\n\n**{each.question}**\n\nNeeds: {', '.join(each.needs) or 'no stream'}.\n"
            page += f"\n{markdown_of(each.measured)}\n"
            sizes = "\n".join(f"- {line}" for line in each.sections[MATERIAL_SIZES].splitlines())
            for title, text in {**each.sections, MATERIAL_SIZES: sizes}.items():
                page += f"\n### {title}\n\n{markdown_of(text)}\n"
        pages[f"{subject}.md"] = page
    return {"README.md": index, **pages}


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    causes = folder.parent / "causes"
    for target in (folder, causes):
        target.mkdir(parents=True, exist_ok=True)
    for name, text in check_pages().items():
        write_text(folder / name, text)
    for name, text in cause_pages().items():
        write_text(causes / name, text)
    write_text(folder.parent / "datasets.md", layout_page())
    write_text(PUBLISHED, explanations_text(explanations()))

"""The examples that the documentation shows."""

import re
from pathlib import Path
from typing import Final

DOCS: Final = Path(__file__).parents[2] / "docs"


def blocks(page: str, language: str) -> list[str]:
    """Return the blocks of a language on a page of the documentation."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


CONFIG_EXAMPLE: Final = blocks("efforts.md", "toml")[0]
POLICY_EXAMPLE: Final = blocks("gate.md", "toml")[0]

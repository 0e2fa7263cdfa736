"""The explanation of a check: its class docstring, in fixed sections.

The first line is the question, what follows is what is measured; then come the sections of ``SECTIONS``, each under a
heading that is underlined with dashes.

The package holds the explanations of all checks in a file, so that they are read without the numerical libraries that
the checks load.
"""

import inspect
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from fedora_qa.checks.protocol import Check

PUBLISHED: Final = Path(__file__).with_name("explanations.json")
"""Of all checks in their order; ``make docs`` writes it."""

SECTIONS: Final = ("Why it matters", "How", "Noise model", "Cannot detect", "Sources")


@dataclass(frozen=True, slots=True)
class Explanation:
    """The explanation of a check.

    Attributes
    ----------
    check
        Name of the check.
    needs
        Streams without which the question cannot be answered.
    question
        First line of its docstring.
    measured
        Text before the first section.
    sections
        Text of each section by heading, in order.
    """

    check: str
    needs: tuple[str, ...]
    question: str
    measured: str
    sections: Mapping[str, str]

    @property
    def missing(self) -> tuple[str, ...]:
        """Headings of the sections that the docstring lacks."""
        return tuple(title for title in SECTIONS if not self.sections.get(title))


def explanation(check: "Check[Any]") -> Explanation:
    """Return the explanation in the check's docstring."""
    lines = inspect.cleandoc(type(check).__doc__ or "").splitlines()
    # A heading has as many dashes below it as it has characters.
    starts = [i for i, (line, below) in enumerate(pairwise(lines)) if line.strip() and below == "-" * len(line)]
    bounds = [*starts, len(lines)]
    sections = {lines[start]: _text(lines[start + 2 : stop]) for start, stop in pairwise(bounds)}
    head = lines[: bounds[0]]
    question = head[0] if head else ""
    return Explanation(check.name, check.needs, question, _text(head[1:]), sections)


@cache
def published_explanations() -> tuple[Explanation, ...]:
    """Return the explanations that the package holds, in the order of the checks."""
    rows = json.loads(PUBLISHED.read_text("utf-8"))
    return tuple(Explanation(**{**row, "needs": tuple(row["needs"])}) for row in rows)


def explanations_text(explanations: tuple[Explanation, ...]) -> str:
    """Return explanations as JSON, which ``published_explanations`` reads."""
    return json.dumps([asdict(each) for each in explanations], indent=1, ensure_ascii=False) + "\n"


def _text(lines: list[str]) -> str:
    return "\n".join(lines).strip("\n").rstrip()

"""The explanation of a check: its class docstring, in fixed sections.

The first line is the question, what follows is what is measured; then come the sections of ``SECTIONS``, each under a
heading that is underlined with dashes.
"""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from fedora_qa.checks.protocol import Check

SECTIONS: Final = ("Why it matters", "How", "Noise model", "Cannot see", "Sources")


@dataclass(frozen=True, slots=True)
class Explanation:
    """The explanation of a check.

    Attributes
    ----------
    question
        First line of its docstring.
    measured
        Text before the first section.
    sections
        Text of each section by heading, in order.
    """

    question: str
    measured: str
    sections: Mapping[str, str]

    @property
    def missing(self) -> tuple[str, ...]:
        """Headings of the sections that the docstring lacks."""
        return tuple(title for title in SECTIONS if not self.sections.get(title))


def explanation(check: Check[Any]) -> Explanation:
    """Return the explanation in the check's docstring."""
    lines = inspect.cleandoc(type(check).__doc__ or "").splitlines()
    # A heading has as many dashes below it as it has characters.
    starts = [i for i, (line, below) in enumerate(pairwise(lines)) if line.strip() and below == "-" * len(line)]
    bounds = [*starts, len(lines)]
    sections = {lines[start]: _text(lines[start + 2 : stop]) for start, stop in pairwise(bounds)}
    head = lines[: bounds[0]]
    return Explanation(head[0] if head else "", _text(head[1:]), sections)


def _text(lines: list[str]) -> str:
    return "\n".join(lines).strip("\n").rstrip()

"""Tables as LaTeX for a paper, with the rules of the package booktabs. All text that comes from a file is escaped."""

import re
from collections.abc import Iterable, Sequence
from typing import Final

from fedora_qa.record.wording import printable

LATEX_NEEDS: Final = r"% needs \usepackage{booktabs}"
"""What a document must load before the tables."""

_COMMANDS: Final = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    "<": "$<$",
    ">": "$>$",
    "±": r"$\pm$",
    "→": r"$\to$",
    "−": "$-$",
    "–": "--",
    "·": r"$\cdot$",
    "²": "$^2$",
    "ω": r"$\omega$",
    "µ": r"$\mu$",
    "\N{REPLACEMENT CHARACTER}": "?",
}
"""Characters that LaTeX reads as commands, or that not every font has."""

_NUMBER: Final = re.compile(r"(-?\d+(?:\.\d+)?)(?:e([+-]?\d+))?")
_WITH_ERROR: Final = re.compile(rf"{_NUMBER.pattern}(?: ± {_NUMBER.pattern})?")


def latex_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> str:
    """Return a floating table; columns that hold numbers are aligned to the right, and numbers set as mathematics."""
    holds_numbers = (k > 0 and any(_WITH_ERROR.fullmatch(row[k]) for row in rows) for k in range(len(head)))
    columns = "".join("r" if right else "l" for right in holds_numbers)
    return "\n".join(
        [
            r"\begin{table}",
            r"  \centering",
            rf"  \caption{{{_escape(f'{title}. {note}'.strip())}}}",
            rf"  \begin{{tabular}}{{{columns}}}",
            r"    \toprule",
            _row(map(_escape, head)),
            r"    \midrule",
            *(_row(map(_cell, row)) for row in rows),
            r"    \bottomrule",
            r"  \end{tabular}",
            r"\end{table}",
        ]
    )


def _row(cells: Iterable[str]) -> str:
    return f"    {' & '.join(cells)} \\\\"


def _cell(text: str) -> str:
    if not _WITH_ERROR.fullmatch(text):
        return "--" if text == "-" else _escape(text)  # a dash stands for an absent value
    # 1.2e-05 is written as a power of ten.
    powers = _NUMBER.sub(lambda part: part[1] + (rf" \times 10^{{{int(part[2])}}}" if part[2] else ""), text)
    mathematics = powers.replace("±", r"\pm")
    return f"${mathematics}$"


def _escape(text: str) -> str:
    return "".join(_COMMANDS.get(sign, sign) for sign in printable(text))

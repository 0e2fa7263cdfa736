"""Tables in LaTeX, read as strictly as pdflatex reads them: what it would refuse raises ``ValueError`` here."""

import re
from dataclasses import dataclass

_TOKEN = re.compile(r"\\[a-zA-Z]+|\\.|[{}$&%^_#~\n]|[^\\{}$&%^_#~\n]+", re.DOTALL)
_TEXT = {r"\textbackslash", r"\textasciitilde", r"\textasciicircum", *(f"\\{sign}" for sign in "&%$#_{}")}
_MATHEMATICS = {r"\pm", r"\to", r"\omega", r"\mu", r"\times", r"\cdot"}


@dataclass(frozen=True, slots=True)
class LatexTable:
    """The caption and the cells of a table, as they are written."""

    caption: str
    rows: tuple[tuple[str, ...], ...]


def read_latex(text: str) -> list[LatexTable]:
    """Return the tables of a document that consists of tables and comments."""
    bare = re.sub(r"(?<!\\)%.*", "", text)
    tables = []
    for body in re.split(r"\\begin\{table\}", bare)[1:]:
        match = re.fullmatch(
            r"\s*\\centering\s*\\caption\{(?P<caption>.*)\}\s*\\begin\{tabular\}\{(?P<columns>[lr]+)\}(?P<rows>.*)"
            r"\\end\{tabular\}\s*\\end\{table\}\s*",
            body,
            re.DOTALL,
        )
        if match is None:
            raise ValueError(f"Expected a table with caption and tabular, got {body!r}")
        _require_text(match["caption"])
        rows = []
        *lines, last = re.split(r"\\\\", match["rows"])
        if last.split() != [r"\bottomrule"]:
            raise ValueError(f"Expected a rule below the last row, got {last!r}")
        for line in lines:
            cells = tuple(cell.strip() for cell in re.split(r"(?<!\\)&", re.sub(r"\\(top|mid)rule\b", "", line)))
            if len(cells) != len(match["columns"]):
                raise ValueError(f"Expected {len(match['columns'])} cells, got {cells}")
            for cell in cells:
                _require_text(cell)
            rows.append(cells)
        tables.append(LatexTable(match["caption"], tuple(rows)))
    if bare[: bare.find(r"\begin")].strip() or not tables:
        raise ValueError("Expected tables and comments alone")
    return tables


def _require_text(text: str) -> None:
    """Raise ``ValueError`` where a group or formula is open, a command is unknown, or a sign needs another mode."""
    depth, in_mathematics = 0, False
    for token in _TOKEN.findall(text):
        if token == "$":
            in_mathematics = not in_mathematics
        elif token in "{}":
            depth += 1 if token == "{" else -1
        elif token in "&#~\n" or (token in "^_" and not in_mathematics):
            raise ValueError(f"Expected an escaped {token!r} in {text!r}")
        elif token.startswith("\\") and token not in (_MATHEMATICS if in_mathematics else _TEXT):
            raise ValueError(f"Expected a command of this mode, got {token} in {text!r}")
        elif any(ord(sign) > 0xFF and not sign.isalpha() for sign in token):
            raise ValueError(f"Expected signs of Latin 1, which LaTeX sets up (some in T1 only), got {token!r}")
        if depth < 0:
            raise ValueError(f"Expected an open group before each end, got {text!r}")
    if depth or in_mathematics:
        raise ValueError(f"Expected groups and formulas to be closed, got {text!r}")

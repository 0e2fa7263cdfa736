"""Tables in LaTeX: numbers are mathematics, and nothing of a file is read as a command."""

import re

import pytest

from fedora_qa.record.latex import latex_table


@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        ("12.5", "$12.5$"),
        ("-3", "$-3$"),
        ("2.06 ± 0.03", r"$2.06 \pm 0.03$"),
        ("1.2e-05", r"$1.2 \times 10^{-5}$"),
        ("3.1e+07 ± 2e+06", r"$3.1 \times 10^{7} \pm 2 \times 10^{6}$"),
        ("–", "--"),
        ("-", "--"),
        ("2 to 30", "2 to 30"),
        ("day_1 & 50% #2", r"day\_1 \& 50\% \#2"),
        (r"\input{secret}~^$", r"\textbackslash{}input\{secret\}\textasciitilde{}\textasciicircum{}\$"),
        ("two\nlines", "two lines"),
    ],
)
def test_cells(cell: str, expected: str) -> None:
    """A number is set as mathematics, with its error and power of ten; any other text as it stands."""
    line = latex_table("T", ("name", "value"), [("a", cell)]).splitlines()[7]
    assert line == rf"    a & {expected} \\"


def test_table() -> None:
    """The first column and columns without numbers are aligned to the left; every brace is closed."""
    text = latex_table(
        "Flow", ("sequence", "rate", "variance (px²)"), [("a", "10 Hz", "1.5"), ("b", "25 Hz", "–")], "A {note"
    )
    assert r"\begin{tabular}{llr}" in text
    assert r"\caption{Flow. A \{note}" in text
    assert r"sequence & rate & variance (px$^2$) \\" in text
    assert text.count(r"\\") == 3
    bare = re.sub(r"\\[{}]", "", text)
    assert bare.count("{") == bare.count("}")

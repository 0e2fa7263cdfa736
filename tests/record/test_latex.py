"""Tables in LaTeX: numbers are mathematics, and nothing of a file is read as a command."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.record.latex import LATEX_NEEDS, latex_table
from tests.support.latex_reader import read_latex


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


@given(
    st.lists(st.tuples(st.text(st.characters(codec="latin-1")), st.text(st.characters(codec="latin-1"))), min_size=1)
)
def test_whatever_a_file_says_is_a_table(rows: list[tuple[str, str]]) -> None:
    """A strict reader gets as many rows and cells as were written, and no command that a name spells."""
    (table,) = read_latex(f"{LATEX_NEEDS}\n{latex_table('T', ('name', 'value'), rows, rows[0][0])}")
    assert [len(row) for row in table.rows] == [2] * (1 + len(rows))


@pytest.mark.parametrize("cell", ["{", "$x", "a & b", "50% $", r"\input{x}", "x_1", "a → b", "}{"])
def test_the_reader_refuses_what_is_not_escaped(cell: str) -> None:
    """The same cells, as they are, are no table."""
    text = latex_table("T", ("name", "value"), [("PLACE", "1")])
    assert len(read_latex(text)) == 1
    with pytest.raises(ValueError, match="Expected"):
        read_latex(text.replace("PLACE", cell))

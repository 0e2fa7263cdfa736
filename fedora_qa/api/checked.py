"""A record with its arrays, for use from Python and in notebooks.

Data frames need pandas, an extra, which is imported only where one is requested. In HTML all text from a file is
escaped.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from numpy.typing import NDArray

from fedora_qa.cli.arrays import arrays_beside, write_arrays
from fedora_qa.cli.html import render_html_or_none
from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import write_record
from fedora_qa.record.notebook import html_table, html_text, isolated_frame
from fedora_qa.record.several_files import gravest_verdict
from fedora_qa.record.tables import Kind, Table, table_of
from fedora_qa.record.types import Record, Verdict
from fedora_qa.record.wording import cause_sentence, findings_of, headline, place

if TYPE_CHECKING:
    import pandas as pd

# Types that allow missing values: NumPy's int64 has none, pandas' Int64 does.
_TYPES: Final[Mapping[Kind, str]] = {
    "text": "string",
    "texts": "object",
    "integer": "Int64",
    "integers": "object",
    "number": "float64",
    "scalar": "object",
}


@dataclass(frozen=True, slots=True, repr=False)
class CheckedRecord(Record):
    """The record of one or more files, and the arrays that lie beside it.

    ``results``, ``measurements``, ``findings``, ``diagnoses`` and ``statistics`` are data frames of all files, with the
    columns of the tables that ``--csv`` writes; they need pandas (``pip install 'fedora-qa[notebook]'``).

    Attributes
    ----------
    arrays
        Evidence by name; ``evidence`` of each file states what each array holds.
    """

    # Not compared: an array has no single truth value, so that ``==`` of two records would raise.
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict, compare=False)

    @property
    def verdict(self) -> Verdict:
        """The gravest verdict of all files: incomplete before findings before clean."""
        return gravest_verdict(self.files)

    @property
    def results(self) -> "pd.DataFrame":
        """A row for each check of each file: its outcome, coverage and reason."""
        return frame_of(table_of(self, "results"))

    @property
    def measurements(self) -> "pd.DataFrame":
        """A row for each number that a check measured, with its expected value and its detection limit."""
        return frame_of(table_of(self, "measurements"))

    @property
    def findings(self) -> "pd.DataFrame":
        """A row for each finding: rule, severity, message and place."""
        return frame_of(table_of(self, "findings"))

    @property
    def diagnoses(self) -> "pd.DataFrame":
        """A row for each probable cause: its fitted size, remedy, and the findings that it explains."""
        return frame_of(table_of(self, "diagnoses"))

    @property
    def statistics(self) -> "pd.DataFrame":
        """A row for each number that describes a file: durations, speeds, rates."""
        return frame_of(table_of(self, "statistics"))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the record as JSON, and its arrays beside it, as ``fedora-qa check --json`` does."""
        write_arrays(arrays_beside(Path(path)), self.arrays)
        write_record(self, Path(path))

    def __repr__(self) -> str:
        return "\n".join(f"{file.path}: {headline(file)}" for file in self.files)

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: the report where its package is installed, else verdicts and findings."""
        page = render_html_or_none(self, self.arrays)
        return light_page(self) if page is None else isolated_frame(page)


def with_arrays(record: Record, arrays: Mapping[str, NDArray[Any]]) -> CheckedRecord:
    """Return a record with the arrays that lie beside it."""
    return CheckedRecord(**{each.name: getattr(record, each.name) for each in fields(record)}, arrays=dict(arrays))


def frame_of(table: Table) -> "pd.DataFrame":
    """Return a table as a data frame; the types of its columns do not depend on what they hold.

    Raises
    ------
    MisuseError
        pandas is not installed.
    """
    try:
        import pandas as pd  # noqa: PLC0415 - an extra
    except ImportError as missing:
        raise MisuseError(
            f"Expected what makes data frames, got: {missing}; install it with pip install 'fedora-qa[notebook]'"
        ) from None
    columns = {
        # An explicit type: inferred ones would differ between records, and for columns without values.
        column.name: pd.Series([row[position] for row in table.rows], dtype=_TYPES[column.kind])
        for position, column in enumerate(table.columns)
    }
    return pd.DataFrame(columns)


def light_page(record: Record) -> str:
    """Return the verdict of each file, its probable causes, and its findings as a table."""
    parts = []
    for file in record.files:
        parts.append(f"<h4>{html_text(file.path)}</h4><p><b>{html_text(headline(file))}</b></p>")
        if file.diagnoses:
            causes = (f"<li>{html_text(f'{cause_sentence(cause)}. {cause.remedy}')}</li>" for cause in file.diagnoses)
            parts.append(f"<ul>{''.join(causes)}</ul>")
        finding_rows = [(f.id, f.severity, f.code, f.message, place(f.where)) for _, f in findings_of(file)]
        if finding_rows:
            parts.append(html_table(("id", "severity", "rule", "finding", "where"), finding_rows))
    return "".join(parts)

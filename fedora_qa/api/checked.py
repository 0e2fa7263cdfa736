"""A record with its arrays, for use from Python and in notebooks."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from fedora_qa.api.frames import frame_of
from fedora_qa.api.notebook import light_page, report_frame
from fedora_qa.cli.arrays import arrays_beside, write_arrays
from fedora_qa.record.json_io import write_record
from fedora_qa.record.tables import table_of
from fedora_qa.record.types import Record, Verdict
from fedora_qa.record.wording import headline

if TYPE_CHECKING:
    import pandas as pd


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
        verdicts = {file.verdict for file in self.files}
        gravest_first: tuple[Verdict, ...] = ("incomplete", "findings", "clean")
        # A record without files has tested nothing: incomplete.
        return next((verdict for verdict in gravest_first if verdict in verdicts), "incomplete")

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
        return report_frame(self, self.arrays) or light_page(self)

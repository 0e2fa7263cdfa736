"""Statistics of sequences from Python."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fedora_qa.api.check import frame_of
from fedora_qa.api.options import AnyPath, folder_texts, path_text
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.stats import NOTES, measured_file, reading_of, tables_of, tables_to_markdown
from fedora_qa.errors import MisuseError
from fedora_qa.record.notebook import html_table, html_text
from fedora_qa.record.tables import TextTable, statistics_table
from fedora_qa.statistics.collector import Statistics

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, repr=False)
class MeasuredStatistics:
    """The statistics of sequences.

    Attributes
    ----------
    by_file
        The numbers of each file, by its path, by their group and by their name, which ends with the unit, as in
        ``by_file["seq.h5"]["sequence"]["duration_s"]``.
    """

    by_file: Mapping[str, Statistics]

    @property
    def tables(self) -> tuple[TextTable, ...]:
        """The tables that the command prints: sequences, flow, depth and light, rates."""
        return tables_of(self.by_file)

    @property
    def frame(self) -> "pd.DataFrame":
        """A data frame with a row for each number: file, group, name and value; needs pandas."""
        return frame_of(statistics_table(self.by_file))

    def __repr__(self) -> str:
        return tables_to_markdown(self.tables)

    def _repr_html_(self) -> str:
        """Return the tables as HTML for a notebook."""
        tables = (html_table(table.head, table.rows, table.title) for table in self.tables)
        return f"{''.join(tables)}<p>{html_text(NOTES)}</p>"


def stats(
    *paths: AnyPath,
    dialect: AnyPath | None = None,
    metadata: AnyPath | None = None,
    memory: str = "1GB",
    allow_external: Sequence[AnyPath] = (),
    apart: bool = False,
) -> MeasuredStatistics:
    """Measure duration, distance, greatest speeds, event rate, flow, depth and light, as ``fedora-qa stats`` does.

    Parameters
    ----------
    paths
        HDF5 files, folders that are one sequence, and folders of these, each once.
    dialect
        How the files name and scale their data: a name, or a TOML file; None: as it is recognised.
    metadata
        A TOML file whose table ``[metadata]`` declares what the sequences do not declare.
    memory
        Memory to aim at, with its unit.
    allow_external
        Folders with other files that a file may link to, or consist of.
    apart
        Whether to open each file in another process, as for ``check``.

    Returns
    -------
    MeasuredStatistics
        The numbers, each with its unit in its name: s, m, m/s, rad/s, events/s, px, DN.

    Raises
    ------
    MisuseError
        No path, one that is missing, given twice or not HDF5, or an illegal option.
    FedoraError
        A file cannot be opened, or no dialect describes it.
    """
    if not paths:
        raise MisuseError("Expected at least one file to measure, got none")
    external = folder_texts(allow_external) or ()
    reading = reading_of(path_text(dialect), path_text(metadata), memory, external, in_process=not apart)
    sequences = sequences_of([Path(path) for path in paths], reading.dialect)
    return MeasuredStatistics(
        {str(path): measured_file(path, reading).statistics for path in sequences if isinstance(path, Path)}
    )

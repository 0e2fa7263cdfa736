"""Check files from Python, and read records of earlier runs; the record with its arrays, for notebooks.

Data frames need pandas, an extra, which is imported only where one is requested. In HTML all text from a file is
escaped.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from numpy.typing import NDArray

from fedora_qa.api.options import AnyPath, copied_as, folder_texts, path_text, settings_of
from fedora_qa.cli.arrays import arrays_beside, read_arrays, write_arrays
from fedora_qa.cli.check import Request, check_all, executor_for
from fedora_qa.cli.outputs import page_or_none
from fedora_qa.cli.record import evidence_arrays, record_of
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.settings import check_options
from fedora_qa.engine.options import Effort
from fedora_qa.errors import MisuseError
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.judgement.materiality import Profile
from fedora_qa.record.json_io import read_record as read_plain
from fedora_qa.record.json_io import write_record
from fedora_qa.record.notebook import html_table, html_text, isolated_frame
from fedora_qa.record.tables import Kind, Table, table_of
from fedora_qa.record.types import Record, Verdict, gravest_verdict
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
        page = page_or_none(self, self.arrays)
        return light_page(self) if page is None else isolated_frame(page)


def check(
    *paths: AnyPath,
    effort: Effort | None = None,
    select: Sequence[str] | None = None,
    ignore: Sequence[str] | None = None,
    dialect: AnyPath | None = None,
    metadata: AnyPath | None = None,
    profile: Profile | None = None,
    fail_on: Literal["failed", "warned"] | None = None,
    memory: str | None = None,
    false_alarm_rate: float | None = None,
    canary: bool | None = None,
    jobs: int | None = None,
    allow_external: Sequence[AnyPath] | None = None,
    required_coverage: Mapping[str, float] | None = None,
    config: AnyPath | None = None,
    evidence: bool = True,
    apart: bool = False,
) -> CheckedRecord:
    """Check files as ``fedora-qa check`` does, and return the record of all of them.

    An option that is None holds as ``config`` states it, and without one as its default.

    Parameters
    ----------
    paths
        HDF5 files, folders that are one sequence, and folders of these, each once.
    effort
        How much to look at: ``"quick"``, ``"standard"``, ``"full"`` (default) or ``"exhaustive"``.
    select, ignore
        Subjects or checks to run and to leave out, such as ``["clocks", "imu.noise"]``; default: all, and none.
    dialect
        How the files name and scale their data: a name, or a TOML file; default: as it is recognised.
    metadata
        A TOML file whose table ``[metadata]`` declares what the sequences do not declare; default: none.
    profile
        From which size a deviation matters: ``"release"`` (default) to publish the data, ``"training"`` to train on
        them, ``"strict"`` for any size.
    fail_on
        From which outcome on a command exits with 1: ``"failed"`` (default) or ``"warned"``. It is part of the
        configuration whose digest the record holds, and changes no verdict.
    memory
        Memory to aim at of all processes together, with its unit, such as ``"512MiB"``; default ``"1GB"``, 1e9 bytes.
    false_alarm_rate
        Probability, between 0 and 1, that a correct file fails, shared by all comparisons of the file; default 1e-4.
    canary
        Whether each check must detect a fault that is planted for it in memory; default False.
    jobs
        Files, and windows of a file, checked at once, each in a process of its own; default 1, in this process. With
        several, or ``apart``, a script must guard its entry with ``if __name__ == "__main__"``, as multiprocessing
        requires.
    allow_external
        Folders with other files that a file may link to, or consist of; default: none.
    required_coverage
        Least share, 0 to 1, of its stream that a subject or check must cover, by its name; default: none.
    config
        A ``fedora-qa.toml`` with these options; paths in it are relative to it.
    evidence
        Whether to keep images and series for the report.
    apart
        Whether to open files in another process even with a single job: for files from unknown sources, which may
        crash HDF5 or take for ever to open. Their checks are then ``crashed``, and the program continues.

    Returns
    -------
    CheckedRecord
        What was found of each file, with times in us on its own clock, and values in the units that stand beside them.

    Raises
    ------
    MisuseError
        No such file, not HDF5 at all, or an option with an illegal value. Defects of a file raise nothing: they stand
        in the record.
    """
    files = [Path(path) for path in paths]
    if not files:
        raise MisuseError("Expected at least one file to check, got none")
    options = {
        "effort": effort,
        "select": select,
        "ignore": ignore,
        "dialect": path_text(dialect),
        "metadata": path_text(metadata),
        "profile": profile,
        "fail_on": fail_on,
        "memory": memory,
        "false_alarm_rate": false_alarm_rate,
        "canary": canary,
        "jobs": jobs,
        "allow_external": folder_texts(allow_external),
        "required_coverage": required_coverage,
    }
    settings = settings_of(config, options)
    engine_options = replace(check_options(settings), evidence=EvidenceOptions() if evidence else None)
    # Before workers are started: a wrong path is a misuse of the call, not a finding.
    sequences = sequences_of(files, engine_options.dialect)
    started = datetime.now(UTC).isoformat(timespec="seconds")
    executor = executor_for(settings, in_process=not apart)
    # Read here, as ``check_all`` closes the executor.
    workers = executor.capacity
    runs = check_all(sequences, Request(settings, engine_options, started), executor)
    return with_arrays(record_of(runs, settings, started, {"jobs": workers}), evidence_arrays(runs))


def read_record(path: AnyPath) -> CheckedRecord:
    """Read a record that ``fedora-qa check --json`` or ``save`` wrote, with the arrays beside it if they are there.

    Raises
    ------
    MisuseError
        There is no record, or its arrays are damaged.
    """
    record, beside = read_plain(Path(path)), arrays_beside(Path(path))
    return with_arrays(record, read_arrays(beside) if beside.is_file() else {})


def with_arrays(record: Record, arrays: Mapping[str, NDArray[Any]]) -> CheckedRecord:
    """Return a record with the arrays that lie beside it."""
    return copied_as(CheckedRecord, record, arrays=dict(arrays))


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

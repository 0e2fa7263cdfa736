"""Where a record comes from: the file, the tool, the run, and the arrays that were kept."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fedora_qa.record.types import FileRecord, Record, Scalar
from fedora_qa.record.wording import number
from fedora_reports.evidence import Evidence
from fedora_reports.statistics import Table

_CHECK = "check "
"""Begins the names of those seconds that belong to one check."""


@dataclass(frozen=True, slots=True)
class Provenance:
    """Facts as pairs of name and value, and tables."""

    facts: tuple[tuple[str, str], ...]
    tables: tuple[Table, ...]


def file_provenance(file: FileRecord, evidence: Evidence) -> Provenance:
    """Return what identifies the file, what was inferred about it, and what was kept of it."""
    digest = f"{file.sha256}{' (of parts of the file)' if file.digest_kind == 'partial' else ''}"
    facts = [
        ("Path", file.path),
        ("Size", f"{file.size / 1e6:.1f} MB"),
        ("SHA-256", digest),
        ("Dialect", file.dialect or "not recognised"),
        *((f"Inferred: {name.replace('_', ' ')}", _fact(value)) for name, value in file.inferred.items()),
    ]
    return Provenance(tuple(facts), tuple(_evidence_tables(evidence)))


def run_provenance(record: Record) -> Provenance:
    """Return what made the record, and how long it took."""
    facts = [
        ("Made by", f"{record.tool.name} {record.tool.version}, ruleset {record.ruleset_version}"),
        ("Started", record.run.started),
        ("Effort", record.effort or "not stated"),
        ("Configuration", record.config_digest),
        ("Record version", record.record_version),
    ]
    seconds = record.run.seconds
    stages = {name: spent for name, spent in seconds.items() if not name.startswith(_CHECK)}
    checks = {name.removeprefix(_CHECK): spent for name, spent in seconds.items() if name.startswith(_CHECK)}
    slowest = dict(sorted(checks.items(), key=lambda item: -item[1]))
    tables = (_seconds("Seconds by stage", stages), _seconds("Seconds by check", slowest), _host(record.run.host))
    return Provenance(tuple(facts), tuple(table for table in tables if table.rows))


def _seconds(title: str, spent: Mapping[str, float]) -> Table:
    return Table(title, "", ("part", "seconds"), tuple((name, f"{value:.3f}") for name, value in spent.items()))


def _host(host: Mapping[str, Scalar]) -> Table:
    return Table(
        "Machine", "", ("fact", "value"), tuple((name.replace("_", " "), _fact(v)) for name, v in host.items())
    )


def _evidence_tables(evidence: Evidence) -> Iterator[Table]:
    rows = []
    for name in evidence.names():
        array = evidence.arrays[name]
        shape = " × ".join(map(str, array.shape)) or "one number"
        rows.append((name, evidence.title(name), shape, str(array.dtype), f"{array.nbytes / 1e3:.1f}"))
    if rows:
        note = f"{sum(evidence.arrays[name].nbytes for name in evidence.names()) / 1e6:.2f} MB before compression."
        yield Table("Evidence", note, ("array", "title", "shape", "type", "kB"), tuple(rows), numeric=False)
    if evidence.missing:
        missing = tuple((name, evidence.title(name)) for name in evidence.missing)
        yield Table("Evidence that is missing", "", ("array", "title"), missing, numeric=False)


def _fact(value: Scalar) -> str:
    return number(value) if isinstance(value, float) else str(value)

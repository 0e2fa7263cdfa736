"""The provenance of a record: the file, the tool, the run, and the arrays that were kept."""

from collections.abc import Mapping
from dataclasses import dataclass

from fedora_qa.record.types import FileRecord, Record, Scalar
from fedora_qa.record.wording import number
from fedora_reports.evidence import Evidence
from fedora_reports.statistics import Table

_CHECK = "check "
"""Prefix of the names of those seconds that belong to one check."""


@dataclass(frozen=True, slots=True)
class Provenance:
    """Facts as pairs of name and value, and tables."""

    facts: tuple[tuple[str, str], ...]
    tables: tuple[Table, ...]


def file_provenance(file: FileRecord, evidence: Evidence) -> Provenance:
    """Return the identity of a file, what was inferred about it, and the arrays that were kept of it.

    Parameters
    ----------
    file
        The record of the file.
    evidence
        The arrays of the file.
    """
    digest = f"{file.sha256}{' (of parts of the file)' if file.digest_kind == 'partial' else ''}"
    facts = [
        ("Path", file.path),
        ("Size", f"{file.size / 1e6:.1f} MB"),
        ("SHA-256", digest),
        ("Dialect", file.dialect or "not recognised"),
        *((f"Inferred: {name.replace('_', ' ')}", _fact(value)) for name, value in file.inferred.items()),
    ]
    tables, rows, size = [], [], 0
    for name in evidence.names():
        array = evidence.arrays[name]
        shape = " × ".join(map(str, array.shape)) or "one number"
        rows.append((name, evidence.title(name), shape, str(array.dtype), f"{array.nbytes / 1e3:.1f}"))
        size += array.nbytes
    if rows:
        note = f"{size / 1e6:.2f} MB before compression."
        tables.append(Table("Evidence", note, ("array", "title", "shape", "type", "kB"), tuple(rows), numeric=False))
    if evidence.missing:
        missing = tuple((name, evidence.title(name)) for name in evidence.missing)
        tables.append(Table("Evidence that is missing", "", ("array", "title"), missing, numeric=False))
    return Provenance(tuple(facts), tuple(tables))


def run_provenance(record: Record) -> Provenance:
    """Return the tool and the configuration of a run, its machine, and the time that it took."""
    facts = [
        ("Made by", f"{record.tool.name} {record.tool.version}, ruleset {record.ruleset_version}"),
        ("Started", record.run.started),
        ("Effort", record.effort or "not stated"),
        ("Profile", record.profile),
        ("Configuration", record.config_digest),
        ("Record version", record.record_version),
    ]
    seconds = record.run.seconds
    stages = {name: spent for name, spent in seconds.items() if not name.startswith(_CHECK)}
    checks = {name.removeprefix(_CHECK): spent for name, spent in seconds.items() if name.startswith(_CHECK)}
    slowest = dict(sorted(checks.items(), key=lambda item: -item[1]))
    host = tuple((name.replace("_", " "), _fact(value)) for name, value in record.run.host.items())
    tables = (
        _seconds("Seconds by stage", stages),
        _seconds("Seconds by check", slowest),
        Table("Machine", "", ("fact", "value"), host),
    )
    return Provenance(tuple(facts), tuple(table for table in tables if table.rows))


def _seconds(title: str, spent: Mapping[str, float]) -> Table:
    return Table(title, "", ("part", "seconds"), tuple((name, f"{value:.3f}") for name, value in spent.items()))


def _fact(value: Scalar) -> str:
    return number(value) if isinstance(value, float) else str(value)

"""Which streams agree: the checks that compare each pair of streams, as a table."""

from dataclasses import dataclass

from fedora_qa.record.evidence import AGREEMENT
from fedora_reports.evidence import Evidence


@dataclass(frozen=True, slots=True)
class AgreementCell:
    """The checks that compare two streams; none of them failed where the streams agree."""

    passed: int
    failed: int


@dataclass(frozen=True, slots=True)
class Agreement:
    """Streams, and for each of them a row with a cell for each stream; None on the diagonal and where no check is."""

    streams: tuple[str, ...]
    rows: tuple[tuple[AgreementCell | None, ...], ...]


def agreement_of(evidence: Evidence) -> Agreement | None:
    """Return the table of a file; None where no pair of streams was kept."""
    cells: dict[frozenset[str], AgreementCell] = {}
    for name in evidence.under(AGREEMENT):
        counts = evidence.numbers(name, 2)
        pair = name.split("/")[1:]
        if counts is not None and len(pair) == 2:
            cells[frozenset(pair)] = AgreementCell(int(counts[0]), int(counts[1]))
    streams = tuple(sorted({stream for pair in cells for stream in pair}))
    rows = tuple(tuple(cells.get(frozenset((row, column))) for column in streams) for row in streams)
    return Agreement(streams, rows) if streams else None

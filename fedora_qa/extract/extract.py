"""Cut the shortest piece out of a sequence that still shows a finding, which a check of the piece confirms."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path

import h5py

from fedora_qa.conventions import NS_PER_S
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.plan import window_length_ns
from fedora_qa.engine.run import check_file
from fedora_qa.extract.cut import Cutter
from fedora_qa.extract.place import pieces_around, place_of
from fedora_qa.extract.rows import CutRows
from fedora_qa.layout.detect import detect_dialect
from fedora_qa.layout.dialect import split_choice
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.record.atomic import replacing
from fedora_qa.record.types import Finding
from fedora_qa.sequence.scan import scan
from fedora_qa.sequence.sequence import open_sequence

Report = Callable[[str, int, int], None]
"""Called with the piece that is tried, how many were tried before, and how many there are."""


@dataclass(frozen=True, slots=True)
class CheckFinding:
    """A finding, and the check that found it."""

    check: str
    finding: Finding


@dataclass(frozen=True, slots=True)
class Extraction:
    """What was written.

    Attributes
    ----------
    kept
        Rows by stream.
    left_out
        Datasets that belong to no stream and are too large to be copied whole, and what could not be read.
    finding
        The finding as the check of the piece reports it; None where it reports none.
    """

    kept: dict[str, CutRows]
    left_out: tuple[str, ...]
    finding: Finding | None

    @property
    def is_whole(self) -> bool:
        """Whether every row of every stream was kept."""
        return all(rows.start == 0 and rows.to_the_end for rows in self.kept.values())


def extract(
    source: Path, target: Path, wanted: CheckFinding, options: CheckOptions, longest_s: float, report: Report
) -> Extraction:
    """Write the shortest piece that shows a finding, or the longest that was tried where none does.

    Pieces around the finding's place are written and checked, each with twice the margin of the one before, until the
    check finds the same rule broken in the same stream. The target is written entirely or not at all.

    Parameters
    ----------
    options
        How the finding was found; only the check that found it is run. Values from other files, where
        ``allow_external`` names their folders, are written into the piece. The piece is checked without these files.
    longest_s
        Length of the longest piece to try; the first is tried whatever its length.

    Raises
    ------
    MisuseError, UnreadableFileError
        As ``open_sequence``.
    """
    folders = options.allow_external
    # Without `allow_external`: the piece must show the finding by itself, on a machine that has no other files.
    options = replace(options, select=(wanted.check,), ignore=(), evidence=None, canary=False, allow_external=())
    with ExitStack() as opened:
        sequence = opened.enter_context(open_sequence(source, options.dialect, allow_external=folders))
        file = opened.enter_context(h5py.File(source.resolve() if folders else source, "r", locking="best-effort"))
        external_files = opened.enter_context(closing(ExternalFiles(folders))) if folders else None
        scanned = scan(sequence, window_length_ns(sequence))
        cutter = Cutter(
            file,
            sequence,
            scanned,
            split_choice(options.dialect)[0] or detect_dialect(file, external_files),
            external_files,
        )
        place = place_of(wanted.finding.where, wanted.check, scanned)
        with replacing(target) as temporary:
            pieces = tuple(pieces_around(place, round(longest_s * NS_PER_S)))
            for number, piece in enumerate(pieces):
                report(f"a piece of {(piece.stop_ns - piece.start_ns) / NS_PER_S:.3g} s", number, len(pieces))
                kept, left_out = cutter.write(piece, temporary)
                record = check_file(temporary, options).record
                # The same rule, broken in the same stream. Place and size may differ: the piece has fewer rows, so that
                # its worst place may be another.
                same = (
                    finding
                    for result in record.results
                    for finding in result.findings
                    if result.check == wanted.check
                    and finding.code == wanted.finding.code
                    and wanted.finding.where.stream in {where.stream for where in finding.all_places}
                )
                extracted = Extraction(kept, left_out, next(same, None))
                # A piece that holds all rows cannot grow.
                if extracted.finding or extracted.is_whole:
                    break
            return extracted

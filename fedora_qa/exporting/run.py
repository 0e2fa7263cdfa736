"""Write a sequence in a layout that is chosen by name."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from fedora_qa.errors import MisuseError, UnreadableRowsError
from fedora_qa.exporting.dsec import write_dsec
from fedora_qa.exporting.tum import write_tum
from fedora_qa.layout.dialect import DialectChoice
from fedora_qa.sequence.sequence import open_sequence

ExportForm = Literal["tum", "dsec"]
Report = Callable[[str, int, int], None]


def export_sequence(
    source: Path, target: Path, form: ExportForm, dialect: DialectChoice, report: Report
) -> dict[str, int]:
    """Write a sequence, and return the number of rows by stream.

    Parameters
    ----------
    source
        A file or folder, in any dialect; only read.
    target
        A new file (``tum``) or folder (``dsec``), which gets its name when it is complete.

    Raises
    ------
    MisuseError
        The sequence has nothing that the layout holds, rows that cannot be decoded, or what does not fit.
    """
    try:
        with open_sequence(source, dialect) as sequence:
            return write_tum(sequence, target) if form == "tum" else write_dsec(sequence, target, report)
    except UnreadableRowsError as error:
        raise MisuseError(f"{error}: {source}; check the file first, and repair it or cut out a part") from error

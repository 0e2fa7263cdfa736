"""One HDF5 file of the canonical layout, as all commands read it without a dialect."""

from pathlib import Path

import h5py

from fedora_qa.engine.progress import Progress
from fedora_qa.layout.create import DeferredErrorFile
from fedora_qa.record.atomic import replacing
from fedora_qa.sequence.canonical_copy import CanonicalCopy, write_canonical
from fedora_qa.sequence.sequence import Sequence


def write_fedora(sequence: Sequence, target: Path, report: Progress) -> CanonicalCopy:
    """Write the whole sequence, and return what was written, and what has no place in the layout.

    Raises
    ------
    MisuseError
        There is nothing to write, a value does not fit the layout, or the file cannot be written.
    UnreadableRowsError
        Rows cannot be decoded.
    """
    with replacing(target) as temporary, DeferredErrorFile(temporary, "the sequence") as handle:
        with h5py.File(handle, "w") as file:
            written = write_canonical(sequence, file, report)
        handle.raise_failure()
    return written

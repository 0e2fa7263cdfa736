"""The family of errors.

::

    FedoraError                an error that the user reads as one sentence
    ├── MisuseError            no such path, not HDF5 at all, bad options or config (exit code 2)
    │   ├── NotHdf5Error       the path exists and does not begin like HDF5
    │   └── StorageError       a file behind a URL cannot be read, or was changed meanwhile
    ├── UnreadableFileError    an HDF5 signature, and it cannot be opened (a finding, not misuse)
    ├── UnrecognisedError      no dialect describes anything in a file or folder (incomplete: nothing is measured)
    ├── UnreadableRowsError    some rows of one dataset cannot be decoded (a finding; the rest goes on)
    ├── NotRepairableError     a file cannot be repaired, or its copy would not be better (nothing is written)
    └── WorkerLostError        the process that did a task died (the task is done again; the rest goes on)
        └── EndlessError       the task exceeded its limit of time (the task is not done again)
"""

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return a clause that proposes the name nearest to one that does not exist; empty where none is near.

    Nearest is the largest ratio of Ratcliff and Obershelp 1988, at least 0.6, as ``difflib`` recommends.
    """
    nearest = get_close_matches(name, names, n=1)
    return f"; did you mean {nearest[0]!r}?" if nearest else ""


def first_line(error: BaseException) -> str:
    """Return the first line with text of an error, or its type where it has none."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


class FedoraError(Exception):
    """Base of every error with a message meant for people."""


class MisuseError(FedoraError):
    """The request cannot be carried out: a wrong path, option or configuration."""


class NotHdf5Error(MisuseError):
    """The path exists and holds no HDF5 file."""


class StorageError(MisuseError):
    """A file behind a URL cannot be read: no such object, no access, no connection, or it was changed meanwhile."""


class UnreadableFileError(FedoraError):
    """The file has an HDF5 signature and cannot be opened: truncated or corrupt."""


class UnrecognisedError(FedoraError):
    """No dialect describes anything in a file or folder; the message has the command that drafts one."""


class UnreadableRowsError(FedoraError):
    """Rows of a dataset cannot be decoded.

    Attributes
    ----------
    key
        Canonical key of the dataset.
    start, stop
        The requested rows.
    chunks
        Numbers in the dataset of the stored chunks that cannot be decoded; empty where they were not decoded singly.
    has_other_form
        Whether what is stored is sound, but of another size or depth than the rows of the dataset.
    """

    def __init__(
        self,
        key: str,
        start: int,
        stop: int,
        reason: str,
        chunks: tuple[int, ...] = (),
        *,
        has_other_form: bool = False,
    ) -> None:
        super().__init__(f"Expected rows {start} to {stop} of {key} to decode, got: {reason}")
        self.key = key
        self.start = start
        self.stop = stop
        self.reason = reason
        self.chunks = chunks
        self.has_other_form = has_other_form


class NotRepairableError(FedoraError):
    """The file cannot be repaired, or its copy would not be better; the message states the reason."""


class WorkerLostError(FedoraError):
    """The process of a task died: killed, out of memory, or by a crash of a library."""


class EndlessError(WorkerLostError):
    """A task exceeded its limit of time, such as a file that never opens; it would exceed it again."""

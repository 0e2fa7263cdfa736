"""What a process keeps from one task to the next: the open file that it measures, and the blocks decoded of it.

It also keeps the pass over its last windows, which otherwise would be read back at once.
"""

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from typing import TYPE_CHECKING, Final

from fedora_qa.engine.time_limit import time_limit

if TYPE_CHECKING:  # a worker has an open file before it has loaded what measures
    from fedora_qa.engine.file_task import Sealed, Surveyed
    from fedora_qa.engine.partial_pass import PartialPass
    from fedora_qa.engine.survey import OpenSurvey, Survey
    from fedora_qa.storage.place import Place

OPENING_S: Final = 5.0
"""Seconds of processor time within which a file must open, which takes hundredths of one. HDF5 follows structures that
refer to themselves for ever (docs/hostile-files.md)."""


class OpenFile:
    """Holds one open file at most, so that neighbouring batches of windows share the blocks between them.

    Parameters
    ----------
    keeps
        Whether the process is a worker of this package, in which a file stays open after a task; elsewhere each task
        opens it anew. A file behind a URL never stays open, as each task reports its own traffic.
    """

    def __init__(self, *, keeps: bool) -> None:
        self._keeps = keeps
        self._surveyed: Surveyed | None = None
        self._open: tuple[Survey, OpenSurvey] | None = None
        self._shown: tuple[Sealed[PartialPass], PartialPass] | None = None
        self._kept = ExitStack()

    @contextmanager
    def opened(self, surveyed: "Surveyed") -> "Iterator[tuple[Survey, OpenSurvey]]":
        """Open a surveyed file, or go on with it; raises ``FedoraError`` where it has been changed since."""
        from fedora_qa.engine.survey import opened, require_same  # noqa: PLC0415 - loads what measures
        from fedora_qa.storage.place import RemoteFile  # noqa: PLC0415 - as above
        from fedora_qa.storage.server import version_of  # noqa: PLC0415 - as above

        if self._open is None or self._surveyed != surveyed:
            self.clear()
            survey: Survey = surveyed.survey.open()
            self._open = survey, self._kept.enter_context(opened(survey))
            self._surveyed = surveyed
        else:
            require_same(self._open[0], version_of(surveyed.path))
        try:
            yield self._open
        except BaseException:
            self._surveyed = self._open = self._shown = None
            # With the error, so that the file is closed without the test for a change, which would raise another one.
            self._kept.__exit__(*sys.exc_info())
            raise
        if not self._keeps or isinstance(surveyed.path, RemoteFile):
            self.clear()

    def keep_shown(self, sealed: "Sealed[PartialPass]", measured: "PartialPass") -> None:
        """Keep a pass that was written to a file, for the task that continues it; only in workers."""
        if self._keeps and sealed.path is not None:
            self._shown = sealed, measured

    def take_shown(self, *sealed: "Sealed[PartialPass]") -> "Iterator[PartialPass]":
        """Yield passes over windows, to be extended; none of them is kept here any longer.

        The pass that was written last need not be read back. It is handed out once: a task that is done again reads the
        pass from its file.
        """
        # Given away before use: the task changes it, and a failed task leaves it half changed.
        latest, self._shown = self._shown, None
        for item in sealed:
            yield latest[1] if latest and latest[0] == item else item.open()

    def opening(self, path: "Place") -> AbstractContextManager[None]:
        """End this process where a local file takes for ever to open; only in workers, whose end is noticed."""
        from fedora_qa.storage.place import RemoteFile  # noqa: PLC0415 - loads what measures

        return time_limit(OPENING_S) if self._keeps and not isinstance(path, RemoteFile) else nullcontext()

    def clear(self) -> None:
        """Close the file, and drop its decoded blocks."""
        self._surveyed = self._open = self._shown = None
        self._kept.close()

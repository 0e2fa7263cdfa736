"""What a process has for its tasks: the file that it keeps open between them, and whom it reports its progress to."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.storage.place import RemoteFile
from fedora_qa.storage.server import version_of

if TYPE_CHECKING:
    from fedora_qa.engine.survey import OpenSurvey, Survey


class OpenFile:
    """Holds one open file at most, so that neighbouring batches of windows share the rows between them.

    Parameters
    ----------
    keeps
        Whether the process is a worker of this package, in which a file stays open after a task; elsewhere each task
        opens it anew. A file behind a URL never stays open, as each task reports its own traffic.
    """

    def __init__(self, *, keeps: bool) -> None:
        self._keeps = keeps
        self._token = ""
        self._file: OpenSurvey | None = None
        self._opened = ExitStack()

    @contextmanager
    def opened(self, survey: "Survey") -> "Iterator[OpenSurvey]":
        """Open a surveyed file, or go on with it; raises ``FedoraError`` where it has been changed since."""
        # The process of the command imports this module as well, and measures nothing.
        from fedora_qa.engine.survey import opened, receivers, require_same  # noqa: PLC0415 - loads what measures

        if self._file is not None and self._token == survey.token:
            require_same(survey, version_of(survey.path))
            # The same survey may come with another plan.
            file = receivers(survey, self._file.sequence, self._file.ready)
        else:
            self.close()
            file = self._file = self._opened.enter_context(opened(survey))
            self._token = survey.token
        try:
            yield file
        except BaseException:
            self._file = None
            # With the error, so that the file is closed without the test for a change, which would raise another one.
            self._opened.__exit__(*sys.exc_info())
            raise
        if not self._keeps or isinstance(survey.path, RemoteFile):
            self.close()

    def close(self) -> None:
        """Close the file, and drop its decoded rows."""
        self._file = None
        self._opened.close()


@dataclass(frozen=True, slots=True)
class Worker:
    """What a task gets beside its arguments."""

    open_file: OpenFile
    progress: Progress = quiet

"""One file on its way to its record, as steps for any process: survey, batches of windows, judgement."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fedora_qa.engine.executors import DIED_TWICE, ENDLESS, Task
from fedora_qa.engine.file_task import FileTask, Sealed, Surveyed
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import MEASURING, Progress
from fedora_qa.engine.work_queue import WorkQueue
from fedora_qa.storage.place import Place

_OPENED: Final = "being opened"

if TYPE_CHECKING:  # the process that deals out the work loads no checks
    from fedora_qa.checks.protocol import Check


@dataclass(frozen=True, slots=True)
class WorkStep:
    """A task of a file, with the calls for its progress, for its result, and for the death of its process.

    ``when_endless`` is called where the file took for ever to open, as it would again; None: ``when_lost`` is called.
    """

    task: Task[Any]
    progress: Progress
    then: Callable[[Any], None]
    when_lost: Callable[[], None]
    when_endless: Callable[[], None] | None = None


@dataclass(frozen=True, slots=True)
class Part:
    """The sealed pass over neighbouring windows, from ``start`` up to but without ``stop``."""

    start: int
    stop: int
    sealed_pass: Sealed[Any]


class FileWork:
    """One file: the steps that are ready, and in the end its run.

    A step whose process dies is done once more. A batch of windows is then measured window by window, so that the one
    which ends the process costs no other. A file that takes for ever to open is not opened again. A single worker does
    a file in one step.

    Attributes
    ----------
    ready
        Steps that can begin at once; windows of the work queue are not among them.
    run
        None until the file is done.
    """

    def __init__(
        self,
        path: Place,
        size: int,
        checks: "tuple[Check[Any], ...] | None",
        options: CheckOptions,
        workers: int,
        report: Callable[[str], None],
        folder: Path | None = None,
    ) -> None:
        self.path = path
        self.bytes = size
        self.ready: deque[WorkStep] = deque()
        self.run: FileRun | None = None
        self.windows = 0
        self._checks = checks
        self._workers = workers
        self._report = report
        self._folder = folder
        self._parts: dict[int, Part] = {}
        self._lost: list[int] = []
        self._seen: dict[int, int] = {}
        self._surveyed_as: Surveyed | None = None
        self._work_queue = WorkQueue(0, workers)
        self._options = options
        if workers == 1:
            self._do_in_one()
        else:
            self._do_in_steps()

    def take(self, worker: int) -> WorkStep | None:
        """Return the next step for a worker, by its number; None where there is none for now."""
        if self.ready:
            return self.ready.popleft()
        survey, windows = self._surveyed_as, self._work_queue.take(worker)
        if survey is None or not windows:
            return None
        return self._measuring(survey, windows, when_lost=partial(self._each_alone, survey, windows))

    @property
    def windows_done(self) -> int:
        """How many windows have been measured, or lost."""
        # A copy of the values: threads of workers add windows while this sums.
        return sum(tuple(self._seen.values()))

    @property
    def share_done(self) -> float:
        """Share of the work that is done: each window counts as one, and so does judgement."""
        return 1.0 if self.run else self.windows_done / (self.windows + 1)

    def _do_in_one(self) -> None:
        """Make the whole file one step for one process; where that process dies, go on step by step."""

        def tell(what: str, done: int, of: int) -> None:
            if what == MEASURING:
                self.windows, self._seen[0] = of, done
            self._tell(what, done, of)

        task = FileTask("check_whole", self.path.absolute(), (self._checks, self._options))
        self.ready.append(WorkStep(task, tell, self._finished, self._do_in_steps, self._give_up_opening))

    def _do_in_steps(self) -> None:
        self._seen.clear()
        task = FileTask("survey_file", self.path.absolute(), (self._checks, self._options))
        self._do(_OPENED, task, self._surveyed)

    def _do(self, doing: str, task: Task[Any], then: Callable[[Any], None]) -> None:
        """Make a task for the whole file ready; where its process dies twice, every check has crashed."""
        once = WorkStep(task, self._tell, then, partial(self._give_up, doing, DIED_TWICE), self._give_up_opening)
        # The first loss makes the same step ready once more; the second gives the file up.
        self.ready.append(replace(once, when_lost=partial(self.ready.append, once)))

    def _give_up_opening(self) -> None:
        self._give_up(_OPENED, ENDLESS)

    def _give_up(self, doing: str, end: str) -> None:
        from fedora_qa.engine.failures import lost_file  # noqa: PLC0415 - loads what measures
        from fedora_qa.engine.run import asked_for  # noqa: PLC0415 - as above

        self.run = lost_file(self.path, asked_for(self._checks, self._options), doing, end)

    def _surveyed(self, survey: Surveyed | FileRun) -> None:
        if isinstance(survey, FileRun):
            self._finished(survey)
            return
        self.windows = survey.windows
        self._work_queue = WorkQueue(survey.windows, self._workers)
        self._surveyed_as = survey
        self._finish_if_measured(survey)

    def _measuring(self, survey: Surveyed, windows: Sequence[int], when_lost: Callable[[], None]) -> WorkStep:
        first = windows[0]
        # A batch that follows a part extends its state: fewer large states have to be merged in the end.
        before = next((part for part in self._parts.values() if part.stop == first), None)
        if before:
            # Taken out, so that no other step extends the same part meanwhile.
            del self._parts[before.start]

        def tell(what: str, done: int, of: int) -> None:
            self._seen[first] = done
            self._tell(what, done, of)

        def measured(part: Sealed[Any]) -> None:
            self._seen[first] = len(windows)
            self._keep(Part(before.start if before else first, windows[-1] + 1, part))
            if before:
                # Not before the extended part has come: a lost step needs the old one again.
                before.sealed_pass.discard()
            self._finish_if_measured(survey)

        def lost() -> None:
            if before:
                self._keep(before)
            when_lost()

        task = FileTask("measure_windows", survey, (before.sealed_pass if before else None,), windows, self._folder)
        return WorkStep(task, tell, measured, lost)

    def _keep(self, part: Part) -> None:
        self._parts[part.start] = part

    def _each_alone(self, survey: Surveyed, windows: Sequence[int]) -> None:
        for window in windows:
            # What the lost batch had reported no longer counts.
            self._seen[window] = 0
            self.ready.append(self._measuring(survey, [window], when_lost=partial(self._lose, survey, window)))

    def _lose(self, survey: Surveyed, window: int) -> None:
        self._seen[window] = 1
        self._lost.append(window)
        self._finish_if_measured(survey)

    def _finish_if_measured(self, survey: Surveyed) -> None:
        if self.windows_done == self.windows:
            parts = [part.sealed_pass for _, part in sorted(self._parts.items())]
            task = FileTask("finish_file", survey, (parts, sorted(self._lost)))
            self._do("being judged", task, self._finished)

    def _finished(self, run: FileRun) -> None:
        # Tasks carry the absolute path; the record states the path that was given.
        self.run = replace(run, record=replace(run.record, path=str(self.path)))
        for part in self._parts.values():
            part.sealed_pass.discard()
        self._parts.clear()
        self._seen = {0: self.windows}

    def _tell(self, what: str, done: int, of: int) -> None:
        self._report(f"{self.path.name}: {what}")

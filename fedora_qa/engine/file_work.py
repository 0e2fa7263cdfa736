"""One file on its way to its record, as steps that can be done anywhere: survey, stretches of windows, judgement."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, Final

from fedora_qa.checks.protocol import Check
from fedora_qa.engine.executors import Task
from fedora_qa.engine.finish import finish_file
from fedora_qa.engine.lost import lost_file
from fedora_qa.engine.measured import STAGE, Measured, measure_windows
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.survey import Survey, survey_file
from fedora_qa.engine.whole import check_whole
from fedora_qa.storage.place import Place

_STRETCHES_PER_WORKER: Final = 2
"""So that the last worker to end does not keep the others waiting for long."""

_FEWEST_WINDOWS: Final = 2
_MOST_WINDOWS: Final = 8
"""In a stretch. What windows share, and what lies around them, is read again at both ends of a stretch; a worker that
dies takes a stretch with it."""


@dataclass(frozen=True, slots=True)
class Step:
    """A task of a file: what it tells, what becomes of its result, and what is done when the process died over it."""

    task: Task[Any]
    progress: Progress
    then: Callable[[Any], None]
    when_lost: Callable[[], None]


class FileWork:
    """One file: the steps that are ready to be done, and in the end its run.

    A step whose process dies is done again once: a stretch of windows each window by itself, so that the one that
    kills costs no other. A single worker does a file in one step.

    Attributes
    ----------
    ready
        Steps that wait for nothing.
    run
        None until the file is done.
    """

    def __init__(
        self,
        path: Place,
        size: int,
        checks: tuple[Check[Any], ...],
        options: CheckOptions,
        workers: int,
        told: Callable[[str], None],
    ) -> None:
        self.path = path
        self.bytes = size
        self.ready: deque[Step] = deque()
        self.run: FileRun | None = None
        self.windows = 0
        self._checks = checks
        self._workers = workers
        self._told = told
        self._parts: dict[int, Measured] = {}
        self._lost: list[int] = []
        self._seen: dict[int, int] = {}
        self._options = options
        if workers == 1:
            self._do_in_one()
        else:
            self._do_in_steps()

    @property
    def windows_done(self) -> int:
        """How many windows have been measured, or lost."""
        return sum(tuple(self._seen.values()))

    @property
    def share_done(self) -> float:
        """Share of the work that is done: each window counts as one, and so does judgement."""
        return 1.0 if self.run else self.windows_done / (self.windows + 1)

    def _do_in_one(self) -> None:
        """Get the whole file done by one process, step by step where that dies over it."""

        def tell(what: str, done: int, of: int) -> None:
            if what == STAGE:
                self.windows, self._seen[0] = of, done
            self._tell(what, done, of)

        task = partial(check_whole, self.path.absolute(), self._checks, self._options)
        self.ready.append(Step(task, tell, self._finished, self._do_in_steps))

    def _do_in_steps(self) -> None:
        self._seen.clear()
        task = partial(survey_file, self.path.absolute(), self._checks, self._options)
        self._do("being opened", task, self._surveyed)

    def _do(self, doing: str, task: Task[Any], then: Callable[[Any], None]) -> None:
        """Get a task done for the whole file; where its process dies twice, every check has crashed."""
        once = Step(task, self._tell, then, partial(self._give_up, doing))
        self.ready.append(replace(once, when_lost=partial(self.ready.append, once)))

    def _give_up(self, doing: str) -> None:
        self.run = lost_file(self.path, self._checks, doing)

    def _surveyed(self, survey: Survey | FileRun) -> None:
        if isinstance(survey, FileRun):
            self._finished(survey)
            return
        self.windows = len(survey.windows)
        for windows in stretches(self.windows, self._workers):
            alone = partial(self._each_alone, survey, windows)
            self.ready.append(self._measuring(survey, windows, when_lost=alone))
        self._finish_if_measured(survey)

    def _measuring(self, survey: Survey, windows: Sequence[int], when_lost: Callable[[], None]) -> Step:
        first = windows[0]

        def tell(what: str, done: int, of: int) -> None:
            self._seen[first] = done
            self._tell(what, done, of)

        def measured(part: Measured) -> None:
            self._seen[first] = len(windows)
            self._parts[first] = part
            self._finish_if_measured(survey)

        return Step(partial(measure_windows, survey, windows), tell, measured, when_lost)

    def _each_alone(self, survey: Survey, windows: Sequence[int]) -> None:
        for window in windows:
            self._seen[window] = 0
            self.ready.append(self._measuring(survey, [window], when_lost=partial(self._lose, survey, window)))

    def _lose(self, survey: Survey, window: int) -> None:
        self._seen[window] = 1
        self._lost.append(window)
        self._finish_if_measured(survey)

    def _finish_if_measured(self, survey: Survey) -> None:
        if self.windows_done == self.windows:
            parts = [part for _, part in sorted(self._parts.items())]
            self._do("being judged", partial(finish_file, survey, parts, sorted(self._lost)), self._finished)

    def _finished(self, run: FileRun) -> None:
        self.run = replace(run, record=replace(run.record, path=str(self.path)))
        self._parts.clear()
        self._seen = {0: self.windows}

    def _tell(self, what: str, done: int, of: int) -> None:
        self._told(f"{self.path.name}: {what}")


def stretches(windows: int, workers: int) -> tuple[Sequence[int], ...]:
    """Deal windows out in stretches that workers can measure by themselves."""
    length = min(max(windows // (_STRETCHES_PER_WORKER * workers), _FEWEST_WINDOWS), _MOST_WINDOWS)
    return equal_parts(windows, -(-windows // length))


def equal_parts(windows: int, count: int) -> tuple[Sequence[int], ...]:
    """Cut windows into neighbouring parts, none of them empty."""
    count = min(count, windows)
    bounds = [windows * number // count for number in range(count + 1)] if count else []
    return tuple(range(start, stop) for start, stop in pairwise(bounds))

"""One file on its way to its record, as tasks for any process: survey, batches of windows, judgement."""

import pickle
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from fedora_qa.engine.executors.executor import (
    CHECK_WHOLE,
    FINISH_FILE,
    MEASURE_WINDOWS,
    SURVEY_FILE,
    Kept,
    Task,
    opening_test,
)
from fedora_qa.engine.options import DIED_TWICE, ENDLESS, CheckOptions, FileRun, lost_file
from fedora_qa.engine.progress import MEASURING, Progress
from fedora_qa.storage.place import Place

if TYPE_CHECKING:  # loads what measures
    from fedora_qa.checks.protocol import Check
    from fedora_qa.engine.survey import Survey

_OPENED: Final = "being opened"

_SHARE: Final = 2 / 3
_FEWEST_WINDOWS: Final = 4
_MOST_WINDOWS: Final = 64
"""Bounds of a batch: share of the windows that are left, and their number. States of windows, some 40 MB at 1440x1080,
are written after each batch and read for the next, which takes as long as two windows there; a worker that dies loses
one batch."""


@dataclass(frozen=True, slots=True)
class PackedSurvey:
    """A survey of a file, pickled, and what deals out its windows.

    Attributes
    ----------
    path
        The file.
    windows
        The windows that are to be measured, as of ``Survey``.
    pickled
        The survey.
    """

    path: Place
    windows: tuple[int, ...]
    pickled: bytes

    @staticmethod
    def of(survey: "Survey") -> "PackedSurvey":
        """Pack a survey."""
        return PackedSurvey(survey.path, survey.windows, pickle.dumps(survey, pickle.HIGHEST_PROTOCOL))

    def load(self) -> "Survey":
        """Return the survey. This takes the process of the command more than a second, and workers nothing."""
        survey: Survey = pickle.loads(self.pickled)
        return survey


@dataclass(frozen=True, slots=True)
class WorkStep:
    """A task of a file, with the calls for its progress, for its result, and for the death of its process.

    ``when_endless`` is called where the file took for ever to open, as it would again; None: ``when_lost`` is called.
    """

    task: Task
    progress: Progress
    then: Callable[[Any], None]
    when_lost: Callable[[], None]
    when_endless: Callable[[], None] | None = None


@dataclass(frozen=True, slots=True)
class Part:
    """The pass over neighbouring windows, from ``start`` up to but without ``stop``."""

    start: int
    stop: int
    states: Kept


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
        None until the file is done, and once it was handed over.
    is_done
        Whether there is, or was, a run.
    """

    def __init__(
        self,
        path: Place,
        size: int,
        checks: "tuple[Check[Any], ...] | None",
        options: CheckOptions,
        workers: int,
        report: Callable[[str], None],
    ) -> None:
        self.path = path
        self.bytes = size
        self.ready: deque[WorkStep] = deque()
        self.run: FileRun | None = None
        self.is_done = False
        self.windows = 0
        # Absolute, because workers may have another working directory.
        self._of_file = (path.absolute(), checks, options)
        self._checks = checks
        self._options = options
        self._workers = workers
        self._report = report
        self._parts: dict[int, Part] = {}
        self._lost: list[int] = []
        # Windows that were measured or lost; and for progress, which may be reported late, so many by first window.
        self._settled = 0
        self._reported: dict[int, int] = {}
        self._survey: PackedSurvey | None = None
        self._kept_survey = Kept()
        self._work_queue = WorkQueue(0, workers)
        begin = self._do_in_one if workers == 1 else self._do_in_steps
        test = opening_test(path, options.dialect, options.allow_external)
        if test:
            self._do(_OPENED, test, lambda _: begin(), partial(self._give_up, _OPENED, ENDLESS))
        else:
            begin()

    def take(self, worker: int) -> WorkStep | None:
        """Return the next step for a worker, by its number; None where there is none for now."""
        if self.ready:
            return self.ready.popleft()
        survey, windows = self._survey, self._work_queue.take(worker)
        if survey is None or not windows:
            return None
        return self._measuring(survey, windows, when_lost=partial(self._each_alone, survey, windows))

    def hand_over(self) -> FileRun:
        """Return the run and forget it: of thousands of files, no evidence lies here any longer.

        Raises
        ------
        ValueError
            The file is not done, or its run was handed over before.
        """
        run, self.run = self.run, None
        if run is None:
            raise ValueError(f"Expected the run of {self.path}, got none; wait until the file is done")
        return run

    @property
    def windows_done(self) -> int:
        """How many windows have been measured, or lost, as far as progress was reported."""
        # A copy of the values: other threads add windows while this sums.
        return min(sum(tuple(self._reported.values())), self.windows)

    @property
    def share_done(self) -> float:
        """Share of the work that is done: each window counts as one, and so does judgement."""
        return 1.0 if self.is_done else self.windows_done / (self.windows + 1)

    def _do_in_one(self) -> None:
        """Make the whole file one step for one process; where that process dies, go on step by step."""

        def tell(what: str, done: int, of: int) -> None:
            if what == MEASURING:
                self.windows, self._reported[0] = of, done
            self._tell(what, done, of)

        task = Task(CHECK_WHOLE, self._of_file)
        self.ready.append(WorkStep(task, tell, self._finished, self._do_in_steps))

    def _do_in_steps(self) -> None:
        self._reported.clear()
        # The survey stays where the tasks are done, which all need it: hundreds of kilobytes for an hour of poses.
        self._do(_OPENED, Task(SURVEY_FILE, self._of_file, keeps_result=True), self._surveyed)

    def _do(
        self,
        doing: str,
        task: Task,
        then: Callable[[Any], None],
        when_endless: Callable[[], None] | None = None,
    ) -> None:
        """Make a task for the whole file ready; where its process dies twice, every check has crashed."""
        once = WorkStep(task, self._tell, then, partial(self._give_up, doing, DIED_TWICE), when_endless)
        # The first loss makes the same step ready once more; the second gives the file up.
        self.ready.append(replace(once, when_lost=partial(self.ready.append, once)))

    def _give_up(self, doing: str, end: str) -> None:
        self._end(lost_file(self.path, self._checks, self._options, doing, end))

    def _surveyed(self, kept: Kept) -> None:
        survey: PackedSurvey | FileRun = kept.load()
        self._kept_survey = kept
        if isinstance(survey, FileRun):
            self._finished(survey)
            return
        self.windows = len(survey.windows)
        self._work_queue = WorkQueue(self.windows, self._workers)
        self._survey = survey
        self._finish_if_measured(survey)

    def _measuring(self, survey: PackedSurvey, windows: Sequence[int], when_lost: Callable[[], None]) -> WorkStep:
        first = windows[0]
        # A batch that follows a part extends its state: fewer large states have to be merged in the end.
        before = next((part for part in self._parts.values() if part.stop == first), None)
        if before:
            # Taken out, so that no other step extends the same part meanwhile.
            del self._parts[before.start]

        def tell(what: str, done: int, of: int) -> None:
            self._reported[first] = done
            self._tell(what, done, of)

        def measured(states: Kept) -> None:
            self._reported[first] = len(windows)
            self._settled += len(windows)
            self._keep(Part(before.start if before else first, windows[-1] + 1, states))
            if before:
                # Not before the extended part has come: a lost step needs the old one again.
                before.states.discard()
            self._finish_if_measured(survey)

        def lost() -> None:
            if before:
                self._keep(before)
            when_lost()

        numbers = [survey.windows[place] for place in windows]
        arguments = (self._kept_survey, numbers, "planned", before.states if before else None)
        task = Task(MEASURE_WINDOWS, arguments, keeps_result=True)
        return WorkStep(task, tell, measured, lost)

    def _keep(self, part: Part) -> None:
        self._parts[part.start] = part

    def _each_alone(self, survey: PackedSurvey, windows: Sequence[int]) -> None:
        for window in windows:
            # What the lost batch had reported no longer counts.
            self._reported[window] = 0
            self.ready.append(self._measuring(survey, [window], when_lost=partial(self._lose, survey, window)))

    def _lose(self, survey: PackedSurvey, window: int) -> None:
        self._reported[window] = 1
        self._settled += 1
        self._lost.append(window)
        self._finish_if_measured(survey)

    def _finish_if_measured(self, survey: PackedSurvey) -> None:
        if self._settled == self.windows:
            lost = [survey.windows[place] for place in sorted(self._lost)]
            parts = [part.states for _, part in sorted(self._parts.items())]
            self._do("being judged", Task(FINISH_FILE, (self._kept_survey, parts, lost)), self._finished)

    def _finished(self, run: FileRun) -> None:
        # Tasks carry the absolute path; the record states the path that was given.
        self._end(replace(run, record=replace(run.record, path=str(self.path))))

    def _end(self, run: FileRun) -> None:
        """Set the run, and drop all that its tasks have needed."""
        self.run, self.is_done = run, True
        for part in self._parts.values():
            part.states.discard()
        self._parts.clear()
        self._kept_survey.discard()
        self._survey, self._kept_survey = None, Kept()
        self._reported = {0: self.windows}

    def _tell(self, what: str, done: int, of: int) -> None:
        self._report(f"{self.path.name}: {what}")


class WorkQueue:
    """The windows of a file that no worker has taken yet, in neighbourhoods."""

    def __init__(self, windows: int, workers: int) -> None:
        self._left: list[Sequence[int]] = list(equal_parts(windows, workers))

    def take(self, worker: int) -> Sequence[int]:
        """Return the next batch for a worker; empty where nothing is left.

        A long neighbourhood is taken in batches of at most two thirds of its rest, so that workers end at nearly the
        same time.
        """
        if worker < len(self._left) and self._left[worker]:
            left = self._left[worker]
            length = _length(left)
            self._left[worker] = left[length:]
            return left[:length]
        longest = max(range(len(self._left)), key=lambda number: len(self._left[number]), default=0)
        if not self._left or not self._left[longest]:
            return ()
        left = self._left[longest]
        length = _length(left)
        # From the far end: its own worker continues at the near end, beside blocks that it has decoded.
        self._left[longest] = left[:-length]
        return left[-length:]


def equal_parts(windows: int, count: int) -> tuple[Sequence[int], ...]:
    """Cut windows into neighbouring parts, none of them empty."""
    count = min(count, windows)
    bounds = [windows * number // count for number in range(count + 1)] if count else []
    return tuple(range(start, stop) for start, stop in pairwise(bounds))


def _length(left: Sequence[int]) -> int:
    return min(max(int(_SHARE * len(left)), _FEWEST_WINDOWS), _MOST_WINDOWS, len(left))

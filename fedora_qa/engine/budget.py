"""Check files within a budget of time: windows are visited in an order that spreads them evenly, while they fit.

Checks that need neither images nor events get every window, first. All others get windows in rounds. After each round
the file is judged by the windows that were visited, so that there is a run at any time, and the duration of judgement
is known from the last one. A round visits at most as many windows again as were visited before, so that all judgements
together take less than three times as long as the last. States of single windows merge exactly in the order of time.

Windows are visited at the density of ``quick`` until all of them fit. Further windows gain at least as much as density
does: half as much time again for every flow field instead of every third lowers the limits of flow by a tenth, half as
many windows again lower all limits by 18% (docs/trade.md). Only then denser efforts are tried, on the least number of
windows, and the first with which all windows fit is chosen.
"""

import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, Final

from fedora_qa.checks.protocol import Check
from fedora_qa.engine.executors.executor import (
    FINISH_FILE,
    MEASURE_WINDOWS,
    SILENCE_S,
    SURVEY_FILE,
    TRAFFIC_OF,
    Executor,
    Kept,
    Task,
    opening_test,
)
from fedora_qa.engine.file_work import PackedSurvey, equal_parts
from fedora_qa.engine.options import DIED_TWICE, ENDLESS, CheckOptions, Effort, FileRun, lost_file
from fedora_qa.engine.plan import FEWEST_WINDOWS, WINDOW_NS, Plan, sampling_of, sees_every_window
from fedora_qa.engine.progress import Progress, ProgressTally, Report, quiet
from fedora_qa.engine.survey import Survey, frame_pixels
from fedora_qa.errors import EndlessError, WorkerLostError
from fedora_qa.storage.place import Place, RemoteFile
from fedora_qa.storage.server import NO_TRAFFIC, Traffic, version_of

_DENSER: Final[tuple[Effort, ...]] = ("full", "standard")

_SNAPSHOTS_OVER: Final = 16
"""Over how many windows, the first in the visiting order, the snapshots of the evidence are spread."""

_LATEST: Final = 8
"""Number of latest windows whose slowest predicts the next one. The first windows, which also load and compile, drop
out of them."""

_DONE: Final = "done"

_SHORTEST_S: Final = 1e-3
"""Seconds that a window takes at least."""


@dataclass(frozen=True, slots=True)
class _LostTask:
    """Stands for the result of a task over which two processes died, or which did not end."""

    end: str


class _GivenUpError(Exception):
    """A file is given up: ``doing`` states the step, ``end`` how its process ended."""

    def __init__(self, doing: str, end: str) -> None:
        super().__init__(doing, end)
        self.doing = doing
        self.end = end


@dataclass(slots=True)
class _Density:
    """The windows of a file at the density of an effort.

    Attributes
    ----------
    pending
        Windows still to be visited, in their order.
    parts
        The passes over visited windows, by their numbers on the grid.
    latest_s
        Seconds of the latest windows.
    """

    effort: Effort
    survey: Survey
    pending: deque[int]
    parts: dict[int, Kept] = field(default_factory=dict)
    lost: list[int] = field(default_factory=list)
    latest_s: deque[float] = field(default_factory=lambda: deque(maxlen=_LATEST))

    @property
    def longest_s(self) -> float:
        """Seconds of the slowest of the latest windows."""
        return max(self.latest_s, default=0.0)

    @property
    def mean_s(self) -> float:
        """Mean seconds of the latest windows."""
        return sum(self.latest_s) / max(len(self.latest_s), 1)

    @property
    def unevenness(self) -> float:
        """How many times slower than their mean the slowest of the latest windows was: 1 where nothing disturbs.

        Another load of the machine, which makes some windows slower, may make judgement slower than the last one.
        """
        return self.longest_s / self.mean_s if self.mean_s else 1.0

    @property
    def visited(self) -> Survey:
        """The survey whose plan is what was visited, or lost."""
        chosen = tuple(sorted({*self.parts, *self.lost}))
        return replace(self.survey, plan=replace(self.survey.plan, chosen=chosen))


def check_within_budget(
    paths: Sequence[Place],
    checks: tuple[Check[Any], ...] | None,
    options: CheckOptions,
    executor: Executor,
    report: Report,
    began: float | None,
) -> Iterator[tuple[Place, FileRun]]:
    """Check files one after another, each in its part of the budget, in proportion to its bytes.

    What a file does not use is left to the files after it. The least number of windows is visited whatever the budget.

    Parameters
    ----------
    options
        With ``budget_s``.
    began
        Since when (``time.monotonic``) the budget counts; now where None.

    Raises
    ------
    FedoraError
        As ``check_files``.
    """
    deadline = (time.monotonic() if began is None else began) + (options.budget_s or 0.0)
    sizes = [version_of(path).size for path in paths]
    windows_before = 0
    for number, path in enumerate(paths):
        left_s = max(0.0, deadline - time.monotonic())
        share = sizes[number] / max(sum(sizes[number:]), 1)

        def tell(
            doing: str, done: int, of: int, number: int = number, path: Place = path, before: int = windows_before
        ) -> None:
            # The file counts as done with its record, and judgement as one more window.
            ended = doing == _DONE
            bytes_done = sum(sizes[:number]) + (sizes[number] if ended else int(sizes[number] * done / (of + 1)))
            doing = f"{path.name}: {doing}"
            report(ProgressTally(doing, number + ended, len(paths), before + done, before + of, bytes_done, sum(sizes)))

        file = _BudgetedFile(path, checks, options, executor, tell, time.monotonic() + share * left_s)
        run = file.check()
        tell(_DONE, file.windows, file.windows)
        windows_before += file.windows
        yield path, run


class _BudgetedFile:
    """One file and its deadline, s on the clock of ``time.monotonic``. ``tell`` gets the windows done, of all.

    Attributes
    ----------
    windows
        How many the file has; 0 until it was surveyed.
    """

    def __init__(
        self,
        path: Place,
        checks: tuple[Check[Any], ...] | None,
        options: CheckOptions,
        executor: Executor,
        tell: Progress,
        deadline: float,
    ) -> None:
        self._path = path
        self._checks = checks
        self._options = options
        self._executor = executor
        self._tell = tell
        self._deadline = deadline
        self.windows = 0
        self._visited = 0
        self._steady: list[Kept] = []
        self._kept: list[Kept] = []
        self._judging_s: list[float] = []
        self._judged_windows = 1
        self._traffic = NO_TRAFFIC

    def check(self) -> FileRun:
        """Return the run of the file by the windows that the budget sufficed for."""
        try:
            run, density = self._checked()
        except _GivenUpError as lost:
            run, density = lost_file(self._path, self._checks, self._options, lost.doing, lost.end), None
        overrun_s = time.monotonic() - self._deadline
        if density is None:
            reached = "the file was given up" if self.windows else "the file cannot be opened"
        else:
            reached = f"{len(density.parts)} of {self.windows} windows at the density of {density.effort}"
            if len(density.parts) <= FEWEST_WINDOWS < self.windows:
                reached += ", the least that is always looked at"
            reached += (
                f", {overrun_s:.1f} s longer than there was" if overrun_s > 0 else f", with {-overrun_s:.1f} s left"
            )
        seconds = {**run.seconds}
        if len(self._judging_s) > 1:
            seconds["rehearsals"] = sum(self._judging_s[:-1])
        self._discard(self._kept)
        traffic = run.traffic if density is None else self._traffic
        # Tasks carry the absolute path; the record states the path that was given.
        record = replace(run.record, path=str(self._path))
        return replace(run, record=record, reached=reached, seconds=seconds, traffic=traffic)

    def _checked(self) -> tuple[FileRun, _Density | None]:
        """Return the last run that was judged, with its density; None where the file cannot be opened."""
        place = self._path.absolute()
        if test := opening_test(place, self._options.dialect, self._options.allow_external):
            self._do(test, "being opened")
        packed = self._do(Task(SURVEY_FILE, (place, self._checks, self._options)), "being opened")
        if isinstance(packed, FileRun):
            return packed, None
        survey: Survey = packed.load()
        self.windows = survey.plan.of
        self._traffic = survey.traffic
        if any(sees_every_window(check.needs) for check in survey.asked):
            # Tasks end in any order; states merge in the order of time.
            parts: dict[int, Kept] = {}
            batches = equal_parts(self.windows, self._executor.capacity)
            tasks = (Task(MEASURE_WINDOWS, (packed, batch, "steady", None), keeps_result=True) for batch in batches)
            for task, part, _ in self._do_all(tasks):
                if isinstance(part, _LostTask):
                    raise _GivenUpError("being measured", part.end)
                parts[task.arguments[1][0]] = part
                self._kept.append(part)
            self._steady = [part for _, part in sorted(parts.items())]
        # Windows shorter than 0.2 s are visited in groups of that length, as neighbours share decoded frames.
        order = visiting_order(self.windows, max(1, WINDOW_NS // survey.scanned.cell_ns))
        density = sparse = self._visit_least(survey, "quick", order)
        run, judged = self._judge(density), density
        settled = False
        while density.pending:
            if not settled and self._fits_whole(sparse):
                settled = True
                for effort in _DENSER:
                    denser = self._visit_least(survey, effort, order)
                    if self._fits_whole(denser):
                        # It was judged, and nothing is added to it.
                        self._discard(tuple(sparse.parts.values()))
                        density = denser
                        break
                    self._discard(tuple(denser.parts.values()))
            # c windows and their judgement fit where  c t / W + u J (n + c) / n <= left,  with t the seconds of the
            # slowest of the latest windows, W the workers, J the seconds of the last judgement, after n windows, and u
            # the unevenness. Judgement has a constant part, so that J (n + c) / n is an upper bound.
            done, left_s = max(len(density.parts), 1), self._deadline - time.monotonic()
            judging_s = density.unevenness * self._judging_s[-1] * done / self._judged_windows
            each_s = density.longest_s / self._executor.capacity + judging_s / done
            count = min(int((left_s - judging_s) / max(each_s, _SHORTEST_S)), done)
            if count < 1 or not self._visit(density, count, self._deadline - judging_s * (done + count) / done):
                break
            try:
                run, judged = self._judge(density), density
            except _GivenUpError:
                # The run by fewer windows stands.
                break
        return run, judged

    def _visit_least(self, survey: Survey, effort: Effort, order: tuple[int, ...]) -> _Density:
        """Visit the least number of windows at the density of an effort."""
        sampling = sampling_of(effort, frame_pixels(survey.scanned.facts.layout))
        plan = Plan(tuple(sorted(order[:_SNAPSHOTS_OVER])), len(order), sampling)
        options = replace(survey.options, effort=effort)
        density = _Density(effort, replace(survey, plan=plan, options=options), deque(order))
        self._visit(density, FEWEST_WINDOWS, until=inf)
        return density

    def _visit(self, density: _Density, count: int, until: float) -> int:
        """Visit the next windows of a density while they end in time; return how many were visited, or lost."""
        number, packed = len(density.pending), PackedSurvey.of(density.survey)

        def tasks() -> Iterator[Task]:
            for _ in range(min(count, len(density.pending))):
                if time.monotonic() + density.longest_s > until:
                    return
                window = density.pending.popleft()
                yield Task(MEASURE_WINDOWS, (packed, (window,), "sampled", None), keeps_result=True)

        for task, part, seconds in self._do_all(tasks()):
            (window,) = task.arguments[1]
            if isinstance(part, _LostTask):
                density.lost.append(window)
            else:
                density.parts[window] = part
                density.latest_s.append(seconds)
                self._kept.append(part)
            # A new density begins with no windows; the progress that is reported does not run backwards.
            self._visited = max(self._visited, len(density.parts))
            self._tell("measuring", self._visited, self.windows)
        return number - len(density.pending)

    def _judge(self, density: _Density) -> FileRun:
        """Return the run of the file by the windows that were visited at a density."""
        began = time.monotonic()
        parts = [*self._steady, *(part for _, part in sorted(density.parts.items()))]
        packed = PackedSurvey.of(density.visited)
        run: FileRun = self._do(Task(FINISH_FILE, (packed, parts, sorted(density.lost))), "being judged")
        self._judging_s.append(time.monotonic() - began)
        self._judged_windows = max(len(density.parts), 1)
        # Its own traffic: that of the survey and of the parts is counted once for all judgements.
        self._traffic += run.traffic - density.survey.traffic - self._traffic_of(parts)
        return run

    def _traffic_of(self, parts: Sequence[Kept]) -> Traffic:
        """Return the requests to a server for passes over windows."""
        if not isinstance(self._path, RemoteFile):
            return NO_TRAFFIC
        try:
            traffic: Traffic = self._do(Task(TRAFFIC_OF, (parts,)), "being judged")
        except _GivenUpError:
            # Only the count is lost: the record stands.
            return NO_TRAFFIC
        return traffic

    def _discard(self, parts: Sequence[Kept]) -> None:
        """Drop passes over windows that are judged no more, after noting their traffic."""
        self._traffic += self._traffic_of(parts)
        for part in parts:
            part.discard()
        self._kept = [part for part in self._kept if part not in parts]

    def _fits_whole(self, density: _Density) -> bool:
        """Whether all windows that wait at a density fit, beside their judgement."""
        measuring_s = density.mean_s * len(density.pending) / self._executor.capacity
        judging_s = density.unevenness * self._judging_s[-1] * self.windows / self._judged_windows
        return time.monotonic() + measuring_s + judging_s <= self._deadline

    def _do(self, task: Task, doing: str) -> Any:
        """Do a task for the whole file, which is given up where that fails."""
        ((_, result, _),) = self._do_all(iter([task]))
        if isinstance(result, _LostTask):
            raise _GivenUpError(doing, result.end)
        return result

    def _do_all(self, tasks: Iterator[Task]) -> Iterator[tuple[Task, Any, float]]:
        """Yield tasks with their results and seconds as they end; one whose process dies is done again once."""
        running: dict[Future[Any], tuple[Task, float, bool]] = {}

        while True:
            while len(running) < self._executor.capacity and (task := next(tasks, None)):
                # An executor in this process does the task here: the clock is read before.
                began = time.monotonic()
                future = self._executor.submit(task, quiet)
                running[future] = task, began, False
            if not running:
                return
            ended, _ = wait(running, timeout=SILENCE_S, return_when=FIRST_COMPLETED)
            if not ended:
                self._executor.require_workers()
            for future in ended:
                task, began, again = running.pop(future)
                try:
                    result = future.result()
                except EndlessError:
                    result = _LostTask(ENDLESS)
                except WorkerLostError:
                    if not again:
                        running[self._executor.submit(task, quiet)] = task, began, True
                        continue
                    result = _LostTask(DIED_TWICE)
                yield task, result, time.monotonic() - began


def visiting_order(windows: int, together: int = 1) -> tuple[int, ...]:
    """Return windows in the order in which they are visited: spread evenly over the file, however early it ends.

    Groups of ``together`` neighbours follow each other in the order of ``_spread``, since neighbouring short windows
    share decoded rows. One window of each of the first ``FEWEST_WINDOWS`` groups comes before all others.

    Returns
    -------
    tuple of int
        The places 0 to ``windows`` - 1, the first and the last first.
    """
    groups = -(-windows // together)
    order: dict[int, None] = {}
    for group in _spread(groups)[:FEWEST_WINDOWS]:
        # Of the last group its last window: the first windows visited shall span the whole sequence.
        order[windows - 1 if 0 < group == groups - 1 else group * together] = None
    for group in _spread(groups):
        order |= dict.fromkeys(range(group * together, min((group + 1) * together, windows)))
    return tuple(order)


def _spread(count: int) -> tuple[int, ...]:
    """Return the numbers 0 to ``count`` - 1: the first, the last, then always numbers between earlier ones.

    They follow the sequence of van der Corput (1935): 1/2, 1/4, 3/4, 1/8, 5/8, ... of the way. After any number of them
    the longest gap is at most twice that of as many places spread evenly, but for rounding.
    """
    order = dict.fromkeys(place for place in (0, count - 1) if 0 <= place < count)
    number = 1
    while len(order) < count:
        # Radical inverse of the number in base 2: the sum of b_k 2^-(k+1) over its binary digits b_k, so that
        # 1, 10, 11 become 0.1, 0.01, 0.11.
        inverse, digit, digits = 0.0, 0.5, number
        while digits:
            inverse += digit * (digits & 1)
            digits >>= 1
            digit /= 2
        # After rounding a number may come again; its first place in the order holds.
        order.setdefault(round(inverse * (count - 1)))
        number += 1
    return tuple(order)

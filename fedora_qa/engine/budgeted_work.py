"""One file on its way to its record within a budget of time: which windows are visited, in which order and density."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from fedora_qa.checks.protocol import Check
from fedora_qa.engine.budget import Pace, Reserve, batch
from fedora_qa.engine.budget_steps import (
    SampledPasses,
    at_density,
    finish_sampled,
    has_steady_checks,
    measure_sampled,
    measure_steady,
    rehearse,
)
from fedora_qa.engine.effort import Effort
from fedora_qa.engine.executors import DIED_TWICE, Result, Task
from fedora_qa.engine.file_task import Surveyed
from fedora_qa.engine.file_work import FileWork, WorkStep
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.partial_pass import PartialPass
from fedora_qa.engine.plan import FEWEST_WINDOWS, Plan, sampling_of
from fedora_qa.engine.prepare import frame_pixels
from fedora_qa.engine.survey import Survey
from fedora_qa.engine.windows import WINDOW_NS
from fedora_qa.engine.work_queue import equal_parts
from fedora_qa.storage.place import Place
from fedora_qa.storage.traffic import NO_TRAFFIC, Traffic

_ANY_TIME: Final = float("inf")

_DENSER: Final[tuple[Effort, ...]] = ("full", "standard")

_SNAPSHOTS_OVER: Final = 16
"""Over how many windows, the first in the visiting order, the snapshots of the evidence are spread."""


def visiting_order(windows: int, together: int = 1) -> tuple[int, ...]:
    """Return windows in the order in which they are visited: spread evenly over the file, however early it ends.

    Groups of ``together`` neighbours follow each other in the order of ``_spread``, since neighbouring short windows
    share decoded rows. One window of each of the first ``FEWEST_WINDOWS`` groups comes before all others.

    Parameters
    ----------
    windows
        How many there are.
    together
        How many neighbours make a group.

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


@dataclass(slots=True, eq=False)
class Density:
    """The density of an effort: windows still to be measured, the passes over the others, and their pace."""

    effort: Effort
    survey: Survey
    pending: deque[int]
    passes: dict[int, PartialPass] = field(default_factory=dict)
    pace: Pace = field(default_factory=Pace)


class Densities:
    """How densely the windows of a file are sampled: the densities that were tried, beginning with the sparsest.

    Further windows gain at least as much as density does: half as much time again for every flow field instead of every
    third lowers the limits of flow by a tenth, half as many windows again lower all limits by 18% (docs/trade.md). So
    the density of ``quick`` holds until all windows fit. Only then denser ones are tried, on the least number of
    windows, and the first with which all windows fit is chosen.

    Attributes
    ----------
    now
        The density at which windows are measured.
    tried
        All of them, that of ``quick`` first.
    """

    def __init__(self, survey: Survey, order: tuple[int, ...]) -> None:
        self._survey = survey
        self._order = order
        self._settled = False
        self.tried: list[Density] = []
        self.now = self._try("quick")

    def changed(self, fits: Callable[[Density], bool]) -> bool:
        """Go to another density, where the present one is not the right one; return whether that was done.

        To be called after the least number of windows. ``fits`` returns whether all windows that are left at a density
        fit into the budget.
        """
        sparse = self.tried[0]
        if self._settled:
            return False
        # Settled for good: each further density would measure its windows anew.
        if self.now is not sparse and fits(self.now):
            self._settled = True
            return False
        untried = [effort for effort in _DENSER if effort not in {density.effort for density in self.tried}]
        before = self.now
        # Denser ones only once all windows fit at the sparsest: windows lower limits more than tiles do.
        self.now = self._try(untried[0]) if untried and fits(sparse) else sparse
        return self.now is not before

    def _try(self, effort: Effort) -> Density:
        sampling = sampling_of(effort, frame_pixels(self._survey.scanned.facts.layout))
        plan = Plan(tuple(sorted(self._order[:_SNAPSHOTS_OVER])), len(self._order), sampling)
        density = Density(effort, at_density(self._survey, plan, effort), deque(self._order))
        self.tried.append(density)
        return density


class BudgetedWork(FileWork):
    """One file: windows are visited in an order that spreads them evenly, for as long as the next one fits.

    The least number of windows is visited whatever the budget. ``allot`` returns the deadline of the file on the clock
    of ``time.monotonic``, s; it is called once the timestamps have been read. Only the process that deals out the steps
    reads this clock for deadlines.
    """

    def __init__(
        self,
        path: Place,
        size: int,
        checks: tuple[Check[Any], ...] | None,
        options: CheckOptions,
        workers: int,
        report: Callable[[str], None],
        folder: Path | None,
        allot: Callable[["BudgetedWork"], float],
    ) -> None:
        self._allot = allot
        self._deadline = 0.0
        self._least = 0
        self._densities: Densities | None = None
        self._reserve = Reserve()
        self._steady: dict[int, PartialPass] = {}
        self._under_way: dict[int, tuple[Density | None, int]] = {}
        self._rehearsing = False
        self._rehearsals_s = 0.0
        self._traffic = NO_TRAFFIC
        super().__init__(path, size, checks, options, workers, report, folder)

    def _do_in_one(self) -> None:
        """Go in steps even with a single worker: the next step is decided between them."""
        self._do_in_steps()

    def _surveyed(self, surveyed: Surveyed | FileRun) -> None:
        if isinstance(surveyed, FileRun):
            self._finished(surveyed)
            return
        survey: Survey = surveyed.survey.open()
        self._deadline = self._allot(self)
        self.windows = survey.plan.of
        self._least = min(FEWEST_WINDOWS, self.windows)
        # Windows shorter than 0.2 s are visited in groups of that length, as neighbours share decoded frames.
        together = max(1, WINDOW_NS // survey.scanned.cell_ns)
        densities = self._densities = Densities(survey, visiting_order(self.windows, together))
        for windows in equal_parts(self.windows, self._workers) if has_steady_checks(survey) else ():
            task = partial(measure_steady, survey, windows)
            self._start(task, partial(self._steady.__setitem__, windows[0]))
        self._go_on(densities)

    def _go_on(self, densities: Densities) -> None:
        """Make steps ready while workers are free, and judge when nothing more fits."""
        while len(self._under_way) < self._workers and self._next_step(densities):
            pass
        if not self._under_way:
            now = densities.now
            # Passes at another density are not judged, but the server was asked for their rows all the same.
            for other in densities.tried:
                if other is not now:
                    self._traffic = sum((part.traffic for part in other.passes.values()), self._traffic)
            passes = SampledPasses(self._steady_parts(), now.passes)
            # A window that was lost at one density may have been measured at another.
            lost = sorted(set(self._lost) - now.passes.keys())
            self._do("being judged", partial(finish_sampled, self._visited(now), passes, lost), self._finished)

    def _next_step(self, densities: Densities) -> bool:
        """Make the next step ready; False where there is none for now."""
        now, left_s = densities.now, self._deadline - time.monotonic()
        soon = len(now.passes) + sum(windows for density, windows in self._under_way.values() if density is now)
        # The least number is measured whatever the budget (docs/efforts.md).
        if soon < self._least and now.pending:
            self._measure(now, [now.pending.popleft()], _ANY_TIME)
            return True
        reserve_is_measured = self._reserve.is_known
        # What fits cannot be estimated before the least windows have been measured and judgement has been rehearsed.
        if len(now.passes) < self._least or (self._under_way and not reserve_is_measured):
            return False
        # Once the reserve is measured, a rehearsal only serves windows that are still to come.
        worthwhile = not self._rehearsing and (now.pending or not reserve_is_measured)
        if worthwhile and self._reserve.is_due(len(now.passes), now.pace, left_s):
            began, windows = time.monotonic(), len(now.passes)

            def rehearsed(traffic: Traffic) -> None:
                took_s = time.monotonic() - began
                self._reserve.add(windows, took_s)
                self._rehearsals_s += took_s
                self._traffic += traffic
                self._rehearsing = False

            self._rehearsing = True
            # A copy of the mapping: steps that end meanwhile add passes to it.
            passes = SampledPasses(self._steady_parts(), dict(now.passes))
            self._start(partial(rehearse, self._visited(now), passes), rehearsed)
            return True
        if not reserve_is_measured:
            return False
        if densities.changed(partial(self._fits, left_s)):
            return self._next_step(densities)
        # Time is kept back for judging one window more than are under way; the load that slowed the slowest window may
        # slow judgement as well. As many windows are measured as fit into the rest.
        left_s -= now.pace.unevenness * self._reserve.seconds(soon + 1)
        count = batch(left_s, now.pace, len(now.pending), self._workers)
        if count:
            self._measure(now, [now.pending.popleft() for _ in range(count)], left_s)
        return bool(count)

    def _fits(self, left_s: float, density: Density) -> bool:
        """Whether all windows that wait at a density fit, beside the reserve that they will need."""
        needed_s = density.pace.mean_s * len(density.pending) / self._workers
        return needed_s + density.pace.unevenness * self._reserve.seconds(self.windows) <= left_s

    def _measure(self, now: Density, windows: Sequence[int], allowed_s: float) -> None:
        began = time.monotonic()

        def measured(passes: dict[int, PartialPass]) -> None:
            # Windows that did not fit return to the front, so that those visited stay evenly spread.
            now.pending.extendleft(reversed([window for window in windows if window not in passes]))
            now.passes.update(passes)
            now.pace.add(len(passes), time.monotonic() - began)
            # A new density starts with no windows; the progress that is reported shall not run backwards.
            self._seen = {0: max(self.windows_done, len(now.passes))}

        def each_by_itself() -> None:
            for window in windows:
                # One window a step: the one that ends its process is then lost alone.
                alone = partial(measure_sampled, now.survey, (window,), _ANY_TIME)
                self._start(alone, now.passes.update, partial(self._lost.append, window), now, 1)

        task = partial(measure_sampled, now.survey, tuple(windows), allowed_s)
        self._start(task, measured, each_by_itself, now, len(windows))

    def _visited(self, density: Density) -> Survey:
        """Return the survey whose plan is what was visited, or lost."""
        chosen = tuple(sorted({*density.passes, *self._lost}))
        return at_density(density.survey, replace(density.survey.plan, chosen=chosen), density.effort)

    def _steady_parts(self) -> tuple[PartialPass, ...]:
        return tuple(part for _, part in sorted(self._steady.items()))

    def _start(
        self,
        task: Task[Result],
        then: Callable[[Result], None],
        when_lost: Callable[[], None] | None = None,
        density: Density | None = None,
        windows: int = 0,
    ) -> None:
        """Make a step ready, which is under way until it has ended; a lost one is repeated without ``when_lost``."""
        # The identity stays unique while ``lost`` below refers to the task.
        key = id(task)
        self._under_way[key] = (density, windows)

        def ended(result: Result) -> None:
            del self._under_way[key]
            then(result)
            if self._densities:
                self._go_on(self._densities)

        def lost() -> None:
            del self._under_way[key]
            if when_lost is not None:
                when_lost()
            else:
                self._start(task, then, partial(self._give_up, "being measured", DIED_TWICE))
            if self._densities and not self.run:
                self._go_on(self._densities)

        self.ready.append(WorkStep(task, self._tell, ended, lost))

    def _finished(self, run: FileRun) -> None:
        seconds = {**run.seconds, "rehearsals": self._rehearsals_s} if self._rehearsals_s else run.seconds
        # How many windows the budget sufficed for.
        if self._densities is None:
            reached = "the file cannot be opened"
        else:
            now, overrun_s = self._densities.now, time.monotonic() - self._deadline
            reached = f"{len(now.passes)} of {self.windows} windows at the density of {now.effort}"
            if len(now.passes) <= self._least < self.windows:
                reached += ", the least that is always looked at"
            reached += (
                f", {overrun_s:.1f} s longer than there was" if overrun_s > 0 else f", with {-overrun_s:.1f} s left"
            )
        super()._finished(replace(run, reached=reached, seconds=seconds, traffic=run.traffic + self._traffic))

"""How densely the windows of a file are sampled within a budget of time.

Further windows gain at least as much as density does: half as much time again for every flow field instead of every
third lowers the limits of flow by a tenth, half as many windows again lower all limits by 18% (docs/trade.md). So the
density of ``quick`` holds until all windows fit. Only then denser ones are tried, on the least number of windows, and
the first with which all windows fit is chosen.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from fedora_qa.engine.budget import Pace
from fedora_qa.engine.budget_steps import at_density
from fedora_qa.engine.effort import Effort
from fedora_qa.engine.partial_pass import PartialPass
from fedora_qa.engine.plan import Plan, sampling_of
from fedora_qa.engine.prepare import frame_pixels
from fedora_qa.engine.survey import Survey

_DENSER: Final[tuple[Effort, ...]] = ("full", "standard")

_MOMENTS_OVER: Final = 16
"""Over how many windows, the first in the visiting order, the snapshots of the evidence are spread."""


@dataclass(slots=True, eq=False)
class Density:
    """The density of an effort: windows still to be measured, the passes over the others, and their pace."""

    effort: Effort
    survey: Survey
    pending: deque[int]
    passes: dict[int, PartialPass] = field(default_factory=dict)
    pace: Pace = field(default_factory=Pace)


class Densities:
    """The densities that were tried, beginning with the sparsest.

    Attributes
    ----------
    now
        The one at which windows are measured.
    tried
        All of them, that of ``quick`` first.
    """

    def __init__(self, survey: Survey, order: tuple[int, ...]) -> None:
        self._survey = survey
        self._order = order
        self._settled = False
        self.tried: list[Density] = []
        self.now = self._look("quick")

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
        self.now = self._look(untried[0]) if untried and fits(sparse) else sparse
        return self.now is not before

    def _look(self, effort: Effort) -> Density:
        sampling = sampling_of(effort, frame_pixels(self._survey.scanned.facts.layout))
        plan = Plan(tuple(sorted(self._order[:_MOMENTS_OVER])), len(self._order), sampling)
        density = Density(effort, at_density(self._survey, plan, effort), deque(self._order))
        self.tried.append(density)
        return density

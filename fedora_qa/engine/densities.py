"""How densely the windows of a file are looked at within a budget of time.

A window more is worth at least what density is: half as much time again for every flow field instead of every third
lowers the limits of flow by a tenth, half as many windows again lower all limits by 18% (docs/trade.md). So the density
of ``quick`` is kept until all windows fit. Only then denser ones are tried, on as few windows as are always looked at,
and the first with which all windows fit is kept.
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
"""Over how many windows, the first in the order, the moments of the evidence are spread."""


@dataclass(slots=True, eq=False)
class Density:
    """The density of an effort: the windows that wait for it, what the others have shown, and how fast that goes."""

    effort: Effort
    survey: Survey
    pending: deque[int]
    passes: dict[int, PartialPass] = field(default_factory=dict)
    pace: Pace = field(default_factory=Pace)


class Densities:
    """The densities that were tried, from the sparsest on.

    Attributes
    ----------
    now
        The one at which windows are looked at.
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
        """Go to another density, where that of now is not the right one; whether that was done.

        Ask after the least number of windows. ``fits`` says whether all windows that wait at a density fit.
        """
        sparse = self.tried[0]
        if self._settled:
            return False
        if self.now is not sparse and fits(self.now):
            self._settled = True
            return False
        untried = [effort for effort in _DENSER if effort not in {density.effort for density in self.tried}]
        before = self.now
        self.now = self._look(untried[0]) if untried and fits(sparse) else sparse
        return self.now is not before

    def _look(self, effort: Effort) -> Density:
        sampling = sampling_of(effort, frame_pixels(self._survey.scanned.facts.layout))
        plan = Plan(tuple(sorted(self._order[:_MOMENTS_OVER])), len(self._order), sampling)
        density = Density(effort, at_density(self._survey, plan, effort), deque(self._order))
        self.tried.append(density)
        return density

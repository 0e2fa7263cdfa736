"""What the study measures: what an effort costs, how far a budget carries, where a fault is found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fedora_qa.engine.options import Effort


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor seconds of reading and of checking one clean file, its verdict, and checks that saw too little.

    ``seen`` has the share of the rows of frames, depth, events and flow that lie in the windows of an effort.
    """

    scene: str
    effort: str
    reading_s: float
    checking_s: float
    decoded_bytes: float
    window_share: float
    tile_share: float
    seen: Mapping[str, float]
    verdict: str
    blind: float

    @property
    def ratio(self) -> float:
        """Seconds of checking in units of those of reading."""
        return self.checking_s / self.reading_s


@dataclass(frozen=True, slots=True)
class Reach:
    """How many windows of a clean sequence a budget of time reached, and how densely they were looked at."""

    scene: str
    budget: str
    density: Effort
    windows: int
    of: int
    reading_s: float

    @property
    def ratio(self) -> float:
        """The budget in units of the time that reading takes."""
        return float(self.budget.removesuffix("s")) / self.reading_s


@dataclass(frozen=True, slots=True)
class Found:
    """One planted fault, and at which efforts and budgets it was found."""

    name: str
    scene: str
    number: int
    times_limit: float
    magnitude: float
    unit: str
    seen: Mapping[str, bool]


def mean_cost(costs: Sequence[Cost], effort: str) -> Cost:
    """Sum of the costs of an effort over the scenes; shares are means."""
    of = [cost for cost in costs if cost.effort == effort]
    return Cost(
        "all",
        effort,
        sum(cost.reading_s for cost in of),
        sum(cost.checking_s for cost in of),
        sum(cost.decoded_bytes for cost in of),
        sum(cost.window_share for cost in of) / len(of),
        sum(cost.tile_share for cost in of) / len(of),
        {stream: sum(cost.seen[stream] for cost in of) / len(of) for stream in of[0].seen},
        ", ".join(sorted({cost.verdict for cost in of})),
        sum(cost.blind for cost in of),
    )


def mean_reach(reached: Sequence[Reach], budget: str) -> Reach:
    """Return the sum of what a budget reached over the scenes, its reading the mean of them."""
    of = [reach for reach in reached if reach.budget == budget]
    return replace(
        of[0],
        scene="all",
        windows=sum(reach.windows for reach in of),
        of=sum(reach.of for reach in of),
        reading_s=sum(reach.reading_s for reach in of) / len(of),
    )

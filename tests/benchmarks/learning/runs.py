"""The runs of the study: what is trained, on which data, from which seed; and which part of the study asks for it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

from tests.benchmarks.learning.budget import FLIGHT_S, Budget
from tests.benchmarks.learning.flights import MOTION_KINDS, MotionKind
from tests.benchmarks.learning.planted import PLANTED, PlantedFault

RATES_HZ: Final = (10, 25, 50)
"""Rates of the paper; the first is that of everything but part a."""

Sampling = Literal["iso-time", "iso-sample"]
Part = Literal["a", "b", "c", "price"]

PARTS: Final[tuple[Part, ...]] = ("a", "b", "c", "price")


@dataclass(frozen=True, slots=True)
class Arrangement:
    """The data of a run.

    Attributes
    ----------
    kind
        Of the flights that are trained on.
    rate_hz
        Of the flow.
    sampling
        ``iso-time``: every interval of every flight. ``iso-sample``: as many as there are at the lowest rate, the first
        of each flight, so that a higher rate covers less time. At the lowest rate both are the same.
    fault
        In the flights for training and validation; None: correct data.
    """

    kind: MotionKind
    rate_hz: int = RATES_HZ[0]
    sampling: Sampling = "iso-time"
    fault: PlantedFault | None = None

    @property
    def name(self) -> str:
        """Beginning of the names of its runs."""
        return f"{self.kind}-{self.rate_hz}hz-{self.sampling}-{self.fault.name if self.fault else 'correct'}"

    @property
    def most(self) -> int | None:
        """Intervals of each flight that are trained on; None: all."""
        return round(FLIGHT_S * RATES_HZ[0]) if self.sampling == "iso-sample" else None

    @property
    def tested_on(self) -> tuple[MotionKind, ...]:
        """Kinds of the test flights: both for the cross-tests, else the kind that is trained on."""
        return MOTION_KINDS if self.fault is None and self.rate_hz == RATES_HZ[0] else (self.kind,)


@dataclass(frozen=True, slots=True)
class TrainingRun:
    """One network."""

    arrangement: Arrangement
    seed: int

    @property
    def name(self) -> str:
        """Name of its result."""
        return f"{self.arrangement.name}-seed{self.seed}"


def arrangements_of(part: Part) -> tuple[Arrangement, ...]:
    """Return what a part trains on. Parts share runs, which are done once."""
    if part == "a":
        higher = [
            Arrangement("flying", rate, sampling) for sampling in ("iso-time", "iso-sample") for rate in RATES_HZ[1:]
        ]
        return (Arrangement("flying"), *higher)
    if part in ("b", "c"):
        return tuple(Arrangement(kind) for kind in MOTION_KINDS)
    return (Arrangement("flying"), *(Arrangement("flying", fault=fault) for fault in PLANTED))


def runs_of(part: Part, budget: Budget) -> Iterator[tuple[TrainingRun, ...]]:
    """Yield the runs of each arrangement of a part."""
    for arrangement in arrangements_of(part):
        seeds = budget.control_seeds if part == "price" and arrangement.fault is None else budget.seeds
        yield tuple(TrainingRun(arrangement, seed) for seed in range(seeds))

"""How much is generated and trained: three budgets, everything else is fixed."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

COLOUR_SIZE: Final = (144, 108)
"""Width and height of depth and flow, px; the event camera then has 64x48 pixels, 4/9 of it."""
EVENT_SIZE: Final = (64, 48)
FLIGHT_S: Final = 1.0
BINS: Final = 5
"""Bins of a voxel grid."""
BATCH: Final = 8
"""Samples of a step of the optimiser."""


@dataclass(frozen=True, slots=True)
class Budget:
    """Sizes of a study.

    Attributes
    ----------
    train, validation, test
        Flights of each kind.
    steps, evaluate_every, patience
        Most steps of the optimiser; the loss of the validation flights is taken every so many steps, and training stops
        when it has not fallen for ``patience`` times.
    seeds
        Runs of each arrangement, which differ in initial weights, order of samples and flips.
    control_seeds
        Runs on correct data that the faults are held against.
    """

    train: int
    validation: int
    test: int
    steps: int
    evaluate_every: int
    patience: int
    seeds: int
    control_seeds: int


BUDGETS: Final[Mapping[str, Budget]] = MappingProxyType(
    {
        "smoke": Budget(3, 1, 1, steps=12, evaluate_every=6, patience=2, seeds=2, control_seeds=2),
        "small": Budget(32, 6, 6, steps=300, evaluate_every=50, patience=4, seeds=3, control_seeds=6),
        "full": Budget(128, 16, 24, steps=3000, evaluate_every=200, patience=6, seeds=5, control_seeds=12),
    }
)

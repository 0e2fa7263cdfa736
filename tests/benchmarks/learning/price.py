"""What a fault costs: errors after training on faulty data less those after training on correct data.

Runs differ by their seed. All faults are held against the same runs on correct data, so the intervals are those of
Dunnett: with the stated confidence all of them hold together, for one error measure.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import dunnett, t

from fedora_qa.judgement.materiality import materiality_row
from tests.benchmarks.learning.planted import PlantedFault

CONFIDENCE: Final = 0.95
METRICS: Final[Mapping[str, str]] = {
    "naee": "NAEE",
    "nade": "NADE",
    "nae_position": "NAE, position",
    "nae_orientation": "NAE, orientation",
}
"""Error measures by their field in a result, with their names."""

_TABLE_UNITS: Final[Mapping[str, tuple[str, ...]]] = {"percent": ("percent", "%"), "events": ("1",), "": ("1",)}
"""Units that materiality.toml has for the units of faults, where they differ."""

_SEED: Final = 1
"""Dunnett's intervals are integrated by quasi-random points."""


@dataclass(frozen=True, slots=True)
class Cost:
    """The cost of a fault in one error measure, with its simultaneous interval."""

    cost: float
    low: float
    high: float

    @property
    def leaves_noise(self) -> bool:
        """Whether the fault makes the error larger, beyond the scatter of the seeds."""
        return self.low > 0


def costs_of(correct: Sequence[float], faulty: Mapping[str, Sequence[float]]) -> dict[str, Cost]:
    """Return the cost of each fault.

    Parameters
    ----------
    correct
        Errors of the runs on correct data, at least two.
    faulty
        Errors of the runs with each fault, at least two each.

    Notes
    -----
    C. W. Dunnett, A multiple comparison procedure for comparing several treatments with a control, J. American
    Statistical Association 50, 1955. It pools the variance of all groups.
    """
    if not faulty:
        return {}
    result = dunnett(*faulty.values(), control=correct, random_state=np.random.default_rng(_SEED))
    interval = result.confidence_interval(CONFIDENCE)
    return {
        name: Cost(float(np.mean(values) - np.mean(correct)), float(low), float(high))
        for (name, values), low, high in zip(faulty.items(), interval.low, interval.high, strict=True)
    }


def least_costly_size(costs: Mapping[float, Cost]) -> float | None:
    """Return the size from which on every planted size costs beyond the noise; None where the largest does not."""
    least = None
    for size in sorted(costs, reverse=True):
        if not costs[size].leaves_noise:
            break
        least = size
    return least


def mean_interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the mean of some runs, and half the width of its interval by Student's t; NaN for a single run.

    Both are NaN without any.
    """
    if not values:
        return float("nan"), float("nan")
    mean = float(np.mean(values))
    if len(values) < 2:
        return mean, float("nan")
    half = float(t.ppf(0.5 + CONFIDENCE / 2, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values)))
    return mean, half


def material_size(fault: PlantedFault) -> tuple[str, float] | None:
    """Return the code and material size of the profile ``training`` that a fault is held against; 0: every deviation.

    None where the table has no size of that kind in the unit of the fault.
    """
    for code in fault.codes:
        for unit in _TABLE_UNITS.get(fault.unit, (fault.unit,)):
            row = materiality_row(code, unit)
            if row is not None:
                return code, 0.0 if row.exact else row.training
    return None

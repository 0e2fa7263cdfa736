"""Whether correct files alarm as rarely as is said, and whether standard errors are as large as the scatter."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import binom, binomtest, norm

from tests.benchmarks.false_alarms.checked import Checked

CONFIDENCE: Final = 0.99
LEVELS: Final = (1e-2, 1e-3)


@dataclass(frozen=True, slots=True)
class Share:
    """``count`` of ``of``, beside the rate that is claimed."""

    count: int
    of: int
    rate: float

    @property
    def interval(self) -> tuple[float, float]:
        """Clopper and Pearson's interval of the true rate (Biometrika 26, 1934)."""
        found = binomtest(self.count, self.of).proportion_ci(CONFIDENCE, method="exact")
        return float(found.low), float(found.high)

    @property
    def most(self) -> int:
        """The most that the claimed rate gives with probability CONFIDENCE."""
        return int(binom.ppf(CONFIDENCE, self.of, self.rate))

    @property
    def agrees(self) -> bool:
        """Whether there are no more than the claimed rate gives."""
        return self.count <= self.most


@dataclass(frozen=True, slots=True)
class Calibration:
    """Pulls of one measurement over many files."""

    name: str
    pulls: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Mean pull: a bias, in standard errors."""
        return float(np.mean(self.pulls))

    @property
    def spread(self) -> float:
        """Standard deviation of the pulls; 1 where standard errors are right."""
        return float(np.std(self.pulls, ddof=1))

    @property
    def spread_error(self) -> float:
        """Standard error of the spread of as many Gaussian values."""
        return self.spread / (2.0 * (len(self.pulls) - 1)) ** 0.5

    def beyond(self, level: float) -> Share:
        """Pulls that an correct Gaussian value exceeds with probability ``level``."""
        z = norm.isf(level / 2)
        return Share(int(np.sum(np.abs(self.pulls) > z)), len(self.pulls), level)


def alarms(files: Sequence[Checked], rate: float) -> Share:
    """Files that failed a check, or crashed one."""
    return Share(sum(bool(one.alarms) for one in files), len(files), rate)


def calibrations(files: Iterable[Checked], least_files: int) -> tuple[Calibration, ...]:
    """Pulls by measurement, of those that at least ``least_files`` files have."""
    pulls: dict[str, list[float]] = defaultdict(list)
    for one in files:
        for pull in one.pulls:
            pulls[pull.name].append(pull.pull)
    return tuple(Calibration(name, tuple(found)) for name, found in pulls.items() if len(found) >= least_files)

"""How far an honest value may lie from what is expected, and the least deviation that would be seen.

All comparisons made on one file share one false-alarm budget alpha. With n comparisons, each is held to alpha/n
(Bonferroni: valid whatever their dependence), two-sided, so that an honest Gaussian value with standard error s and a
model error of at most ``allowance`` exceeds::

    limit = allowance + z s,      z = Phi^-1(1 - alpha / (2 n))

with probability at most alpha/n. A deviation d is seen with probability ``power`` when d >= limit + z_power s, less
the worst case in which the model error works against it.
"""

from dataclasses import dataclass

from scipy.stats import norm

DEFAULT_FALSE_ALARM_RATE = 1e-4
DEFAULT_POWER = 0.95


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The multiple of the standard error at which a value is out of order, and at which a fault is surely seen."""

    z_limit: float
    z_power: float

    def limit(self, standard_error: float, allowance: float) -> float:
        """Return the largest deviation that an honest value has."""
        return allowance + self.z_limit * standard_error

    def least_detectable(self, standard_error: float, allowance: float, resolution: float) -> float:
        """Return the least deviation that would have been seen with the stated power."""
        return self.limit(standard_error, allowance) + max(self.z_power * standard_error, resolution)


def tolerance_for(comparisons: int, false_alarm_rate: float, power: float = DEFAULT_POWER) -> Tolerance:
    """Return the tolerance when a file's false-alarm rate is shared by a number of comparisons.

    Raises
    ------
    ValueError
        The rate or the power is not between 0 and 1.
    """
    if not 0 < false_alarm_rate < 1 or not 0 < power < 1:
        raise ValueError(f"Expected rates between 0 and 1, got {false_alarm_rate} and {power}")
    share = false_alarm_rate / max(comparisons, 1)
    return Tolerance(z_limit=float(norm.isf(share / 2)), z_power=float(norm.isf(1 - power)))

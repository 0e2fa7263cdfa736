"""How far a correct value may lie from what is expected, and the least deviation that would be detected.

All comparisons made on one file share one false-alarm budget alpha. With n comparisons, each is held to alpha/n
(Bonferroni: valid whatever their dependence), two-sided, so that a correct Gaussian value with standard error s and a
model error of at most ``bound`` exceeds::

    limit = bound + z s,      z = Phi^-1(1 - alpha / (2 n))

with probability at most alpha/n. A value that is the worst of m is m of the n comparisons: by the union bound the worst
exceeds with probability at most m alpha/n. Where only one side counts, the probability is at most half of that.

A fault of size d gives the value d + b + s e, with e standard normal and a model error b of which only |b| <= bound
is known: what may look like a fault may as well hide one. It exceeds the limit with probability ``power`` or more,
whatever b is, from that d on which does so for b = -bound::

    d - bound = limit + z_power s,      least = 2 bound + (z + z_power) s,      z_power = Phi^-1(power)

A value that moves in steps (a count) must also move by one whole step to leave the limit.
"""

from dataclasses import dataclass

from fedora_qa.estimators.fitting.tails import normal_beyond

DEFAULT_POWER = 0.95


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The multiple of the standard error at which a value exceeds its limit, and that of the detection power."""

    z_limit: float
    z_power: float

    def limit(self, standard_error: float, model_error_bound: float) -> float:
        """Return the largest deviation of a correct value, in the unit of its standard error."""
        # The first equation of the module's docstring.
        return model_error_bound + self.z_limit * standard_error

    def least_detectable(self, standard_error: float, model_error_bound: float, resolution: float) -> float:
        """Return the least fault that would have been detected with the stated power, whichever way the model errs."""
        return (  # the last equation of the module's docstring
            self.limit(standard_error, model_error_bound)
            + model_error_bound
            + max(self.z_power * standard_error, resolution)
        )


def tolerance_for(comparisons: int, false_alarm_rate: float, power: float = DEFAULT_POWER) -> Tolerance:
    """Return the tolerance when a file's false-alarm rate is shared by a number of comparisons.

    Parameters
    ----------
    comparisons
        Number of comparisons that share the rate.
    false_alarm_rate
        Probability that a correct file fails.
    power
        Probability with which the least detectable fault is detected.

    Raises
    ------
    ValueError
        The rate or the power is not between 0 and 1.
    """
    if not 0 < false_alarm_rate < 1 or not 0 < power < 1:
        raise ValueError(f"Expected rates between 0 and 1, got {false_alarm_rate} and {power}")
    rate_of_comparison = false_alarm_rate / max(comparisons, 1)  # Bonferroni
    # Two-sided limit: half of the rate in each tail. A fault moves the value in one direction: one tail of 1 - power.
    return Tolerance(z_limit=normal_beyond(rate_of_comparison / 2), z_power=normal_beyond(1 - power))

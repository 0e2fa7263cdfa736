"""The largest deviation of a correct value (limit), and the least deviation that would be detected (detection limit).

All comparisons of one file share one false-alarm rate alpha. With n comparisons each gets the rate alpha / n
(Bonferroni), which holds for any dependence between the comparisons. The limit is two-sided::

    limit = bound + z s,      z = Phi^-1(1 - alpha / (2 n))

A correct Gaussian value with standard error s and a model error of at most ``bound`` exceeds the limit with a
probability of at most alpha / n. A value that is the worst of m counts as m of the n comparisons: by the union bound it
exceeds the limit with a probability of at most m alpha / n. Where only one side counts, the probability is at most half
of that.

A fault of size d gives the value d + b + s e, with e standard normal and an unknown model error b, |b| <= bound. A
model error can imitate a fault or compensate one. The worst case is b = -bound. For every b the value exceeds the limit
with a probability of at least ``power`` if::

    d - bound >= limit + z_power s,      least = 2 bound + (z + z_power) s,      z_power = Phi^-1(power)

A value that changes in steps (a count) must also change by at least one whole step to exceed the limit.
"""

from dataclasses import dataclass

from fedora_qa.estimators.fitting.tails import normal_beyond

# Probability with which a deviation of the size of the detection limit is detected.
DEFAULT_POWER = 0.95


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Multiples of the standard error that limits and detection limits consist of.

    Attributes
    ----------
    z_limit
        Largest deviation of a correct value without model error, in standard errors.
    z_power
        Distance from the limit at which a deviation is detected with the stated power, in standard errors.
    """

    z_limit: float
    z_power: float

    def limit(self, standard_error: float, model_error_bound: float) -> float:
        """Return the largest deviation of a correct value.

        Parameters
        ----------
        standard_error
            Of the value, in its unit, under the noise model of a correct file.
        model_error_bound
            Bound on the systematic error of the method, in the unit of the value.

        Returns
        -------
        float
            In the unit of the value.
        """
        # limit = bound + z s
        return model_error_bound + self.z_limit * standard_error

    def least_detectable(self, standard_error: float, model_error_bound: float, resolution: float) -> float:
        """Return the least fault that would have been detected with the stated power, for any model error.

        Parameters
        ----------
        standard_error
            Of the value, in its unit, under the noise model of a correct file.
        model_error_bound
            Bound on the systematic error of the method, in the unit of the value.
        resolution
            Least step by which the value can change, in its unit: 1 for a count, 0 where it is continuous.

        Returns
        -------
        float
            In the unit of the value.
        """
        return (  # least = 2 bound + (z + z_power) s, beyond the limit by at least one step
            self.limit(standard_error, model_error_bound)
            + model_error_bound
            + max(self.z_power * standard_error, resolution)
        )


def tolerance_for(comparisons: int, false_alarm_rate: float, power: float = DEFAULT_POWER) -> Tolerance:
    """Return the tolerance of each comparison where comparisons share the false-alarm rate of a file.

    Parameters
    ----------
    comparisons
        Number of comparisons that share the rate; 0 counts as 1.
    false_alarm_rate
        Probability that a correct file fails, between 0 and 1.
    power
        Probability with which the least detectable fault is detected, between 0 and 1.

    Returns
    -------
    Tolerance
        The same for all comparisons.

    Raises
    ------
    ValueError
        If the rate or the power is not between 0 and 1.
    """
    if not 0 < false_alarm_rate < 1 or not 0 < power < 1:
        raise ValueError(f"Expected rates between 0 and 1, got {false_alarm_rate} and {power}")
    rate_of_comparison = false_alarm_rate / max(comparisons, 1)  # Bonferroni
    # z = Phi^-1(1 - alpha / (2 n)): two-sided, half of the rate in each tail. z_power = Phi^-1(power): a fault changes
    # the value in one direction.
    return Tolerance(z_limit=normal_beyond(rate_of_comparison / 2), z_power=normal_beyond(1 - power))

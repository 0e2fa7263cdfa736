"""Mean error of samples that were rounded to a step while they hardly changed.

Rounding x to multiples of a step s errs by a sawtooth of x, ``e(x) = s/pi sum_k (-1)^k/k sin(2 pi k x / s)``. Its mean
over samples is the characteristic function of their values at the frequencies k / s, and Gaussian noise of standard
deviation sigma multiplies each term by ``exp(-2 pi^2 k^2 sigma^2 / s^2)`` (B. Widrow, I. Kollar, Quantization Noise,
Cambridge 2008, chapters 3 and 4). So samples that move by several steps, or have noise of half a step, average the
error out; constant ones keep one error, half a step at most.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

_HARMONICS: Final = 8
"""Terms of the sawtooth that are summed. The others have ``6 / pi^2 sum_(k > 8) 1/k^2 = 7%`` of the variance of
rounding, alternate from sample to sample, and are part of its white noise."""


def mean_rounding_bound(values: Float64, step: float, noise: float) -> float:
    """Return a bound on the mean error of samples that were rounded to a step.

    The phases of the terms against each other are taken as the worst ones, as values are known to a step only. Values
    that stay within a step give the bound of half a step.

    Parameters
    ----------
    values
        (n,) a smooth course of the samples, as their moving mean.
    step
        Step, in the unit of the values; 0 where they were not rounded.
    noise
        Standard deviation of the Gaussian noise that the samples had before they were rounded, in the same unit.

    Returns
    -------
    float
        In the unit of the values.
    """
    if step <= 0 or not len(values):
        return 0.0
    k = np.arange(1, _HARMONICS + 1)
    shares = np.abs(np.exp(2j * np.pi * k[:, None] * (values / step)).mean(axis=1))
    # |mean e| <= s/pi sum_k 1/k |phi(2 pi k / s)| exp(-2 pi^2 k^2 sigma^2 / s^2), and s/2.
    terms = shares / k * np.exp(-2 * np.square(np.pi * k * noise / step))
    return min(step / 2, step / np.pi * float(terms.sum()))

"""Probability of detection against the size of a fault.

Model: a fault of size m is found with probability Phi(a + b ln m), b > 0. Without a fault nothing is found: false
alarms, 1e-4 a file, lie far below what a study of some thousand files could distinguish from zero.

The estimate maximises the likelihood times |I|^(1/4), I being the Fisher information of (a, b): the square root of
Jeffreys' prior. As trials grow it is that of maximum likelihood. It is finite, too, where a size separates what was
found from what was not, as a sharp limit does, and the likelihood rises for ever with the slope: any positive power of
|I| does that. The power is a compromise of two biases of the size found 95% of the time, in the median of 150 simulated
studies with slopes b of 1 to 20 in a range of 80: of 13 trials, the likelihood alone states 0.6 of it where it is
finite, Jeffreys' own power of 1/2 states 1.0 to 2.4 times it, and this one 0.7 to 1.5; of 60 trials, 0.97 to 1.06.
Source: Kosmidis and Firth, "Jeffreys-prior penalty, finiteness and shrinkage in binomial-response generalized linear
models", Biometrika 2021, for any power; the idea is Firth's, "Bias reduction of maximum likelihood estimates",
Biometrika 1993.

The interval of a magnitude, or of the probability at one, is its range over all curves whose log likelihood, without
any prior, lies within chi2_2(0.95) / 2 of the best: over the joint likelihood region of both parameters. So the band
holds the whole curve at once with 95% confidence, and the interval of a single magnitude is somewhat wider than one of
95% would have to be; it is valid where the trials are separated too. Source: Cox and Hinkley, "Theoretical Statistics",
1974, 7.2. Curves are laid out on a grid of the size found half of the time and of the slope, twice: once over
everything, and once finer over where the first found them likely. A bound is as fine as that grid, a fiftieth of the
interval.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_ndtr, ndtr, ndtri
from scipy.stats import chi2

Array = NDArray[np.float64]

# Twice the log likelihood ratio is chi-square of two degrees of freedom for the two parameters (docstring).
_DROP: Final = float(chi2.ppf(0.95, 2)) / 2
_BEYOND: Final = float(np.log(100.0))
"""Range beyond the sizes of the trials, ln, in which limits are estimated; farther out they are unknown."""
_LOG_SLOPES: Final = (float(np.log(0.05)), float(np.log(200.0)))
"""From a curve that takes decades to rise to one that rises within a percent of the size."""
_COARSE, _FINE = 41, 61
_POWER: Final = 0.25
"""Of the Fisher information's determinant, in the prior."""


@dataclass(frozen=True, slots=True)
class ProbitFit:
    """A fitted curve and all that are likely beside it.

    Attributes
    ----------
    log_half, log_slope
        ln of the size found half of the time, and ln b, of the best curve.
    likely_halves, likely_log_slopes : (k,)
        The same of every curve on the grid that the trials do not rule out, and of the best.
    log_least, log_most
        Sizes (ln) between which limits can be estimated.
    separated
        Whether a size divides what was found from what was not.
    """

    log_half: float
    log_slope: float
    likely_halves: Array
    likely_log_slopes: Array
    log_least: float
    log_most: float
    separated: bool

    def log_size_at(self, probability: float) -> tuple[float | None, float | None, float | None]:
        """Return ln of the size found with a probability, and its bounds; None where it cannot be estimated."""
        quantile = float(ndtri(probability))
        # Phi(b (x - h)) = p, solved for x = h + Phi^-1(p) / b.
        sizes = self.likely_halves + quantile * np.exp(-self.likely_log_slopes)
        best = self.log_half + quantile * float(np.exp(-self.log_slope))
        return self._known(best), self._known(float(sizes.min())), self._known(float(sizes.max()))

    def probability_at(self, log_sizes: Array) -> tuple[Array, Array, Array]:
        """Return the probability at ln sizes (n,), and the lower and upper bounds of its band."""
        slopes = np.exp(self.likely_log_slopes)[:, None]
        likely = ndtr(slopes * (log_sizes - self.likely_halves[:, None]))
        best = ndtr(np.exp(self.log_slope) * (log_sizes - self.log_half))
        return np.asarray(best), np.asarray(likely.min(axis=0)), np.asarray(likely.max(axis=0))

    def _known(self, log_size: float) -> float | None:
        return log_size if self.log_least <= log_size <= self.log_most else None


def fit_probit(log_sizes: Array, detected: NDArray[np.bool_]) -> ProbitFit:
    """Fit the curve to trials.

    Parameters
    ----------
    log_sizes
        (n,) natural logarithms of the sizes.
    detected
        (n,) whether each fault was found.

    Raises
    ------
    ValueError
        All or none were found, or there is one size only: there is nothing to fit.
    """
    if detected.all() or not detected.any() or np.ptp(log_sizes) == 0:
        raise ValueError("Expected trials of several sizes, found and not found, got none of one of them")
    least, most = float(log_sizes.min()) - _BEYOND, float(log_sizes.max()) + _BEYOND
    halves, slopes = np.linspace(least, most, 2 * _COARSE), np.linspace(*_LOG_SLOPES, _COARSE)
    coarse = _log_likelihoods(halves, slopes, log_sizes, detected)
    best = _climb(log_sizes, detected)
    # The grid can miss the maximum, and the climb maximises with the prior: the larger of both is the reference of the
    # likelihood region.
    top = max(float(coarse.max()), float(_log_likelihoods(best[:1], best[1:], log_sizes, detected)[0, 0]))
    rows, columns = np.nonzero(coarse > top - _DROP)
    halves = _finer(halves, rows, best[0])
    slopes = np.clip(_finer(slopes, columns, best[1]), *_LOG_SLOPES)
    rows, columns = np.nonzero(_log_likelihoods(halves, slopes, log_sizes, detected) > top - _DROP)
    return ProbitFit(
        log_half=float(best[0]),
        log_slope=float(best[1]),
        likely_halves=np.append(halves[rows], best[0]),
        likely_log_slopes=np.append(slopes[columns], best[1]),
        log_least=least,
        log_most=most,
        separated=bool(log_sizes[detected].min() > log_sizes[~detected].max()),
    )


def _climb(log_sizes: Array, detected: NDArray[np.bool_]) -> Array:
    """Return the best curve (ln size at one half, ln slope); the slope stays within its bounds.

    It begins with one that rises over all sizes: about steep ones the trials hold so little information that the prior
    is flat there.
    """

    def cost(at: Array) -> float:
        allowed = np.clip(at[1:], *_LOG_SLOPES)
        likelihood = _log_likelihoods(at[:1], allowed, log_sizes, detected)[0, 0]
        # Ln |I| / 4, I being the Fisher information of (a, b).
        # It is the sum of w (1, x; x, x^2) with w = phi^2 / (Phi (1 - Phi)); x is taken about its mean, which leaves
        # the determinant as it is and keeps its digits.
        half = float(at[0])
        log_slope = float(allowed[0])
        scores = np.exp(log_slope) * (log_sizes - half)
        weights = np.exp(-(scores**2) - np.log(2 * np.pi) - log_ndtr(scores) - log_ndtr(-scores))
        x = log_sizes - log_sizes.mean()
        determinant = weights.sum() * (weights * x**2).sum() - (weights * x).sum() ** 2
        prior = _POWER * float(np.log(max(determinant, np.finfo(float).tiny)))
        # A slope beyond its bounds has the likelihood of the bound, and its distance as a cost: the simplex returns.
        return float(np.abs(at[1:] - allowed)[0] - likelihood - prior)

    half, log_slope = np.median(log_sizes), -np.log(log_sizes.std())
    around = np.array([[half, log_slope], [half + log_sizes.std(), log_slope], [half, log_slope + 0.5]])
    options = {"initial_simplex": around, "xatol": 1e-5, "fatol": 1e-7}
    done = minimize(cost, around[0], method="Nelder-Mead", options=options).x
    return np.array([done[0], np.clip(done[1], *_LOG_SLOPES)])


def _finer(axis: Array, likely: NDArray[np.intp], best: float) -> Array:
    """Return a finer axis over the likely places on the coarse one, a step wider on both sides."""
    inside, step = [best, *axis[likely]], float(axis[1] - axis[0])
    return np.linspace(min(inside) - step, max(inside) + step, _FINE)


def _log_likelihoods(halves: Array, log_slopes: Array, log_sizes: Array, detected: NDArray[np.bool_]) -> Array:
    """Return the log likelihood (halves, slopes) of curves with these ln sizes at one half and ln slopes."""
    # ln Phi(z) of what was found, ln(1 - Phi(z)) = ln Phi(-z) of what was not; log_ndtr keeps its digits in the tails.
    signs = np.where(detected, 1.0, -1.0)
    distances = signs * (log_sizes - halves[:, None, None])
    return np.asarray(log_ndtr(np.exp(log_slopes)[None, :, None] * distances).sum(axis=2))

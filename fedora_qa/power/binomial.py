"""Exact intervals of a share."""

from scipy.stats import beta, binom

from fedora_qa.record.power_types import Share

CONFIDENCE = 0.95


def share_of(count: int, of: int) -> Share:
    """Return a share with its exact two-sided interval of 95%.

    Source: Clopper and Pearson, "The use of confidence or fiducial limits illustrated in the case of the binomial",
    Biometrika 1934, in its beta form. It covers the true share with at least the confidence, whatever that share is.

    Parameters
    ----------
    count, of
        Successes, and trials.

    Raises
    ------
    ValueError
        The count is not between 0 and ``of``.
    """
    if not 0 <= count <= of:
        raise ValueError(f"Expected a count between 0 and {of}, got {count}")
    tail = (1 - CONFIDENCE) / 2
    # Clopper and Pearson 1934: quantiles of Beta(k, n - k + 1) and Beta(k + 1, n - k), undefined at k = 0 and n.
    low = float(beta.ppf(tail, count, of - count + 1)) if count else 0.0
    high = float(beta.isf(tail, count + 1, of - count)) if count < of else 1.0
    return Share(count, of, low, high)


def upper_bound(count: int, of: int) -> float:
    """Return the one-sided upper bound of a share: 1 - 0.05^(1/n) where nothing was counted in n."""
    return float(beta.isf(1 - CONFIDENCE, count + 1, of - count)) if count < of else 1.0


def chance_of(count: int, of: int, rate: float) -> float:
    """Return the probability of ``count`` or more in ``of`` where each comes at ``rate``."""
    # The survival function is P(X > k).
    return float(binom.sf(count - 1, of, rate))

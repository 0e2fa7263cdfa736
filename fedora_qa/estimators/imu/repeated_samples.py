"""Samples that repeat the one before exactly, and components that keep their value, while the body moves."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Indices = NDArray[np.intp]

_TYPICAL_SHARE: Final = 0.1
"""Share of a typical change. A body that moves by more next to a repeat does not come to rest there."""

_ROUNDINGS: Final = 16.0
"""Units of rounding by which neighbours of a steady motion may differ. The rotation of a vector takes fifteen
operations (nine products, six sums), each of which errs by at most half a unit, in either neighbour."""

FEWEST_HELD: Final = 16
"""Least number of repeats of a component that is held: a filter or a bus that gives a value twice holds it for fewer
samples. The value is not derived."""

_LOG_CHANCE: Final = float(np.log(1e-9))
"""Logarithm of the probability of six standard deviations (normal, one side)."""

_LARGE_CHANGE: Final = 0.9
"""Quantile of the changes of a component above which one is large: that of a component that comes to rest is among the
smallest."""


def repeated_samples(*samples: Float64, roundings: Sequence[float]) -> Indices:
    """Return the indices of samples that exactly repeat the one before, in every array, while the body moves.

    A body that comes to rest slows down before. Therefore a run of repeats counts only where the change next to it,
    before or after, is at least a tenth of a typical one, and larger than rounding makes of a steady motion. Where all
    samples repeat, none counts.

    Parameters
    ----------
    samples
        Arrays (N, k) of the same N samples.
    roundings
        Unit of rounding of each array, in its unit.

    Returns
    -------
    ndarray of intp
        (n,) ascending.
    """
    changes = [np.abs(np.diff(values, axis=0)).max(axis=-1, initial=0.0) for values in samples]
    repeats = np.all([change == 0 for change in changes], axis=0)
    if not len(repeats) or repeats.all() or not repeats.any():
        return np.empty(0, dtype=np.intp)
    moves = np.zeros(len(repeats), dtype=np.bool_)
    for change, rounding in zip(changes, roundings, strict=True):
        if np.any(change > 0):
            typical = float(np.median(change[change > 0]))
            moves |= change >= max(_TYPICAL_SHARE * typical, _ROUNDINGS * rounding)
    starts = np.flatnonzero(repeats & ~np.insert(repeats[:-1], 0, False))
    stops = np.flatnonzero(repeats & ~np.append(repeats[1:], False)) + 1
    padded = np.concatenate(([False], moves, [False]))  # padded[i] is the change before change i
    runs = [np.arange(a, b) + 1 for a, b in zip(starts, stops, strict=True) if padded[a] or padded[b + 1]]
    return np.concatenate(runs) if runs else np.empty(0, dtype=np.intp)


def longest_hold(values: Float64, *, rounding: float) -> slice:
    """Return the longest run of equal samples of one component that chance and rest do not explain.

    Coarse values repeat by chance. With the share p of repeats in the rest of the samples, one of n runs has r repeats
    with a probability of n p^r at most. A component comes to rest, and leaves it, by changes that grow from 0: a hold
    begins or ends with a change that is large among all changes of the component. A sensor at its limit repeats its
    largest or smallest value, which is not 0.

    Parameters
    ----------
    values
        (N,) of one component.
    rounding
        Unit of rounding of a value, in its unit.

    Returns
    -------
    slice
        Of the samples of the run, which all have one value; empty where there is none.
    """
    none = slice(0, 0)
    if len(values) < FEWEST_HELD or not np.isfinite(values).all():
        return none
    changes = np.abs(np.diff(values))
    repeats = changes == 0
    starts = np.flatnonzero(repeats & ~np.insert(repeats[:-1], 0, False))
    stops = np.flatnonzero(repeats & ~np.append(repeats[1:], False)) + 1
    if not len(starts) or repeats.all():
        return none
    longest = int(np.argmax(stops - starts))
    start, stop = int(starts[longest]), int(stops[longest])
    held, others = stop - start, len(repeats) - (stop - start)
    # At least one repeat is reckoned with: a share of 0 of few samples is no probability of 0.
    share = max(int(repeats.sum()) - held, 1) / max(others, 1)
    if held < FEWEST_HELD or np.log(len(values)) + held * np.log(min(share, 1.0)) > _LOG_CHANCE:
        return none
    value = float(values[start])
    if value and value in (values.min(), values.max()):
        return none
    # Changes into the run and out of it; the sequence may begin or end with it.
    beside = [float(changes[i]) for i in (start - 1, stop) if 0 <= i < len(changes)]
    large = float(np.quantile(changes[changes > 0], _LARGE_CHANGE))
    return slice(start, stop + 1) if max(beside) > max(large, _ROUNDINGS * rounding) else none

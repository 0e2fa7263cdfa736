"""Whether two sides differ by more than chance: exchange what chance alone could have put on the other side.

If both sides came from one process, who belongs to which side would be arbitrary. So the distance of the sides as they
are is compared with the distances of sides made by exchanging their units at random (permutation test; Phipson and
Smyth 2010 for the chance of a sample of relabellings). It assumes that units are exchangeable, nothing about
distributions.
"""

from dataclasses import dataclass
from itertools import count
from math import ceil, comb
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.comparison.histograms import Float64, Int64, mean_of, shares_of, wasserstein

_AT_ONCE: Final = 500
_MOST_RELABELLINGS: Final = 400_000
_SURELY_CHANCE: Final = 20
"""So many relabellings at least as far apart are enough to stop: the chance is known to a fourth of itself."""

_RESAMPLINGS: Final = 400
_FEWEST_RESAMPLED: Final = 5
"""The spread of fewer units is no estimate of that of their process."""


@dataclass(frozen=True, slots=True)
class Sides:
    """Counts of the units of two sides, (u, n) and (v, n), each unit with some. ``paired``: unit i is of one moment."""

    before: Int64
    after: Int64
    edges: Float64
    paired: bool

    @property
    def least_chance(self) -> float:
        """The least chance that relabelling can give; exchanging whole sides of one size changes no distance."""
        u, v = len(self.before), len(self.after)
        # Each pair is exchanged or not; without pairs any u of the u + v units form the first side.
        ways = 2**u if self.paired else comb(u + v, u)
        return min(1.0, (2.0 if self.paired or u == v else 1.0) / ways)

    @property
    def distance(self) -> float:
        """Wasserstein distance of the sides as they are."""
        return float(self._distances(self.before.sum(axis=0)[None].astype(np.float64))[0])

    def relabelled(self, number: int, random: np.random.Generator) -> Float64:
        """Return the distances (number,) of sides between which units were exchanged at random."""
        u, v = len(self.before), len(self.after)
        if self.paired:
            exchanged = random.integers(0, 2, (number, u)).astype(np.float64)
            # The first side plus (after - before) of each exchanged pair: one product for all relabellings.
            return self._distances(self.before.sum(axis=0) + exchanged @ (self.after - self.before))
        # Each row is a permutation of all units: those with the numbers below u form the first side.
        places = random.permuted(np.broadcast_to(np.arange(u + v), (number, u + v)), axis=1)
        chosen = (places < u).astype(np.float64)
        return self._distances(chosen @ np.concatenate([self.before, self.after]))

    def resampled(self, number: int, random: np.random.Generator) -> tuple[Float64, Float64]:
        """Return distances and shifts of the mean (number,) of sides whose units were drawn again (bootstrap)."""
        weights = _drawn_again(len(self.before), number, random)
        # Pairs are drawn together: what both sides have in common is then no scatter of their difference.
        others = weights if self.paired else _drawn_again(len(self.after), number, random)
        before, after = shares_of(weights @ self.before), shares_of(others @ self.after)
        return wasserstein(before, after, self.edges), mean_of(after, self.edges) - mean_of(before, self.edges)

    def _distances(self, before: Float64) -> Float64:
        # Relabelling moves units and loses none: the other side is the rest.
        after = self.before.sum(axis=0) + self.after.sum(axis=0) - before
        return wasserstein(shares_of(before), shares_of(after), self.edges)


@dataclass(frozen=True, slots=True)
class Chance:
    """What chance gives: how likely a distance as large as the sides' own, and what it exceeds once in twenty."""

    of_distance: float
    distance_95: float


def chance_of(sides: Sides, level: float, random: np.random.Generator) -> Chance:
    """Relabel until the chance of the sides' own distance is known well enough to compare it with ``level``.

    Parameters
    ----------
    sides
        Counts of the units of both sides.
    level
        Probability, 0 to 1, at which a chance is significant: it decides how many relabellings are made.
    random
        Source of the relabellings.

    Returns
    -------
    Chance
        The chance of the sides' own distance, and the distance that chance exceeds once in twenty, in the unit of the
        edges.
    """
    own = sides.distance * (1 - 1e-9)  # a relabelling that gives the sides back must not fall short by rounding
    # The least chance of n relabellings is 1 / (1 + n): 1 / level of them could just reach the level, and four times
    # as many allow some to lie as far apart.
    wanted = min(_MOST_RELABELLINGS, ceil(4 / level))
    distances: list[Float64] = []
    made = as_far = 0
    while made < wanted and as_far < _SURELY_CHANCE:
        distances.append(sides.relabelled(_AT_ONCE, random))
        made += _AT_ONCE
        as_far += int(np.count_nonzero(distances[-1] >= own))
    # The sides as they are count as one relabelling, since a chance of 0 is not valid (Phipson and Smyth 2010).
    return Chance((1 + as_far) / (1 + made), float(np.quantile(np.concatenate(distances), 0.95)))


def enough_units(level: float, *, paired: bool) -> int:
    """Return how many units a side needs so that its least chance reaches ``level``."""
    return next(n for n in count(1) if 2 / (2**n if paired else comb(2 * n, n)) <= level)


def standard_errors(sides: Sides, random: np.random.Generator) -> tuple[float | None, float | None]:
    """Estimate the errors of distance and shift by drawing units again (bootstrap).

    Parameters
    ----------
    sides
        Counts of the units of both sides.
    random
        Source of the draws.

    Returns
    -------
    tuple[float | None, float | None]
        Standard errors of the distance and of the shift of the mean, in the unit of the edges; None where a side has
        too few units.
    """
    if min(len(sides.before), len(sides.after)) < _FEWEST_RESAMPLED:
        return None, None
    distances, shifts = sides.resampled(_RESAMPLINGS, random)
    return float(distances.std(ddof=1)), float(shifts.std(ddof=1))


def _drawn_again(units: int, number: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return how often each unit is drawn when as many are drawn with replacement, (number, units)."""
    return random.multinomial(units, np.full(units, 1 / units), number).astype(np.float64)

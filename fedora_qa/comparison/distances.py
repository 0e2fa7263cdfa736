"""Which distributions are compared, which units can be exchanged between them, and how far they lie apart.

If both sides came from one process, the side of a unit would be arbitrary. So the distance of the sides as they are is
compared with the distances of sides made by exchanging their units at random (permutation test; Phipson and
Smyth 2010 for the chance of a sample of relabellings). It assumes that units are exchangeable, nothing about
distributions.

Neighbouring frames of a flight are correlated, so that a thousand frames are not a thousand samples. The correlation
time is estimated, and the sequence is cut into segments several times as long, which count as independent (batch means:
Law and Kelton, *Simulation Modeling and Analysis*, 9.5.3).
"""

from dataclasses import dataclass
from itertools import count, pairwise
from math import ceil, comb, sqrt
from typing import Final

import numpy as np

from fedora_qa.comparison.subjects import (
    Float64,
    Int64,
    SubjectInput,
    matches,
    mean_of,
    paired_blocks,
    shares_of,
    unit_of,
    wasserstein,
    without_empty_ends,
)
from fedora_qa.comparison.types import Conclusion, Design, Difference

_NOUNS: Final[dict[Design, str]] = {
    "versions": "blocks of time are in both",
    "sequences": "segments of time count as independent",
    "datasets": "files have it",
}

_AT_ONCE: Final = 500
_MOST_RELABELLINGS: Final = 400_000
_SURELY_CHANCE: Final = 20
"""Relabelling stops after so many that are at least as far apart: the relative error of the chance is then a fourth."""

_RESAMPLINGS: Final = 400
_FEWEST_RESAMPLED: Final = 5
"""The spread of fewer units is no estimate of that of their process."""

_SEGMENT_LENGTH: Final = 4.0
"""Length of a segment in correlation times. Where the correlation falls as exp(-t / T), whose correlation time is 2 T,
the means of neighbouring segments of length L are correlated by T / (2 (L - T)): by 0.07 for L = 8 T."""

_MOST_SEGMENTS: Final = 16
"""Longer segments are better than more of them: 16 against 16 can be relabelled in 6e8 ways."""

_QUARTILES: Final = (0.25, 0.5, 0.75)


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
        weights = _resampling_weights(len(self.before), number, random)
        # Pairs are drawn together: what both sides have in common is then no scatter of their difference.
        others = weights if self.paired else _resampling_weights(len(self.after), number, random)
        before, after = shares_of(weights @ self.before), shares_of(others @ self.after)
        return wasserstein(before, after, self.edges), mean_of(after, self.edges) - mean_of(before, self.edges)

    def _distances(self, before: Float64) -> Float64:
        # Relabelling moves units and loses none: the other side is the rest.
        after = self.before.sum(axis=0) + self.after.sum(axis=0) - before
        return wasserstein(shares_of(before), shares_of(after), self.edges)


@dataclass(frozen=True, slots=True)
class PairedCounts:
    """Two distributions that are compared. ``file`` is empty where they are of whole subjects."""

    file: str
    quantity: str
    design: Design
    sides: Sides


def paired_counts(before: SubjectInput, after: SubjectInput, design: Design) -> tuple[PairedCounts, ...]:
    """Return every quantity that both subjects have, by file where they are versions."""
    if design == "versions":
        of_files: list[PairedCounts] = []
        for match in matches(before, after):
            first, other = match.before.sampled, match.after.sampled
            if first is None or other is None:
                continue
            for quantity in first.counts:
                blocks = paired_blocks(first, other, quantity) if quantity in other.counts else None
                if blocks is not None and len(blocks[0]):
                    of_files.append(_paired(match.name, quantity, "versions", *blocks, paired=True))
        return tuple(of_files)
    quantities = _quantities(before)
    return tuple(
        _paired("", quantity, design, _units(before, quantity, design), _units(after, quantity, design), paired=False)
        for quantity in quantities
        if quantity in _quantities(after)
    )


def difference_of(counts: PairedCounts, level: float) -> Difference:
    """Return how far two distributions lie apart, and whether chance gives as much at ``level`` (a probability)."""
    sides = counts.sides
    random = np.random.default_rng(0)  # the same result in every run
    distance_error, shift_error = standard_errors(sides, random)
    before, after = (float(mean_of(shares_of(side.sum(axis=0)), sides.edges)) for side in (sides.before, sides.after))
    chance: Chance | None = None
    conclusion: Conclusion
    reason = ""
    # Whole numbers: the counts of a copy are equal exactly.
    if np.array_equal(sides.before, sides.after):
        conclusion = "identical"
    elif sides.least_chance <= level:
        chance = chance_of(sides, level, random)
        conclusion = "differs" if chance.of_distance <= level else "no_difference_seen"
    else:
        # A permutation test states no chance below that of its least likely relabelling: too few units decide nothing.
        conclusion = "not_told"
        u, v, enough = len(sides.before), len(sides.after), enough_units(level, paired=sides.paired)
        there, takes = (f"{u}", f"{enough}") if sides.paired else (f"{u} and {v}", f"{enough} each")
        reason = f"only {there} {_NOUNS[counts.design]}; to tell at {level:.2g} takes {takes}"
    return Difference(
        file=counts.file,
        quantity=counts.quantity,
        unit=unit_of(counts.quantity),
        mean_before=before,
        mean_after=after,
        shift_standard_error=shift_error,
        distance=sides.distance,
        distance_standard_error=distance_error,
        distance_by_chance=chance.distance_95 if chance else None,
        chance=chance.of_distance if chance else None,
        units=(len(sides.before), len(sides.after)),
        told=conclusion,
        reason=reason,
    )


def _paired(file: str, quantity: str, design: Design, before: Int64, after: Int64, *, paired: bool) -> PairedCounts:
    first, other, edges = without_empty_ends(before, after)
    return PairedCounts(file, quantity, design, Sides(first, other, edges, paired))


def _units(subject: SubjectInput, quantity: str, design: Design) -> Int64:
    """Return the counts (u, n) of what can be exchanged: files of a dataset, segments of a sequence."""
    having = [file.sampled for file in subject.files if file.sampled and quantity in file.sampled.counts]
    # Files are independent as they are. Blocks of one flight are correlated: only segments of several correlation times
    # can be exchanged.
    if design == "datasets":
        return np.stack([sampled.total(quantity) for sampled in having])
    return np.concatenate([independent_segments(sampled.counts[quantity]) for sampled in having])


def _quantities(subject: SubjectInput) -> dict[str, None]:
    return dict.fromkeys(q for file in subject.files if file.sampled for q in file.sampled.counts)


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


def _resampling_weights(units: int, number: int, random: np.random.Generator) -> Float64:
    """Return how often each unit is drawn when as many are drawn with replacement, (number, units)."""
    return random.multinomial(units, np.full(units, 1 / units), number).astype(np.float64)


def independent_segments(counts: Int64) -> Int64:
    """Merge blocks of time into segments of 4 correlation times or more: (s, n) counts of the segments, 16 at most.

    Parameters
    ----------
    counts
        (b, n) counts in n bins of blocks in the order of time; blocks without any are left out.
    """
    counts = counts[counts.sum(axis=1) > 0]
    number = max(1, min(_MOST_SEGMENTS, int(len(counts) / (_SEGMENT_LENGTH * correlation_time(counts)))))
    edges = np.linspace(0, len(counts), number + 1).round().astype(int)
    return np.stack([counts[start:stop].sum(axis=0) for start, stop in pairwise(edges)])


def correlation_time(counts: Int64) -> float:
    """Return the correlation time of blocks (b, n), in blocks: 1 or a little more for independent ones.

    It is the sum of the correlations at all lags. Its standard error is added, because a short sequence underestimates
    slow changes. Of three series, the shares of values below each quartile of all, the longest time counts.
    """
    if len(counts) < 2:
        return 1.0
    below = np.cumsum(shares_of(counts.sum(axis=0)))
    places = np.minimum(np.searchsorted(below, _QUARTILES), len(below) - 1)
    # One series for each quartile: the share of a block's values that lie below it.
    series = np.cumsum(shares_of(counts), axis=1)[:, places]
    return max(_summed_correlations(series[:, k]) for k in range(len(places)))


def _summed_correlations(series: Float64) -> float:
    """Sum the correlations at all lags up to where their pairs stop being positive (Geyer 1992), and add the error.

    Summed up to lag M of N samples, the relative error is sqrt(2 (2 M + 1) / N) (Sokal 1989, *Monte Carlo methods in
    statistical mechanics*, 3.19).
    """
    centred = series - series.mean()
    samples = len(centred)
    # N times the autocovariances at the lags 0 to N - 1.
    products = np.correlate(centred, centred, "full")[samples - 1 :]
    # Shares lie between 0 and 1: a variance below (1e-12)^2 is the rounding of a constant series.
    if not products[0] > 1e-24 * samples:
        return 1.0
    correlations = products / products[0]
    # 1 + 2 (rho_1 + rho_2 + ...) = -1 + 2 (sum over pairs of lags 2 j, 2 j + 1), because rho_0 = 1.
    total, last = -1.0, 0
    for lag in range(0, samples - 1, 2):
        pair = float(correlations[lag] + correlations[lag + 1])
        if pair <= 0:
            break
        total, last = total + 2 * pair, lag + 1
    # Relative error sqrt(2 (2 M + 1) / N) of Sokal 1989, 3.19 (docstring), with M = last.
    return max(total, 1.0) * (1 + sqrt(2 * (2 * last + 1) / samples))

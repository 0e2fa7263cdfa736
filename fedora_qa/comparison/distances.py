"""Which distributions are compared, which units can be exchanged between them, and how far they lie apart."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.comparison.histograms import Int64, mean_of, shares_of
from fedora_qa.comparison.relabelling import Sides, chance_of, enough_units, standard_errors
from fedora_qa.comparison.sampled import SampledCounts, filled, paired_blocks, unit_of
from fedora_qa.comparison.stretches import independent_stretches
from fedora_qa.comparison.subjects import Given, GivenFile, matches
from fedora_qa.comparison.types import Design, Difference, Told

_NOUNS: Final[dict[Design, str]] = {
    "versions": "blocks of time are in both",
    "sequences": "stretches of time can count as independent",
    "datasets": "files have it",
}


@dataclass(frozen=True, slots=True)
class PairedCounts:
    """Two distributions that are compared. ``file`` is empty where they are of whole subjects."""

    file: str
    quantity: str
    design: Design
    sides: Sides


def held_together(before: Given, after: Given, design: Design) -> tuple[PairedCounts, ...]:
    """Return every quantity that both subjects have, by file where they are versions."""
    if design == "versions":
        paired = [_paired(match.name, match.before.sampled, match.after.sampled) for match in matches(before, after)]
        return tuple(held for some in paired for held in some)
    quantities = _quantities(before)
    return tuple(
        _held("", quantity, design, _units(before, quantity, design), _units(after, quantity, design), paired=False)
        for quantity in quantities
        if quantity in _quantities(after)
    )


def difference_of(held: PairedCounts, level: float) -> Difference:
    """Return how far two distributions lie apart, and whether chance gives as much at ``level`` (a probability)."""
    sides = held.sides
    random = np.random.default_rng(0)  # the same answer whenever it is asked for
    distance_error, shift_error = standard_errors(sides, random)
    before, after = (float(mean_of(shares_of(side.sum(axis=0)), sides.edges)) for side in (sides.before, sides.after))
    conclusion, reason = _told_beforehand(held, level)
    chance = None if conclusion else chance_of(sides, level, random)
    if chance:
        conclusion = "differs" if chance.of_distance <= level else "no_difference_seen"
    return Difference(
        file=held.file,
        quantity=held.quantity,
        unit=unit_of(held.quantity),
        mean_before=before,
        mean_after=after,
        shift_standard_error=shift_error,
        distance=sides.distance,
        distance_standard_error=distance_error,
        distance_by_chance=chance.distance_95 if chance else None,
        chance=chance.of_distance if chance else None,
        units=(len(sides.before), len(sides.after)),
        told=conclusion or "not_told",
        reason=reason,
    )


def _told_beforehand(held: PairedCounts, level: float) -> tuple[Told | None, str]:
    """Return the conclusion where none needs relabelling, with its reason; None where relabelling decides."""
    sides = held.sides
    # Whole numbers: the counts of a copy are equal exactly.
    if np.array_equal(sides.before, sides.after):
        return "identical", ""
    # A permutation test states no chance below that of its least likely relabelling: too few units decide nothing.
    if sides.least_chance <= level:
        return None, ""
    u, v, enough = len(sides.before), len(sides.after), enough_units(level, paired=sides.paired)
    there, takes = (f"{u}", f"{enough}") if sides.paired else (f"{u} and {v}", f"{enough} each")
    return "not_told", f"only {there} {_NOUNS[held.design]}; to tell at {level:.2g} takes {takes}"


def _paired(name: str, before: SampledCounts | None, after: SampledCounts | None) -> list[PairedCounts]:
    if before is None or after is None:
        return []
    pairs = {q: paired_blocks(before, after, q) for q in before.counts if q in after.counts}
    return [_held(name, q, "versions", *blocks, paired=True) for q, blocks in pairs.items() if len(blocks[0])]


def _held(file: str, quantity: str, design: Design, before: Int64, after: Int64, *, paired: bool) -> PairedCounts:
    first, other, edges = filled(before, after)
    return PairedCounts(file, quantity, design, Sides(first, other, edges, paired))


def _units(given: Given, quantity: str, design: Design) -> Int64:
    """Return the counts (u, n) of what can be exchanged: files of a dataset, segments of a sequence."""
    having = [sampled for sampled in map(_sampled, given.files) if sampled and quantity in sampled.counts]
    # Files are independent as they are. Blocks of one flight are correlated: only segments of several correlation times
    # can be exchanged.
    if design == "datasets":
        return np.stack([sampled.total(quantity) for sampled in having])
    return np.concatenate([independent_stretches(sampled.counts[quantity]) for sampled in having])


def _quantities(given: Given) -> dict[str, None]:
    return dict.fromkeys(q for file in given.files if file.sampled for q in file.sampled.counts)


def _sampled(file: GivenFile) -> SampledCounts | None:
    return file.sampled

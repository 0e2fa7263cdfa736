"""The conclusions of a comparison, in sentences: which subject is darker or faster, by how much, and in how many files.

A sentence names a direction only where the mean changed significantly at the level of the comparison. A distribution
may differ with an equal mean; then the sentence states its distance.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import erfc, sqrt
from typing import Final

from fedora_qa.comparison.types import Comparison, Difference, Pair, StatisticChange
from fedora_qa.record.wording import number, with_error, with_unit


@dataclass(frozen=True, slots=True)
class QuantityWords:
    """A quantity in a sentence: its name, and the verb phrase of a subject whose mean is higher, or lower."""

    name: str
    higher: str
    lower: str


_FLOW: Final = "flow_"
_WORDS: Final[Mapping[str, QuantityWords]] = {
    "depth_m": QuantityWords("depth", "has larger depths", "has smaller depths"),
    "luma_dn": QuantityWords("luma", "is brighter", "is darker"),
    "event_rate_per_ms": QuantityWords("event rate", "has more events", "has fewer events"),
    "pixel_interval_ms": QuantityWords(
        "time between events of a pixel", "has longer times between events", "has shorter times between events"
    ),
}
_MOST_STATISTICS: Final = 3
_MOST_RULES: Final = 3


def conclusions_of(comparison: Comparison) -> tuple[str, ...]:
    """Return the conclusions on each subject against the reference, the most serious first; each is a sentence."""
    return tuple(sentence for pair in comparison.pairs for sentence in _of_pair(comparison, pair))


def _of_pair(comparison: Comparison, pair: Pair) -> Iterator[str]:
    reference, name = (comparison.subjects[place].name for place in (pair.before, pair.after))
    sentences = [
        *_changed_findings(name, pair),
        *_changed_distributions(name, reference, pair, comparison.level),
        *_moved_statistics(name, pair),
    ]
    conclusions = [difference.told for difference in pair.differences]
    if not sentences and conclusions:
        if conclusions.count("identical") == len(conclusions):
            yield f"{name} and {reference} have identical distributions."
        elif "no_difference_seen" in conclusions:
            open_count = conclusions.count("not_told")
            rest = f"; {open_count} of {len(conclusions)} distributions have too few independent samples to compare"
            yield f"No difference is detected between {name} and {reference}{rest if open_count else ''}."
        else:
            yield f"Differences between {name} and {reference} cannot be detected: too few samples are independent."
    yield from sentences


def _changed_findings(name: str, pair: Pair) -> Iterator[str]:
    findings = pair.versions.findings if pair.versions else ()
    for change, verb in (("new", "has"), ("gone", "no longer has"), ("changed", "changes")):
        rules = dict.fromkeys(finding.code or finding.check for finding in findings if finding.change == change)
        count = sum(finding.change == change for finding in findings)
        if count:
            what = f"{'new ' if change == 'new' else ''}{'finding' if count == 1 else 'findings'}"
            yield f"{name} {verb} {count} {what}: {_listed(list(rules))}."


def _changed_distributions(name: str, reference: str, pair: Pair, level: float) -> Iterator[str]:
    by_quantity: dict[str, list[Difference]] = {}
    for difference in pair.differences:
        by_quantity.setdefault(difference.quantity, []).append(difference)
    for quantity, compared in by_quantity.items():
        differing = [difference for difference in compared if difference.told == "differs"]
        words = _words_of(quantity)
        # One file may be brighter and another one darker: each direction is a separate sentence.
        for direction in (1, -1, 0):
            some = [difference for difference in differing if _direction(difference, level) == direction]
            if not some:
                continue
            largest = max(some, key=lambda difference: difference.distance)
            what = {1: words.higher, -1: words.lower, 0: f"has another distribution of {words.name}"}[direction]
            where = ""
            if len(compared) > 1:
                where = f" in {len(some)} of {len(compared)} files"
                where += f", most in {largest.file}" if len(some) > 1 else f", {largest.file}"
            yield f"{name} {what}{where}: {_numbers(largest, words, reference, direction)}."


def _numbers(difference: Difference, words: QuantityWords, reference: str, direction: int) -> str:
    means = (
        f"mean {words.name} {number(difference.mean_after)} against "
        f"{with_unit(difference.mean_before, difference.unit)} in {reference}"
    )
    if direction:
        shift = difference.mean_after - difference.mean_before
        return f"{means}, a shift of {with_error(shift, difference.shift_standard_error, difference.unit)}"
    distance = with_error(difference.distance, difference.distance_standard_error, difference.unit)
    return f"the distance is {distance}, with {means}"


def _direction(difference: Difference, level: float) -> int:
    """Return the sign of a shift of the mean whose probability by chance is at most ``level``; else 0."""
    shift, error = difference.mean_after - difference.mean_before, difference.shift_standard_error
    if error is None or shift == 0:
        return 0
    # P(|z| > x) = erfc(x / sqrt 2) of a normal shift; without an error any shift is significant.
    chance = erfc(abs(shift) / (error * sqrt(2))) if error else 0.0
    return (1 if shift > 0 else -1) if chance <= level else 0


def _moved_statistics(name: str, pair: Pair) -> Iterator[str]:
    moved = [change for change in (pair.versions.statistics if pair.versions else ()) if change.moved == "moved"]
    for change in moved[:_MOST_STATISTICS]:
        yield f"{name}, {change.file}: {_moved_words(change)}."
    if len(moved) > _MOST_STATISTICS:
        yield f"{name}: {len(moved) - _MOST_STATISTICS} more statistics changed beyond their errors."


def _moved_words(change: StatisticChange) -> str:
    words = f"{change.statistic} is {number(change.after)} against {number(change.before)}"
    if change.after is None or change.before is None:
        return words
    return f"{words}, a difference of {with_error(change.after - change.before, change.standard_error, '')}"


def _words_of(quantity: str) -> QuantityWords:
    if quantity.startswith(_FLOW):
        rate = quantity.removeprefix(_FLOW).removesuffix("hz")
        return QuantityWords(f"flow at {rate} Hz", f"has larger flow at {rate} Hz", f"has smaller flow at {rate} Hz")
    return _WORDS.get(quantity, QuantityWords(quantity, f"has more {quantity}", f"has less {quantity}"))


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_RULES} more" if len(names) > _MOST_RULES else ""
    return f"{', '.join(names[:_MOST_RULES])}{more}"

"""Whether the least detectable faults that checks state of clean files are true.

Which measurement states the limit of which cause? A record does not say it, and it need not: a measurement measures a
cause where its unit is one of the fault's size, and where its deviation *is* that size. So it is one that exceeded its
limit in three trials of the cause or more, by a deviation whose ratio to the planted size has a median between 1/2 and
2. Whether it exceeded decides only which measurements are meant; whether their limits are true is counted over all
trials, found or not.

A check states of a clean file the least limit of these measurements. A planted size is told in units of the limit that
was stated of its own clean file, because limits differ from file to file as their information does. Then the stated
limit is too bold where fewer than 90% of the faults from 1 on were found, and so few would be found with less than 5%
probability if the promised 95% were true; too cautious where 95% are found at less than half of it already; untested
where there are too few faults to tell; and true otherwise.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final

from fedora_qa.power.binomial import chance_of, share_of
from fedora_qa.power.detection import Sized, curve_of, is_found_by
from fedora_qa.power.study import Trial
from fedora_qa.power.units import factor_between
from fedora_qa.record.power_types import Curve, NotComparable, Share, StatedLimit, Truth

_FEWEST: Final = 3
"""Trials in which a measurement must have exceeded its limit, and faults from the limit on that can tell its truth."""
_TRACKS: Final = (0.5, 2.0)
_PROMISED: Final = 0.95
_NEEDED: Final = 0.90
_BY_CHANCE: Final = 0.05
_CAUTIOUS: Final = 0.5


@dataclass(frozen=True, slots=True)
class _Comparison:
    """A trial whose clean file states a limit: that limit, and the planted size in units of it."""

    limit: float
    ratio: float
    found: bool


def stated_limits(
    sized: Sized, clean: Mapping[str, Trial]
) -> tuple[tuple[StatedLimit, ...], tuple[NotComparable, ...]]:
    """Return every check whose stated limit can be held against the cause, and those for which it cannot.

    ``clean`` are the clean trials by file.
    """
    checks = dict.fromkeys(check for trial in sized.trials for check in trial.checked.failed)
    compared = [_compare(sized, check, clean) for check in checks]
    return (
        tuple(one for one in compared if isinstance(one, StatedLimit)),
        tuple(one for one in compared if isinstance(one, NotComparable)),
    )


def _compare(sized: Sized, check: str, clean: Mapping[str, Trial]) -> StatedLimit | NotComparable:
    if not sized.has_size:
        return NotComparable(sized.cause, check, "the fault has no size")
    if sized.worse_when_smaller:
        return NotComparable(sized.cause, check, "the fault grows as its magnitude falls")
    names = _that_measure(sized, check)
    if isinstance(names, str):
        return NotComparable(sized.cause, check, names)
    comparisons = list(_comparisons(sized, check, names, clean))
    if not comparisons:
        return NotComparable(sized.cause, check, "no clean file of these faults states a limit")
    limits = [one.limit for one in comparisons]
    ratios, found = [one.ratio for one in comparisons], [one.found for one in comparisons]
    share, curve = _found_from(1, comparisons), curve_of(ratios, found)
    return StatedLimit(
        cause=sized.cause,
        check=check,
        measurements=names,
        unit=sized.unit,
        least=min(limits),
        median=median(limits),
        most=max(limits),
        found_from_it=share,
        found_from_twice=_found_from(2, comparisons),
        curve=curve,
        truth=_truth(share, curve, ratios),
    )


def _that_measure(sized: Sized, check: str) -> tuple[str, ...] | str:
    """Return the check's measurements that measure the fault's size, or why there are none."""
    deviations: dict[str, list[float]] = {}
    other_units: dict[str, None] = {}
    for size, trial in zip(sized.sizes, sized.trials, strict=True):
        for reading in trial.checked.exceeded:
            factor = factor_between(reading.unit, sized.unit)
            if reading.check == check and factor is None:
                other_units[reading.unit] = None
            elif reading.check == check and factor is not None:
                deviations.setdefault(reading.name, []).append(abs(reading.deviation) * factor / size)
    names = tuple(
        name
        for name, ratios in deviations.items()
        if len(ratios) >= _FEWEST and _TRACKS[0] <= median(ratios) <= _TRACKS[1]
    )
    if names:
        return names
    if not deviations:
        units = ", ".join(unit if unit not in {"", "1"} else "a pure number" for unit in other_units)
        return f"measured in {units}, planted in {sized.unit}" if units else "no measurement exceeded a limit"
    if all(len(ratios) < _FEWEST for ratios in deviations.values()):
        return f"exceeded in fewer than {_FEWEST} trials"
    return "the deviation is not the planted size"


def _comparisons(sized: Sized, check: str, names: tuple[str, ...], clean: Mapping[str, Trial]) -> Iterator[_Comparison]:
    for size, trial in zip(sized.sizes, sized.trials, strict=True):
        limits = _stated(clean.get(trial.item.base or ""), check, names, sized.unit)
        if limits:
            yield _Comparison(min(limits), size / min(limits), is_found_by(trial, check))


def _stated(base: Trial | None, check: str, names: tuple[str, ...], unit: str) -> list[float]:
    """Return the limits that the check states of a clean file, in the unit of the fault."""
    return [
        reading.least_detectable * factor
        for reading in (base.checked.stated if base else ())
        if reading.check == check and reading.name in names and reading.least_detectable
        if (factor := factor_between(reading.unit, unit)) is not None
    ]


def _found_from(ratio: float, comparisons: Sequence[_Comparison]) -> Share:
    found = [one.found for one in comparisons if one.ratio >= ratio]
    return share_of(sum(found), len(found))


def _truth(from_it: Share, curve: Curve, ratios: Sequence[float]) -> Truth:
    too_few_found = from_it.count < _NEEDED * from_it.of
    if too_few_found and 1 - chance_of(from_it.count + 1, from_it.of, _PROMISED) < _BY_CHANCE:
        return "too_bold"
    at_95 = curve.at_95.value
    if curve.fitted == "all_found" and min(ratios) < _CAUTIOUS:
        return "too_cautious"
    if at_95 is not None and at_95 < _CAUTIOUS:
        return "too_cautious"
    return "untested" if too_few_found or from_it.of < _FEWEST else "true"

"""Whether the least detectable faults that checks state of clean files are true.

A stated limit is a size in the unit of a measurement: the least deviation that is detected with 95% probability. It is
compared with what was planted in one of two ways.

*By size*, where the measurement measures the cause itself: where its unit is one of the fault's size, and its
deviation *is* that size. So it is one that exceeded its limit in three trials of the cause or more, by a deviation
whose ratio to the planted size lies between 1/2 and 2 in three quarters of them (a share of pixels that break a law may
come near the percents of a wrong threshold now and then, and is no measure of it). Whether it exceeded decides only
which measurements are meant; whether their limits are true is counted over all trials, found or not. Of several the
least limit counts.

*By response*, where it does not (a clock error in ppm that shows as a shift in px, a fault without a size, a shift in
any direction, of which measurements have components): a faulty file is a copy of a clean one, noise and all, so that
the difference of the two measurements is what the fault moved the measurement by. That effect is compared with the
limit stated of the clean file, and found is what the measurement itself exceeded. Of several, the one that exceeded
most often is taken, and of those alike the one that moves most. Trials whose fault makes the measurement's own limit
more than twice what it was are counted like all others, and their number is stated: the limit of a clean file does not
show that a fault disturbs the data of the measurement.

Either way each trial has its ratio to the limit that was stated of its own clean file, because limits differ from file
to file as their information does. A value that is the worst of several places or times has a range of limits
``[low, high]``: what it promises is that a fault of ``high`` is detected wherever it is, and that one below ``low`` is
detected nowhere. Where a fault has its largest effect is not known before, and the worst place of a clean file is one
at random. So the ratio is that to ``high``, and a limit is too cautious only by its ratio to ``low``.

A stated limit is too bold where fewer than 90% of the faults from 1 on were found,
and so few would be found with less than 5% probability if the promised 95% were true; too cautious where 95% are found
at less than half of it already; untested where fewer than three faults lie between 1 and 4, or one was missed that may
have been missed by chance; and true otherwise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Final

from fedora_qa.power.detection import CauseTrials, chance_of, curve_of, factor_between, is_found_by, share_of
from fedora_qa.power.study import MeasuredDeviation, Trial
from fedora_qa.record.power_study import ComparedBy, Curve, NotComparable, Share, StatedLimit, Truth

_FEWEST: Final = 3
"""Trials in which a measurement must have exceeded its limit, and faults near the limit that can test it."""
_TRACKS: Final = (0.5, 2.0)
_MOSTLY: Final = 0.75
_PROMISED: Final = 0.95
_NEEDED: Final = 0.90
_BY_CHANCE: Final = 0.05
_CAUTIOUS: Final = 0.5
_DISTURBED: Final = 2.0
"""Times the limit of the clean file from which on a fault is taken to disturb the measurement, not to move it."""
_NEAR: Final = 4.0
"""Times the limit up to which a fault tests it: far beyond, any limit would be met."""
_NOTHING: Final = 0.01
"""Times the limit below which a fault carries no information on where detection rises."""


@dataclass(frozen=True, slots=True)
class _Comparison:
    """A trial whose clean file states a limit: that limit, the fault in units of it, and whether it was found.

    Of a range of limits ``limit`` and ``ratio`` refer to the highest, ``ratio_to_lowest`` to the lowest.
    ``is_detected`` is by the check that states the limit, ``by_any`` by any check. ``is_disturbed``: the faulty file
    states a limit of more than ``_DISTURBED`` times that of the clean one.
    """

    limit: float
    ratio: float
    ratio_to_lowest: float
    is_detected: bool
    by_any: bool
    is_disturbed: bool


@dataclass(frozen=True, slots=True)
class _LimitTrials:
    """All comparisons of a cause and a check, and of which measurements in which unit."""

    by: ComparedBy
    measurements: tuple[str, ...]
    unit: str
    trials: tuple[_Comparison, ...]


def stated_limits(
    sized: CauseTrials, clean: Mapping[str, Trial]
) -> tuple[tuple[StatedLimit, ...], tuple[NotComparable, ...]]:
    """Compare the stated limits of all checks with the trials of one cause.

    Parameters
    ----------
    sized
        The trials of the cause, sizes in one unit.
    clean
        The clean trials, by file.
    """
    comparable: list[StatedLimit] = []
    others: list[NotComparable] = []
    for check in dict.fromkeys(check for trial in sized.trials for check in trial.checked.failed):
        compared = _by_size(sized, check, clean) or _by_response(sized, check, clean)
        informative = [trial for trial in compared.trials if trial.ratio > _NOTHING] if compared else []
        if compared is None or not informative:
            exceeded = _names_exceeded(sized, check)
            if not exceeded:
                why = "no measurement exceeded a limit"
            elif max(exceeded.values()) < _FEWEST:
                why = f"exceeded in fewer than {_FEWEST} trials"
            else:
                why = "no clean file states a limit of what exceeded"
            others.append(NotComparable(sized.cause, check, why))
            continue
        limits = [trial.limit for trial in compared.trials]
        is_detected = [trial.is_detected for trial in informative]
        curve = curve_of([trial.ratio for trial in informative], is_detected)
        of_lowest = [trial.ratio_to_lowest for trial in informative]
        share = _found_from(1, compared.trials)
        by_any = [replace(trial, is_detected=trial.by_any) for trial in compared.trials]
        comparable.append(
            StatedLimit(
                cause=sized.cause,
                check=check,
                compared=compared.by,
                measurements=compared.measurements,
                unit=compared.unit,
                least=min(limits),
                median=median(limits),
                most=max(limits),
                found_from_it=share,
                found_from_twice=_found_from(2, compared.trials),
                curve=curve,
                truth=_truth(share, [t.ratio for t in informative], curve_of(of_lowest, is_detected), min(of_lowest)),
                found_from_twice_by_any=_found_from(2, by_any),
                worsened=sum(trial.is_disturbed for trial in compared.trials),
            )
        )
    return tuple(comparable), tuple(others)


def _by_size(sized: CauseTrials, check: str, clean: Mapping[str, Trial]) -> _LimitTrials | None:
    """Compare planted sizes with the limits of those measurements that measure them."""
    if not sized.has_size or sized.worse_when_smaller or _has_directions(sized):
        return None
    # The check's measurements that measure the fault's size: deviations over sizes, of what exceeded.
    deviations: dict[str, list[float]] = {}
    for size, trial in zip(sized.sizes, sized.trials, strict=True):
        for measurement in trial.checked.exceeded:
            factor = factor_between(measurement.unit, sized.unit)
            if measurement.check == check and factor is not None:
                deviations.setdefault(measurement.name, []).append(abs(measurement.deviation) * factor / size)
    names = tuple(
        name
        for name, ratios in deviations.items()
        if len(ratios) >= _FEWEST
        and sum(_TRACKS[0] <= ratio <= _TRACKS[1] for ratio in ratios) >= _MOSTLY * len(ratios)
    )
    trials = []
    for size, trial in zip(sized.sizes, sized.trials, strict=True):
        of_faulty = _of_check(trial, check)
        limits = [
            (high * to_size, low * to_size, _is_disturbed(measurement, of_faulty.get(name)))
            for name, measurement in _stated(trial, check, clean).items()
            if name in names and measurement.stated_limits is not None
            if (to_size := factor_between(measurement.unit, sized.unit)) is not None
            for low, high in [measurement.stated_limits]
        ]
        if limits:
            high, _, is_disturbed = min(limits)
            low = min(low for _, low, _ in limits)
            is_detected, by_any = is_found_by(trial, check), trial.checked.is_found
            trials.append(_Comparison(high, size / high, size / low, is_detected, by_any, is_disturbed))
    return _LimitTrials("size", names, sized.unit, tuple(trials)) if trials else None


def _by_response(sized: CauseTrials, check: str, clean: Mapping[str, Trial]) -> _LimitTrials | None:
    """Compare what the fault moved a measurement by with its limit, for the measurement that exceeds most often."""
    options = []
    for name, times in _names_exceeded(sized, check).items():
        if times < _FEWEST:
            continue
        # Of each trial whose measurement and whose clean measurement are known.
        units: list[str] = []
        compared: list[_Comparison] = []
        for trial in sized.trials:
            before, after = _stated(trial, check, clean).get(name), _of_check(trial, check).get(name)
            if before and after and before.stated_limits:
                low, high = before.stated_limits
                # The noise of the clean file is in both measurements and cancels: the difference is the effect of the
                # fault.
                effect = before.harm(after.deviation - before.deviation)
                compared.append(
                    _Comparison(
                        high,
                        effect / high,
                        effect / low,
                        after.exceeds,
                        trial.checked.is_found,
                        _is_disturbed(before, after),
                    )
                )
                units.append(before.unit)
        if compared:
            limit_trials = _LimitTrials("response", (name,), units[0], tuple(compared))
            options.append((times, median(trial.ratio for trial in compared), limit_trials))
    return max(options, key=lambda option: option[:2])[2] if options else None


def _has_directions(sized: CauseTrials) -> bool:
    """Whether sizes are lengths of shifts in several directions: a measurement of a component is small by some."""
    return any(fault.direction_deg is not None for trial in sized.trials for fault in trial.item.planted)


def _is_disturbed(before: MeasuredDeviation, after: MeasuredDeviation | None) -> bool:
    """Whether the faulty file states a worse limit than its clean one."""
    return bool(before.limit) and after is not None and (after.limit or 0.0) > _DISTURBED * (before.limit or 0.0)


def _names_exceeded(sized: CauseTrials, check: str) -> dict[str, int]:
    """Count the trials in which each measurement of the check exceeded its limit."""
    times: dict[str, int] = {}
    for trial in sized.trials:
        for measurement in trial.checked.exceeded:
            if measurement.check == check:
                times[measurement.name] = times.get(measurement.name, 0) + 1
    return times


def _stated(trial: Trial, check: str, clean: Mapping[str, Trial]) -> dict[str, MeasuredDeviation]:
    """Return the measurements of the trial's own clean file, by name."""
    base = clean.get(trial.item.base or "")
    return _of_check(base, check) if base else {}


def _of_check(trial: Trial, check: str) -> dict[str, MeasuredDeviation]:
    return {measurement.name: measurement for measurement in trial.checked.measurements if measurement.check == check}


def _found_from(ratio: float, trials: Sequence[_Comparison]) -> Share:
    detected = [trial.is_detected for trial in trials if trial.ratio >= ratio]
    return share_of(sum(detected), len(detected))


def _truth(from_it: Share, ratios: Sequence[float], curve: Curve, least: float) -> Truth:
    """Judge a limit by ratios to the highest limits of ranges, and by curve and least ratio to the lowest ones."""
    too_few_found = from_it.count < _NEEDED * from_it.of
    # P(X <= count) if the promised 95% were true.
    if too_few_found and 1 - chance_of(from_it.count + 1, from_it.of, _PROMISED) < _BY_CHANCE:
        return "too_bold"
    at_95 = curve.at_95.value
    if curve.fitted == "all_found" and least < _CAUTIOUS:
        return "too_cautious"
    if at_95 is not None and at_95 < _CAUTIOUS:
        return "too_cautious"
    near = sum(1 <= ratio <= _NEAR for ratio in ratios)
    return "untested" if too_few_found or near < _FEWEST else "true"

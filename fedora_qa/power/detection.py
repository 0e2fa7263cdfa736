"""How often each cause is found, by each check and by all together, against its size; with exact intervals."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np
from scipy.stats import beta, binom

from fedora_qa.power.probit import ProbitFit, fit_probit
from fedora_qa.power.study import Trial
from fedora_qa.record.power_study import (
    WHOLE_FILE,
    Curve,
    CurvePoint,
    Detection,
    Estimate,
    FalseAlarms,
    Fitted,
    Share,
    Tried,
)

CONFIDENCE = 0.95

_DIMENSIONS: Final[tuple[Mapping[str, float], ...]] = (
    {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0},
    {"mm": 1e-3, "cm": 1e-2, "m": 1.0},
    {"deg": pi / 180, "rad": 1.0},
    {"deg/s": pi / 180, "rad/s": 1.0},
    {"mm/s^2": 1e-3, "m/s^2": 1.0},
    {"ppm": 1e-6, "percent": 1e-2, "%": 1e-2, "share": 1.0, "1": 1.0},
    {"samples": 1.0, "frames": 1.0},
)
"""Each unit's size, by dimension. Pure numbers are one dimension: a factor of 1.01 is a gain of one percent."""

WORSE_WHEN_SMALLER: Final = frozenset({"interpolated_pose"})
"""Causes whose fault grows as their magnitude falls: poses interpolated from 20 Hz are worse than from 50 Hz."""

UNKNOWN: Final = Estimate(None, None, None)

_FEWEST: Final = 5
"""Trials, of three sizes at least, below which no curve is fitted."""
_POINTS: Final = 33
_GROUPS: Final = 6


def share_of(count: int, of: int) -> Share:
    """Return a share with its exact two-sided interval of 95%.

    Source: Clopper and Pearson, "The use of confidence or fiducial limits illustrated in the case of the binomial",
    Biometrika 1934, in its beta form. It covers the true share with at least the confidence, whatever that share is.

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


def factor_between(unit: str, other: str) -> float | None:
    """Return how many of ``other`` one of ``unit`` is; None where they measure different things."""
    if unit == other:
        return 1.0
    for sizes in _DIMENSIONS:
        if unit in sizes and other in sizes:
            return sizes[unit] / sizes[other]
    return None


@dataclass(frozen=True, slots=True)
class CauseTrials:
    """The trials of one cause in whole files: their sizes in one unit, 0 where the fault has none."""

    cause: str
    unit: str
    sizes: tuple[float, ...]
    trials: tuple[Trial, ...]
    worse_when_smaller: bool = False

    @property
    def has_size(self) -> bool:
        """Whether every fault has a size."""
        return all(self.sizes)


def by_cause(trials: Iterable[Trial]) -> tuple[CauseTrials, ...]:
    """Gather the trials with one fault of a whole file by cause and unit, in the order of the manifest."""
    groups: dict[tuple[str, str], list[tuple[float, Trial]]] = {}
    for trial in trials:
        if trial.item.kind == "single" and not trial.item.is_clean:
            (fault,) = trial.item.planted
            # The unit in which the cause came before, if this one can be converted into it, and the factor to it.
            unit, factor = fault.unit or "", 1.0
            for cause, other in groups:
                to_other = factor_between(fault.unit or "", other) if cause == fault.name else None
                if to_other is not None:
                    unit, factor = other, to_other
                    break
            size = abs(fault.magnitude or 0.0) * factor
            groups.setdefault((fault.name, unit), []).append((size, trial))
    return tuple(
        CauseTrials(
            cause,
            unit,
            tuple(size for size, _ in group),
            tuple(trial for _, trial in group),
            cause.rpartition(":")[2] in WORSE_WHEN_SMALLER,
        )
        for (cause, unit), group in groups.items()
    )


def detections(sized: CauseTrials) -> tuple[Detection, ...]:
    """Return how any check finds the cause, and then each check that ever does, the most frequent first."""
    counts: dict[str, int] = {}
    for trial in sized.trials:
        for check in trial.checked.failed:
            counts[check] = counts.get(check, 0) + 1
    rows = []
    for check in (WHOLE_FILE, *sorted(counts, key=lambda name: -counts[name])):
        detected = [is_found_by(trial, check) for trial in sized.trials]
        # Shares found in ranges of size with about as many trials each; trials of one size stay together.
        groups: list[list[tuple[float, bool]]] = []
        order = sorted(zip(sized.sizes, detected, strict=True)) if sized.has_size else []
        for size, is_detected in order:
            full = not groups or len(groups[-1]) >= len(order) / _GROUPS
            if full and not (groups and groups[-1][-1][0] == size):
                groups.append([])
            groups[-1].append((size, is_detected))
        tried = tuple(
            Tried(group[0][0], group[-1][0], share_of(sum(hit for _, hit in group), len(group))) for group in groups
        )
        detected_share = share_of(sum(detected), len(detected))
        curve = curve_of(sized.sizes, detected, worse_when_smaller=sized.worse_when_smaller)
        material = [is_material_to(trial, check) for trial in sized.trials]
        material_share = share_of(sum(material), len(material))
        material_curve = curve_of(sized.sizes, material, worse_when_smaller=sized.worse_when_smaller)
        rows.append(
            Detection(sized.cause, sized.unit, check, detected_share, tried, curve, material_share, material_curve)
        )
    return tuple(rows)


def is_found_by(trial: Trial, check: str) -> bool:
    """Whether the check failed; any check where it is empty."""
    return check in trial.checked.failed if check else trial.checked.is_found


def is_material_to(trial: Trial, check: str) -> bool:
    """Return whether the check failed by a deviation that is material to a release; any check where it is empty."""
    return check in trial.checked.material if check else bool(trial.checked.material)


def curve_of(sizes: Sequence[float], detected: Sequence[bool], *, worse_when_smaller: bool = False) -> Curve:
    """Fit the probability of detection against the size of a fault.

    Parameters
    ----------
    sizes
        (n) sizes of the faults, all in one unit; 0 for a fault without a size.
    detected
        (n) whether each was found.
    worse_when_smaller
        Whether the fault grows as its size falls.

    Returns
    -------
    Curve
        In the unit of the sizes; without a fit, the reason why there is none.
    """
    why: Fitted | None = None
    if not all(sizes):
        why = "no_size"
    elif all(detected):
        why = "all_found"
    elif not any(detected):
        why = "none_found"
    elif len(sizes) < _FEWEST or len(set(sizes)) < 3:
        why = "too_few"
    if why is not None:
        return Curve(why, separated=False, at_50=UNKNOWN, at_95=UNKNOWN, points=())
    # Size on an axis along which the fault grows: -ln m where a smaller magnitude is worse.
    direction = -1.0 if worse_when_smaller else 1.0
    log_sizes = direction * np.log(sizes)
    is_detected = np.array(detected)
    # The model has a slope b > 0: a falling rate would be fitted by the least slope allowed, and mean nothing.
    if log_sizes[is_detected].mean() <= log_sizes[~is_detected].mean():
        return Curve("not_rising", separated=False, at_50=UNKNOWN, at_95=UNKNOWN, points=())
    fit = fit_probit(log_sizes, is_detected)
    # The curve over the sizes of the trials, in order of magnitude.
    points_log = np.linspace(log_sizes.min(), log_sizes.max(), _POINTS)
    columns = zip(np.exp(direction * points_log), *fit.probability_at(points_log), strict=True)
    points = tuple(sorted((CurvePoint(*map(float, column)) for column in columns), key=lambda point: point.magnitude))
    return Curve(
        "fitted",
        separated=fit.separated,
        at_50=_estimate(fit, 0.50, direction),
        at_95=_estimate(fit, 0.95, direction),
        points=points,
    )


def _estimate(fit: ProbitFit, probability: float, direction: float) -> Estimate:
    value, low, high = (
        None if log_size is None else float(np.exp(direction * log_size)) for log_size in fit.log_size_at(probability)
    )
    # A negative direction exchanges the lower and the upper bound.
    return Estimate(value, low, high) if direction > 0 else Estimate(value, high, low)


def false_alarms(trials: Iterable[Trial], stated_rate: float) -> FalseAlarms:
    """Return how many clean files failed a check, of all and check by check."""
    clean = [trial for trial in trials if trial.item.is_clean]
    alarms = sum(trial.checked.is_found for trial in clean)
    failed = [check for trial in clean for check in trial.checked.failed]
    return FalseAlarms(
        files=share_of(alarms, len(clean)),
        upper=upper_bound(alarms, len(clean)),
        stated=stated_rate,
        chance=chance_of(alarms, len(clean), stated_rate),
        by_check={check: share_of(failed.count(check), len(clean)) for check in sorted(set(failed))},
    )

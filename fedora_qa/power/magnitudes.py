"""How well the size of a fault is estimated, where its cause is named first."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.power.binomial import share_of
from fedora_qa.power.naming import is_named_first
from fedora_qa.power.study import Trial
from fedora_qa.power.units import factor_between
from fedora_qa.record.power_types import MagnitudeError


@dataclass(frozen=True, slots=True)
class SizeEstimate:
    """A true magnitude, the size that the diagnosis states, and the error that was stated, all in one unit."""

    cause: str
    unit: str
    truth: float
    estimate: float
    standard_error: float | None


def magnitude_errors(trials: Sequence[Trial]) -> tuple[MagnitudeError, ...]:
    """Return the errors of each cause, those with one fault only, of the whole file or of a part of it."""
    sizes: dict[tuple[str, str], list[SizeEstimate]] = {}
    for trial in trials:
        size = _size_estimate(trial)
        if size is not None:
            sizes.setdefault((size.cause, size.unit), []).append(size)
    return tuple(_errors(cause, unit, group) for (cause, unit), group in sizes.items())


def _size_estimate(trial: Trial) -> SizeEstimate | None:
    """Return the estimated size of a fault; None where it was not named first, or the units are incompatible."""
    if len(trial.item.planted) != 1 or not trial.checked.is_found or not is_named_first(trial):
        return None
    (fault,), named = trial.item.planted, trial.checked.diagnoses[0]
    factor = factor_between(named.unit, fault.unit or "")
    if not fault.magnitude or named.magnitude is None or factor is None:
        return None
    error = None if not named.standard_error else named.standard_error * factor
    return SizeEstimate(fault.name, fault.unit or "", fault.magnitude, named.magnitude * factor, error)


def _errors(cause: str, unit: str, sizes: Sequence[SizeEstimate]) -> MagnitudeError:
    relative = [abs(size.estimate - size.truth) / abs(size.truth) for size in sizes]
    pulls = np.array([(size.estimate - size.truth) / size.standard_error for size in sizes if size.standard_error])
    return MagnitudeError(
        cause=cause,
        unit=unit,
        count=len(sizes),
        median_relative_error=float(np.median(relative)),
        with_error=len(pulls),
        pull_median=float(np.median(pulls)) if len(pulls) else None,
        # 1.4826 times the median absolute pull is sigma of a normal distribution; a few wrong sizes do not move it.
        pull_spread=float(MAD_TO_SIGMA * np.median(np.abs(pulls))) if len(pulls) else None,
        within_two=share_of(int((np.abs(pulls) < 2).sum()), len(pulls)),
    )

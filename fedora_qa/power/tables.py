"""All tables of a study together; and how well the size of a fault is estimated, where its cause is named first."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_qa import __version__
from fedora_qa.config import RULESET_VERSION, CheckConfig
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.power.binomial import share_of
from fedora_qa.power.detection import by_cause, detections, false_alarms
from fedora_qa.power.detection_power import estimators_digest
from fedora_qa.power.naming import accuracy_by_status, confusions, is_named_first, naming
from fedora_qa.power.stated_limits import stated_limits
from fedora_qa.power.study import Trial
from fedora_qa.power.units import factor_between
from fedora_qa.record.power_types import POWER_VERSION, MagnitudeError, Power
from fedora_qa.record.types import Tool


@dataclass(frozen=True, slots=True)
class Origin:
    """Of which corpus, begun when, and how its files were checked."""

    corpus: str
    started: str
    config: CheckConfig


@dataclass(frozen=True, slots=True)
class SizeEstimate:
    """A true magnitude, the size that the diagnosis states, and the error that was stated, all in one unit."""

    truth: float
    estimate: float
    standard_error: float | None


def power_of(trials: Sequence[Trial], origin: Origin) -> Power:
    """Return all tables of the trials."""
    clean = {trial.item.file: trial for trial in trials if trial.item.is_clean}
    # A copy of a clean file that fails by itself may fail by that false alarm, and not by its fault.
    informative = []
    for trial in trials:
        base = clean.get(trial.item.base or "")
        if base is None or not base.checked.is_found:
            informative.append(trial)
    causes = by_cause(informative)
    stated = [stated_limits(sized, clean) for sized in causes]
    return Power(
        power_version=POWER_VERSION,
        ruleset_version=RULESET_VERSION,
        tool=Tool("fedora-qa", __version__),
        estimators_digest=estimators_digest(),
        config_digest=origin.config.digest,
        effort=origin.config.effort,
        corpus=origin.corpus,
        started=origin.started,
        files=len(trials),
        clean=len(clean),
        crashed=tuple(trial.item.file for trial in trials if trial.checked.crashed),
        set_aside=len(trials) - len(informative),
        false_alarms=false_alarms(trials, origin.config.false_alarm_rate),
        naming=naming(informative),
        detections=tuple(row for sized in causes for row in detections(sized)),
        confusions=confusions(informative),
        magnitudes=magnitude_errors(informative),
        stated=tuple(row for true, _ in stated for row in true),
        not_comparable=tuple(row for _, other in stated for row in other),
        statuses=accuracy_by_status(informative),
    )


def magnitude_errors(trials: Sequence[Trial]) -> tuple[MagnitudeError, ...]:
    """Return the errors of each cause, those with one fault only, of the whole file or of a part of it.

    Faults that were not named first, without a size, or stated in an incompatible unit are left out.
    """
    by_cause_and_unit: dict[tuple[str, str], list[SizeEstimate]] = {}
    for trial in trials:
        if len(trial.item.planted) != 1 or not trial.checked.is_found or not is_named_first(trial):
            continue
        (fault,), named = trial.item.planted, trial.checked.diagnoses[0]
        factor = factor_between(named.unit, fault.unit or "")
        if fault.magnitude and named.magnitude is not None and factor is not None:
            error = None if not named.standard_error else named.standard_error * factor
            size = SizeEstimate(fault.magnitude, named.magnitude * factor, error)
            by_cause_and_unit.setdefault((fault.name, fault.unit or ""), []).append(size)
    errors = []
    for (cause, unit), sizes in by_cause_and_unit.items():
        relative = [abs(size.estimate - size.truth) / abs(size.truth) for size in sizes]
        pulls = np.array([(size.estimate - size.truth) / size.standard_error for size in sizes if size.standard_error])
        errors.append(
            MagnitudeError(
                cause=cause,
                unit=unit,
                count=len(sizes),
                median_relative_error=float(np.median(relative)),
                with_error=len(pulls),
                pull_median=float(np.median(pulls)) if len(pulls) else None,
                # 1.4826 times the median absolute pull is sigma of a normal distribution; a few wrong sizes do not move
                # it.
                pull_spread=float(MAD_TO_SIGMA * np.median(np.abs(pulls))) if len(pulls) else None,
                within_two=share_of(int((np.abs(pulls) < 2).sum()), len(pulls)),
            )
        )
    return tuple(errors)

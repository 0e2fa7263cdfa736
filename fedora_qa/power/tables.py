"""All tables of a study: what was found, which causes were named, and how well sizes were estimated."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from fedora_qa import __version__
from fedora_qa.config import RULESET_VERSION, CheckConfig
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.power.detection import by_cause, detections, factor_between, false_alarms, share_of
from fedora_qa.power.detection_power import estimators_digest
from fedora_qa.power.stated_limits import stated_limits
from fedora_qa.power.study import Trial
from fedora_qa.record.power_study import (
    NO_CAUSE,
    NOT_FOUND,
    POWER_VERSION,
    Confusion,
    Kind,
    MagnitudeError,
    Naming,
    Power,
    StatusAccuracy,
)
from fedora_qa.record.types import DiagnosisStatus, Tool


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
        truth = fault.signed_magnitude
        if truth and named.magnitude is not None and factor is not None:
            error = None if not named.standard_error else named.standard_error * factor
            size = SizeEstimate(truth, named.magnitude * factor, error)
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


def naming(trials: Sequence[Trial]) -> tuple[Naming, ...]:
    """Return, for each kind of faults that occurs, the shares found and named."""
    rows = []
    for kind in get_args(Kind):
        planted = _planted(trials, kind)
        if not planted:
            continue
        detected = [trial for trial in planted if trial.checked.is_found]
        observable = [trial.checked.is_found for trial in planted if trial.item.observable]
        all_named = [
            {fault.name for fault in trial.item.planted} <= {verdict.name for verdict in trial.checked.diagnoses}
            for trial in detected
        ]
        rows.append(
            Naming(
                kind=kind,
                found=share_of(len(detected), len(planted)),
                observable=share_of(sum(observable), len(observable)),
                named_first=share_of(sum(is_named_first(trial) for trial in detected), len(detected)),
                all_named=share_of(sum(all_named), len(detected)),
            )
        )
    return tuple(rows)


def confusions(trials: Sequence[Trial]) -> tuple[Confusion, ...]:
    """Return the matrix of planted against first-named cause, without its zeros; the planted in order of the corpus."""
    confused = []
    for kind in get_args(Kind):
        counts = Counter((planted_name(trial), first_named(trial)) for trial in _planted(trials, kind))
        confused += [Confusion(kind, planted, named, count) for (planted, named), count in counts.items()]
    return tuple(confused)


def accuracy_by_status(trials: Sequence[Trial]) -> tuple[StatusAccuracy, ...]:
    """Return how many diagnoses of each status are right, over all causes and by cause; what names none is left out.

    Every diagnosis counts, not the first alone, and those of clean files, which are wrong.
    """
    right, of = Counter[tuple[DiagnosisStatus, str]](), Counter[tuple[DiagnosisStatus, str]]()
    for trial in trials:
        planted = {fault.name for fault in trial.item.planted}
        for named in trial.checked.diagnoses:
            for cause in ("", named.name.rpartition(":")[2]):
                of[named.status, cause] += 1
                right[named.status, cause] += named.name in planted
    return tuple(
        StatusAccuracy(status, cause, share_of(right[status, cause], count))
        for status in get_args(DiagnosisStatus)
        if status != "unidentified"
        for (counted, cause), count in sorted(of.items())
        if counted == status
    )


def planted_name(trial: Trial) -> str:
    """Return ``stream:cause`` of what was planted, several with a plus between."""
    return "+".join(fault.name for fault in trial.item.planted)


def first_named(trial: Trial) -> str:
    """Return ``stream:cause`` of the first diagnosis, or why there is none."""
    if not trial.checked.is_found:
        return NOT_FOUND
    return trial.checked.diagnoses[0].name if trial.checked.diagnoses else NO_CAUSE


def is_named_first(trial: Trial) -> bool:
    """Whether the first diagnosis is a cause that was planted."""
    return first_named(trial) in {fault.name for fault in trial.item.planted}


def _planted(trials: Sequence[Trial], kind: Kind) -> list[Trial]:
    return [trial for trial in trials if not trial.item.is_clean and trial.item.kind == kind]

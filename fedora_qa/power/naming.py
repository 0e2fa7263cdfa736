"""Whether what was planted is what is named."""

from collections import Counter
from collections.abc import Sequence
from typing import get_args

from fedora_qa.power.binomial import share_of
from fedora_qa.power.study import Trial
from fedora_qa.record.power_types import NO_CAUSE, NOT_FOUND, Confusion, Kind, Naming, StatusAccuracy
from fedora_qa.record.types import DiagnosisStatus


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

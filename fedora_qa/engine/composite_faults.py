"""Name the causes of a file's findings, one fault after the other: undo the first, and look at what is left.

Faults of one stream hide each other: events of inverted polarity have no delay that could be measured. Where the causes
that were named for the whole file, each tested alone, do not clear all findings, the first that a trial supports is
undone in all windows, and causes are named for what then still fails, in the same way. This explanation counts if
undoing its causes one after the other clears more findings than undoing each cause alone, and leaves no finding that
only undoing has brought about.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.protocol import Check
from fedora_qa.diagnosis.coincidence import places_of_clocks
from fedora_qa.diagnosis.diagnose import choose_causes, rank_candidates
from fedora_qa.diagnosis.trial import UndoTrial
from fedora_qa.engine.altered import PlainRun
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.trials import TrialBench, run_trials
from fedora_qa.judgement.judge import Alarm
from fedora_qa.judgement.materiality import Materiality
from fedora_qa.record.types import Diagnosis


@dataclass(frozen=True, slots=True)
class Explanation:
    """The causes of the findings of a file.

    Attributes
    ----------
    diagnoses
        In the order in which their faults are undone; those without a fault may stand anywhere.
    trials
        By the identifier of the diagnosis, where its fault was undone.
    """

    diagnoses: tuple[Diagnosis, ...]
    trials: Mapping[str, UndoTrial]


def name_causes(
    alarms: Sequence[Alarm],
    checks: Sequence[Check[Any]],
    run: PlainRun,
    materiality: Materiality,
    progress: Progress,
    *,
    with_trials: bool,
) -> Explanation:
    """Name the causes of alarms by undoing proposed faults.

    Parameters
    ----------
    alarms
        Of the file.
    checks
        Those whose question can be asked of the file.
    run
        The run of the file.
    materiality
        By which the file was judged.
    progress
        Is told what is tried.
    with_trials
        False: causes are named by what the checks measured, and nothing is undone.
    """
    bench = TrialBench(alarms, checks, run, allowance=None if with_trials else 0)
    return _explain(bench, materiality, progress)


def _explain(bench: TrialBench, materiality: Materiality, progress: Progress) -> Explanation:
    apart = _each_alone(bench, progress)
    cleared = {finding for diagnosis in apart.diagnoses for finding in diagnosis.cleared}
    if len(cleared) == len(bench.alarms):
        return apart
    first = next((d for d in apart.diagnoses if d.id in apart.trials and apart.trials[d.id].reduces), None)
    without = bench.without(apart.trials[first.id], materiality) if first is not None else None
    if first is None or without is None:
        return apart
    rest = _explain(without, materiality, progress)
    return _in_turn(first, apart, rest, bench.alarms, without.alarms) or apart


def _each_alone(bench: TrialBench, progress: Progress) -> Explanation:
    """Name causes of which each is tested with the others in place."""
    alarms, run = bench.alarms, bench.run
    facts = run.ready.facts
    hypotheses = {alarm.finding.id: hypotheses_of(alarm, facts) for alarm in alarms}
    places = places_of_clocks(facts)
    candidates = rank_candidates(alarms, hypotheses, run.strict, places)
    trials = run_trials(bench, candidates, progress)
    diagnoses = choose_causes(alarms, hypotheses, trials, run.strict, places)
    keys = {diagnosis.id: (diagnosis.cause, diagnosis.stream) for diagnosis in diagnoses}
    return Explanation(diagnoses, {d: trials[key] for d, key in keys.items() if key in trials})


def _in_turn(
    first: Diagnosis, apart: Explanation, rest: Explanation, alarms: Sequence[Alarm], alarms_left: Sequence[Alarm]
) -> Explanation | None:
    """Return the explanation by the first cause, and by what then was named; None where that is no better.

    Parameters
    ----------
    first
        The cause whose fault was undone, of the causes that were tested ``apart``.
    rest
        Of ``alarms_left``, what failed with the fault undone.
    alarms
        Of the file with all its faults.
    """
    # The same question: a measurement keeps its name and code. Identifiers of findings are those of each run.
    identifiers = {_question(alarm): alarm.finding.id for alarm in alarms}
    counterparts = {alarm.finding.id: identifiers.get(_question(alarm)) for alarm in alarms_left}
    cleared_after = {finding for diagnosis in rest.diagnoses for finding in diagnosis.cleared}
    remaining = {counterparts[finding] for finding in counterparts if finding not in cleared_after}
    cleared_apart = {finding for diagnosis in apart.diagnoses for finding in diagnosis.cleared}
    # None: a finding without a counterpart, which only undoing has brought about, is left.
    if None in remaining or len(identifiers) - len(remaining) <= len(cleared_apart):
        return None
    # The size of the first was not right, which is no second fault.
    if any((diagnosis.cause, diagnosis.stream) == (first.cause, first.stream) for diagnosis in rest.diagnoses):
        return None

    def translated(findings: Sequence[str]) -> tuple[str, ...]:
        return tuple(identifier for finding in findings if (identifier := counterparts[finding]))

    description = apart.trials[first.id].description
    after = [
        replace(
            diagnosis,
            explains=translated(diagnosis.explains),
            cleared=translated(diagnosis.cleared),
            tried=tuple(f"{description}, then {tried}" for tried in diagnosis.tried),
        )
        for diagnosis in rest.diagnoses
    ]
    # Causes that were named before the first that was undone, such as those that cannot be undone, stay before it.
    keys = [(diagnosis.cause, diagnosis.stream) for diagnosis in apart.diagnoses]
    earlier = set(keys[: keys.index((first.cause, first.stream))])
    ordered = sorted([first, *after], key=lambda d: d is first or (d.cause, d.stream) not in earlier)
    diagnoses: list[Diagnosis] = []
    trials: dict[str, UndoTrial] = {}
    for diagnosis in ordered:
        if not diagnosis.explains:
            continue
        diagnoses.append(replace(diagnosis, id=f"D{len(diagnoses) + 1}"))
        trial = apart.trials[first.id] if diagnosis is first else rest.trials.get(diagnosis.id)
        if trial is not None:
            trials[diagnoses[-1].id] = trial
    return Explanation(tuple(diagnoses), trials)


def _question(alarm: Alarm) -> tuple[str, str]:
    return alarm.statistic.code, alarm.statistic.name

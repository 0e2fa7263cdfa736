"""Name the causes of a file's findings, one fault after the other: undo the first, and look at what is left.

Faults of one stream hide each other: events of inverted polarity have no delay that could be measured. Where the causes
that were named, each tested alone, leave findings, or undoing brings some about, the first that a trial supports is
undone in all windows, and causes are named for what then still fails, in the same way. This explanation counts if
undoing its causes one after the other clears more findings than undoing each of them alone, or findings that the first
had hidden, and leaves no finding that only undoing has brought about.

Of causes that one finding shows together, such as inverted polarity of events that are upside down, none clears
anything alone. The first of them is undone before any is tried.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.protocol import Check
from fedora_qa.diagnosis.clock_grids import ClockPlace, places_of_clocks
from fedora_qa.diagnosis.conclusion import Trials, UndoTrial
from fedora_qa.diagnosis.diagnose import choose_causes, key_of, rank_candidates
from fedora_qa.diagnosis.event_balance import without_balance_of_wrong_frames
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.trials.altered import PlainRun
from fedora_qa.engine.trials.explanation import CauseExplanation
from fedora_qa.engine.trials.inquiry import run_trials
from fedora_qa.engine.trials.trial import TrialBench
from fedora_qa.judgement.judge import Alarm
from fedora_qa.judgement.materiality import Materiality
from fedora_qa.record.types import Diagnosis

_Key = tuple[str, str]
"""Cause and stream."""


def name_causes(
    alarms: Sequence[Alarm],
    checks: Sequence[Check[Any]],
    run: PlainRun,
    materiality: Materiality,
    progress: Progress,
    *,
    with_trials: bool,
) -> CauseExplanation:
    """Name the causes of alarms by undoing proposed faults.

    Parameters
    ----------
    checks
        Those whose question can be asked of the file.
    materiality
        By which the file was judged.
    with_trials
        False: causes are named by what the checks measured, and nothing is undone.
    """
    bench = TrialBench.of(alarms, checks, run)
    if not with_trials:
        bench.work.left = 0
    return _explain(bench, materiality, progress)


@dataclass(frozen=True, slots=True)
class _Round:
    """What the findings of one run could be due to, and what trials of each cause alone have changed."""

    bench: TrialBench
    hypotheses: Mapping[str, Sequence[Hypothesis]]
    places: Mapping[str, ClockPlace]
    trials: Trials

    @staticmethod
    def untried(bench: TrialBench) -> "_Round":
        """Return the round of a run with the causes that are proposed, of which none was tried."""
        facts = bench.run.ready.facts
        alarms = without_balance_of_wrong_frames(bench.alarms)
        hypotheses = {alarm.finding.id: hypotheses_of(alarm, facts) for alarm in alarms}
        return _Round(bench, hypotheses, places_of_clocks(facts), {})

    def tried(self, progress: Progress) -> "_Round":
        """Return the round with the fault of each cause undone alone."""
        bench = self.bench
        candidates = rank_candidates(bench.alarms, self.hypotheses, bench.run.strict, self.places)
        return replace(self, trials=run_trials(bench, candidates, self.places, progress))

    def explanation(self, trials: Trials | None = None) -> CauseExplanation:
        """Return the causes by the trials of the round, or by others."""
        trials = self.trials if trials is None else trials
        diagnoses = choose_causes(self.bench.alarms, self.hypotheses, trials, self.bench.run.strict, self.places)
        tried = {d.id: trials[key_of(d)] for d in diagnoses if key_of(d) in trials}
        return CauseExplanation(diagnoses, tried, dict.fromkeys(tried, self.bench))

    def joint_trial(self) -> tuple[_Key, UndoTrial] | None:
        """Return the first of several causes that one finding shows together, as a trial that clears nothing."""
        joint = next((h for of_finding in self.hypotheses.values() for h in of_finding if h.is_joint), None)
        if joint is None or self.bench.work.left <= 0:
            return None
        run = self.bench.run
        cause, stream, facts = joint.cause, joint.stream, run.ready.facts
        fault = next(faults_for(cause, stream, joint.magnitude, self.bench.alarms, run.strict, facts), None)
        if fault is None:
            return None
        description = fault.undo(facts, run.sequence).description
        return (cause, stream), UndoTrial(fault, description, frozenset(), {}, (), 0)

    def explained_by(self, key: _Key) -> set[str]:
        """Return the findings that a cause would explain."""
        return {f for f, of_finding in self.hypotheses.items() if key in ((h.cause, h.stream) for h in of_finding)}


def _explain(bench: TrialBench, materiality: Materiality, progress: Progress) -> CauseExplanation:
    untried = _Round.untried(bench)
    if (joint := untried.joint_trial()) is not None:
        first, trial = joint
        together = _with_first_undone(untried, first, trial, untried.explained_by(first), set(), materiality, progress)
        if together is not None:
            return together
    alone = untried.tried(progress)
    apart = alone.explanation()
    cleared = _settled(apart)
    reducing = next((d for d in apart.diagnoses if d.id in apart.trials and apart.trials[d.id].reduces), None)
    if reducing is None or not _leaves_some(apart.trials[reducing.id], reducing, cleared, bench.alarms):
        return apart
    first, trial, explained = key_of(reducing), apart.trials[reducing.id], set(reducing.explains)
    return _with_first_undone(alone, first, trial, explained, cleared, materiality, progress) or apart


def _with_first_undone(
    alone: _Round,
    first: _Key,
    trial: UndoTrial,
    explained: Collection[str],
    cleared: Collection[str],
    materiality: Materiality,
    progress: Progress,
) -> CauseExplanation | None:
    """Name the causes of what fails with a first one undone."""
    bench = alone.bench
    without = bench.without(trial.fault, materiality)
    if without is None:
        return None
    rest = _explain(without, materiality, progress)
    # The size of the first was not right, which is no second fault.
    if first in map(key_of, rest.diagnoses):
        return None
    # Identifiers of findings are those of each run; a measurement keeps its code and name.
    identifiers = {_question(alarm): alarm.finding.id for alarm in bench.alarms}
    counterparts = {alarm.finding.id: identifiers.get(_question(alarm)) for alarm in without.alarms}
    cleared_after = _settled(rest)
    remaining = {counterparts[finding] for finding in counterparts if finding not in cleared_after}
    # None: a finding without a counterpart, which only undoing has brought about, is left.
    gained = len(identifiers) - len(remaining) - len(cleared)
    is_hidden = None in counterparts.values()
    if None in remaining or gained < 0 or (gained == 0 and not is_hidden):
        return None
    windows = len(without.run.planned(without.run.ready))
    # What the other causes leave of each finding that remains.
    ratios = {
        identifier: ratio
        for of_other in rest.trials.values()
        for finding, ratio in of_other.left.items()
        if (identifier := counterparts.get(finding)) in remaining and identifier is not None
    }
    if not without.alarms:
        # What is no finding any more may still exceed its limit, by less than is material: undoing does not clear it.
        immaterial = without.left_of(bench.alarms, bench.run.strict)
        remaining |= immaterial.keys()
        ratios |= immaterial
    with_others = _with_others_undone(trial, explained, remaining, ratios, windows)
    amended = alone.explanation({**alone.trials, first: with_others})
    return _in_turn(first, amended, rest, counterparts) if first in map(key_of, amended.diagnoses) else None


def _settled(explanation: CauseExplanation) -> set[str]:
    """Return the findings that trials clear, and those that a cause explains of which its windows showed nothing."""
    settled: set[str] = set()
    for diagnosis in explanation.diagnoses:
        settled.update(diagnosis.cleared)
        # Trials of causes that were looked for later name the findings of their own run.
        if diagnosis.cleared and not diagnosis.after:
            settled.update(set(diagnosis.explains) - explanation.trials[diagnosis.id].left.keys())
    return settled


def _leaves_some(trial: UndoTrial, cause: Diagnosis, cleared: Collection[str], alarms: Sequence[Alarm]) -> bool:
    """Whether a trial leaves or brings about findings, beside those that no cause clears and this one does not explain.

    What the windows of the trial did not show counts as explained.
    """
    undecided = set(cause.explains) - trial.left.keys()
    return bool(trial.caused) or any(a.finding.id not in cleared and a.finding.id not in undecided for a in alarms)


def _with_others_undone(
    trial: UndoTrial,
    explained: Collection[str],
    remaining: Collection[str | None],
    ratios: Mapping[str, float],
    windows: int,
) -> UndoTrial:
    """Return a trial as it is in all windows with the other faults undone, too.

    What it would explain is cleared, unless it remains, by a ratio of the deviation where trials of the others give it.
    What it brought about were findings of the other faults, which it had hidden.
    """
    cleared = trial.cleared.union(explained).difference(remaining)
    left = {finding: ratio for finding, ratio in trial.left.items() if finding not in cleared}
    left |= {f: ratios.get(f, left.get(f, 1.0)) for f in explained if f in remaining}
    return replace(trial, cleared=cleared, cleared_alone=trial.cleared, left=left, caused=(), windows=windows)


def _in_turn(
    first: tuple[str, str], apart: CauseExplanation, rest: CauseExplanation, counterparts: Mapping[str, str | None]
) -> CauseExplanation:
    """Return the causes of a file of which one was undone before the others were named."""

    def translated(findings: Sequence[str]) -> tuple[str, ...]:
        return tuple(identifier for finding in findings if (identifier := counterparts[finding]))

    keys = [key_of(diagnosis) for diagnosis in apart.diagnoses]
    first_cause = apart.diagnoses[keys.index(first)]
    # Causes that were named before the first that was undone, such as those without an inverse, stay before it.
    earlier = set(keys[: keys.index(first)])
    # A cause of hidden findings alone explains none of the file's, and counts where it was tested.
    others = [d for d in rest.diagnoses if translated(d.explains) or d.cleared]
    before = [diagnosis for diagnosis in others if key_of(diagnosis) in earlier]
    after = [diagnosis for diagnosis in others if key_of(diagnosis) not in earlier]
    number_of = {d.id: f"D{n}" for n, d in enumerate([*before, first_cause, *after], 1) if d is not first_cause}
    number = f"D{len(before) + 1}"
    trials, benches = {number: apart.trials[first_cause.id]}, {number: apart.benches[first_cause.id]}
    diagnoses = []
    for diagnosis in (*before, first_cause, *after):
        if diagnosis is first_cause:
            diagnoses.append(replace(first_cause, id=number))
            continue
        own = number_of[diagnosis.id]
        if trial := rest.trials.get(diagnosis.id):
            trials[own], benches[own] = trial, rest.benches[diagnosis.id]
        diagnoses.append(
            replace(
                diagnosis,
                id=own,
                explains=translated(diagnosis.explains),
                cleared=translated(diagnosis.cleared),
                after=(number, *(number_of[other] for other in diagnosis.after)) if diagnosis.tried else (),
            )
        )
    return CauseExplanation(tuple(diagnoses), trials, benches)


def _question(alarm: Alarm) -> tuple[str, str]:
    return alarm.statistic.code, alarm.statistic.name

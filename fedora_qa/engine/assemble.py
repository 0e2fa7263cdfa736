"""From the passes over the windows to the record of the file: follow-ups, judgement, evidence, canaries."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.engine.measure import PassState, attempt, conclude, follow_up, merge_all
from fedora_qa.engine.options import FileRun
from fedora_qa.engine.outcomes import lost_windows, results_in_order
from fedora_qa.engine.plan import FOLLOW_UP_SHARE
from fedora_qa.engine.progress import MEASURING, Progress, Stopwatch
from fedora_qa.engine.survey import OpenSurvey, Prepared, Survey
from fedora_qa.engine.trials.altered import PlainRun
from fedora_qa.engine.trials.explanation import CauseExplanation
from fedora_qa.engine.trials.views import SequenceViews
from fedora_qa.evidence.collector import EvidenceCollector
from fedora_qa.evidence.distributions import DistributionsCollector
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.evidence.trajectory import keep_trajectory
from fedora_qa.evidence.worst_locations import images_of, keep_worst_locations
from fedora_qa.judgement.judge import judge
from fedora_qa.judgement.materiality import materiality_of
from fedora_qa.judgement.places import join_places
from fedora_qa.judgement.verdict import comparisons_of, crossing_streams, uncompared_streams, verdict_of
from fedora_qa.layout.canonical import FRAMES_OF_MAP
from fedora_qa.record.evidence import AGREEMENT, named
from fedora_qa.record.types import CHECK_SECONDS, Canary, FileRecord, Finding, Outcome
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span
from fedora_qa.storage.place import RemoteFile
from fedora_qa.views.storage_steps import inferred_steps


def assemble(
    survey: Survey, file: OpenSurvey, parts: Iterable[PassState], lost: Sequence[int], progress: Progress
) -> FileRun:
    """Judge a file by the passes over its windows.

    Parameters
    ----------
    parts
        Passes over batches of windows, in the order of time.
    lost
        Windows that could not be measured, by their numbers on the grid.
    """
    # A copy: within a budget of time a survey is judged several times.
    watch = Stopwatch(dict(survey.seconds))
    ready, options, asked = file.ready, survey.options, file.asked
    facts, decoded_before = ready.facts, ready.decoder.decoded_bytes
    with watch.stage(MEASURING):
        states = merge_all(file.accumulators, parts, facts)
    # Beside the seconds of merging, those that the windows took in all processes.
    watch.seconds[MEASURING] += states.measuring_s
    lost_spans = [ready.spans[number] for number in lost]
    measured_spans = [span for span in file.chosen if span not in lost_spans]
    with watch.stage("second look"):
        follow_up_count = follow_up(asked, states, measured_spans, facts, ready.decoder, survey.plan.sampling, progress)
    with watch.stage("judgement"):
        observations = conclude(asked, states, facts)
        materiality = materiality_of(options.profile, facts)
        judged = judge(observations, asked, options.false_alarm_rate, materiality)
        alarms = [alarm for result in judged for alarm in result.alarms]
        strict = {j.result.check: j.result for j in judge(observations, asked, options.false_alarm_rate)}
    views = SequenceViews.of(file.sequence, ready)
    plain = PlainRun(
        file.sequence,
        views.prepared(file.sequence, ready, frozenset()),
        observations,
        strict,
        options.effort,
        options.false_alarm_rate,
        views,
    )
    causes = CauseExplanation()
    with watch.stage("diagnosis"):
        if alarms:
            from fedora_qa.engine.trials.composite_faults import name_causes  # noqa: PLC0415 - loads every fault

            # Views decode rows for themselves.
            ready.decoder.leases.forget()
            # Within a budget a file is judged several times, and every second belongs to its windows.
            causes = name_causes(alarms, asked, plain, materiality, progress, with_trials=options.budget_s is None)
        judged, diagnoses = join_places(judged, causes.diagnoses)
        alarms = [alarm for result in judged for alarm in result.alarms]
    with watch.stage("statistics"):
        collector = file.statistics
        tables = attempt(states, collector.name, lambda: collector.conclude(states.states[collector.name], facts))
    with watch.stage("evidence"):
        evidence = _evidence_of_checks(observations)
        evidence_options = options.evidence
        if file.evidence is not None and file.distributions is not None and evidence_options is not None:
            findings = [alarm.finding for alarm in alarms]
            of_pass = _evidence_of_pass(
                file.evidence, states, findings, ready, file.chosen, evidence_options, follow_up_count
            )
            groups = [of_pass, evidence, distributions_of(file.distributions, states, facts)]
            if alarms:
                from fedora_qa.engine.trials.evidence import keep_trials  # noqa: PLC0415 - loads every fault

                of_trials = partial(keep_trials, diagnoses, causes.trials, causes.benches, evidence_options)
                groups.append(attempt(states, file.evidence.name, of_trials) or TitledArrays())
                groups.append(_keep_agreement(asked, {each.result.check: each.result.outcome for each in judged}))
            evidence = merged(groups)
    results = results_in_order(survey.checks, judged, states, survey.reasons)
    canaries: tuple[Canary, ...] = ()
    if options.canary:
        from fedora_qa.engine.trials.canaries import held_to_canaries, prove_alive  # noqa: PLC0415 - loads every fault

        with watch.stage("canaries"):
            proofs = prove_alive(survey.checks, results, plain, progress)
            results = held_to_canaries(results, proofs)
            canaries = tuple(proof.canary for proof in proofs)
    # Last, as this result belongs to no check, and no canary is planted for it.
    results += lost_windows(lost_spans, len(file.windows), facts)
    inferred = dict(facts.layout.inferred) | inferred_steps(facts)
    for observation in observations.values():
        inferred.update(observation.inferred)
    # The version tag of a file behind a URL, as its partial digest does not cover all bytes.
    if isinstance(survey.path, RemoteFile) and survey.version.tag:
        inferred["storage.version"] = survey.version.tag
    needs = {check.name: check.needs for check in survey.checks}
    crossing = crossing_streams(needs)
    record = FileRecord(
        path=str(survey.path),
        size=survey.version.size,
        sha256=survey.digest.sha256,
        digest_kind=survey.digest.kind,
        dialect=facts.layout.dialect_name,
        inferred=inferred,
        statistics=tables or {},
        verdict=verdict_of(results, crossing),
        results=results,
        diagnoses=diagnoses,
        evidence=evidence.titles,
        canaries=canaries,
        comparisons=comparisons_of(results, crossing),
        uncompared=uncompared_streams(results, needs, facts.streams),
    )
    seconds = watch.seconds | {f"{CHECK_SECONDS}{name}": spent for name, spent in states.seconds.items()}
    decoded_bytes = states.decoded_bytes + ready.decoder.decoded_bytes - decoded_before
    traffic = survey.traffic + states.traffic + file.sequence.traffic
    faults = {identifier: trial.fault for identifier, trial in causes.trials.items()}
    return FileRun(record, evidence.arrays, seconds, decoded_bytes, traffic, faults=faults)


def _keep_agreement(checks: Iterable[Check[Any]], outcomes: Mapping[str, Outcome]) -> TitledArrays:
    """Return numbers of passed and failed checks by pair of streams: the odd stream fails with all others.

    Parameters
    ----------
    checks
        Of the file. A check of three streams counts for each pair of them; all rates of flow are one stream.
    outcomes
        By check; those that are neither passed nor failed do not count.
    """
    counts: Counter[tuple[str, str, Outcome]] = Counter()
    for check in checks:
        # Index maps are no streams: they hold rows of events.
        streams = sorted({stream_family(stream) for stream in check.needs} - set(FRAMES_OF_MAP))
        for first, second in combinations(streams, 2):
            counts[first, second, outcomes.get(check.name, "crashed")] += 1
    pairs = sorted({(first, second) for first, second, outcome in counts if outcome in ("passed", "failed")})
    entries = {
        named(AGREEMENT, first, second): (
            np.array([counts[first, second, "passed"], counts[first, second, "failed"]]),
            f"Checks that compare {first} with {second}: passed, failed",
        )
        for first, second in pairs
    }
    return TitledArrays.titled(entries)


def _evidence_of_checks(observations: Mapping[str, Observation]) -> TitledArrays:
    """Return the arrays that checks keep, under ``<check>/<name>``; one without a title is called by its name."""
    return merged(
        TitledArrays.titled(
            {
                named(check, name): (array, observation.titles.get(name, name.replace("_", " ")))
                for name, array in observation.evidence.items()
            }
        )
        for check, observation in observations.items()
    )


def _evidence_of_pass(
    collector: EvidenceCollector,
    states: PassState,
    findings: Iterable[Finding],
    ready: Prepared,
    chosen: Sequence[Span],
    options: EvidenceOptions,
    follow_up_count: int,
) -> TitledArrays:
    """Return evidence of the pass, the trajectory and the worst places; a crash is noted and costs all that follows."""
    facts, source = ready.facts, ready.decoder
    # Images that may still be read again: the share of follow-ups less those done, and at least those of one window.
    mean = images_of(chosen) / max(len(chosen), 1)
    images = round(mean * max(1.0, FOLLOW_UP_SHARE * len(chosen) - follow_up_count))
    parts = (
        attempt(states, collector.name, lambda: collector.conclude(states.states[collector.name], facts)),
        attempt(
            states, collector.name, lambda: keep_trajectory(facts, source, options.trajectory_points, options.frusta)
        ),
        attempt(
            states, collector.name, lambda: keep_worst_locations(findings, ready.spans, facts, source, options, images)
        ),
    )
    return merged(part for part in parts if part is not None)


def distributions_of(collector: DistributionsCollector, states: PassState, facts: Facts) -> TitledArrays:
    """Return what was counted by block of time; nothing, and a note among the crashes, where that failed."""
    counted = attempt(states, collector.name, lambda: collector.conclude(states.states[collector.name], facts))
    return counted or TitledArrays()

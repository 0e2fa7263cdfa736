"""From the passes over the windows to the record of the file: follow-ups, judgement, evidence, canaries."""

from collections.abc import Iterable, Sequence

from fedora_qa.diagnosis.diagnose import diagnose
from fedora_qa.engine.evidence import distributions_of, evidence_of_checks, evidence_of_pass
from fedora_qa.engine.failures import lost_windows
from fedora_qa.engine.options import FileRun
from fedora_qa.engine.outcomes import results_in_order
from fedora_qa.engine.partial_pass import STAGE, PartialPass, together
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.stopwatch import Stopwatch
from fedora_qa.engine.stream import attempt, conclude, follow_up
from fedora_qa.engine.survey import OpenSurvey, Survey
from fedora_qa.evidence.titled_arrays import merged
from fedora_qa.judgement.judge import judge
from fedora_qa.judgement.verdict import crossing_streams, verdict_of
from fedora_qa.record.types import Canary, FileRecord
from fedora_qa.storage.place import RemoteFile


def finish_open(
    survey: Survey, file: OpenSurvey, parts: Iterable[PartialPass], lost: Sequence[int], progress: Progress
) -> FileRun:
    """Judge a file by the passes over its windows.

    Parameters
    ----------
    parts
        Passes over batches of windows, in the order of time.
    lost
        Windows of the survey that could not be measured, by their place in it.
    """
    # A copy: a survey is judged several times where judgement is rehearsed.
    watch = Stopwatch(dict(survey.seconds))
    decoded_before = file.ready.decoder.decoded_bytes
    with watch.stage(STAGE):
        measured = together(parts, file.accumulators, file.ready.facts)
    # Beside the seconds of merging, those that the windows took in all processes.
    watch.seconds[STAGE] += measured.seconds
    states, ready, options, asked = measured.states, file.ready, survey.options, file.asked
    facts = ready.facts
    never = [file.windows[number] for number in lost]
    measured_spans = [span for span in file.chosen if span not in never]
    with watch.stage("second look"):
        again = follow_up(
            asked, states, measured_spans, facts, ready.decoder, survey.plan.sampling, progress, ready.images
        )
    with watch.stage("judgement"):
        observations = conclude(asked, states, facts)
        judged = judge(observations, asked, options.false_alarm_rate)
        alarms = [alarm for result in judged for alarm in result.alarms]
        diagnoses = diagnose(alarms, facts)
    with watch.stage("statistics"):
        collector = file.statistics
        tables = attempt(states, collector.name, lambda: collector.conclude(states.states[collector.name], facts))
    with watch.stage("evidence"):
        kept = evidence_of_checks(observations)
        wanted = options.evidence
        if file.keeper is not None and file.distributions is not None and wanted is not None:
            findings = [alarm.finding for alarm in alarms]
            of_pass = evidence_of_pass(file.keeper, states, findings, ready, file.chosen, wanted, again)
            kept = merged([of_pass, kept, distributions_of(file.distributions, states, facts)])
    results = results_in_order(survey.checks, judged, states, survey.reasons)
    canaries: tuple[Canary, ...] = ()
    if options.canary:
        with watch.stage("canaries"):
            from fedora_qa.engine.canaries import (  # noqa: PLC0415 - few runs plant any
                PlainRun,
                held_to_canaries,
                prove_alive,
            )

            plain = PlainRun(
                file.sequence, ready, observations, options.effort, options.memory_bytes, options.false_alarm_rate
            )
            proofs = prove_alive(survey.checks, results, plain, progress)
            results = held_to_canaries(results, proofs)
            canaries = tuple(proof.canary for proof in proofs)
    # Last, as this result belongs to no check, and no canary is planted for it.
    results += lost_windows(never, len(file.windows), facts)
    inferred = dict(facts.layout.inferred)
    for observation in observations.values():
        inferred.update(observation.inferred)
    # The version tag of a file behind a URL, as its partial digest does not cover all bytes.
    if isinstance(survey.path, RemoteFile) and survey.version.tag:
        inferred["storage.version"] = survey.version.tag
    record = FileRecord(
        path=str(survey.path),
        size=survey.version.size,
        sha256=survey.digest.sha256,
        digest_kind=survey.digest.kind,
        dialect=facts.layout.dialect_name,
        inferred=inferred,
        statistics=tables or {},
        verdict=verdict_of(results, crossing_streams(survey.checks)),
        results=results,
        diagnoses=diagnoses,
        evidence=kept.titles,
        canaries=canaries,
    )
    seconds = watch.seconds | {f"check {name}": spent for name, spent in states.seconds.items()}
    decoded_bytes = measured.decoded_bytes + ready.decoder.decoded_bytes - decoded_before
    traffic = survey.traffic + measured.traffic + file.sequence.traffic
    return FileRun(record, kept.arrays, seconds, decoded_bytes, traffic)

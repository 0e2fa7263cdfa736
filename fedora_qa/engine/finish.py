"""From the passes over the windows to the record of the file: follow-ups, judgement, evidence, canaries."""

from collections.abc import Iterable, Mapping, Sequence

from fedora_qa.checks.protocol import Observation
from fedora_qa.diagnosis.diagnose import diagnose
from fedora_qa.engine.evidence import distributions_of, evidence_of_checks, evidence_of_pass
from fedora_qa.engine.failures import lost_windows
from fedora_qa.engine.options import FileRun
from fedora_qa.engine.outcomes import crossing_streams, results_in_order, verdict_of
from fedora_qa.engine.partial_pass import STAGE, PartialPass, together
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.stopwatch import Stopwatch
from fedora_qa.engine.stream import PassState, attempt, conclude, follow_up
from fedora_qa.engine.survey import OpenSurvey, Survey
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.judgement.judge import judge
from fedora_qa.record.types import Canary, FileRecord, Finding, Result, Scalar
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
        kept = _evidence(survey, file, states, observations, [alarm.finding for alarm in alarms], again)
    results = results_in_order(survey.checks, judged, states, survey.reasons)
    canaries: tuple[Canary, ...] = ()
    if options.canary:
        with watch.stage("canaries"):
            results, canaries = _proven(survey, file, observations, results, progress)
    # Last, as this result belongs to no check, and no canary is planted for it.
    results += lost_windows(never, len(file.windows), facts)
    record = FileRecord(
        path=str(survey.path),
        size=survey.version.size,
        sha256=survey.digest.sha256,
        digest_kind=survey.digest.kind,
        dialect=facts.layout.dialect_name,
        inferred=_inferred(facts.layout.inferred, observations) | _stored(survey),
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


def _evidence(
    survey: Survey,
    file: OpenSurvey,
    states: PassState,
    observations: Mapping[str, Observation],
    findings: Sequence[Finding],
    looked_again: int,
) -> TitledArrays:
    kept = evidence_of_checks(observations)
    if file.keeper is None or file.distributions is None or survey.options.evidence is None:
        return kept
    options = survey.options.evidence
    of_pass = evidence_of_pass(file.keeper, states, findings, file.ready, file.chosen, options, looked_again)
    return merged([of_pass, kept, distributions_of(file.distributions, states, file.ready.facts)])


def _proven(
    survey: Survey,
    file: OpenSurvey,
    observations: Mapping[str, Observation],
    results: tuple[Result, ...],
    progress: Progress,
) -> tuple[tuple[Result, ...], tuple[Canary, ...]]:
    """Return the results, held to their canaries, and these."""
    from fedora_qa.engine.canaries import PlainRun, held_to_canaries, prove_alive  # noqa: PLC0415 - few runs plant any

    options = survey.options
    plain = PlainRun(
        file.sequence, file.ready, observations, options.effort, options.memory_bytes, options.false_alarm_rate
    )
    proofs = prove_alive(survey.checks, results, plain, progress)
    return held_to_canaries(results, proofs), tuple(proof.canary for proof in proofs)


def _stored(survey: Survey) -> dict[str, Scalar]:
    """Return the version tag of a file behind a URL, whose partial digest does not cover all bytes."""
    return {"storage.version": survey.version.tag} if isinstance(survey.path, RemoteFile) and survey.version.tag else {}


def _inferred(by_layout: Mapping[str, Scalar], observations: Mapping[str, Observation]) -> dict[str, Scalar]:
    inferred = dict(by_layout)
    for observation in observations.values():
        inferred.update(observation.inferred)
    return inferred

"""Check one file from beginning to end."""

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from fedora_qa.checks import CHECKS
from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.engine.canaries import PlainRun, Proof, held_to_canaries, prove_alive
from fedora_qa.engine.digest import Digest, file_digest
from fedora_qa.engine.evidence import distributions_of, evidence_of_checks, evidence_of_pass
from fedora_qa.engine.outcomes import crossing_streams, results_in_order, verdict_of, why_not_applicable
from fedora_qa.engine.plan import Effort, make_plan
from fedora_qa.engine.prepare import prepare
from fedora_qa.engine.stream import Accumulator, Progress, attempt, conclude, look_again, measure
from fedora_qa.engine.unreadable import unreadable_record
from fedora_qa.errors import MisuseError, UnreadableFileError
from fedora_qa.evidence.collector import EvidenceCollector
from fedora_qa.evidence.distributions import DistributionsCollector
from fedora_qa.evidence.kept import together
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.judgement.diagnosis import diagnose
from fedora_qa.judgement.judge import judge
from fedora_qa.judgement.tolerances import DEFAULT_FALSE_ALARM_RATE
from fedora_qa.layout.dialect import Dialect
from fedora_qa.record.types import FileRecord, Scalar
from fedora_qa.sequence.sequence import Sequence, open_sequence
from fedora_qa.statistics.collector import StatisticsCollector

_MEBIBYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """How a file is to be checked.

    Attributes
    ----------
    select, ignore
        Names of checks (``subject`` or ``subject.property``) to run, all where empty, and to leave out. What is
        selected also bounds the statistics: values of streams that no selected check needs are not decoded.
    dialect
        How the file names and scales things; recognised from the file when None.
    memory_bytes
        What to aim at: shares of it bound the decoded blocks and what is computed of single images; what else checks
        compute follows the size of frames and the number of events.
    canary
        Whether each check must see a fault that is planted for it in memory; one that does not is ``crashed``.
    evidence
        How much to keep for a person to see; None: only what checks keep themselves.
    """

    effort: Effort = "full"
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    dialect: Dialect | None = None
    memory_bytes: int = 1024 * _MEBIBYTE
    false_alarm_rate: float = DEFAULT_FALSE_ALARM_RATE
    canary: bool = False
    evidence: EvidenceOptions | None = field(default_factory=EvidenceOptions)


@dataclass(frozen=True, slots=True)
class FileRun:
    """The record of one file, the evidence that lies beside it, and where the time went."""

    record: FileRecord
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    decoded_bytes: int = 0


@dataclass(slots=True)
class _Stopwatch:
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - began


def quiet(what: str, done: int, of: int) -> None:
    """Report no progress."""


def check_file(path: Path, options: CheckOptions, progress: Progress = quiet) -> FileRun:
    """Check one file.

    Raises
    ------
    MisuseError
        There is no such file, it is not HDF5, or the options name an unknown check.
    """
    checks = select_checks(options.select, options.ignore)
    watch = _Stopwatch()
    try:
        with watch.stage("open"):
            sequence = open_sequence(path, options.dialect)
    except UnreadableFileError as error:
        return FileRun(unreadable_record(path, file_digest(path), checks, str(error)), seconds=watch.seconds)
    with sequence:
        with watch.stage("digest"):
            digest = file_digest(path)
        return _check_open(sequence, digest, checks, options, progress, watch)


def select_checks(select: tuple[str, ...], ignore: tuple[str, ...]) -> tuple[Check[Any], ...]:
    """Return the checks that are asked for, in their fixed order.

    Raises
    ------
    MisuseError
        A name is that of no subject and no check.
    """
    known = {check.name for check in CHECKS} | {check.name.split(".")[0] for check in CHECKS}
    for name in (*select, *ignore):
        if name not in known:
            raise MisuseError(f"Expected a subject or check (see `fedora-qa checks`), got {name!r}")

    def named(check: Check[Any], names: tuple[str, ...]) -> bool:
        return check.name in names or check.name.split(".")[0] in names

    return tuple(check for check in CHECKS if (not select or named(check, select)) and not named(check, ignore))


def _check_open(
    sequence: Sequence,
    digest: Digest,
    checks: tuple[Check[Any], ...],
    options: CheckOptions,
    progress: Progress,
    watch: _Stopwatch,
) -> FileRun:
    with watch.stage("stamps"):
        progress("reading stamps", 0, 1)
        ready = prepare(sequence, options.memory_bytes)
    facts = ready.facts
    plan = make_plan(options.effort, len(ready.spans))
    reasons = {check.name: why_not_applicable(check, facts) for check in checks}
    asked = [check for check in checks if not reasons[check.name]]
    chosen = [ready.spans[number] for number in plan.chosen]
    statistics = StatisticsCollector(_needed_by(asked) if options.select else None)
    keeper = EvidenceCollector(ready.spans, chosen, options.evidence) if options.evidence else None
    distributions = DistributionsCollector(ready.spans)
    accumulators: list[Accumulator] = [*asked, statistics, *([keeper, distributions] if keeper else [])]
    with watch.stage("measuring"):
        states = measure(accumulators, chosen, facts, ready.decoder, plan.sampling, progress, ready.images)
    with watch.stage("second look"):
        looked_again = look_again(asked, states, chosen, facts, ready.decoder, plan.sampling, progress, ready.images)
    with watch.stage("judgement"):
        observations = conclude(asked, states, facts)
        judged = judge(observations, asked, options.false_alarm_rate)
        alarms = [alarm for one in judged for alarm in one.alarms]
        diagnoses = diagnose(alarms)
    with watch.stage("statistics"):
        tables = attempt(states, statistics.name, lambda: statistics.conclude(states.states[statistics.name], facts))
    with watch.stage("evidence"):
        kept = evidence_of_checks(observations)
        if keeper and options.evidence:
            findings = [alarm.finding for alarm in alarms]
            seen = evidence_of_pass(keeper, states, findings, ready, chosen, options.evidence, looked_again)
            kept = together([seen, kept, distributions_of(distributions, states, facts)])
    results = results_in_order(checks, judged, states, reasons)
    proofs: tuple[Proof, ...] = ()
    if options.canary:
        with watch.stage("canaries"):
            plain = PlainRun(
                sequence, ready, observations, options.effort, options.memory_bytes, options.false_alarm_rate
            )
            proofs = prove_alive(checks, results, plain, progress)
            results = held_to_canaries(results, proofs)
    record = FileRecord(
        path=str(sequence.path),
        size=sequence.path.stat().st_size,
        sha256=digest.sha256,
        digest_kind=digest.kind,
        dialect=sequence.layout.dialect_name,
        inferred=_inferred(sequence, observations),
        statistics=tables or {},
        verdict=verdict_of(results, crossing_streams(checks)),
        results=results,
        diagnoses=diagnoses,
        evidence=kept.titles,
        canaries=tuple(proof.canary for proof in proofs),
    )
    seconds = watch.seconds | {f"check {name}": spent for name, spent in states.seconds.items()}
    return FileRun(record, kept.arrays, seconds, ready.decoder.decoded_bytes)


def _needed_by(checks: Iterable[Check[Any]]) -> frozenset[str]:
    """Return the streams that the checks ask for: where some are selected, statistics shall cost no others."""
    return frozenset(stream for check in checks for stream in check.needs)


def _inferred(sequence: Sequence, observations: Mapping[str, Observation]) -> dict[str, Scalar]:
    inferred: dict[str, Scalar] = dict(sequence.layout.inferred)
    for observation in observations.values():
        inferred.update(observation.inferred)
    return inferred

"""Checks whose diagnosis is given, to test what a repair does with it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from fedora_qa.causes import CAUSES
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.tasks import check_file
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.record.types import Diagnosis, DiagnosisStatus, FileRecord, Finding, Result, Where

CheckFunction = Callable[[Path, CheckOptions, Progress], FileRun]


def diagnosis_of(
    fault: ReversibleFault,
    identifier: str = "D1",
    status: DiagnosisStatus = "confirmed",
    explains: tuple[str, ...] = ("F1",),
    cleared: tuple[str, ...] = (),
) -> Diagnosis:
    """The diagnosis of a fault."""
    unit = CAUSES[fault.cause].unit
    return Diagnosis(identifier, fault.cause, fault.stream, fault.magnitude, unit, None, 0.0, Where(fault.stream),
                     CAUSES[fault.cause].remedy, explains, status, (), cleared)  # fmt: skip


def record_with(path: Path, *codes: str, diagnoses: tuple[Diagnosis, ...] = ()) -> FileRecord:
    """A record of a file of which one check failed, with a finding for each code, or passed without any."""
    findings = tuple(Finding(f"F{n}", code, "error", "", Where()) for n, code in enumerate(codes, 1))
    result = Result("clocks.order", "failed" if codes else "passed", "?", findings=findings)
    verdict = "findings" if codes else "clean"
    return FileRecord(str(path), 0, "", "full", "fedora", {}, {}, verdict, (result,), diagnoses)


def given_check(
    source: Path,
    *faults: ReversibleFault,
    status: DiagnosisStatus = "confirmed",
    before: tuple[str, ...] = ("clocks.order.backward_steps",),
    after: tuple[str, ...] = (),
) -> CheckFunction:
    """A check that measures nothing: of the source it finds ``before`` and the faults, of any other file ``after``."""
    diagnoses = tuple(diagnosis_of(fault, f"D{n}", status) for n, fault in enumerate(faults, 1))

    def check(path: Path, _options: CheckOptions, _progress: Progress) -> FileRun:
        if path != source:
            return FileRun(record_with(path, *after))
        record = record_with(path, *before, diagnoses=diagnoses)
        return FileRun(record, faults={d.id: fault for d, fault in zip(diagnoses, faults, strict=True)})

    return check


def diagnosing_check(source: Path, *faults: ReversibleFault) -> CheckFunction:
    """The check of the engine, which names these faults for the failures of the source, each for all of them."""

    def check(path: Path, options: CheckOptions, progress: Progress) -> FileRun:
        run = check_file(path, options, progress)
        if path != source:
            return run
        failures = tuple(f.id for result in run.record.results if result.outcome == "failed" for f in result.findings)
        diagnoses = tuple(diagnosis_of(fault, f"D{n}", explains=failures) for n, fault in enumerate(faults, 1))
        record = replace(run.record, diagnoses=diagnoses)
        return replace(run, record=record, faults={d.id: f for d, f in zip(diagnoses, faults, strict=True)})

    return check

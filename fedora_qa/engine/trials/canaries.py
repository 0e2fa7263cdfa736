"""Verify each check: plant a fault in the data that it reads, and test whether the check detects it.

A check gets a canary where it passed on the file, or warned. The fault is planted on the window with most events first,
then on twice as many around it, and so on up to all planned windows, until the check gives a finding. It is judged by
the limits of the plain run. A check that gives no finding gets larger faults. One that detects none of them is deaf:
that it passed on the file is then no evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from fedora_qa.catalogue import canary_of
from fedora_qa.checks.protocol import Check
from fedora_qa.engine.measure import PassState, attempt
from fedora_qa.engine.outcomes import crashed_result
from fedora_qa.engine.plan import sees_every_window
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.trials.altered import PlainRun, WindowPass, busiest, growing
from fedora_qa.faults.canary_conditions import MULTIPLES, CanaryConditions, PlantCanary, UnplantableError
from fedora_qa.faults.fault import Fault
from fedora_qa.record.types import Canary, Outcome, Result
from fedora_qa.record.wording import OUTCOME_WORDS

_IN_ORDER: tuple[Outcome, ...] = ("passed", "warned")


@dataclass(frozen=True, slots=True)
class Proof:
    """A canary and, where the check did not detect it, the traceback of the check's own failure if there is one."""

    canary: Canary
    traceback: str = ""


def prove_alive(
    checks: Sequence[Check[Any]], results: Sequence[Result], run: PlainRun, progress: Progress
) -> tuple[Proof, ...]:
    """Plant a canary for each check that has a result, and return which of them were detected."""
    by_name = {check.name: check for check in checks}
    place_ns = 0
    if spans := run.planned(run.ready):
        span = busiest(spans)
        place_ns = (span.start_ns + span.stop_ns) // 2
    proofs = []
    for done, result in enumerate(results):
        plant, reason = canary_of(result.check), ""
        progress("planting canaries", done, len(results))
        if result.outcome == "failed":
            reason = "it failed on the file itself"
        elif result.outcome not in _IN_ORDER:
            reason = f"it was {OUTCOME_WORDS[result.outcome]} on the file"
        elif plant is None:
            reason = "there is no canary for it"
        if plant is None or reason:
            proofs.append(Proof(Canary(result.check, "not_planted", reason=reason)))
            continue
        check, attempted = by_name[result.check], PassState({})
        proof = attempt(
            attempted, check.name, partial(_plant_ever_larger, check, plant, run.strict[check.name], run, place_ns)
        )
        # A canary that fails itself proves nothing, and counts as not detected.
        if proof is None:
            failed = Canary(check.name, "silent", reason="its canary failed")
            proof = Proof(failed, attempted.crashes[check.name])
        proofs.append(proof)
    return tuple(proofs)


def held_to_canaries(results: Sequence[Result], proofs: Sequence[Proof]) -> tuple[Result, ...]:
    """Return the results, those of checks that stayed silent on their canary as crashed."""
    silent = {proof.canary.check: proof for proof in proofs if proof.canary.outcome == "silent"}
    held = []
    for result in results:
        proof = silent.get(result.check)
        if proof is None:
            held.append(result)
        elif proof.traceback:
            held.append(crashed_result(result.check, result.question, proof.traceback))
        else:
            reason = f"it did not see its own canary in {proof.canary.windows} windows: {proof.canary.fault}"
            held.append(replace(result, outcome="crashed", reason=reason))
    return tuple(held)


def _plant_ever_larger(check: Check[Any], plant: PlantCanary, result: Result, run: PlainRun, place_ns: int) -> Proof:
    """Plant ever larger faults until one is detected; a fault without a size is planted once."""
    proofs: dict[str, Proof] = {}
    for multiple in MULTIPLES:
        try:
            fault = plant(CanaryConditions(run.sequence, run.ready.facts, result.measurements, place_ns, multiple))
        except UnplantableError as why:
            return Proof(Canary(check.name, "not_planted", reason=str(why)))
        # A fault without a size is the same at every multiple.
        if fault.description in proofs:
            continue
        # A rule that the check already reports of the unchanged file is no detection of the fault.
        proof = _plant(check, fault, run, place_ns, known_rules=_rules([result]))
        if proof.canary.outcome == "seen" or proof.traceback:
            return proof
        proofs[fault.description] = proof
    # A check that cannot observe its question on the faulty rows is not deaf.
    withheld = [proof for proof in proofs.values() if proof.canary.outcome == "withheld"]
    return (withheld or list(proofs.values()))[0]


def _plant(check: Check[Any], fault: Fault, run: PlainRun, place_ns: int, *, known_rules: frozenset[str]) -> Proof:
    """Plant a fault on ever more windows; a finding of a rule that is not in ``known_rules`` is a detection."""
    faulty = run.altered_by(fault)
    canary, reason = Canary(check.name, "silent", fault.description), ""
    inner: WindowPass | None = None
    # Windows of the faulty sequence: a fault that moves time is cut into other windows than the file.
    for spans in growing((faulty.spans if sees_every_window(check.needs) else run.planned(faulty)), place_ns):
        inner = run.judged([check], spans, faulty, inner)
        results = [check_result.result for check_result in inner.judged]
        canary = replace(canary, windows=len(spans))
        if _rules(results) - known_rules:
            return Proof(replace(canary, outcome="seen"))
        if check.name in inner.crashes:
            return Proof(canary, inner.crashes[check.name])
        reason = "".join(result.reason for result in results if result.outcome == "not_observable")
    return Proof(replace(canary, outcome="withheld", reason=reason) if reason else canary)


def _rules(results: Sequence[Result]) -> frozenset[str]:
    return frozenset(finding.code for result in results for finding in result.findings)

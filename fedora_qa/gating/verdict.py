"""Make the record of a release from those of its sequences: rules, severities, waivers, baseline, in this order."""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Final

from fedora_qa.check_names import selected_explanations
from fedora_qa.gating.acceptance import Baseline, accept_known, rule_on_waivers, waive, with_severity
from fedora_qa.gating.policy import Policy
from fedora_qa.gating.release import Release, ReleaseResult, with_release_results
from fedora_qa.judgement.verdict import crossing_streams, verdict_of
from fedora_qa.record.types import FOLDER, FileRecord, Outcome, Record
from fedora_qa.record.wording import SHORT_OF_COVERAGE

_WITHOUT_VERDICT: Final[frozenset[Outcome]] = frozenset({"not_applicable", "not_observable"})


@dataclass(frozen=True, slots=True)
class Judgement:
    """The criteria for the sequences of a release."""

    policy: Policy
    baseline: Baseline | None
    today: date


def release_record(release: Release, files: Sequence[FileRecord]) -> FileRecord:
    """Return the record of a release before any rule: its digest is of the names and digests of its sequences.

    Parameters
    ----------
    files
        The records of the sequences, in the release's order.
    """
    listing = "".join(
        f"{file.sha256}  {sequence.name}\n" for file, sequence in zip(files, release.sequences, strict=True)
    )
    return FileRecord(
        path=str(release.folder),
        size=sum(file.size for file in files),
        sha256=hashlib.sha256(listing.encode("utf-8", "surrogateescape")).hexdigest(),
        digest_kind="partial" if any(file.digest_kind == "partial" for file in files) else "full",
        dialect="",
        inferred={},
        statistics={},
        verdict="clean",
        results=(),
    )


def judge_release(
    record: Record, release: Release, release_results: Iterable[ReleaseResult], judgement: Judgement
) -> Record:
    """Return the record as the policy judges it.

    Parameters
    ----------
    record
        Of the sequences, in the release's order, and last of the release itself, as ``release_record`` makes it.
    judgement
        The policy, the baseline, and the day on which waivers are tested.
    """
    policy, release_results = judgement.policy, tuple(release_results)
    names = [*(sequence.name for sequence in release.sequences), FOLDER]
    ruled = [with_release_results(name, file, release_results) for name, file in zip(names, record.files, strict=True)]
    weighed = [with_severity(file, policy.severity, policy.check.fail_on) for file in ruled]
    # A sequence is incomplete where a required check came to no verdict; the reason of the check states it.
    required = {each.check for name in policy.required_checks for each in selected_explanations((name,), ())}
    shortfall = f"could not tell {SHORT_OF_COVERAGE} it"
    files_judged = []
    for file in weighed[:-1]:
        results = tuple(
            replace(result, reason="; ".join(filter(None, (result.reason, shortfall))))
            if result.check in required and result.outcome in _WITHOUT_VERDICT
            else result
            for result in file.results
        )
        files_judged.append(file if results == file.results else replace(file, results=results, verdict="incomplete"))
    files_judged.append(weighed[-1])
    accepted = []
    for name, file in zip(names, files_judged, strict=True):
        waived = waive(name, file, policy.waivers, judgement.today)
        if judgement.baseline is not None:
            waived = accept_known(name, waived, judgement.baseline, policy.check.false_alarm_rate)
        accepted.append(waived)
    # Before anything is waived: a waiver is needed where its finding exists, in whichever order waivers are applied.
    on_waivers = rule_on_waivers(zip(names, files_judged, strict=True), policy.waivers, judgement.today)
    accepted[-1] = with_release_results(FOLDER, accepted[-1], [on_waivers])
    selected = selected_explanations(policy.check.select, policy.check.ignore)
    crossing = crossing_streams({each.check: each.needs for each in selected})
    verdicts = [_with_verdict(file, crossing) for file in accepted[:-1]]
    return replace(record, config_digest=policy.digest, files=(*verdicts, _with_verdict(accepted[-1], frozenset())))


def _with_verdict(file: FileRecord, crossing: frozenset[str]) -> FileRecord:
    """Return the file with the verdict of its results; an incomplete one stays incomplete, whatever is accepted."""
    if file.verdict == "incomplete":
        return file
    return replace(file, verdict=verdict_of(file.results, crossing))

"""How a file is to be checked, and what checking it gives, even where no process could open it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from fedora_qa.check_names import selected_explanations
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.judgement.verdict import DEFAULT_FALSE_ALARM_RATE
from fedora_qa.record.types import Diagnosis, FileRecord, Result, Verdict
from fedora_qa.storage.digest import Digest, file_digest
from fedora_qa.storage.place import Place
from fedora_qa.storage.server import NO_TRAFFIC, Traffic

if TYPE_CHECKING:  # loads what measures
    from numpy.typing import NDArray

    from fedora_qa.checks.protocol import Check
    from fedora_qa.faults.fault import ReversibleFault
    from fedora_qa.judgement.materiality import Profile
    from fedora_qa.layout.dialect import DialectChoice

Effort = Literal["quick", "standard", "full", "exhaustive"]

_MEBIBYTE: Final = 1 << 20

DIED_TWICE: Final = "died twice over it (out of memory, or a library crashed)"
ENDLESS: Final = "did not come to an end, and was ended"
"""How the processes that did a task ended, as a record states it."""


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """How a file is to be checked.

    Attributes
    ----------
    select, ignore
        Names of checks (``subject`` or ``subject.property``) to run, all where empty, and to leave out. What is
        selected also bounds the statistics: values of streams that no selected check needs are not decoded.
    dialect
        Names and units of the datasets, recognised from the file when None; and what is declared beside the files.
    memory_bytes
        A target: shares of it bound the decoded blocks and the arrays computed from single images. Other arrays of
        checks follow from the size of frames and the number of events.
    profile
        From which size a deviation matters. Configurations choose ``release`` where they name none.
    canary
        Whether each check must detect a fault that is planted for it in memory; one that does not is ``crashed``.
    budget_s
        Seconds that ``check_files`` may take over all files together, in place of the effort; None: no limit.
    evidence
        How much to keep for the reader of a report; None: only the evidence of the checks.
    allow_external
        Folders in which other files may be read that a local file links to, or is made of; none where empty.
    """

    effort: Effort = "full"
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    dialect: "DialectChoice" = None
    memory_bytes: int = 1024 * _MEBIBYTE
    false_alarm_rate: float = DEFAULT_FALSE_ALARM_RATE
    profile: "Profile" = "strict"
    canary: bool = False
    budget_s: float | None = None
    evidence: EvidenceOptions | None = field(default_factory=EvidenceOptions)
    allow_external: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class FileRun:
    """The record of one file, its evidence, the seconds of each stage, and the traffic with servers.

    ``reached`` states how many windows a budget of time sufficed for; empty without one. ``faults`` holds the fault
    that was undone for a diagnosis, by the identifier of the diagnosis.
    """

    record: FileRecord
    arrays: "Mapping[str, NDArray[Any]]" = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    decoded_bytes: int = 0
    traffic: Traffic = NO_TRAFFIC
    reached: str = ""
    faults: "Mapping[str, ReversibleFault]" = field(default_factory=dict)


def lost_file(
    path: Place, checks: "Iterable[Check[Any]] | None", options: CheckOptions, doing: str, end: str
) -> FileRun:
    """Return the run of a file that no process could open, or judge: every check crashed.

    Parameters
    ----------
    checks
        None: those that the options select.
    doing, end
        Parts of the reason: the step that failed, and how its process ended.
    """
    if checks is None:
        selected = selected_explanations(options.select, options.ignore)
        questions = {explanation.check: explanation.question for explanation in selected}
    else:
        questions = {check.name: check.question for check in checks}
    # Reads bytes only, not through HDF5, which may have ended the processes before.
    digest = file_digest(path)
    reason = f"the process by which it was {doing} {end}"
    results = tuple(Result(name, "crashed", question, reason=reason) for name, question in questions.items())
    return FileRun(record_without_facts(path, digest, "incomplete", results))


def record_without_facts(
    path: Place, digest: Digest, verdict: Verdict, results: tuple[Result, ...], diagnoses: tuple[Diagnosis, ...] = ()
) -> FileRecord:
    """Return the record of a file of which nothing was measured."""
    return FileRecord(
        path=str(path),
        size=digest.version.size,
        sha256=digest.sha256,
        digest_kind=digest.kind,
        dialect="",
        inferred={},
        statistics={},
        verdict=verdict,
        results=results,
        diagnoses=diagnoses,
    )

"""How a file is to be checked, and what checking it gives."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fedora_qa.engine.effort import Effort
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.judgement.false_alarm_rate import DEFAULT_FALSE_ALARM_RATE
from fedora_qa.record.types import FileRecord
from fedora_qa.storage.traffic import NO_TRAFFIC, Traffic

if TYPE_CHECKING:  # commands that measure nothing load neither NumPy nor HDF5
    from numpy.typing import NDArray

    from fedora_qa.faults.reversible import ReversibleFault
    from fedora_qa.judgement.materiality import Profile
    from fedora_qa.layout.dialect import DialectChoice

_MEBIBYTE: Final = 1 << 20


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

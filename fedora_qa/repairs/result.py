"""What a repair did, or why it did nothing; as plain data, for people and for the provenance of the file."""

from dataclasses import dataclass

from fedora_qa.record.types import Diagnosis, FileRecord
from fedora_qa.repairs.write import DatasetChange


@dataclass(frozen=True, slots=True)
class RepairStep:
    """A diagnosis whose fault is undone.

    Attributes
    ----------
    diagnosis
        The cause, its size, and how it is known.
    done
        What undoing does, in words.
    fault
        The fault with all its sizes, as its class is written.
    """

    diagnosis: Diagnosis
    done: str
    fault: str


@dataclass(frozen=True, slots=True)
class Omission:
    """A diagnosis that is not repaired, and the reason, as a sentence."""

    diagnosis: Diagnosis
    reason: str


@dataclass(frozen=True, slots=True)
class Repair:
    """The result.

    Attributes
    ----------
    steps
        What was done, or would be done, in order.
    omissions
        The other diagnoses.
    datasets, attributes
        What was altered, or would be: datasets, and attributes as ``path.name = value``.
    beside
        Datasets that the dialect does not describe and that may refer to what was altered; they are not altered.
    refusal
        Why nothing is written, as a sentence; empty where the file is written, or would be.
    before, after
        The records of the file and, where one was made, of the repaired copy, which is judged by the limits alone.
    """

    steps: tuple[RepairStep, ...]
    omissions: tuple[Omission, ...]
    before: FileRecord
    datasets: tuple[DatasetChange, ...] = ()
    attributes: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()
    refusal: str = ""
    after: FileRecord | None = None

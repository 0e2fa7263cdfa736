"""A cause with its fitted size, and what else was measured of the file: of it a fault is made that a trial undoes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fedora_qa.causes import stream_family
from fedora_qa.diagnosis.measured_sizes import Results
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

Faults = Iterator[ReversibleFault]


@dataclass(frozen=True, slots=True)
class FittedCause:
    """A cause in a stream with its fitted size, and what else was measured of the file.

    Attributes
    ----------
    cause, stream
        As in ``fedora_qa.causes``.
    size
        In the unit of the cause; 0 where none was fitted.
    alarms
        Of the file, with the features of their statistics.
    results
        Of the file, by check: their measurements give components of vectors that exceed no limit.
    facts
        Of the file.
    """

    cause: str
    stream: str
    size: float
    alarms: Sequence[Alarm]
    results: Results
    facts: Facts

    @property
    def family(self) -> str:
        """The stream; ``flow`` for every rate."""
        return stream_family(self.stream)

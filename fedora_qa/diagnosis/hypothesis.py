"""A cause that would explain a finding."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

ANY_CAUSE: Final = "any"
"""In place of a cause: any other fault of the stream would explain the finding as well."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A cause that would explain a finding, with its fitted size.

    Attributes
    ----------
    cause, stream
        As in ``fedora_qa.causes``; the cause may be ``ANY_CAUSE``.
    support
        How well the cause explains the deviation, 0 (not at all) to 1 (entirely).
    magnitude, unit, standard_error
        Fitted size in the unit of the cause, and its standard error. Positive where timestamps are too late or values
        too large; None where the cause has no size.
    """

    cause: str
    stream: str
    support: float
    magnitude: float | None = None
    unit: str = ""
    standard_error: float | None = None


Propose = Callable[[Alarm, Facts], tuple[Hypothesis, ...]]
"""Returns the hypotheses for an alarm of one check, best supported first.

It reads the features of the alarm's statistic and the facts of the file, no samples: diagnosis decodes nothing.
"""

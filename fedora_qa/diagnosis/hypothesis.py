"""A cause that would explain a finding."""

from dataclasses import dataclass
from typing import Final

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

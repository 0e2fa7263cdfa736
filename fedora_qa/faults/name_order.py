"""Fault of the order of images that were listed by their names."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.fault import Fault, rows_from, value_keys
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class FramesInOrderOfNames:
    """Values are in the order of their numbers as text, 1, 10, 11, 2, as files without leading zeros are listed.

    Their timestamps stay.

    Attributes
    ----------
    stream
        Of images.
    first_number
        Number of the first frame.
    """

    stream: str
    first_number: int = 0
    cause: ClassVar[str] = "swapped_frames"

    @property
    def magnitude(self) -> None:
        """None: the order has no size."""
        return

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Order the values by their numbers as text."""
        return self._ordered(facts, f"{self.stream} is in the order of numbers as text", self.order)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Return each value to the place of its number."""
        description = f"{self.stream} in the order of numbers from {self.first_number}, not of their text"
        return self._ordered(facts, description, lambda count: np.argsort(self.order(count)))

    def order(self, count: int) -> Int64:
        """Return the rows (count,) in the order of their numbers as text."""
        return np.array(sorted(range(count), key=lambda row: str(row + self.first_number)), dtype=np.int64)

    def _ordered(self, facts: Facts, description: str, source: Callable[[int], Int64]) -> Fault:
        keys = value_keys(facts, self.stream)
        orders = {key: source(facts.sizes[key]) for key in keys}
        return Fault(description, {key: rows_from(order.__getitem__, len(order)) for key, order in orders.items()})

"""Faults of the map that rectifies events."""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

from fedora_qa.faults.fault import Fault
from fedora_qa.faults.reversible import InapplicableError
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows


@dataclass(frozen=True, slots=True)
class RectificationAxes:
    """Two axes of the map that rectifies events are exchanged.

    Attributes
    ----------
    exchanged
        ``coordinates``: entries are y before x; ``pixels``: the map of a square sensor is stored by x before y.
    """

    exchanged: Literal["coordinates", "pixels"] = "coordinates"
    cause: ClassVar[str] = "axes_swapped"
    stream: ClassVar[str] = "metadata"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange the axes."""
        return self._altered(facts, f"the {self.exchanged} of rectify_map are exchanged")

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange the axes once more."""
        return self._altered(facts, f"the {self.exchanged} of rectify_map exchanged back")

    def _altered(self, facts: Facts, description: str) -> Fault:
        map_px = facts.declared.rectify_map_px
        if map_px is None:
            raise InapplicableError("Expected a map that rectifies events, got none")
        if self.exchanged == "pixels" and map_px.shape[0] != map_px.shape[1]:
            raise InapplicableError("Expected a square event camera to exchange the pixels of its map, got another")
        altered_px = map_px[..., ::-1] if self.exchanged == "coordinates" else map_px.swapaxes(0, 1)
        return Fault(description, declared=replace(facts.declared, rectify_map_px=altered_px))

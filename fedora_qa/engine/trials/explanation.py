"""The causes of the findings of a file; without findings there are none, and nothing that names causes is imported."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fedora_qa.record.types import Diagnosis

if TYPE_CHECKING:  # loads every fault
    from fedora_qa.diagnosis.conclusion import UndoTrial
    from fedora_qa.engine.trials.trial import TrialBench


@dataclass(frozen=True, slots=True)
class CauseExplanation:
    """The causes of the findings of a file.

    Attributes
    ----------
    diagnoses
        In the order in which their faults are undone; those without a fault may stand anywhere.
    trials
        By the identifier of the diagnosis, where its fault was undone.
    benches
        On which that was done, by the identifier of the diagnosis: with the faults undone that were named before.
    """

    diagnoses: tuple[Diagnosis, ...] = ()
    trials: "Mapping[str, UndoTrial]" = field(default_factory=dict)
    benches: "Mapping[str, TrialBench]" = field(default_factory=dict)

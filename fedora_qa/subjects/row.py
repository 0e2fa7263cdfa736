"""A row of the catalogue."""

from dataclasses import dataclass
from typing import Any

from fedora_qa.checks.protocol import Check
from fedora_qa.diagnosis.hypothesis import Propose
from fedora_qa.faults.canary_conditions import PlantCanary


@dataclass(frozen=True, slots=True)
class CatalogueRow:
    """A check, the causes that its alarms suggest, and the fault that it must detect.

    Attributes
    ----------
    check
        Knows no cause.
    propose
        Returns the hypotheses for an alarm of the check.
    canary
        Returns the fault that is planted for the check.
    """

    check: Check[Any]
    propose: Propose
    canary: PlantCanary

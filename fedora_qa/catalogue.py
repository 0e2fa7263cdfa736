"""The checks, in the order in which they run and are shown, with the proposals of causes and the canary of each.

``fedora_qa/subjects/`` has the rows. What needs a few checks alone imports them from there.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from fedora_qa.checks.protocol import Check
from fedora_qa.faults.canary_conditions import PlantCanary
from fedora_qa.subjects import SUBJECTS
from fedora_qa.subjects.rows import hypotheses_of, rows_of

__all__ = ["CANARIES", "CATALOGUE", "CHECKS", "hypotheses_of"]

CATALOGUE: Final = tuple(row for subject in SUBJECTS for row in rows_of(subject))

CHECKS: Final[tuple[Check[Any], ...]] = tuple(row.check for row in CATALOGUE)

CANARIES: Final[Mapping[str, PlantCanary]] = MappingProxyType({row.check.name: row.canary for row in CATALOGUE})
"""By the name of the check."""

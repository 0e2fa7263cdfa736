"""How often diagnoses of a status were right, as ``make power`` measured and published it."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final

from fedora_qa.record.types import DiagnosisStatus

PUBLISHED: Final = Path(__file__).with_name("confidence.json")
"""Rows of status, cause (empty: all causes), diagnoses that were right, and all."""

FEWEST: Final = 20
"""Diagnoses from which the frequency of one cause is used: its standard error is then 0.11 at most. With fewer, that of
all causes of the status is used."""


def confidence_of(status: DiagnosisStatus, cause: str) -> float:
    """Return the measured frequency, 0 to 1, with which such diagnoses were right; 0 where none was measured."""
    published = _published()
    own, all_causes = published.get((status, cause), (0, 0)), published.get((status, ""), (0, 0))
    right, of = own if own[1] >= FEWEST else all_causes
    return right / of if of >= FEWEST else 0.0


@cache
def _published() -> Mapping[tuple[str, str], tuple[int, int]]:
    rows = json.loads(PUBLISHED.read_text("utf-8")) if PUBLISHED.exists() else []
    return {(status, cause): (right, of) for status, cause, right, of in rows}

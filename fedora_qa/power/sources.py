"""Which code a measurement of power belongs to."""

from pathlib import Path
from typing import Final

from fedora_qa.code_digest import PACKAGE, code_digest

MEASURED: Final = ("checks", "diagnosis", "estimators", "faults", "geometry", "judgement", "views")
"""The folders whose code and data decide what is found and named."""


def estimators_digest(package: Path = PACKAGE) -> str:
    """Return the SHA-256 of all sources that decide what is found."""
    return code_digest(MEASURED, package)

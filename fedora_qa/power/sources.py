"""Which code a measurement of power belongs to."""

import hashlib
from pathlib import Path
from typing import Final

MEASURED: Final = ("checks", "estimators", "geometry", "judgement")
"""The folders whose code decides what is found."""

_PACKAGE: Final = Path(__file__).parents[1]


def estimators_digest(package: Path = _PACKAGE) -> str:
    """Return the SHA-256 of all sources that decide what is found: of their paths and of their text, in order."""
    digest = hashlib.sha256()
    for path in sorted(path for folder in MEASURED for path in (package / folder).rglob("*.py")):
        digest.update(f"{path.relative_to(package).as_posix()}\0".encode())
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()

"""Which code made a result: that of the whole package, as any of it may decide what a record says."""

import hashlib
from pathlib import Path
from typing import Final

_PACKAGE: Final = Path(__file__).parents[1]


def code_digest(package: Path = _PACKAGE) -> str:
    """Return the SHA-256 of all sources of the package: of their paths and of their text, in order."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(f"{path.relative_to(package).as_posix()}\0".encode())
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()

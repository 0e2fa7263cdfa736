"""Identify the code that made a result: the SHA-256 of the sources of the package, or of some of its parts."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parent

_SUFFIXES: Final = (".py", ".toml")


def code_digest(parts: Sequence[str] = ("",), package: Path = PACKAGE) -> str:
    """Return the SHA-256 of all sources and tables (TOML) in parts of the package: of paths and text, in order."""
    digest = hashlib.sha256()
    within = (path for part in parts for path in (package / part, *(package / part).rglob("*")))
    paths = {path for path in within if path.is_file() and path.suffix in _SUFFIXES}
    for path in sorted(paths):
        # A zero byte ends each path and each text, so that no text can be read as the path that follows.
        digest.update(f"{path.relative_to(package).as_posix()}\0".encode())
        # Line ends of a checkout on Windows do not change what the code does.
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()

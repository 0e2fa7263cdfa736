"""Rules about what lies beside the sequences: datasheet, licence, checksums."""

import hashlib
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from fedora_qa.errors import MisuseError
from fedora_qa.gate.policy import Documents
from fedora_qa.gate.release import FOLDER, inside
from fedora_qa.gate.release_result import ReleaseResult, Violation

_LINE: Final = re.compile(r"([0-9a-fA-F]{64}) [ *](.+)")
_PIECE: Final = 1 << 20


def whole_digest(path: Path) -> str:
    """Return the SHA-256 of all of a file, whatever its size."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(_PIECE):
            digest.update(piece)
    return digest.hexdigest()


def rule_on_documents(folder: Path, documents: Documents) -> ReleaseResult:
    """Datasheet, licence and checksums are there and not empty."""
    asked = {"datasheet": documents.datasheet, "licence": documents.licence, "checksums": documents.checksums}
    violations = [
        Violation(FOLDER, kind, f"Expected the {kind} in {name}, got no such file, or an empty one")
        for kind, name in asked.items()
        if name is not None and not _has_text(inside(folder, name))
    ]
    return ReleaseResult("release.documents", "Are datasheet, licence and checksums there?", FOLDER, tuple(violations))


def rule_on_checksums(folder: Path, listing: str, digests: Mapping[str, str]) -> ReleaseResult:
    """Every sequence is listed, and every digest is right.

    Parameters
    ----------
    listing
        Name of the checksums, in the form of ``sha256sum``.
    digests
        SHA-256 of each sequence, by its name.
    """
    violations = tuple(_checksum_violations(folder, inside(folder, listing), digests))
    return ReleaseResult("release.checksums", "Are the checksums complete and right?", "each", violations)


def _checksum_violations(folder: Path, listing: Path, digests: Mapping[str, str]) -> Iterator[Violation]:
    listed: dict[str, str] = {}
    # Names of files need not be UTF-8: surrogates keep them readable and comparable.
    text = listing.read_text(encoding="utf-8", errors="surrogateescape") if listing.is_file() else ""
    for number, line in enumerate(text.splitlines(), start=1):
        match = _LINE.fullmatch(line)
        if match:
            listed[match[2].removeprefix("./")] = match[1].lower()
        elif line.strip():
            message = f"Expected a digest and a name in line {number} of {listing.name}, got something else"
            yield Violation(FOLDER, "unreadable", message)
    for name in sorted(digests.keys() - listed.keys()):
        yield Violation(name, "unlisted", f"Expected the sequence in {listing.name}, got no line for it")
    for name, digest in listed.items():
        actual = digests.get(name) or _digest_beside(folder, name)
        if actual != digest:
            message = f"Expected {name} with the SHA-256 {digest}, which {listing.name} lists, got {actual}"
            yield Violation(name if name in digests else FOLDER, "wrong", message)


def _digest_beside(folder: Path, name: str) -> str:
    """Return the digest of a listed file that is no sequence, or why there is none."""
    try:
        path = inside(folder, name)
    except MisuseError:
        return "no name of a file within the release"
    return whole_digest(path) if path.is_file() else "no such file"


def _has_text(path: Path) -> bool:
    return path.is_file() and bool(path.read_bytes().strip())

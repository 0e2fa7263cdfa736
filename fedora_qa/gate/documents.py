"""Rules about what lies beside the sequences: datasheet, licence, checksums."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from fedora_qa.errors import MisuseError
from fedora_qa.gate.policy import Documents
from fedora_qa.gate.release import FOLDER, Release, inside
from fedora_qa.gate.release_result import ReleaseResult, Violation
from fedora_qa.record.types import FileRecord

_LINE: Final = re.compile(r"([0-9a-fA-F]{64}) [ *](.+)")
_PIECE: Final = 1 << 20


def whole_digest(path: Path) -> str:
    """Return the SHA-256 of all of a file, whatever its size."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(_PIECE):
            digest.update(piece)
    return digest.hexdigest()


def whole_digests(release: Release, files: Sequence[FileRecord]) -> dict[str, str]:
    """Return the SHA-256 of all of each sequence by its name; the record has that of files up to 1 GiB."""
    return {
        sequence.name: file.sha256 if file.digest_kind == "full" else whole_digest(sequence.path)
        for sequence, file in zip(release.sequences, files, strict=True)
    }


def rule_on_documents(folder: Path, documents: Documents) -> ReleaseResult:
    """Datasheet, licence and checksums are there and not empty."""
    asked = {"datasheet": documents.datasheet, "licence": documents.licence, "checksums": documents.checksums}
    violations = []
    for kind, name in asked.items():
        if name is None:
            continue
        path = inside(folder, name)
        if not path.is_file() or not path.read_bytes().strip():
            message = f"Expected the {kind} in {name}, got no such file, or an empty one"
            violations.append(Violation(FOLDER, kind, message))
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
    path = inside(folder, listing)
    violations: list[Violation] = []
    listed: dict[str, str] = {}
    # Names of files need not be UTF-8: surrogates keep them readable and comparable.
    text = path.read_text(encoding="utf-8", errors="surrogateescape") if path.is_file() else ""
    for number, line in enumerate(text.splitlines(), start=1):
        match = _LINE.fullmatch(line)
        if match:
            listed[match[2].removeprefix("./")] = match[1].lower()
        elif line.strip():
            message = f"Expected a digest and a name in line {number} of {path.name}, got something else"
            violations.append(Violation(FOLDER, "unreadable", message))
    for name in sorted(digests.keys() - listed.keys()):
        violations.append(Violation(name, "unlisted", f"Expected the sequence in {path.name}, got no line for it"))
    for name, digest in listed.items():
        actual = digests.get(name)
        if not actual:
            # A listed file that is no sequence: its digest, or why there is none.
            try:
                beside = inside(folder, name)
            except MisuseError:
                actual = "no name of a file within the release"
            else:
                actual = whole_digest(beside) if beside.is_file() else "no such file"
        if actual != digest:
            message = f"Expected {name} with the SHA-256 {digest}, which {path.name} lists, got {actual}"
            violations.append(Violation(name if name in digests else FOLDER, "wrong", message))
    question = "Are the checksums complete and right?"
    return ReleaseResult("release.checksums", question, "each", tuple(violations))

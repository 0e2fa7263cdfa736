"""Verify later that a release is still the one that was certified."""

from collections.abc import Iterator
from datetime import date
from pathlib import Path

from fedora_qa.gate.certificate import Certificate
from fedora_qa.gate.documents import whole_digest
from fedora_qa.gate.release import find_sequences, inside


def differences(certificate: Certificate, folder: Path, today: date) -> tuple[str, ...]:
    """Return what differs from what was certified, a sentence each; empty where nothing does.

    Raises
    ------
    MisuseError
        There is no such folder, or a name in the certificate leads out of it.
    """
    return tuple(_differences(certificate, folder, today))


def _differences(certificate: Certificate, folder: Path, today: date) -> Iterator[str]:
    if certificate.digest != certificate.own_digest:
        yield "the certificate was changed after it was issued"
    certified = {file.name: file.sha256 for file in certificate.files} | dict(certificate.documents)
    # Before any file is read: a name that leads out of the folder raises.
    paths = {name: inside(folder, name) for name in certified}
    sequences = {sequence.name for sequence in find_sequences(folder, certificate.patterns)}
    for name, sha256 in certified.items():
        if not paths[name].is_file():
            yield f"{name} is missing"
        elif whole_digest(paths[name]) != sha256:
            yield f"{name} was changed"
    for name in sorted(sequences - certified.keys()):
        yield f"{name} was added"
    for waiver in certificate.waivers:
        if waiver.expires < today:
            yield f"the waiver of {waiver.owner} for {waiver.file} expired on {waiver.expires}"

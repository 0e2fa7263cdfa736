"""The certificate of a release: its bytes, the checks and their detection limits, and the waivers.

``differences`` compares a release with its certificate later.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import ClassVar, Final, Literal

from pydantic import ConfigDict, TypeAdapter

from fedora_qa.gating.acceptance import Waiver, named_files
from fedora_qa.gating.policy import Policy
from fedora_qa.gating.release import find_sequences, inside
from fedora_qa.record.documents import DocumentKind
from fedora_qa.record.types import FOLDER, Coverage, Outcome, Record, Tool
from fedora_qa.storage.digest import whole_digest
from fedora_qa.storage.folder import is_folder

CERTIFICATE_VERSION: Final = "1.0"

_STRICT: Final = ConfigDict(extra="forbid")


@dataclass(frozen=True, slots=True)
class Sight:
    """The least fault that a check would have detected, with 95% probability."""

    name: str
    least_detectable: float
    unit: str


@dataclass(frozen=True, slots=True)
class CertifiedCheck:
    """The result of one check on one file."""

    check: str
    outcome: Outcome
    coverage: Coverage | None
    sights: tuple[Sight, ...]


@dataclass(frozen=True, slots=True)
class CertifiedFile:
    """A sequence by its name in the release, its bytes, and what was checked of them."""

    name: str
    size: int
    sha256: str
    checks: tuple[CertifiedCheck, ...]


@dataclass(frozen=True, slots=True)
class Certificate:
    """That a release passed a gate.

    Attributes
    ----------
    policy_sha256
        Of the policy's file.
    noted
        Findings that did not fail the gate, as ``file: code: message``: warnings, and what is waived or known.
    files, documents
        Sequences, and by name the SHA-256 of datasheet, licence and checksums. Names are relative to the release.
    patterns
        Which files of the release are sequences.
    digest
        SHA-256 of everything else in the certificate. It reveals damage and not forgery: sign the file against that.
    """

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    certificate_version: Literal["1.0"]
    issued: str
    tool: Tool
    ruleset_version: str
    effort: str
    policy_sha256: str
    policy_digest: str
    files: tuple[CertifiedFile, ...]
    documents: Mapping[str, str]
    patterns: tuple[str, ...]
    waivers: tuple[Waiver, ...]
    noted: tuple[str, ...]
    digest: str = ""

    @property
    def own_digest(self) -> str:
        """The value of ``digest`` in a certificate that was not changed."""
        # Canonical JSON, without the digest itself: equal certificates have equal bytes.
        values = CERTIFICATE.adapter.dump_python(replace(self, digest=""), mode="json")
        return hashlib.sha256(json.dumps(values, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


CERTIFICATE: Final = DocumentKind(
    name="certificate",
    noun="a certificate",
    version=CERTIFICATE_VERSION,
    adapter=TypeAdapter(Certificate),
    written_by="fedora-qa gate --certificate",
    again="certify the release again with this version",
)

write_certificate = CERTIFICATE.write
read_certificate = CERTIFICATE.read


def certificate_of(record: Record, policy: Policy, policy_sha256: str, digests: Mapping[str, str]) -> Certificate:
    """Return the certificate of a release whose gate's record is clean."""
    named = tuple(named_files(record))
    folder = Path(record.files[-1].path)
    files = []
    for name, file in named:
        if name == FOLDER:
            continue
        checks = []
        for result in file.results:
            # A measurement without a detection limit rules nothing out.
            sights = tuple(
                Sight(measurement.name, measurement.least_detectable, measurement.unit)
                for measurement in result.measurements
                if measurement.least_detectable is not None
            )
            checks.append(CertifiedCheck(result.check, result.outcome, result.coverage, sights))
        files.append(CertifiedFile(name, file.size, digests[name], tuple(checks)))
    certificate = Certificate(
        certificate_version=CERTIFICATE_VERSION,
        issued=record.run.started,
        tool=record.tool,
        ruleset_version=record.ruleset_version,
        effort=record.effort,
        policy_sha256=policy_sha256,
        policy_digest=policy.digest,
        files=tuple(files),
        documents={name: whole_digest(inside(folder, name)) for name in policy.documents.names.values()},
        patterns=policy.files,
        waivers=policy.waivers,
        noted=tuple(
            f"{name}: {finding.code}: {finding.message}"
            for name, file in named
            for result in file.results
            for finding in result.findings
        ),
    )
    return replace(certificate, digest=certificate.own_digest)


def differences(certificate: Certificate, folder: Path, today: date) -> tuple[str, ...]:
    """Return what differs from what was certified, a sentence each; empty where nothing does.

    Raises
    ------
    MisuseError
        There is no such folder, or a name in the certificate leads out of it.
    """
    deviations = []
    if certificate.digest != certificate.own_digest:
        deviations.append("the certificate was changed after it was issued")
    certified = {file.name: file.sha256 for file in certificate.files} | dict(certificate.documents)
    # Before any file is read: a name that leads out of the folder raises.
    paths = {name: inside(folder, name) for name in certified}
    # Files in a folder that is certified as one sequence are parts of it, whatever its dialect.
    sequences = {
        sequence.name
        for sequence in find_sequences(folder, certificate.patterns)
        if not any(sequence.name.startswith(f"{name}/") for name in certified)
    }
    for name, sha256 in certified.items():
        if not (paths[name].exists() or is_folder(paths[name])):
            deviations.append(f"{name} is missing")
        elif whole_digest(paths[name]) != sha256:
            deviations.append(f"{name} was changed")
    deviations += [f"{name} was added" for name in sorted(sequences - certified.keys())]
    deviations += [
        f"the waiver of {waiver.owner} for {waiver.file} expired on {waiver.expires}"
        for waiver in certificate.waivers
        if waiver.expires < today
    ]
    return tuple(deviations)

"""The certificate: what was checked of which bytes, by what, how closely, and what was waived."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Final, Literal

from pydantic import ConfigDict, TypeAdapter

from fedora_qa.gate.baseline import named_files
from fedora_qa.gate.documents import whole_digest
from fedora_qa.gate.policy import Policy
from fedora_qa.gate.release import FOLDER, inside
from fedora_qa.gate.waivers import Waiver
from fedora_qa.record.documents import DocumentKind
from fedora_qa.record.types import Coverage, FileRecord, Outcome, Record, Result, Tool

CERTIFICATE_VERSION: Final = "1.0"

_STRICT: Final = ConfigDict(extra="forbid")


@dataclass(frozen=True, slots=True)
class Sight:
    """The least fault that a check would have seen, with 95% probability."""

    name: str
    least_detectable: float
    unit: str


@dataclass(frozen=True, slots=True)
class CertifiedCheck:
    """What one check told of one file."""

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
        SHA-256 of everything else in the certificate. It tells damage, not forgery: sign the file for that.
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
        """What ``digest`` is in a certificate that nobody has changed."""
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
    """Return the certificate of a release whose gate's record is clean.

    Parameters
    ----------
    digests
        SHA-256 of all of each sequence, by its name.
    """
    named = tuple(named_files(record))
    folder = Path(record.files[-1].path)
    documents = (policy.documents.datasheet, policy.documents.licence, policy.documents.checksums)
    certificate = Certificate(
        certificate_version=CERTIFICATE_VERSION,
        issued=record.run.started,
        tool=record.tool,
        ruleset_version=record.ruleset_version,
        effort=record.effort,
        policy_sha256=policy_sha256,
        policy_digest=policy.digest,
        files=tuple(_certified(name, file, digests[name]) for name, file in named if name != FOLDER),
        documents={name: whole_digest(inside(folder, name)) for name in documents if name is not None},
        patterns=policy.files,
        waivers=policy.waivers,
        noted=tuple(note for name, file in named for note in _notes(name, file)),
    )
    return replace(certificate, digest=certificate.own_digest)


def _certified(name: str, file: FileRecord, sha256: str) -> CertifiedFile:
    return CertifiedFile(name, file.size, sha256, tuple(_certified_check(result) for result in file.results))


def _certified_check(result: Result) -> CertifiedCheck:
    sights = tuple(
        Sight(measurement.name, measurement.least_detectable, measurement.unit)
        for measurement in result.measurements
        if measurement.least_detectable is not None
    )
    return CertifiedCheck(result.check, result.outcome, result.coverage, sights)


def _notes(name: str, file: FileRecord) -> Iterator[str]:
    for result in file.results:
        for finding in result.findings:
            yield f"{name}: {finding.code}: {finding.message}"

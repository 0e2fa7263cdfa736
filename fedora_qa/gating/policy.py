"""The policy of a release: ``policy.toml``, read and validated; unknown keys are refused by name."""

import hashlib
import json
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, Final, Literal

from pydantic import ConfigDict, TypeAdapter

from fedora_qa.check_names import require_check_names, selected_explanations
from fedora_qa.checks.explanation import published_explanations
from fedora_qa.config import RULESET_CHANGES, RULESET_VERSION, CheckConfig, files_beside, read_toml
from fedora_qa.errors import MisuseError, did_you_mean
from fedora_qa.gating.acceptance import Waiver, require_legal_names
from fedora_qa.gating.release import is_plain
from fedora_qa.layout.canonical import FLOW_STREAMS, STREAMS, in_file_order, is_flow_stream
from fedora_qa.record.types import Severity

Total = Literal["sequences", "bytes", "duration_s", "distance_m", "events"]
CameraName = Literal["rgb", "depth", "events"]

RULES: Final = ("release", *(f"release.{rule}" for rule in (
    "naming", "streams", "intrinsics", "distinct", "identity", "splits", "checksums", "documents", "totals",
)))  # fmt: skip
"""The rules about a release, as severities name them: all together, and each. Waivers that are wrong always fail."""

_STRICT: Final = ConfigDict(extra="forbid", use_attribute_docstrings=True)


@dataclass(frozen=True, slots=True)
class Bounds:
    """The least and the greatest legal total, both included; None is unbounded."""

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    least: float | None = None
    """The least legal total."""
    most: float | None = None
    """The greatest legal total."""


@dataclass(frozen=True, slots=True)
class Documents:
    """Files that must lie in the release, by their names in it; None is not required."""

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    datasheet: str | None = None
    """Describes the release."""
    licence: str | None = None
    """States what users may do with the release."""
    checksums: str | None = None
    """In the form of ``sha256sum``: it must list every sequence, and every digest in it must be correct."""

    @property
    def names(self) -> Mapping[str, str]:
        """The name of each document that is required, by its kind."""
        names = {"datasheet": self.datasheet, "licence": self.licence, "checksums": self.checksums}
        return {kind: name for kind, name in names.items() if name is not None}


@dataclass(frozen=True, slots=True)
class Policy:
    """All keys of a policy."""

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    ruleset_version: str
    """The ruleset of the policy; another one is refused, so that an upgrade changes no verdict unnoticed."""
    files: tuple[str, ...] = ("**/*.h5", "**/*.hdf5")
    """Patterns of the sequences beneath the folder; ``**`` stands for any depth. Hidden files are left out."""
    check: CheckConfig = field(default_factory=CheckConfig)
    """The options of ``fedora-qa.toml``."""
    required_streams: tuple[str, ...] = ()
    """Streams that every sequence must hold; ``flow`` is all rates."""
    required_checks: tuple[str, ...] = ()
    """Subjects or checks that must come to a verdict; a sequence without that verdict is incomplete."""
    severity: Mapping[str, Severity] = field(default_factory=dict)
    """Severity of the findings of a subject or check. ``error`` and ``critical`` fail the gate."""
    naming: str | None = None
    """Regular expression that the whole name of each sequence, relative to the folder, must match."""
    same_intrinsics: tuple[CameraName, ...] = ()
    """Cameras whose declared intrinsics must be the same in all sequences."""
    distinct_streams: tuple[str, ...] = ()
    """Streams whose content must not occur twice; ``flow`` is all rates."""
    same_sequence: bool = False
    """Whether files with different data may declare one sequence, as the parts of a long flight do."""
    totals: Mapping[Total, Bounds] = field(default_factory=dict)
    """Bounds of sums over the release."""
    documents: Documents = field(default_factory=Documents)
    """Files that must lie in the release, by their names in it."""
    splits: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Patterns by split, in which ``*`` stands for any text; each sequence in one, and no content in two."""
    waivers: tuple[Waiver, ...] = ()
    """Findings that somebody accepts until a day."""

    @property
    def digest(self) -> str:
        """SHA-256 of all keys of the policy that may change the record, equal for equal policies."""
        keys = {**POLICY_READER.dump_python(self, mode="json"), "check": self.check.digest}
        canonical = json.dumps(keys, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()


POLICY_READER: Final = TypeAdapter(Policy)


def read_policy(path: Path) -> Policy:
    """Read a policy.

    Raises
    ------
    MisuseError
        There is no such file, it is not TOML, is for another ruleset, or a key is unknown or has an illegal value;
        names the key.
    """
    policy = read_toml(path, POLICY_READER, "policy")
    if policy.ruleset_version != RULESET_VERSION:
        raise MisuseError(
            f"Expected ruleset {policy.ruleset_version!r}, which {path} pins, got {RULESET_VERSION!r}; install the "
            "version that the policy was written for, or look at what changed and raise ruleset_version. "
            + " ".join(f"New in {version}: {change}." for version, change in RULESET_CHANGES.items())
        )
    for key, names in (
        ("required_streams", policy.required_streams),
        ("distinct_streams", policy.distinct_streams),
    ):
        for name in names:
            if name not in {*STREAMS, "flow"} and not is_flow_stream(name):
                raise MisuseError(
                    f"Expected a stream in {key!r}, got {name!r}; there are {', '.join(STREAMS)}"
                    f"{did_you_mean(name, STREAMS)}"
                )
    require_check_names(policy.severity, also=RULES)
    require_check_names([*policy.required_checks, *policy.check.select, *policy.check.ignore])
    checks = [*(explained.check for explained in published_explanations()), *RULES[1:]]
    for waiver in policy.waivers:
        require_legal_names(waiver, checks)
    # Every required check is among those that the policy runs.
    running = {each.check for each in selected_explanations(policy.check.select, policy.check.ignore)}
    for name in policy.required_checks:
        required = {each.check for each in selected_explanations((name,), ())}
        if not required <= running:
            left_out = ", ".join(sorted(required - running))
            raise MisuseError(
                f"Expected every check in 'required_checks' to be run, got {left_out}, left out by 'check'"
            )
    for pattern in policy.files:
        if not is_plain(pattern):
            raise MisuseError(f"Expected patterns beneath the folder in 'files', got {pattern!r}")
    for document in policy.documents.names.values():
        if not is_plain(document):
            raise MisuseError(f"Expected names of files within the folder in 'documents', got {document!r}")
    try:
        re.compile(policy.naming or "")
    except re.error as problem:
        raise MisuseError(f"Expected a regular expression in 'naming', got {policy.naming!r}: {problem}") from None
    _ = policy.check.memory_bytes  # raises where it is no amount
    return replace(policy, check=files_beside(policy.check, path))


def each_stream(names: Iterable[str], streams: Collection[str]) -> tuple[str, ...]:
    """Return the streams that names stand for; ``flow`` is every rate among ``streams``, or the usual ones."""
    rates = tuple(filter(is_flow_stream, in_file_order(streams))) or FLOW_STREAMS
    return tuple(stream for name in names for stream in (rates if name == "flow" else (name,)))

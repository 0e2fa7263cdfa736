"""How checks are run: ``fedora-qa.toml``, and the options of the command line that override it.

::

    effort = "full"                 # quick, standard, full or exhaustive
    select = ["event_response"]     # subjects or checks; all where absent
    ignore = ["imu.noise"]
    dialect = "fedora"              # a name, or a TOML file beside this one; recognised from each file where absent
    profile = "release"             # from which size a deviation matters: release, training or strict (any)
    fail_on = "failed"              # or "warned"
    memory = "1GB"                  # of all jobs together; 700MB for each job where absent, and 1GB at least
    jobs = 2                        # tasks at once, each in a process of its own; as many as cores where absent
    false_alarm_rate = 1e-4         # a file, shared by all its comparisons
    canary = false                  # whether each check must detect a fault that is planted for it in memory
    allow_external = []             # folders in which other files may be read that a file links to; none where absent

    [required_coverage]             # least share of its stream that a subject or check must cover, 0 to 1
    integrity = 1.0
"""

import hashlib
import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, TypeVar

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from fedora_qa.errors import MisuseError, did_you_mean
from fedora_qa.judgement.verdict import DEFAULT_FALSE_ALARM_RATE

T = TypeVar("T")

RULESET_VERSION: Final = "2"
"""Version of the checks and of their rules; it increases when the same file could get another verdict."""

RULESET_CHANGES: Final[Mapping[str, str]] = {
    "2": "a deviation fails only from a material size on (`profile`, release by default); as in ruleset 1 with "
    'profile = "strict"; and a sequence name that is declared twice with other data fails the gate, unless the policy '
    "has `same_sequence = true`",
}
"""What changed with each version of the ruleset since the one before."""

_BYTES_PER_UNIT: Final[Mapping[str, int]] = {
    "b": 1,
    "kb": 10**3,
    "mb": 10**6,
    "gb": 10**9,
    "kib": 2**10,
    "mib": 2**20,
    "gib": 2**30,
}
DEFAULT_MEMORY: Final = "1GB"
"""Of one job."""

JOB_MEMORY_BYTES: Final = 700 * 10**6
"""Memory of each of more jobs, where only their number is stated. Of a file of 1440x1080, two jobs decode 105% of the
bytes with 1.3 GB and more, and 153% with 1 GB: rows that neighbouring windows share are decoded again."""

LEAST_JOB_MEMORY_BYTES: Final = 500 * 10**6
"""Memory that is stated starts no more jobs than get this much each."""

LEAST_MEMORY_BYTES: Final = 64 * 2**20
"""A decoded colour and depth frame with two flow fields at 1440x1080 take 35 MiB."""

MOST_TOML_BYTES: Final = 1 << 20
"""Longest configuration, policy or dialect that is read; some ten thousand lines."""

_DECIDES_NOTHING: Final = frozenset({"jobs"})
"""Keys that make a run faster and do not alter its record."""

Share = Annotated[float, Field(ge=0, le=1)]


@dataclass(frozen=True, slots=True)
class CheckConfig:
    """All keys of a configuration file."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    effort: Literal["quick", "standard", "full", "exhaustive"] = "full"
    """How much to look at."""
    select: tuple[str, ...] = ()
    """Subjects or checks to run; all where absent."""
    ignore: tuple[str, ...] = ()
    """Subjects or checks to leave out."""
    dialect: str | None = None
    """How the files name and scale their data: a name, or a TOML file beside this one; recognised where absent."""
    metadata: str | None = None
    """A TOML file beside this one whose table [metadata] declares what the sequences do not say; none where absent."""
    profile: Literal["release", "training", "strict"] = "release"
    """From which size a deviation matters: to publish the data, to train on them, or any size."""
    fail_on: Literal["failed", "warned"] = "failed"
    """From which outcome on a check counts as a finding."""
    memory: str | None = None
    """Memory to aim at, such as 1GB, of all jobs together; where absent, 700MB for each job, and 1GB at least."""
    false_alarm_rate: Annotated[float, Field(gt=0, lt=1)] = DEFAULT_FALSE_ALARM_RATE
    """Probability that a correct file fails; shared by all comparisons of a file."""
    canary: bool = False
    """Whether each check must detect a fault that is planted for it in memory."""
    jobs: Annotated[int, Field(ge=1)] | None = None
    """Tasks at once, each in a process of its own; they share the memory. Where absent, as the machine allows."""
    allow_external: tuple[str, ...] = ()
    """Folders, beside this file, in which other files may be read that a file links to or is made of; none if empty."""
    required_coverage: Mapping[str, Share] = field(default_factory=dict)
    """Least share, 0 to 1, of its stream that a subject or check must cover."""

    @property
    def memory_bytes(self) -> int:
        """The memory limit in bytes; raises ``MisuseError`` where it is not an amount."""
        if self.memory is None:
            return max(parse_bytes(DEFAULT_MEMORY), (self.jobs or 1) * JOB_MEMORY_BYTES)
        return parse_bytes(self.memory)

    @property
    def digest(self) -> str:
        """SHA-256 of everything that is configured and may change the record, equal for equal configurations."""
        # Records must not depend on the machine: with more jobs the same configuration gives the same digest.
        deciding = {name: value for name, value in asdict(self).items() if name not in _DECIDES_NOTHING}
        if not self.allow_external:
            del deciding["allow_external"]  # as when there was no such key
        if self.metadata is None:
            del deciding["metadata"]
        # The default follows the number of jobs, which is that of the machine.
        deciding["memory"] = self.memory or DEFAULT_MEMORY
        # Sorted keys and fixed separators, so that equal configurations give equal bytes.
        canonical = json.dumps(deciding, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()


CONFIG_READER: Final = TypeAdapter(CheckConfig)


def read_config(path: Path) -> CheckConfig:
    """Read a configuration file.

    Raises
    ------
    MisuseError
        There is no such file, it is not TOML, or a key is unknown or has an illegal value; names the key.
    """
    config = read_toml(path, CONFIG_READER, "configuration")
    # For what it raises: an illegal amount is reported when the file is read, not when memory is first used.
    _ = config.memory_bytes
    return files_beside(config, path)


def with_options(config: CheckConfig, options: Mapping[str, Any]) -> CheckConfig:
    """Return a configuration with some options, by key, replaced; raises ``MisuseError`` as ``read_config``."""
    values = {each.name: getattr(config, each.name) for each in fields(config)}
    try:
        changed = CONFIG_READER.validate_python({**values, **options})
    except ValidationError as error:
        raise MisuseError(f"Expected legal options, got {_first_problem(error, CONFIG_READER)}") from None
    _ = changed.memory_bytes
    return changed


def read_toml(path: Path, reader: TypeAdapter[T], noun: str) -> T:
    """Read a TOML file as a type; raises ``MisuseError`` as ``read_config`` does. ``noun`` names its content."""
    try:
        with path.open("rb") as file:
            # One byte more than the limit shows that the file is too long without reading the rest.
            content = file.read(MOST_TOML_BYTES + 1)
        if len(content) > MOST_TOML_BYTES:
            raise MisuseError(f"Expected a {noun} of {MOST_TOML_BYTES} bytes at most, got more: {path}")
        values = tomllib.loads(content.decode("utf-8"))
    except OSError as error:
        raise MisuseError(f"Expected a readable {noun} at {path}, got: {error.strerror}") from None
    # The TOML parser descends once for each level; a hostile file of nested lists exhausts the stack.
    except RecursionError:
        raise MisuseError(f"Expected TOML in {path}, got tables or lists nested too deeply") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise MisuseError(f"Expected TOML in {path}, got: {error}") from None
    try:
        return reader.validate_python(values)
    except ValidationError as error:
        raise MisuseError(f"Expected a legal {noun} in {path}, got {_first_problem(error, reader)}") from None


def files_beside(config: CheckConfig, path: Path) -> CheckConfig:
    """Return the configuration with folders and other files relative to the file that names them."""
    # Relative to the file, so that a release can be checked from any working directory.
    folders = tuple(str(path.parent / folder) for folder in config.allow_external)
    config = replace(config, allow_external=folders)
    if config.metadata is not None:
        config = replace(config, metadata=str(path.parent / config.metadata))
    if config.dialect is not None and config.dialect.endswith(".toml"):
        return replace(config, dialect=str(path.parent / config.dialect))
    return config


def parse_bytes(text: str) -> int:
    """Return an amount of memory such as ``1GB`` or ``512MiB`` in bytes; raises ``MisuseError``."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([kmg]?i?b)\s*", text.lower())
    if not match or match[2] not in _BYTES_PER_UNIT:
        raise MisuseError(f"Expected memory as a number and a unit such as 1GB or 512MiB, got {text!r}")
    # 1GB is 10**9 bytes and 1GiB is 2**30 (IEC 80000-13).
    amount = int(float(match[1]) * _BYTES_PER_UNIT[match[2]])
    if amount < LEAST_MEMORY_BYTES:
        raise MisuseError(f"Expected memory of at least {LEAST_MEMORY_BYTES >> 20}MiB, got {text!r}")
    return amount


def _first_problem(error: ValidationError, reader: TypeAdapter[Any]) -> str:
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    # pydantic reports an unknown key as a keyword argument, a term that the writer of a TOML file does not expect.
    if first["type"] == "unexpected_keyword_argument":
        name = str(first["loc"][-1])
        return f"the key {key!r}, which does not exist{did_you_mean(name, _keys_of(reader) - {name})}"
    hint = ""
    if first["type"] == "literal_error":
        # pydantic gives the legal values as one text, each between quotes.
        hint = did_you_mean(str(first["input"]), re.findall("'([^']+)'", first["ctx"]["expected"]))
    return f"for the key {key!r}: {first['msg']}{hint}"


def _keys_of(reader: TypeAdapter[Any]) -> set[str]:
    """Return the keys of all tables of a TOML file."""
    schema = reader.json_schema()
    return {key for table in (schema, *schema.get("$defs", {}).values()) for key in table.get("properties", {})}

"""Dialects: layouts of others as data. Each is a TOML file that gives the place of every canonical dataset."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from math import pi
from pathlib import Path
from typing import ClassVar, Final, Literal

from fedora_qa.conventions import MM_PER_M, NS_PER_S, NS_PER_US, STANDARD_GRAVITY_M_S2
from fedora_qa.errors import MisuseError
from fedora_qa.layout.binding import Polarity
from fedora_qa.layout.canonical import DATASETS, DatasetSpec

DIALECT_NAMES: Final = ("fedora", "purdue-lab", "dsec", "mvsec", "m3ed")

NS_PER_TIME_UNIT: Final[Mapping[str, int]] = {"s": NS_PER_S, "ms": 1_000_000, "us": NS_PER_US, "ns": 1}

SCALES: Final[Mapping[tuple[str, str], float]] = {
    ("m", "mm"): MM_PER_M,
    ("cm", "mm"): 10.0,
    ("mm", "m"): 1 / MM_PER_M,
    ("deg/s", "rad/s"): pi / 180,
    # Standard gravity, not local gravity, is the unit of data sheets.
    ("g", "m/s^2"): STANDARD_GRAVITY_M_S2,
}
"""Factor from a stored unit to the canonical one."""

# Where the scalar is stored first, the canonical x, y, z, w are entries 1, 2, 3, 0.
QUATERNION_COLUMNS: Final[Mapping[str, tuple[int, ...]]] = {"xyzw": (0, 1, 2, 3), "wxyz": (1, 2, 3, 0)}
"""Which stored entries are x, y, z, w."""

_STRICT: Final = {"extra": "forbid"}
"""Configuration of pydantic: an unknown key is an error."""


@dataclass(frozen=True, slots=True)
class DatasetPlace:
    """Where a canonical dataset lies and how it is stored.

    Attributes
    ----------
    path
        From the root of the file; empty: where the canonical layout puts it.
    columns
        Entries of the last axis that make the canonical columns, in canonical order; empty: all.
    time_unit
        Unit of timestamps.
    offset_path
        A scalar dataset, in the unit of the timestamps, that is added to each of them; empty: none.
    value_unit
        Unit of values; empty: the canonical one.
    polarity
        ``01``: 1 brighter, 0 darker; ``inverted``: the other way round; ``plus_minus``: 1 brighter, -1 darker.
    quaternion
        Order of the stored quaternions.
    """

    __pydantic_config__: ClassVar[Mapping[str, str]] = _STRICT

    path: str = ""
    columns: tuple[int, ...] = ()
    time_unit: Literal["s", "ms", "us", "ns"] = "us"
    offset_path: str = ""
    value_unit: str = ""
    polarity: Polarity = "01"
    quaternion: Literal["xyzw", "wxyz"] = "xyzw"

    def ranks_of(self, spec: DatasetSpec) -> tuple[int, ...]:
        """Return the ranks that the stored dataset may have."""
        rank = len(spec.shape)
        if not self.columns:
            return (rank,)
        # Columns are picked from a last axis that a canonical dataset of rank 1 does not have. A grey image lacks it.
        return (2,) if rank == 1 else (rank, rank - 1)


@dataclass(frozen=True, slots=True)
class Hint:
    """A dataset by which the dialect is recognised: its path, and where stated its rank and the kind of its type."""

    __pydantic_config__: ClassVar[Mapping[str, str]] = _STRICT

    path: str
    rank: int | None = None
    kind: Literal["int", "float"] | None = None


@dataclass(frozen=True, slots=True)
class Dialect:
    """A layout as data.

    Attributes
    ----------
    name, description
        For people.
    canonical_elsewhere
        Whether datasets that are not named lie where the canonical layout puts them, in canonical units.
    datasets
        The place of each dataset by canonical key.
    hints
        Where two dialects fit a file equally well, the one with any of its hints in the file is chosen.
    """

    __pydantic_config__: ClassVar[Mapping[str, str]] = _STRICT

    name: str
    description: str = ""
    canonical_elsewhere: bool = False
    datasets: Mapping[str, DatasetPlace] = field(default_factory=dict)
    hints: tuple[Hint, ...] = ()

    def place_of(self, key: str) -> DatasetPlace | None:
        """Return where a canonical dataset lies; None where this dialect has no place for it."""
        return self.datasets.get(key, DatasetPlace() if self.canonical_elsewhere else None)

    def is_canonical(self, key: str) -> bool:
        """Whether the dialect holds the dataset to the canonical type and path."""
        return self.canonical_elsewhere and key not in self.datasets


def load_dialect(name_or_path: str | Path) -> Dialect:
    """Read a packaged dialect by its name, or a TOML file.

    Raises
    ------
    MisuseError
        No such dialect, not TOML, an unknown key, or a value that does not fit. The message names the key.
    """
    is_packaged = str(name_or_path) in DIALECT_NAMES
    if is_packaged:
        text = (resources.files("fedora_qa.layout") / "dialects" / f"{name_or_path}.toml").read_text("utf-8")
    else:
        try:
            text = Path(name_or_path).read_text("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            names = ", ".join(DIALECT_NAMES)
            message = f"Expected a dialect ({names}) or a TOML file, got {str(name_or_path)!r}: {error}"
            raise MisuseError(message) from error
    try:
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise MisuseError(f"Expected the dialect {name_or_path} to be TOML, got: {error}") from error
    if is_packaged:
        # Tests validate the packaged dialects.
        datasets = {
            key: DatasetPlace(**{**place, "columns": tuple(place.get("columns", ()))})
            for key, place in document.get("datasets", {}).items()
        }
        hints = tuple(Hint(**hint) for hint in document.get("hints", ()))
        return Dialect(**{**document, "datasets": datasets, "hints": hints})
    from pydantic import TypeAdapter, ValidationError  # noqa: PLC0415 - slow to load, and dialects of the package need none

    try:
        dialect = TypeAdapter(Dialect).validate_python(document)
    except ValidationError as error:
        problem = error.errors()[0]
        where = ".".join(str(part) for part in problem["loc"]) or "the document"
        raise MisuseError(f"Expected a dialect in {name_or_path}, got: {where}: {problem['msg']}") from error
    # All keys before any unit: an unknown key has no canonical unit.
    for key in dialect.datasets:
        if key not in DATASETS:
            message = f"datasets.{key}: Expected a canonical key such as path/events/t, got {key!r}"
            raise MisuseError(f"Expected a dialect in {name_or_path}, got: {message}")
    for key, place in dialect.datasets.items():
        # The factor is dropped: the call refuses an unknown unit now and not at the first read.
        scale_of(key, place)
    return dialect


def scale_of(key: str, place: DatasetPlace) -> float:
    """Return the factor from stored to canonical values.

    Raises
    ------
    MisuseError
        There is no conversion to the canonical unit.
    """
    canonical = DATASETS[key].units
    if place.value_unit in {"", canonical}:
        return 1.0
    scale = SCALES.get((place.value_unit, canonical))
    if scale is None:
        units = sorted(stored for stored, target in SCALES if target == canonical)
        raise MisuseError(
            f"Expected value_unit of {key} to be one of {', '.join([canonical, *units])}, got {place.value_unit!r}"
        )
    return scale

"""Dialects: layouts of others as data. Each is a TOML file that gives the place of every canonical dataset.

A dialect may describe a folder: ``files`` names its parts (roles), and places then name the role that holds them. A
dialect may also state ``metadata`` that no file of the layout holds, or holds elsewhere. A side file has the same table
``[metadata]`` for one sequence, and takes precedence.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from itertools import chain
from math import pi
from pathlib import Path, PurePosixPath
from typing import Any, ClassVar, Final, Literal

from fedora_qa.conventions import MM_PER_M, NS_PER_S, NS_PER_US, STANDARD_GRAVITY_M_S2
from fedora_qa.errors import MisuseError, did_you_mean
from fedora_qa.layout.binding import Polarity
from fedora_qa.layout.canonical import (
    ATTRIBUTES,
    DATASETS,
    FRAMES_OF_MAP,
    DatasetSpec,
    Size,
    flow_rate_hz,
    flow_stream_of,
    is_dataset_key,
    spec_of,
)
from fedora_qa.layout.conversions import MAP_DEFINITIONS, MATRIX_ROWS, ConversionName

DIALECT_NAMES: Final = ("fedora", "purdue-lab", "dsec", "mvsec", "m3ed", "v2e", "vid2e", "tum-vie", "eds")

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

KIND: Final = "kind"
"""Key of the metadata that states whether a sequence is recorded or synthetic."""

UNKNOWN: Final = "unknown"
"""Value of ``metadata/events/model`` where nobody states how the sensor responds."""

EVENT_MODEL: Final = "metadata/events/model"
DEPTH_RANGE: Final = "metadata/depth_range"
DISPARITY_TO_DEPTH: Final = "metadata/disparity_to_depth"
"""Not part of the layout: the matrix Q (4, 4) of OpenCV, by which disparity is read as depth."""

T_SECOND_DEPTH: Final = "metadata/T_second_depth"
"""Not part of the layout: (4, 4), from the depth camera to the second camera of the pair that disparity is between."""

T_POSED_BODY: Final = "metadata/T_posed_body"
"""Not part of the layout: (4, 4), from the body to the frame whose poses are stored, where that is another one."""

T_BODY_IMU: Final = "metadata/T_body_imu"
"""Not part of the layout: (4, 4), from the IMU to the body, where what it measures is stored in axes of its own."""

VERTICAL: Final = "metadata/vertical"
"""Not part of the layout: ``unknown`` where Z of the world need not point up."""

_POSE_NUMBERS: Final = 7
"""Of a position and a quaternion."""

_POSE: Final = "path/pose"
"""Stands for position, orientation and timestamps, the latter at the path ``timestamps`` of the same file."""

METADATA_KEYS: Final = frozenset(
    {f"{owner}/{name}".lstrip("/") for owner, name in ATTRIBUTES}
    | {DEPTH_RANGE, DISPARITY_TO_DEPTH, T_BODY_IMU, T_POSED_BODY, T_SECOND_DEPTH, VERTICAL}
)
"""What a dialect or a side file may declare."""


Constant = str | int | float | tuple[float, ...] | tuple[tuple[float, ...], ...]


_CONVERTED: Final[Mapping[str, Callable[[DatasetSpec], bool]]] = {
    "chw": lambda spec: spec.is_image and len(spec.shape) == 4,
    "until_next": lambda spec: spec.is_timestamps and len(spec.shape) == 2,
    "turned": lambda spec: spec.stream == "imu" and not spec.is_timestamps,
    "position_quaternion": lambda spec: spec.stream == "pose" and not spec.is_timestamps,
    **dict.fromkeys(MAP_DEFINITIONS, lambda spec: spec.stream in FRAMES_OF_MAP),
}
"""Of which datasets a conversion makes sense, where it does not of most."""


@dataclass(frozen=True, slots=True)
class MetadataPlace:
    """Where a declaration lies, or a factor of one.

    Attributes
    ----------
    file
        Role of the file that holds it; empty in dialects of one file.
    path
        A dataset or object of HDF5, or the keys of a YAML, TOML or JSON document, joined by slashes.
    attribute
        Attribute of the object at the path; empty: the values of the dataset itself.
    value
        In place of a path: the value, as a factor of a product.
    entry
        Number of the entry of a list that is meant; None: all of it.
    convert
        ``fx_fy_cx_cy``: four numbers, or a table that names them so, make the matrix of a pinhole camera.
        ``k1_k2_k3_k4``: a table that names coefficients of a lens so makes the list of them. ``projection``: it is the
        left part of a projection matrix (3, 4). ``position_quaternion``: seven numbers, or a table that names them
        ``px, py, pz, qx, qy, qz, qw``, make a transformation (4, 4).
    invert
        Whether the matrix is that of the inverse transformation.
    """

    __pydantic_config__: ClassVar[Mapping[str, str]] = _STRICT

    file: str = ""
    path: str = ""
    attribute: str = ""
    value: Constant | None = None
    entry: int | None = None
    convert: Literal["", "fx_fy_cx_cy", "k1_k2_k3_k4", "projection", "position_quaternion"] = ""
    invert: bool = False


Declaration = MetadataPlace | tuple[MetadataPlace, ...] | Constant
"""A place, a product of matrices at several places, or the value itself."""


def _places_in(declaration: Declaration) -> tuple[MetadataPlace, ...]:
    """Return the places that a declaration is read from; none of a constant."""
    parts = declaration if isinstance(declaration, tuple) else (declaration,)
    return tuple(place for place in parts if isinstance(place, MetadataPlace) and place.value is None)


@dataclass(frozen=True, slots=True)
class DatasetPlace:
    """Where a canonical dataset lies and how it is stored.

    Attributes
    ----------
    file
        Role of the file, or of the images, that hold it; empty in dialects of one file.
    path
        From the root of the file; empty: where the canonical layout puts it. In NPZ the name of the array; images,
        NPY and text have none.
    columns
        Entries of the last axis that make the canonical columns, in canonical order; those of a quaternion in the order
        that ``quaternion`` states; empty: all.
    members
        Of a dataset of a compound type: names of the members that are read; several are the entries of the last axis,
        of which ``columns`` may choose. Empty: the type is not compound.
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
    scale
        Factor from stored values to values in ``value_unit``.
    invalid
        Stored value that marks an invalid pixel, read as NaN.
    convert
        ``flow16``: 16-bit flow, (v - 2^15) / 128 px and a channel of validity. ``disparity``: px, read as depth by
        ``metadata/disparity_to_depth``, 0 invalid; ``disparity16``: the same from 16 bits, v / 256 px. ``chw``: the
        channels of an image come first. ``matrix4``: (4, 4) transformations, of which the dataset is a part; also
        without their last row, and row by row in 16 or 12 columns.
        ``position_quaternion``: the same from a position and a quaternion, seven columns, where the frame of the poses
        is not the body.
        ``until_next``: intervals from each instant to the next; what the stream holds for the last one is left out.
        ``turned``: samples of an IMU in axes of its own, which ``metadata/T_body_imu`` takes to those of the body.
        ``event_not_before``, ``event_before``, ``event_after``, ``nearest_event``: what an index map names
        (``conversions.MapDefinition``).
    invert
        Whether transformations are those of the world in the body, and are inverted.
    """

    __pydantic_config__: ClassVar[Mapping[str, str]] = _STRICT

    file: str = ""
    path: str = ""
    columns: tuple[int, ...] = ()
    members: tuple[str, ...] = ()
    time_unit: Literal["s", "ms", "us", "ns"] = "us"
    offset_path: str = ""
    value_unit: str = ""
    polarity: Polarity = "01"
    quaternion: Literal["xyzw", "wxyz"] = "xyzw"
    scale: float = 1.0
    invalid: float | None = None
    convert: ConversionName = ""
    invert: bool = False

    def stored_shape(self, spec: DatasetSpec) -> tuple[Size, ...]:
        """Return the symbolic shape before conversion, columns left aside."""
        rows, *axes = spec.shape
        # A transformation is a matrix a row; 16-bit flow has a third channel.
        shapes: dict[str, tuple[Size, ...]] = {
            "matrix4": (rows, 4, 4),
            "position_quaternion": (rows, _POSE_NUMBERS),
            "flow16": (rows, *axes[:-1], 3),
            "chw": (rows, *axes[-1:], *axes[:-1]),
            "until_next": (rows,),
        }
        return shapes.get(self.convert, spec.shape)

    def ranks_of(self, spec: DatasetSpec) -> tuple[int, ...]:
        """Return the ranks that the stored dataset may have."""
        rank = len(self.stored_shape(spec))
        if self.convert == "matrix4":
            # A matrix a row, or its numbers in a row.
            return (2,) if self.columns else (rank, 2)
        if not self.columns:
            return (rank,)
        # Columns are picked from a last axis, which a canonical dataset without them lacks, and so does a grey image.
        return (rank, rank - 1) if rank > 1 and spec.has_columns else (rank + 1,)


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
    files
        Patterns of the names of the files in a folder, by role, the first that matches any counts. The first role is
        that of a file which is given without its folder; a folder without it does not fit. Empty: one HDF5 file.
    datasets
        The place of each dataset by canonical key.
    metadata
        Declarations by canonical key (``METADATA_KEYS``).
    fewest_roles
        Of how many roles a folder must have files to be recognised: names such as ``*_data.h5`` are those of many.
    hints
        Where two dialects fit a file equally well, the one with any of its hints in the file is chosen.
    """

    __pydantic_config__: ClassVar[Mapping[str, str]] = _STRICT

    name: str
    description: str = ""
    canonical_elsewhere: bool = False
    files: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    datasets: Mapping[str, DatasetPlace] = field(default_factory=dict)
    metadata: Mapping[str, Declaration] = field(default_factory=dict)
    fewest_roles: int = 1
    hints: tuple[Hint, ...] = ()

    @property
    def first_role(self) -> str:
        """The role of a file that is given without its folder; empty in dialects of one file."""
        return next(iter(self.files), "")

    def place_of(self, key: str) -> DatasetPlace | None:
        """Return where a canonical dataset lies; None where this dialect has no place for it."""
        return self.datasets.get(key, DatasetPlace(file=self.first_role) if self.canonical_elsewhere else None)

    def roles_of_declaration(self, owner: str) -> tuple[str, ...]:
        """Return the roles of the files that hold attributes of an object of the layout, each once."""
        places = (_places_in(made) for key, made in self.metadata.items() if key.rpartition("/")[0] == owner)
        return tuple({place.file: None for place in chain.from_iterable(places)})

    def is_canonical(self, key: str) -> bool:
        """Whether the dialect holds the dataset to the canonical type and path."""
        return self.canonical_elsewhere and key not in self.datasets


@dataclass(frozen=True, slots=True)
class SideMetadata:
    """What a user declares beside a sequence: the name of the file that says so, and declarations by canonical key."""

    name: str
    metadata: Mapping[str, Declaration]


@dataclass(frozen=True, slots=True)
class Supplemented:
    """A dialect (None: recognised from each sequence), and what is declared beside the sequences."""

    dialect: Dialect | None
    side: SideMetadata


DialectChoice = Dialect | Supplemented | None
"""How sequences are read; None: as their dialect is recognised."""


def split_choice(choice: DialectChoice) -> tuple[Dialect | None, SideMetadata | None]:
    """Return the dialect of a choice, and what is declared beside the sequences."""
    return (choice.dialect, choice.side) if isinstance(choice, Supplemented) else (choice, None)


def load_dialect(name_or_path: str | Path) -> Dialect:
    """Read a packaged dialect by its name, or a TOML file.

    Raises
    ------
    MisuseError
        No such dialect, not TOML, an unknown key, or a value that does not fit. The message names the key.
    """
    if str(name_or_path) in DIALECT_NAMES:
        return _packaged(str(name_or_path))
    expected = f"a dialect ({', '.join(DIALECT_NAMES)}) or a TOML file"
    hint = did_you_mean(str(name_or_path), DIALECT_NAMES)
    if hint and not Path(name_or_path).exists():
        raise MisuseError(f"Expected {expected}, got {str(name_or_path)!r}{hint}")
    document = _read_document(name_or_path, expected, "the dialect")
    document = _spelt_out(document)
    try:
        from pydantic import TypeAdapter, ValidationError  # noqa: PLC0415 - slow to load, and dialects of the package need none

        dialect: Dialect = TypeAdapter(Dialect).validate_python(document)
    except ValidationError as error:
        raise _illegal("a dialect", name_or_path, error) from error
    try:
        _require_consistent(dialect)
    except MisuseError as error:
        raise MisuseError(f"Expected a dialect in {name_or_path}, got: {error}") from None
    for key, place in dialect.datasets.items():
        # The factor is dropped: the call refuses an unknown unit now and not at the first read.
        scale_of(key, place)
    return dialect


def load_choice(dialect: str | None, metadata: str | None) -> DialectChoice:
    """Return how sequences are read, by the names of a dialect and of a file of metadata; raises ``MisuseError``."""
    loaded = load_dialect(dialect) if dialect else None
    return Supplemented(loaded, load_side_metadata(metadata)) if metadata else loaded


def load_side_metadata(path: str | Path) -> SideMetadata:
    """Read what a TOML file declares in its table ``[metadata]``.

    Raises
    ------
    MisuseError
        There is no such file, it is not TOML, or it declares what the layout does not have. The message names the key.
    """
    from pydantic import TypeAdapter, ValidationError  # noqa: PLC0415 - slow to load

    document = _read_document(path, "metadata in a TOML file", "the metadata")
    if set(document) != {"metadata"}:
        others = ", ".join(sorted(set(document) - {"metadata"})) or "no such table"
        raise MisuseError(f"Expected one table [metadata] in {path}, got {others}")
    try:
        metadata: dict[str, Declaration] = TypeAdapter(dict[str, Declaration]).validate_python(document["metadata"])
    except ValidationError as error:
        raise _illegal("metadata", path, error) from error
    try:
        _require_known(metadata)
    except MisuseError as error:
        raise MisuseError(f"Expected metadata in {path}, got: {error}") from None
    return SideMetadata(Path(path).name, metadata)


def _read_document(path: str | Path, expected: str, noun: str) -> dict[str, Any]:
    try:
        text = Path(path).read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(f"Expected {expected}, got {str(path)!r}: {error}") from error
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise MisuseError(f"Expected {noun} {path} to be TOML, got: {error}") from error


def _illegal(noun: str, path: str | Path, error: Any) -> MisuseError:
    problem = error.errors()[0]
    where = ".".join(str(part) for part in problem["loc"]) or "the document"
    return MisuseError(f"Expected {noun} in {path}, got: {where}: {problem['msg']}")


@cache
def _packaged(name: str) -> Dialect:
    """Return a dialect of the package, which tests validate. A folder is compared with each of them many times."""
    text = (resources.files("fedora_qa.layout") / "dialects" / f"{name}.toml").read_text("utf-8")
    document = _spelt_out(tomllib.loads(text))
    datasets = {
        key: DatasetPlace(**place | {name: tuple(place.get(name, ())) for name in ("columns", "members")})
        for key, place in document.get("datasets", {}).items()
    }
    metadata = {key: _packaged_declaration(value) for key, value in document.get("metadata", {}).items()}
    hints = tuple(Hint(**hint) for hint in document.get("hints", ()))
    return Dialect(**{**document, "datasets": datasets, "metadata": metadata, "hints": hints})


def _packaged_declaration(value: Any) -> Any:
    if isinstance(value, dict):
        return MetadataPlace(**{name: _packaged_declaration(field) for name, field in value.items()})
    return tuple(map(_packaged_declaration, value)) if isinstance(value, list) else value


def _spelt_out(document: dict[str, Any]) -> dict[str, Any]:
    """Return a dialect without abbreviations: patterns as lists, and a pose as its three datasets."""
    files, datasets = document.get("files", {}), document.get("datasets", {})
    if isinstance(files, dict):
        files = {
            role: (patterns,)
            if isinstance(patterns, str)
            else tuple(patterns)
            if isinstance(patterns, list)
            else patterns
            for role, patterns in files.items()
        }
    if isinstance(datasets, dict) and isinstance(datasets.get(_POSE), dict):
        datasets = dict(datasets)
        place = datasets.pop(_POSE)
        timestamps = {name: place[name] for name in ("file", "time_unit") if name in place}
        stored = {name: value for name, value in place.items() if name not in {"timestamps", "time_unit"}}
        datasets |= {f"{_POSE}/position": stored, f"{_POSE}/orientation": stored}
        datasets[f"{_POSE}/ts"] = {**timestamps, "path": place.get("timestamps", "")}
    return {**document, "files": files, "datasets": datasets}


def _require_consistent(dialect: Dialect) -> None:
    """Raise ``MisuseError`` for an unknown key, an odd pattern, or a role that no pattern has."""
    for role, patterns in dialect.files.items():
        for pattern in patterns:
            parts = PurePosixPath(pattern).parts
            if not parts or pattern.startswith("/") or ".." in parts or "**" in parts or "\\" in pattern:
                raise MisuseError(f"files.{role}: Expected a pattern of names below the folder, got {pattern!r}")
        if not patterns or len({form_of(pattern) for pattern in patterns}) != 1:
            raise MisuseError(f"files.{role}: Expected one or more patterns of one format, got {list(patterns)}")
    # All keys before any unit: an unknown key has no canonical unit.
    for key, place in dialect.datasets.items():
        if not is_dataset_key(key):
            hint = did_you_mean(key, DATASETS)
            raise MisuseError(f"datasets.{key}: Expected a canonical key such as path/events/t, got {key!r}{hint}")
        fits = _CONVERTED.get(place.convert)
        if fits is not None and not fits(spec_of(key)):
            raise MisuseError(f"datasets.{key}.convert: Expected a conversion of such a dataset, got {place.convert!r}")
        if place.convert == "position_quaternion" and len(place.columns) not in {0, _POSE_NUMBERS}:
            message = f"Expected {_POSE_NUMBERS} columns, a position and a quaternion, got {len(place.columns)}"
            raise MisuseError(f"datasets.{key}.columns: {message}")
        if place.convert == "matrix4" and place.columns and (len(place.columns),) not in MATRIX_ROWS:
            message = f"Expected 12 or 16 columns, a matrix row by row, got {len(place.columns)}"
            raise MisuseError(f"datasets.{key}.columns: {message}")
        if len(place.columns) > 1 and not spec_of(key).has_columns:
            raise MisuseError(f"datasets.{key}.columns: Expected one column or channel, got {len(place.columns)}")
    rates: dict[float, str] = {}
    for stream in {stream: None for key in dialect.datasets if (stream := flow_stream_of(key))}:
        other = rates.setdefault(flow_rate_hz(stream), stream)
        if other != stream:
            raise MisuseError(f"datasets.path/{stream}: Expected each rate of flow once, got path/{other} as well")
    _require_known(dialect.metadata)
    named = [(f"datasets.{key}", place.file) for key, place in dialect.datasets.items()]
    named += [
        (f"metadata.{key}", place.file)
        for key, declaration in dialect.metadata.items()
        for place in _places_in(declaration)
    ]
    for where, role in named:
        if role not in dialect.files and (role or dialect.files):
            roles = ", ".join(dialect.files) or "no role, as the dialect has no [files]"
            raise MisuseError(f"{where}: Expected file to be a role of [files] ({roles}), got {role!r}")
    for key, place in dialect.datasets.items():
        if place.members and place.file and (form := form_of(dialect.files[place.file][0])) != "hdf5":
            message = f"Expected members of a compound type in HDF5, got a role of {form}; use columns"
            raise MisuseError(f"datasets.{key}.members: {message}")


def _require_known(metadata: Mapping[str, Declaration]) -> None:
    for key, value in metadata.items():
        if key not in METADATA_KEYS:
            hint = did_you_mean(key, METADATA_KEYS)
            raise MisuseError(f"metadata.{key}: Expected a key such as metadata/cameras/events/K, got {key!r}{hint}")
        if key == KIND and value not in {"recorded", "synthetic"}:
            raise MisuseError(f"metadata.kind: Expected recorded or synthetic, got {value!r}")
        if key == VERTICAL and value != UNKNOWN:
            raise MisuseError(f"{VERTICAL.replace('/', '.')}: Expected unknown, got {value!r}; or leave it out")


Form = Literal["hdf5", "images", "text", "array", "document"]

FORMS: Final[Mapping[str, Form]] = {
    ".h5": "hdf5", ".hdf5": "hdf5",
    ".png": "images", ".jpg": "images", ".jpeg": "images", ".exr": "images",
    ".txt": "text", ".csv": "text", ".tum": "text",
    ".npy": "array", ".npz": "array",
    ".yaml": "document", ".yml": "document", ".toml": "document", ".json": "document",
}  # fmt: skip
"""Format of a file by the ending of its name."""


def form_of(name: str) -> Form:
    """Return the format by the ending of a name or pattern; raises ``MisuseError`` for one that is not read."""
    form = FORMS.get(PurePosixPath(name).suffix.lower())
    if form is None:
        raise MisuseError(f"Expected a name that ends in one of {', '.join(FORMS)}, got {name!r}")
    return form


def scale_of(key: str, place: DatasetPlace) -> float:
    """Return the factor from stored to canonical values.

    Raises
    ------
    MisuseError
        There is no conversion to the canonical unit.
    """
    canonical = spec_of(key).units
    if place.value_unit in {"", canonical}:
        return place.scale
    scale = SCALES.get((place.value_unit, canonical))
    if scale is None:
        units = sorted(stored for stored, target in SCALES if target == canonical)
        raise MisuseError(
            f"Expected value_unit of {key} to be one of {', '.join([canonical, *units])}, got {place.value_unit!r}"
        )
    return place.scale * scale

"""Evaluate what a dialect, or a file beside the sequence, declares: constants, and values at paths in its files."""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.conversions import transformations
from fedora_qa.layout.decodable import require_filters, require_small_chunks, require_sound_blocks, require_whole_chunks
from fedora_qa.layout.dialect import Declaration, Dialect, MetadataPlace, SideMetadata
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.folder import OpenFolder
from fedora_qa.layout.hdf5_objects import RefusedError, find_dataset, find_object, reading, stored_attribute
from fedora_qa.sources.text import document_value

MOST_VALUES: Final = 4096
"""Values of a dataset that is read for a declaration; a list of hot pixels has hundreds."""

PINHOLE: Final = ("fx", "fy", "cx", "cy")
_PINHOLES: Final = (PINHOLE, ("fx", "fy", "ppx", "ppy"), ("focalX", "focalY", "centerX", "centerY"))
"""Names of the intrinsics in documents that name them: those of Basalt, librealsense, and RGB-D-E (lvsn)."""

_LENS: Final = ("k1", "k2", "k3", "k4")
_POSE: Final = ("px", "py", "pz", "qx", "qy", "qz", "qw")
"""Names of the parts of a transformation in documents, such as those of Basalt."""

_PROJECTION: Final = (3, 4)
_MATRICES: Final = {(3, 3), (4, 4)}

_UNIT: Final = 1e-3
"""How far the length of a quaternion may be from 1: three decimals are the fewest that are written. The value is not
derived."""


@dataclass(frozen=True, slots=True)
class Supplied:
    """A declaration that the sequence does not make itself in the way of the canonical layout.

    Attributes
    ----------
    value
        Number, text or array; None where ``problem`` states why there is none.
    origin
        Who declares it, in words, for the record.
    problem
        A sentence; empty where there is none.
    rounding
        Of a product of matrices, the sum of ``rounding_of`` over its factors.
    """

    value: Any
    origin: str
    problem: str = ""
    rounding: float = 0.0


def rounding_of(numbers: Any, value: float = 1.0) -> float:
    """Return by how much a value of a matrix may differ from what was meant, by the places in which it is stored.

    Half a unit of the last decimal place of the number that has most of them; and 2^-24 of the value, because a matrix
    may have been stored in float32 on the way.
    """
    texts = (Decimal(repr(float(number))).normalize() for number in np.ravel(numbers) if np.isfinite(number))
    exponents = [exponent for text in texts if isinstance(exponent := text.as_tuple().exponent, int)]
    return float(0.5 * 10.0 ** min([0, *exponents]) + abs(value) * 2.0**-24)


def supplied_declarations(
    dialect: Dialect,
    side: SideMetadata | None,
    holder: h5py.File | OpenFolder,
    external_files: ExternalFiles | None = None,
) -> dict[str, Supplied]:
    """Return what is declared for a sequence by canonical key; what a side file declares takes precedence.

    Declarations whose file a folder lacks are left out, and so is the rest of the camera that they belong to: it is of
    no use in part.
    """
    supplied: dict[str, Supplied] = {}
    missing: set[str] = set()
    sources: tuple[tuple[str, Mapping[str, Declaration]], ...] = ((f"dialect {dialect.name}", dialect.metadata),)
    for origin, metadata in (*sources, *(((side.name, side.metadata),) if side else ())):
        for key, declaration in metadata.items():
            try:
                value, place = _value(declaration, dialect, holder, external_files)
            except _MissingFileError:
                missing.add(key)
                continue
            except (RefusedError, OSError, ValueError) as error:
                supplied[key] = Supplied(None, origin, f"Expected {key} as {origin} states it, got: {error}")
                continue
            factors = declaration if isinstance(declaration, tuple) else ()
            rounding = sum(
                rounding_of(_value(factor, dialect, holder, external_files)[0])
                for factor in factors
                if isinstance(factor, MetadataPlace) and factor.value is None
            )
            supplied[key] = Supplied(value, f"{origin}: {place}" if place else origin, rounding=rounding)
    partial = {key.rpartition("/")[0] for key in missing - set(supplied) if key.startswith("metadata/cameras/")}
    return {key: made for key, made in supplied.items() if key.rpartition("/")[0] not in partial}


class _MissingFileError(Exception):
    """The folder has no file of a role."""


def _value(
    declaration: Declaration, dialect: Dialect, holder: h5py.File | OpenFolder, external_files: ExternalFiles | None
) -> tuple[Any, str]:
    """Return the value of a declaration, and where it was read; raises ``ValueError`` where it makes no sense."""
    if isinstance(declaration, MetadataPlace):
        return _converted(declaration, _stored(declaration, dialect, holder, external_files)), _shown(declaration)
    if isinstance(declaration, tuple) and declaration and isinstance(declaration[0], MetadataPlace):
        factors = [place for place in declaration if isinstance(place, MetadataPlace)]
        matrices = [np.asarray(_value(place, dialect, holder, external_files)[0], np.float64) for place in factors]
        if any(matrix.shape not in _MATRICES for matrix in matrices):
            raise ValueError("a product of what are not all 3 x 3 or 4 x 4 matrices")
        size = max(len(matrix) for matrix in matrices)
        product = np.eye(size)
        for matrix in matrices:
            factor = np.eye(size)
            factor[: len(matrix), : len(matrix)] = matrix  # a rotation beside transformations moves nothing
            product = product @ factor
        return product, " times ".join(_shown(place) for place in factors if place.value is None)
    return (np.asarray(declaration) if isinstance(declaration, tuple) else declaration), ""


def _stored(
    place: MetadataPlace, dialect: Dialect, holder: h5py.File | OpenFolder, external_files: ExternalFiles | None
) -> Any:
    if place.value is not None:
        return place.value
    if isinstance(holder, OpenFolder):
        files = holder.matched.files.get(place.file)
        if place.file not in dialect.files:
            raise ValueError(f"the role {place.file!r}, which the dialect {dialect.name} does not have")
        if files is None:
            raise _MissingFileError
        if files.form == "document":
            value = document_value(files.first, place.path)
            if value is None:
                raise ValueError(f"nothing at {place.path} of {files.first.name}")
            return value
        file = holder.hdf5.get(place.file)
        if file is None:
            raise ValueError(f"{files.first.name}, which holds no metadata")
    elif place.file == dialect.first_role:
        file = holder
    else:
        raise _MissingFileError
    if place.attribute:
        owner = find_object(file, place.path, external_files)
        value = stored_attribute(owner, place.attribute) if isinstance(owner, h5py.Group | h5py.Dataset) else None
        if value is None:
            raise ValueError(f"no attribute {place.attribute} at {place.path}")
        return value
    dataset = find_dataset(file, place.path, external_files)
    if dataset is None:
        raise ValueError(f"nothing at {place.path}")
    return small_values(dataset, place.path)


def small_values(dataset: h5py.Dataset, path: str) -> Any:
    """Return all values of a dataset of few numbers, or its one text; raises ``RefusedError`` for any other."""
    with reading(path):
        is_text = h5py.check_string_dtype(dataset.dtype) is not None
        few = dataset.shape is not None and dataset.size <= (1 if is_text else MOST_VALUES)
        if not few or not (is_text or dataset.dtype.kind in "iufb"):
            raise RefusedError("wrong_shape", "wrong_shape", f"Expected few numbers or one text at {path}")
        # Nothing bounds a scalar by itself: its chunk passes the same tests as that of a stream before it is read.
        require_filters(dataset, path)
        require_small_chunks(dataset, path)
        require_whole_chunks(dataset, path)
        if not is_text and dataset.shape:
            require_sound_blocks(dataset, 0, len(dataset))
        value = np.asarray(dataset[()])
        return value.reshape(-1)[0] if is_text else value


def _converted(place: MetadataPlace, stored: Any) -> Any:
    value = stored
    if place.entry is not None:
        entries = np.asarray(value).reshape(-1)
        if not -len(entries) <= place.entry < len(entries):
            raise ValueError(f"{len(entries)} entries where number {place.entry} is wanted")
        value = entries[place.entry]
    if place.convert == "fx_fy_cx_cy":
        fx, fy, cx, cy = _named_numbers(value, pinhole_names(value) or PINHOLE)
        value = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    if place.convert == "k1_k2_k3_k4":
        value = _named_numbers(value, _LENS)
    if place.convert == "position_quaternion":
        (value,), (length,) = transformations(_named_numbers(value, _POSE)[np.newaxis])
        if not abs(length - 1) < _UNIT:
            raise ValueError(f"a quaternion of length {length:.3g}, not 1")
    if place.convert == "projection":
        matrix = _numbers(value)
        if matrix.shape != _PROJECTION:
            raise ValueError(f"values of shape {matrix.shape} where a projection matrix, 3 x 4, is wanted")
        value = matrix[:, :3]
    if place.invert:
        matrix = _numbers(value)
        if matrix.shape not in _MATRICES or not np.all(np.isfinite(matrix)) or not np.linalg.cond(matrix) < 1e12:
            raise ValueError("a matrix that cannot be inverted")
        value = np.linalg.inv(matrix)
    return np.asarray(value) if isinstance(value, list | tuple) else value


def pinhole_names(document: Any) -> tuple[str, ...]:
    """Return the names under which a table of a document has the intrinsics; none where it has none of these."""
    names = _PINHOLES if isinstance(document, dict) else ()
    return next((four for four in names if all(isinstance(document.get(name), int | float) for name in four)), ())


def _named_numbers(value: Any, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the numbers of a list of as many, or those that a table has under these names."""
    if isinstance(value, dict):
        if missing := [name for name in names if name not in value]:
            raise ValueError(f"a table without {', '.join(missing)}")
        value = [value[name] for name in names]
    numbers = _numbers(value).reshape(-1)
    if len(numbers) != len(names):
        raise ValueError(f"{len(numbers)} numbers where {', '.join(names)} are wanted")
    return numbers


def _numbers(value: Any) -> NDArray[np.float64]:
    array = np.asarray(value)
    if array.dtype.kind not in "iuf":
        raise ValueError("values that are no numbers")
    return array.astype(np.float64)


def _shown(place: MetadataPlace) -> str:
    at = f"{place.path}@{place.attribute}" if place.attribute else place.path
    where = f"{at} of {place.file}" if place.file else at
    return f"{where}, inverted" if place.invert else where

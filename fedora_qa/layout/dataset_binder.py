"""Open a dataset where the dialect has it: the binding that states how its rows are read, or why it has none.

The functions below state the types and shapes in which a dataset may be stored.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import h5py
import numpy as np

from fedora_qa.causes import allowed
from fedora_qa.layout.binding import Binding, instant_ns, rows_together
from fedora_qa.layout.canonical import BESIDE, DatasetSpec
from fedora_qa.layout.conversions import MATRIX_ROWS, Conversion, depth_from_disparity
from fedora_qa.layout.decodable import (
    require_bounded,
    require_bounded_shape,
    require_filters,
    require_sound_blocks,
    require_whole_chunks,
    unwritten_chunks,
)
from fedora_qa.layout.dialect import (
    DISPARITY_TO_DEPTH,
    NS_PER_TIME_UNIT,
    QUATERNION_COLUMNS,
    T_BODY_IMU,
    T_POSED_BODY,
    DatasetPlace,
    Dialect,
    MetadataPlace,
    form_of,
    scale_of,
)
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.folder import OpenFolder
from fedora_qa.layout.hdf5_objects import READ_ERRORS, RefusedError, find_dataset, reading
from fedora_qa.layout.members import MembersForm, form_of_members, listed, require_not_compound
from fedora_qa.layout.metadata import Supplied, small_values
from fedora_qa.sources.images import number_in
from fedora_qa.sources.source import OutsideRows, SourceError

_FIRST_ROWS: Final = 1 << 16
"""Rows that tell whether floats are whole numbers, and which code polarity has: so many events are of either kind."""

_RIGID: Final = 1e-4
"""Largest departure of R^T R from the identity: calibrations in text have six digits or so."""

EXTRA_STREAMS: Final = ("depth_range", *BESIDE)
"""Datasets of the layout that are declarations, not streams."""


@dataclass(frozen=True, slots=True)
class LayoutProblem:
    """A defect of the layout.

    ``code`` is ``integrity.layout.<rule>``, ``cause`` an identifier of ``causes.py``, ``magnitude`` in its unit.
    ``is_lossless`` states that the values can be read as they were meant, so that only the form is unusual.
    """

    code: str
    cause: str
    stream: str
    key: str
    message: str
    magnitude: float | None = None
    is_lossless: bool = False


class BrokenDatasetError(Exception):
    """A defect of a dataset, for which its stream is absent."""

    def __init__(self, key: str, reason: RefusedError) -> None:
        super().__init__(str(reason))
        self.key = key
        self.reason = reason


class DatasetBinder:
    """Binds single datasets of a file or folder, and collects their problems.

    Attributes
    ----------
    problems
        Of the layout, in the order in which they are reported.
    inferred
        Values that were inferred and not declared.
    """

    def __init__(
        self,
        file: h5py.File | OpenFolder,
        dialect: Dialect,
        external_files: ExternalFiles | None,
        supplied: Mapping[str, Supplied],
    ) -> None:
        self.file = file
        self.dialect = dialect
        self.external_files = external_files
        self.supplied = supplied
        self.problems: list[LayoutProblem] = []
        self.inferred: dict[str, str | float] = {}

    def report(self, stream: str, key: str, reason: RefusedError, *, is_lossless: bool = False) -> None:
        """Add a problem of a stream, or of the declarations."""
        code = f"integrity.layout.{reason.rule}"
        stream = "metadata" if stream in EXTRA_STREAMS else stream
        cause = reason.cause if allowed(reason.cause, stream) else "unknown"
        self.problems.append(LayoutProblem(code, cause, stream, key, str(reason), reason.magnitude, is_lossless))

    def path(self, key: str) -> str:
        """Return the path of a dataset in its HDF5 file."""
        return self.place(key).path or key

    def place(self, key: str) -> DatasetPlace:
        """Return where the dialect has a dataset; the canonical place where it states none."""
        return self.dialect.place_of(key) or DatasetPlace()

    def has_place(self, key: str) -> bool:
        """Whether the dialect has a place for a dataset; of a single file, whether it is in the role of that file."""
        place = self.dialect.place_of(key)
        return place is not None and (isinstance(self.file, OpenFolder) or place.file == self.dialect.first_role)

    def holder(self, key: str) -> h5py.File | None:
        """Return the HDF5 file of a dataset; None where its role has none."""
        return self.file if isinstance(self.file, h5py.File) else self.file.hdf5.get(self.place(key).file)

    def words_of(self, key: str) -> str:
        """Return where a dataset is looked for, for people."""
        if isinstance(self.file, h5py.File) or self.holder(key) is not None:
            return self.path(key)
        place = self.place(key)
        where = self.file.matched.place(place.file)
        return f"{place.path} in {where}" if place.path and form_of(where) == "array" else where

    def name_without_number(self, key: str) -> str:
        """Return the first image of a dataset without a number that no other has; empty: it is none of images."""
        files = None if isinstance(self.file, h5py.File) else self.file.matched.files.get(self.place(key).file)
        if files is None or files.form != "images":
            return ""
        counts = Counter(map(number_in, files.names))
        return next((name for name in files.names if number_in(name) is None or counts[number_in(name)] > 1), "")

    def dataset(self, spec: DatasetSpec) -> h5py.Dataset | OutsideRows | None:
        """Open a dataset; None where there is none. Raises ``BrokenDatasetError``."""
        place, holder = self.place(spec.key), self.holder(spec.key)
        try:
            if holder is not None:
                return find_dataset(holder, self.path(spec.key), self.external_files)
            if isinstance(self.file, h5py.File) or place.file not in self.file.matched.files:
                return None
            if self.file.matched.files[place.file].form == "document":
                raise RefusedError("not_a_dataset", "wrong_shape", f"Expected rows at {place.file}, got a document")
            with reading(self.words_of(spec.key)):
                try:
                    of_names = spec.is_timestamps and len(spec.shape) == 1
                    # Events are not rows of equal length a file: those of several files follow on each other.
                    is_joined = spec.stream == "events"
                    return self.file.source(place.file, place.path, of_names=of_names, is_joined=is_joined)
                except SourceError as error:
                    raise RefusedError(error.rule, error.cause, str(error)) from error
        except RefusedError as refused:
            raise BrokenDatasetError(spec.key, refused) from refused

    def bind(self, spec: DatasetSpec, dataset: h5py.Dataset | OutsideRows | None) -> Binding:
        """Return how the rows of a dataset are read; raises ``BrokenDatasetError`` where they cannot be."""
        place, path = self.place(spec.key), self.path(spec.key)
        try:
            if not isinstance(dataset, h5py.Dataset):
                if dataset is None:
                    raise ValueError(f"Expected a dataset for {spec.key}, got none")
                return self._bind_source(spec, dataset)
            with reading(path):
                # Header tests come first: no chunk is decoded before its size and filters are known to be safe.
                form: h5py.Dataset | MembersForm = dataset
                if place.members:
                    form = form_of_members(dataset, place.members, path)
                    path = f"{path} ({listed(place.members)})"
                _require_readable_type(spec, form, path)
                _require_depth(place, form, path)
                _require_shape(spec, place, form, path)
                require_filters(dataset, path)
                require_bounded(spec, dataset, path)
                require_whole_chunks(dataset, path)
                binding = Binding(
                    key=spec.key,
                    path=self.path(spec.key),
                    rows=form.shape[0],
                    shape=form.shape,
                    dtype=form.dtype,
                    columns=_columns(spec, place),
                    members=place.members,
                    ns_per_unit=NS_PER_TIME_UNIT[place.time_unit] if spec.is_timestamps else None,
                    scale=scale_of(spec.key, place),
                    polarity=place.polarity,
                    role=place.file if isinstance(self.file, OpenFolder) else "",
                    conversion=self._conversion(place),
                    # 0 for contiguous storage: ``Sequence.chunk_rows`` then chooses blocks of about a megabyte.
                    chunk_rows=rows_together(spec.key, dataset.chunks[0]) if dataset.chunks else 0,
                    stored_chunk=dataset.chunks or (),
                )
                # Reported although the dataset can be read: another type than the layout's, and chunks never written.
                if self.dialect.is_canonical(spec.key) and dataset.dtype.newbyteorder("=") != np.dtype(spec.dtype):
                    message = (
                        f"Expected {path} as {spec.dtype}, got {dataset.dtype}; write it in the type of the layout"
                    )
                    lossless = _holds_without_loss(spec, dataset.dtype) and _is_whole(spec, dataset)
                    if lossless:
                        message = f"{message}, or read it by a dialect (fedora-qa layout FILE --draft-dialect OUT)"
                    refused = RefusedError("wrong_dtype", "wrong_dtype", message)
                    self.report(spec.stream, spec.key, refused, is_lossless=lossless)
                    if spec.key == "path/events/p" and place.polarity == "01" and _is_signed_polarity(dataset):
                        binding = replace(binding, polarity="plus_minus")
                        self.inferred["events.polarity"] = "1 brighter, -1 darker"
                unwritten, chunks = unwritten_chunks(dataset)
                if unwritten:
                    message = f"Expected all {chunks} chunks of {path} to be written, got {unwritten} that never were"
                    share = 100 * unwritten / chunks
                    self.report(spec.stream, spec.key, RefusedError("unwritten", "truncated", message, share))
                offset_ns = self._offset_ns(spec.key, place, binding)
                source: tuple[str, str] | None = None
                if self.external_files is not None:
                    there = dataset.file.filename
                    holder = self.holder(spec.key)
                    own = holder.filename if holder is not None else ""
                    outside = there != own or dataset.is_virtual or dataset.external
                    source = (there, dataset.name) if outside else None
                return replace(binding, offset_ns=offset_ns, source=source)
        except RefusedError as refused:
            raise BrokenDatasetError(spec.key, refused) from refused

    def _bind_source(self, spec: DatasetSpec, source: OutsideRows) -> Binding:
        """Bind rows that lie outside of HDF5; raises ``RefusedError``."""
        place, path = self.place(spec.key), self.words_of(spec.key)
        columns = _columns(spec, place)
        # Text always has an axis of columns; a single one needs no choice.
        if columns is None and len(place.stored_shape(spec)) == 1 and len(source.shape) == 2 and source.shape[1] == 1:
            columns, place = (0,), replace(place, columns=(0,))
        _require_readable_type(spec, source, path)
        _require_depth(place, source, path)
        _require_shape(spec, place, source, path)
        # The bounds of HDF5, but for those of its storage: a source itself compares what a file states with its bytes.
        require_bounded_shape(spec, source.shape, path)
        binding = Binding(
            key=spec.key,
            path=self.file.matched.place(place.file) if isinstance(self.file, OpenFolder) else path,
            rows=source.shape[0],
            shape=source.shape,
            dtype=source.dtype,
            columns=columns,
            ns_per_unit=NS_PER_TIME_UNIT[place.time_unit] if spec.is_timestamps else None,
            scale=scale_of(spec.key, place),
            polarity=place.polarity,
            chunk_rows=source.rows_together,
            stored_chunk=(source.rows_together, *source.shape[1:]) if source.rows_together else (),
            role=place.file,
            outside=source,
            conversion=self._conversion(place),
        )
        return replace(binding, offset_ns=self._offset_ns(spec.key, place, binding))

    def _conversion(self, place: DatasetPlace) -> Conversion | None:
        """Return what is done with the rows of a dataset; raises ``RefusedError`` where it lacks a declaration."""
        if not place.convert and place.invalid is None:
            return None
        conversion = Conversion(place.convert, place.invert, place.invalid)
        if place.convert in {"matrix4", "position_quaternion"}:
            return replace(conversion, T_posed_body=self._posed_body())
        if place.convert == "turned":
            return replace(conversion, R_body_sensor=self._body_imu())
        if place.convert not in {"disparity", "disparity16"}:
            return conversion
        made = self.supplied.get(DISPARITY_TO_DEPTH)
        if made is None or made.problem:
            message = made.problem if made else f"Expected {DISPARITY_TO_DEPTH} to read disparity by, got none"
            if made is None and (missing := self._missing_file(DISPARITY_TO_DEPTH)):
                message = f"{message}, because there is no {missing} in the folder"
            raise RefusedError("undeclared", "missing_stream", f"{message}; supply it (--metadata)")
        coefficients = depth_from_disparity(np.asarray(made.value, np.float64))
        if coefficients is None:
            message = f"Expected {DISPARITY_TO_DEPTH} as the matrix Q of OpenCV (4 x 4), got another"
            raise RefusedError("undeclared", "unknown", message)
        return replace(conversion, depth_from_disparity=coefficients)

    def _missing_file(self, key: str) -> str:
        """Return the name of the file that declares a key by the dialect, where a folder lacks it; else nothing."""
        declaration = self.dialect.metadata.get(key)
        role = declaration.file if isinstance(declaration, MetadataPlace) else ""
        if not role or isinstance(self.file, h5py.File) or role in self.file.matched.files:
            return ""
        return self.file.matched.place(role)

    def _body_imu(self) -> tuple[tuple[float, ...], ...]:
        """Return the rotation from the axes of the IMU to those of the body; raises ``RefusedError``."""
        made = self.supplied.get(T_BODY_IMU)
        matrix = np.empty(0) if made is None or made.problem else np.asarray(made.value, np.float64)
        if matrix.shape != (4, 4) or not np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=_RIGID):
            message = f"Expected {T_BODY_IMU} as a rigid transformation (4 x 4), got another; supply it (--metadata)"
            raise RefusedError("undeclared", "unknown", message)
        return tuple(tuple(map(float, row)) for row in matrix[:3, :3])

    def _posed_body(self) -> tuple[tuple[float, ...], ...]:
        """Return the transformation from the body to the frame whose poses are stored; empty where none is declared."""
        made = self.supplied.get(T_POSED_BODY)
        if made is None:
            return ()
        matrix = np.empty(0) if made.problem else np.asarray(made.value, np.float64)
        if matrix.shape != (4, 4) or not np.all(np.isfinite(matrix)):
            message = made.problem or f"Expected {T_POSED_BODY} as a transformation (4 x 4), got another"
            raise RefusedError("undeclared", "unknown", message)
        return tuple(tuple(map(float, row)) for row in matrix)

    def _offset_ns(self, key: str, place: DatasetPlace, binding: Binding) -> int:
        """Return what is added to timestamps, ns; 0 where the dialect names no such scalar or the file has none."""
        holder = self.holder(key)
        if not place.offset_path or holder is None:
            return 0
        dataset = find_dataset(holder, place.offset_path)
        if dataset is None:
            return 0
        values = np.asarray(small_values(dataset, place.offset_path))
        numeric = values.size == 1 and values.dtype.kind in "iuf"
        with reading(place.offset_path):
            offset = instant_ns(values.reshape(-1)[0], binding) if numeric else None
        if offset is None:
            raise RefusedError("wrong_shape", "wrong_shape", f"Expected one finite number at {place.offset_path}")
        return offset


def _columns(spec: DatasetSpec, place: DatasetPlace) -> tuple[int, ...] | None:
    """Return which stored entries are read, in canonical order; None: all as they are."""
    order = QUATERNION_COLUMNS[place.quaternion]
    if place.convert == "position_quaternion":
        columns = place.columns or tuple(range(3 + len(order)))
        return (*columns[:3], *(columns[3 + entry] for entry in order))
    if spec.key != "path/pose/orientation" or place.quaternion == "xyzw" or place.convert:
        return place.columns or None
    # The columns of a quaternion are in the stored order, of which the dialect says what it is.
    return tuple(place.columns[entry] for entry in order) if len(place.columns) == len(order) else order


def _holds_without_loss(spec: DatasetSpec, dtype: np.dtype[Any]) -> bool:
    """Return whether another type than the layout's holds the values of a dataset as they were meant.

    Returns
    -------
    bool
        Wider types, and whole numbers in others that hold them; float32 samples, whose step of 2^-24 of the value is
        below the noise of any IMU; millimetres of depth as integers of 16 bits or more. Narrower floats and scaled
        integers lose, and 8 bits hold no millimetres.
    """
    canonical = np.dtype(spec.dtype)
    if canonical.kind == "f":
        millimetres = spec.key == "path/depth" and dtype.kind in "iu" and dtype.itemsize >= 2
        # Whole metres of a range.
        metres = spec.stream == "depth_range" and dtype.kind in "iu"
        return millimetres or metres or (dtype.kind == "f" and dtype.itemsize >= 4)
    # float64 holds microseconds and indices up to 2^53 (285 years), float32 columns, rows and polarity up to 2^24.
    return dtype.kind in "iub" or dtype.itemsize >= (8 if canonical.itemsize == 8 else 4)


def _is_whole(spec: DatasetSpec, dataset: h5py.Dataset) -> bool:
    """Whether the first values in place of whole numbers are such, in the range of the layout's type, or not finite.

    Damage is found elsewhere.
    """
    canonical = np.dtype(spec.dtype)
    if canonical.kind == "f":
        return True
    try:
        # Images have a row a frame: one is enough.
        rows = 1 if spec.is_image else _FIRST_ROWS
        require_sound_blocks(dataset, 0, rows)
        values = np.asarray(dataset[:rows], np.float64)
    except READ_ERRORS:
        return True
    finite, limits = values[np.isfinite(values)], np.iinfo(canonical)
    # A polarity of -1 is darker.
    least = -1 if spec.key == "path/events/p" else limits.min
    return bool(np.all((finite == np.rint(finite)) & (finite >= least) & (finite <= limits.max)))


def _is_signed_polarity(dataset: h5py.Dataset) -> bool:
    """Whether the first events have polarities -1 and none 0, so that -1 is darker. Damage is found elsewhere."""
    if dataset.dtype.kind not in "if":
        return False
    try:
        require_sound_blocks(dataset, 0, _FIRST_ROWS)
        polarity = dataset[:_FIRST_ROWS]
    except READ_ERRORS:
        return False
    return bool(np.any(polarity == -1) and not np.any(polarity == 0))


def _require_readable_type(spec: DatasetSpec, dataset: h5py.Dataset | OutsideRows | MembersForm, path: str) -> None:
    """Refuse types without a safe conversion: all that are not numbers, and colours that are not 8-bit codes."""
    require_not_compound(dataset.dtype, path, spec.dtype)
    # At most 8 bytes: an extended float does not fit float64 without loss.
    numeric = dataset.dtype.kind in "iufb" and dataset.dtype.subdtype is None and dataset.dtype.itemsize <= 8
    if not numeric or (spec.key == "path/rgb" and dataset.dtype != np.uint8):
        message = f"Expected {path} as {spec.dtype}, got {dataset.dtype}, which cannot be converted safely"
        raise RefusedError("wrong_dtype", "wrong_dtype", message)


def _require_depth(place: DatasetPlace, dataset: h5py.Dataset | OutsideRows | MembersForm, path: str) -> None:
    """Refuse 8 bits where a conversion reads codes of 16: all of them would be invalid, or far too small."""
    if place.convert in {"flow16", "disparity16"} and dataset.dtype.itemsize == 1:
        message = f"Expected {path} of 16 bits, which {place.convert} needs, got 8 bits; write them anew, not scaled"
        raise RefusedError("wrong_dtype", "wrong_dtype", message)


def _require_shape(
    spec: DatasetSpec, place: DatasetPlace, dataset: h5py.Dataset | OutsideRows | MembersForm, path: str
) -> None:
    """Refuse a rank, a fixed size or an empty image that the layout does not have."""
    shape: tuple[int, ...] | None = dataset.shape
    stored = place.stored_shape(spec)
    # Length 0 along time is a legal empty stream; rows or images without entries are not.
    if shape is None or len(shape) not in place.ranks_of(spec) or 0 in shape[1:]:
        fits = False
    elif place.columns:
        # A table (rank 2) or an image with channels has the axis of columns; a grey image counts as one entry.
        has_columns = len(shape) == 2 or len(shape) >= len(stored)
        entries = shape[-1] if has_columns else 1
        fits = all(0 <= column < entries for column in place.columns)
    elif place.convert == "matrix4":
        fits = shape[1:] in MATRIX_ROWS
    else:
        fits = all(isinstance(size, str) or size == length for size, length in zip(stored, shape, strict=True))
    if not fits:
        expected = " x ".join(str(size) for size in stored)
        message = f"Expected {path} of shape {expected}, got {shape}"
        if spec.is_image and not spec.has_columns:
            if place.columns:
                message = f"Expected {path} of shape {expected} x channels, got {shape}"
            elif shape is not None and len(shape) > len(stored):
                message = f"{message}; columns = [0] reads the first of the channels"
        raise RefusedError("wrong_shape", "wrong_shape", message)

"""Find the canonical datasets in a file: its dialect, complete streams, absent streams, and problems."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import prod
from typing import Any, Final

import h5py
import numpy as np

from fedora_qa.causes import INDEX_MAPS, allowed
from fedora_qa.layout.binding import Binding, instant_ns, rows_together
from fedora_qa.layout.bitshuffle import require_sound_blocks
from fedora_qa.layout.bounds import LARGEST_IMAGE_PIXELS, MOST_SAMPLES, require_bounded, unwritten_chunks
from fedora_qa.layout.canonical import (
    FASTEST_FLOW_HZ,
    FLOW_STREAMS,
    FRAMES_OF_MAP,
    METADATA_GROUPS,
    PROMISED_BY,
    STREAM_GROUPS,
    STREAMS,
    DatasetSpec,
    companions_of,
    datasets_of,
    flow_rate_hz,
    flow_stream_of,
    in_file_order,
    is_flow_stream,
    spec_of,
)
from fedora_qa.layout.conversions import Conversion, depth_from_disparity
from fedora_qa.layout.detect import declares_fedora, detect_dialect
from fedora_qa.layout.dialect import (
    DISPARITY_TO_DEPTH,
    KIND,
    NS_PER_TIME_UNIT,
    QUATERNION_COLUMNS,
    T_POSED_BODY,
    DatasetPlace,
    Dialect,
    DialectChoice,
    scale_of,
    split_choice,
)
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.filters import require_filters, require_whole_chunks
from fedora_qa.layout.folder import OpenFolder
from fedora_qa.layout.links import (
    READ_ERRORS,
    RefusedError,
    damaged_name,
    find_dataset,
    find_object,
    has_group,
    names_in,
    reading,
)
from fedora_qa.layout.metadata import Supplied, small_values, supplied_declarations
from fedora_qa.sources.images import Images, left_out, numbers_of
from fedora_qa.sources.source import OutsideRows, SourceError

_EXTRA_STREAMS: Final = ("depth_range",)
"""Datasets of the layout that are declarations, not streams."""

_LIKE_A_RATE: Final = re.compile(r".*hz|[+-]?[0-9.]+", re.IGNORECASE)
"""Names in ``path/flow`` that are meant as rates, whether they are or not."""

_MOST_FLOW_RATES: Final = 32
"""Each pair of rates is compared: a file of unknown origin must not decide how long that takes."""

_FIRST_ROWS: Final = 1 << 16
"""Rows that tell whether floats are whole numbers, and which code polarity has: so many events are of either kind."""

_NEVER_EMPTY: Final = frozenset({"rgb", "depth", "imu", "pose"})
"""Streams that are sampled whatever happens: without a sample they are absent. A still scene gives no events, and a
sequence shorter than an interval gives no flow."""


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


@dataclass(frozen=True, slots=True)
class Layout:
    """Where everything lies in one file.

    Attributes
    ----------
    dialect_name
        The dialect that the file was read in.
    bindings
        By canonical key; only of whole streams.
    streams
        The complete streams: every dataset exists, shapes are consistent, types can be read.
    absent
        Why each other stream is absent, by stream.
    problems
        Defects of the layout, in the order of the canonical layout.
    inferred
        Values that were inferred and not declared, for the record.
    is_recognised
        Whether a dialect is named by the file or the user, or the file holds anything of one.
    supplied
        What the dialect, or a file beside the sequence, declares, by canonical key.
    """

    dialect_name: str
    bindings: Mapping[str, Binding]
    streams: frozenset[str]
    absent: Mapping[str, str]
    problems: tuple[LayoutProblem, ...] = ()
    inferred: Mapping[str, str | float] = field(default_factory=dict)
    is_recognised: bool = True
    supplied: Mapping[str, Supplied] = field(default_factory=dict, compare=False)  # arrays have no single truth


def resolve(
    file: h5py.File | OpenFolder, choice: DialectChoice = None, external_files: ExternalFiles | None = None
) -> Layout:
    """Find every canonical dataset.

    Parameters
    ----------
    file
        Open for reading; of a folder all its HDF5 files.
    choice
        The dialect of the file, and what is declared beside it; None: as ``detect_dialect`` returns it. A folder has
        been matched with its dialect already.
    external_files
        Which other files it may read from; None: no other.
    """
    inferred: dict[str, str | float] = {}
    dialect, side = split_choice(choice)
    if isinstance(file, OpenFolder):
        dialect = file.matched.dialect
        is_named = file.matched.is_named
        inferred |= {} if is_named else {"layout.dialect": dialect.name}
        inferred |= {f"files.{role}": words for role, words in file.matched.in_words().items()}
        if unused := file.matched.unused:
            inferred["layout.unused"] = f"{len(unused)} of the folder's files, such as {unused[0]}"
    else:
        is_named = dialect is not None or declares_fedora(file)
        if dialect is None:
            dialect = detect_dialect(file, external_files)
            if not declares_fedora(file):
                inferred["layout.dialect"] = dialect.name
    supplied = supplied_declarations(dialect, side, file, external_files)
    # The values may be large; who declares them is what a reader of the record needs.
    inferred |= {f"declared.{key}": made.origin for key, made in supplied.items() if key != KIND}
    if KIND in supplied:
        inferred[KIND] = str(supplied[KIND].value)
    finder = _Finder(file, dialect, external_files, supplied)
    # In the order of the layout: the first stream with a symbolic size is the reference for all later ones.
    streams = finder.streams()
    for stream in (*streams, *_EXTRA_STREAMS):
        finder.find(stream)
    # Only metadata of the canonical layout declare streams; files of other dialects carry none.
    if dialect.canonical_elsewhere:
        finder.report_declared_streams()
        finder.report_metadata_links()
    return Layout(
        dialect_name=dialect.name,
        bindings=finder.bindings,
        # A stream is bound whole or not at all, so that its first dataset stands for all.
        streams=frozenset(stream for stream in streams if datasets_of(stream)[0].key in finder.bindings),
        absent={stream: why for stream, why in finder.absent.items() if stream in streams},
        problems=tuple(finder.problems),
        inferred=inferred | finder.inferred,
        is_recognised=is_named or bool(finder.bindings or finder.problems),
        supplied=supplied,
    )


def unrecognised(path: str) -> Layout:
    """Return the layout of a folder that fits no dialect."""
    absent = dict.fromkeys(STREAMS, f"no dialect fits the folder {path}")
    return Layout("unknown", {}, frozenset(), absent, is_recognised=False)


class _Finder:
    """Finds the datasets stream by stream. All streams must agree on symbolic sizes; the first with a size sets it."""

    def __init__(
        self,
        file: h5py.File | OpenFolder,
        dialect: Dialect,
        external_files: ExternalFiles | None,
        supplied: Mapping[str, Supplied],
    ) -> None:
        self.file = file
        self.supplied = supplied
        self.external_files = external_files
        self.dialect = dialect
        self.bindings: dict[str, Binding] = {}
        self.absent: dict[str, str] = {}
        self.problems: list[LayoutProblem] = []
        self.inferred: dict[str, str | float] = {}
        self._sizes: dict[str, tuple[int, str]] = {}
        self._searched_groups: set[str] = set()

    def streams(self) -> tuple[str, ...]:
        """Return the streams to look for: of flow the usual rates, or those of the file where it has any other.

        Names of datasets that are no rates, and a second name of a rate, are reported.
        """
        held = {flow_stream_of(key) for key in self.dialect.datasets} - {""}
        if self.dialect.canonical_elsewhere:
            holder = self._holder("path/flow")
            held |= self._stored_rates(names_in(holder, "path/flow", self.external_files)) if holder else set()
        if held <= set(FLOW_STREAMS):
            return STREAMS
        return in_file_order({*STREAMS, *held} - {*FLOW_STREAMS} | held)

    def _stored_rates(self, names: Iterable[str]) -> set[str]:
        """Return the flow streams that names of datasets in ``path/flow`` are of."""
        by_rate_hz: dict[float, set[str]] = {}
        for rate in dict.fromkeys(name.removesuffix("_ts").removesuffix("_moving") for name in names):
            stream = f"flow/{rate}"
            if is_flow_stream(stream):
                by_rate_hz.setdefault(flow_rate_hz(stream), set()).add(stream)
            elif _LIKE_A_RATE.fullmatch(rate):
                message = (
                    f"Expected path/flow/<R>hz with a rate R above 0 and up to {FASTEST_FLOW_HZ:g}, in digits such as "
                    f"12.5, got path/flow/{rate}; rename it"
                )
                self._report("flow", f"path/flow/{rate}", RefusedError("rate_name", "unknown", message))
        held: set[str] = set()
        for streams in by_rate_hz.values():
            # The shortest name has no needless zeros. Which of two fields of one rate is meant cannot be known.
            first, *others = sorted(streams, key=lambda stream: (len(stream), stream))
            held.add(first)
            for other in others:
                message = (
                    f"Expected one flow of {flow_rate_hz(first):g} Hz, got path/{first} and path/{other}; "
                    f"the first is read, remove or rename the other"
                )
                self._report(first, f"path/{other}", RefusedError("two_names", "unknown", message))
        if len(held) > _MOST_FLOW_RATES:
            message = f"Expected flow of {_MOST_FLOW_RATES} rates at most, got {len(held)}; the lowest are read"
            self._report("flow", "", RefusedError("too_many", "unknown", message))
        return set(in_file_order(held)[:_MOST_FLOW_RATES])

    def find(self, stream: str) -> None:
        """Bind all datasets of a stream, or none, with the reason in ``absent``."""
        specs = datasets_of(stream)
        unplaced = [spec.key for spec in specs if not self._has_place(spec.key)]
        if unplaced:
            self.absent[stream] = f"the dialect {self.dialect.name} has no place for {', '.join(unplaced)}"
            return
        try:
            datasets = {spec.key: self._dataset(spec) for spec in specs}
            missing = [key for key, dataset in datasets.items() if dataset is None]
            if len(missing) == len(specs):
                path, holder = self._path(specs[0].key), self._holder(specs[0].key)
                where = "file" if isinstance(self.file, h5py.File) else "folder"
                self.absent[stream] = f"there is no {self._shown(specs[0].key)} in the {where}"
                # A damaged name in the group, reported once a group, may be that of the missing stream.
                group = path.rpartition("/")[0]
                if group not in self._searched_groups and holder is not None:
                    self._searched_groups.add(group)
                    damaged = damaged_name(holder, group, self.external_files)
                    if damaged is not None:
                        message = f"Expected {path}, or names of text in {group or '/'}, got a damaged one: {damaged}"
                        self._report(stream, "", RefusedError("unreadable", "corrupt_chunk", message))
                return
            if missing:
                present = next(key for key, dataset in datasets.items() if dataset is not None)
                message = f"Expected {self._shown(missing[0])} beside {self._shown(present)}, got nothing there"
                raise _BrokenError(missing[0], RefusedError("missing_stream", "missing_stream", message))
            bound = {spec.key: self._bind(spec, datasets[spec.key]) for spec in specs}
            self._agree_on_sizes(specs, bound)
            if any(binding.is_of_instants for binding in bound.values()):
                # n instants begin n - 1 intervals: what is stored for the last has none.
                bound = {key: _without_last_row(binding) for key, binding in bound.items()}
            first = bound[specs[0].key]
            if stream in _NEVER_EMPTY and not first.rows:
                message = f"Expected samples in {first.path}, got none; write the stream, or leave its datasets out"
                raise _BrokenError(first.key, RefusedError("empty", "missing_stream", message))
        except _BrokenError as broken:
            self.absent[stream] = str(broken.reason)
            self._report(stream, broken.key, broken.reason)
            return
        self.bindings.update(bound)
        self._report_gaps(stream, bound)
        # A companion is bound by itself: the stream is complete without it.
        for spec in companions_of(stream):
            if not self._has_place(spec.key):
                continue
            try:
                dataset = self._dataset(spec)
                if dataset is None:
                    continue
                bound = {spec.key: self._bind(spec, dataset)}
                self._agree_on_sizes((spec,), bound)
            except _BrokenError as broken:
                self._report(spec.stream, broken.key, broken.reason)
                continue
            self.bindings.update(bound)

    def report_declared_streams(self) -> None:
        """Report streams that metadata, a group or an index map declare and of which the file holds nothing."""
        reported = {problem.stream for problem in self.problems}
        groups = ((s, g) for s, g in (*PROMISED_BY.items(), *STREAM_GROUPS.items()) if self._has_group(g))
        maps = [key for key in (f"metadata/{name}" for name in FRAMES_OF_MAP) if key in self.bindings]
        of_maps = ((s, key) for key in maps for s in (FRAMES_OF_MAP[key.removeprefix("metadata/")], "events"))
        for stream, place in (*groups, *of_maps):
            if stream in self.absent and stream not in reported:
                self._report_declared(stream, place)
                reported.add(stream)
        # One group declares flow of all rates, and any one rate fulfils it.
        no_flow = not any(is_flow_stream(stream) for stream in (*map(_stream_of, self.bindings), *reported))
        flow_groups = [group for group in ("metadata/flow", "path/flow") if self._has_group(group)]
        if no_flow and flow_groups:
            self._report_declared("flow", flow_groups[0])

    def report_metadata_links(self) -> None:
        """Report groups of metadata behind links that are not followed: their declarations are not read."""
        if not isinstance(self.file, h5py.File):
            return
        for owner in METADATA_GROUPS:
            try:
                find_object(self.file, owner, self.external_files)
            except RefusedError as refused:
                self._report("metadata", "", refused)

    def _has_group(self, path: str) -> bool:
        return isinstance(self.file, h5py.File) and has_group(self.file, path, self.external_files)

    def _report_declared(self, stream: str, place: str) -> None:
        message = f"Expected {stream}, which /{place} declares, got no such stream; write it or drop the declaration"
        self._report(stream, "", RefusedError("missing_stream", "missing_stream", message))

    def _report(self, stream: str, key: str, reason: RefusedError, *, is_lossless: bool = False) -> None:
        code = f"integrity.layout.{reason.rule}"
        stream = "metadata" if stream in _EXTRA_STREAMS else stream
        cause = reason.cause if allowed(reason.cause, stream) else "unknown"
        self.problems.append(LayoutProblem(code, cause, stream, key, str(reason), reason.magnitude, is_lossless))

    def _path(self, key: str) -> str:
        return self._place(key).path or key

    def _place(self, key: str) -> DatasetPlace:
        return self.dialect.place_of(key) or DatasetPlace()

    def _has_place(self, key: str) -> bool:
        """Whether the dialect has a place for a dataset; of a single file, whether it is in the role of that file."""
        place = self.dialect.place_of(key)
        return place is not None and (isinstance(self.file, OpenFolder) or place.file == self.dialect.first_role)

    def _holder(self, key: str) -> h5py.File | None:
        """Return the HDF5 file of a dataset; None where its role has none."""
        return self.file if isinstance(self.file, h5py.File) else self.file.hdf5.get(self._place(key).file)

    def _shown(self, key: str) -> str:
        """Return where a dataset is looked for, for people."""
        if isinstance(self.file, h5py.File) or self._holder(key) is not None:
            return self._path(key)
        return self.file.matched.place(self._place(key).file)

    def _dataset(self, spec: DatasetSpec) -> h5py.Dataset | OutsideRows | None:
        place, holder = self._place(spec.key), self._holder(spec.key)
        try:
            if holder is not None:
                return find_dataset(holder, self._path(spec.key), self.external_files)
            if isinstance(self.file, h5py.File) or place.file not in self.file.matched.files:
                return None
            if self.file.matched.files[place.file].form == "document":
                raise RefusedError("not_a_dataset", "wrong_shape", f"Expected rows at {place.file}, got a document")
            with reading(self._shown(spec.key)):
                try:
                    of_names = spec.is_timestamps and len(spec.shape) == 1
                    return self.file.source(place.file, place.path, of_names=of_names)
                except SourceError as error:
                    raise RefusedError(error.rule, error.cause, str(error)) from error
        except RefusedError as refused:
            raise _BrokenError(spec.key, refused) from refused

    def _bind(self, spec: DatasetSpec, dataset: h5py.Dataset | OutsideRows | None) -> Binding:
        place, path = self._place(spec.key), self._path(spec.key)
        try:
            if not isinstance(dataset, h5py.Dataset):
                if dataset is None:
                    raise ValueError(f"Expected a dataset for {spec.key}, got none")
                return self._bind_source(spec, dataset)
            with reading(path):
                # Header tests come first: no chunk is decoded before its size and filters are known to be safe.
                require_readable_type(spec, dataset, path)
                require_shape(spec, place, dataset, path)
                require_filters(dataset, path)
                require_bounded(spec, dataset, path)
                require_whole_chunks(dataset, path)
                binding = Binding(
                    key=spec.key,
                    path=path,
                    rows=dataset.shape[0],
                    shape=dataset.shape,
                    dtype=dataset.dtype,
                    columns=_columns(spec, place),
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
                    lossless = holds_without_loss(spec, dataset.dtype) and _is_whole(spec, dataset)
                    if lossless:
                        message = f"{message}, or read it by a dialect (fedora-qa layout FILE --draft-dialect OUT)"
                    refused = RefusedError("wrong_dtype", "wrong_dtype", message)
                    self._report(spec.stream, spec.key, refused, is_lossless=lossless)
                    if spec.key == "path/events/p" and place.polarity == "01" and _is_signed_polarity(dataset):
                        binding = replace(binding, polarity="plus_minus")
                        self.inferred["events.polarity"] = "1 brighter, -1 darker"
                unwritten, chunks = unwritten_chunks(dataset)
                if unwritten:
                    message = f"Expected all {chunks} chunks of {path} to be written, got {unwritten} that never were"
                    share = 100 * unwritten / chunks
                    self._report(spec.stream, spec.key, RefusedError("unwritten", "truncated", message, share))
                offset_ns = self._offset_ns(spec.key, place, binding)
                source: tuple[str, str] | None = None
                if self.external_files is not None:
                    there = dataset.file.filename
                    holder = self._holder(spec.key)
                    own = holder.filename if holder is not None else ""
                    outside = there != own or dataset.is_virtual or dataset.external
                    source = (there, dataset.name) if outside else None
                return replace(binding, offset_ns=offset_ns, source=source)
        except RefusedError as refused:
            raise _BrokenError(spec.key, refused) from refused

    def _bind_source(self, spec: DatasetSpec, source: OutsideRows) -> Binding:
        """Bind rows that lie outside of HDF5; raises ``RefusedError``."""
        place, path = self._place(spec.key), self._shown(spec.key)
        columns = _columns(spec, place)
        # Text always has an axis of columns; a single one needs no choice.
        if columns is None and len(place.stored_shape(spec)) == 1 and len(source.shape) == 2 and source.shape[1] == 1:
            columns, place = (0,), replace(place, columns=(0,))
        require_readable_type(spec, source, path)
        require_shape(spec, place, source, path)
        # The bounds of HDF5, but for those of its storage: a source itself compares what a file states with its bytes.
        if spec.is_image and prod(source.shape[1:3]) > LARGEST_IMAGE_PIXELS:
            message = f"Expected {path} in images of {LARGEST_IMAGE_PIXELS} pixels at most, got {source.shape[1:3]}"
            raise RefusedError("too_large", "wrong_shape", message)
        if not spec.is_image and spec.stream != "events" and source.shape[0] > MOST_SAMPLES:
            message = f"Expected {path} in {MOST_SAMPLES} rows at most, got {source.shape[0]}"
            raise RefusedError("too_large", "wrong_shape", message)
        binding = Binding(
            key=spec.key,
            path=path,
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
        if place.convert == "matrix4":
            return replace(conversion, T_posed_body=self._posed_body())
        if place.convert not in {"disparity", "disparity16"}:
            return conversion
        made = self.supplied.get(DISPARITY_TO_DEPTH)
        if made is None or made.problem:
            message = made.problem if made else f"Expected {DISPARITY_TO_DEPTH} to read disparity by, got none"
            raise RefusedError("undeclared", "missing_stream", f"{message}; supply it (--metadata)")
        coefficients = depth_from_disparity(np.asarray(made.value, np.float64))
        if coefficients is None:
            message = f"Expected {DISPARITY_TO_DEPTH} as the matrix Q of OpenCV (4 x 4), got another"
            raise RefusedError("undeclared", "unknown", message)
        return replace(conversion, depth_from_disparity=coefficients)

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
        holder = self._holder(key)
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

    def _gap(self, bound: Mapping[str, Binding]) -> str:
        """Return the first number that the names of images leave out, in words; empty where they leave out none."""
        for binding in bound.values():
            if isinstance(binding.outside, Images):
                numbers = numbers_of(binding.outside.path, binding.outside.names)
                missing = left_out(numbers.rows(0, len(numbers.numbers))) if numbers else None
                if missing is not None:
                    return f"the numbers in the names of {binding.path} leave out {missing}"
        return ""

    def _report_gaps(self, stream: str, bound: Mapping[str, Binding]) -> None:
        # Where the names are the timestamps, a gap is one of time, which other checks measure.
        if any(spec.is_timestamps and self._place(spec.key).file == self._place(datasets_of(stream)[0].key).file
               for spec in datasets_of(stream)):  # fmt: skip
            return
        if gap := self._gap(bound):
            message = f"Expected numbers in equal steps, got a gap: {gap}; every image has a timestamp"
            self._report(stream, "", RefusedError("gap", "unknown", message), is_lossless=True)

    def _agree_on_sizes(self, specs: Iterable[DatasetSpec], bound: Mapping[str, Binding]) -> None:
        """Compare symbolic sizes with those of earlier datasets; keep the new ones only if the whole stream agrees."""
        # A copy: a stream that fails must not fix the sizes of the streams after it.
        sizes = dict(self._sizes)
        for spec in specs:
            stored_shape = self._place(spec.key).stored_shape(spec)
            for symbol, size in zip(stored_shape, bound[spec.key].shape, strict=False):
                if isinstance(symbol, int):
                    continue
                path = bound[spec.key].path
                agreed, agreed_path = sizes.setdefault(symbol, (size, path))
                if size != agreed:
                    gap = self._gap(bound)
                    message = f"Expected {path} with {symbol} = {agreed} as {agreed_path}, got {size}"
                    message = f"{message}; {gap}" if gap else message
                    reason = RefusedError("wrong_shape", "wrong_shape", message)
                    # An index map that is too short was cut off.
                    if spec.stream in INDEX_MAPS and size < agreed:
                        reason = RefusedError("wrong_shape", "truncated", message, 100 * (agreed - size) / agreed)
                    raise _BrokenError(spec.key, reason)
        self._sizes = sizes


def _without_last_row(binding: Binding) -> Binding:
    rows = max(binding.rows - 1, 0)
    return replace(binding, rows=rows, shape=(rows, *binding.shape[1:]))


def _columns(spec: DatasetSpec, place: DatasetPlace) -> tuple[int, ...] | None:
    """Return which stored entries are read, in canonical order; None: all as they are."""
    is_reordered = spec.key == "path/pose/orientation" and place.quaternion != "xyzw" and not place.convert
    return place.columns or (QUATERNION_COLUMNS[place.quaternion] if is_reordered else None)


def holds_without_loss(spec: DatasetSpec, dtype: np.dtype[Any]) -> bool:
    """Return whether another type than the layout's holds the values of a dataset as they were meant.

    Parameters
    ----------
    spec
        Of the dataset.
    dtype
        As stored.

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
        return millimetres or (dtype.kind == "f" and dtype.itemsize >= 4)
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


def require_readable_type(spec: DatasetSpec, dataset: h5py.Dataset | OutsideRows, path: str) -> None:
    """Refuse types without a safe conversion: all that are not numbers, and colours that are not 8-bit codes."""
    # At most 8 bytes: an extended float does not fit float64 without loss.
    numeric = dataset.dtype.kind in "iufb" and dataset.dtype.subdtype is None and dataset.dtype.itemsize <= 8
    if not numeric or (spec.key == "path/rgb" and dataset.dtype != np.uint8):
        message = f"Expected {path} as {spec.dtype}, got {dataset.dtype}, which cannot be converted safely"
        raise RefusedError("wrong_dtype", "wrong_dtype", message)


def require_shape(spec: DatasetSpec, place: DatasetPlace, dataset: h5py.Dataset | OutsideRows, path: str) -> None:
    """Refuse a rank, a fixed size or an empty image that the layout does not have."""
    shape: tuple[int, ...] | None = dataset.shape
    stored = place.stored_shape(spec)
    # Length 0 along time is a legal empty stream; rows or images without entries are not.
    if shape is None or len(shape) not in place.ranks_of(spec) or 0 in shape[1:]:
        fits = False
    elif place.columns:
        # A table (rank 2) or an image with channels has the axis of columns; a grey image counts as one entry.
        has_columns = len(shape) == 2 or len(shape) == len(stored)
        entries = shape[-1] if has_columns else 1
        fits = all(0 <= column < entries for column in place.columns)
    else:
        fits = all(isinstance(size, str) or size == length for size, length in zip(stored, shape, strict=True))
    if not fits:
        expected = " x ".join(str(size) for size in stored)
        raise RefusedError("wrong_shape", "wrong_shape", f"Expected {path} of shape {expected}, got {shape}")


def _stream_of(key: str) -> str:
    return spec_of(key).stream


class _BrokenError(Exception):
    """A defect of one dataset, for which its stream is absent."""

    def __init__(self, key: str, reason: RefusedError) -> None:
        super().__init__(str(reason))
        self.key = key
        self.reason = reason

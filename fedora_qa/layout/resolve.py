"""Find the canonical datasets in a file: its dialect, complete streams, absent streams, and problems.

The dialect is that which the file declares, or else the one with most datasets in it.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from itertools import chain
from typing import Final

import h5py

from fedora_qa.causes import INDEX_MAPS
from fedora_qa.conventions import FORMAT_NAME
from fedora_qa.layout.binding import Binding
from fedora_qa.layout.canonical import (
    BESIDE,
    DATASETS,
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
from fedora_qa.layout.dataset_binder import EXTRA_STREAMS, BrokenDatasetError, DatasetBinder, LayoutProblem
from fedora_qa.layout.dialect import (
    DIALECT_NAMES,
    KIND,
    T_BODY_IMU,
    T_POSED_BODY,
    Dialect,
    DialectChoice,
    form_of,
    load_dialect,
    split_choice,
)
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.folder import MatchedFolder, OpenFolder
from fedora_qa.layout.hdf5_objects import (
    READ_ERRORS,
    RefusedError,
    damaged_name,
    find_dataset,
    find_object,
    has_group,
    names_in,
    text_attribute,
)
from fedora_qa.layout.metadata import Supplied, supplied_declarations
from fedora_qa.sources.images import Images, left_out, numbers_of

_DTYPE_KINDS = {"int": "iu", "float": "f"}

_LEAST_SIMILARITY: Final = 0.85
"""Of difflib's ratio, 2 M / T for M equal letters of T: a letter of a name of seven may differ, two of fourteen."""

_LIKE_A_RATE: Final = re.compile(r".*hz|[+-]?[0-9.]+", re.IGNORECASE)
"""Names in ``path/flow`` that are meant as rates, whether they are or not."""

_MOST_FLOW_RATES: Final = 32
"""Each pair of rates is compared: a file of unknown origin must not decide how long that takes."""

_NEVER_EMPTY: Final = frozenset({"rgb", "depth", "imu", "pose"})
"""Streams that are sampled whatever happens: without a sample they are absent. A still scene gives no events, and a
sequence shorter than an interval gives no flow."""


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
        is_named = dialect is not None or _declares_fedora(file)
        if dialect is None:
            dialect = detect_dialect(file, external_files)
            if not _declares_fedora(file):
                inferred["layout.dialect"] = dialect.name
    supplied = supplied_declarations(dialect, side, file, external_files)
    # The values may be large; who declares them is what a reader of the record needs.
    inferred |= {f"declared.{key}": made.origin for key, made in supplied.items() if key != KIND}
    if KIND in supplied:
        inferred[KIND] = str(supplied[KIND].value)
    binder = DatasetBinder(file, dialect, external_files, supplied)
    if isinstance(file, OpenFolder) and not is_named:
        _report_unused(file.matched, binder)
    finder = _Finder(binder)
    # In the order of the layout: the first stream with a symbolic size is the reference for all later ones.
    streams = finder.streams()
    for stream in (*streams, *EXTRA_STREAMS):
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
        problems=tuple(binder.problems),
        inferred=inferred | binder.inferred,
        is_recognised=is_named or bool(finder.bindings or binder.problems),
        supplied=supplied,
    )


def _report_unused(matched: MatchedFolder, binder: DatasetBinder) -> None:
    """Note images of which none is read, and a folder of which most files are not, although a dialect fits."""
    unused = matched.unused_data
    images = [name for name in unused if form_of(name) == "images"]
    place = matched.dialect.datasets.get("path/rgb")
    patterns = matched.dialect.files[place.file] if place and place.file not in matched.files else ()
    got = f"; draft a dialect with `{matched.draft_command}` where they are streams"
    if images and patterns and form_of(patterns[0]) == "images":
        message = (
            f"Expected images at {' or '.join(patterns)}, as in the dialect {matched.dialect.name}, got none there, "
            f"but {len(images)} images elsewhere that are not read, such as {images[0]}{got}"
        )
    elif matched.is_mostly_unused:
        message = (
            f"Expected the files of the dialect {matched.dialect.name}, by which the folder was recognised, got "
            f"{len(unused)} others that are not read, such as {unused[0]}{got}"
        )
    else:
        return
    binder.report("metadata", "", RefusedError("unused_files", "missing_stream", message), is_lossless=True)


def unrecognised(path: str) -> Layout:
    """Return the layout of a folder that fits no dialect."""
    absent = dict.fromkeys(STREAMS, f"no dialect fits the folder {path}")
    return Layout("unknown", {}, frozenset(), absent, is_recognised=False)


def detect_dialect(file: h5py.File, external_files: ExternalFiles | None = None) -> Dialect:
    """Return the dialect that the file declares, or else the one with most datasets in the file.

    Among equals the hints decide, then the order of ``DIALECT_NAMES``. A file without any of these datasets is read as
    canonical, and all of its streams are reported absent. A dialect of a folder that gives no hint is that of no
    file by itself: its paths are those of many layouts.
    """
    if _declares_fedora(file):
        return load_dialect(FORMAT_NAME)
    dialects = [load_dialect(name) for name in DIALECT_NAMES]
    scores: list[tuple[int, bool]] = []
    for dialect in dialects:
        count, hinted = 0, False
        if dialect.files and not dialect.hints:
            scores.append((count, hinted))
            continue
        for spec in map(spec_of, dict.fromkeys((*DATASETS, *dialect.datasets))):
            place = dialect.place_of(spec.key)
            # Datasets in other files of the folder do not identify the dialect of this file.
            place = place if place is None or place.file == dialect.first_role else None
            dataset = None if place is None else _legible_dataset(file, place.path or spec.key, external_files)
            # Rank only: a dataset of a wrong size still identifies its dialect, and the size is reported later.
            if place is not None and dataset is not None and len(dataset.shape) in place.ranks_of(spec):
                count += 1
        for hint in dialect.hints:
            dataset = _legible_dataset(file, hint.path, external_files)
            if dataset is None or hint.rank not in {None, len(dataset.shape)}:
                continue
            hinted = hint.kind is None or dataset.dtype.kind in _DTYPE_KINDS[hint.kind]
            if hinted:
                break
        scores.append((count, hinted))
    # ``index`` returns the first of equals, so that the order of ``DIALECT_NAMES`` decides last.
    return dialects[scores.index(max(scores))]


def _declares_fedora(file: h5py.File) -> bool:
    """Whether the file declares that it follows the canonical layout."""
    return text_attribute(file, "format") == FORMAT_NAME


def _legible_dataset(file: h5py.File, path: str, external_files: ExternalFiles | None) -> h5py.Dataset | None:
    """Return the dataset at a path if it has a shape and a type that can be read."""
    try:
        dataset = find_dataset(file, path, external_files)
        legible = dataset is not None and dataset.shape is not None and dataset.dtype is not None
    except (RefusedError, *READ_ERRORS):
        return None
    return dataset if legible else None


class _Finder:
    """Finds the datasets stream by stream. All streams must agree on symbolic sizes; the first with a size sets it."""

    def __init__(self, binder: DatasetBinder) -> None:
        self.binder = binder
        self.file = binder.file
        self.dialect = binder.dialect
        self.external_files = binder.external_files
        self.bindings: dict[str, Binding] = {}
        self.absent: dict[str, str] = {}
        self._sizes: dict[str, tuple[int, str]] = {}
        self._searched_groups: set[str] = set()

    def streams(self) -> tuple[str, ...]:
        """Return the streams to look for: of flow the usual rates, or those of the file where it has any other.

        Names of datasets that are no rates, and a second name of a rate, are reported.
        """
        held = {flow_stream_of(key) for key in self.dialect.datasets} - {""}
        if self.dialect.canonical_elsewhere:
            holder = self.binder.holder("path/flow")
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
                self.binder.report("flow", f"path/flow/{rate}", RefusedError("rate_name", "unknown", message))
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
                self.binder.report(first, f"path/{other}", RefusedError("two_names", "unknown", message))
        if len(held) > _MOST_FLOW_RATES:
            message = f"Expected flow of {_MOST_FLOW_RATES} rates at most, got {len(held)}; the lowest are read"
            self.binder.report("flow", "", RefusedError("too_many", "unknown", message))
        return set(in_file_order(held)[:_MOST_FLOW_RATES])

    def find(self, stream: str) -> None:
        """Bind all datasets of a stream, or none, with the reason in ``absent``."""
        specs = datasets_of(stream)
        unplaced = [spec.key for spec in specs if not self.binder.has_place(spec.key)]
        if unplaced:
            self.absent[stream] = f"the dialect {self.dialect.name} has no place for {', '.join(unplaced)}"
            placed = [spec.key for spec in specs if spec.key in self.dialect.datasets]
            # Of a file by itself, the other files of the folder hold the rest.
            if placed and not any(key in self.dialect.datasets for key in unplaced):
                message = (
                    f"Expected a place for {', '.join(unplaced)} beside {placed[0]} in the dialect "
                    f"{self.dialect.name}, got none; add it, or leave {stream} out of the dialect"
                )
                self._note_of_own_dialect(stream, placed[0], message)
            return
        mount = self.binder.supplied.get(T_BODY_IMU)
        if (mount is None or mount.problem) and any(self.binder.place(spec.key).convert == "turned" for spec in specs):
            # What a sensor measures in unknown axes can be compared with nothing.
            self.absent[stream] = f"nobody states {T_BODY_IMU}, by which its axes are those of the body"
            return
        if stream == "pose" and T_POSED_BODY in self.dialect.metadata and T_POSED_BODY not in self.binder.supplied:
            # Poses of a frame that nothing places in the body would be taken for poses of the body.
            self.absent[stream] = (
                f"the file that declares {T_POSED_BODY}, by which poses are those of the body, is missing"
            )
            return
        try:
            datasets = {spec.key: self.binder.dataset(spec) for spec in specs}
            missing = [key for key, dataset in datasets.items() if dataset is None]
            if len(missing) == len(specs):
                path, holder = self.binder.path(specs[0].key), self.binder.holder(specs[0].key)
                where = "file" if isinstance(self.file, h5py.File) else "folder"
                self.absent[stream] = f"there is no {self.binder.words_of(specs[0].key)} in the {where}"
                # A damaged name in the group, reported once a group, may be that of the missing stream.
                group = path.rpartition("/")[0]
                if group not in self._searched_groups and holder is not None:
                    self._searched_groups.add(group)
                    damaged = damaged_name(holder, group, self.external_files)
                    if damaged is not None:
                        message = f"Expected {path}, or names of text in {group or '/'}, got a damaged one: {damaged}"
                        self.binder.report(stream, "", RefusedError("unreadable", "corrupt_chunk", message))
                self._report_similar_name(stream, path)
                words = self.binder.words_of(specs[0].key)
                message = (
                    f"Expected {words} in the {where}, where the dialect {self.dialect.name} has {stream}, got "
                    "nothing there; correct the dialect, or leave the stream out of it"
                )
                self._note_of_own_dialect(stream, specs[0].key, message)
                return
            if missing:
                present = next(key for key, dataset in datasets.items() if dataset is not None)
                expected, beside = self.binder.words_of(missing[0]), self.binder.words_of(present)
                message = f"Expected {expected} beside {beside}, got nothing there"
                if name := self.binder.name_without_number(missing[0]):
                    message = (
                        f"Expected a number of its own at the end of each name of {expected}, which is the timestamp, "
                        f"got {name}; rename the images, or take {missing[0]} from a file"
                    )
                raise BrokenDatasetError(missing[0], RefusedError("missing_stream", "missing_stream", message))
            bound = {spec.key: self.binder.bind(spec, datasets[spec.key]) for spec in specs}
            instants = next((binding.rows for binding in bound.values() if binding.is_of_instants), None)
            # n instants begin n - 1 intervals: what is stored for the last, if anything, has none.
            bound = {
                key: _without_last_row(binding) if binding.is_of_instants or binding.rows == instants else binding
                for key, binding in bound.items()
            }
            self._agree_on_sizes(specs, bound)
            first = bound[specs[0].key]
            if stream in _NEVER_EMPTY and not first.rows:
                message = f"Expected samples in {first.path}, got none; write the stream, or leave its datasets out"
                raise BrokenDatasetError(first.key, RefusedError("empty", "missing_stream", message))
        except BrokenDatasetError as broken:
            self.absent[stream] = str(broken.reason)
            self.binder.report(stream, broken.key, broken.reason)
            return
        self.bindings.update(bound)
        self._report_gaps(stream, bound)
        # A companion is bound by itself: the stream is complete without it.
        for spec in companions_of(stream):
            if not self.binder.has_place(spec.key):
                continue
            try:
                dataset = self.binder.dataset(spec)
                if dataset is None:
                    message = (
                        f"Expected {self.binder.words_of(spec.key)}, where the dialect {self.dialect.name} has "
                        f"{spec.key}, got nothing there; correct the dialect, or leave the dataset out of it"
                    )
                    self._note_of_own_dialect(stream, spec.key, message)
                    continue
                binding = self.binder.bind(spec, dataset)
                bound = {spec.key: _without_last_row(binding) if binding.rows == instants else binding}
                self._agree_on_sizes((spec,), bound)
            except BrokenDatasetError as broken:
                self.binder.report(spec.stream, broken.key, broken.reason)
                continue
            self.bindings.update(bound)

    def _note_of_own_dialect(self, stream: str, key: str, message: str) -> None:
        """Report what a dialect has and a file has not: of one of the package most files lack something."""
        if self.dialect.name not in DIALECT_NAMES and key in self.dialect.datasets:
            reason = RefusedError("missing_stream", "missing_stream", message)
            self.binder.report(stream, "", reason, is_lossless=True)

    def _report_similar_name(self, stream: str, path: str) -> None:
        """Note a name that is nearly that of an absent stream; rates of flow are nearly those of one another."""
        if not self.dialect.canonical_elsewhere or is_flow_stream(stream) or not isinstance(self.file, h5py.File):
            return
        similar = _similar_path(self.file, path, self.external_files)
        if similar is not None:
            message = f"Expected {path}, or no name like it, got {similar}; rename it if it is meant"
            self.binder.report(stream, "", RefusedError("similar_name", "missing_stream", message), is_lossless=True)

    def report_declared_streams(self) -> None:
        """Report streams that metadata, a group or an index map declare and of which the file holds nothing."""
        reported = {problem.stream for problem in self.binder.problems if not problem.is_lossless}
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
                self.binder.report("metadata", "", refused)

    def _has_group(self, path: str) -> bool:
        return isinstance(self.file, h5py.File) and has_group(self.file, path, self.external_files)

    def _report_declared(self, stream: str, place: str) -> None:
        message = f"Expected {stream}, which /{place} declares, got no such stream; write it or drop the declaration"
        self.binder.report(stream, "", RefusedError("missing_stream", "missing_stream", message))

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
        images = self.binder.place(datasets_of(stream)[0].key).file
        if any(spec.is_timestamps and self.binder.place(spec.key).file == images for spec in datasets_of(stream)):
            return
        if gap := self._gap(bound):
            message = f"Expected numbers in equal steps, got a gap: {gap}; every image has a timestamp"
            self.binder.report(stream, "", RefusedError("gap", "unknown", message), is_lossless=True)

    def _agree_on_sizes(self, specs: Iterable[DatasetSpec], bound: Mapping[str, Binding]) -> None:
        """Compare symbolic sizes with those of earlier datasets; keep the new ones only if the whole stream agrees."""
        # A copy: a stream that fails must not fix the sizes of the streams after it.
        sizes = dict(self._sizes)
        for spec in specs:
            stored_shape = self.binder.place(spec.key).stored_shape(spec)
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
                    raise BrokenDatasetError(spec.key, reason)
        self._sizes = sizes


def _without_last_row(binding: Binding) -> Binding:
    rows = max(binding.rows - 1, 0)
    return replace(binding, rows=rows, shape=(rows, *binding.shape[1:]))


def _stream_of(key: str) -> str:
    return spec_of(key).stream


def _similar_path(file: h5py.File, path: str, external_files: ExternalFiles | None = None) -> str | None:
    """Return a path in the file that is nearly a missing one of the layout and that the layout lacks."""
    parts = path.split("/")
    for depth, part in enumerate(parts):
        parent = "/".join(parts[:depth])
        names = names_in(file, parent or "/", external_files)
        if part not in names:
            unknown = sorted(set(names) - _known_names(parent))
            return next((f"{parent}/{name}" for name in get_close_matches(part, unknown, 1, _LEAST_SIMILARITY)), None)
    return None


def _known_names(parent: str) -> set[str]:
    """Return the names that the layout has in a group."""
    beginning = f"{parent}/" if parent else ""
    beside = (spec.key for stream in BESIDE for spec in datasets_of(stream))
    paths = chain(DATASETS, beside, METADATA_GROUPS)
    return {path.removeprefix(beginning).split("/")[0] for path in paths if path.startswith(beginning)}

"""Describe the datasets of a sequence and their paths: the rows of `fedora-qa layout`."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import h5py

from fedora_qa.layout.binding import stored_dataset
from fedora_qa.layout.canonical import spec_of
from fedora_qa.layout.conversions import ConversionName
from fedora_qa.layout.decodable import filters_of
from fedora_qa.layout.dialect import NS_PER_TIME_UNIT, form_of
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.folder import OpenFolder
from fedora_qa.layout.hdf5_objects import text_attribute, walk
from fedora_qa.layout.members import listed
from fedora_qa.layout.resolve import Layout

_CONVERSIONS: Final[Mapping[ConversionName, str]] = {
    "": "",
    "flow16": "flow of 16 bits to px",
    "disparity": "disparity to depth",
    "disparity16": "disparity of 16 bits to depth",
    "matrix4": "part of 4 x 4 transformations",
    "position_quaternion": "position and quaternion of the frame of the poses",
    "chw": "channels first to channels last",
    "until_next": "instants to intervals",
    "turned": "axes of the sensor to those of the body",
    "event_not_before": "names the first event not before, 0 where none is left",
    "event_before": "names the last event before",
    "event_after": "names the first event after",
    "nearest_event": "names the nearest event",
}


@dataclass(frozen=True, slots=True)
class DatasetRow:
    """One dataset as it lies in the file.

    Attributes
    ----------
    key, stream, path
        Canonical key, the stream that it is part of, and where it lies.
    shape, dtype, chunks
        As stored; ``chunks`` is None for contiguous storage.
    codec
        The filters that its bytes pass through, ``none`` where there are none.
    units
        Its label, empty where it has none.
    conversion
        What is done to reach canonical values, empty where nothing is.
    """

    key: str
    stream: str
    path: str
    shape: tuple[int, ...]
    dtype: str
    chunks: tuple[int, ...] | None
    codec: str
    units: str
    conversion: str


@dataclass(frozen=True, slots=True)
class Description:
    """A file's layout, for people.

    Attributes
    ----------
    datasets
        What was found, in the order of the canonical layout.
    absent
        Each stream that is not there or not whole, and why.
    unused
        Datasets of the file, members of its compound types, or files of the folder, for which the dialect has no place.
    unseen
        What the search for them left out, and why; empty where it left out nothing.
    problems
        What is wrong, one sentence each.
    inferred
        What was concluded and not declared, by name.
    """

    dialect: str
    datasets: tuple[DatasetRow, ...]
    absent: tuple[tuple[str, str], ...]
    unused: tuple[str, ...]
    unseen: tuple[str, ...]
    problems: tuple[str, ...]
    inferred: tuple[tuple[str, str | float], ...]


def describe(file: h5py.File | OpenFolder, layout: Layout, external_files: ExternalFiles | None = None) -> Description:
    """Describe the layout that ``resolve`` returned for a file or folder with the same ``external_files``."""
    unused: tuple[str, ...]
    unseen: tuple[str, ...]
    if isinstance(file, OpenFolder):
        unused, unseen = file.matched.unused, ()
    else:
        used, walked = {binding.path for binding in layout.bindings.values()}, walk(file)
        unused, unseen = tuple(path for path in walked.paths if path not in used), walked.unseen
        members: dict[str, set[str]] = defaultdict(set)
        for binding in layout.bindings.values():
            if binding.members and binding.source is None:
                members[binding.path] |= set(binding.members)
        unused += tuple(
            f"{name} of {path}"
            for path, names in members.items()
            for name in file[path].dtype.names
            if name not in names
        )
    rows: list[DatasetRow] = []
    for binding in layout.bindings.values():
        dataset: h5py.Dataset | None = None
        if binding.outside is None:
            holder = file.hdf5[binding.role] if isinstance(file, OpenFolder) else file
            # HDF5 itself would follow a link, and search for its file in more places than those that are allowed.
            dataset = stored_dataset(external_files.holding(holder, binding) if external_files else holder, binding)
        # A registered name may carry a remark behind a semicolon ("bitshuffle; see https://...").
        filters = [] if dataset is None else [name.split(";")[0].strip() for _, name in filters_of(dataset)]
        codec = " + ".join(filters) or "none"
        if binding.outside is not None:
            codec = form_of(binding.path)
        steps: list[str] = []
        if binding.members:
            steps.append(f"{listed(binding.members)} of a compound type".removeprefix("the "))
        if binding.columns is not None:
            steps.append(f"columns {', '.join(map(str, binding.columns))} of the last axis")
        if binding.ns_per_unit is not None and binding.ns_per_unit != NS_PER_TIME_UNIT["us"]:
            unit = next(name for name, ns in NS_PER_TIME_UNIT.items() if ns == binding.ns_per_unit)
            steps.append(f"stamps in {unit}")
        if binding.offset_ns:
            steps.append(f"stamps {binding.offset_ns / NS_PER_TIME_UNIT['us']:+.16g} us")
        if binding.conversion is not None:
            steps.append(_CONVERSIONS[binding.conversion.name])
            steps[-1] += ", inverted" if binding.conversion.invert else ""
            if binding.conversion.invalid is not None:
                steps.append(f"{binding.conversion.invalid:g} is invalid")
        if binding.scale != 1.0:
            steps.append(f"values times {binding.scale:.6g} to {spec_of(binding.key).units}")
        if binding.polarity != "01":
            steps.append("polarity 1, -1 to 1, 0" if binding.polarity == "plus_minus" else "polarity inverted")
        rows.append(
            DatasetRow(
                key=binding.key,
                stream=spec_of(binding.key).stream,
                path=f"{binding.role}: {binding.path}" if binding.role else binding.path,
                shape=binding.shape,
                dtype=str(binding.dtype),
                chunks=binding.stored_chunk or None,
                codec=codec,
                units="" if dataset is None else text_attribute(dataset, "units") or "",
                conversion=", ".join(filter(None, steps)),
            )
        )
    return Description(
        dialect=layout.dialect_name,
        datasets=tuple(rows),
        absent=tuple(layout.absent.items()),
        unused=unused,
        unseen=unseen,
        problems=tuple(problem.message for problem in layout.problems),
        inferred=tuple(layout.inferred.items()),
    )

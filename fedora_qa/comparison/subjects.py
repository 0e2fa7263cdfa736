"""The input of a comparison: files with their statistics, records and distributions (counts in bins).

Distributions are read back from the arrays beside a record. Within a bin values count as evenly spread, so that the
distribution function is a straight line between its edges.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.comparison.types import ComparedFile, Design, Subject
from fedora_qa.evidence.value_counts import octave_edges
from fedora_qa.layout.canonical import flow_rate_hz, is_flow_stream
from fedora_qa.record.evidence import DISTRIBUTIONS, QUANTITIES, named
from fedora_qa.record.types import FileRecord, Scalar

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

_FLOW: Final = "flow_"
_UNITS: Final = {"_per_ms": "events/ms", "_ms": "ms", "_dn": "DN", "_m": "m"}
"""By the ending of a quantity's name, longer endings first; flow is in px over the interval of its rate."""


@dataclass(frozen=True, slots=True)
class SampledCounts:
    """Counts by quantity (b, n) in ``octave_edges`` (n + 1,), and when each block begins, in whole block lengths."""

    block_ns: int
    places: Int64
    counts: Mapping[str, Int64]

    def total(self, quantity: str) -> Int64:
        """Return the counts of all blocks together (n,)."""
        return np.asarray(self.counts[quantity].sum(axis=0))


def sampled_counts_of(arrays: Mapping[str, NDArray[Any]], prefix: str = "") -> SampledCounts | None:
    """Return what the arrays hold under ``prefix``; None where there are no distributions, or no sound ones."""
    blocks = arrays.get(prefix + named(DISTRIBUTIONS, "blocks_ns"))
    if blocks is None or blocks.dtype.kind != "i" or blocks.ndim != 2 or blocks.shape[1] != 2 or not len(blocks):
        return None
    block_ns = int(blocks[0, 1] - blocks[0, 0])
    if block_ns <= 0 or np.any(np.diff(blocks[:, 0]) <= 0):
        return None
    begins = prefix + DISTRIBUTIONS + "/"
    names = dict.fromkeys(name.removeprefix(begins).split("/")[0] for name in arrays if name.startswith(begins))
    placed = {name: _counts_in_all_bins(arrays, named(begins[:-1], name), len(blocks)) for name in names}
    counts = {name: placed[name] for name in sorted(names, key=_order)}
    return SampledCounts(
        block_ns, blocks[:, 0] // block_ns, {name: values for name, values in counts.items() if values is not None}
    )


def paired_blocks(before: SampledCounts, after: SampledCounts, quantity: str) -> tuple[Int64, Int64]:
    """Return the counts (b, n) of both sides in the blocks of time in which both have some."""
    # A block is a power of two times a window: shorter blocks merge into the longer ones.
    block_ns = max(before.block_ns, after.block_ns)
    # The counts of each block that has any, by number.
    sides: list[dict[int, Int64]] = []
    for side in (before, after):
        merged: dict[int, Int64] = {}
        for place, counts in zip(side.places * side.block_ns // block_ns, side.counts[quantity], strict=True):
            if counts.any():
                merged[int(place)] = merged.get(int(place), np.zeros_like(counts)) + counts
        sides.append(merged)
    common = [place for place in sides[0] if place in sides[1]]
    if not common:
        empty = np.empty((0, len(octave_edges()) - 1), np.int64)
        return empty, empty
    stacked = [np.stack([counts_of[number] for number in common]) for counts_of in sides]
    return stacked[0], stacked[1]


def meaning_of(quantity: str) -> str:
    """Return what is counted, with its unit, as a title."""
    rate = quantity.removeprefix(_FLOW).removesuffix("hz")
    return QUANTITIES.get(quantity, f"Pixels by length of flow at {rate} Hz, px over its interval")


def unit_of(quantity: str) -> str:
    """Return the unit of a quantity's values."""
    if quantity.startswith(_FLOW):
        return "px"
    return next((unit for ending, unit in _UNITS.items() if quantity.endswith(ending)), "")


def without_empty_ends(counts: Int64, other: Int64) -> tuple[Int64, Int64, Float64]:
    """Return counts (u, n) and (v, n) without the bins on either end that are empty in both, and their edges."""
    filled_bins = np.flatnonzero(counts.any(axis=0) | other.any(axis=0))
    first, last = int(filled_bins[0]), int(filled_bins[-1]) + 1
    return counts[:, first:last], other[:, first:last], octave_edges()[first : last + 1]


def shares_of(counts: NDArray[Any]) -> Float64:
    """Return counts (..., n) as shares of their sum along the last axis, which must not be 0."""
    return np.asarray(counts / counts.sum(axis=-1, keepdims=True), dtype=np.float64)


def mean_of(shares: Float64, edges: Float64) -> Float64:
    """Return the means (...) of distributions given by shares (..., n) in bins of ``edges`` (n + 1,), in their unit."""
    # Values are spread evenly within a bin, so that the mean of a bin is its middle.
    return np.asarray(shares @ ((edges[1:] + edges[:-1]) / 2))


def wasserstein(first: Float64, other: Float64, edges: Float64) -> Float64:
    """Return the Wasserstein distances of order 1 (...) between shares (..., n), in the unit of ``edges`` (n + 1,).

    It is the area between the two distribution functions (Vallender 1974): how far a value must be moved on average to
    turn one distribution into the other.
    """
    # F - G at the right edge of each bin, a straight line within it; then |F - G| at its left and right edge.
    ahead = np.cumsum(first - other, axis=-1)
    before = np.abs(np.concatenate([np.zeros_like(ahead[..., :1]), ahead[..., :-1]], axis=-1))
    after = np.abs(ahead)
    crossing = np.sign(np.roll(ahead, 1, axis=-1)) * np.sign(ahead) < 0
    # np.roll puts the last bin before the first, where F - G is 0 and cannot change its sign.
    crossing[..., 0] = False
    total = before + after
    # Where F - G changes its sign in a bin of width w, |F - G| is two triangles, (a^2 + b^2) / (a + b) w / 2, and not
    # the trapezium (a + b) w / 2.
    squares = np.divide(before**2 + after**2, total, out=np.zeros_like(total), where=total > 0)
    return np.asarray(np.where(crossing, squares, total) @ np.diff(edges) / 2)


def _counts_in_all_bins(arrays: Mapping[str, NDArray[Any]], name: str, blocks: int) -> Int64 | None:
    """Return counts in all bins; None where an array is missing or is not what it should be."""
    counts, edges, every = arrays.get(f"{name}/counts"), arrays.get(f"{name}/edges"), octave_edges()
    # Arrays beside a record may come from anywhere: type, shape and edges are tested before they are used.
    if counts is None or edges is None or counts.dtype.kind != "i" or counts.ndim != 2 or edges.dtype.kind != "f":
        return None
    first = int(np.searchsorted(every, edges[0])) if edges.shape == (counts.shape[1] + 1,) else len(every)
    if len(counts) != blocks or not np.array_equal(every[first : first + len(edges)], edges) or (counts < 0).any():
        return None
    whole = np.zeros((blocks, len(every) - 1), np.int64)
    whole[:, first : first + counts.shape[1]] = counts
    return whole if whole.any() else None


def _order(quantity: str) -> tuple[int, float, str]:
    """Order quantities: flow by rate, then the others as the record lists them."""
    stream = quantity.replace(_FLOW, "flow/", 1)
    if is_flow_stream(stream):
        return 0, flow_rate_hz(stream), quantity
    quantities = list(QUANTITIES)
    return 1, quantities.index(quantity) if quantity in quantities else len(quantities), quantity


@dataclass(frozen=True, slots=True)
class KeptArrays:
    """Where the evidence of a file lies: in the file ``path``, under names that begin with ``prefix``."""

    path: Path
    prefix: str


@dataclass(frozen=True, slots=True)
class FileInput:
    """One file.

    ``record`` is None where it was not checked, ``sampled`` where its distributions are unknown, ``kept`` where no
    evidence lies beside its record.
    """

    path: str
    statistics: Mapping[str, Mapping[str, Scalar]]
    sampled: SampledCounts | None
    record: FileRecord | None = None
    kept: KeptArrays | None = None


@dataclass(frozen=True, slots=True)
class SubjectInput:
    """The files that one argument names."""

    name: str
    files: tuple[FileInput, ...]

    @property
    def by_name(self) -> Mapping[str, FileInput]:
        """The files by the end of their path, or the whole of it where two have the same end."""
        ends = [PurePath(file.path).name for file in self.files]
        return {end if ends.count(end) == 1 else file.path: file for end, file in zip(ends, self.files, strict=True)}

    @property
    def subject(self) -> Subject:
        """The subject as the document holds it."""
        return Subject(
            self.name,
            tuple(
                ComparedFile(name, file.path, file.statistics, file.record.verdict if file.record else None)
                for name, file in self.by_name.items()
            ),
        )


@dataclass(frozen=True, slots=True)
class Match:
    """One file in two versions."""

    name: str
    before: FileInput
    after: FileInput


def design_of(before: SubjectInput, after: SubjectInput) -> Design:
    """Return what two subjects are to each other: versions where files have the same names, else what they hold."""
    if before.by_name.keys() & after.by_name.keys():
        return "versions"
    return "sequences" if len(before.files) == len(after.files) == 1 else "datasets"


def matches(before: SubjectInput, after: SubjectInput) -> tuple[Match, ...]:
    """Return the files that are in both, by name; two single files are versions of each other whatever their names."""
    if len(before.files) == len(after.files) == 1:
        names = [*before.by_name, *after.by_name]
        return (Match(" → ".join(dict.fromkeys(names)), before.files[0], after.files[0]),)
    others = after.by_name
    return tuple(Match(name, file, others[name]) for name, file in before.by_name.items() if name in others)


@dataclass(frozen=True, slots=True)
class SharedFile:
    """A file that several subjects have, None for those that lack it; in the order of the subjects."""

    name: str
    files: tuple[FileInput | None, ...]


@dataclass(frozen=True, slots=True)
class SharedEvidence:
    """The evidence of a shared file by the names of ``fedora_qa.record.evidence``, for each subject.

    None for a subject that lacks the file, and nothing for one that kept no evidence of it.
    """

    name: str
    arrays: tuple[Mapping[str, NDArray[Any]] | None, ...]


def shared_files(inputs: Sequence[SubjectInput]) -> tuple[SharedFile, ...]:
    """Return the files of the first subject that another has as well; single files are one, whatever their names."""
    if all(len(subject.files) == 1 for subject in inputs):
        name = " · ".join(dict.fromkeys(name for subject in inputs for name in subject.by_name))
        return (SharedFile(name, tuple(subject.files[0] for subject in inputs)),)
    by_name = [subject.by_name for subject in inputs]
    return tuple(
        SharedFile(name, tuple(files.get(name) for files in by_name))
        for name in by_name[0]
        if any(name in files for files in by_name[1:])
    )


def labels(paths: Sequence[str]) -> tuple[str, ...]:
    """Return a short name for each path: its end, with as many folders before it as distinguish it."""
    parts = [PurePath(path).parts or (path,) for path in paths]
    names: list[str] = []
    for part in parts:
        # The fewest parts from the end that no other path ends in.
        lengths = range(1, len(part) + 1)
        length = next((n for n in lengths if sum(other[-n:] == part[-n:] for other in parts) == 1), len(part))
        names.append("/".join(part[-length:]).replace("//", "/"))
    return tuple(names)

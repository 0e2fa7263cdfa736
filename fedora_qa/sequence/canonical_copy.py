"""Write a sequence of any layout, a folder too, as one file of the canonical layout."""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa import __version__
from fedora_qa.conventions import FORMAT_NAME, FORMAT_VERSION
from fedora_qa.errors import MisuseError
from fedora_qa.layout.canonical import MS_TO_EVENT, is_dataset_key, is_flow_stream, spec_of
from fedora_qa.layout.create import create_dataset
from fedora_qa.layout.dialect import (
    DEPTH_RANGE,
    T_BODY_IMU,
    UNKNOWN,
    VERTICAL,
    DialectChoice,
    SideMetadata,
    Supplemented,
    load_dialect,
)
from fedora_qa.sequence.declared import Declared, declared_attributes
from fedora_qa.sequence.sequence import Sequence, file_times_us, open_sequence

_BLOCK_BYTES: Final = 4 << 20
"""Bytes of a dataset that are in memory at once, or one of its chunks where that is larger."""

_LEVEL: Final = 2
"""Of Zstandard: level 5 compresses a frame by a few percent more, in three times the time."""

_BESIDE_THE_LAYOUT: Final = (T_BODY_IMU, VERTICAL)
"""Declarations that checks use, and the canonical layout has no place for."""


@dataclass(frozen=True, slots=True)
class CanonicalCopy:
    """What was written.

    Attributes
    ----------
    rows
        Number of rows by stream.
    left_out
        Datasets that the layout has no place for, by canonical key, with the reason.
    beside
        What has to be declared beside the file, because the layout has no place for it; None where nothing has.
    """

    rows: dict[str, int]
    left_out: dict[str, str]
    beside: SideMetadata | None


@contextmanager
def canonical_file(
    source: Path, choice: DialectChoice, folder: Path | None, report: Callable[[str, int, int], None]
) -> Iterator[tuple[Path, DialectChoice]]:
    """Yield one canonical file of the sequence in a folder, and how it is read; it is removed at the end.

    Parameters
    ----------
    choice
        How it is read.
    folder
        Where the file may lie for a while; None: where the system keeps temporary files.
    report
        As of ``write_canonical``.

    Raises
    ------
    MisuseError, UnreadableRowsError
        As ``open_sequence`` and ``write_canonical``.
    """
    with TemporaryDirectory(prefix=".fedora-qa-", dir=folder) as temporary:
        target = Path(temporary) / f"{source.name}.h5"
        with open_sequence(source, choice) as sequence, h5py.File(target, "w") as file:
            beside = write_canonical(sequence, file, report).beside
        fedora = load_dialect(FORMAT_NAME)
        yield target, Supplemented(fedora, beside) if beside else fedora


def write_canonical(sequence: Sequence, file: h5py.File, report: Callable[[str, int, int], None]) -> CanonicalCopy:
    """Write every whole stream, in canonical units, and all that is declared.

    Values are those that checks read, but for the types of the layout: timestamps are whole microseconds on the clock
    of the sequence, rounded down so that their order stays, and depth is float32. An event sensor that nobody declares
    is declared as unknown.

    Parameters
    ----------
    file
        Open for writing, and empty.
    report
        Receives what is written, the rows so far and their number.

    Raises
    ------
    MisuseError
        The sequence has no stream, or the type of the layout cannot hold a value.
    UnreadableRowsError
        Rows cannot be decoded.
    """
    layout = sequence.layout
    rows: dict[str, int] = {}
    left_out: dict[str, str] = {}
    for key, binding in layout.bindings.items():
        if not is_dataset_key(key) or key == DEPTH_RANGE:
            continue
        if key == MS_TO_EVENT:
            left_out[key] = "it follows from the events"
        elif binding.conversion is not None and key.endswith("_to_event"):
            left_out[key] = f"its entries are defined in another way ({binding.conversion.name})"
        else:
            _write_rows(sequence, file, key, report)
            if spec_of(key).stream in layout.streams:
                rows[spec_of(key).stream] = binding.rows
    if not rows:
        raise MisuseError("Expected at least one whole stream to write, got none; check the sequence first")
    _write_declarations(file, sequence.declared, frozenset(rows))
    supplied = {key: made.value for key in _BESIDE_THE_LAYOUT if (made := layout.supplied.get(key))}
    beside = SideMetadata(", ".join(supplied), supplied) if supplied else None
    return CanonicalCopy(rows, left_out, beside)


def _write_rows(sequence: Sequence, file: h5py.File, key: str, report: Callable[[str, int, int], None]) -> None:
    spec, count = spec_of(key), sequence.layout.bindings[key].rows

    def rows(start: int, stop: int) -> NDArray[Any]:
        return file_times_us(sequence, key, start, stop) if spec.is_timestamps else sequence.rows(key, start, stop)

    row_shape = rows(0, min(count, 1)).shape[1:]
    sizes = dict(zip(map(str, spec.shape), (count, *row_shape), strict=True))
    dataset = create_dataset(file, key, sizes, level=_LEVEL)
    # Whole chunks of the copy, and at least as many rows as are decoded together: none is compressed twice.
    chunk_rows = spec.chunk_rows or 1
    fitting = _BLOCK_BYTES // max(dataset.dtype.itemsize * prod(row_shape), 1)
    together = max(-(-max(fitting, sequence.chunk_rows(key)) // chunk_rows), 1) * chunk_rows
    for start in range(0, count, together):
        report(f"writing {key}", start, count)
        stop = min(start + together, count)
        values = rows(start, stop)
        with np.errstate(all="ignore"):  # what the type cannot hold is compared below
            stored = values.astype(dataset.dtype)
        # Floating-point numbers are rounded to their type.
        if stored.dtype.kind in "iu" and not np.array_equal(stored, values):
            row = start + int(np.flatnonzero(np.any((stored != values).reshape(len(values), -1), axis=1))[0])
            raise MisuseError(f"Expected {key} to fit {stored.dtype}, as the layout has it, got another value at {row}")
        dataset[start:stop] = stored


def _write_declarations(file: h5py.File, declared: Declared, streams: Collection[str]) -> None:
    values = declared_attributes(declared)
    values["", "format"], values["", "format_version"] = FORMAT_NAME, FORMAT_VERSION
    values["", "created_by"] = f"fedora-qa {__version__}"
    if "events" in streams:
        values["metadata/events", "polarity"] = "1=brighter"
        values.setdefault(("metadata/events", "model"), UNKNOWN)
    if any(map(is_flow_stream, streams)):
        values["metadata/flow", "unit"] = "px"
    for (owner, name), value in values.items():
        # Datasets are there already: what is declared of one that is absent has no place.
        if value is not None and np.size(value) and (not owner.startswith("path/") or owner in file):
            holder = file if not owner else file[owner] if owner in file else file.create_group(owner)
            holder.attrs[name] = value
    if declared.depth_range_m is not None:
        create_dataset(file, DEPTH_RANGE, {})[...] = declared.depth_range_m

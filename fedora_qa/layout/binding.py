"""Where one dataset of a file lies, and how its stored values become canonical ones."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any, Final, Literal

import h5py
import hdf5plugin  # noqa: F401  the import registers the Blosc codec with HDF5
import numpy as np
from h5py import h5d, h5p
from numpy.typing import NDArray

from fedora_qa.conventions import POLARITY_BRIGHTER, POLARITY_DARKER
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import spec_of
from fedora_qa.layout.conversions import Conversion, converted, intervals
from fedora_qa.layout.decodable import require_sound_blocks, require_sound_chunk, uses_bitshuffle
from fedora_qa.layout.direct_chunks import StoredChunks
from fedora_qa.layout.hdf5_objects import READ_ERRORS
from fedora_qa.layout.members import array_of_members
from fedora_qa.sources.source import OutsideRows, SourceError

Polarity = Literal["01", "inverted", "plus_minus"]

POLARITY_CODES: Final[Mapping[Polarity, tuple[int, int]]] = {"01": (1, 0), "inverted": (0, 1), "plus_minus": (1, -1)}
"""Stored codes of brighter and of darker events."""

Opened = dict[str, StoredChunks]
"""Datasets of a file that stay open with it, by canonical key: opening a dataset takes longer than reading a few
lines."""

FARTHEST_TIMESTAMP_NS: Final = 2**61
"""Instants saturate at about this distance from the origin (73 years), so that the difference of two fits int64."""

INVALID_TIMESTAMP_NS: Final = -FARTHEST_TIMESTAMP_NS
"""The instant of a timestamp that is NaN: earlier than every real one, so that it never advances a clock."""

INVALID_POLARITY: Final = 255
"""Stands for a stored polarity that the dialect does not define."""

FEWEST_ROWS: Final = 4096
"""Least number of samples or events that are decoded together. A file may store each in a chunk of its own."""

LARGEST_SAMPLE: Final = 1e30
"""Samples beyond it are infinite, as what their type cannot hold is. No unit of the layout gives them a meaning, and
the square of a square of their derivatives must fit float64: ``(1e30 / (1e-9 s)^2)^4 = 1e192``."""

_INT64: Final = np.iinfo(np.int64)


@dataclass(frozen=True, slots=True)
class Binding:
    """One canonical dataset found in a file.

    Attributes
    ----------
    key
        Canonical key.
    path
        Where it lies in this file.
    rows
        Length of the axis of time.
    shape, dtype
        As stored.
    columns
        Which entries of the last axis make the canonical columns, in canonical order; None: all as they are. A
        dataset without that axis counts as having one entry there (a grey image as R, G and B: ``(0, 0, 0)``).
    members
        Of a compound type: names of the members that are read, several as entries of a last axis. ``shape`` and
        ``dtype`` are those of the array that they make. Empty: the type is not compound.
    ns_per_unit
        Nanoseconds in a unit of a timestamp; None for values.
    offset_ns
        What is added to every timestamp.
    scale
        Canonical value = stored value * scale.
    polarity
        Code of polarity.
    chunk_rows
        Number of rows that are decoded together, by ``rows_together``; 0 for contiguous storage.
    stored_chunk
        Shape of one stored chunk; empty for contiguous storage.
    source
        File and path there, where HDF5 reads other files for it; None: it lies in the file itself.
    role
        Role of the HDF5 file that holds it, in a folder.
    outside
        Its rows, where they do not lie in HDF5.
    conversion
        What is done with stored rows before units are applied; None: nothing.
    """

    key: str
    path: str
    rows: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    columns: tuple[int, ...] | None = None
    members: tuple[str, ...] = ()
    ns_per_unit: int | None = None
    offset_ns: int = 0
    scale: float = 1.0
    polarity: Polarity = "01"
    chunk_rows: int = 0
    stored_chunk: tuple[int, ...] = ()
    source: tuple[str, str] | None = None
    role: str = ""
    outside: OutsideRows | None = None
    conversion: Conversion | None = None

    @property
    def chunk_grid(self) -> tuple[int, ...]:
        """How many chunks are stored along each axis; empty for contiguous storage."""
        return tuple(-(-size // chunk) for size, chunk in zip(self.shape, self.stored_chunk, strict=False))

    @property
    def is_stored_canonically(self) -> bool:
        """Whether stored values are canonical values, but for the type and the origin of time."""
        as_it_is = self.columns is None and not self.members and self.conversion is None and self.scale == 1.0
        return as_it_is and self.polarity == "01" and self.ns_per_unit in {None, 1000}

    @property
    def is_of_instants(self) -> bool:
        """Whether intervals are stored as the instants that begin them, which are one more."""
        return self.conversion is not None and self.conversion.name == "until_next"

    @property
    def is_image_as_it_is(self) -> bool:
        """Whether stored values are those of canonical images in every respect, so that nothing is left to convert."""
        spec = spec_of(self.key)
        return spec.is_image and self.is_stored_canonically and self.dtype == np.dtype(spec.dtype)


def rows_together(key: str, stored_rows: int) -> int:
    """Return how many rows to decode together where a chunk holds ``stored_rows``: those of one or more whole chunks.

    They are ``FEWEST_ROWS`` at least, or as many as a chunk of the layout, where these are fewer.
    """
    fewest = min(spec_of(key).chunk_rows, FEWEST_ROWS)
    return stored_rows * -(-fewest // stored_rows) if 0 < stored_rows < fewest else stored_rows


def stored_dataset(file: h5py.File, binding: Binding) -> h5py.Dataset:
    """Open a dataset in the file that holds it, whose other files lie beside it; raises ``READ_ERRORS``."""
    if binding.source is None:
        return file[binding.path]
    access = h5p.create(h5p.DATASET_ACCESS)
    # HDF5 resolves names of external files against the working directory by default. The prefix makes it the folder of
    # the file, where ``ExternalFiles.require_sources`` has checked them.
    access.set_efile_prefix(os.fsencode(Path(file.filename).parent))
    return h5py.Dataset(h5d.open(file.id, binding.source[1].encode("utf-8", "surrogateescape"), access), readonly=True)


def raw_rows(
    file: h5py.File | None, binding: Binding, start: int, stop: int, opened: Opened | None = None
) -> NDArray[Any]:
    """Return rows in stored units and type, columns selected and ordered canonically.

    Parameters
    ----------
    file
        The HDF5 file that holds the dataset; None where its rows lie outside of HDF5.
    opened
        Datasets that stay open, to which this one is added; None: it is closed.

    Raises
    ------
    UnreadableRowsError
        The rows cannot be decoded: damaged bytes, a wrong checksum, or an unknown codec.
    """
    try:
        # An interval ends at the instant that begins the next.
        beyond = int(binding.is_of_instants)
        stored = _stored_rows(file, binding, start, stop + beyond, {} if opened is None else opened)
    except READ_ERRORS as error:
        failing = tuple(_failing_chunks(file, binding, start, stop))
        cause = error.with_traceback(None)  # its frames would hold the rows that were to be read
        has_other_form = isinstance(error, SourceError) and error.rule == "wrong_shape"
        raise UnreadableRowsError(
            binding.key, start, stop, str(error), failing, has_other_form=has_other_form
        ) from cause
    selected = selected_columns(stored, binding)
    return intervals(selected) if binding.is_of_instants else selected


def selected_columns(stored: NDArray[Any], binding: Binding) -> NDArray[Any]:
    """Return stored rows with their members or columns selected and ordered canonically."""
    if binding.members:
        stored = array_of_members(stored, binding.members)
    if binding.columns is None:
        return stored
    spec = spec_of(binding.key)
    if not spec.has_columns or binding.is_of_instants:
        # One column of a table (MVSEC: x, y, t, p), or one channel of images (depth in R, G and B): their axis goes.
        return stored[..., binding.columns[0]]
    if stored.ndim < len(spec.shape):
        # A grey image has no axis of channels; columns (0, 0, 0) then read its one channel as R, G and B.
        stored = stored[..., np.newaxis]
    return stored[..., list(binding.columns)]


def _stored_rows(file: h5py.File | None, binding: Binding, start: int, stop: int, opened: Opened) -> NDArray[Any]:
    """Return rows as they are stored; raises ``READ_ERRORS``."""
    if binding.outside is not None:
        return binding.outside.rows(start, stop)
    if file is None:
        raise ValueError(f"no file is open that holds {binding.path}")
    if binding.key not in opened:
        opened[binding.key] = StoredChunks(stored_dataset(file, binding))
    chunks = opened[binding.key]
    dataset = chunks.dataset
    if chunks.uses_bitshuffle:
        require_sound_blocks(dataset, start, stop)
    if binding.members:
        # HDF5 passes over the other members: memory is taken for those that are read alone.
        return np.asarray(dataset.fields(list(dict.fromkeys(binding.members)))[start:stop])
    if not binding.is_image_as_it_is:
        return np.asarray(dataset[start:stop])
    stored = np.empty((stop - start, *dataset.shape[1:]), dataset.dtype)
    # Direct decoding covers one whole Blosc chunk. HDF5 reads all else, and names the fault of a damaged chunk.
    if not chunks.decode(start, stored):
        dataset.read_direct(stored, np.s_[start:stop])
    return stored


def _failing_chunks(file: h5py.File | None, binding: Binding, start: int, stop: int) -> Iterator[int]:
    """Read the chunks of some rows one by one, and yield the numbers of those that fail, in the order of the file."""
    grid, chunk = binding.chunk_grid, binding.stored_chunk
    if not grid or start >= stop:
        return
    if binding.outside is not None:
        # Images lie in a file each.
        for row in range(start, stop):
            try:
                binding.outside.rows(row, row + 1)
            except READ_ERRORS:
                yield row
        return
    if file is None:
        return
    for position in product(range(start // chunk[0], -(-stop // chunk[0])), *map(range, grid[1:])):
        try:
            # One chunk a read: a read of all of them fails as a whole and does not name the chunk.
            dataset = stored_dataset(file, binding)
            place = tuple(slice(at * size, (at + 1) * size) for at, size in zip(position, chunk, strict=True))
            if uses_bitshuffle(dataset):
                require_sound_chunk(dataset, tuple(axis.start for axis in place))
            dataset[place]
        except READ_ERRORS:
            yield int(np.ravel_multi_index(position, grid))


def canonical_rows(
    file: h5py.File | None,
    binding: Binding,
    start: int,
    stop: int,
    origin_ns: int,
    opened: Opened | None = None,
) -> NDArray[Any]:
    """Return rows in canonical units.

    Timestamps become int64 nanoseconds from ``origin_ns``. Values are scaled, and samples beyond ``LARGEST_SAMPLE``
    become infinite; polarity is 1 brighter, 0 darker, and ``INVALID_POLARITY`` where the stored code is neither.
    Columns, rows and indices that the canonical type cannot hold stay in int64, so that no fault is wrapped into range.

    Raises
    ------
    UnreadableRowsError
        As for ``raw_rows``.
    """
    return canonical_values(raw_rows(file, binding, start, stop, opened), binding, origin_ns)


def canonical_values(raw: NDArray[Any], binding: Binding, origin_ns: int) -> NDArray[Any]:
    """Return raw rows in canonical units, as ``canonical_rows``."""
    if binding.conversion is not None:
        raw = converted(raw, binding.key, binding.conversion)
    if binding.ns_per_unit is not None:
        return timestamps_ns(raw, binding, origin_ns)
    if binding.key == "path/events/p":
        if raw.dtype.kind in "iu" and raw.itemsize == 1:  # a table of 256 codes: four passes over a million take longer
            codes = np.arange(256, dtype=np.uint8).view(raw.dtype)
            return _canonical_polarity(codes, binding.polarity)[raw.view(np.uint8)]
        return _canonical_polarity(raw, binding.polarity)
    canonical = np.dtype(spec_of(binding.key).dtype)
    if canonical.kind in "iu":
        if raw.dtype == canonical:
            return raw
        if raw.dtype.kind == "f":
            farthest = float(FARTHEST_TIMESTAMP_NS)
            # -1 lies outside of all columns, rows and indices, so that NaN counts as out of bounds.
            raw = np.nan_to_num(raw.astype(np.float64), nan=-1.0, posinf=farthest, neginf=-farthest)
            raw = np.rint(np.clip(raw, -farthest, farthest))
        whole, limits = _int64(raw), np.iinfo(canonical)
        # uint16 would wrap column 65536 to 0, where no check of bounds finds it; int64 keeps it out of range.
        fits = not whole.size or (int(whole.min()) >= limits.min and int(whole.max()) <= limits.max)
        return whole.astype(canonical) if fits else whole
    with np.errstate(over="ignore"):  # what the type cannot hold becomes infinite, and is reported as such
        values = raw.astype(canonical, copy=False)
        # The factor takes the canonical type: a float64 factor would widen float32 images.
        values = values if binding.scale == 1.0 else values * canonical.type(binding.scale)
    if not spec_of(binding.key).is_image:
        far = np.abs(values) > LARGEST_SAMPLE  # False for NaN
        values = np.where(far, np.copysign(np.inf, values), values) if np.any(far) else values
    return values


def timestamps_ns(raw: NDArray[Any], binding: Binding, origin_ns: int) -> NDArray[np.int64]:
    """Turn stored timestamps into nanoseconds from an origin.

    The origin is subtracted in the stored unit and type before anything is converted: epoch timestamps lose nothing.
    NaN becomes ``INVALID_TIMESTAMP_NS``; values farther than ``FARTHEST_TIMESTAMP_NS`` from it saturate.
    """
    unit = _ns_per_unit(binding)
    origin = origin_ns - binding.offset_ns
    if raw.dtype.kind == "f":
        # Subtract before the unit is applied: epoch time in ns is 1.7e18, which float64 rounds to 256 ns.
        elapsed = (raw.astype(np.float64, copy=False) - origin / unit) * unit
        farthest = float(FARTHEST_TIMESTAMP_NS)
        elapsed = np.nan_to_num(elapsed, nan=-farthest, posinf=farthest, neginf=-farthest)
        return np.rint(np.clip(elapsed, -farthest, farthest)).astype(np.int64)
    # t_ns = (raw - units) * unit - rest_ns with origin = units * unit + rest_ns: integers only, nothing is rounded.
    units = min(max(origin // unit, _INT64.min), _INT64.max)
    # Less than a unit, unless the origin lies outside of int64.
    rest_ns = min(max(origin - units * unit, -FARTHEST_TIMESTAMP_NS), FARTHEST_TIMESTAMP_NS)
    reach = FARTHEST_TIMESTAMP_NS // unit
    # Clipping before the subtraction keeps the result within 2^62 ns: no damaged timestamp wraps around int64.
    nearby = np.clip(_int64(raw), max(units - reach, _INT64.min), min(units + reach, _INT64.max))
    nearby -= units
    nearby *= unit
    nearby -= rest_ns
    return nearby


def instant_ns(timestamp: float | int, binding: Binding) -> int | None:
    """Return one stored timestamp as nanoseconds on the file's own clock, exactly; None where it is not finite."""
    if not np.isfinite(timestamp):
        return None
    # Fraction holds a float64 exactly; a product in float64 would be rounded to 256 ns at epoch times.
    exact = Fraction(timestamp.item() if isinstance(timestamp, np.generic) else timestamp)
    return round(exact * _ns_per_unit(binding)) + binding.offset_ns


def _ns_per_unit(binding: Binding) -> int:
    if binding.ns_per_unit is None:
        raise ValueError(f"Expected the timestamps of a stream, got {binding.key}; values have no unit of time")
    return binding.ns_per_unit


def _canonical_polarity(raw: NDArray[Any], code: Polarity) -> NDArray[np.uint8]:
    brighter, darker = POLARITY_CODES[code]
    # Codes that the dialect does not define stay recognisable; a default of 0 would count them as darker events.
    p = np.full(raw.shape, INVALID_POLARITY, dtype=np.uint8)
    p[raw == brighter] = POLARITY_BRIGHTER
    p[raw == darker] = POLARITY_DARKER
    return p


def _int64(raw: NDArray[Any]) -> NDArray[np.int64]:
    """Convert whole numbers to int64; unsigned numbers beyond int64 saturate."""
    if raw.dtype == np.uint64:
        # A cast would wrap values of 2^63 and more to negative ones.
        raw = np.minimum(raw, np.uint64(_INT64.max))
    return raw.astype(np.int64, copy=False)

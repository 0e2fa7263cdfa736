"""Planting a fault in a copy of a file, whole or confined to a region of the image."""

import math
from pathlib import Path
from typing import Any, Final

import h5py
import hdf5plugin  # noqa: F401 - its import makes the codec of the layout known to HDF5
import numpy as np
from numpy.typing import NDArray

from fedora_generator.errors import OutputError
from fedora_generator.faults.fault import Fault, FaultError, Region, default_unit
from fedora_generator.faults.index_maps import precedes_index_maps, update_index_maps
from fedora_generator.faults.rows import blocks, streams_in, values_in, window_of
from fedora_generator.faults.table import (
    BYTE_FAULTS,
    FAULTS,
    USUAL_FACTORS,
    allows_direction,
    allows_interval,
    allows_region,
    legal_causes,
    legal_streams,
)
from fedora_generator.partial_file import partial_file
from fedora_qa.causes import stream_family
from fedora_qa.errors import did_you_mean
from fedora_qa.layout.canonical import is_flow_stream

Columns = dict[str, NDArray[Any]]

_CAMERA: Final = "metadata/cameras/events"


def confine_to_region(file: h5py.File, source: Path, fault: Fault, region: Region) -> None:
    """Restore, in the open faulty copy, everything of the fault's stream that lies outside the region.

    Parameters
    ----------
    region
        (x0, y0, x1, y1), half-open, in pixels of the stream's own image.

    Raises
    ------
    FaultError
        The region is empty, or leaves the image.
    """
    with h5py.File(source) as clean:
        for stream in streams_in(file, fault.stream):
            if stream == "events":
                _confine_events(file, clean, region)
                continue
            window = window_of(clean, stream, fault)
            for faulty in values_in(file, stream):
                before = clean[faulty.name]
                left, top, right, bottom = _inside_image(region, width=before.shape[2], height=before.shape[1])
                for block in blocks(faulty, window):
                    images = before[block]
                    images[:, top:bottom, left:right] = faulty[block][:, top:bottom, left:right]
                    faulty[block] = images


def _confine_events(file: h5py.File, clean: h5py.File, region: Region) -> None:
    """Merge the clean events outside the region and the faulty ones inside, in the order of the clean file.

    All events are in memory at once, about 60 bytes each, as a fault may have changed their order.
    """
    if _CAMERA not in clean:
        raise FaultError(f"Expected {_CAMERA}, got none: the size of the sensor is needed")
    sensor = clean[_CAMERA].attrs
    _inside_image(region, width=int(sensor["width"]), height=int(sensor["height"]))
    before, faulty = _columns(clean), _columns(file)
    outside, inside = ~_lie_in(before, region), _lie_in(faulty, region)
    merged = {name: np.concatenate([before[name][outside], faulty[name][inside]]) for name in before}
    # The order of a clean file that is not canonical is that of its recorder: then only time decides.
    is_canonical = np.array_equal(_canonical_order(before), np.arange(len(before["t"])))
    order = _canonical_order(merged) if is_canonical else np.argsort(merged["t"], kind="stable")
    for name, values in merged.items():
        dataset = file[f"path/events/{name}"]
        dataset.resize(len(values), axis=0)
        dataset[...] = values[order]


def _inside_image(region: Region, *, width: int, height: int) -> Region:
    left, top, right, bottom = region
    if not (0 <= left < right <= width and 0 <= top < bottom <= height):
        raise FaultError(
            f"Expected a region x0 < x1, y0 < y1 within the {width}x{height} px image, got "
            f"{left},{top},{right},{bottom}; give it in pixels of the stream's own image"
        )
    return region


def _columns(file: h5py.File) -> Columns:
    return {name: file[f"path/events/{name}"][...] for name in "xytp"}


def _lie_in(events: Columns, region: Region) -> NDArray[np.bool_]:
    left, top, right, bottom = region
    x, y = events["x"], events["y"]
    inside: NDArray[np.bool_] = (x >= left) & (x < right) & (y >= top) & (y < bottom)
    return inside


def _canonical_order(events: Columns) -> NDArray[np.int64]:
    return np.lexsort((events["p"], events["x"], events["y"], events["t"]))


_COPY_BLOCK_BYTES: Final = 1 << 20


def plant_fault(
    source: Path,
    target: Path,
    cause: str,
    stream: str,
    magnitude: float | None = None,
    unit: str | None = None,
    seed: int = 0,
    start_s: float | None = None,
    stop_s: float | None = None,
    *,
    region: Region | None = None,
    direction_deg: float | None = None,
    donor: Path | None = None,
    consistent_maps: bool = True,
) -> Fault:
    """Copy ``source`` to ``target`` with one fault in it.

    Parameters
    ----------
    source, target
        The clean file, which is only read, and the faulty one, replaced in one step when it is complete.
    cause, stream
        As ``legal_causes`` and ``legal_streams`` list them.
    magnitude, unit
        Positive: timestamps too late, values too large. The unit is the cause's own if none is given. Where the
        magnitude is a factor, 1, which is no fault, stands for the usual factor (``USUAL_FACTORS``). A fault without a
        size needs no magnitude.
    seed
        Seed of everything that the fault draws at random.
    start_s, stop_s
        Half-open interval, seconds after the file's first timestamp, to confine the fault to.
    region
        Rectangle (x0, y0, x1, y1), half-open, in pixels of the stream's own image, to confine the fault to: inside, the
        file is as the fault makes it; outside, as it was.
    direction_deg
        Direction of a shift, clockwise from the right, which then need not be by whole pixels (``allows_direction``).
    donor
        The file that ``other_sequence`` takes the stream from.
    consistent_maps
        Compute the index maps again where a recorder would have made them after the fault.

    Raises
    ------
    FaultError
        The fault cannot be planted as requested; nothing is written.
    OutputError
        The target's folder does not exist, or its disk is full.
    """
    if cause not in legal_causes():
        of_stream, _, identifier = cause.rpartition(":")
        if of_stream and identifier in legal_causes():
            raise FaultError(
                f"Expected a cause without its stream, got {cause!r}; use {identifier} --stream {of_stream}"
            )
        # The list of all causes hides the one that is near.
        hint = did_you_mean(identifier, legal_causes())
        remedy = (
            f"{hint} `fedora-generate fault -h` lists all" if hint else f"; choose from {', '.join(legal_causes())}"
        )
        raise FaultError(f"Expected a cause that can be planted, got {cause!r}{remedy}")
    if ("flow" if is_flow_stream(stream) else stream) not in legal_streams(cause):
        streams = ", ".join(legal_streams(cause))
        raise FaultError(
            f"Expected a stream that {cause} can befall, got {stream!r}; choose from {streams}"
            f"{did_you_mean(stream, legal_streams(cause))}"
        )
    if (start_s, stop_s) != (None, None) and not allows_interval(cause, stream):
        raise FaultError(f"Expected no interval for {stream}:{cause}, got one: it befalls the whole stream or none")
    if region is not None and not allows_region(cause, stream):
        raise FaultError(f"Expected no region for {stream}:{cause}, got one: it befalls the whole image or none")
    if direction_deg is not None and not allows_direction(cause, stream):
        raise FaultError(f"Expected no direction for {stream}:{cause}, got one: only shifts of rgb and flow have one")
    unit = default_unit(cause, stream) if unit is None else unit
    fault = Fault(
        cause=cause,
        stream=stream,
        magnitude=_magnitude_of(cause, stream, magnitude, unit),
        unit=unit,
        seed=seed,
        start_s=start_s,
        stop_s=stop_s,
        region=region,
        direction_deg=direction_deg,
        donor=donor,
    )
    if not source.is_file() or not h5py.is_hdf5(source):
        kind = "a folder" if source.is_dir() else "no HDF5 file" if source.exists() else "a path that does not exist"
        raise FaultError(f"Expected an HDF5 file that the generator wrote, got {kind}: {source}")
    if not target.parent.is_dir():
        raise OutputError(f"Expected an existing folder to write into, got {target.parent}; create it first")
    if target.exists() and target.samefile(source):
        raise FaultError(
            f"Expected a target other than the source, got {target} twice; faults are never planted in place"
        )
    try:
        with source.open("rb") as clean, partial_file(target, overwrite=True) as copy:
            while copy.write(clean.read(_COPY_BLOCK_BYTES)):
                copy.raise_pending()
            key = (cause, stream_family(stream))
            if key in BYTE_FAULTS:
                BYTE_FAULTS[key](copy.path, fault)
                return fault
            with h5py.File(copy, "r+") as file:
                if stream != "metadata":
                    streams_in(file, stream)  # raises where there is none
                FAULTS[key](file, fault)
                if region is not None:
                    confine_to_region(file, source, fault, region)
                if consistent_maps and precedes_index_maps(fault):
                    update_index_maps(file)
    except OutputError:
        raise
    except (KeyError, OSError) as error:
        raise FaultError(f"Expected a readable file of the canonical layout, got {source}: {error}") from error
    return fault


def _magnitude_of(cause: str, stream: str, magnitude: float | None, unit: str) -> float:
    usual = USUAL_FACTORS.get((cause, stream_family(stream)))
    if usual is not None and magnitude in (None, 1):
        return usual
    if magnitude is None and unit not in ("", "1"):
        raise FaultError(f"Expected a magnitude for {cause}, in {unit} unless a unit is given; use --magnitude")
    magnitude = 1.0 if magnitude is None else magnitude
    if not math.isfinite(magnitude) or (magnitude == 0 and unit):
        raise FaultError(f"Expected a finite magnitude other than 0 for {cause}, got {magnitude:g}")
    return magnitude

"""A fault confined to a part of the image: inside, the file is as the fault makes it; outside, as it was."""

from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault, FaultError, Region
from fedora_generator.faults.rows import blocks, streams_in, values_in, window_of

Columns = dict[str, NDArray[Any]]

_CAMERA: Final = "metadata/cameras/events"


def confine_to_region(file: h5py.File, source: Path, fault: Fault, region: Region) -> None:
    """Restore, in the open faulty copy, everything of the fault's stream that lies outside the region.

    Parameters
    ----------
    file
        The open faulty copy.
    source
        The clean file.
    fault
        Its stream and interval.
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

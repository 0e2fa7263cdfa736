"""Snapshots as arrays: those along the sequence, or that of a location."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.evidence.pictures import block_px, summed_counts
from fedora_qa.evidence.snapshot import Snapshot
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.record.evidence import named
from fedora_qa.sequence.facts import Facts

Entries = Mapping[str, tuple[NDArray[Any], str]]

_ON_CLOCK: Final = "us on the file's clock"


def keep_snapshots(group: str, snapshots: Sequence[Snapshot], facts: Facts, width_px: int) -> TitledArrays:
    """Return snapshots as arrays whose first axis is the snapshot; a missing picture is NaN, or 0 for codes and counts.

    Parameters
    ----------
    group
        Prefix of the names.
    snapshots
        In the order of time.
    facts
        Convert times to the clock of the file.
    width_px
        Largest width of pictures, px.

    Returns
    -------
    TitledArrays
        Empty where no snapshot has a picture.
    """
    entries = _entries(snapshots, facts, width_px) if any(snapshot.pictures for snapshot in snapshots) else {}
    return TitledArrays.titled({named(group, name): entry for name, entry in entries.items()})


def keep_snapshot(group: str, snapshot: Snapshot, facts: Facts, width_px: int) -> TitledArrays:
    """Return one snapshot as arrays without an axis of snapshots.

    Parameters
    ----------
    group
        Prefix of the names.
    snapshot
        With one picture at least.
    facts
        Convert times to the clock of the file.
    width_px
        Largest width of pictures, px.
    """
    entries = _entries([snapshot], facts, width_px)
    return TitledArrays.titled({named(group, name): (array[0], title) for name, (array, title) in entries.items()})


def _entries(snapshots: Sequence[Snapshot], facts: Facts, width_px: int) -> Entries:
    times_us = np.array([facts.to_file_us(snapshot.time_ns) for snapshot in snapshots])
    entries: dict[str, tuple[NDArray[Any], str]] = {"times_us": (times_us, f"Instants, {_ON_CLOCK}")}
    for family in ("rgb", "depth", "flow", "residual", "events"):
        pictures = [snapshot.pictures.get(family) for snapshot in snapshots]
        present = [picture for picture in pictures if picture is not None]
        if not present:
            continue
        # Start and end of the interval of each picture (n, 2), on the file's clock; NaN where there is none.
        bounds_ns = [
            (np.nan, np.nan) if picture is None else (picture.start_ns, picture.stop_ns) for picture in pictures
        ]
        intervals_us = facts.origin_us + np.array(bounds_ns, dtype=np.float64) / NS_PER_US
        # Smaller pictures lie in the upper left corner of the largest.
        shape = tuple(max(sizes) for sizes in zip(*(picture.image.shape for picture in present), strict=True))
        missing = 0 if family in ("rgb", "events") else np.nan
        stack = np.full((len(pictures), *shape), missing, present[0].image.dtype)
        for layer, picture in zip(stack, pictures, strict=True):
            if picture is not None:
                layer[tuple(slice(size) for size in picture.image.shape)] = picture.image
        # The coarsest averaging of these pictures.
        block = max(picture.block for picture in present)
        averaged = f", averaged over {block}x{block} pixels" if block > 1 else ""
        match family:
            case "rgb":
                entries["rgb"] = stack, f"Colour frame, DN as stored{averaged}"
                entries["rgb_times_us"] = intervals_us[:, 0], f"Instants of the colour frames, {_ON_CLOCK}"
            case "depth":
                entries["depth_m"] = stack, f"Depth along the optical axis, m{averaged}"
                entries["depth_times_us"] = intervals_us[:, 0], f"Instants of the depth frames, {_ON_CLOCK}"
            case "flow":
                streams = ", ".join(sorted({picture.stream for picture in present}))
                title = f"Flow ({streams}; u right, v down), px of the stored image over its interval{averaged}"
                entries["flow_px"] = stack, title
                entries["flow_interval_us"] = intervals_us, f"Start and end of the flow's interval, {_ON_CLOCK}"
            case "residual":
                title = (
                    "What the flow leaves: the frame at its end, carried back by it, minus the frame at its start, "
                    f"luma in DN{averaged}"
                )
                entries["residual_dn"] = stack, title
            case "events":
                if block == 1:  # the size of an undeclared sensor follows from all events, (n, 2, h, w)
                    block = block_px(stack.shape[3], width_px)
                    stack = summed_counts(stack, block)
                of_pixel = f"{block}x{block} pixels" if block > 1 else "a pixel"
                counted_ms = (present[0].stop_ns - present[0].start_ns) / NS_PER_MS
                within = f"number in {of_pixel} of the sensor within {counted_ms:g} ms"
                entries["brighter"] = stack[:, 1], f"Events that tell of brightening, {within}"
                entries["darker"] = stack[:, 0], f"Events that tell of darkening, {within}"
                title = f"Start and end of the time in which events were counted, {_ON_CLOCK}"
                entries["events_interval_us"] = intervals_us, title
    return entries

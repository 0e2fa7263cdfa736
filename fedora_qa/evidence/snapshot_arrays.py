"""Snapshots as arrays: those along the sequence, or that of a location."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.evidence.pictures import block_px, summed_counts
from fedora_qa.evidence.snapshot import EVENTS_NS, Picture, Snapshot
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.record.evidence import named
from fedora_qa.sequence.facts import Facts

Entries = Mapping[str, tuple[NDArray[Any], str]]
Pictures = Sequence[Picture | None]

_EVENTS_MS: Final = EVENTS_NS / 1e6
_ON_CLOCK: Final = "us on the file's clock"


def keep_snapshots(group: str, snapshots: Sequence[Snapshot], facts: Facts, width_px: int) -> TitledArrays:
    """Return the snapshots as arrays whose first axis is the snapshot; a picture that one lacks is NaN, or 0.

    Nothing where none of them has any picture.
    """
    entries = _entries(snapshots, facts, width_px) if any(snapshot.pictures for snapshot in snapshots) else {}
    return TitledArrays.titled({named(group, name): entry for name, entry in entries.items()})


def keep_snapshot(group: str, snapshot: Snapshot, facts: Facts, width_px: int) -> TitledArrays:
    """Return one snapshot as arrays without an axis of snapshots."""
    entries = _entries([snapshot], facts, width_px)
    return TitledArrays.titled({named(group, name): (array[0], title) for name, (array, title) in entries.items()})


def _entries(snapshots: Sequence[Snapshot], facts: Facts, width_px: int) -> Entries:
    times_us = np.array([facts.to_file_us(snapshot.time_ns) for snapshot in snapshots])
    entries: dict[str, tuple[NDArray[Any], str]] = {"times_us": (times_us, f"Instants, {_ON_CLOCK}")}
    families = (("rgb", _rgb), ("depth", _depth), ("flow", _flow), ("residual", _residual), ("events", _events))
    for family, arrays_of in families:
        pictures = [snapshot.pictures.get(family) for snapshot in snapshots]
        if any(picture is not None for picture in pictures):
            entries.update(arrays_of(pictures, facts, width_px))
    return entries


def _rgb(pictures: Pictures, facts: Facts, width_px: int) -> Entries:
    return {
        "rgb": (_stacked(pictures, 0), f"Colour frame, DN as stored{_averaged(pictures)}"),
        "rgb_times_us": (_intervals_us(pictures, facts)[:, 0], f"Instants of the colour frames, {_ON_CLOCK}"),
    }


def _depth(pictures: Pictures, facts: Facts, width_px: int) -> Entries:
    return {
        "depth_m": (_stacked(pictures, np.nan), f"Depth along the optical axis, m{_averaged(pictures)}"),
        "depth_times_us": (_intervals_us(pictures, facts)[:, 0], f"Instants of the depth frames, {_ON_CLOCK}"),
    }


def _flow(pictures: Pictures, facts: Facts, width_px: int) -> Entries:
    streams = sorted({picture.stream for picture in _present(pictures)})
    title = f"Flow ({', '.join(streams)}; u right, v down), px of the stored image over its interval"
    return {
        "flow_px": (_stacked(pictures, np.nan), title + _averaged(pictures)),
        "flow_interval_us": (_intervals_us(pictures, facts), f"Start and end of the flow's interval, {_ON_CLOCK}"),
    }


def _residual(pictures: Pictures, facts: Facts, width_px: int) -> Entries:
    title = "What the flow leaves: the frame at its end, carried back by it, minus the frame at its start, luma in DN"
    return {"residual_dn": (_stacked(pictures, np.nan), title + _averaged(pictures))}


def _events(pictures: Pictures, facts: Facts, width_px: int) -> Entries:
    counts, block = _stacked(pictures, 0), max(picture.block for picture in _present(pictures))  # (n, 2, h, w)
    if block == 1:  # the size of an undeclared sensor follows from all events
        block = block_px(counts.shape[3], width_px)
        counts = summed_counts(counts, block)
    of_pixel = f"{block}x{block} pixels" if block > 1 else "a pixel"
    entries = {
        name: (
            counts[:, polarity],
            f"Events that tell of {change}, number in {of_pixel} of the sensor within {_EVENTS_MS:g} ms",
        )
        for polarity, name, change in ((1, "brighter", "brightening"), (0, "darker", "darkening"))
    }
    interval = (_intervals_us(pictures, facts), f"Start and end of the time in which events were counted, {_ON_CLOCK}")
    return {**entries, "events_interval_us": interval}


def _present(pictures: Pictures) -> Iterable[Picture]:
    return (picture for picture in pictures if picture is not None)


def _stacked(pictures: Pictures, missing: float) -> NDArray[Any]:
    """Stack pictures, smaller ones in the upper left corner of the largest; what is missing has the given value."""
    images = [picture.image for picture in _present(pictures)]
    shape = tuple(max(sizes) for sizes in zip(*(image.shape for image in images), strict=True))
    stack = np.full((len(pictures), *shape), missing, images[0].dtype)
    for layer, picture in zip(stack, pictures, strict=True):
        if picture is not None:
            layer[tuple(slice(size) for size in picture.image.shape)] = picture.image
    return stack


def _intervals_us(pictures: Pictures, facts: Facts) -> NDArray[np.float64]:
    """Return start and end of what each picture shows (n, 2), on the file's clock; NaN where there is none."""
    bounds = [(p.start_ns, p.stop_ns) if p is not None else (np.nan, np.nan) for p in pictures]
    return facts.origin_us + np.array(bounds, dtype=np.float64) / NS_PER_US


def _averaged(pictures: Pictures) -> str:
    block = max(picture.block for picture in _present(pictures))
    return f", averaged over {block}x{block} pixels" if block > 1 else ""

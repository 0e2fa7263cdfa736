"""What the streams show where findings are worst: images that are decoded once more, bounded, after judgement."""

from collections.abc import Iterable, Sequence

import numpy as np

from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.pictures import block_px, picture_shape
from fedora_qa.evidence.snapshot import Picture, Snapshot, take_snapshot
from fedora_qa.evidence.snapshot_arrays import keep_snapshot
from fedora_qa.evidence.snapshot_times import fitting_width_px
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.evidence.worst_locations import WHOLE, Box, WorstLocation, box_of, location_beside, worst_locations
from fedora_qa.record.evidence import BESIDE, PLACES, named
from fedora_qa.record.types import Finding, Where
from fedora_qa.record.wording import place as text_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import RowSource, Sampling, Span, Window


def keep_worst_locations(
    findings: Iterable[Finding],
    spans: Sequence[Span],
    facts: Facts,
    source: RowSource,
    options: EvidenceOptions,
    images: int,
) -> TitledArrays:
    """Draw pictures of all streams at the locations of the gravest findings.

    Parameters
    ----------
    spans
        All windows of the file.
    images
        How many images may be decoded for it; one location needs one of each stream of images, and the frame at the end
        of the flow. What the locations leave of it is spent on the frames before and after them, the gravest first.

    Returns
    -------
    TitledArrays
        Pictures and boxes by the id of the finding.
    """
    streams = sum(name in facts.clocks for name in ("rgb", "depth")) + bool(facts.flow_streams)
    # The residual also needs the frame at the end of the field's interval.
    streams += bool(facts.flow_streams) and "rgb" in facts.clocks
    most = min(options.worst_locations, images // max(streams, 1))
    width_px = fitting_width_px(facts, options, options.worst_locations + options.beside * len(BESIDE))
    locations = worst_locations(findings, spans, facts, most)
    beside = min(options.beside, (images // max(streams, 1) - len(locations)) // len(BESIDE))
    return merged(
        [
            *(_arrays_at(location, facts, source, width_px) for location in locations),
            *(
                _arrays_beside(location, name, step, spans, facts, source, width_px)
                for location in locations[: max(beside, 0)]
                for name, step in BESIDE.items()
            ),
        ]
    )


def images_of(spans: Iterable[Span]) -> int:
    """Return how many images these windows own."""
    owned = [(stream, stop - start) for span in spans for stream, (start, stop) in span.owned.items()]
    return sum(count for stream, count in owned if stream in {"rgb", "depth"} or stream.startswith("flow/"))


def _arrays_at(location: WorstLocation, facts: Facts, source: RowSource, width_px: int) -> TitledArrays:
    window = Window(location.span, facts, source, Sampling())
    snapshot = take_snapshot(window, location.time_ns, width_px, location.rows)
    if not snapshot.pictures:
        return TitledArrays()
    finding = location.finding
    group = named(PLACES, finding.id)
    box = np.array(_box(finding.where, snapshot, width_px))
    title = f"{finding.id}, {text_of(finding.where)}: left, top, right and bottom of its box as shares of a picture"
    titled_box = TitledArrays.titled({named(group, "box"): (box, title)})
    return merged([keep_snapshot(group, snapshot, facts, width_px), titled_box])


def _arrays_beside(
    location: WorstLocation, name: str, step: int, spans: Sequence[Span], facts: Facts, source: RowSource, width_px: int
) -> TitledArrays:
    """Return what the streams show so many frames from a location; nothing where there is no such frame."""
    beside = location_beside(location, step, spans, facts)
    if beside is None:
        return TitledArrays()
    snapshot = take_snapshot(Window(beside.span, facts, source, Sampling()), beside.time_ns, width_px, beside.rows)
    group = named(PLACES, location.finding.id, name)
    return keep_snapshot(group, snapshot, facts, width_px) if snapshot.pictures else TitledArrays()


def _box(where: Where, snapshot: Snapshot, width_px: int) -> Box:
    """Return the box in the picture of the stream named; where that shows nothing, in that of depth or colour."""
    family = (where.stream or "").split("/")[0]
    picture = snapshot.pictures.get(family) or snapshot.pictures.get("depth") or snapshot.pictures.get("rgb")
    return box_of(where, *_stored_shape(picture, width_px)) if picture else WHOLE


def _stored_shape(picture: Picture, width_px: int) -> tuple[int, int]:
    """Return how many rows and columns of the stored image the picture stands for."""
    if picture.stream != "events":
        return picture.image.shape[0] * picture.block, picture.image.shape[1] * picture.block
    height, width = picture.image.shape[1:]
    if picture.block > 1:
        return height * picture.block, width * picture.block
    block = block_px(width, width_px)
    rows, columns = picture_shape(height, width, block)
    return rows * block, columns * block

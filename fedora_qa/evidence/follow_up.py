"""One bounded extra look, after judgement, at the places where findings are worst."""

from collections.abc import Iterable, Sequence

import numpy as np

from fedora_qa.evidence.glimpse import Glimpse, Picture, glimpse
from fedora_qa.evidence.instants import fitting_width_px
from fedora_qa.evidence.kept import Kept, together
from fedora_qa.evidence.moments import keep_glimpse
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.pictures import block_px, picture_shape
from fedora_qa.evidence.places import WHOLE, Box, Place, box_of, place_beside, worst_places
from fedora_qa.record.evidence import BESIDE, PLACES, named
from fedora_qa.record.types import Finding, Where
from fedora_qa.record.wording import place as words_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import RowSource, Sampling, Span, Window


def keep_places(
    findings: Iterable[Finding],
    spans: Sequence[Span],
    facts: Facts,
    source: RowSource,
    options: EvidenceOptions,
    images: int,
) -> Kept:
    """Draw what the streams show at the places of the gravest findings.

    Parameters
    ----------
    spans
        All windows of the file.
    images
        How many images may be decoded for it; one place needs one of each stream of images, and the frame at the end
        of the flow. What the places leave of it is spent on the frames before and after them, the gravest first.
    """
    streams = sum(name in facts.clocks for name in ("rgb", "depth")) + bool(facts.flow_streams)
    streams += bool(facts.flow_streams) and "rgb" in facts.clocks
    most = min(options.places, images // max(streams, 1))
    width_px = fitting_width_px(facts, options, options.places + options.beside * len(BESIDE))
    places = worst_places(findings, spans, facts, most)
    beside = min(options.beside, (images // max(streams, 1) - len(places)) // len(BESIDE))
    return together(
        [
            *(_kept(place, facts, source, width_px) for place in places),
            *(
                _kept_beside(place, name, step, spans, facts, source, width_px)
                for place in places[: max(beside, 0)]
                for name, step in BESIDE.items()
            ),
        ]
    )


def images_of(spans: Iterable[Span]) -> int:
    """Return how many images these windows own."""
    owned = (bounds for span in spans for stream, bounds in span.owned.items() if _is_images(stream))
    return sum(stop - start for start, stop in owned)


def _is_images(stream: str) -> bool:
    return stream in {"rgb", "depth"} or stream.startswith("flow/")


def _kept(place: Place, facts: Facts, source: RowSource, width_px: int) -> Kept:
    window = Window(place.span, facts, source, Sampling())
    seen = glimpse(window, place.time_ns, width_px, place.rows)
    if not seen.pictures:
        return Kept()
    finding = place.finding
    group = named(PLACES, finding.id)
    box = np.array(_box(finding.where, seen, width_px))
    title = f"{finding.id}, {words_of(finding.where)}: left, top, right and bottom of its box as shares of a picture"
    return together([keep_glimpse(group, seen, facts, width_px), Kept.titled({named(group, "box"): (box, title)})])


def _kept_beside(
    place: Place, name: str, step: int, spans: Sequence[Span], facts: Facts, source: RowSource, width_px: int
) -> Kept:
    """Return what the streams show so many frames from a place; nothing where there is no such frame."""
    beside = place_beside(place, step, spans, facts)
    if beside is None:
        return Kept()
    seen = glimpse(Window(beside.span, facts, source, Sampling()), beside.time_ns, width_px, beside.rows)
    group = named(PLACES, place.finding.id, name)
    return keep_glimpse(group, seen, facts, width_px) if seen.pictures else Kept()


def _box(where: Where, seen: Glimpse, width_px: int) -> Box:
    """Return the box in the picture of the stream named; where that shows nothing, in the one that it is like."""
    family = (where.stream or "").split("/")[0]
    picture = seen.pictures.get(family) or seen.pictures.get("depth") or seen.pictures.get("rgb")
    return box_of(where, *_shown_shape(picture, width_px)) if picture else WHOLE


def _shown_shape(picture: Picture, width_px: int) -> tuple[int, int]:
    """Return how many rows and columns of the stored image the picture stands for."""
    if picture.stream != "events":
        return picture.image.shape[0] * picture.block, picture.image.shape[1] * picture.block
    height, width = picture.image.shape[1:]
    if picture.block > 1:
        return height * picture.block, width * picture.block
    block = block_px(width, width_px)
    rows, columns = picture_shape(height, width, block)
    return rows * block, columns * block

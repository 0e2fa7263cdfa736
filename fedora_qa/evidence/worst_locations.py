"""Pictures of the streams where findings are worst: a window, an instant, images, and a box in the picture.

The images are decoded once more after judgement, up to a limit. A box is cut out of pictures that were not averaged,
because small displacements are visible only there.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.pictures import block_px, picture_shape
from fedora_qa.evidence.snapshot import (
    Picture,
    Snapshot,
    fitting_width_px,
    keep_snapshot,
    snapshot_times_ns,
    take_snapshot,
)
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.record.evidence import BESIDE, PLACES, named
from fedora_qa.record.types import Finding, Severity, Where
from fedora_qa.record.wording import place as text_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import RowSource, Sampling, Span, Window

Box = tuple[float, float, float, float]

WHOLE: Final[Box] = (0.0, 0.0, 1.0, 1.0)

_SEVERITY_RANK: Final[Mapping[Severity, int]] = {"critical": 0, "error": 1, "warning": 2, "info": 3}
_FRAMES: Final = ("rgb", "depth")


@dataclass(frozen=True, slots=True)
class WorstLocation:
    """The window, instant and images of a finding.

    Attributes
    ----------
    finding
        The finding.
    span
        The window.
    time_ns
        The instant, ns from the file's origin.
    rows
        Row of the image by stream, where the finding names it.
    """

    finding: Finding
    span: Span
    time_ns: int
    rows: Mapping[str, int] = field(default_factory=dict)


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
    source
        Decodes rows of the file.
    options
        Number of locations, and size of the pictures.
    images
        Largest number of images that may be decoded. One location needs one image of each stream, and the frame at the
        end of the flow. The rest is used for the frames before and after the locations, the gravest first.
    """
    streams = sum(name in facts.clocks for name in ("rgb", "depth")) + bool(facts.flow_streams)
    # The residual also needs the frame at the end of the field's interval.
    streams += bool(facts.flow_streams) and "rgb" in facts.clocks
    most = min(options.worst_locations, images // max(streams, 1))
    width_px = fitting_width_px(facts, options, options.worst_locations + options.beside * len(BESIDE))
    locations = worst_locations(findings, spans, facts, most)
    beside = min(options.beside, (images // max(streams, 1) - len(locations)) // len(BESIDE))
    parts: list[TitledArrays] = []
    for location in locations:
        window = Window(location.span, facts, source, Sampling())
        snapshot = take_snapshot(window, location.time_ns, width_px, location.rows)
        if not snapshot.pictures:
            continue
        where, group = location.finding.where, named(PLACES, location.finding.id)
        # The box lies in the picture of the named stream; where that stream has no picture, in that of depth or colour.
        family = (where.stream or "").split("/")[0]
        picture = snapshot.pictures.get(family) or snapshot.pictures.get("depth") or snapshot.pictures.get("rgb")
        box = WHOLE
        if picture:
            # Rows and columns of the stored image that the picture stands for.
            of_events, block = picture.stream == "events", picture.block
            height, width = picture.image.shape[1:] if of_events else picture.image.shape[:2]
            if of_events and block <= 1:  # not yet averaged, as the size of the sensor is not declared
                block = block_px(width, width_px)
                height, width = picture_shape(height, width, block)
            box = box_of(where, height * block, width * block)
        title = (
            f"{location.finding.id}, {text_of(where)}: left, top, right and bottom of its box as shares of a picture"
        )
        parts.append(keep_snapshot(group, snapshot, facts, width_px))
        parts.append(TitledArrays.titled({named(group, "box"): (np.array(box), title)}))
    for location in locations[: max(beside, 0)]:
        for name, step in BESIDE.items():
            neighbour = _location_beside(location, step, spans, facts)
            if neighbour is None:
                continue
            window = Window(neighbour.span, facts, source, Sampling())
            snapshot = take_snapshot(window, neighbour.time_ns, width_px, neighbour.rows)
            if snapshot.pictures:
                group = named(PLACES, location.finding.id, name)
                parts.append(keep_snapshot(group, snapshot, facts, width_px))
    return merged(parts)


def images_of(spans: Iterable[Span]) -> int:
    """Return how many images these windows own."""
    owned = [(stream, stop - start) for span in spans for stream, (start, stop) in span.owned.items()]
    return sum(count for stream, count in owned if stream in {"rgb", "depth"} or stream.startswith("flow/"))


def worst_locations(
    findings: Iterable[Finding], spans: Sequence[Span], facts: Facts, most: int
) -> tuple[WorstLocation, ...]:
    """Return the locations of the gravest findings that have one, each location once; the gravest first.

    Parameters
    ----------
    most
        Largest number of locations.
    """
    locations: dict[object, WorstLocation] = {}
    for finding in sorted(findings, key=lambda finding: _SEVERITY_RANK[finding.severity]):
        location = location_of(finding, spans, facts)
        if location is not None:
            where = finding.where
            locations.setdefault((location.time_ns, where.pixel, where.tile), location)
    return tuple(locations.values())[:most]


def location_of(finding: Finding, spans: Sequence[Span], facts: Facts) -> WorstLocation | None:
    """Return the location of a finding; None where the finding concerns the whole file, or lies in no window."""
    where = finding.where
    # The frame that the finding names, of its stream or else of colour.
    rows: dict[str, int] = {}
    own = where.stream if where.stream in _FRAMES else None
    frames = own or next((name for name in _FRAMES if name in facts.clocks), None)
    frame = where.frame if where.frame is not None or own is None else where.index_start
    if frames is not None and frames in facts.clocks and frame is not None and _has_row(facts, frames, frame):
        rows[frames] = frame
    time_ns = _instant_ns(where, rows, facts)
    if time_ns is None and not rows and where.index_start is None:
        # A pixel without a time is taken in the middle of the file.
        middles_ns = snapshot_times_ns(spans, facts, 1) if where.pixel or where.tile else {}
        for span in spans:
            if span.index in middles_ns:
                return WorstLocation(finding, span, middles_ns[span.index][0])
        return None
    # The field of flow is the one nearest to the instant, of those that the finding names.
    if where.stream in facts.flow_streams and where.index_start is not None:
        first = max(where.index_start, 0)
        stop = where.index_start + 1 if where.index_stop is None else where.index_stop
        starts_ns = facts.clocks[where.stream].times_ns[first : max(stop, 0)]
        if time_ns is not None and len(starts_ns):
            # In floating point, as a finding may name a time that is beyond 64-bit nanoseconds.
            rows[where.stream] = first + int(np.argmin(np.abs(starts_ns - float(time_ns))))
    first_row = {where.stream: where.index_start} if where.stream and where.index_start is not None else {}
    nearest = _owner({**first_row, **rows}, spans) or nearest_span(time_ns, spans)
    if nearest is None:
        return None
    owned = {stream: row for stream, row in rows.items() if row in range(*nearest.owned.get(stream, (0, 0)))}
    return WorstLocation(
        finding, nearest, (nearest.start_ns + nearest.stop_ns) // 2 if time_ns is None else time_ns, owned
    )


def _location_beside(location: WorstLocation, step: int, spans: Sequence[Span], facts: Facts) -> WorstLocation | None:
    """Return the location a number of frames later or earlier; None where there is no such frame or timestamp.

    If the finding names a field of flow, the field nearest to that frame is taken.
    """
    stream = next((name for name in _FRAMES if name in facts.clocks and facts.clocks[name].usable), None)
    if stream is None:
        return None
    times_ns = facts.clocks[stream].times_ns
    row = location.rows.get(stream, int(np.argmin(np.abs(times_ns - location.time_ns)))) + step
    if not _has_row(facts, stream, row):
        return None
    time_ns = int(times_ns[row])
    rows = {stream: row}
    for name in location.rows:
        if name in facts.flow_streams and facts.clocks[name].usable:
            rows[name] = int(np.argmin(np.abs(facts.clocks[name].times_ns - time_ns)))
    span = _owner({stream: row}, spans) or nearest_span(time_ns, spans)
    return None if span is None else WorstLocation(location.finding, span, time_ns, rows)


def box_of(where: Where, height: int, width: int) -> Box:
    """Return a finding's tile or pixel as shares of an image of the named stream.

    The cameras of a file have one field of view, so the shares hold for the pictures of all streams.

    Parameters
    ----------
    where
        With a tile or a pixel, px.
    height, width
        Of the stored image, px.

    Returns
    -------
    Box
        Left, top, right, bottom, 0 to 1, clipped to the image. The whole image where the finding names no part, or one
        outside the image.
    """
    tile = where.tile or (where.pixel and (*where.pixel, where.pixel[0] + 1, where.pixel[1] + 1))
    if not tile:
        return WHOLE
    left, right = (min(max(column / width, 0.0), 1.0) for column in tile[::2])
    top, bottom = (min(max(row / height, 0.0), 1.0) for row in tile[1::2])
    return (left, top, right, bottom) if left < right and top < bottom else WHOLE


def _instant_ns(where: Where, rows: Mapping[str, int], facts: Facts) -> int | None:
    """Return the timestamp of the named frame, or else the middle of the finding's interval; None without either."""
    for stream, row in rows.items():
        if facts.clocks[stream].usable:
            return int(facts.clocks[stream].times_ns[row])
    if where.start_us is not None:
        first, stop = where.index_start, where.index_stop
        is_single_field = where.stream in facts.flow_streams and (stop is None or first is None or stop - first == 1)
        stop_us = where.start_us if where.stop_us is None or is_single_field else where.stop_us
        return facts.from_file_us((where.start_us + stop_us) / 2)
    clock = facts.clocks.get(where.stream or "")
    if clock is None or where.index_start is None or not _has_row(facts, where.stream or "", where.index_start):
        return None
    return int(clock.times_ns[where.index_start])


def _owner(rows: Mapping[str, int], spans: Iterable[Span]) -> Span | None:
    """Return the window that owns the first of these rows; it exists also where clocks are not usable."""
    for stream, row in rows.items():
        for span in spans:
            if row in range(*span.owned.get(stream, (0, 0))):
                return span
    return None


def nearest_span(time_ns: int | None, spans: Sequence[Span]) -> Span | None:
    """Return the window at an instant, or the one nearest to it."""
    if time_ns is None or not spans:
        return None
    return min(spans, key=lambda span: max(span.start_ns - time_ns, time_ns - span.stop_ns + 1, 0))


def _has_row(facts: Facts, stream: str, row: int) -> bool:
    return 0 <= row < len(facts.clocks[stream].times_ns)


def busiest_box(snapshot: Snapshot, width_px: int) -> Box:
    """Return the box in which the widest picture has a width, where most events lie; in the middle without events.

    Parameters
    ----------
    snapshot
        With pictures that were not averaged.
    width_px
        Of the box in the widest picture, px.
    """
    widest = max((_picture_size(picture)[1] for picture in snapshot.pictures.values()), default=0)
    if widest <= width_px:
        return WHOLE
    share = width_px / widest
    middle = (0.5, 0.5)
    if (events := snapshot.pictures.get("events")) is not None and np.any(events.image):
        height, width = _picture_size(events)
        counts = events.image.sum(axis=0, dtype=np.float32)
        side = (max(round(share * width), 1), max(round(share * height), 1))
        sums = cv2.boxFilter(counts, cv2.CV_32F, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
        row, column = np.unravel_index(int(np.argmax(sums)), sums.shape)
        middle = ((int(column) + 0.5) / width, (int(row) + 0.5) / height)
    left, top = (min(max(centre - share / 2, 0.0), 1.0 - share) for centre in middle)
    return (left, top, left + share, top + share)


def cut_out(snapshot: Snapshot, box: Box) -> Snapshot:
    """Return the same box of all pictures: the cameras of a file have one field of view."""
    pictures = {
        family: replace(picture, image=np.ascontiguousarray(_picture_part(picture, box)))
        for family, picture in snapshot.pictures.items()
    }
    return replace(snapshot, pictures=pictures)


def _picture_size(picture: Picture) -> tuple[int, int]:
    """Return rows and columns."""
    shape = picture.image.shape
    return shape[-2:] if picture.stream == "events" else shape[:2]


def _picture_part(picture: Picture, box: Box) -> NDArray[Any]:
    height, width = _picture_size(picture)
    left, top, right, bottom = box
    rows, columns = _pixels(top, bottom, height), _pixels(left, right, width)
    return picture.image[..., rows, columns] if picture.stream == "events" else picture.image[rows, columns]


def _pixels(start: float, stop: float, size: int) -> slice:
    """Return the pixels of a range of shares, 1 at least; their number does not depend on where the range lies."""
    first = round(start * size)
    return slice(first, first + max(round((stop - start) * size), 1))

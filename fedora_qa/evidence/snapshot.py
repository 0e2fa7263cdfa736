"""Snapshots: their times and sizes, pictures of all streams at one instant, flow residuals, and their arrays."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import in_families
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.images.luma import LUMA_WEIGHTS
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.pictures import (
    LARGEST_SENSOR_PX,
    block_px,
    events_of_pixels,
    mean_codes,
    mean_values,
    picture_shape,
    summed_counts,
)
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.record.evidence import MOMENTS, named
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events, Span, Window

T = TypeVar("T")

EVENTS_NS: Final = 20_000_000
"""Time over which events are counted, ns: one period at 50 frames/s, half before and half after the instant."""

_OUTSIDE: Final = -10.0
"""Coordinate outside of all pictures, px, for pixels without a finite flow."""

# Of a pixel of a picture.
_BYTES_PER_PX: Final = {"path/rgb": 3, "path/depth": 4}
_FLOW_BYTES_PER_PX: Final = 8
# Counts of two polarities as uint16; the residual is float16.
_EVENT_BYTES_PER_PX: Final = 4
_RESIDUAL_BYTES_PER_PX: Final = 2
_LEAST_WIDTH_PX: Final = 16
# Rows and columns of the paper's event camera, for files that declare none.
_USUAL_SENSOR: Final = (480, 640)

_Entries = Mapping[str, tuple[NDArray[Any], str]]

ON_CLOCK: Final = "us on the file's clock"


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture of one stream.

    Attributes
    ----------
    image
        As in ``Snapshot``.
    stream
        Stream of the image.
    row
        Row of the image in its stream; 0 for events.
    block
        Side of the blocks over which pixels were averaged or summed, px.
    start_ns, stop_ns
        Start and end of its interval, ns from the file's origin; equal for an instant.
    """

    image: NDArray[Any]
    stream: str
    row: int
    block: int
    start_ns: int
    stop_ns: int


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Pictures of the streams around an instant; streams without a picture are left out.

    Attributes
    ----------
    time_ns
        The instant, ns from the file's origin.
    pictures
        By family, averaged or summed over blocks of pixels: ``rgb`` (h, w, 3) codes, ``depth`` (h, w) m, ``flow`` (h,
        w, 2) px, ``residual`` (h, w) DN of that flow between the frames at both its ends, ``events`` (2, h, w) darker
        and brighter events (of each pixel where the size of the sensor is not declared).
    """

    time_ns: int
    pictures: Mapping[str, Picture]


def take_snapshot(
    window: Window,
    time_ns: int,
    width_px: int,
    rows: Mapping[str, int] | None = None,
    families: frozenset[str] | None = None,
    events_ns: int = EVENTS_NS,
) -> Snapshot:
    """Take pictures of every stream near an instant of a window; without the pictures of rows that cannot be decoded.

    Parameters
    ----------
    window
        Its own images are used, and events from before and after it.
    time_ns
        The instant, ns from the file's origin.
    width_px
        Largest width of pictures, px.
    rows
        Row of the image by stream; for other streams the nearest in time.
    families
        The streams to take (``flow`` is every rate); None: all.
    events_ns
        Time over which events are counted, ns, half before and half after the instant.
    """
    rows = rows or {}
    draw: dict[str, Callable[[], Picture | None]] = {
        "rgb": lambda: _frame(window, "rgb", time_ns, rows, lambda row: _small_codes(window, row, width_px)),
        "depth": lambda: _frame(window, "depth", time_ns, rows, lambda row: _small(window.depth_m(row), width_px)),
        "flow": lambda: _flow(window, time_ns, rows, width_px),
        "events": lambda: _events(window, time_ns, width_px, events_ns),
    }
    pictures = {family: _readable(read) for family, read in draw.items() if in_families(family, families)}
    flow = pictures.get("flow")
    if flow is not None and in_families("rgb", families):
        pictures["residual"] = _readable(lambda: _residual(window, flow, width_px))
    return Snapshot(time_ns, {family: picture for family, picture in pictures.items() if picture is not None})


def nearest_row(window: Window, stream: str, time_ns: int) -> int | None:
    """Return the row nearest to an instant, of those of a stream that a window owns; None where it owns none.

    Where the timestamps of a stream are not usable, its rows are taken as evenly spread over the window.

    Parameters
    ----------
    stream
        Any stream but events.
    time_ns
        Ns from the file's origin.
    """
    rows, clock = window.owned(stream), window.facts.clocks.get(stream)
    if clock is None or not rows:
        return None
    if clock.usable:
        return rows.start + int(np.argmin(np.abs(clock.times_ns[rows.start : rows.stop] - time_ns)))
    phase = (time_ns - window.span.start_ns) / (window.span.stop_ns - window.span.start_ns)
    return rows.start + int(np.clip(phase * len(rows), 0, len(rows) - 1))


def _readable(read: Callable[[], T | None]) -> T | None:
    """Return a picture; None where its rows cannot be decoded. Other pictures are not affected."""
    try:
        return read()
    except UnreadableRowsError:
        return None


def _frame(
    window: Window,
    stream: str,
    time_ns: int,
    rows: Mapping[str, int],
    draw: Callable[[int], tuple[NDArray[Any], int]],
) -> Picture | None:
    row = rows.get(stream, nearest_row(window, stream, time_ns))
    if row is None or stream not in window.facts.streams:
        return None
    frame_ns = int(window.facts.clocks[stream].times_ns[row])
    image, block = draw(row)
    return Picture(image, stream, row, block, frame_ns, frame_ns)


def _flow(window: Window, time_ns: int, rows: Mapping[str, int], width_px: int) -> Picture | None:
    """Return the picture of the named field, or of the fastest rate whose nearest field begins close to the instant.

    Close means within half the length of the field's interval.
    """
    for stream in reversed(window.facts.flow_streams):
        row = rows.get(stream)
        if row is None and any(name.startswith("flow/") for name in rows):
            continue  # the field of another rate is named
        clock = window.facts.clocks[stream]
        if row is None:
            row = nearest_row(window, stream, time_ns)
            if row is not None and clock.ends_ns is not None and clock.usable:
                begin_ns, end_ns = int(clock.times_ns[row]), int(clock.ends_ns[row])
                row = row if 2 * abs(begin_ns - time_ns) <= abs(end_ns - begin_ns) else None
        if row is None:
            continue
        image, block = _small(window.flow_px(stream, row), width_px)
        start_ns = int(clock.times_ns[row])
        return Picture(
            image, stream, row, block, start_ns, start_ns if clock.ends_ns is None else int(clock.ends_ns[row])
        )
    return None


def _residual(window: Window, flow: Picture, width_px: int) -> Picture | None:
    """Return the residual between the frames at both ends of a field's interval; None where the file has none."""
    clock = window.facts.clocks.get("rgb")
    if clock is None or not clock.usable or "rgb" not in window.facts.streams:
        return None
    rows = [int(np.argmin(np.abs(clock.times_ns - time_ns))) for time_ns in (flow.start_ns, flow.stop_ns)]
    # A frame belongs to an end of the interval where it is no farther than a quarter of it.
    distances_ns = [
        abs(int(clock.times_ns[row]) - time_ns)
        for row, time_ns in zip(rows, (flow.start_ns, flow.stop_ns), strict=True)
    ]
    if rows[0] == rows[1] or 4 * max(distances_ns) > abs(flow.stop_ns - flow.start_ns):
        return None
    (earlier, block), (later, _) = (_small_codes(window, row, width_px) for row in rows)
    if earlier.shape[:2] != flow.image.shape[:2] or block != flow.block:
        return None
    residual_dn = carried_back_dn(earlier, later, flow.image, block)
    return Picture(residual_dn, flow.stream, flow.row, block, flow.start_ns, flow.stop_ns)


def carried_back_dn(
    earlier: NDArray[Any], later: NDArray[Any], flow_px: NDArray[Any], block: int
) -> NDArray[np.float16]:
    """Return the luma of ``later`` at the positions to which the flow leads, minus the luma of ``earlier``.

    The residual is for a picture, not for a measurement: pixels that are covered or uncovered during the interval, and
    the averaging over blocks, also cause residuals.

    Parameters
    ----------
    earlier, later
        (h, w, 3) codes of the frames at both ends of the flow's interval, averaged over blocks of pixels.
    flow_px
        (h, w, 2), u right and v down, px of the stored image; NaN where unknown.
    block
        Side of a block in the stored image, px.

    Returns
    -------
    ndarray of float16
        (h, w) DN; NaN where the flow is unknown or leads out of the picture.
    """
    weights = LUMA_WEIGHTS.astype(np.float32)
    before, after = ((image.astype(np.float32) @ weights).astype(np.float32) for image in (earlier, later))
    rows, columns = np.indices(before.shape, dtype=np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        # Flow is in px of the stored image, of which one px of the picture is ``block``.
        x, y = columns + flow_px[..., 0] / block, rows + flow_px[..., 1] / block
    height, width = before.shape
    within = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)  # False for NaN
    # cv2.remap gets finite coordinates everywhere; values outside are masked below.
    to_column, to_row = (np.where(within, axis, _OUTSIDE).astype(np.float32) for axis in (x, y))
    warped = cv2.remap(after, to_column, to_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    # float16 resolves a difference of 255 DN to 0.125 DN, finer than the codes of a frame.
    return np.where(within, warped - before, np.nan).astype(np.float16)


def _events(window: Window, time_ns: int, width_px: int, events_ns: int) -> Picture | None:
    """Count the events of each block of pixels; of each pixel where the size of the sensor is not declared.

    Then it follows only from the events of all snapshots.
    """
    if "events" not in window.facts.streams:
        return None
    events = events_around(window, time_ns, events_ns)
    shape = sensor_shape(window.facts, events)
    block = block_px(shape[1], width_px) if "events" in window.facts.declared.cameras else 1
    start_ns, stop_ns = time_ns - events_ns // 2, time_ns + events_ns // 2
    return Picture(events_of_pixels(events.x, events.y, events.p, shape, block), "events", 0, block, start_ns, stop_ns)


def events_around(window: Window, time_ns: int, events_ns: int) -> Events:
    """Return the events around an instant of a window.

    Parameters
    ----------
    window
        Reads its events with a margin of half of ``events_ns``, once for all instants.
    time_ns
        The instant, ns from the file's origin.
    events_ns
        Length of the interval, ns, half before and half after the instant.

    Raises
    ------
    UnreadableRowsError
        Where they cannot be decoded.
    """
    events = window.events(events_ns // 2, events_ns // 2)
    first, last = np.searchsorted(events.times_ns, [time_ns - events_ns // 2, time_ns + events_ns // 2])
    rows = slice(first, last)
    return Events(events.x[rows], events.y[rows], events.times_ns[rows], events.p[rows])


def sensor_shape(facts: Facts, events: Events) -> tuple[int, int]:
    """Return height and width of the event camera, px: as declared, or else as far as these events lie."""
    declared = facts.declared.cameras.get("events")
    if declared is not None:
        return declared.height, declared.width
    height, width = (min(int(values.max(initial=0)) + 1, LARGEST_SENSOR_PX) for values in (events.y, events.x))
    return height, width


def _small_codes(window: Window, frame: int, width_px: int) -> tuple[NDArray[Any], int]:
    """Return a colour frame averaged over blocks, once a window: the frame of an instant often also begins the flow."""
    image = window.rgb(frame)
    block = block_px(image.shape[1], width_px)
    return window.derived(_mean_codes, frame, block), block


def _mean_codes(window: Window, frame: int, block: int) -> NDArray[Any]:
    return mean_codes(window.rgb(frame), block)


def _small(image: NDArray[Any], width_px: int) -> tuple[NDArray[Any], int]:
    block = block_px(image.shape[1], width_px)
    return mean_values(image, block), block


def snapshot_times_ns(spans: Sequence[Span], facts: Facts, count: int) -> Mapping[int, tuple[int, ...]]:
    """Return times by the number of their window, evenly spread over the images of the windows.

    They are timestamps of the slowest stream of images that has enough images, so that faster streams have an image
    near them. Without images they are the middles of windows.

    Parameters
    ----------
    spans
        Windows over which the times are spread.
    count
        Number of times; fewer where there are fewer images.
    """
    # The stream of images with the fewest rows that are enough; the one with the most where none has.
    streams = [name for name in ("rgb", "depth", *facts.flow_streams) if name in facts.clocks]
    sizes = {name: sum(_owned_rows(span, name) for span in spans) for name in streams if facts.clocks[name].usable}
    enough = [name for name, size in sizes.items() if size >= count]
    filled = [name for name, size in sizes.items() if size]
    stream = (
        min(enough, key=lambda name: sizes[name]) if enough else max(filled, key=lambda name: sizes[name], default=None)
    )
    if stream is None:
        middles = _evenly(len(spans), count)
        return {spans[i].index: ((spans[i].start_ns + spans[i].stop_ns) // 2,) for i in middles}
    ends = np.cumsum([_owned_rows(span, stream) for span in spans])
    times_ns = facts.clocks[stream].times_ns
    times_by_window: dict[int, tuple[int, ...]] = {}
    for position in _evenly(int(ends[-1]), count):
        number = int(np.searchsorted(ends, position, "right"))
        span = spans[number]
        # ``ends`` are cumulative counts, so that the row is counted back from the end of its window.
        row = span.owned[stream][1] - (int(ends[number]) - position)
        times_by_window[span.index] = (*times_by_window.get(span.index, ()), int(times_ns[row]))
    return times_by_window


def fitting_width_px(facts: Facts, options: EvidenceOptions, snapshots: int) -> int:
    """Return the greatest width of pictures, px, with which a number of snapshots fits into the size; 16 px at least.

    Parameters
    ----------
    options
        Size of the pictures, and their largest width.
    snapshots
        Number of snapshots.
    """
    widths = range(options.picture_width_px, _LEAST_WIDTH_PX, -1)
    fits = (width for width in widths if snapshots * snapshot_bytes(facts, width) <= options.size_bytes)
    return next(fits, _LEAST_WIDTH_PX)


def snapshot_bytes(facts: Facts, width_px: int) -> int:
    """Return the size of the pictures of one snapshot in bytes, with the largest flow.

    Parameters
    ----------
    width_px
        Largest width of pictures, px.
    """
    sizes: dict[str, int] = {}
    flow = {f"path/{stream}": _FLOW_BYTES_PER_PX for stream in facts.flow_streams}
    for key, bytes_per_px in (_BYTES_PER_PX | flow).items():
        binding = facts.layout.bindings.get(key)
        if binding is not None and len(binding.shape) >= 3:
            family = "flow" if "flow" in key else key
            sizes[family] = max(sizes.get(family, 0), bytes_per_px * _pixels(binding.shape[1:3], width_px))
    if "path/rgb" in sizes and "flow" in sizes:
        sizes["residual"] = _RESIDUAL_BYTES_PER_PX * sizes["path/rgb"] // _BYTES_PER_PX["path/rgb"]
    camera = facts.declared.cameras.get("events")
    if "events" in facts.streams:
        shape = (camera.height, camera.width) if camera else _USUAL_SENSOR
        sizes["events"] = _EVENT_BYTES_PER_PX * _pixels(shape, width_px)
    return sum(sizes.values())


def _pixels(shape: tuple[int, ...], width_px: int) -> int:
    rows, columns = picture_shape(shape[0], shape[1], block_px(shape[1], width_px))
    return rows * columns


def _owned_rows(span: Span, stream: str) -> int:
    start, stop = span.owned.get(stream, (0, 0))
    return stop - start


def _evenly(of: int, count: int) -> list[int]:
    """Return positions in the middles of ``count`` equal parts of a range, each once."""
    edges = np.linspace(0, of, count + 1)
    return sorted({int((start + stop) / 2) for start, stop in pairwise(edges)}) if of else []


def keep_snapshots(snapshots: Sequence[Snapshot], facts: Facts, width_px: int) -> TitledArrays:
    """Return snapshots in the order of time as arrays whose first axis is the snapshot; none where all lack pictures.

    A missing picture is NaN, or 0 for codes and counts. ``width_px`` is the largest width of pictures.
    """
    entries = _entries(snapshots, facts, width_px) if any(snapshot.pictures for snapshot in snapshots) else {}
    return TitledArrays.titled({named(MOMENTS, name): entry for name, entry in entries.items()})


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


def _entries(snapshots: Sequence[Snapshot], facts: Facts, width_px: int) -> _Entries:
    times_us = np.array([facts.to_file_us(snapshot.time_ns) for snapshot in snapshots])
    entries: dict[str, tuple[NDArray[Any], str]] = {"times_us": (times_us, f"Instants, {ON_CLOCK}")}
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
                entries["rgb_times_us"] = intervals_us[:, 0], f"Instants of the colour frames, {ON_CLOCK}"
            case "depth":
                entries["depth_m"] = stack, f"Depth along the optical axis, m{averaged}"
                entries["depth_times_us"] = intervals_us[:, 0], f"Instants of the depth frames, {ON_CLOCK}"
            case "flow":
                streams = ", ".join(sorted({picture.stream for picture in present}))
                title = f"Flow ({streams}; u right, v down), px of the stored image over its interval{averaged}"
                entries["flow_px"] = stack, title
                entries["flow_interval_us"] = intervals_us, f"Start and end of the flow's interval, {ON_CLOCK}"
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
                title = f"Start and end of the time in which events were counted, {ON_CLOCK}"
                entries["events_interval_us"] = intervals_us, title
    return entries

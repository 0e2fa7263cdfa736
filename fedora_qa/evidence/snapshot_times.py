"""Times of snapshots, and the size of their pictures."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.pictures import block_px, picture_shape
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span

_BYTES_PER_PX: Final = {"path/rgb": 3, "path/depth": 4}
_FLOW_BYTES_PER_PX: Final = 8
# Counts of two polarities as uint16; the residual is float16.
_EVENT_BYTES_PER_PX: Final = 4
_RESIDUAL_BYTES_PER_PX: Final = 2
_LEAST_WIDTH_PX: Final = 16
# Rows and columns of the paper's event camera, for files that declare none.
_USUAL_SENSOR: Final = (480, 640)


def snapshot_times_ns(spans: Sequence[Span], facts: Facts, count: int) -> Mapping[int, tuple[int, ...]]:
    """Return times by the number of their window, evenly spread over the images of the windows.

    They are timestamps of the slowest stream of images that has enough images, so that faster streams have an image
    near them. Without images they are the middles of windows.

    Parameters
    ----------
    spans
        Windows over which the times are spread.
    facts
        With the clocks of the file.
    count
        Number of times; fewer where there are fewer images.

    Returns
    -------
    Mapping[int, tuple[int, ...]]
        Ns from the file's origin.
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
    """Return the greatest width of pictures, px, with which a number of snapshots fits into the size.

    Parameters
    ----------
    facts
        With the sizes of the images.
    options
        Size of the pictures, and their largest width.
    snapshots
        Number of snapshots.

    Returns
    -------
    int
        16 px at least.
    """
    widths = range(options.picture_width_px, _LEAST_WIDTH_PX, -1)
    fits = (width for width in widths if snapshots * snapshot_bytes(facts, width) <= options.size_bytes)
    return next(fits, _LEAST_WIDTH_PX)


def snapshot_bytes(facts: Facts, width_px: int) -> int:
    """Return the size of the pictures of one snapshot in bytes, with the largest flow.

    Parameters
    ----------
    facts
        With the sizes of the images.
    width_px
        Largest width of pictures, px.

    Returns
    -------
    int
        Uncompressed size.
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

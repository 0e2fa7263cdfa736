"""Cut a sequence into windows on a fixed grid of time; choose which are measured, and how densely, for each effort.

Efforts trade time for detection power. ``quick`` and ``standard`` sample windows evenly over the sequence, the first
and the last among them, short ones in groups of neighbours, as each window is decoded with its halo; ``full`` decodes
every chunk and uses every event and sample, and a stated share of image tiles; ``exhaustive`` uses every pixel. Checks
that need neither images nor events get every window at every effort: IMU and poses are a thousandth of a file, and a
sample of windows would miss a jump of one instant.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_qa.conventions import NS_PER_S
from fedora_qa.engine.options import Effort
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import datasets_of, is_timed, timestamps_of
from fedora_qa.sequence.scan import Scan
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.window import USUAL_PIXELS, Sampling, Span

WINDOW_NS: Final = NS_PER_S // 5
"""0.2 s: the least time in which flow of 10, 25 and 50 Hz all complete whole intervals."""

_MOST_WINDOW_BYTES: Final = 128 << 20
"""Most bytes of images in a window. Every check reads them, one check after another, so that all should be held."""

# 0.02 s, the interval of flow at 50 Hz.
_SHORTEST_WINDOW_NS: Final = NS_PER_S // 50

FEWEST_WINDOWS: Final = 4
"""In a sample smaller than this a local fault cannot be distinguished from a global one."""

_FEWEST_PLACES: Final = 2_000
"""Least pixels of a frame that dense checks read: to thin out a small frame costs power and saves no time."""

_SAMPLES: Final = frozenset({"imu", "pose"})
"""Streams of single samples, which cost little to read."""

FOLLOW_UP_SHARE: Final = 0.1
"""Share of the windows that checks may request for follow-ups."""

FEWEST_FOLLOW_UPS: Final = 3
"""Windows that they may always request: the scatter of windows cannot be estimated from fewer."""


@dataclass(frozen=True, slots=True)
class EffortLevel:
    """Share of the windows, and the density within a window."""

    window_share: float
    sampling: Sampling


EFFORTS: Final[Mapping[Effort, EffortLevel]] = MappingProxyType(
    {
        "quick": EffortLevel(0.1, Sampling(tile_share=0.05)),
        "standard": EffortLevel(0.25, Sampling(tile_share=0.1)),
        "full": EffortLevel(1.0, Sampling(tile_share=0.25)),
        "exhaustive": EffortLevel(1.0, Sampling(tile_share=1.0)),
    }
)


@dataclass(frozen=True, slots=True)
class Plan:
    """The windows to measure, by their place in the list of spans, and how densely."""

    chosen: tuple[int, ...]
    of: int
    sampling: Sampling


def make_plan(effort: Effort, windows: int, window_ns: int = WINDOW_NS, pixels: int | None = None) -> Plan:
    """Choose windows for an effort, evenly spread over the sequence.

    Windows shorter than usual are chosen in groups of neighbours that are together as long as a usual window: at
    1440x1080 a window of 0.025 s decodes five times its own rows. There are at least ``FEWEST_WINDOWS`` groups.

    Parameters
    ----------
    windows
        How many there are.
    pixels
        The size of a frame, where known.
    """
    share = EFFORTS[effort].window_share
    wanted = min(windows, max(FEWEST_WINDOWS, round(share * windows)))
    # Groups as long as one usual window of 0.2 s, rounded up.
    groups = min(wanted, max(FEWEST_WINDOWS, -(-wanted * window_ns // WINDOW_NS)))
    number = np.arange(wanted)
    # Windows left out lie in equal gaps between the groups only, so that the first and the last are chosen.
    gaps_before = number * groups // max(wanted, 1)
    left_out = gaps_before * (windows - wanted) / max(groups - 1, 1)
    chosen = number + left_out.round().astype(int)
    return Plan(tuple(chosen.tolist()), windows, sampling_of(effort, pixels))


def sees_every_window(needs: Iterable[str]) -> bool:
    """Whether a check of these streams gets every window at every effort."""
    return bool(streams := frozenset(needs)) and streams <= _SAMPLES


def sampling_of(effort: Effort, pixels: int | None) -> Sampling:
    """Return how densely an effort samples a window: more so in small frames, up to ``full``, and less in large ones.

    The power to detect a fault of a whole field follows from the number of pixels that are read, not from their share.
    Further pixels of a large frame cost time and gain little, as a file has thousands of fields. Standard errors grow
    with one over the root of that number: at 1440x1080 a seventh of the pixels that the share would give makes limits
    2.7 times as large, 0.002 to 0.005 px of a rate's mean within one second. Against a bound of 400,000 pixels limits
    are 1.35 times as large (the median of the 33 numbers that the flow of one second is fitted with), and the check
    takes 0.7 of the time.

    Parameters
    ----------
    pixels
        Pixels of a frame, where known. ``exhaustive`` reads all of them.
    """
    usual = EFFORTS[effort].sampling
    if not pixels or effort == "exhaustive":
        return usual
    # Above ``USUAL_PIXELS`` the number of pixels that are read is constant, and so is the standard error.
    fewer = min(1.0, USUAL_PIXELS / pixels)
    # sqrt(2000 * pixels) pixels at least, never fewer than 2000 of a larger frame, but no larger share than ``full``.
    least = min((_FEWEST_PLACES / pixels) ** 0.5, EFFORTS["full"].sampling.tile_share * fewer)
    return replace(usual, tile_share=max(usual.tile_share * fewer, least))


def window_length_ns(sequence: SequenceRows) -> int:
    """Return the length of the windows: 0.2 s, halved while the images of one would exceed 128 MiB.

    It follows from the file alone and not from the workers, so that results do not depend on them.
    """
    bytes_per_s = 0.0
    for stream in sorted(filter(is_timed, sequence.layout.streams)):
        images = [spec for spec in datasets_of(stream) if spec.is_image]
        rows = sequence.layout.bindings[timestamps_of(stream)].rows
        if not images or rows < 2:
            continue
        try:
            timestamps = sequence.rows(timestamps_of(stream), 0, min(rows, 1000))
        except UnreadableRowsError:
            continue
        # The rate from the median step of the first timestamps, which ignores single wrong ones. Rows of flow are
        # (start, end): the start counts.
        step_ns = float(np.median(np.diff(timestamps.reshape(len(timestamps), -1)[:, 0])))
        if step_ns <= 0:
            continue
        shape = sequence.layout.bindings[images[0].key].shape
        row_bytes = int(np.prod(shape[1:], dtype=np.int64)) * np.dtype(images[0].dtype).itemsize
        # At most all rows of the stream, however small a step wrong timestamps give.
        bytes_per_s += row_bytes * min(NS_PER_S / step_ns, rows)
    length = WINDOW_NS
    while length > _SHORTEST_WINDOW_NS and bytes_per_s * length / NS_PER_S > _MOST_WINDOW_BYTES:
        length //= 2
    return length


def cut_windows(scan: Scan) -> tuple[Span, ...]:
    """Return a span for every cell of the grid in which any stream has items, in order."""
    cells = [runs.cells for runs in scan.runs.values()]
    if not cells:
        return ()
    every = np.unique(np.concatenate(cells))
    owned: dict[str, list[tuple[int, int]]] = {}
    for stream, runs in scan.runs.items():
        first = np.searchsorted(runs.cells, every, "left")
        bounds = np.append(runs.starts, runs.count)
        # Beyond a stream's last cell ``searchsorted`` gives its length; the last cell in its place differs, so absent.
        present = runs.cells[np.minimum(first, len(runs.cells) - 1)] == every
        owned[stream] = [
            (int(bounds[i]), int(bounds[i + 1])) if there else (0, 0) for i, there in zip(first, present, strict=True)
        ]
    return tuple(
        Span(
            index=number,
            start_ns=int(cell) * scan.cell_ns,
            stop_ns=(int(cell) + 1) * scan.cell_ns,
            owned={stream: rows[number] for stream, rows in owned.items() if rows[number] != (0, 0)},
        )
        for number, cell in enumerate(every)
    )

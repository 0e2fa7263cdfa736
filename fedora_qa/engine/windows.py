"""Cut a sequence into windows: index ranges on a fixed grid of time."""

from typing import Final

import numpy as np

from fedora_qa.conventions import NS_PER_S
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.canonical import DATASETS, TIMESTAMPS_OF
from fedora_qa.sequence.scan import Scan
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.window import Span

WINDOW_NS: Final = NS_PER_S // 5
"""0.2 s: the least time in which flow of 10, 25 and 50 Hz all complete whole intervals."""

_MOST_WINDOW_BYTES: Final = 64 << 20
"""Most bytes of images in a window. Every check reads them, one check after another, so that all should be held."""

# 0.02 s, the interval of flow at 50 Hz.
_SHORTEST_WINDOW_NS: Final = NS_PER_S // 50


def window_length_ns(sequence: SequenceRows) -> int:
    """Return the length of the windows: 0.2 s, halved while the images of one would exceed 64 MiB.

    It follows from the file alone and not from the workers, so that results do not depend on them.
    """
    length = WINDOW_NS
    streams = sorted(sequence.layout.streams & set(TIMESTAMPS_OF))
    while (
        length > _SHORTEST_WINDOW_NS
        and sum(_image_bytes_per_s(sequence, stream) for stream in streams) * length / NS_PER_S > _MOST_WINDOW_BYTES
    ):
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


def _image_bytes_per_s(sequence: SequenceRows, stream: str) -> float:
    """Estimate decoded image bytes of a stream per second from the median step of its first timestamps."""
    images = [spec for spec in DATASETS.values() if spec.stream == stream and spec.is_image]
    rows = sequence.layout.bindings[TIMESTAMPS_OF[stream]].rows
    if not images or rows < 2:
        return 0.0
    try:
        timestamps = sequence.rows(TIMESTAMPS_OF[stream], 0, min(rows, 1000))
    except UnreadableRowsError:
        return 0.0
    # Rows of flow are (start, end): the start counts. The median ignores single timestamps that are wrong.
    step_ns = float(np.median(np.diff(timestamps.reshape(len(timestamps), -1)[:, 0])))
    if step_ns <= 0:
        return 0.0
    shape = sequence.layout.bindings[images[0].key].shape
    row_bytes = int(np.prod(shape[1:], dtype=np.int64)) * np.dtype(images[0].dtype).itemsize
    # At most all rows of the stream, however small a step wrong timestamps give.
    return row_bytes * min(NS_PER_S / step_ns, rows)

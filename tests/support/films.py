"""A sequence without a file: depth images that are known by their value."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.engine.decode import BlockDecoder


class Films:
    """A sequence of depth images of 2 MB, each of one value: its number."""

    origin_ns = 0
    declared: Any = None
    layout: Any = SimpleNamespace(bindings={"path/depth": SimpleNamespace(rows=100)})

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        return np.repeat(np.arange(start, stop, dtype=np.float32), IMAGE_BYTES // 4).reshape(stop - start, -1, 1024)

    def chunk_rows(self, key: str) -> int:
        return 1


FACTS: Any = SimpleNamespace(events=None)
NOTHING_SCANNED: Any = SimpleNamespace(block_first_ns=np.empty(0, np.int64), facts=FACTS)
IMAGE_BYTES = 1 << 21


def images_of(decoder: BlockDecoder, *frames: int) -> int:
    """Ask for images, which must be the right ones; return how many were decoded for it."""
    before = decoder.decoded_bytes
    for frame in frames:
        assert np.all(decoder.rows("path/depth", frame, frame + 1) == frame)
    return (decoder.decoded_bytes - before) // IMAGE_BYTES

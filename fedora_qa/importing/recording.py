"""What every format of recordings is turned into: blocks of rows in canonical units, and facts about the recording."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

Kind = Literal["recorded", "synthetic"]
Resolution = tuple[int, int]
"""Width and height, px."""

BLOCK_BYTES: Final = 128 * 1024
"""Bytes of an event file that are decoded together. EVT3 has at most 6 events a byte, so that a block is 10 MB at most;
the usual one stays in the cache until it is copied."""


@dataclass(frozen=True, slots=True)
class Block:
    """Rows of one stream.

    Attributes
    ----------
    columns
        Arrays of one length by canonical key, in canonical type and unit. The writer copies them: their memory may be
        used again for the next block.
    """

    columns: Mapping[str, NDArray[Any]]


@dataclass(slots=True)
class Recording:
    """A recording that is being read.

    Attributes
    ----------
    format
        Its format in words, such as ``Prophesee EVT3``.
    blocks
        Its rows; of each stream in the order of the recording. Can be iterated once.
    size
        Bytes to read, or messages; the unit of ``done``.
    cameras
        Sizes of the images of ``rgb``, ``depth``, ``events``; complete once all blocks are read.
    kind
        Whether sensors made it; None: the format does not tell.
    facts
        What is kept as provenance: values of the header, and counts; complete once all blocks are read.
    unread
        What else it holds that is not read, in sentences.
    done
        How much of ``size`` is read.
    """

    format: str
    blocks: Iterator[Block]
    size: int
    cameras: dict[str, Resolution]
    kind: Kind | None = None
    facts: dict[str, str | int] = field(default_factory=dict)
    unread: tuple[str, ...] = ()
    done: int = 0


def event_block(x: NDArray[Any], y: NDArray[Any], t_us: NDArray[Any], p: NDArray[Any]) -> Block:
    """Return a block of events (n,): column, row, time in us, 1 brighter or 0 darker."""
    return Block(
        {
            "path/events/x": np.asarray(x, np.uint16),
            "path/events/y": np.asarray(y, np.uint16),
            "path/events/t": np.asarray(t_us, np.int64),
            "path/events/p": np.asarray(p, np.uint8),
        }
    )

"""The longest steps between successive event timestamps, forwards and backwards: a clock that was set shows in them."""

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.facts import EventStep

Int64 = NDArray[np.int64]

KEPT: Final = 8
"""Of either direction. A clock that was set makes two; the others say what is usual."""


def longest_steps(earlier: Iterable[EventStep], start: int, previous_ns: int, times_ns: Int64) -> tuple[EventStep, ...]:
    """Return the longest steps among known ones and those of a block, in the order of the file.

    Parameters
    ----------
    earlier
        The longest steps of earlier blocks.
    start
        First row of the block.
    previous_ns
        Stamp before the block.
    times_ns
        (n,) timestamps of the block.
    """
    before_ns = np.concatenate([[previous_ns], times_ns[:-1]])
    steps_ns = times_ns - before_ns
    of_block = (
        EventStep(start + int(row), int(before_ns[row]), int(times_ns[row]))
        for rows in (_largest(steps_ns), _largest(-steps_ns))
        for row in rows
    )
    steps = (*earlier, *of_block)
    forwards = sorted((step for step in steps if step.length_ns > 0), key=lambda step: -step.length_ns)
    backwards = sorted((step for step in steps if step.length_ns < 0), key=lambda step: step.length_ns)
    return tuple(sorted((*forwards[:KEPT], *backwards[:KEPT]), key=lambda step: step.row))


def _largest(values: Int64) -> NDArray[np.intp]:
    """Return where the largest values lie, those above zero only, earlier ones first among equals."""
    rows: NDArray[np.intp] = np.flatnonzero(values > 0)
    if len(rows) > KEPT:
        # Selection in linear time: a block holds 2^20 steps, of which eight are needed.
        least = np.partition(values[rows], -KEPT)[-KEPT]
        # Among equal steps the earliest is taken, so that the result does not depend on the borders of blocks.
        above, equal = rows[values[rows] > least], rows[values[rows] == least]
        rows = np.sort(np.concatenate([above, equal[: KEPT - len(above)]]))
    return rows

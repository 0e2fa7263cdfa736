"""Which causes put frames at other places than where the flow carries them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from fedora_qa.checks.protocol import Suspect

ALLOWED: Final = 0.5
"""Halfway between a frame in its place and one that repeats the frame before."""

_IN_PLACE: Final = 0.25
"""An interval is surely in order within half of what is allowed."""

_UNTOLD: Final = 0.6
"""Weight of frames out of place where the interval in which they come back is not known."""

Interval = tuple[int, int, float]
"""Two frames, and the share of the usual flow by which they lie apart."""


@dataclass(frozen=True, slots=True)
class OutOfOrder:
    """Intervals that are out of order.

    Attributes
    ----------
    shares
        Of the usual flow.
    by_frames
        Whether it is frames that are out of their places, from 0 to 1. Such a frame falls short in one interval and
        catches up in another beside, so that a run of intervals that only falls short, or only runs ahead, is no such
        frame; of one that nothing is known beside it may be.
    alone
        Whether each has neighbours in order on both sides.
    """

    shares: tuple[float, ...]
    by_frames: float
    alone: bool


def exceeds_limit(intervals: Sequence[Interval]) -> OutOfOrder:
    """Find the intervals that are out of order, and whether frames that are out of their places make them."""
    ordered = sorted(intervals)
    runs = list(_runs(ordered))
    returns = any(min(run) < 1 - _IN_PLACE and max(run) > 1 + _IN_PLACE for run, _, _ in runs)
    told = all(is_told for _, is_told, _ in runs)
    return OutOfOrder(
        tuple(share for _, _, share in ordered if abs(share - 1) > ALLOWED),
        1.0 if returns else 0.0 if told else _UNTOLD,
        bool(runs) and told and all(length == 1 for _, _, length in runs),
    )


def _runs(ordered: Sequence[Interval]) -> Iterator[tuple[list[float], bool, int]]:
    """Yield the shares of each run out of order and of its neighbours, whether both are known, and the run's length."""
    off = [abs(share - 1) > ALLOWED for _, _, share in ordered]
    follows = [False, *(one[1] == other[0] for one, other in pairwise(ordered)), False]
    start = 0
    while start < len(ordered):
        stop = start + 1
        if off[start]:
            while stop < len(ordered) and off[stop] and follows[stop]:
                stop += 1
            first, last = start - follows[start], stop + follows[stop]
            yield [share for _, _, share in ordered[first:last]], follows[start] and follows[stop], stop - start
        start = stop


def order_suspects(found: OutOfOrder) -> tuple[Suspect, ...]:
    """Name what puts intervals out of order.

    Exchanged frames turn a motion round: frames that are d apart leave d + 2 intervals out of order. Frozen ones stop
    it, once for each. What is not by frames moved the image itself, for one interval, or turned it for many.
    """
    turned = any(share < -ALLOWED for share in found.shares)
    stopped = sum(abs(share) < ALLOWED for share in found.shares)
    exchanged = float(max(len(found.shares) - 2, 1)) if turned else None
    swapped, frozen = found.by_frames * turned, found.by_frames * (stopped > 0 and not turned)
    moved = 1 - found.by_frames
    return (
        Suspect("spatial_offset", "rgb", moved * (0.8 if found.alone else 0.3)),
        Suspect("mirrored", "rgb", moved * (0.5 if found.alone else 0.8)),
        Suspect("swapped_frames", "rgb", max(0.95 * swapped, 0.2), exchanged, "samples"),
        Suspect("frozen_frames", "rgb", max(0.95 * frozen, 0.2), float(max(stopped, 1)), "samples"),
        Suspect("dropped_samples", "rgb", 0.3),
        Suspect("duplicated_samples", "rgb", 0.3),
        *(Suspect(cause, "flow", 0.3) for cause in ("swapped_frames", "frozen_frames", "flow_interval_shifted",
                                                    "flow_gain", "flow_sign", "flow_unit", "other_sequence")),
        Suspect("other_sequence", "rgb", 0.3),
    )  # fmt: skip

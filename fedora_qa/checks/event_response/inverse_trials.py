"""Which fault, once undone, lets events add up to the frames again: tried where they do not (``conservation``).

The law of conservation is certain, so that a wrong repair breaks it at other pixels as often as it mends it. What
counts is the pixels that obey again less those that no longer do, in the rectangle of tiles where this is most: a fault
of a part of the image is mended there and nowhere else. A window is tried as a whole and by halves, as a fault may
begin or end within it.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import ceil, exp, sqrt
from typing import Any, Final, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_response.timing_causes import whose_offset
from fedora_qa.checks.protocol import Suspect
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.estimators.events.row_kernels import count_between_frames
from fedora_qa.estimators.events.shift import RADIUS_PX, cross_correlation
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import GRID, ROUNDING_DN, SeenFrames, seen_frames, sensor_events, signal
from fedora_qa.views.frame_run_sums import EVEN, join, violations

Bool = NDArray[np.bool_]
Counts = NDArray[np.int32]
Symmetry = tuple[bool, bool, bool]
"""Whether axes are exchanged, columns mirrored, rows mirrored."""

UPRIGHT: Final = (False, False, False)

Pixels = TypeVar("Pixels", bound=NDArray[Any])

FEWEST_BROKEN: Final = 10
"""Pixels of a part that break the law, below which a repair mends most of them by chance."""

MENDED: Final = 0.8
"""Share of them that a repair must mend, net. In 36 damaged files right repairs of a whole window or its half reached
0.8 to 1; wrong ones, where none was right, 0.6 of twenty pixels or more and 0.5 of fifty."""

ENOUGH_BROKEN: Final = 50
"""Pixels of a part that break the law, from which on it tells that no repair mends them."""

_SURE: Final = 0.95

_BY_FAR: Final = 3.0
"""Times the pixels of the next best cause that a repair must mend over all windows to be the right one for sure."""

_LATER_STILL: Final = 0.6
"""Weight of an offset of time beside that of a shift: one that is larger than those tried shifts what moves evenly."""

_PARTS: Final = 3
"""A window and its halves."""

_SEEN_PX: Final = 12_000
"""Pixels that are tried, evenly spread: more would tell no more of a fault that moves or turns a part of the image."""

_FIRST_WINDOWS: Final = 8
_EVERY: Final = 8
"""The first windows are tried, and every eighth of the others: which ones must not depend on what others showed."""

_DELAYS_MS: Final = tuple(float(late) for late in range(-30, 31, 2) if late)
"""Offsets that are tried, as far as the halo of a window reaches. One that is off by a millisecond still mends most."""

_END_NS: Final = 2 * NS_PER_MS
"""From an end of the events to the next frame: a step of the ladder of offsets."""

_IMAGES: Final = ("sharp_dn", "even_dn", "error_dn", "counts")

_PEAKS: Final = 3
"""Shifts that are tried: the highest values of the cross-correlation."""


@dataclass(frozen=True, slots=True)
class Mended:
    """Pixels that a repair mends, net, and the size of the fault that it undoes, as ``causes`` count it."""

    cause: str
    pixels: int
    size: float | None = None


@dataclass(frozen=True, slots=True)
class Trial:
    """A part of a window: how many of the pixels that were tried break the law, and the best repair by cause."""

    window: int
    broken: int
    repairs: tuple[Mended, ...]

    @property
    def best(self) -> int:
        """Pixels that the best repair mends."""
        return max(one.pixels for one in self.repairs)


@dataclass(frozen=True, slots=True)
class _Repair:
    """Counts (n - 1, 2, h, w) of events as they would be without a fault; ``known`` (h, w) where that can be said.

    Both are of the pixels that are tried. ``symmetry`` is how events were moved across the image.
    """

    cause: str
    counts: Counts
    known: Bool
    symmetry: Symmetry = UPRIGHT
    size: float | None = None


def trials(window: Window) -> list[Trial]:
    """Return what undoing faults does to a window; nothing where events add up, or it is not its turn."""
    seen, declared = seen_frames(window), window.facts.declared.events
    its_turn = window.span.index < _FIRST_WINDOWS or window.span.index % _EVERY == 0
    if declared is None or len(seen) < 2 or not its_turn:
        return []
    middle, rounding_dn = len(seen) // 2, ROUNDING_DN[window.facts.declared.transfer]
    few = SeenFrames(seen.frames, seen.times_ns, *(_thinned(getattr(seen, name)) for name in _IMAGES))
    parts = [part for part in ((0, len(seen)), (0, middle + 1), (middle, len(seen))) if part[1] - part[0] > 1]
    broken = {part: _broken(_between(few, *part), declared, rounding_dn) for part in parts}
    told = {part: pixels for part, pixels in broken.items() if np.count_nonzero(pixels) >= FEWEST_BROKEN}
    repairs = list(_repairs(window, seen, declared)) if told else []
    return [
        _tried(window.span.index, few, part, pixels, repairs, declared, rounding_dn) for part, pixels in told.items()
    ]


def causes_by_undoing(tried: Sequence[Trial], facts: Facts) -> tuple[Suspect, ...]:
    """Return the causes whose undoing mends a part, that which mends most; nothing where none mends enough.

    A repair that leaves more pixels broken than the best one is less probable by exp(-1) for each twentieth of them.
    Frames that were moved or turned have the effect of events that were. Where all that is broken in earnest stays so,
    a few pixels at the end of a file that some repair mends are chance.
    """
    told = [one for one in tried if one.best >= MENDED * one.broken]
    if nothing_mends(tried):
        return ()
    if not told:
        return _clearly_best(tried, facts)
    trial = max(told, key=lambda one: one.best)
    fair = max(1.0, 0.05 * trial.broken)
    weights = {one: _SURE * exp((one.pixels - trial.best) / fair) for one in trial.repairs}
    later = _LATER_STILL * max(weight for one, weight in weights.items() if one.cause == "spatial_offset")
    return (
        *(suspect for one, weight in weights.items() for suspect in _suspects(one, weight, facts)),
        *_suspects(Mended("time_offset", 0), later, facts),
    )


def _clearly_best(tried: Sequence[Trial], facts: Facts) -> tuple[Suspect, ...]:
    """Return the cause whose undoing mends most over all windows, by far; nothing where none does.

    In noise, pixels that spurious events break are mended by nothing, so that the right repair falls short of
    ``MENDED``. A wrong one that mends by chance is followed closely by another wrong one, or by one of its kind in
    another window.
    """
    whole: dict[int, Trial] = {}
    for one in tried:
        if one.window not in whole or one.broken > whole[one.window].broken:
            whole[one.window] = one
    broken = sum(one.broken for one in whole.values())
    mended: Counter[str] = Counter()
    for one in whole.values():
        mended.update({repair.cause: max(repair.pixels, 0) for repair in one.repairs})
    (cause, most), (_, next_best), *_ = (*mended.most_common(2), ("", 0), ("", 0))
    if broken < ENOUGH_BROKEN or most < broken / 2 or most < _BY_FAR * next_best:
        return ()
    best = max((r for one in whole.values() for r in one.repairs if r.cause == cause), key=lambda repair: repair.pixels)
    return _suspects(best, _SURE * most / broken, facts)


def nothing_mends(tried: Sequence[Trial]) -> bool:
    """Whether some window that tells is broken in both halves, and no repair mends even half of any part that tells.

    A loss at one instant breaks one half only.
    """
    telling = [one for one in tried if one.broken >= ENOUGH_BROKEN]
    parts = Counter(one.window for one in tried)
    throughout = any(parts[one.window] == _PARTS for one in telling)
    return throughout and all(one.best < one.broken / 2 for one in telling)


def _suspects(one: Mended, weight: float, facts: Facts) -> tuple[Suspect, ...]:
    of_events, of_frames = whose_offset(one.size or 0.0, facts) if one.cause == "time_offset" else _EVENTS_OR_FRAMES
    events = Suspect(one.cause, "events", weight * of_events / max(of_events, of_frames), one.size)
    if one.cause not in _OF_FRAMES_TOO:
        return (events,)
    against = None if one.size is None else -one.size
    return events, Suspect(one.cause, "rgb", weight * of_frames / max(of_events, of_frames), against)


_EVENTS_OR_FRAMES: Final = (0.9, 0.8)
_OF_FRAMES_TOO: Final = frozenset({"mirrored", "spatial_offset", "time_offset"})


def _tried(
    window: int,
    seen: SeenFrames,
    part: tuple[int, int],
    before: Bool,
    repairs: Sequence[_Repair],
    declared: EventModel,
    rounding_dn: float,
) -> Trial:
    best: dict[str, Mended] = {}
    for repair in repairs:
        after = _broken(_between(replace(seen, counts=repair.counts), *part), declared, rounding_dn)
        mended = most_mended(before, np.where(repair.known, after, before), repair.symmetry)
        if repair.cause not in best or mended > best[repair.cause].pixels:
            best[repair.cause] = Mended(repair.cause, mended, repair.size)
    return Trial(window, int(np.count_nonzero(before)), tuple(best.values()))


def _repairs(window: Window, seen: SeenFrames, declared: EventModel) -> Iterator[_Repair]:
    """Yield the counts of events with each fault undone."""
    everywhere = np.ones(seen.counts.shape[2:], np.bool_)
    yield _repair("polarity_inverted", seen.counts[:, ::-1], everywhere)
    for left, up in ((True, False), (False, True), (True, True)):
        mirrored = seen.counts[..., :: -1 if up else 1, :: -1 if left else 1]
        yield _repair("mirrored", mirrored, everywhere, symmetry=(False, left, up))
    yield _repair("axes_swapped", *_swapped(seen.counts), symmetry=(True, False, False))
    for right_px, down_px in _likely_shifts(seen, declared):
        along = float(right_px) if down_px == 0 else None
        yield _repair("spatial_offset", *_moved_back(seen.counts, right_px, down_px), size=along)
    for late_ms in _DELAYS_MS:
        yield _repair("time_offset", _on_time(window, seen, round(late_ms * NS_PER_MS)), everywhere, size=late_ms)


def _on_time(window: Window, seen: SeenFrames, late_ns: int) -> Counts:
    """Return the counts of events that are late by so much; as they are where the file would have to go on longer.

    An interval that no event can have been moved from would be emptied, and nothing that contradicts a frame be left.
    """
    events, scan = sensor_events(window), window.facts.events
    counts = np.zeros_like(seen.counts)
    count_between_frames(events.x, events.y, events.times_ns - late_ns, events.p, seen.times_ns, counts)
    if scan is None:
        return counts
    begins_ns, ends_ns = seen.times_ns[:-1] + late_ns, seen.times_ns[1:] + late_ns
    untold = (begins_ns < scan.first_ns - _END_NS) | (ends_ns > scan.last_ns + _END_NS)
    counts[untold] = seen.counts[untold]
    return counts


def _repair(
    cause: str, counts: Counts, known: Bool, *, symmetry: Symmetry = UPRIGHT, size: float | None = None
) -> _Repair:
    return _Repair(cause, _thinned(counts), _thinned(known), symmetry, size)


def _swapped(counts: Counts) -> tuple[Counts, Bool]:
    """Exchange the axes in the square that both orders share, and return where (h, w) that is."""
    side = min(counts.shape[2:])
    swapped, known = np.zeros_like(counts), np.zeros(counts.shape[2:], np.bool_)
    swapped[..., :side, :side] = counts[..., :side, :side].swapaxes(2, 3)
    known[:side, :side] = True
    return swapped, known


def _moved_back(counts: Counts, right_px: int, down_px: int) -> tuple[Counts, Bool]:
    """Return the counts as they were before they were moved, and where (h, w) they came from the sensor."""
    height, width = counts.shape[2:]
    rows, columns = np.arange(height) + down_px, np.arange(width) + right_px
    known = ((rows >= 0) & (rows < height))[:, np.newaxis] & (columns >= 0) & (columns < width)
    moved = counts[:, :, rows.clip(0, height - 1)][..., columns.clip(0, width - 1)]
    return moved, known


def _likely_shifts(seen: SeenFrames, declared: EventModel) -> list[tuple[int, int]]:
    """Return the shifts, right and down, at which events go best with the changes of the frames; none is no shift."""
    levels, lit = signal(seen, declared)
    signed = declared.threshold_on * seen.counts[:, 1] - declared.threshold_off * seen.counts[:, 0]
    usable = lit[:-1] & lit[1:]
    changes = np.where(usable, np.diff(levels, axis=0), 0.0)
    patch = np.sum([cross_correlation(*each) for each in zip(changes, signed, usable, strict=True)], axis=0)
    patch[RADIUS_PX, RADIUS_PX] = -np.inf
    highest = np.argsort(-patch, axis=None)[:_PEAKS]
    return [(int(column) - RADIUS_PX, int(row) - RADIUS_PX)
            for row, column in zip(*np.unravel_index(highest, patch.shape), strict=True)]  # fmt: skip


def _broken(seen: SeenFrames, declared: EventModel, rounding_dn: float) -> Bool:
    nowhere = np.zeros(seen.counts.shape[2:], np.bool_)
    stretch = join(seen, declared, rounding_dn, nowhere)
    return violations(stretch, EVEN, declared, phase_known=False)[0]


def most_mended(before: Bool, after: Bool, symmetry: Symmetry = UPRIGHT) -> int:
    """Return by how much fewer pixels (h, w) are broken after than before, in the rectangle of tiles of most.

    Events that a ``symmetry`` moves to the other side of the image break the law there if they do not belong there:
    rectangles are those that it leaves in their place.
    """
    gain = before.astype(np.int64) - after
    rows, columns = (np.linspace(0, size, GRID + 1).round().astype(int) for size in gain.shape)
    sums = np.pad(gain.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))[np.ix_(rows, columns)]
    swap, left, up = symmetry
    edges = list(combinations(range(GRID + 1), 2))
    return max(
        int(sums[bottom, right] - sums[top, right] - sums[bottom, first] + sums[top, first])
        for top, bottom in edges
        for first, right in edges
        if not (left and first + right != GRID)
        and not (up and top + bottom != GRID)
        and not (swap and (top, bottom) != (first, right))
    )


def _between(seen: SeenFrames, first: int, stop: int) -> SeenFrames:
    """Return the frames from ``first`` to before ``stop``, and the events between them."""
    frames, counts = slice(first, stop), seen.counts[first : stop - 1]
    images = (seen.sharp_dn[frames], seen.even_dn[frames], seen.error_dn[frames])
    return SeenFrames(seen.frames[frames], seen.times_ns[frames], *images, counts)


def _thinned(image: Pixels) -> Pixels:
    """Return every so many pixels of the last two axes, (h, w)."""
    step = ceil(sqrt(max(image.shape[-1] * image.shape[-2] / _SEEN_PX, 1.0)))
    return cast(Pixels, np.ascontiguousarray(image[..., ::step, ::step]))

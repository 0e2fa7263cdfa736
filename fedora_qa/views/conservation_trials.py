"""How many violations of conservation an inverse transform of the events resolves: tried where the law is violated.

The law of conservation is certain, so a wrong transform violates it at other pixels as often as it resolves violations.
Counted is the number of resolved violations less that of new ones, in the rectangle of tiles where the difference is
largest: a fault of a part of the image is resolved in that part only. A window is tried as a whole and by halves, as a
fault may begin or end within it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from math import ceil, sqrt
from typing import Any, Final, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS
from fedora_qa.estimators.events.pixels import count_between_frames
from fedora_qa.estimators.events.shift import RADIUS_PX, cross_correlation
from fedora_qa.features import Feature
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import ROUNDING_DN, ResampledFrames, resampled_frames, signal
from fedora_qa.views.frame_runs import EVEN, join, violations
from fedora_qa.views.sensor_events import GRID, sensor_events

Bool = NDArray[np.bool_]
Counts = NDArray[np.int32]
Edges = NDArray[np.intp]
Symmetry = tuple[bool, bool, bool]
"""Whether axes are exchanged, columns mirrored, rows mirrored."""
Transform = Literal["invert_polarity", "mirror", "swap_axes", "shift", "delay"]
"""What is done to the events: polarities, columns or rows, axes, coordinates or timestamps."""

UPRIGHT: Final = (False, False, False)

Pixels = TypeVar("Pixels", bound=NDArray[Any])

FEWEST_VIOLATIONS: Final = 10
"""Violations of a part below which a transform resolves most of them by chance."""

_TRIED_PX: Final = 12_000
"""Pixels that are tried, evenly spread: more would add little on a fault that moves or turns a part of the image."""

_FIRST_WINDOWS: Final = 8
_WINDOW_STEP: Final = 8
"""The first windows are tried, and every eighth of the others. The choice must not depend on the result of other
windows."""

_DELAYS_MS: Final = tuple(float(delay_ms) for delay_ms in range(-30, 31, 2) if delay_ms)
"""Delays that are tried, ms, up to the halo of a window. A delay that is wrong by 1 ms still resolves most
violations."""

_END_NS: Final = 2 * NS_PER_MS
"""Largest time from an end of the events to the next frame: one step of the list of delays, ns."""

_PEAKS: Final = 3
"""Shifts that are tried: the highest values of the cross-correlation."""


@dataclass(frozen=True, slots=True)
class Resolution:
    """Violations that an inverse transform resolves, net.

    Attributes
    ----------
    transform
        What was done to the events.
    pixels
        Violations that are resolved less violations that are new.
    size
        Size of the fault that the transform would undo: px to the right for ``shift``, ms of delay for ``delay``. None
        where the transform has no size or the shift is not along the columns.
    """

    transform: Transform
    pixels: int
    size: float | None = None


@dataclass(frozen=True, slots=True)
class InverseTrial(Feature):
    """A part of a window: how many of the tried pixels violate the law, and the best resolution by transform.

    Attributes
    ----------
    window
        Number of the window.
    violations
        Number of tried pixels of the part that violate the law.
    resolutions
        The best resolution of each transform.
    """

    window: int
    violations: int
    resolutions: tuple[Resolution, ...]

    @property
    def best(self) -> int:
        """Violations that the best transform resolves."""
        return max(resolution.pixels for resolution in self.resolutions)


@dataclass(frozen=True, slots=True)
class _TransformedCounts:
    """Counts (n - 1, 2, h, w) of events after an inverse transform; ``defined`` (h, w) where there are such.

    Both are of the pixels that are tried. ``symmetry`` is how events were moved across the image.
    """

    transform: Transform
    counts: Counts
    defined: Bool
    symmetry: Symmetry = UPRIGHT
    size: float | None = None


def is_tried(window: Window) -> bool:
    """Whether inverse transforms are tried in a window, if it violates the law."""
    return window.span.index < _FIRST_WINDOWS or window.span.index % _WINDOW_STEP == 0


def inverse_trials(window: Window) -> list[InverseTrial]:
    """Try inverse transforms on a window and on its halves.

    Returns
    -------
    list[InverseTrial]
        A trial for each part with ``FEWEST_VIOLATIONS`` or more. Empty for windows that are not tried, which are most
        windows beyond the first ones.
    """
    resampled, declared = resampled_frames(window), window.facts.declared.events
    if declared is None or len(resampled) < 2 or not is_tried(window):
        return []
    rounding_dn = ROUNDING_DN[window.facts.declared.transfer]
    images = (resampled.edge_aware_dn, resampled.uniform_dn, resampled.error_dn, resampled.counts)
    sampled = ResampledFrames(resampled.frames, resampled.times_ns, *(_every_few(image) for image in images))
    middle = len(resampled) // 2
    parts = [part for part in ((0, len(resampled)), (0, middle + 1), (middle, len(resampled))) if part[1] - part[0] > 1]
    before = {part: _violations(sampled, *part, declared, rounding_dn) for part in parts}
    broken = {part: pixels for part, pixels in before.items() if np.count_nonzero(pixels) >= FEWEST_VIOLATIONS}
    candidates = list(_transformed(window, resampled, declared)) if broken else []
    trials = []
    for part, pixels in broken.items():
        best: dict[Transform, Resolution] = {}
        for candidate in candidates:
            after = _violations(replace(sampled, counts=candidate.counts), *part, declared, rounding_dn)
            # Pixels without counts after the transform keep their state.
            net = most_resolved(pixels, np.where(candidate.defined, after, pixels), candidate.symmetry)
            if candidate.transform not in best or net > best[candidate.transform].pixels:
                best[candidate.transform] = Resolution(candidate.transform, net, candidate.size)
        trials.append(InverseTrial(window.span.index, int(np.count_nonzero(pixels)), tuple(best.values())))
    return trials


def most_resolved(before: Bool, after: Bool, symmetry: Symmetry = UPRIGHT) -> int:
    """Return by how much the number of violating pixels falls in the rectangle of tiles where it falls most.

    A ``symmetry`` moves events to the other side of the image, where they violate the law if they do not belong there.
    So only rectangles that the symmetry maps onto themselves are counted.

    Parameters
    ----------
    before, after
        (h, w) pixels that violate the law.
    symmetry
        Whether axes were exchanged, columns mirrored, rows mirrored.

    Returns
    -------
    int
        Pixels, negative where every rectangle has more violations than before.
    """
    # Signed integers: a pixel that is newly violated counts as -1.
    gain = before.astype(np.int64) - after
    rows, columns = (np.linspace(0, size, GRID + 1).round().astype(int) for size in gain.shape)
    # A summed-area table at the borders of tiles: the sum of any rectangle of tiles from its four corners.
    sums = np.pad(gain.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))[np.ix_(rows, columns)]
    top, bottom, left, right = _rectangles(symmetry)
    return int((sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]).max())


@cache
def _rectangles(symmetry: Symmetry) -> tuple[Edges, Edges, Edges, Edges]:
    """Return top, bottom, left and right, in tiles, of the rectangles (n,) that a symmetry maps onto themselves."""
    swap, mirrored_columns, mirrored_rows = symmetry
    edges = list(combinations(range(GRID + 1), 2))
    rectangles = [
        (top, bottom, left, right)
        for top, bottom in edges
        for left, right in edges
        if not (mirrored_columns and left + right != GRID)
        and not (mirrored_rows and top + bottom != GRID)
        and not (swap and (top, bottom) != (left, right))
    ]
    top, bottom, left, right = np.array(rectangles, dtype=np.intp).T
    return top, bottom, left, right


def _transformed(window: Window, resampled: ResampledFrames, declared: EventModel) -> Iterator[_TransformedCounts]:
    """Yield the counts of events after each inverse transform."""
    counts, (height, width) = resampled.counts, resampled.counts.shape[2:]
    everywhere = _every_few(np.ones((height, width), np.bool_))
    yield _TransformedCounts("invert_polarity", _every_few(counts[:, ::-1]), everywhere)
    for left, up in ((True, False), (False, True), (True, True)):
        mirrored = counts[..., :: -1 if up else 1, :: -1 if left else 1]
        yield _TransformedCounts("mirror", _every_few(mirrored), everywhere, (False, left, up))
    # Axes are exchanged in the square that both orders share.
    side = min(height, width)
    swapped, in_square = np.zeros_like(counts), np.zeros((height, width), np.bool_)
    swapped[..., :side, :side] = counts[..., :side, :side].swapaxes(2, 3)
    in_square[:side, :side] = True
    yield _TransformedCounts("swap_axes", _every_few(swapped), _every_few(in_square), (True, False, False))
    # The shifts, right and down, at which events correlate best with the frames, without the shift of 0 px.
    levels, lit = signal(resampled, declared)
    # Change of the signal by the events, E = C+ n+ - C- n-, as the declared model states it.
    signed = declared.threshold_on * resampled.counts[:, 1] - declared.threshold_off * resampled.counts[:, 0]
    usable = lit[:-1] & lit[1:]
    changes = np.where(usable, np.diff(levels, axis=0), 0.0)
    patch = np.sum([cross_correlation(*each) for each in zip(changes, signed, usable, strict=True)], axis=0)
    # A shift of 0 px leaves the events as stored.
    patch[RADIUS_PX, RADIUS_PX] = -np.inf
    highest = np.argsort(-patch, axis=None)[:_PEAKS]
    likely_shifts = [(int(column) - RADIUS_PX, int(row) - RADIUS_PX)
            for row, column in zip(*np.unravel_index(highest, patch.shape), strict=True)]  # fmt: skip
    for right_px, down_px in likely_shifts:
        rows, columns = np.arange(height) + down_px, np.arange(width) + right_px
        # Pixels whose events would have to come from beyond the sensor have none.
        from_sensor = ((rows >= 0) & (rows < height))[:, np.newaxis] & (columns >= 0) & (columns < width)
        moved = counts[:, :, rows.clip(0, height - 1)][..., columns.clip(0, width - 1)]
        size = float(right_px) if down_px == 0 else None
        yield _TransformedCounts("shift", _every_few(moved), _every_few(from_sensor), size=size)
    events, scan = sensor_events(window), window.facts.events
    for delay_ms in _DELAYS_MS:
        delay_ns = round(delay_ms * NS_PER_MS)
        advanced = np.zeros_like(resampled.counts)
        count_between_frames(events.x, events.y, events.times_ns - delay_ns, events.p, resampled.times_ns, advanced)
        if scan is not None:
            # Intervals beyond the ends of the file keep their own events: the delay would leave them without events,
            # and without events no frame is contradicted.
            start_ns, stop_ns = resampled.times_ns[:-1] + delay_ns, resampled.times_ns[1:] + delay_ns
            beyond_file = (start_ns < scan.first_ns - _END_NS) | (stop_ns > scan.last_ns + _END_NS)
            advanced[beyond_file] = counts[beyond_file]
        yield _TransformedCounts("delay", _every_few(advanced), everywhere, size=delay_ms)


def _violations(resampled: ResampledFrames, first: int, stop: int, declared: EventModel, rounding_dn: float) -> Bool:
    """Return the pixels (h, w) that violate the law over the frames from ``first`` to before ``stop``."""
    part, counts = slice(first, stop), resampled.counts[first : stop - 1]
    images = (resampled.edge_aware_dn[part], resampled.uniform_dn[part], resampled.error_dn[part])
    frames = ResampledFrames(resampled.frames[part], resampled.times_ns[part], *images, counts)
    nowhere = np.zeros(resampled.counts.shape[2:], np.bool_)
    run = join(frames, declared, rounding_dn, nowhere, only_even=True)
    return violations(run, EVEN, declared, phase_declared=False)[0]


def _every_few(image: Pixels) -> Pixels:
    """Return every so many pixels of the last two axes, (h, w), that ``_TRIED_PX`` or a few more are left."""
    step = ceil(sqrt(max(image.shape[-1] * image.shape[-2] / _TRIED_PX, 1.0)))
    return cast(Pixels, np.ascontiguousarray(image[..., ::step, ::step]))

"""Inverse transforms of the fields of one rate, or of all, tried on a common interval in which two rates disagree."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_chains import Chain, ComposedPaths, FieldTransform, Segment, compose, exists
from fedora_qa.views.flow_comparison import equal_bits
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_rate_agreement import FEWEST_PIXELS, compared_pixels, median_error_px, path_starts

Float64 = NDArray[np.float64]

_FEWEST_OFF: Final = 4 * FEWEST_PIXELS
"""Pixels from which on those that are off are tried alone: a quarter of them may leave the image."""

_EVERY: Final = 4
"""Of pixels that are off all over the image every fourth is tried."""

_SAME_GAIN: Final = 0.02
"""Relative distance to a change of unit below which a gain is that change of unit."""

COPIES: Final = ("field_of_another_rate", "repeated_field")
"""Transforms that compare fields bit for bit: they remove all of the error or none, since no chance makes copies."""

_TRANSFORMS: Final[tuple[tuple[str, FieldTransform], ...]] = (
    ("negated", lambda flow_px: -flow_px),
    ("transposed_axes", lambda flow_px: flow_px[..., ::-1]),
    ("flipped_v", lambda flow_px: flow_px * np.array([1, -1], dtype=flow_px.dtype)),
    ("mirrored", lambda flow_px: flow_px[:, ::-1]),
    ("mirrored", lambda flow_px: flow_px[::-1]),
)
"""Transforms of a whole field (H, W, 2): of its values, or of the grid that they lie on."""


@dataclass(frozen=True, slots=True)
class _TransformResidual:
    """A transform of one rate, or of ``flow``, and the median error in px that remains after it."""

    stream: str
    transform: str
    residual_px: float
    magnitude: float | None = None


def try_inverse_transforms(window: Window, segment: Segment) -> list[ConventionTrial]:
    """Try transforms of either rate, and of both, on one segment: the share of the error that each removes.

    Parameters
    ----------
    segment
        A common interval of two rates that are off.

    Returns
    -------
    The best trial of each transform and stream; ``rate`` and ``stream`` are both the rate that was transformed.
    """
    columns, rows = _pixels_off(window, segment)
    slow, fast = (compose(window, chain, columns, rows) for chain in (segment.slow, segment.fast))
    # The flow itself bounds the error that a transform can remove, so that dividing arbitrary values explains nothing.
    moved_px = np.linalg.norm(slow.displacement_px[slow.clear], axis=-1)
    reference_px = min(median_error_px(slow, fast), float(np.median(moved_px)) if len(moved_px) else np.inf)
    best: dict[tuple[str, str], ConventionTrial] = {}
    for residual in (
        *_of_either_rate(window, segment, slow, fast, (columns, rows)),
        *_of_both_rates(window, segment, (columns, rows)),
    ):
        removed_share = max(1.0 - residual.residual_px / reference_px, 0.0) if reference_px > 0 else 0.0
        stream, transform = residual.stream, residual.transform
        if (stream, transform) not in best or best[stream, transform].removed_share < removed_share:
            best[stream, transform] = ConventionTrial(stream, transform, stream, removed_share, residual.magnitude)
    return list(best.values())


def _pixels_off(window: Window, segment: Segment) -> tuple[Float64, Float64]:
    """Return pixels of the lattice that are off, where they are few: a fault of a part of the image. All otherwise."""
    columns, rows = path_starts(window, segment)
    slow, fast = (compose(window, chain, columns, rows) for chain in (segment.slow, segment.fast))
    compared = compared_pixels(slow, fast)
    # Pixels that were not compared get 0 on both sides, and so do not count as off.
    apart_px = np.where(compared[:, None], slow.displacement_px - fast.displacement_px, 0.0)
    off = np.linalg.norm(apart_px, axis=-1) > np.where(compared, slow.bound_px + fast.bound_px, 0.0)
    if _FEWEST_OFF <= np.count_nonzero(off) < 0.5 * np.count_nonzero(compared):
        return columns[off], rows[off]
    return columns[::_EVERY], rows[::_EVERY]


def _of_either_rate(
    window: Window, segment: Segment, slow: ComposedPaths, fast: ComposedPaths, pixels: tuple[Float64, Float64]
) -> Iterator[_TransformResidual]:
    """Transform one rate and leave the other."""
    for chain, own, other in ((segment.slow, slow, fast), (segment.fast, fast, slow)):
        stream = chain.stream
        interval_s = (segment.end_ns - segment.start_ns) / len(chain.rows) / NS_PER_S
        residual_of = partial(_TransformResidual, stream)
        for transform, change in _TRANSFORMS:
            yield residual_of(transform, median_error_px(compose(window, chain, *pixels, change), other))
        for shift in (-1, 1):
            neighbour = chain.shifted(shift)
            if exists(window.facts, neighbour):
                residual_px = median_error_px(compose(window, neighbour, *pixels), other)
                yield residual_of("neighbouring_interval", residual_px, float(shift))
        for factor in _factors(interval_s, own, other):
            gain = factor - 1
            units = (interval_s, 1 / interval_s) if interval_s > 0 else ()
            # Flow in px/s or px s is off by the interval or its reciprocal: near these a factor is a unit, not a gain.
            unit = next((unit for unit in units if abs((1 + gain) / unit - 1) < _SAME_GAIN), None)
            residual_px = median_error_px(compose(window, chain, *pixels, _division_by(factor)), other)
            if unit is None:
                yield residual_of("scaled", residual_px, 100 * gain)
            else:
                yield residual_of("another_unit", residual_px, unit)
        # A copy is exact: it explains all of the error or none (COPIES).
        yield residual_of("field_of_another_rate", 0.0 if _holds_field_of_another_rate(window, chain) else np.inf)
        repetitions = _count_repetitions(window, chain)
        yield residual_of("repeated_field", 0.0 if repetitions else np.inf, float(repetitions))


def _of_both_rates(window: Window, segment: Segment, pixels: tuple[Float64, Float64]) -> Iterator[_TransformResidual]:
    """Transform both rates alike."""
    for transform, change in _TRANSFORMS:
        slow, fast = (compose(window, chain, *pixels, change) for chain in (segment.slow, segment.fast))
        yield _TransformResidual("flow", transform, median_error_px(slow, fast))


def _division_by(factor: float) -> Callable[[NDArray[np.float32]], NDArray[np.floating]]:
    return lambda flow_px: flow_px / np.float32(factor)


def _factors(interval_s: float, own: ComposedPaths, other: ComposedPaths) -> Iterator[float]:
    """Yield factors by which a rate may be too large: a change of unit, and the one that fits."""
    yield from (interval_s, 1 / interval_s) if interval_s > 0 else ()
    compared = compared_pixels(own, other)
    own_px, other_px = own.displacement_px[compared], other.displacement_px[compared]
    # Least squares of own = factor * other over all components.
    square = float(np.sum(other_px**2))
    factor = float(np.sum(own_px * other_px)) / square if square > 0 else 0.0
    yield from (factor,) if factor > 0 else ()


def _holds_field_of_another_rate(window: Window, chain: Chain) -> bool:
    """Whether the chain's first field equals the field of another rate at its start or row."""
    row = chain.rows[0]
    own, start_ns = window.flow_px(chain.stream, row), window.facts.clocks[chain.stream].times_ns[row]
    for stream in window.facts.flow_streams:
        starts_ns = window.facts.clocks[stream].times_ns
        if stream == chain.stream or not len(starts_ns):
            continue
        latest = max(int(np.searchsorted(starts_ns, start_ns, "right")) - 1, 0)
        candidates = (window.flow_px(stream, candidate) for candidate in {latest, min(row, len(starts_ns) - 1)})
        if any(equal_bits(own, candidate) for candidate in candidates):
            return True
    return False


def _count_repetitions(window: Window, chain: Chain) -> int:
    """Count the repetitions in the longest run of equal fields that touches the chain, up to a window beyond it."""
    reach = len(window.owned(chain.stream))
    first = max(chain.rows[0] - reach, 0)
    last = min(chain.rows[-1] + reach, len(window.facts.clocks[chain.stream].times_ns) - 1)

    def repeats(row: int) -> bool:
        if not first < row <= last:
            return False
        return equal_bits(window.flow_px(chain.stream, row), window.flow_px(chain.stream, row - 1))

    longest = 0
    for row in chain.rows:
        if repeats(row):
            after = next(later for later in range(row + 1, last + 2) if not repeats(later))
            before = next(earlier for earlier in range(row - 1, first - 1, -1) if not repeats(earlier))
            longest = max(longest, after - before - 1)
    return longest

"""The rates of flow against each other: short fields compose to long ones."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_S
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_axes import FLOW_AXES
from fedora_qa.views.flow_chains import (
    FEWEST_PIXELS,
    MOST_LOST,
    Chain,
    ComposedPaths,
    FieldTransform,
    MedianEndpointError,
    RateAgreement,
    Segment,
    compare_rates,
    compared_pixels,
    compose,
    exists,
    median_error_px,
    path_starts,
    segments,
)
from fedora_qa.views.flow_comparison import equal_bits
from fedora_qa.views.flow_conventions import ConventionTrial

Float64 = NDArray[np.float64]

RatePair = tuple[str, str]
"""Two rates, the slower one first."""

_MOST_FOLLOW_UPS: Final = 4


_FEWEST_OFF: Final = 4 * FEWEST_PIXELS
"""Least number of deviating pixels for a trial on these alone: a quarter of them suffices for a comparison."""

_EVERY: Final = 4
"""Step between the pixels of a trial where pixels deviate in the whole image."""

_SAME_GAIN: Final = 0.02
"""Relative distance to a change of unit below which a gain is that change of unit."""

COPIES: Final = ("field_of_another_rate", "repeated_field")
"""Transforms that compare fields bit for bit: they remove all of the error or none, because equal fields do not occur
by chance."""

_TRANSFORMS: Final[tuple[tuple[str, FieldTransform], ...]] = (
    *((name, axes.of) for name, axes in FLOW_AXES.items()),
    ("mirrored", lambda flow_px: flow_px[:, ::-1]),
    ("mirrored", lambda flow_px: flow_px[::-1]),
)
"""Transforms of a whole field (H, W, 2): of its values, or of their grid."""


@dataclass(frozen=True, slots=True)
class WindowComposition:
    """The common intervals that begin in a window.

    Attributes
    ----------
    window
        Number of the window.
    segments
        Compared intervals.
    not_compared
        Number of intervals that could not be compared.
    trials
        Trials of a follow-up.
    """

    window: int
    segments: tuple[RateAgreement, ...] = ()
    not_compared: int = 0
    trials: tuple[ConventionTrial, ...] = ()


@dataclass(frozen=True, slots=True)
class RatePairsOff(Feature):
    """Deviating common intervals of pairs of rates.

    Attributes
    ----------
    pair
        The compared pair.
    shares_off
        Share of deviating intervals of every pair, 0 to 1.
    """

    pair: RatePair
    shares_off: Mapping[RatePair, float]


@dataclass(frozen=True, slots=True)
class _TransformResidual:
    """A transform of one rate, or of ``flow``, and the median error in px that remains after it."""

    stream: str
    transform: str
    residual_px: float
    magnitude: float | None = None


class FlowRatesComposition(WindowCheck[WindowComposition]):
    """Does the composition of fields of a faster rate equal the field of a slower one?

    Each pixel is moved along the fields of both rates, from the start of a common interval to its end: five fields of
    50 Hz against one of 10 Hz, two of 50 Hz against one of 25 Hz, five of 25 Hz against two of 10 Hz. The error is the
    distance of the two endpoints in px: its median over the worst interval, and its median over the worst of 48 tiles.
    The share of pixels that leave the image by only one of the rates is measured too.

    Why it matters
    --------------
    The comparison needs neither depth nor pose nor frames. With three rates it determines which one is wrong, because
    the two others agree. It detects a rate that is stored under the name of another, and a single field at a wrong
    place.

    How
    ---
    Flow is interpolated bilinearly at pixels of a lattice, whose density depends on the effort. Paths within 4 px of
    discontinuities of the flow are left out. Paths are also left out if another surface moves across their intermediate
    point and occludes it or is occluded. For this test, every fourth pixel of a field (every eighth from 880,000 pixels
    on) is moved to its endpoint; two flows belong to different surfaces if they differ by more than 0.5 px, and by more
    than the flow's slope times their distance. After an alarm, the rate that disagrees with the others is named, and
    inverse transforms are applied to it (sign, axes, mirrors, unit, gain, neighbouring intervals, fields of another
    rate, repeated fields). Where few pixels deviate, these pixels alone are used.

    Noise model
    -----------
    The error has bounds, not a standard error. Each field of a path contributes a quarter of the second differences
    around the interpolated position (twice the bilinear error of a smooth surface), half of the third differences (the
    step between two surfaces), and single-precision rounding. All are multiplied by the flow's slope from field to
    field. A median error must not exceed the median of its bounds.

    Cannot detect
    -------------
    An error that all rates share and that composes, such as a rotated camera. Which of only two rates is wrong. Pixels
    that are occluded in between. Errors of timestamps, which only change which fields are compared.

    Sources
    -------
    First principles: Lagrange's remainder for the interpolation, ``geometry/rigid_flow.py`` for the rounding;
    derivation in ``estimators/flow/path_kernels.py``.
    """

    name = "flow_rates.composition"
    needs = ("flow",)

    def not_applicable(self, facts: Facts) -> str:
        """Require two rates."""
        return "" if len(facts.flow_streams) > 1 else "the file has only one rate of flow"

    def measure(self, window: Window) -> WindowComposition | None:
        """Compare every pair of rates over the intervals that begin in the window."""
        agreements, not_compared = [], 0
        # Streams are in the order of their rates: the slower one of each pair comes first.
        for slow, fast in combinations(window.facts.flow_streams, 2):
            for segment in segments(window, slow, fast):
                agreement = compare_rates(window, segment)
                agreements += [agreement] if agreement else []
                not_compared += agreement is None
        return WindowComposition(window.span.index, tuple(agreements), not_compared)

    def follow_up_windows(self, state: list[WindowComposition], facts: Facts) -> tuple[int, ...]:
        """Return the windows of the worst intervals that exceed their bounds."""
        worst = sorted(
            (-max((agreement.suspicion for agreement in summary.segments), default=0.0), summary.window)
            for summary in state
        )
        return tuple(window for suspicion, window in worst[:_MOST_FOLLOW_UPS] if suspicion < -1)

    def follow_up(self, state: list[WindowComposition], window: Window) -> None:
        """Try inverse transforms on the window's worst interval of each pair of rates."""
        of_window = [
            agreement for summary in state if summary.window == window.span.index for agreement in summary.segments
        ]
        trials: list[ConventionTrial] = []
        for group in _by_pair(of_window).values():
            worst = max(group, key=lambda agreement: agreement.suspicion)
            if worst.suspicion > 1:
                trials += try_inverse_transforms(window, worst.segment)
        state.append(WindowComposition(window.span.index, trials=tuple(trials)))

    def conclude(self, state: Sequence[WindowComposition], facts: Facts) -> Observation:
        """State the endpoint error of each pair of rates."""
        pairs = _by_pair([agreement for summary in state for agreement in summary.segments])
        count = sum(len(group) for group in pairs.values())
        not_compared = sum(summary.not_compared for summary in state)
        agreements = [agreement for group in pairs.values() for agreement in group]
        pixels_of_field = max((agreement.pixels_of_field for agreement in agreements), default=0)
        coverage = Coverage(
            sum(agreement.pixels_read for agreement in agreements),
            (count + not_compared) * pixels_of_field,
            "pixels of common intervals",
        )
        if not agreements:
            coverage = Coverage(0, not_compared, "common intervals")
        if not pairs:
            return Observation(coverage, unobservable="no two rates have a common interval of whole fields")
        trials = [trial for summary in state for trial in summary.trials]
        shares_off = {
            pair: sum(agreement.suspicion > 1 for agreement in group) / len(group) for pair, group in pairs.items()
        }
        statistics: list[Statistic] = []
        for pair, group in pairs.items():
            name = f"{pair[0]} by {pair[1].removeprefix('flow/')}"
            most_lost = max(group, key=lambda agreement: agreement.lost)
            of_pair = [
                Statistic(
                    name=f"{name} leaving",
                    value=most_lost.lost,
                    unit="share",
                    standard_error=0.0,
                    model_error_bound=MOST_LOST,
                    side="upper",
                    statement=f"{most_lost.lost:.0%} of the pixels leave the image by {pair[0]} or by {pair[1]}, "
                    "but not by both.",
                    code="flow_rates.composition.leaving",
                    where=_where(
                        [agreement for agreement in group if agreement.lost > MOST_LOST] or [most_lost], facts
                    ),
                )
            ]
            compared = [
                (agreement, agreement.whole, agreement.worst_tile)
                for agreement in group
                if agreement.whole and agreement.worst_tile
            ]
            if compared:
                whole = max(compared, key=lambda errors: errors[1].rank)
                tile = max(compared, key=lambda errors: errors[2].rank)
                off = [agreement for agreement, error, _ in compared if error.suspicion > 1]
                off_tile = [agreement for agreement, _, error in compared if error.suspicion > 1]
                extent = f"{len(off)} of {len(compared)} intervals deviate"
                of_pair += [
                    _error(f"{name} error", pair, whole[1], extent, "error", _where(off or [whole[0]], facts)),
                    _error(f"{name} worst_tile", pair, tile[2], "in the worst tile", "tile",
                           replace(_where(off_tile or [tile[0]], facts), tile=tile[0].tile)),
                ]  # fmt: skip
            features = (RatePairsOff(pair, shares_off), *trials)
            statistics += [replace(statistic, features=features) for statistic in of_pair]
        return Observation(coverage, tuple(statistics))


def _by_pair(agreements: Sequence[RateAgreement]) -> Mapping[RatePair, list[RateAgreement]]:
    pairs: dict[RatePair, list[RateAgreement]] = {}
    for agreement in sorted(agreements, key=lambda agreement: agreement.segment.start_ns):
        pairs.setdefault((agreement.segment.slow.stream, agreement.segment.fast.stream), []).append(agreement)
    return pairs


def _error(name: str, pair: RatePair, error: MedianEndpointError, extent: str, rule: str, where: Where) -> Statistic:
    return Statistic(
        name=name,
        value=error.typical_px,
        unit="px",
        standard_error=0.0,
        model_error_bound=error.bound_px,
        side="upper",
        statement=f"{pair[0]} differs by {error.typical_px:.3g} px from the composed fields of {pair[1]}; the bound by "
        f"interpolation is {error.bound_px:.1g} px; {extent}.",
        code=f"flow_rates.composition.{rule}",
        where=where,
    )


def _where(group: Sequence[RateAgreement], facts: Facts) -> Where:
    first, last = group[0].segment, group[-1].segment
    return Where(
        stream=first.slow.stream,
        start_us=facts.to_file_us(first.start_ns),
        stop_us=facts.to_file_us(last.end_ns),
        index_start=first.slow.rows[0],
        index_stop=last.slow.rows[-1] + 1,
    )


def try_inverse_transforms(window: Window, segment: Segment) -> list[ConventionTrial]:
    """Apply transforms to either rate, and to both, on one segment, with the share of the error that each removes.

    Parameters
    ----------
    segment
        A deviating common interval of two rates.

    Returns
    -------
    list[ConventionTrial]
        The best trial of each transform and stream; ``rate`` and ``stream`` are both the transformed rate.
    """
    columns, rows = path_starts(window, segment)
    slow, fast = (compose(window, chain, columns, rows) for chain in (segment.slow, segment.fast))
    compared = compared_pixels(slow, fast)
    # Pixels that were not compared get 0 on both sides, and so do not deviate.
    apart_px = np.where(compared[:, None], slow.displacement_px - fast.displacement_px, 0.0)
    off = np.linalg.norm(apart_px, axis=-1) > np.where(compared, slow.bound_px + fast.bound_px, 0.0)
    # Few deviating pixels are used alone: a fault of a part of the image.
    if _FEWEST_OFF <= np.count_nonzero(off) < 0.5 * np.count_nonzero(compared):
        columns, rows = columns[off], rows[off]
    else:
        columns, rows = columns[::_EVERY], rows[::_EVERY]
    slow, fast = (compose(window, chain, columns, rows) for chain in (segment.slow, segment.fast))
    # The flow itself bounds the error that a transform can remove: a division by a large factor removes no more.
    moved_px = np.linalg.norm(slow.displacement_px[slow.clear], axis=-1)
    reference_px = min(median_error_px(slow, fast), float(np.median(moved_px)) if len(moved_px) else np.inf)
    best: dict[tuple[str, str], ConventionTrial] = {}
    for residual in _transform_residuals(window, segment, slow, fast, (columns, rows)):
        removed_share = max(1.0 - residual.residual_px / reference_px, 0.0) if reference_px > 0 else 0.0
        stream, transform = residual.stream, residual.transform
        if (stream, transform) not in best or best[stream, transform].removed_share < removed_share:
            best[stream, transform] = ConventionTrial(stream, transform, stream, removed_share, residual.magnitude)
    return list(best.values())


def _transform_residuals(
    window: Window, segment: Segment, slow: ComposedPaths, fast: ComposedPaths, pixels: tuple[Float64, Float64]
) -> Iterator[_TransformResidual]:
    """Yield the residuals of transforms of one rate against the other as stored, and of transforms of both rates."""
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
        # A rate may be too large by a change of unit, or by the factor that fits: least squares of own = factor * other
        # over all components.
        compared = compared_pixels(own, other)
        own_px, other_px = own.displacement_px[compared], other.displacement_px[compared]
        square = float(np.sum(other_px**2))
        fitted = float(np.sum(own_px * other_px)) / square if square > 0 else 0.0
        units = (interval_s, 1 / interval_s) if interval_s > 0 else ()
        for factor in (*units, fitted) if fitted > 0 else units:
            gain = factor - 1
            # Flow in px/s or px s is wrong by the interval or its reciprocal: near these a factor is a unit, not a
            # gain.
            unit = next((unit for unit in units if abs((1 + gain) / unit - 1) < _SAME_GAIN), None)
            residual_px = median_error_px(compose(window, chain, *pixels, _division_by(factor)), other)
            if unit is None:
                yield residual_of("scaled", residual_px, 100 * gain)
            else:
                yield residual_of("another_unit", residual_px, unit)
        # The fields of other rates that the chain's first may be a copy of: at its start, and of its row.
        first, clocks = chain.rows[0], window.facts.clocks
        candidates: list[tuple[str, int]] = []
        for rate in window.facts.flow_streams:
            starts_ns = clocks[rate].times_ns
            if rate != stream and len(starts_ns):
                latest = max(int(np.searchsorted(starts_ns, clocks[stream].times_ns[first], "right")) - 1, 0)
                candidates += [(rate, row) for row in {latest, min(first, len(starts_ns) - 1)}]
        field_px = window.flow_px(stream, first)
        is_copy = any(equal_bits(field_px, window.flow_px(rate, row)) for rate, row in candidates)
        # A copy is exact: it removes all of the error or none (COPIES).
        yield residual_of("field_of_another_rate", 0.0 if is_copy else np.inf)
        repetitions = _count_repetitions(window, chain)
        yield residual_of("repeated_field", 0.0 if repetitions else np.inf, float(repetitions))
    for transform, change in _TRANSFORMS:
        changed = (compose(window, chain, *pixels, change) for chain in (segment.slow, segment.fast))
        yield _TransformResidual("flow", transform, median_error_px(*changed))


def _division_by(factor: float) -> Callable[[NDArray[np.float32]], NDArray[np.floating]]:
    return lambda flow_px: flow_px / np.float32(factor)


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

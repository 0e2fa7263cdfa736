"""Each depth frame against the next: the same surfaces from the position that the pose gives."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Notice, Observation, Statistic, WindowCheck
from fedora_qa.estimators.depth.pair_fit import DepthFit
from fedora_qa.estimators.depth.warp import DepthLattice, WarpedLattice
from fedora_qa.estimators.fitting.quantile_kernels import median_of
from fedora_qa.estimators.fitting.robust import sensitivity_range
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.depth_conventions import PairTrials, try_conventions
from fedora_qa.views.depth_pairs import DepthPair, owned_pairs, pixels_of_pairs, where_of_frames, why_no_geometry
from fedora_qa.views.flow_comparison import is_noisy

Float64 = NDArray[np.float64]

_MOST_FOLLOW_UPS: Final = 4

_TILES: Final = (8, 6)
"""Tiles across and down: large enough that each holds a surface, small enough to detect a wrong corner of the image."""

_FEWEST_IN_TILE: Final = 20
"""Least number of pixels of a tile: a median of noise over so many exceeds twice its bound in no file."""

_PERCENT: Final = 100.0


@dataclass(frozen=True, slots=True)
class PairsOff(Feature):
    """Pairs of depth frames that exceed their bounds.

    Attributes
    ----------
    off
        Number of pairs with a residual above its bound.
    compared
        Number of compared pairs.
    repeated
        Number of deviating pairs whose frames are equal bit for bit.
    """

    off: int
    compared: int
    repeated: int


@dataclass(frozen=True, slots=True)
class MotionCorrections(Feature):
    """Corrections of the motion against their declared noise.

    Attributes
    ----------
    variance_ratio
        Mean square of the corrections over their declared variance.
    """

    variance_ratio: float


@dataclass(frozen=True, slots=True)
class DepthDeviation:
    """A median absolute residual of inverse depth, relative to the depth.

    Attributes
    ----------
    typical
        The median residual, a share of the depth.
    bound
        Median of the bounds of the residuals, likewise.
    """

    typical: float
    bound: float

    @property
    def excess(self) -> float:
        """Ratio of the residual to its bound: above 1 most pixels exceed their bounds."""
        return self.typical / self.bound

    @property
    def rank(self) -> tuple[float, float]:
        """Key by which the worst of several is chosen: by excess over the bound, within the bounds by their ratio.

        Whether a deviation is material follows from its excess, and not from its ratio to a bound.
        """
        return max(self.typical - self.bound, 0.0), self.excess


@dataclass(frozen=True, slots=True)
class PairAgreement:
    """Comparison of one pair of frames.

    Attributes
    ----------
    first, second
        Rows of the depth stream.
    whole, worst_tile, tile
        Deviation over all compared pixels; that of the tile with the largest excess; and this tile: left, top, right,
        bottom, px, or None without one.
    bounds_of_tiles
        Lowest and highest bound of a tile.
    pixels, pixels_read
        Number of compared pixels, and of those of the lattice, clear of edges, whether they could be compared or not.
    noise_square, noise_dof
        chi^2 of the correction of the motion under its declared noise, and its degrees of freedom; 0 where none is
        declared or estimated.
    repeats
        Whether the pair deviates and its frames are equal bit for bit.
    """

    first: int
    second: int
    whole: DepthDeviation
    worst_tile: DepthDeviation
    tile: tuple[int, int, int, int] | None
    bounds_of_tiles: tuple[float, float]
    pixels: int
    pixels_read: int
    noise_square: float
    noise_dof: float
    repeats: bool

    @property
    def excess(self) -> float:
        """Above 1 where the pair or a tile exceeds its bound, or the correction ten times the variance of the noise."""
        by_noise = self.noise_square / (10 * self.noise_dof) if self.noise_dof > 0 else 0.0
        return max(self.whole.excess, self.worst_tile.excess, by_noise)


@dataclass(frozen=True, slots=True)
class WindowAgreement:
    """The pairs of a window.

    Attributes
    ----------
    window
        Number of the window.
    pairs
        Compared pairs.
    without_pose
        Number of pairs that no pose covers.
    too_few_pixels
        Number of pairs that share too few pixels.
    not_fitted
        Number of pairs whose fit of the motion does not converge.
    trials
        Trials of a follow-up.
    """

    window: int
    pairs: tuple[PairAgreement, ...] = ()
    without_pose: int = 0
    too_few_pixels: int = 0
    not_fitted: int = 0
    trials: tuple[PairTrials, ...] = ()


class DepthConsistency(WindowCheck[WindowAgreement]):
    """Does each depth frame, moved by the camera's motion, agree with the next?

    The median deviation of the worst pair of frames, and of the worst of 48 tiles of any pair, in percent of the depth;
    and the size of the correction of the motion that fits each pair.

    Why it matters
    --------------
    Flow, scene flow and every reprojection use depth and pose together. If one of them belongs to another time, another
    unit or another camera, this comparison detects it without any image.

    How
    ---
    Pixels of a frame are moved by the relative motion of the poses into the next frame, whose inverse depth is
    interpolated bilinearly there (exact on planes). Pixels near edges and near the border are left out in both frames:
    within 4 px, plus the distance by which the nearest surface may have moved against them. Occluded pixels are thereby
    left out without use of the residual. Only after an alarm, the inverses of convention faults are applied one by one
    to deviating pairs: units, rays, mirrors, shifts, exchanged and frozen frames, late timestamps, conventions of the
    pose. The share of the residual that an inverse removes is its weight.

    Noise model
    -----------
    Each pixel has a bound, which is the sum of: rounding to float32; half a step where depths are quantised; a quarter
    of the second differences of the inverse depth around the pixel in both frames (twice Lagrange's bilinear error of a
    smooth surface; for white noise about twice its spread); the interpolation of the pose where timestamps lie between
    its samples, and half a step of each stored component of both poses, less what the fit of the motion within its
    declared noise removes of them. A median must not exceed the
    median of its bounds. Where the file declares pose noise, a correction of the motion is fitted to each pair. The
    correction must have the size that the declared noise implies: its square is chi-square, and is made normal by the
    cube root. Bounds include the effect of the last step of the fit. A pair whose fit neither converges nor agrees has
    no estimate of its motion. It counts only if its residuals before the correction exceed their bounds by more than
    five standard deviations of the noise explain.

    Cannot detect
    -------------
    An error that changes depth and pose consistently, such as one wrong unit in both. An error of a few pixels. Pixels
    beside edges and on moving objects. A camera that does not move.

    Sources
    -------
    Y. Chen, G. Medioni, Image and Vision Computing 10 (1992) 145 (point to plane); E. B. Wilson, M. M. Hilferty, PNAS
    17 (1931) 684 (cube root of chi-square); first principles, ``fedora_qa/estimators/depth/inverse_depth.py`` and
    ``warp.py``.
    """

    name = "depth.consistency"
    needs = ("depth", "pose")

    def not_applicable(self, facts: Facts) -> str:
        """Return which assumption of the model does not hold; empty where all hold."""
        return why_no_geometry(facts)

    def measure(self, window: Window) -> WindowAgreement | None:
        """Compare every pair that the window owns."""
        agreements, without_pose, too_few_pixels, not_fitted = [], 0, 0, 0
        for pair in owned_pairs(window):
            fit = None if pair is None else pair.fit_as_declared()
            if pair is None:
                without_pose += 1
            elif fit is None:
                too_few_pixels += 1
            else:
                agreement = compare(pair, fit)
                not_fitted += agreement is None
                agreements += [agreement] if agreement else []
        return WindowAgreement(window.span.index, tuple(agreements), without_pose, too_few_pixels, not_fitted)

    def follow_up_windows(self, state: list[WindowAgreement], facts: Facts) -> tuple[int, ...]:
        """Return the windows of the worst pairs that exceed their bounds."""
        # Negated, so that the worst window comes first and windows of equal excess keep their order.
        worst = sorted((-max((pair.excess for pair in window.pairs), default=0.0), window.window) for window in state)
        # The excess is in units of the bound: above 1 a pair fails.
        chosen = [window for negative_excess, window in worst if negative_excess < -1]
        return tuple(chosen[:_MOST_FOLLOW_UPS])

    def follow_up(self, state: list[WindowAgreement], window: Window) -> None:
        """Apply inverse transforms to the middle one of the window's deviating pairs.

        A fault may begin or end between the frames of the worst pair.
        """
        of_window = [pair for summary in state if summary.window == window.span.index for pair in summary.pairs]
        off = sorted((pair for pair in of_window if pair.excess > 1), key=lambda pair: pair.excess)
        # The median of the deviating pairs (see the docstring).
        chosen = off[(len(off) - 1) // 2]
        for pair in owned_pairs(window):
            if pair is not None and pair.first == chosen.first:
                # A single deviating tile, in frames that agree otherwise, is used alone.
                local = chosen.whole.excess <= 1 and chosen.noise_square <= 0
                residual, tile = (chosen.worst_tile.typical, chosen.tile) if local else (chosen.whole.typical, None)
                trials = try_conventions(pair.whole(), residual, tile)
                state.append(WindowAgreement(window.span.index, trials=(trials,)))

    def conclude(self, state: Sequence[WindowAgreement], facts: Facts) -> Observation:
        """State the worst deviations, and the size of the corrections."""
        pairs = sorted((pair for window in state for pair in window.pairs), key=lambda pair: pair.first)
        total = max(int(np.count_nonzero(facts.clocks["depth"].advancing)) - 1, 0)
        coverage = pixels_of_pairs(sum(pair.pixels_read for pair in pairs), total, facts)
        if not pairs:
            pairs_by_reason = {
                "are not covered by poses": sum(window.without_pose for window in state),
                "share too few pixels clear of edges": sum(window.too_few_pixels for window in state),
                "deviate by no more than the noise of a motion that is not fitted": sum(
                    window.not_fitted for window in state
                ),
            }
            reasons = [f"{count} {reason}" for reason, count in pairs_by_reason.items() if count]
            why = "the file has no two depth frames, or static pixels are not known"
            if reasons:
                why = "of the pairs of depth frames " + ", ".join(reasons)
            return Observation(coverage, unobservable=why)
        off = [pair for pair in pairs if pair.excess > 1]
        features = (
            PairsOff(len(off), len(pairs), sum(pair.repeats for pair in off)),
            *(trials for window in state for trials in window.trials),
        )
        worst = max(pairs, key=lambda pair: pair.whole.rank)
        off_whole = [pair for pair in pairs if pair.whole.excess > 1]
        worst_by_tile = max(pairs, key=lambda pair: pair.worst_tile.rank)
        off_in_tile = [pair for pair in pairs if pair.worst_tile.excess > 1]
        statistics = [
            Statistic(
                name="deviation",
                value=_PERCENT * worst.whole.typical,
                unit="percent",
                # The bound covers the whole error of each pixel; the median has no random part beyond it.
                standard_error=0.0,
                model_error_bound=_PERCENT * worst.whole.bound,
                sensitivity=sensitivity_range(0.0, [_PERCENT * pair.whole.bound for pair in pairs]),
                side="upper",
                statement=f"Depth frame {worst.first} differs from frame {worst.second} by "
                f"{_deviation_text(worst.whole)}; {len(off_whole)} of {len(pairs)} pairs deviate.",
                code="depth.consistency.frame",
                where=_where(off_whole or [worst], facts),
                features=features,
            ),
            Statistic(
                name="worst_tile",
                value=_PERCENT * worst_by_tile.worst_tile.typical,
                unit="percent",
                standard_error=0.0,
                model_error_bound=_PERCENT * worst_by_tile.worst_tile.bound,
                sensitivity=sensitivity_range(
                    0.0, [_PERCENT * bound for pair in pairs for bound in pair.bounds_of_tiles]
                ),
                side="upper",
                statement=f"A tile of depth frame {worst_by_tile.first} differs from frame {worst_by_tile.second} by "
                f"{_deviation_text(worst_by_tile.worst_tile)}; {len(off_in_tile)} of {len(pairs)} pairs deviate.",
                code="depth.consistency.tile",
                where=replace(_where(off_in_tile or [worst_by_tile], facts), tile=worst_by_tile.tile),
                features=features,
            ),
        ]
        # Corrections have a known distribution only where the declared noise is not zero.
        if facts.declared.pose is not None and is_noisy(facts.declared.pose):
            statistics += _corrections(pairs, facts, features)
        undeclared = Notice(
            "depth.consistency.undeclared",
            "The noise of the pose is not declared, so that the correction of the motion of each pair has no limit.",
        )
        notices = () if facts.declared.pose else (undeclared,)
        return Observation(coverage, tuple(statistics), notices)


def _corrections(pairs: Sequence[PairAgreement], facts: Facts, features: tuple[Feature, ...]) -> list[Statistic]:
    """Return the statistics of the corrections against the declared noise: of every second pair, and of the worst.

    Every second pair, because neighbouring pairs share a pose. With Q chi-square of n degrees of freedom, (Q/n)^(1/3)
    is normal about 1 - 2/(9n) with variance 2/(9n) (Wilson and Hilferty, PNAS 17 (1931) 684); at n = 6 its five-sigma
    tails are right within a factor of three.
    """
    # Pairs that constrain less than one direction of the noise are left out.
    corrected = [pair for pair in pairs if pair.noise_dof >= 1]
    if not corrected:
        return []
    # Neighbouring pairs share a pose, and with it its noise.
    independent = corrected[::2]
    dof = sum(pair.noise_dof for pair in independent)
    ratio = sum(pair.noise_square for pair in independent) / dof
    worst = max(corrected, key=lambda pair: pair.noise_square / pair.noise_dof)
    features = (*features, MotionCorrections(ratio))
    return [
        _correction("pose_correction", ratio, dof, "The corrections of the pose that fit depth are",
                    where_of_frames(facts, independent[0].first, independent[-1].second), features,
                    tests=1, side="both"),
        _correction("worst_pose_correction", worst.noise_square / worst.noise_dof, worst.noise_dof,
                    f"The correction of the pose that fits depth frames {worst.first} and {worst.second} is",
                    where_of_frames(facts, worst.first, worst.second), features,
                    tests=len(corrected), side="upper"),
    ]  # fmt: skip


def _correction(
    name: str, ratio: float, dof: float, subject: str, where: Where, features: tuple[Feature, ...],
    *, tests: int, side: Literal["both", "upper"],
) -> Statistic:  # fmt: skip
    variance = 2 / (9 * dof)  # Wilson and Hilferty, as above
    return Statistic(
        name=name,
        # (Q/n)^(1/3) is nearly normal (Wilson and Hilferty 1931).
        value=float(np.cbrt(ratio)),
        unit="1",
        standard_error=float(np.sqrt(variance)),
        expected=1 - variance,
        side=side,
        tests=tests,
        # The ratio is one of squares.
        statement=f"{subject} {np.sqrt(ratio):.3g} times as large as the declared pose noise implies.",
        code=f"depth.consistency.{name}",
        where=where,
        features=features,
    )


def _where(pairs: Sequence[PairAgreement], facts: Facts) -> Where:
    return where_of_frames(facts, pairs[0].first, pairs[-1].second)


def _deviation_text(deviation: DepthDeviation) -> str:
    typical, bound = (_PERCENT * share for share in (deviation.typical, deviation.bound))
    return f"{typical:.3g}% at the median pixel, where the bound by rounding is {bound:.1g}%"


def compare(pair: DepthPair, fit: DepthFit) -> PairAgreement | None:
    """Compare the frames of a pair.

    Parameters
    ----------
    pair
        Two depth frames and the motion between them.
    fit
        Correction of the motion within its noise. Without it, declared pose noise, which moves all pixels together,
        would count as an error of depth.

    Returns
    -------
    PairAgreement | None
        None where the fit does not converge, and the noise of the motion may explain what is left.
    """
    lattice = pair.lattice()
    agreement = _agreement(pair, pair.warped_after(fit, lattice), lattice, fit)
    # Steps may also not end because a part of the image has a fault: the rest then agrees.
    if fit.converged or agreement.whole.excess <= 1:
        return agreement
    # Without an estimate of the motion, a deviation is certain only where no motion within the noise explains it.
    uncorrected = _agreement(pair, pair.warped_within_noise(lattice), lattice, fit=None)
    return uncorrected if uncorrected.excess > 1 else None


def _agreement(pair: DepthPair, warped: WarpedLattice, lattice: DepthLattice, fit: DepthFit | None) -> PairAgreement:
    """Return the comparison of a pair from its warped pixels; ``fit`` is None where no correction is estimated."""
    compared = np.isfinite(warped.residuals)
    residuals, bounds = np.abs(warped.residuals[compared]), warped.bounds[compared]
    whole = DepthDeviation(median_of(residuals), median_of(bounds))

    # Tiles of the first frame, numbered row by row.
    across, down = _TILES
    height, width = pair.image1.depths_m.shape
    tile_columns = (lattice.columns * across / width).astype(np.uint8)
    tile_rows = (lattice.rows * down / height).astype(np.uint8)
    tiles = (tile_rows * np.uint8(across) + tile_columns)[compared]
    typical, limits = medians_by_group(residuals, bounds, tiles, across * down, _FEWEST_IN_TILE)
    worst_tile, tile_px, bounds_of_tiles = whole, None, (whole.bound, whole.bound)
    if np.isfinite(typical).any():
        # Tiles are ranked by the residual over its bound: bounds grow where depth is steep or coarsely rounded.
        tile = int(np.nanargmax(typical / limits))
        worst_tile = DepthDeviation(float(typical[tile]), float(limits[tile]))
        bounds_of_tiles = (float(np.nanmin(limits)), float(np.nanmax(limits)))
        row, column = divmod(tile, across)
        left, right = column * width // across, (column + 1) * width // across
        top, bottom = row * height // down, (row + 1) * height // down
        # The lattice has every ``every_px``-th pixel of the frame.
        tile_px = (pair.every_px * left, pair.every_px * top, pair.every_px * right, pair.every_px * bottom)

    # Only deviating pairs are compared value by value.
    repeats = max(whole.excess, worst_tile.excess) > 1 and np.array_equal(
        pair.window.depth_m(pair.first), pair.window.depth_m(pair.second), equal_nan=True
    )
    return PairAgreement(
        pair.first,
        pair.second,
        whole,
        worst_tile,
        tile_px,
        bounds_of_tiles,
        pixels=warped.compared,
        pixels_read=lattice.depths_m.size,
        noise_square=fit.noise_square if fit else 0.0,
        noise_dof=fit.noise_dof if fit else 0.0,
        repeats=repeats,
    )


@njit(cache=True)
def medians_by_group(
    first: Float64, second: Float64, groups: NDArray[np.uint8], count: int, fewest: int
) -> tuple[Float64, Float64]:
    """Return the medians of two columns by group.

    Parameters
    ----------
    first, second
        (n,) the columns.
    groups
        (n,) group of each row, less than ``count``.
    count
        Number of groups.
    fewest
        Groups of fewer rows have no medians.

    Returns
    -------
    first_medians
        (count,); NaN in groups of fewer than ``fewest`` rows.
    second_medians
        (count,) likewise.
    """
    ends = np.zeros(count + 1, np.int64)
    for group in groups:
        ends[group + 1] += 1
    ends = np.cumsum(ends)
    # Counting sort: values of one group lie together.
    next_index, first_sorted, second_sorted = ends[:-1].copy(), np.empty(len(first)), np.empty(len(first))
    for i in range(len(groups)):
        index = next_index[groups[i]]
        first_sorted[index], second_sorted[index] = first[i], second[i]
        next_index[groups[i]] = index + 1
    first_medians, second_medians = np.full(count, np.nan), np.full(count, np.nan)
    for group in range(count):
        start, stop = ends[group], ends[group + 1]
        if stop - start >= max(fewest, 1):
            first_medians[group] = median_of(first_sorted[start:stop])
            second_medians[group] = median_of(second_sorted[start:stop])
    return first_medians, second_medians

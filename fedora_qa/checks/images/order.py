"""Displacement of frames along the flow: order in time, of whole frames and of their parts.

A part may be frozen, or of another frame, while the rest of the image moves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import nan
from typing import Final, NamedTuple, TypeGuard

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA, robust_sigma, sensitivity_range
from fedora_qa.estimators.images.order import FlowRatio, flow_ratio, flow_ratios_of_parts, is_constant
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import USUAL_PIXELS, Window
from fedora_qa.views.frame_pairs import luma_on_flow_grid, pairs_with_flow, seen_part
from fedora_qa.views.frames import is_large
from fedora_qa.views.warped_frames import optics_of

Float64 = NDArray[np.float64]
Box = tuple[int, int, int, int]
"""Left, top, right, bottom."""

ALLOWED: Final = 0.5
"""Largest deviation of a ratio: halfway between a correct frame (1) and one that repeats the frame before (0)."""

LARGEST_ERROR: Final = 0.1
"""Largest error of a ratio that counts: a fifth of ``ALLOWED``."""

LEAST_RATIO: Final = 0.5
"""Least median ratio: below it frames do not follow the flow in most intervals, and no single interval deviates."""

FEWEST_PAIRS: Final = 4

FEWEST_PAIRS_OF_PART: Final = 8
"""Least number of pairs for the median ratio of a part and its scatter."""

PARTS: Final = 4
"""Number of parts along each side: at least one lies within any region of half the width and height."""


_IN_PLACE: Final = 0.25
"""Deviation within which an interval is certainly in order: half of ``ALLOWED``."""

PartRatios = tuple[tuple[float, float], ...]
"""(parts, 2) ratios to the flow and their standard errors, row by row; NaN where a part is not informative."""


@dataclass(frozen=True, slots=True)
class FramePairRatio:
    """Ratio of the displacement of two frames to the flow between them.

    Attributes
    ----------
    before, after
        Rows of the frames.
    ratio, standard_error, rounding_error
        Ratio of the whole frames, its standard error, and its error by rounding of the frames.
    shown_part
        Left, top, right, bottom of the part of the flow's grid that colour frames cover, px.
    parts
        Ratios of the parts.
    """

    before: int
    after: int
    ratio: float
    standard_error: float
    rounding_error: float
    shown_part: Box
    parts: PartRatios


class FrameInterval(NamedTuple):
    """Displacement of two frames along the flow.

    Attributes
    ----------
    before, after
        Rows of the frames.
    relative_ratio
        Ratio of the displacement to the flow, in units of the median ratio.
    """

    before: int
    after: int
    relative_ratio: float


@dataclass(frozen=True, slots=True)
class DisplacedFrames:
    """Frames that follow each other as they should, in the place of other frames.

    Attributes
    ----------
    first, stop
        Rows of the first of them, and of the one after the last; None: to the end of the file.
    frames
        By how many frames they are late; negative: early.
    """

    first: int
    stop: int | None
    frames: int


@dataclass(frozen=True, slots=True)
class OutOfOrderIntervals(Feature):
    """Intervals in which the displacement of the frames differs from the flow.

    Attributes
    ----------
    relative_ratios
        Ratios of the intervals that deviate by more than ``ALLOWED``, in the order of time; 1 is the median.
    frames_return
        Whether the ratio is too small in one interval and too large in one beside it, or the reverse. None where it is
        not, but an interval beside was not measured.
    isolated
        Whether each interval has neighbours in order on both sides.
    displaced
        Frames between two intervals that make up for each other; None without any.
    """

    relative_ratios: tuple[float, ...]
    frames_return: bool | None
    isolated: bool
    displaced: DisplacedFrames | None = None


class ImagesOrder(WindowCheck[tuple[FramePairRatio, ...]]):
    """Is each frame displaced from the frame before by the stored flow?

    For each pair of frames, the ratio of the displacement of the second against the first to the flow. A correct file
    gives 1. A frame that repeats the one before gives 0, and the one after it 2. Exchanged neighbours give 2, -1, 2.

    Why it matters
    --------------
    A frame that is out of order, frozen or dropped gives wrong motion in two intervals. Everything that is learnt from
    pairs of frames, or aligned to events by them, is wrong there.

    How
    ---
    The change from each frame to the next is regressed on the change that the fastest flow predicts, with gain and bias
    of brightness as free parameters. Images are first reduced until the flow is about a pixel. The pair with the most
    significant deviation from the median of all is judged. Each of 4 x 4 parts of the image is compared with its own
    median. The sign of the ratio separates exchanged frames from frozen ones. If a frame is out of order, the ratio is
    too small in one interval and too large in a neighbouring one. Ratios that are only too small or only too large,
    with neighbours in order, mean an image that was moved or rotated.

    Noise model
    -----------
    The standard error combines the spread of all pairs (1.4826 times the median absolute deviation) with that of the
    pair's own regression. The bound is half of the flow: halfway between a correct frame and a repeated one. Pairs are
    used if the error of their ratio by rounding alone is below 0.1; for a part, its own error must be below 0.1 as
    well.

    Cannot detect
    -------------
    An error of all frames together (``flow_photometric.residual``). Frames with little motion. If flow is slower than
    the frames, only frames at its ends are tested. The check alone does not determine whether flow or frames are out of
    order: ``event_response.frames`` compares frames with events, and if both fail, the frames are wrong.

    Sources
    -------
    B. D. Lucas, T. Kanade, IJCAI (1981) 674, with one unknown a pair; derivation in ``estimators/images/order.py``.
    """

    name = "images.order"
    needs = ("flow", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Return why frames cannot be mapped onto the flow's grid; empty where they can."""
        optics = optics_of(facts)
        return optics if isinstance(optics, str) else ""

    def measure(self, window: Window) -> tuple[FramePairRatio, ...]:
        """Regress every pair that the window owns."""
        ratios = []
        for pair in pairs_with_flow(window):
            if pair.flow_px is None:
                continue
            before, after = luma_on_flow_grid(window, pair.before), luma_on_flow_grid(window, pair.after)
            if is_constant(before) or is_constant(after):  # blank frames are measured by images.exposure
                continue
            flow_px, size = pair.flow_px, (before.shape[1], before.shape[0])
            if is_large(before.size, window):
                # The number of used pixels is the geometric mean of the frame's and that of a usual frame: at 1440x1080
                # 38% of each part. The standard error of a part's ratio is then usually 0.012 in place of 0.008, and
                # the detection limit of a part 25% larger; that of a whole frame is the same. The side is the root of
                # the area, hence the fourth root.
                side_ratio = min(1.0, (USUAL_PIXELS / before.size) ** 0.25)
                boxes, middles = part_boxes(*size), []
                for left, top, right, bottom in boxes:
                    across, down = (round((1 - side_ratio) / 2 * side) for side in (right - left, bottom - top))
                    middles.append((left + across, top + down, right - across, bottom - down))
                whole, of_middles = flow_ratios_of_parts(before, after, flow_px, middles)
                # A part whose middle is not informative is used as a whole.
                of_parts = [
                    ratio if _is_informative(ratio) else flow_ratios_of_parts(before, after, flow_px, [box])[1][0]
                    for ratio, box in zip(of_middles, boxes, strict=True)
                ]
                # Middles of the parts are a sample of the frame: the whole frame is used where their error is too
                # large.
                if whole is None or whole.rounding_error >= LARGEST_ERROR:
                    whole = flow_ratio(before, after, flow_px)
            else:
                whole = flow_ratio(before, after, flow_px)
                of_parts = [flow_ratio(before, after, flow_px, box) for box in part_boxes(*size)]
            if whole is not None:
                errors = whole.standard_error, whole.rounding_error
                parts = tuple(
                    (ratio.ratio, ratio.standard_error) if _is_informative(ratio) else (nan, nan) for ratio in of_parts
                )
                left, top, *_ = seen_part(window)
                shown_part = (left, top, left + size[0], top + size[1])
                ratios.append(FramePairRatio(pair.before, pair.after, whole.ratio, *errors, shown_part, parts))
        return tuple(ratios)

    def conclude(self, state: Sequence[tuple[FramePairRatio, ...]], facts: Facts) -> Observation:
        """Find the pair with the most significant deviation from all others."""
        pairs = [pair for ratios in state for pair in ratios]
        clear = [pair for pair in pairs if pair.rounding_error < LARGEST_ERROR]
        coverage = Coverage(len(clear), max(facts.sizes.get("path/rgb", 0) - 1, 0), "frame intervals")
        if len(clear) < FEWEST_PAIRS:
            return Observation(coverage, unobservable="too few frames at the ends of flow fields, or too little motion")
        ratios = np.array([pair.ratio for pair in clear])
        # The median of the file is the reference, because a gain of the whole flow does not change the order of frames.
        usual = float(np.median(ratios))
        if usual < LEAST_RATIO:
            reason = f"the median displacement of frames is {usual:.2g} of the flow (see flow_photometric.residual)"
            return Observation(coverage, unobservable=reason)
        scatter = float(robust_sigma(ratios, usual))
        errors = np.hypot(scatter, [pair.standard_error for pair in clear])
        worst = int(np.argmax((np.abs(ratios - usual) - ALLOWED * usual) / errors))
        farthest, error = clear[worst], float(errors[worst])
        off = [pair for pair in clear if abs(pair.ratio / usual - 1) > ALLOWED]
        first, last = (off[0].after, off[-1].before) if off else (farthest.after, farthest.after)
        whole = Statistic(
            name="share_of_the_flow",
            value=farthest.ratio / usual,
            unit="1",
            standard_error=error / usual,
            expected=1.0,
            model_error_bound=ALLOWED,
            tests=max(facts.sizes.get("path/rgb", 0) - 1, 1),
            statement=f"Frame {farthest.after} is displaced by {farthest.ratio:.2f} of the flow from frame "
            f"{farthest.before}; the median is {usual:.2f}. {len(off)} frame intervals are out of order.",
            code="images.order.share",
            where=_where(first, last, facts),
            features=(intervals_out_of_order([FrameInterval(p.before, p.after, p.ratio / usual) for p in clear]),),
        )
        part = _worst_part(pairs, facts)
        return Observation(coverage, (whole,) if part is None else (whole, part))


def part_boxes(width: int, height: int) -> tuple[Box, ...]:
    """Return the parts of an image, row by row, half-open.

    Parameters
    ----------
    width, height
        Of the image, px.

    Returns
    -------
    tuple
        (``PARTS`` squared) boxes: left, top, right, bottom, px.
    """
    columns, rows = ([round(edge * size / PARTS) for edge in range(PARTS + 1)] for size in (width, height))
    return tuple((left, top, right, bottom) for top, bottom in pairwise(rows) for left, right in pairwise(columns))


def _is_informative(ratio: FlowRatio | None) -> TypeGuard[FlowRatio]:
    return ratio is not None and max(ratio.rounding_error, ratio.standard_error) < LARGEST_ERROR


def _worst_part(pairs: Sequence[FramePairRatio], facts: Facts) -> Statistic | None:
    """Return the statistic of the part whose ratio deviates most from its median; None where none is informative."""
    # Ratios and their errors, (pairs, parts) each.
    ratios, own_errors = np.moveaxis(np.array([pair.parts for pair in pairs]), -1, 0)
    usual = np.array([_median_of_finite(column) for column in ratios.T])
    informative = (np.count_nonzero(np.isfinite(ratios), axis=0) >= FEWEST_PAIRS_OF_PART) & (usual >= LEAST_RATIO)
    if not informative.any():
        return None
    relative = np.where(informative, ratios / np.where(informative, usual, 1.0), np.nan)
    scatter = MAD_TO_SIGMA * np.array([_median_of_finite(np.abs(column - 1)) for column in relative.T])
    errors = np.hypot(scatter, own_errors / np.where(informative, usual, 1.0))
    scores = np.where(np.isfinite(relative), (np.abs(relative - 1) - ALLOWED) / errors, -np.inf)
    pair, part = (int(i) for i in np.unravel_index(int(np.argmax(scores)), scores.shape))

    before, after, (x0, y0, x1, y1) = pairs[pair].before, pairs[pair].after, pairs[0].shown_part
    left, top, right, bottom = part_boxes(x1 - x0, y1 - y0)[part]
    left, top, right, bottom = left + x0, top + y0, right + x0, bottom + y0
    series = [FrameInterval(p.before, p.after, float(r)) for p, r in zip(pairs, relative[:, part], strict=True)]
    off = [interval for interval in series if abs(interval.relative_ratio - 1) > ALLOWED] or [series[pair]]
    return Statistic(
        name="share_of_the_flow_in_a_part",
        value=float(relative[pair, part]),
        unit="1",
        standard_error=float(errors[pair, part]),
        expected=1.0,
        model_error_bound=ALLOWED,
        tests=int(np.count_nonzero(np.isfinite(relative))),
        sensitivity=sensitivity_range(np.where(np.isfinite(relative), errors, np.nan), ALLOWED),
        statement=f"In columns {left} to {right - 1}, rows {top} to {bottom - 1} the displacement of frame {after} "
        f"from frame {before} is {relative[pair, part]:.2f} of the median.",
        code="images.order.part",
        where=replace(_where(off[0].after, off[-1].before, facts), tile=(left, top, right, bottom)),
        features=(intervals_out_of_order([p for p in series if np.isfinite(p.relative_ratio)]),),
    )


def _median_of_finite(values: Float64) -> float:
    """Return the median of the finite values, 0 where there are none."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else 0.0


def _where(first: int, last: int, facts: Facts) -> Where:
    start_us, stop_us = (facts.to_file_us(int(facts.clocks["rgb"].times_ns[frame])) for frame in (first, last))
    return Where(stream="rgb", start_us=start_us, stop_us=stop_us, frame=first)


class _IntervalRun(NamedTuple):
    """Ratios of a run out of order and of its neighbours, whether both of these are measured, and the run's length."""

    ratios: list[float]
    complete: bool
    length: int


def intervals_out_of_order(intervals: Sequence[FrameInterval]) -> OutOfOrderIntervals:
    """Return the intervals that are out of order, and whether the displacement of frames returns to normal.

    For a frame out of order the ratio is too small in one interval and too large in one beside it.
    """
    ordered = sorted(intervals)
    off = [abs(interval.relative_ratio - 1) > ALLOWED for interval in ordered]
    # No interval before the first and none after the last.
    follows = [False, *(earlier.after == later.before for earlier, later in pairwise(ordered)), False]
    # Runs of intervals out of order, in which each begins with the frame at which that before it ends.
    runs: list[_IntervalRun] = []
    start = 0
    while start < len(ordered):
        stop = start + 1
        if off[start]:
            while stop < len(ordered) and off[stop] and follows[stop]:
                stop += 1
            first, last = start - follows[start], stop + follows[stop]
            ratios = [interval.relative_ratio for interval in ordered[first:last]]
            runs.append(_IntervalRun(ratios, follows[start] and follows[stop], stop - start))
        start = stop
    returns = any(min(run.ratios) < 1 - _IN_PLACE and max(run.ratios) > 1 + _IN_PLACE for run in runs)
    complete = all(run.complete for run in runs)
    return OutOfOrderIntervals(
        tuple(interval.relative_ratio for interval in ordered if abs(interval.relative_ratio - 1) > ALLOWED),
        True if returns else False if complete else None,
        bool(runs) and complete and all(run.length == 1 for run in runs),
        # Frames that were not measured may be out of order as well.
        _displaced([interval for interval, is_off in zip(ordered, off, strict=True) if is_off], ordered)
        if all(follows[1:-1])
        else None,
    )


def _displaced(off: Sequence[FrameInterval], ordered: Sequence[FrameInterval]) -> DisplacedFrames | None:
    """Return the frames between two intervals out of order, of which the second makes up for the first.

    Frames that are d late begin with a displacement of 1 - d, follow each other, and end with one of 1 + d, of which
    the whole is 2. Those that are late to the end of the file make up for nothing. A single frame in the place of
    another is one that is frozen or lost.
    """
    if len(off) == 1 and off[0].after < ordered[-1].before:
        late = 1 - off[0].relative_ratio
        return DisplacedFrames(off[0].after, None, round(late)) if late > ALLOWED and _is_whole(late) else None
    if len(off) != 2 or off[1].before <= off[0].after:
        return None
    begins, ends = (interval.relative_ratio - 1 for interval in off)
    # A long displacement is measured too short: the shorter one states how many frames it is.
    late = -begins if begins < 0 else ends
    if begins * ends >= 0 or not _is_whole(late):
        return None
    return DisplacedFrames(off[0].after, off[1].before + 1, round(late))


def _is_whole(frames: float) -> bool:
    return abs(frames - round(frames)) <= _IN_PLACE

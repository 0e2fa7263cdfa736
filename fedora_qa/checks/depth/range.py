"""The values of depth: their range, clipping at its ends, and their steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Notice, Observation, Statistic, WindowCheck
from fedora_qa.conventions import MM_PER_M
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.images.values import positive_extremes
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.depth_pairs import depth_step_m, largest_share, where_of_frames

RANGE_ROUNDING: Final = 2.0**-22
"""Rounding to float32 (2^-24), of the depths and of the range, with two bits to spare; relative."""

_NEIGHBOURHOOD: Final = 64 * RANGE_ROUNDING
"""Depths between this and ``RANGE_ROUNDING`` of an end are its neighbourhood: 63 times as wide as the end itself."""

_COARSE: Final = 1e-3
"""Steps of this share of the depth change a parallax of 10 px by 0.01 px."""


@dataclass(frozen=True, slots=True)
class DepthExtent(Feature):
    """Extremes of the depths of a file.

    Attributes
    ----------
    nearest_m, farthest_m
        Nearest and farthest valid depth, m.
    range_m
        The declared range, m.
    """

    nearest_m: float
    farthest_m: float
    range_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class FrameExtent:
    """Extremes of one depth frame, and its pixels at the ends of the range.

    Attributes
    ----------
    frame
        Row of the frame.
    nearest_m, farthest_m
        Nearest and farthest valid depth, m.
    contour
        Width plus height of the frame, px: the number of pixels of a line of equal depth.
    on_end
        Number of pixels on the near and on the far end of the declared range.
    near_end
        Number of pixels close to the near and to the far end, without those on it.
    """

    frame: int
    nearest_m: float
    farthest_m: float
    contour: int
    on_end: tuple[int, int]
    near_end: tuple[int, int]


@dataclass(frozen=True, slots=True)
class WindowExtents:
    """Extremes of the frames of a window.

    Attributes
    ----------
    frames
        Frames with a valid pixel.
    """

    frames: tuple[FrameExtent, ...]


class DepthRange(WindowCheck[WindowExtents]):
    """Do depths lie in the declared range, without being clipped to its ends?

    The nearest and the farthest valid depth of all frames compared with ``depth_range``, the number of pixels that lie
    exactly on either end, and the step in which depths are stored.

    Why it matters
    --------------
    A sensor that writes its limit where it has no return creates a wall at 30 m: planners avoid it, and scene flow on
    it is wrong. Steps of a thousandth of the depth change a parallax of 10 px by 0.01 px, which is relevant for flow.

    How
    ---
    Every decoded frame is read. Pixels that equal an end, to the rounding of float32, are counted and compared with
    those in a neighbourhood of it that is 63 times as wide: surfaces have one pixel on the end for 63 there. Steps are
    inferred from the values (``fedora_qa/estimators/storage/steps.py``). Where their size is unknown, or they are steps
    of 1/z, second differences along rows and columns are used: they vanish on planes, and are multiples of one number
    where depths, or their inverses, were rounded. Steps above a thousandth of the depth are noted (16-bit millimetres
    at near range, half floats, disparities, a z-buffer of few bits). Finer steps are stated among the inferred facts.

    Noise model
    -----------
    The ends are exact except for the rounding of depths and range to float32, 2^-24, with a margin of a factor of 4.
    The excess on an end is a Poisson count; its variance is the number that the neighbourhood implies, plus one. In one
    frame, one line at exactly that depth is allowed: as many pixels as its width plus height.

    Cannot detect
    -------------
    Wrong depths within the range. A declared range that is too wide. The code of invalid pixels (``integrity.finite``).
    Steps in scenes without a plane or a smooth surface.

    Sources
    -------
    The canonical layout, version 1.0; IEEE 754-2019 for the rounding; first principles.
    """

    name = "depth.range"
    needs = ("depth",)

    def measure(self, window: Window) -> WindowExtents | None:
        """Count pixels at the ends of the range in every frame that the window owns."""
        range_m = window.facts.declared.depth_range_m
        # Neighbourhoods are relative to the end: one at 0 m has none.
        ends_m = [(i, end_m) for i, end_m in enumerate(range_m or ()) if end_m > 0]
        # Slightly more than the neighbourhood, whose ends are rounded to single precision.
        width = 2 * _NEIGHBOURHOOD
        near_ends = [(end_m * (1 - width), end_m * (1 + width)) for _, end_m in ends_m]
        frames = []
        for frame in window.owned("depth"):
            try:
                depth_m = window.depth_m(frame)
            except UnreadableRowsError:  # a finding of integrity.readable
                continue
            extremes = positive_extremes(depth_m, near_ends)
            # The frame has no valid pixel.
            if extremes is None:
                continue
            nearest_m, farthest_m, near_ends_m = extremes
            on_end, near_end = [0, 0], [0, 0]
            for i, end_m in ends_m:
                # In float64: float32 would round the relative distance by as much as the end is wide.
                distances = np.abs(near_ends_m.astype(np.float64) / end_m - 1.0)
                on_end[i] = int(np.count_nonzero(distances <= RANGE_ROUNDING))
                # The neighbourhood without the end itself, as its definition has it: 63 times as wide as the end.
                near_end[i] = int(np.count_nonzero(distances <= _NEIGHBOURHOOD)) - on_end[i]
            on, near = (on_end[0], on_end[1]), (near_end[0], near_end[1])
            frames.append(FrameExtent(frame, nearest_m, farthest_m, sum(depth_m.shape), on, near))
        return WindowExtents(tuple(frames)) if frames else None

    def conclude(self, state: Sequence[WindowExtents], facts: Facts) -> Observation:
        """State the ends, and the pixels that lie on them."""
        frames = sorted((frame for window in state for frame in window.frames), key=lambda frame: frame.frame)
        coverage = Coverage(len(frames), facts.sizes.get("path/depth", 0), "depth frames")
        range_m = facts.declared.depth_range_m
        if not frames:
            return Observation(coverage, unobservable="no depth frame has a valid pixel")
        notices: tuple[Notice, ...] = ()
        inferred: dict[str, str | float] = {}
        step = depth_step_m(facts)
        if step.is_coarse:
            ends_m = (min(frame.nearest_m for frame in frames), max(frame.farthest_m for frame in frames))
            share, at_m = max((largest_share(step, end_m, end_m), end_m) for end_m in ends_m)
            inferred = {"depth_step_mm": MM_PER_M * share * at_m}
            if share >= _COARSE:
                message = (
                    f"Depths have steps of {MM_PER_M * share * at_m:.3g} mm at {at_m:.3g} m, "
                    f"{100 * share:.2g}% of the depth."
                )
                notices = (Notice("depth.range.steps", message, Where(stream="depth")),)
        if range_m is None:
            why = "the file declares no depth range"
            ends = _ends(frames, facts, (0.0, np.inf))
            return Observation(coverage, ends, notices, unobservable=why, inferred=inferred)
        clipped = []
        for end, (name, end_m) in enumerate(zip(("near", "far"), range_m, strict=True)):
            on_end = sum(frame.on_end[end] for frame in frames)
            # A uniform density of the neighbourhood, over the width of the end itself.
            expected = sum(frame.near_end[end] for frame in frames) * RANGE_ROUNDING / (_NEIGHBOURHOOD - RANGE_ROUNDING)
            worst = frames[int(np.argmax([frame.on_end[end] for frame in frames]))]
            clipped.append(
                Statistic(
                    name=f"on_{name}_end",
                    value=float(on_end),
                    unit="pixels",
                    # A Poisson count; plus one, for an expected number of zero.
                    standard_error=float(np.sqrt(expected + 1.0)),
                    expected=expected,
                    # A surface may have a line of just this depth in one frame.
                    model_error_bound=float(max(frame.contour for frame in frames)),
                    side="upper",
                    resolution=1.0,
                    statement=f"{on_end} pixels lie exactly on the {name} end of the range, {end_m:g} m: depth was "
                    "clipped there instead of being NaN.",
                    code=f"depth.range.{name}_end",
                    where=where_of_frames(facts, worst.frame, worst.frame),
                )
            )
        return Observation(coverage, (*_ends(frames, facts, range_m), *clipped), notices, inferred=inferred)


def _ends(frames: Sequence[FrameExtent], facts: Facts, range_m: tuple[float, float]) -> tuple[Statistic, ...]:
    nearest = min(frames, key=lambda frame: frame.nearest_m)
    farthest = max(frames, key=lambda frame: frame.farthest_m)
    extent = DepthExtent(nearest.nearest_m, farthest.farthest_m, range_m)
    low_m, high_m = range_m
    return (
        Statistic(
            name="nearest",
            value=nearest.nearest_m,
            unit="m",
            standard_error=0.0,
            expected=low_m,
            model_error_bound=RANGE_ROUNDING * low_m,
            side="lower",
            statement=f"The nearest depth is {nearest.nearest_m:.4g} m; {low_m:g} m or more is declared.",
            code="depth.range.nearest",
            where=where_of_frames(facts, nearest.frame, nearest.frame),
            features=(extent,),
        ),
        Statistic(
            name="farthest",
            value=farthest.farthest_m,
            unit="m",
            standard_error=0.0,
            expected=high_m,
            model_error_bound=RANGE_ROUNDING * high_m,
            side="upper",
            statement=f"The farthest depth is {farthest.farthest_m:.4g} m; {high_m:g} m or less is declared.",
            code="depth.range.farthest",
            where=where_of_frames(facts, farthest.frame, farthest.frame),
            features=(extent,),
        ),
    )

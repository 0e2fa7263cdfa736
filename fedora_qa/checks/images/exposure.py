"""Frames against each other: exposure."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, expm1
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.images.code_gains import frames_with_gain
from fedora_qa.checks.protocol import Notice, Observation, Statistic, Suspect, WindowCheck
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.estimators.images.code_gain import CODES
from fedora_qa.estimators.images.gain import brightness_gain
from fedora_qa.estimators.images.values import count_codes, is_of_one_code
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.frame_pairs import flow_rate_of, neighbours, pairs_with_flow, same_points

Float64 = NDArray[np.float64]

NEIGHBOURS: Final = 3
"""Pairs on either side that tell what the brightness does by itself: light that changes slowly, the sky coming in."""

FEWEST_PAIRS: Final = 4

CLIPPED_SHARE: Final = 0.25
"""Share of pixels at 255 beyond which a file is said to be overexposed: a judgement, no more than a notice."""

MATTERS_PERCENT: Final = 20.0

_SAMPLED_EVERY_PX: Final = 4

MOVED_ON_PERCENT: Final = 0.2
"""What points of one place differ in brightness where the flow misses them by part of a pixel: bias, not noise."""


@dataclass(frozen=True, slots=True)
class PairGain:
    """Two frames, the logarithm of the later one's brightness over the earlier one's, and its error."""

    before: int
    after: int
    log_gain: float
    standard_error: float


@dataclass(frozen=True, slots=True)
class WindowExposure:
    """What a window shows.

    Attributes
    ----------
    gains
        Of its pairs.
    blank
        Frames of one value.
    clipped
        Sum over its frames of the share of pixels at 255.
    frames, codes
        Its frames, and how often each code (256,) occurs in them.
    """

    gains: tuple[PairGain, ...]
    blank: tuple[int, ...]
    clipped: float
    frames: range
    codes: NDArray[np.int64]


class ImagesExposure(WindowCheck[WindowExposure]):
    """Is the exposure the same in all frames?

    The largest jump of brightness from one frame to the next, at the same points; the frames of one value throughout;
    and the frames that were multiplied after they had been rounded.

    Why it matters
    --------------
    Event cameras see ratios, and so do photometric losses: a frame that is 2% brighter than its neighbours is 0.02
    nat of change that no event accounts for, a tenth of a usual threshold at every pixel.

    How
    ---
    Points that both frames show, by the fastest flow where there is one, and else the same coarse pixels, are
    compared tile by tile (``fedora_qa/estimators/images/gain.py``): the logarithm of the ratio of sums, and the median
    over tiles. What the brightness does by itself, slowly, is the median of the pairs around; the pair that departs
    from it most is judged. A frame that differs alone gives a jump up and one down. A gain of rounded values leaves
    just those codes out (or puts two on one) that lie between its multiples: histograms of the frames tell it, to a
    hundredth of a percent (``fedora_qa/estimators/images/code_gain.py``).

    Noise model
    -----------
    A pair's error is that of a median over tiles, from their spread and from rounding, together with the spread of
    all pairs (median absolute deviation). 0.2% is allowed for points that the flow misses by part of a pixel. Without
    flow, motion makes tiles differ, so that errors grow by ten; only jumps of many percent are then seen. That the
    codes of one gain, and no others, are missing by chance has a probability below one in a thousand of that of any
    code missing among frequent ones.

    Cannot see
    ----------
    Exposure that is wrong in all frames alike and was so before rounding: to the log model of events it means nothing
    at all, and to the linear model it is a threshold. Gains of single tiles of the image, and vignetting that stays.
    Light that changes slowly is no jump.

    Sources
    -------
    The canonical layout, version 1.0: DN = rint(clip(Y)); first principles, the derivations stand with the
    estimators.
    """

    name = "images.exposure"
    needs = ("rgb",)

    def measure(self, window: Window) -> WindowExposure:
        """Compare every pair that the window owns."""
        gains = []
        for pair in pairs_with_flow(window) if flow_rate_of(window) else neighbours(window):
            found = brightness_gain(*same_points(window, pair))
            if found is not None:
                gains.append(PairGain(pair.before, pair.after, found.log_gain, found.standard_error))
        blank, clipped, codes = [], [], np.zeros(CODES, dtype=np.int64)
        for frame in window.owned("rgb"):
            rgb = window.rgb(frame)
            if is_of_one_code(rgb):
                blank.append(frame)
            looked_at = ceil(rgb.shape[0] / _SAMPLED_EVERY_PX) * ceil(rgb.shape[1] / _SAMPLED_EVERY_PX)
            clipped.append(count_codes(rgb, _SAMPLED_EVERY_PX, codes) / max(looked_at, 1))
        return WindowExposure(tuple(gains), tuple(blank), float(np.sum(clipped)), window.owned("rgb"), codes)

    def conclude(self, state: Sequence[WindowExposure], facts: Facts) -> Observation:
        """Find the largest jump, and count blank frames."""
        gains = sorted((one for w in state for one in w.gains), key=lambda one: one.before)
        blank = [frame for w in state for frame in w.blank]
        frames = sum(len(w.frames) for w in state)
        coverage = Coverage(len(gains), max(facts.sizes.get("path/rgb", 0) - 1, 0), "frame intervals")
        if frames and len(blank) == frames:
            return Observation(coverage, unobservable="every frame is of one value throughout")
        measured = [_blank(blank, facts)]
        if len(gains) >= FEWEST_PAIRS:
            measured.append(_jump(gains, facts))
        measured += frames_with_gain([(w.frames, w.codes) for w in state], facts)
        clipped = sum(w.clipped for w in state) / max(frames, 1)
        notices = (
            (Notice("images.exposure.clipped", f"{clipped:.0%} of the pixels are at 255.", Where(stream="rgb")),)
            if clipped > CLIPPED_SHARE
            else ()
        )
        why = (
            ""
            if len(gains) >= FEWEST_PAIRS
            else "too few frames at the ends of the flow, or too little lit and not clipped"
        )
        return Observation(coverage, tuple(measured), notices, why)


def _jump(gains: Sequence[PairGain], facts: Facts) -> Statistic:
    jumps = departures(np.array([one.log_gain for one in gains]))
    spread = MAD_TO_SIGMA * float(np.median(np.abs(jumps)))
    errors = np.hypot(spread, [one.standard_error for one in gains])
    model_error_bound = MOVED_ON_PERCENT / 100
    worst = int(np.argmax((np.abs(jumps) - model_error_bound) / errors))
    first = _first_of(jumps, worst, float(errors[worst]))
    frame, percent = gains[first].after, 100 * expm1(float(jumps[first]))
    times_ns = facts.clocks["rgb"].times_ns
    error = 100 * float(errors[worst])
    return Statistic(
        name="largest_jump",
        value=100 * float(abs(jumps[worst])),
        unit="percent",
        standard_error=error,
        model_error_bound=100 * model_error_bound,
        side="upper",
        tests=len(gains),
        material=MATTERS_PERCENT,
        statement=f"Frame {frame} is {abs(percent):.3g} +/- {error:.2g}% {'brighter' if percent > 0 else 'darker'} "
        f"than frame {gains[first].before} at the same points.",
        code="images.exposure.jump",
        where=Where(
            stream="rgb",
            start_us=facts.to_file_us(int(times_ns[frame])),
            stop_us=facts.to_file_us(int(times_ns[min(frame + 1, len(times_ns) - 1)])),
            frame=frame,
        ),
        suspects=(
            Suspect("exposure_or_gamma", "rgb", 0.95, percent, "percent", error),
            # Luma weighs the channels, so that exchanged ones are brighter or darker; images.channels tells them.
            Suspect("channel_order", "rgb", 0.6),
            *(Suspect(cause, "rgb", 0.2) for cause in ("other_sequence", "swapped_frames", "frozen_frames")),
        ),
    )


def departures(log_gains: Float64) -> Float64:
    """Return by how much each gain (n,) departs from the median of those around it."""
    around = [
        np.concatenate([log_gains[max(i - NEIGHBOURS, 0) : i], log_gains[i + 1 : i + 1 + NEIGHBOURS]])
        for i in range(len(log_gains))
    ]
    apart: Float64 = log_gains - np.array([np.median(values) for values in around])
    return apart


def _first_of(jumps: Float64, worst: int, error: float) -> int:
    """Return the jump with which a departure of the worst size begins: up and down again is one frame, or several."""
    like = np.flatnonzero(np.abs(np.abs(jumps) - abs(jumps[worst])) < max(5 * error, 0.2 * abs(jumps[worst])))
    return int(like[0])


def _blank(blank: Sequence[int], facts: Facts) -> Statistic:
    if not blank:
        return no_faults("blank_frames", "frames", "images.exposure.blank")
    times_ns = facts.clocks["rgb"].times_ns
    return count_of_faults(
        "blank_frames",
        len(blank),
        "frames",
        statement=f"{len(blank)} frames are of one value throughout, the first of them frame {blank[0]}.",
        code="images.exposure.blank",
        where=Where(
            stream="rgb",
            start_us=facts.to_file_us(int(times_ns[blank[0]])),
            stop_us=facts.to_file_us(int(times_ns[min(blank[-1] + 1, len(times_ns) - 1)])),
            frame=blank[0],
        ),
        suspects=(Suspect("exposure_or_gamma", "rgb", 0.9), Suspect("dropped_samples", "rgb", 0.3)),
    )

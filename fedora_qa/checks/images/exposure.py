"""Changes of exposure between frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, expm1, log
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.protocol import Notice, Observation, Statistic, WindowCheck
from fedora_qa.estimators.fitting.robust import robust_sigma, sensitivity_range
from fedora_qa.estimators.images.gain import CODES, brightness_gain, gain_after_rounding, is_informative
from fedora_qa.estimators.images.values import count_codes, is_of_one_code
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.frame_pairs import flow_rate_of, neighbours, pairs_with_flow, same_points

Float64 = NDArray[np.float64]

NEIGHBOURS: Final = 3
"""Number of pairs on either side whose median is the slow change of brightness, by light or by the view."""

FEWEST_PAIRS: Final = 4

CLIPPED_SHARE: Final = 0.25
"""Share of pixels at 255 above which a notice of overexposure is given."""


_SAMPLED_EVERY_PX: Final = 4

MISREGISTRATION_PERCENT: Final = 0.2
"""Bias of the brightness of equal points, in percent, by errors of the flow of less than a pixel."""

_CORNER_EVIDENCE: Final = log(1e3)
"""Natural logarithm of the likelihood ratio from which a jump is one of vignetting: an even jump is taken for one with
a probability of a thousandth at most (Markov's inequality)."""


@dataclass(frozen=True, slots=True)
class FramePairGain:
    """Change of brightness between two frames.

    Attributes
    ----------
    before, after
        Rows of the frames.
    log_gain
        ln of the later brightness over the earlier one.
    standard_error
        Of ``log_gain``.
    corner_log_gain, corner_evidence
        As of ``BrightnessGain``.
    """

    before: int
    after: int
    log_gain: float
    standard_error: float
    corner_log_gain: float = 0.0
    corner_evidence: float = 0.0


@dataclass(frozen=True, slots=True)
class WindowExposure:
    """Brightness of a window's frames.

    Attributes
    ----------
    gains
        Changes of brightness of the window's pairs.
    blank
        Rows of frames of one value.
    clipped
        Sum over the frames of the share of pixels at 255.
    frames, codes
        Rows of the frames, and the number of each code (256,) in them.
    """

    gains: tuple[FramePairGain, ...]
    blank: tuple[int, ...]
    clipped: float
    frames: range
    codes: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class BrightnessJump(Feature):
    """A step of the brightness from one frame to the next.

    Attributes
    ----------
    percent
        Its size, positive where the later frame is brighter.
    standard_error_percent
        Of the size.
    corner_percent
        The step in the corners where it grows with the squared distance from the middle, as vignetting that begins or
        ends has it; None where an even step is as likely.
    """

    percent: float
    standard_error_percent: float
    corner_percent: float | None = None


@dataclass(frozen=True, slots=True)
class CodesMultiplied(Feature):
    """A gain of frames after their rounding to codes.

    Attributes
    ----------
    percent
        Its size.
    half_range_percent
        Half the range of gains with the same missing codes.
    """

    percent: float
    half_range_percent: float


class ImagesExposure(WindowCheck[WindowExposure]):
    """Is the exposure the same in all frames?

    The largest jump of brightness from one frame to the next, at the same points, in percent; the number of frames of
    one value throughout; and the number of frames that were multiplied after they had been rounded.

    Why it matters
    --------------
    Event cameras measure ratios of brightness, and photometric losses compare them. A frame that is 2% brighter than
    its neighbours has a change of 0.02 nat that no event explains: a tenth of a common threshold at every pixel.

    How
    ---
    Points that both frames show are compared tile by tile (``fedora_qa/estimators/images/gain.py``): the gain is the
    median over tiles of the logarithm of the ratio of sums. The points follow from the fastest flow; without flow,
    coarse pixels at the same position are compared. The slow change of brightness is the median of the neighbouring
    pairs, and the pair with the most significant difference from it is judged. A single deviating frame gives a jump up
    and one down. A gain of rounded values leaves out exactly those codes (or puts two on one) that lie between its
    multiples: histograms of the frames determine it to a hundredth of a percent
    (``fedora_qa/estimators/images/gain.py``).

    Noise model
    -----------
    The error of a pair is that of a median over tiles, from their spread and from rounding, combined with the spread of
    all pairs (median absolute deviation). The bound is 0.2%, for points that the flow misses by part of a pixel.
    Without flow, motion makes tiles differ, and errors are ten times as large: only jumps of many percent are then
    detected. The probability that exactly the codes of one gain are missing by chance is less than a thousandth of the
    probability that any frequent code is missing.

    Cannot detect
    -------------
    Exposure that is wrong by one factor in all frames, and was so before rounding: it has no effect in the log model of
    events, and that of a threshold in the linear model. Gains of single tiles of the image. Constant vignetting
    (``images.vignetting``). Slow changes of light are no jump.

    Sources
    -------
    The canonical layout, version 1.0: DN = rint(clip(Y)); first principles, derivations in
    ``fedora_qa/estimators/images/gain.py``.
    """

    name = "images.exposure"
    needs = ("rgb",)

    def measure(self, window: Window) -> WindowExposure:
        """Compare every pair that the window owns."""
        gains = []
        for pair in pairs_with_flow(window) if flow_rate_of(window) else neighbours(window):
            gain = brightness_gain(*same_points(window, pair))
            if gain is not None:
                gains.append(
                    FramePairGain(
                        pair.before,
                        pair.after,
                        gain.log_gain,
                        gain.standard_error,
                        gain.corner_log_gain,
                        gain.corner_evidence,
                    )
                )
        blank, clipped, codes = [], [], np.zeros(CODES, dtype=np.int64)
        for frame in window.owned("rgb"):
            rgb = window.rgb(frame)
            if is_of_one_code(rgb):
                blank.append(frame)
            # Every fourth pixel along both axes: the share at 255 needs no more.
            sampled = ceil(rgb.shape[0] / _SAMPLED_EVERY_PX) * ceil(rgb.shape[1] / _SAMPLED_EVERY_PX)
            clipped.append(count_codes(rgb, _SAMPLED_EVERY_PX, codes) / max(sampled, 1))
        return WindowExposure(tuple(gains), tuple(blank), float(np.sum(clipped)), window.owned("rgb"), codes)

    def conclude(self, state: Sequence[WindowExposure], facts: Facts) -> Observation:
        """Find the largest jump, and count blank frames."""
        gains = sorted((gain for w in state for gain in w.gains), key=lambda gain: gain.before)
        blank = [frame for w in state for frame in w.blank]
        frames = sum(len(w.frames) for w in state)
        coverage = Coverage(len(gains), max(facts.sizes.get("path/rgb", 0) - 1, 0), "frame intervals")
        if frames and len(blank) == frames:
            return Observation(coverage, unobservable="every frame has only one value")
        measurements = [no_faults("blank_frames", "frames", "images.exposure.blank")]
        if blank:
            statement = f"{len(blank)} frames have only one value, the first of them frame {blank[0]}."
            where = _where(blank[0], blank[-1] + 1, facts)
            measurements = [
                count_of_faults(
                    "blank_frames",
                    len(blank),
                    "frames",
                    statement=statement,
                    code="images.exposure.blank",
                    where=where,
                )
            ]
        if len(gains) >= FEWEST_PAIRS:
            jumps = departures(np.array([gain.log_gain for gain in gains]))
            scatter = float(robust_sigma(jumps, 0.0))
            errors = np.hypot(scatter, [gain.standard_error for gain in gains])
            model_error_bound = MISREGISTRATION_PERCENT / 100
            # The most significant jump beyond misregistration, not the largest.
            worst = int(np.argmax((np.abs(jumps) - model_error_bound) / errors))
            # Brighter frames, one or several, give a jump up and one down of nearly equal size: the first is named.
            size, tolerance = abs(jumps[worst]), max(5 * float(errors[worst]), 0.2 * abs(jumps[worst]))
            first = int(np.flatnonzero(np.abs(np.abs(jumps) - size) < tolerance)[0])
            frame, percent = gains[first].after, 100 * expm1(float(jumps[first]))
            error = 100 * float(errors[worst])
            # Where the jump is: of neighbouring pairs without one, neither model is of interest.
            at_jump = gains[worst]
            is_of_corners = at_jump.corner_evidence > _CORNER_EVIDENCE
            corner_percent = 100 * expm1(at_jump.corner_log_gain) if is_of_corners else None
            measurements.append(
                Statistic(
                    name="largest_jump",
                    value=100 * float(abs(jumps[worst])),
                    unit="percent",
                    standard_error=error,
                    model_error_bound=100 * model_error_bound,
                    side="upper",
                    tests=len(gains),
                    sensitivity=sensitivity_range(100 * errors, 100 * model_error_bound),
                    statement=f"Frame {frame} is {abs(percent):.3g} +/- {error:.2g}% "
                    f"{'brighter' if percent > 0 else 'darker'} than frame {gains[first].before} at the same points.",
                    code="images.exposure.jump",
                    where=_where(frame, frame + 1, facts),
                    features=(BrightnessJump(percent, error, corner_percent),),
                )
            )
        # Without enough frequent codes a gain after rounding cannot be detected: the count is then not stated.
        codes = np.sum([w.codes for w in state], axis=0) if state else np.zeros(CODES, dtype=np.int64)
        if is_informative(codes):
            measurements.append(_frames_with_gain(state, codes, facts))
        clipped = sum(w.clipped for w in state) / max(frames, 1)
        notices = (
            (Notice("images.exposure.clipped", f"{clipped:.0%} of the pixels are at 255.", Where(stream="rgb")),)
            if clipped > CLIPPED_SHARE
            else ()
        )
        why = (
            ""
            if len(gains) >= FEWEST_PAIRS
            else "too few frames at the ends of the flow, or too few pixels that are neither dark nor clipped"
        )
        return Observation(coverage, tuple(measurements), notices, why)


def departures(log_gains: Float64) -> Float64:
    """Return the difference of each gain from the median of those around it.

    Parameters
    ----------
    log_gains
        (n,) logarithms of the brightness ratio of neighbouring frames, in the order of time; n at least 2.

    Returns
    -------
    ndarray of float64
        (n,) differences, positive for a jump to brighter.
    """
    around = [
        np.concatenate([log_gains[max(i - NEIGHBOURS, 0) : i], log_gains[i + 1 : i + 1 + NEIGHBOURS]])
        for i in range(len(log_gains))
    ]
    residuals: Float64 = log_gains - np.array([np.median(values) for values in around])
    return residuals


def _where(first: int, stop: int, facts: Facts) -> Where:
    """Return the time from a frame on until that of another, or until the last one."""
    times_ns = facts.clocks["rgb"].times_ns
    start_us, stop_us = (facts.to_file_us(int(times_ns[row])) for row in (first, min(stop, len(times_ns) - 1)))
    return Where(stream="rgb", start_us=start_us, stop_us=stop_us, frame=first)


def _frames_with_gain(windows: Sequence[WindowExposure], codes: NDArray[np.int64], facts: Facts) -> Statistic:
    """Return the count of frames with a gain, by the codes of all windows together, or else by those of each.

    A gain of a part of the file is detected in that part only, because the missing codes occur elsewhere.
    """
    # A gain of the whole file leaves out the same codes in all windows; one of a part does so in its own windows only.
    of_all = gain_after_rounding(codes)
    gains = [
        (w.frames, gain)
        for w in windows
        if len(w.frames) and (gain := of_all or gain_after_rounding(w.codes)) is not None
    ]
    where, statement, features = Where(stream="rgb"), "", tuple[Feature, ...]()
    if gains:
        first, last = gains[0][0].start, gains[-1][0].stop - 1
        # The gain with the narrowest range has the smallest error.
        sharpest = min((gain for _, gain in gains), key=lambda gain: gain.half_range)
        percent, half_range_percent = 100 * (sharpest.gain - 1), 100 * sharpest.half_range
        start_us, stop_us = (facts.to_file_us(int(facts.clocks["rgb"].times_ns[row])) for row in (first, last))
        where = Where("rgb", start_us, stop_us, index_start=first, index_stop=last + 1, frame=first)
        statement = (
            f"Frames {first} to {last} were made {percent:+.4g} +/- {half_range_percent:.2g}% brighter after they had "
            "been rounded to 8 bits: exactly the codes between the multiples of this gain are missing, or codes that "
            "fall on one are doubled."
        )
        features = (CodesMultiplied(percent, half_range_percent),)
    return Statistic(
        name="frames_with_gain_after_rounding",
        value=float(sum(len(frames) for frames, _ in gains)),
        unit="frames",
        standard_error=0.0,
        resolution=1.0,
        statement=statement,
        code="images.exposure.rounded_before",
        where=where,
        features=features,
    )

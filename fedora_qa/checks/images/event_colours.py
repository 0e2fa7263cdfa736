"""Colours of frames regressed on events: sums of a window, the fit of a file, and the base of both checks of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.events.levels import LevelImages, LevelPairs, level_pairs
from fedora_qa.estimators.images.channel_noise import channel_noise_variances, spread_patches
from fedora_qa.estimators.images.event_colours import (
    ColourBlocks,
    ColourFit,
    colour_blocks,
    colour_columns,
    concatenate_colours,
    curve_slopes,
    edge_aware_colours,
    fit_colours,
    signal_secants,
)
from fedora_qa.estimators.images.gain import CODES, exponent_after_rounding
from fedora_qa.estimators.images.luma import TRANSFERS, to_code, to_linear
from fedora_qa.estimators.images.values import count_codes
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_axes import turned_frame
from fedora_qa.views.event_camera import event_footprints, resampled_frames, why_frames_and_events_do_not_meet
from fedora_qa.views.level_samples import FEWEST_PAIRS, LINEAR_LEAST_TICKS, hot_pixels, least_dn
from fedora_qa.views.sensor_events import local_tick_ns, pixel_events

_SAMPLED_EVERY_PX: Final = 4
"""Every fourth pixel along both axes of a frame: its codes need no more."""

ENOUGH_PAIRS: Final = 1500
"""Number of pairs of the shortest gaps that are taken of a window."""

LONGEST_GAP_NS: Final = 60_000_000
"""Longest gap between events, ns: three times that of threshold fits. Errors of the level are common to all channels
and mostly cancel in the weights, so the level may have larger errors, and small frames have more samples. The fit by
straight lines bounds the error."""

QUARTERS: Final = 4
FEWEST_BLOCKS: Final = 8
"""Quarters of the image in two windows: with fewer, the spread between them is no standard error."""

UNRELATED: Final = 0.7
"""Largest share of the variance of the events that frames do not explain: with more, they show another scene, or have
only rounding."""


@dataclass(frozen=True, slots=True)
class ColourSums:
    """Normal equations of a window, in one block for each quarter of the image.

    Attributes
    ----------
    samples
        Number of pairs of level samples.
    by_curve
        By transfer curve, the declared one first. Other curves are applied to means over footprints, which is accurate
        enough to select the curve.
    straight
        By the declared curve, with straight lines between events in place of cubics.
    codes
        (256,) number of values of each code among some pixels of the frames.
    """

    samples: int
    by_curve: tuple[ColourBlocks, ...]
    straight: ColourBlocks
    codes: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ColourResponse:
    """The fit of a file.

    Attributes
    ----------
    fit
        Under the declared curve.
    best_curve
        Transfer curve with the smallest residual.
    exponent_of_codes
        Of the power law through which rounded values went, by the codes that are absent; None where there is none.
    """

    fit: ColourFit
    best_curve: str
    exponent_of_codes: float | None = None


def colour_sums(window: Window) -> ColourSums | None:
    """Return the sums of a window; None where it has too few level samples."""
    return window.derived(_colour_sums)


def _colour_sums(window: Window) -> ColourSums | None:
    frames, declared = resampled_frames(window), window.facts.declared.events
    if declared is None or len(frames) < 2:
        return None
    refractory_ns = int(2 * declared.refractory_us * NS_PER_US)
    # Where rounding is small against a threshold: not saturated, not declared hot.
    darkest_dn, hot = least_dn(window, declared), hot_pixels(declared, frames)
    if declared.is_lin_log:
        # The regression has the secants of the logarithm.
        darkest_dn = max(darkest_dn, declared.linear_below_dn - declared.log_eps_dn)
    light = frames.uniform_dn, frames.uniform_dn, frames.error_dn, darkest_dn, hot
    pairs = level_pairs(
        pixel_events(window),
        frames.times_ns,
        LevelImages(*light),
        longest_gap_ns=LONGEST_GAP_NS,
        least_gap_ns=LINEAR_LEAST_TICKS * local_tick_ns(window) if declared.model == "linear" else refractory_ns,
        off_over_on=declared.threshold_off / declared.threshold_on,
    ).tightest(ENOUGH_PAIRS)
    # Leak events are brighter events without a rise of the level.
    elapsed_s = (frames.times_ns[pairs.later] - frames.times_ns[pairs.earlier]) / NS_PER_S
    pairs.regressors[:, 0] -= declared.leak_rate_hz * elapsed_s
    if len(pairs) < FEWEST_PAIRS:
        return None
    height, width = frames.uniform_dn.shape[1:]
    rows, columns = np.divmod(pairs.pixels, width)
    # Blocks of the jackknife: 2 x 2 quarters of the image, numbered row by row.
    quarter: NDArray[np.intp] = (2 * (2 * rows // height) + 2 * columns // width).astype(np.intp)
    # Linear R, G, B (m, 3) of each pair's pixel at its earlier and its later frame, in DN. Frames are 8-bit: a table of
    # 256 codes covers all values.
    transfer = window.facts.declared.transfer
    linear_dn = to_linear(np.arange(256.0), transfer)
    colours = np.empty((len(pairs), 3)), np.empty((len(pairs), 3))
    # Variance of the difference of both by noise of single channels, DN^2.
    noise_dn2 = np.zeros((len(pairs), 3))
    codes = np.zeros(CODES, dtype=np.int64)
    for i, frame in enumerate(frames.frames):
        at_start, at_end = pairs.earlier == i, pairs.later == i
        if not (at_start.any() or at_end.any()):
            continue
        rgb = turned_frame(window, window.rgb(int(frame)))
        count_codes(rgb, _SAMPLED_EVERY_PX, codes)
        prints = event_footprints(window, (rgb.shape[0], rgb.shape[1]))
        of_channels_dn2 = window.derived_image(_channel_noise_dn2, int(frame))
        of_rows, of_columns = ((axis.edge_aware.weights**2).sum(axis=1) for axis in (prints.rows, prints.columns))
        for at_frame, rgb_dn in zip((at_start, at_end), colours, strict=True):
            rgb_dn[at_frame] = edge_aware_colours(prints, rgb, linear_dn, pairs.pixels[at_frame])
            averaged = of_rows[rows[at_frame]] * of_columns[columns[at_frame]]
            noise_dn2[at_frame] += averaged[:, np.newaxis] * of_channels_dn2

    def sums(curve: str, pairs: LevelPairs) -> ColourBlocks:
        steps = np.array([declared.threshold_on, declared.threshold_off])
        events, delay = pairs.regressors[:, :2] @ steps, pairs.regressors[:, 2:] @ steps
        # The declared curve recovers the stored codes, which the tested curve then linearises.
        earlier, later = (each if curve == transfer else to_linear(to_code(each, transfer), curve) for each in colours)
        regressors = colour_columns(earlier, later, declared.model, declared.log_eps_dn)
        slopes = curve_slopes(earlier, later)
        secants = signal_secants(earlier, later, declared.model, declared.log_eps_dn)
        noise = noise_dn2 * secants[:, np.newaxis] ** 2
        return colour_blocks(np.column_stack([regressors, -delay]), events, slopes, noise, quarter, QUARTERS)

    by_curve = tuple(sums(curve, pairs) for curve in _curves(transfer))
    return ColourSums(len(pairs), by_curve, sums(transfer, pairs.with_straight_lines()), codes)


def _channel_noise_dn2(window: Window, frame: int) -> NDArray[np.float64]:
    """Return the variances (3,) of noise of single channels in a colour frame, DN^2 of linear light."""
    patches = spread_patches(turned_frame(window, window.rgb(frame)))
    return channel_noise_variances(to_linear(np.arange(256.0), window.facts.declared.transfer)[patches])


def _curves(declared: str) -> tuple[str, ...]:
    """Return the tested transfer curves, the declared one first."""
    return (declared, *(curve for curve in TRANSFERS if curve != declared))


_TOO_FEW: Final = "too few pairs of frames at which events determine a level (slow motion, little texture, or dark)"
_ALIKE: Final = "the channels of the frames are equal or proportional, as in grey images, and have no separate weights"


class ColourCheck(WindowCheck[ColourSums]):
    """A check of the colours of frames by their regression on events."""

    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> ColourSums | None:
        """Sum the window's level samples."""
        return colour_sums(window)

    def conclude(self, state: Sequence[ColourSums], facts: Facts) -> Observation:
        """Fit the whole file and state the result."""
        samples = sum(sums.samples for sums in state)
        coverage = Coverage(samples, samples, "level samples")
        declared, curves = facts.declared.events, _curves(facts.declared.transfer)
        by_curve = (
            [concatenate_colours([sums.by_curve[i] for sums in state]) for i in range(len(curves))] if state else []
        )
        if not by_curve or len(by_curve[0]) < FEWEST_BLOCKS or declared is None:
            return Observation(coverage, unobservable=_TOO_FEW)
        linear = declared.model == "linear"
        fits = [fit_colours(blocks, with_exponent=False) for blocks in by_curve]
        # Proportional channels have no separate weights, by any curve.
        if any(np.isnan(fit.variance) for fit in fits):
            return Observation(coverage, unobservable=_ALIKE)
        best = int(np.argmin([fit.variance for fit in fits]))
        if not fits[best].unexplained < UNRELATED:
            why = (
                f"frames do not explain {fits[best].unexplained:.0%} of the variance of the events: they do not belong "
                "together (see event_response.orientation)"
            )
            return Observation(coverage, unobservable=why)
        # Only the linear model separates an exponent from the thresholds (class docstring of images.transfer).
        fit = fit_colours(by_curve[0], with_exponent=linear, frame_variance=fits[best].variance)
        # Straight lines in place of cubics bound the error of the level between events.
        straight = fit_colours(concatenate_colours([sums.straight for sums in state]), with_exponent=linear)
        exponent = exponent_after_rounding(np.sum([sums.codes for sums in state], axis=0))
        response = ColourResponse(fit.widened(straight), curves[best], exponent)
        measured = self.state(response, declared, facts)
        return Observation(coverage, measured, unobservable=self.why_blind(response))

    def why_blind(self, response: ColourResponse) -> str:
        """Return why the smallest fault is not detectable in the file, in addition to the detection limits."""
        return ""

    def state(self, response: ColourResponse, declared: EventModel, facts: Facts) -> tuple[Statistic, ...]:
        """Return the measurements of the fit."""
        raise NotImplementedError

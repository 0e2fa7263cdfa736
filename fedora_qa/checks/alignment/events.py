"""Events against colour: position in the image, for any polarity and thresholds."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.alignment.edge_shifts import CameraPairShift, colour_edges, event_edges, events_at_depth_steps
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.events.far_shift import FarSums, far_shift, far_sums, joined
from fedora_qa.estimators.events.shift import (
    RADIUS_PX,
    auto_correlation,
    cross_correlation,
    slope_sums,
    slopes_where_fired,
)
from fedora_qa.estimators.events.shift_errors import open_level_errors, step_of_level
from fedora_qa.estimators.events.shift_kernels import change_and_events
from fedora_qa.estimators.fitting.robust import jackknife_errors
from fedora_qa.estimators.images.registration import PEAK_RADIUS_PX, registered_shift
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import why_not_one_view
from fedora_qa.views.depth_edges import DARK_DN, DepthEdges, depth_edges
from fedora_qa.views.event_camera import intervals_due, resampled_frames
from fedora_qa.views.event_depth_edges import EventDepthEdges, event_depth_edges, only_depth_locates_events
from fedora_qa.views.frames import is_large, turn_of

Float64 = NDArray[np.float64]

INTERVALS: Final = 3
"""Frame intervals of a window that are correlated, evenly spread; short windows use up to twice as many a second. The
errors of more intervals are correlated: in 1 s of 1440x1080, 50 intervals give no smaller error than 30."""

FEWEST_INTERVALS: Final = 4

REACH_PX: Final = RADIUS_PX - PEAK_RADIUS_PX
"""Largest shift that is registered at full resolution, px; larger ones are measured on blocks of pixels."""

_MOST_GROUPS: Final = 12
"""Groups of successive intervals that are left out in turn."""

LEAST_CORRELATION: Final = 0.1
"""Least correlation coefficient of events and frames of one scene; unrelated ones reach 0.03."""

_SHIFTS: Final = 29 * 29
"""Shifts of up to fourteen pixels in both directions."""

_BY_CHANCE: Final = 1e-4
"""Probability with which events that have nothing to do with the frames have a peak: the false-alarm rate of a file."""


@dataclass(frozen=True, slots=True)
class IntervalCorrelations:
    """Sums over the lit pixels of some frame intervals of a window.

    Attributes
    ----------
    auto, cross
        (k, s, s) correlation of the frames' absolute change with itself, and with the number of events.
    sums
        (k, 4) number of pixels and of events, and sums of squares of the absolute change and of the number of events
        about their means, over all pixels.
    slopes
        (k, 3, 2) sums of slopes of the level as in ``slopes_where_fired``, and of its change as in ``slope_sums``.
    far
        Correlations of the same pixels at half the resolution, for shifts beyond the reach of ``cross``.
    edges
        Edges of colour and of events at steps of depth, which separate shifts of both cameras.
    """

    auto: Float64
    cross: Float64
    sums: Float64
    slopes: Float64
    far: FarSums
    edges: DepthEdges | None


class AlignmentEvents(WindowCheck[IntervalCorrelations | EventDepthEdges]):
    """Do events lie at the pixels where frames change, for any polarity, thresholds and sensor model?

    The shift of events against colour frames, in px of the event camera, to the right and down. Where frames have
    another centre or lens than events: the shift of events against the steps of depth, to the right, down and away from
    the principal point, and the increase of the agreement by a lens that is not declared. With flow: the delay of
    events against colour that depth carries into their view, in ms.

    Why it matters
    --------------
    Frames and events are used together pixel by pixel. One wrong crop or half-pixel convention displaces all edges of
    one against those of the other. The question is that of ``event_response.alignment``, without declared thresholds.

    How
    ---
    The number of events between two frames is cross-correlated with the absolute change of log luma, of a sensor that
    is declared linear with that of luma. The sum over intervals is registered on the autocorrelation of that change, to
    a hundredth of a pixel for shifts of up to four pixels. Larger shifts, up to fourteen pixels, are measured to half a
    pixel on blocks of 2 x 2 pixels. Pixels with events of both signs are left out: a change that reverses between the
    frames is not in their difference, and in rotations of tens of pixels a frame it comes from other rows. Where depth
    exists, it determines which camera is shifted: a shift must also explain colour against depth, and events against
    depth. A peak is one where the correlation exceeds what as many events reach at any of the shifts by chance.

    A colour camera beside the events has parallax, and one of another lens has other pixels: events are then located by
    depth alone. Steps of depth are projected into the event camera through both lenses, and the profiles of event
    counts around them are those of ``alignment.depth``, of the events up to 10 ms before and after a depth frame. The
    same is done with outlines that further distortions of the third order displace, by up to 64 px at the corners.

    The delay is measured where a colour frame and the begin or the end of a field of flow lie within 30 ms of a depth
    frame. Depth carries the colour frame into the view of depth, without points that the colour camera does not see and
    without outlines, and each point moves with the velocity of the flow. This gives the level of each pixel of the
    event camera around the frame, and from it the events of 5 to 50 ms on both sides, for any threshold: the reference
    of a pixel follows its level as in a mechanical play of the width of the threshold. Sums of positive less negative
    events are fitted with a gain, a delay, the width of the play, and a shift to the right and down. A delay moves
    events by the velocity of each pixel times the delay, a shift moves all alike, and the lag by the play is a part of
    a threshold whatever the velocity: they are separate where velocities and contrasts vary over image and time. The
    interval of the events is moved by up to 30 ms, to where nothing is left. Of the logarithm and the luma itself, and
    of eight thresholds, those are taken that explain most.

    Noise model
    -----------
    The size of a step, C, is estimated from the data, by the regression of the number of events on the change. What the
    regression leaves is the error by levels between two events, from which the standard error follows. The spread when
    segments of time are left out in turn is used where it is larger. The model error bound is the lag: a level that has
    risen is above its reference by C/2 on average, so that events lag a constant drift by at most C/2 mean|g| / mean
    g^2, with g the slope of the level; means are weighted by the change, as pixels fire in proportion to it. Against
    depth the errors and bounds are those of ``alignment.depth``, and the lag is bounded by 1 / (2 k) px, with k the
    events of one polarity of a pixel: they have crossed k steps C of an edge that passes within a pixel. The error of
    an advantage is a jackknife of the difference, in which texture that both share has no part. The error of the delay
    is a jackknife over nine parts of the image and up to twelve groups of frames. Its bound is the change by a play
    whose width is not fitted.

    Cannot detect
    -------------
    A shift smaller than the lag. A shift of a part of the time or of the image, except in the mean. Shifts beyond
    fourteen pixels, which leave no correlation. Against depth: a lens that is wrong by so little that its corners move
    by less than about eight pixels, except through the mean shift away from the principal point. A delay of more than
    30 ms, or without flow; whether events are late, or colour early. A late stream appears shifted along the mean
    motion, and is suspected as well.

    Sources
    -------
    M. Guizar-Sicairos, S. Thurman, J. Fienup, Opt. Lett. 33 (2008) for the registration; derivations in
    ``fedora_qa/estimators/events/shift.py`` and ``fedora_qa/estimators/events/tracked_level.py``.
    """

    name = "alignment.events"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, whose axes differ by 10 deg at most."""
        if only_depth_locates_events(facts):
            return ""
        return why_not_one_view(facts, "events", "rgb", rotated=True)

    def measure(self, window: Window) -> IntervalCorrelations | EventDepthEdges | None:
        """Correlate some intervals of the window, or add up the profiles of events at steps of depth."""
        if only_depth_locates_events(window.facts):
            return event_depth_edges(window)
        frames = resampled_frames(window)
        if len(frames) < 2:
            return None
        intervals = min(INTERVALS, intervals_due(window, frames, 2 * INTERVALS))
        if intervals <= 0:
            return None
        # In short windows rounding puts several places of an even spread on one interval.
        chosen = np.unique(np.linspace(0, len(frames) - 2, intervals).round().astype(int))
        rgb = window.facts.declared.cameras["rgb"]
        by_quarters = is_large(rgb.width * rgb.height, window)
        height = frames.uniform_dn.shape[1]
        # Steps of a linear sensor are equal in light: in log they are smaller where it is brighter, and the brighter
        # side of each edge would have more events than its change asks for.
        declared = window.facts.declared.events
        is_linear = declared is not None and declared.model == "linear"
        auto, cross, sums, slopes, far = [], [], [], [], []
        for interval in chosen.tolist():
            # In large frames each interval uses one quarter of the image, in turn. The uncertainty between events
            # differs more over the image than over time, so all quarters together have the error of the whole image. In
            # 1 s of 1440x1080 standard errors are 0.014 and 0.030 px, against 0.011 and 0.018 px; limits, mostly due to
            # the lag, are 9% and 23% larger.
            rows = slice(None)
            if by_quarters:
                quarter = int(4 * turn_of(int(frames.frames[interval])))
                rows = slice(quarter * height // 4, (quarter + 1) * height // 4)
            # The mean over a footprint is taken of linear intensity, before the logarithm: averages of logarithms have
            # larger errors at sharp edges. DARK_DN limits the effect of rounding in dark pixels.
            ends_dn = (frames.uniform_dn[frame, rows] for frame in (interval, interval + 1))
            before, after = (dn if is_linear else np.log(dn + DARK_DN) for dn in ends_dn)
            error_before_dn, error_after_dn = frames.error_dn[interval, rows], frames.error_dn[interval + 1, rows]
            counts = np.ascontiguousarray(frames.counts[interval, :, rows])
            change, events, usable, sums_of_interval = change_and_events(
                before, after, error_before_dn, error_after_dn, counts
            )
            slopes_of_interval = slope_sums(before, change, usable)
            # Only pixels that fire lag behind the level; the uncertainty between events concerns every usable pixel.
            slopes_of_interval[:2] = slopes_where_fired(before, change, usable)
            # Slopes are sums over pixels: those of a quarter are extrapolated to all rows.
            slopes_of_interval *= height / len(before)
            auto.append(auto_correlation(change, usable))
            cross.append(cross_correlation(change, events, usable))
            sums.append(sums_of_interval)
            slopes.append(slopes_of_interval)
            far.append(far_sums(change, events, usable))
        return IntervalCorrelations(
            np.array(auto), np.array(cross), np.array(sums), np.array(slopes), joined(far), depth_edges(window)
        )

    def conclude(self, state: Sequence[IntervalCorrelations | EventDepthEdges], facts: Facts) -> Observation:
        """Register the sums of all intervals, or locate the peaks of the profiles."""
        at_steps = [window for window in state if isinstance(window, EventDepthEdges)]
        if only_depth_locates_events(facts):
            return events_at_depth_steps(at_steps, len(facts.clocks["depth"].times_ns))
        return self._registered([window for window in state if isinstance(window, IntervalCorrelations)], facts)

    def _registered(self, state: Sequence[IntervalCorrelations], facts: Facts) -> Observation:
        """Register the sums of all intervals."""
        intervals = max(len(facts.clocks["rgb"].times_ns) - 1, 0)
        coverage = Coverage(sum(len(window.sums) for window in state), intervals, "frame intervals")
        if coverage.seen < FEWEST_INTERVALS:
            return Observation(coverage, unobservable="fewer than four frame intervals with events")
        auto, cross, sums, slopes = (
            np.concatenate([getattr(window, name) for window in state]) for name in ("auto", "cross", "sums", "slopes")
        )
        pixels, events, change_squares, event_squares = sums.sum(axis=0)
        # A shift beyond the reach has no peak within it, so the coarse search has precedence.
        # The coefficient of n unrelated events is about normal with the variance 1/n, and the largest of m exceeds x
        # with a probability of at most m exp(-n x^2 / 2).
        least = max(LEAST_CORRELATION, sqrt(2 * log(_SHIFTS / _BY_CHANCE) / max(events, 1.0)))
        far = far_shift(joined([window.far for window in state]), REACH_PX, least)
        if far is None:
            # Correlation coefficient: covariance over the root of both sums of squares; 1e-300 keeps it finite where
            # nothing changes.
            all_auto, all_cross = auto.sum(axis=0), cross.sum(axis=0)
            strength = float(all_cross.max() / max(np.sqrt(change_squares * event_squares), 1e-300))
            shift = registered_shift(all_auto, all_cross)
            if strength < least or shift is None:
                why = f"events and frames have a correlation of at most {strength:.2g} within {REACH_PX} px; "
                why += f"{events:.0f} events reach {min(least, 1.0):.2g} by chance"
                return Observation(coverage, unobservable=why)
            # Delete-one jackknife over groups of intervals.
            groups = np.array_split(np.arange(len(auto)), min(len(auto), _MOST_GROUPS))
            partial = [
                registered_shift(all_auto - auto[g].sum(axis=0), all_cross - cross[g].sum(axis=0)) for g in groups
            ]
            fitted_px = [(each.right_px, each.down_px) for each in partial if each is not None]
            # A peak that does not exist without one group depends on that group alone.
            if len(fitted_px) < len(partial):
                return Observation(coverage, unobservable="the peak depends on single segments of time")
            spread_px = jackknife_errors(fitted_px)
        else:
            shift, spread_px, strength = far.shift, far.errors_px, far.strength
        _, lags_px = open_level_errors(slopes.mean(axis=0), step_of_level(strength, change_squares, event_squares))
        # The change by frames differs from the steps by e of variance sigma^2 (1 / r^2 - 1). A regression of e on the
        # slope h of the change has the standard error sigma_e / sqrt(sum h^2). Successive intervals share e.
        open_variance = change_squares / pixels * (1 / strength**2 - 1)
        level_errors_px = np.sqrt(open_variance / np.maximum(slopes.mean(axis=0)[2], 1e-300))
        # Not added: the spread over time contains the part of the open levels that differs between intervals.
        errors_px = np.maximum(spread_px, level_errors_px)

        # Depth against colour and against events: a shift of one camera must explain all pairs.
        total_errors_px = np.hypot(errors_px, lags_px)
        shift_px = (float(shift.right_px), float(shift.down_px))
        pairs = [CameraPairShift("rgb", "events", shift_px, (float(total_errors_px[0]), float(total_errors_px[1])))]
        edges = [window.edges for window in state if window.edges is not None]
        if edges:
            against_depth = (
                colour_edges(edges)[0].against_depth("rgb"),
                event_edges(edges).against_depth("events"),
            )
            pairs += [pair for pair in against_depth if pair is not None]

        return Observation(
            coverage,
            tuple(
                Statistic(
                    name=f"shift_{direction}",
                    value=value_px,
                    unit="px",
                    standard_error=float(error_px),
                    model_error_bound=float(lag_px),
                    statement=f"Events lie {value_px:+.3g} +/- {error_px:.2g} px ({direction} positive) from the "
                    "changes of the frames.",
                    code="alignment.events.shift",
                    where=Where(stream="events"),
                    features=tuple(pairs),
                )
                for direction, value_px, error_px, lag_px in zip(
                    ("right", "down"), shift_px, errors_px, lags_px, strict=True
                )
            ),
        )

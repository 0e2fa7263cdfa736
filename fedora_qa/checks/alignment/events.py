"""Events against colour: place in the image, whatever their polarity and thresholds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.alignment.edge_shifts import colour_edges, event_edges
from fedora_qa.checks.alignment.odd_one_out import PairShift, shift_suspects
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.estimators.events.far_shift import FarSums, far_shift, far_sums, joined
from fedora_qa.estimators.events.frame_changes import change_and_events
from fedora_qa.estimators.events.shift import (
    RADIUS_PX,
    auto_correlation,
    cross_correlation,
    open_level_errors,
    slope_sums,
)
from fedora_qa.estimators.images.registration import PEAK_RADIUS_PX, registered_shift
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import why_not_one_view
from fedora_qa.views.depth_edges import DARK_DN, DepthEdges, depth_edges
from fedora_qa.views.event_camera import ResampledFrames, intervals_due, resampled_frames
from fedora_qa.views.large_frames import is_large, turn_of

Float64 = NDArray[np.float64]

INTERVALS: Final = 3
"""Frame intervals of a window that are correlated, evenly spread; shorter windows than usual take up to twice as many a
second. Beyond that stretches of time err alike: of a second of 1440 x 1080, all 50 intervals told no more than 30."""

FEWEST_INTERVALS: Final = 4

REACH_PX: Final = RADIUS_PX - PEAK_RADIUS_PX
"""Farthest shift that is registered; farther ones are told by blocks of pixels."""

_MOST_GROUPS: Final = 12
"""Groups of successive intervals that are left out in turn."""

LEAST_CORRELATION: Final = 0.1
"""Below this, events and frames are not of one scene, and a peak is chance (unrelated ones reach 0.03)."""


@dataclass(frozen=True, slots=True)
class Registration:
    """Sums over the lit pixels of some frame intervals of a window.

    Attributes
    ----------
    auto, cross
        (k, s, s) correlation of the frames' absolute change with itself, and with the number of events.
    sums
        (k, 4) absolute change of the pixels that fire, their events, and squares of all pixels' beyond the means.
    slopes
        (k, 3, 2) as ``slope_sums`` gives them: slopes of the level where pixels fire, slopes of its change everywhere.
    far
        The same pixels at half the resolution, for shifts beyond the reach of ``cross``.
    edges
        The same window's depth against colour and events, which tells the odd one out.
    """

    auto: Float64
    cross: Float64
    sums: Float64
    slopes: Float64
    far: FarSums
    edges: DepthEdges | None


class AlignmentEvents(WindowCheck[Registration]):
    """Do events lie at the pixels where frames change, whatever their polarity, thresholds and sensor model?

    The shift of events against colour frames, in px of the event camera, to the right and down.

    Why it matters
    --------------
    Frames and events are used together, pixel by pixel: one wrong crop or half-pixel convention and edges of the one
    lie beside edges of the other. It asks what ``event_response.alignment`` asks, without declared thresholds.

    How
    ---
    The number of events between two frames is cross-correlated with the absolute change of log luma, and the sum over
    intervals is registered on the autocorrelation of that change, to a hundredth of a pixel and up to four pixels; and
    up to fourteen, to half a pixel, on blocks of 2 x 2 pixels.
    Pixels with events of both signs are left out: what passed between the frames is not in their difference, and in
    turns of tens of pixels a frame it comes from other rows.
    Depth, where it is there, tells which camera is off: a shift must explain colour against depth and events against
    depth too.

    Noise model
    -----------
    The size of a step, C, is taken from the data: the change of all pixels that fire over their events. What a level
    leaves open between two events has a variance of 2/3 C^2, from which the standard error follows; the spread when
    stretches of time are left out in turn counts where it is larger. The allowance is the lag: a level that has risen
    lies above its reference by C/2 on average, so that events follow an even drift by at most C/2 mean|g| / mean g^2,
    with g the slope of the level where pixels fire.

    Cannot see
    ----------
    A shift of less than the lag; a shift of a part of the time or of the image, except in the mean; shifts beyond
    fourteen pixels, which leave no correlation. A late stream appears shifted along the mean motion and is suspected
    as well.

    Sources
    -------
    M. Guizar-Sicairos, S. Thurman, J. Fienup, Opt. Lett. 33 (2008) for the registration; derivations in
    ``shift``.
    """

    name = "alignment.events"
    needs = ("events", "rgb")
    _MATTERS_PX: Final = 2.0

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place."""
        return why_not_one_view(facts, "events", "rgb")

    def measure(self, window: Window) -> Registration | None:
        """Correlate some intervals of the window."""
        seen = resampled_frames(window)
        if len(seen) < 2:
            return None
        wanted = min(INTERVALS, intervals_due(window, seen, 2 * INTERVALS))
        if wanted <= 0:
            return None
        chosen = np.unique(np.linspace(0, len(seen) - 2, wanted).round().astype(int))
        rgb = window.facts.declared.cameras["rgb"]
        quarters = is_large(rgb.width * rgb.height, window)
        parts = [_interval(seen, int(i), _quarter(seen, int(i)) if quarters else slice(None)) for i in chosen]
        *near, far = zip(*parts, strict=True)
        auto, cross, sums, slopes = (np.array(part) for part in near)
        return Registration(auto, cross, sums, slopes, joined(far), depth_edges(window))

    def conclude(self, state: Sequence[Registration], facts: Facts) -> Observation:
        """Register the sums of all intervals."""
        intervals = max(len(facts.clocks["rgb"].times_ns) - 1, 0)
        coverage = Coverage(sum(len(one.sums) for one in state), intervals, "frame intervals")
        if coverage.seen < FEWEST_INTERVALS:
            return Observation(coverage, unobservable="fewer than four frame intervals with events")
        auto, cross, sums, slopes = (
            np.concatenate([getattr(one, name) for one in state]) for name in ("auto", "cross", "sums", "slopes")
        )
        change, events, change_squares, event_squares = sums.sum(axis=0)
        far = far_shift(joined([one.far for one in state]), REACH_PX, LEAST_CORRELATION)
        if far is None:
            strength = float(cross.sum(axis=0).max() / max(np.sqrt(change_squares * event_squares), 1e-300))
            found = registered_shift(auto.sum(axis=0), cross.sum(axis=0))
            if strength < LEAST_CORRELATION or found is None or events == 0:
                why = f"events and frames correlate by no more than {strength:.2g} within {REACH_PX} px"
                return Observation(coverage, unobservable=why)
            spread = _jackknife(auto, cross)
            if spread is None:
                return Observation(coverage, unobservable="the peak depends on single stretches of time")
        else:
            found, spread = far.shift, far.errors_px
        left_open, lags = open_level_errors(slopes.mean(axis=0), float(change / events))
        shift_px, errors = np.array([found.right_px, found.down_px]), np.maximum(spread, left_open)
        suspects = (*_suspects(state, shift_px, np.hypot(errors, lags), facts), *_OTHERS)
        return Observation(coverage, tuple(self._one(axis, shift_px, errors, lags, suspects) for axis in (0, 1)))

    def _one(
        self, axis: int, shift_px: Float64, errors: Float64, lags: Float64, suspects: tuple[Suspect, ...]
    ) -> Statistic:
        name, word = (("shift_right", "right"), ("shift_down", "down"))[axis]
        value, error = float(shift_px[axis]), float(errors[axis])
        return Statistic(
            name=name,
            value=value,
            unit="px",
            standard_error=error,
            model_error_bound=float(lags[axis]),
            material=self._MATTERS_PX,
            statement=f"Events lie {value:+.3g} +/- {error:.2g} px ({word} positive) from where the frames change.",
            code="alignment.events.shift",
            where=Where(stream="events"),
            suspects=suspects,
        )


_OTHERS: Final = (
    Suspect("time_offset", "events", 0.5),
    Suspect("time_offset", "rgb", 0.5),
    Suspect("clock_rate", "events", 0.4),
)
"""What shifts events along the motion of the image."""


def _quarter(seen: ResampledFrames, i: int) -> slice:
    """Return the rows that are looked at between two large frames: each quarter of the image has its turn.

    What events leave open differs from place to place more than over time, so that all quarters together err as the
    whole image does: of 1 s of 1440x1080 standard errors are 0.014 and 0.030 px, for 0.011 and 0.018, and limits, which
    are those of the lag for the most part, 9% and 23% larger.
    """
    number, height = int(4 * turn_of(int(seen.frames[i]))), seen.uniform_dn.shape[1]
    return slice(number * height // 4, (number + 1) * height // 4)


def _interval(seen: ResampledFrames, i: int, rows: slice) -> tuple[Float64, Float64, Float64, Float64, FarSums]:
    """Return the sums of one frame interval over some rows, as in ``Registration``; slopes as if all were like them."""
    before, after = (np.log(seen.uniform_dn[frame, rows] + DARK_DN) for frame in (i, i + 1))
    earlier, later = seen.error_dn[i, rows], seen.error_dn[i + 1, rows]
    counts = np.ascontiguousarray(seen.counts[i, :, rows])
    change, events, usable, sums = change_and_events(before, after, earlier, later, counts)
    slopes = slope_sums(before, change, usable)
    slopes[:2] = slope_sums(before, change, events > 0)[:2]
    slopes *= seen.uniform_dn.shape[1] / len(before)
    auto, cross = auto_correlation(change, usable), cross_correlation(change, events, usable)
    return auto, cross, sums, slopes, far_sums(change, events, usable)


def _jackknife(auto: Float64, cross: Float64) -> Float64 | None:
    """Return the spread (2,) of the shift when groups of intervals are left out in turn; None where it is lost."""
    groups = np.array_split(np.arange(len(auto)), min(len(auto), _MOST_GROUPS))
    all_auto, all_cross = auto.sum(axis=0), cross.sum(axis=0)
    found = [registered_shift(all_auto - auto[g].sum(axis=0), all_cross - cross[g].sum(axis=0)) for g in groups]
    known = [(shift.right_px, shift.down_px) for shift in found if shift is not None]
    if len(known) < len(found):
        return None
    spread: Float64 = np.sqrt((len(known) - 1) * np.var(known, axis=0))
    return spread


def _suspects(state: Sequence[Registration], shift_px: Float64, error_px: Float64, facts: Facts) -> tuple[Suspect, ...]:
    """Weigh the cameras by all pairs that can be had."""
    pairs = [PairShift("rgb", "events", shift_px, error_px)]
    edges = [one.edges for one in state if one.edges is not None]
    if edges:
        against_depth = (colour_edges(edges)[0].pair("rgb"), event_edges(edges).pair("events"))
        pairs += [pair for pair in against_depth if pair is not None]
    return shift_suspects(pairs, facts.declared.cameras)

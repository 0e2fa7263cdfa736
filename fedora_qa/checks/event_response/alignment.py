"""Events against log intensity: place in the image."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_response.shifted import CLEAR, PartSums, Shifted, added, most_shifted, stacked, tiles_of
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import US_PER_S
from fedora_qa.estimators.events.far_shift import FarSums, far_shift, far_sums, joined
from fedora_qa.estimators.events.registration_errors import open_level_errors
from fedora_qa.estimators.events.shift import RADIUS_PX, Interval, Shift, intervals, peak
from fedora_qa.estimators.events.shift_kernels import KEPT, SETTLED, USABLE
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import USUAL_PIXELS, Window
from fedora_qa.views.event_camera import (
    WINDOW_NS,
    events_before,
    intervals_due,
    is_large_sensor,
    seen_frames,
    sensor_shape,
    signal_of,
    tile_around,
    why_frames_and_events_do_not_meet,
)

Float64 = NDArray[np.float64]

INTERVALS: Final = 3
INTERVALS_OF_LARGE: Final = (2, 1)
"""Frame intervals of 0.2 s that are correlated, evenly spread; fewer of large sensors, as errors hardly fall with their
number: limits of 1 s of 640x480 grow by 2 to 5% with two, by another 3 to 4% with one. One will do in files from 1.6 s
on, where images are looked at as densely as ``full`` does, which leaves out no window."""

_DENSE_PX: Final = 0.2 * USUAL_PIXELS
"""Pixels of the largest image that are looked at: ``full`` looks at 0.25 of so many, ``standard`` at 0.1."""

LEAST_CORRELATION: Final = 0.1
"""Below this, events and frames are not of one scene, and a peak is chance (unrelated ones reach 0.03)."""

FEWEST_INTERVALS: Final = 4

REACH_PX: Final = RADIUS_PX - 1
"""Farthest shift whose peak can be seen from both sides; farther ones are told by blocks of pixels."""

_OF_FRAMES: Final = (
    Suspect("spatial_offset", "rgb", 0.7),
    Suspect("swapped_frames", "rgb", 0.5),
    Suspect("frozen_frames", "rgb", 0.5),
)
"""What frames do for a while to make events seem shifted; a region of events cannot come from them."""


@dataclass(frozen=True, slots=True)
class Correlations:
    """Sums over the lit pixels of some frame intervals.

    Attributes
    ----------
    patches
        (k, s, s) cross-correlations of frame changes with event changes, without pixels whose events have turned.
    with_turned, settled
        (k, s, s) with them, and without those too whose frames have turned against their events.
    squares
        (k, 2) squares of both changes, without pixels whose events have turned.
    slopes
        (k, 3, 2) to the right and down: as ``registration_errors`` takes them.
    far
        The patches at half the resolution, for shifts beyond the reach of these.
    tiles
        The same of each tile of the image, summed over the intervals.
    start_ns, stop_ns
        Of the window.
    """

    patches: Float64
    with_turned: Float64
    settled: Float64
    squares: Float64
    slopes: Float64
    far: FarSums
    tiles: PartSums
    start_ns: int
    stop_ns: int


class EventResponseAlignment(WindowCheck[Correlations]):
    """Do events lie at the pixels where the frames change?

    The shift of events against frames, to the right and down, in px of the event camera (positive: events lie too far
    right or down).

    Why it matters
    --------------
    A crop or a half-pixel convention that differs between both sensors displaces every label that is carried over from
    frames to events, flow and depth above all.

    How
    ---
    The change of the signal between two frames is cross-correlated with the signed events in between, over shifts of up
    to eight pixels; the peak of the sum over three intervals each 0.2 s (one or two of large sensors) is found to a
    fraction of a pixel by parabolas. Farther ones, up to fourteen pixels, are found to half a pixel on blocks of 2 x 2.
    A pixel whose brightness has turned fires late: it must first come back through both thresholds. Such hysteresis
    drags events behind the motion, so pixels whose events change sign within the interval or since the one before are
    left out. Shift and delay are nearly one along the mean motion and are fitted alone, not jointly: a late stream
    appears shifted here, by its delay times that motion, and event_response.timing tells which it is.

    Noise model
    -----------
    With g the slope of the change in the image and e what events leave open of it (variance 2/3 C^2), the peak moves
    by the regression of e on g: a standard error of C sqrt(2/3 / sum g^2) in one interval. It is not divided by the
    number of intervals, as e hardly changes where little moves. The spread when intervals are left out in turn is
    taken where it is larger. Pixels that have turned and not yet fired drag still. Those whose frames change against
    their last events can be left out too, and others are fewer: what leaving out all that are known changes is allowed
    for. Each window and each of 4 x 4 tiles is also held against the median
    of all (tiles where they correlate by a half at least); where there are ten or more, their usual scatter counts if
    it exceeds the errors.

    Cannot see
    ----------
    Shifts beyond fourteen pixels or of unrelated scenes (correlation below 0.1), shifts along edges all of one
    direction, rotations and scales; parts with few edges. Hovering leaves the error too large: not_observable.

    Sources
    -------
    First principles (event_shift, registration_errors); delete-one jackknife: Efron and Stein 1981.
    """

    name = "event_response.alignment"
    needs = ("events", "rgb")
    _MATTERS_PX: Final = 2.0

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> Correlations | None:
        """Correlate some intervals of the window."""
        seen, declared = seen_frames(window), window.facts.declared.events
        if declared is None or len(seen) < 2:
            return None
        wanted, last = intervals_due(window, seen, _a_window(window)), len(seen) - 2
        if wanted <= 0:
            return None
        # What came before the first interval is asked only where there is no other.
        chosen = np.unique(np.linspace(min(1, last), last, wanted).round().astype(int)).tolist()
        before = events_before(seen, window) if last == 0 else None
        signals, thresholds = partial(signal_of, seen, declared), (declared.threshold_on, declared.threshold_off)
        sums = [_sums(one) for one in intervals(signals, seen.counts, *thresholds, chosen, before)]
        whole, dragged, settled, far, tiles = zip(*sums, strict=True)
        return Correlations(
            np.concatenate([one.patches for one in whole]),
            np.array(dragged),
            np.array(settled),
            np.concatenate([one.squares for one in whole]),
            np.concatenate([one.slopes for one in whole]),
            joined(far),
            added(tiles),
            window.span.start_ns,
            window.span.stop_ns,
        )

    def conclude(self, state: Sequence[Correlations], facts: Facts) -> Observation:
        """Find the peak of all."""
        coverage = Coverage(sum(len(one.patches) for one in state), _intervals(facts), "frame intervals")
        if coverage.seen < FEWEST_INTERVALS:
            return Observation(coverage, unobservable="fewer than four frame intervals with events")
        patches = np.concatenate([one.patches for one in state])
        squares = np.sum([one.squares.sum(axis=0) for one in state], axis=0)
        far = far_shift(joined([one.far for one in state]), REACH_PX, LEAST_CORRELATION)
        found = _near(patches, squares) if far is None else (far.shift, far.errors_px)
        if isinstance(found, str) or facts.declared.events is None:
            return Observation(coverage, unobservable=str(found))
        shift, spread = found
        threshold = max(facts.declared.events.threshold_on, facts.declared.events.threshold_off)
        slopes = np.concatenate([one.slopes for one in state])
        left_open, lags = open_level_errors(slopes.mean(axis=0), threshold)
        errors = np.maximum(spread, left_open)
        lags = np.minimum(lags, _drag(shift, state)) if far is None else lags
        whole = [self._one(shift, errors, lags, axis) for axis in (0, 1)]
        return Observation(coverage, (*whole, *self._parts(state, threshold, lags, facts)))

    def _parts(self, state: Sequence[Correlations], threshold: float, lags: Float64, facts: Facts) -> list[Statistic]:
        """State the stretch and the region that are shifted most against the rest."""
        found = []
        windows = [PartSums(*(getattr(one, name).sum(axis=0) for name in PartSums.__slots__)) for one in state]
        usual = max(len(one.patches) for one in state)
        dragged = np.array([one.with_turned.sum(axis=0) for one in state])
        stretch = most_shifted(stacked(windows), usual, threshold, LEAST_CORRELATION, dragged)
        if stretch is not None:
            chosen = [one for one, alike in zip(state, stretch.alike, strict=True) if alike]
            start_us, stop_us = facts.to_file_us(chosen[0].start_ns), facts.to_file_us(chosen[-1].stop_ns)
            where = Where(stream="events", start_us=start_us, stop_us=stop_us)
            place = f"From {start_us / US_PER_S:.2f} s to {stop_us / US_PER_S:.2f} s"
            found.append(self._part("stretch", stretch, lags, where, place))
        intervals = sum(len(one.patches) for one in state)
        region = most_shifted(added([one.tiles for one in state]), intervals, threshold, CLEAR)
        if region is not None:
            tile = tile_around(region.alike, sensor_shape(facts.declared))
            place = f"In columns {tile[0]} to {tile[2] - 1}, rows {tile[1]} to {tile[3] - 1}"
            found.append(self._part("region", region, lags, Where(stream="events", tile=tile), place))
        return found

    def _part(self, rule: str, found: Shifted, lags: Float64, where: Where, place: str) -> Statistic:
        word, error = ("right", "down")[found.axis], found.standard_error_px
        return Statistic(
            name=f"shift_in_a_{rule}",
            value=found.shift_px,
            unit="px",
            standard_error=error,
            model_error_bound=float(lags[found.axis]),
            tests=2 * found.compared,
            material=self._MATTERS_PX,
            statement=f"{place} events lie {found.shift_px:+.3g} +/- {error:.2g} px ({word} positive) from where they "
            "lie in the rest.",
            code=f"event_response.alignment.{rule}",
            where=where,
            suspects=(
                Suspect("spatial_offset", "events", 0.9, found.shift_px if found.axis == 0 else None, "px", error),
                *(_OF_FRAMES if rule == "stretch" else ()),
                Suspect("event_model_misdeclared", "events", 0.5),
                Suspect("time_offset", "events", 0.5),
                Suspect("clock_rate", "events", 0.4),
            ),
        )

    def _one(self, shift: Shift, errors: Float64, lags: Float64, axis: int) -> Statistic:
        name, value, word = (("shift_right", shift.right_px, "right"), ("shift_down", shift.down_px, "down"))[axis]
        error = float(errors[axis])
        magnitude = value if axis == 0 else None
        return Statistic(
            name=name,
            value=value,
            unit="px",
            standard_error=error,
            model_error_bound=float(lags[axis]),
            material=self._MATTERS_PX,
            statement=f"Events lie {value:+.3g} +/- {error:.2g} px ({word} positive) from where the frames change.",
            code="event_response.alignment.shift",
            where=Where(stream="events"),
            suspects=(
                Suspect("spatial_offset", "events", 0.8, magnitude, "px", error if magnitude is not None else None),
                Suspect("spatial_offset", "rgb", 0.6, None if magnitude is None else -magnitude, "px"),
                Suspect("time_offset", "events", 0.5),
                Suspect("time_offset", "rgb", 0.5),
                Suspect("clock_rate", "events", 0.4),
                Suspect("event_model_misdeclared", "events", 0.3),
                Suspect("intrinsics_centre", "metadata", 0.4),
            ),
        )


def _a_window(window: Window) -> int:
    """Return how many intervals of a window of the usual length are correlated."""
    if not is_large_sensor(window):
        return INTERVALS
    times_ns, cameras = window.facts.clocks["rgb"].times_ns, window.facts.declared.cameras.values()
    long = int(times_ns[-1] - times_ns[0]) >= 2 * FEWEST_INTERVALS * WINDOW_NS
    dense = window.sampling.tile_share * max(one.width * one.height for one in cameras) >= _DENSE_PX
    return INTERVALS_OF_LARGE[long and dense]


def _near(patches: Float64, squares: Float64) -> tuple[Shift, Float64] | str:
    """Return the shift within reach and its spread (right, down), or why there is none."""
    total = patches.sum(axis=0)
    strength = float(total.max()) / max(float(np.sqrt(squares.prod())), 1e-300)
    shift = peak(total)
    if shift is None or strength < LEAST_CORRELATION:
        return f"events and frames correlate by no more than {strength:.2g} within {RADIUS_PX} px"
    spread = _jackknife(patches, total)
    return "the peak depends on single frame intervals" if spread is None else (shift, spread)


def _drag(shift: Shift, state: Sequence[Correlations]) -> Float64:
    """Return (2,) how far pixels that have turned move the peak: those whose events turned, plus those yet to fire."""
    moved = np.zeros(2)
    for others in ([one.with_turned for one in state], [one.settled for one in state]):
        other = peak(np.sum([patches.sum(axis=0) for patches in others], axis=0))
        if other is None:
            return np.full(2, np.inf)
        moved += abs(np.array([other.right_px - shift.right_px, other.down_px - shift.down_px]))
    return moved


def _sums(interval: Interval) -> tuple[PartSums, Float64, Float64, FarSums, PartSums]:
    """Return the sums of one frame interval, as in ``Correlations``."""
    height, width = interval.flags.shape
    whole = interval.sums(KEPT, [(0, height, 0, width)])
    far = far_sums(interval.change, interval.events, (interval.flags & KEPT).astype(np.bool_))
    return whole, interval.patch(USABLE), interval.patch(SETTLED), far, tiles_of(interval, KEPT)


def _intervals(facts: Facts) -> int:
    return max(len(facts.clocks["rgb"].times_ns) - 1, 0)


def _jackknife(patches: Float64, total: Float64) -> Float64 | None:
    """Return the spread of the peak (right, down) when intervals are left out in turn; None where it is lost."""
    found = [peak(total - patch) for patch in patches]
    known = [(shift.right_px, shift.down_px) for shift in found if shift is not None]
    if len(known) < len(found):
        return None
    spread: Float64 = np.sqrt((len(known) - 1) * np.var(known, axis=0))
    return spread

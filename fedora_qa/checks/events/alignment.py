"""Events against log intensity: place in the image."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.events.view import SeenFrames, seen_frames, signal, why_frames_and_events_do_not_meet
from fedora_qa.checks.protocol import Measured, Observation, Suspect, WindowCheck
from fedora_qa.estimators.event_shift import RADIUS_PX, Shift, cross_correlation, peak, turned_pixels
from fedora_qa.estimators.registration_errors import open_level_errors, slope_sums
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

Float64 = NDArray[np.float64]

INTERVALS: Final = 3
"""Frame intervals of a window that are correlated, evenly spread."""

LEAST_CORRELATION: Final = 0.1
"""Below this, events and frames are not of one scene, and a peak is chance (unrelated ones reach 0.03)."""

FEWEST_INTERVALS: Final = 4


@dataclass(frozen=True, slots=True)
class Correlations:
    """Sums over the lit pixels of some frame intervals.

    Attributes
    ----------
    patches
        (k, s, s) cross-correlations of frame changes with event changes, without pixels that have turned.
    with_turned
        (k, s, s) with them.
    squares
        (k, 2) squares of both changes, without pixels that have turned.
    slopes
        (k, 3, 2) to the right and down: as ``registration_errors`` takes them.
    """

    patches: Float64
    with_turned: Float64
    squares: Float64
    slopes: Float64


class Alignment(WindowCheck[Correlations]):
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
    to eight pixels; the peak of the sum over three intervals a window is found to a fraction of a pixel by parabolas.
    A pixel whose brightness has turned fires late: it must first come back through both thresholds. Such hysteresis
    drags events behind the motion, so pixels whose events change sign within the interval or since the one before are
    left out. Shift and delay are nearly one along the mean motion and are fitted alone, not jointly: a late stream
    appears shifted here, by its delay times that motion, and event_response.timing tells which it is.

    Noise model
    -----------
    With g the slope of the change in the image and e what events leave open of it (variance 2/3 C^2), the peak moves by
    the regression of e on g: a standard error of C sqrt(2/3 / sum g^2) in one interval. It is not divided by the number
    of intervals, as e hardly changes where little moves. The spread when intervals are left out in turn is taken where
    it is larger. Pixels that have turned and not yet fired are not known; about as many have fired, so what leaving
    those out changes is allowed for.

    Cannot see
    ----------
    Shifts beyond eight pixels or of unrelated scenes (correlation below 0.1), shifts along edges all of one direction,
    rotations and scales. Hovering leaves the error too large: not_observable.

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
        levels, lit = signal(seen, declared)
        turned = turned_pixels(seen.counts)
        # Nothing is known of the events before the first interval, which is taken only where there is no other.
        chosen = np.unique(np.linspace(min(1, len(turned) - 1), len(turned) - 1, INTERVALS).round().astype(int))
        sums = [_interval(levels, lit, turned, seen, declared, int(i)) for i in chosen]
        return Correlations(*(np.array(part) for part in zip(*sums, strict=True)))

    def conclude(self, state: Sequence[Correlations], facts: Facts) -> Observation:
        """Find the peak of all."""
        coverage = Coverage(sum(len(one.patches) for one in state), _intervals(facts), "frame intervals")
        if coverage.seen < FEWEST_INTERVALS:
            return Observation(coverage, unobservable="fewer than four frame intervals with events")
        patches = np.concatenate([one.patches for one in state])
        squares = np.sum([one.squares.sum(axis=0) for one in state], axis=0)
        total = patches.sum(axis=0)
        strength = float(total.max()) / max(float(np.sqrt(squares.prod())), 1e-300)
        shift = peak(total)
        if shift is None or strength < LEAST_CORRELATION:
            return Observation(
                coverage,
                unobservable=f"events and frames correlate by no more than {strength:.2g} within {RADIUS_PX} px",
            )
        spread = _jackknife(patches, total)
        if spread is None or facts.declared.events is None:
            return Observation(coverage, unobservable="the peak depends on single frame intervals")
        threshold = max(facts.declared.events.threshold_on, facts.declared.events.threshold_off)
        slopes = np.concatenate([one.slopes for one in state])
        left_open, lags = open_level_errors(slopes.mean(axis=0), threshold)
        errors = np.maximum(spread, left_open)
        dragged = peak(np.sum([one.with_turned.sum(axis=0) for one in state], axis=0))
        if dragged is not None:
            moved = abs(np.array([dragged.right_px - shift.right_px, dragged.down_px - shift.down_px]))
            lags = np.minimum(lags, moved)
        return Observation(coverage, tuple(self._one(shift, errors, lags, axis) for axis in (0, 1)))

    def _one(self, shift: Shift, errors: Float64, lags: Float64, axis: int) -> Measured:
        name, value, word = (("shift_right", shift.right_px, "right"), ("shift_down", shift.down_px, "down"))[axis]
        error = float(errors[axis])
        magnitude = value if axis == 0 else None
        return Measured(
            name=name,
            value=value,
            unit="px",
            standard_error=error,
            allowance=float(lags[axis]),
            matters=self._MATTERS_PX,
            statement=f"Events lie {value:+.3g} +/- {error:.2g} px ({word} positive) from where the frames change.",
            code="event_response.alignment.shift",
            where=Where(stream="events"),
            suspects=(
                Suspect("spatial_offset", "events", 0.8, magnitude, "px", error if magnitude is not None else None),
                Suspect("spatial_offset", "rgb", 0.6, None if magnitude is None else -magnitude, "px"),
                Suspect("time_offset", "events", 0.5),
                Suspect("time_offset", "rgb", 0.5),
                Suspect("clock_rate", "events", 0.4),
                Suspect("intrinsics_centre", "metadata", 0.4),
            ),
        )


def _interval(
    levels: Float64,
    lit: NDArray[np.bool_],
    turned: NDArray[np.bool_],
    seen: SeenFrames,
    declared: EventModel,
    i: int,
) -> tuple[Float64, Float64, Float64, Float64]:
    """Return the sums of one frame interval, as in ``Correlations``."""
    usable = lit[i] & lit[i + 1]
    change = np.where(usable, levels[i + 1] - levels[i], 0.0)
    events = declared.threshold_on * seen.counts[i, 1] - declared.threshold_off * seen.counts[i, 0]
    kept = usable & ~turned[i]
    squares = np.array([np.sum(change[kept] ** 2), np.sum(events[kept] ** 2)])
    return (
        cross_correlation(change, events, kept),
        cross_correlation(change, events, usable),
        squares,
        slope_sums(levels[i], change, kept),
    )


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

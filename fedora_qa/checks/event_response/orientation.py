"""Events against log intensity: axes, directions and sign."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_response.turned import (
    LEAST_PREDICTED,
    Turned,
    causes_of,
    most_turned,
    others_of,
    words_for,
)
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import US_PER_S
from fedora_qa.estimators.events.orientation import BLOCK_PX, SYMMETRIES, Moments
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_blocks import block_moments
from fedora_qa.views.event_camera import (
    sensor_shape,
    tile_around,
    why_frames_and_events_do_not_meet,
)

Float64 = NDArray[np.float64]

_OTHERS: Final = 2 * len(SYMMETRIES) - 1

FEWEST_WINDOWS: Final = 4


@dataclass(frozen=True, slots=True)
class Agreement:
    """Moments of one window under the eight symmetries: between successive frames, and over the whole window.

    ``tiles`` (t, 8, 6) are the sums of moments between successive frames of each tile of the image.
    ``start_ns`` and ``stop_ns`` are those of the window.
    """

    steps: Moments
    span: Moments
    tiles: Float64
    start_ns: int
    stop_ns: int


class EventResponseOrientation(WindowCheck[Agreement]):
    """Do events and frames agree in axes, direction and sign?

    The correlation of what frames and events say has changed, as declared and under the eight symmetries of the square
    and both signs: over the file, in each window of 0.2 s, and in each of 4 x 4 tiles of the image.

    Why it matters
    --------------
    Plugins and loaders differ in polarity codes, in the order of x and y and in where rows begin. Nothing else in a
    file shows it, and a network trained on such events learns a world that moves the other way.

    How
    ---
    The change of the signal between successive frames is correlated with the signed events in between, averaged over
    4 x 4 px blocks, which forgives small shifts. Where frames change too little from one to the next, the change over
    a window is taken. The declared orientation must correlate by at least half of what is due, and better than all
    fifteen others; the orientation that correlates best names the cause. The same is asked of each window, and of
    each tile over all windows, so that a stretch or a region that was written differently is found and placed, where
    at least a quarter agrees.

    Noise model
    -----------
    Events leave each pixel's level open by C+ and C-, a variance of 2/3 C+ C- of a change, averaged over a block; with
    s the variance that frames show, a correlation of sqrt(s / (s + noise)) is due. Standard errors are by leaving
    windows out in turn, of parts three times those of independent blocks, as blocks of one moving texture are not.

    Cannot see
    ----------
    Parts in which a correlation below 0.3 is due (hovering, no texture, night): not_observable where that is the whole
    file. Shifts (event_response.alignment), small delays (event_response.timing), and symmetries of the scene itself.

    Sources
    -------
    First principles (turned, event_orientation); delete-one jackknife: Efron and Stein 1981.
    """

    name = "event_response.orientation"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> Agreement | None:
        """Correlate in one window."""
        blocks = block_moments(window)
        if blocks is None:
            return None
        tiles = blocks.steps.sum(axis=0)
        start_ns, stop_ns = window.span.start_ns, window.span.stop_ns
        return Agreement(Moments(tiles.sum(axis=0)), blocks.span, tiles, start_ns, stop_ns)

    def conclude(self, state: Sequence[Agreement], facts: Facts) -> Observation:
        """Compare the orientations over all windows."""
        coverage = Coverage(len(state), len(state), "windows")
        declared = facts.declared.events
        if not state or declared is None:
            return Observation(coverage, unobservable="no two frames with events around them")
        noise = 2 / 3 * declared.threshold_on * declared.threshold_off / BLOCK_PX**2
        kinds = [[one.steps for one in state], [one.span for one in state]]
        predicted = [_predicted(kind, noise) for kind in kinds]
        best = int(np.argmax(predicted))
        if not np.any([one.sums[:, 4] for one in kinds[best]]):
            return Observation(coverage, unobservable="no events between the frames (see event_response.conservation)")
        if predicted[best] < LEAST_PREDICTED:
            return Observation(
                coverage,
                unobservable=f"too little changes between frames: a correlation of only {predicted[best]:.2g} is due",
            )
        events = facts.events.count if facts.events is not None else 0
        whole = _state(kinds[best], predicted[best], events)
        return Observation(coverage, (*whole, *self._parts(state, noise, facts)))

    def _parts(self, state: Sequence[Agreement], noise: float, facts: Facts) -> list[Statistic]:
        """State the stretch and the region that gain most by another orientation."""
        found = []
        stretch = most_turned([one.steps for one in state], noise)
        if stretch is not None:
            chosen = [one for one, inside in zip(state, stretch.parts, strict=True) if inside]
            start_us, stop_us = facts.to_file_us(chosen[0].start_ns), facts.to_file_us(chosen[-1].stop_ns)
            where = Where(stream="events", start_us=start_us, stop_us=stop_us)
            place = f"From {start_us / US_PER_S:.2f} s to {stop_us / US_PER_S:.2f} s"
            found.append(_part("advantage_in_a_stretch", "stretch", stretch, where, place))
        tiles = np.sum([one.tiles for one in state], axis=0)
        region = most_turned([Moments(sums) for sums in tiles], noise)
        if region is not None:
            tile = tile_around(region.parts, sensor_shape(facts.declared))
            place = f"In columns {tile[0]} to {tile[2] - 1}, rows {tile[1]} to {tile[3] - 1}"
            found.append(_part("advantage_in_a_region", "region", region, Where(stream="events", tile=tile), place))
        return found


def _part(name: str, rule: str, turned: Turned, where: Where, place: str) -> Statistic:
    return Statistic(
        name=name,
        value=turned.other - turned.declared,
        unit="1",
        standard_error=turned.standard_error,
        side="upper",
        tests=turned.compared * _OTHERS,
        material=1.0,
        statement=f"{place} events agree with the frames as {words_for(turned.rival)}: correlation "
        f"{turned.other:.2g}, as they stand {turned.declared:.2g}.",
        code=f"event_response.orientation.{rule}",
        where=where,
        suspects=causes_of(turned.rival),
    )


def _state(kind: Sequence[Moments], predicted: float, events: int) -> tuple[Statistic, ...]:
    correlations = _pooled(kind)
    others = others_of(correlations)
    rival = int(np.argmax(others))
    advantage = float(others[rival] - correlations[0])
    errors = _errors(kind, rival)
    found = causes_of(rival) if others[rival] > max(predicted / 2, correlations[0]) else _UNRELATED
    if not events:
        found = _NONE_LEFT
    agreement = Statistic(
        name="correlation",
        value=float(correlations[0]),
        unit="1",
        standard_error=errors[0],
        expected=predicted,
        model_error_bound=predicted / 2,
        side="lower",
        # Unrelated events lead from what is due, which may err by the allowance, to nothing.
        material=1.5 * predicted,
        statement=f"Events and frames correlate by {correlations[0]:.2g}; about {predicted:.2g} is due.",
        code="event_response.orientation.unrelated",
        where=Where(stream="events"),
        suspects=found,
    )
    alternative = Statistic(
        name="advantage_of_another_orientation",
        value=advantage,
        unit="1",
        standard_error=errors[1],
        side="upper",
        # So much better would the right orientation be than one that is unrelated, if another were the right one.
        material=float(np.max(np.abs(correlations))),
        tests=len(others),
        statement=f"Events agree with the frames as {words_for(rival)}: correlation {others[rival]:.2g}, "
        f"as they stand {correlations[0]:.2g}.",
        code="event_response.orientation.other",
        where=Where(stream="events"),
        suspects=found,
    )
    return agreement, alternative


def _predicted(kind: Sequence[Moments], noise: float) -> float:
    """Return the correlation that is due: signal over signal and noise."""
    signal = Moments(np.sum([one.sums for one in kind], axis=0)).frame_variance()
    return float(np.sqrt(signal / (signal + noise)))


def _pooled(kind: Sequence[Moments]) -> Float64:
    return Moments(np.sum([one.sums for one in kind], axis=0)).correlations()


def _errors(kind: Sequence[Moments], rival: int) -> tuple[float, float]:
    """Return standard errors of the correlation and of the rival's advantage, by leaving windows out in turn.

    Blocks of one moving texture are not independent: with too few windows three times the error of independent
    blocks is taken.
    """
    sums = np.array([one.sums for one in kind])
    floor = 3 / float(np.sqrt(max(sums[:, 0, 0].sum(), 1.0)))
    n = len(sums)
    if n < FEWEST_WINDOWS:
        return floor, floor
    left_out = [Moments(sums.sum(axis=0) - one).correlations() for one in sums]
    values = np.array([(one[0], others_of(one)[rival] - one[0]) for one in left_out])
    spread = np.sqrt((n - 1) * values.var(axis=0))
    return max(float(spread[0]), floor / 3), max(float(spread[1]), floor / 3)


_NONE_LEFT: Final = (Suspect("dropped_samples", "events", 0.95),)

_UNRELATED: Final = (
    Suspect("other_sequence", "events", 0.9),
    Suspect("other_sequence", "rgb", 0.7),
    Suspect("time_offset", "events", 0.6),
    Suspect("time_offset", "rgb", 0.5),
    Suspect("time_unit", "events", 0.4),
)
"""What leaves no correlation in any orientation; ``event_response.timing`` looks for an offset."""

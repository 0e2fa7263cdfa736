"""Events against log intensity: axes, directions and sign."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.events.view import (
    all_events,
    seen_frames,
    sensor_shape,
    signal,
    why_frames_and_events_do_not_meet,
)
from fedora_qa.checks.protocol import Measured, Observation, Suspect, WindowCheck
from fedora_qa.estimators.event_kernels import count_between_frames
from fedora_qa.estimators.event_orientation import BLOCK_PX, SYMMETRIES, Moments, block_means, moments, undone
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events, Window

Float64 = NDArray[np.float64]

LEAST_PREDICTED: Final = 0.3
"""Below this correlation the noise model of the prediction itself is in doubt."""

FEWEST_WINDOWS: Final = 4


@dataclass(frozen=True, slots=True)
class Agreement:
    """Moments of one window under the eight symmetries: between successive frames, and over the whole window."""

    steps: Moments
    span: Moments


class Orientation(WindowCheck[Agreement]):
    """Do events and frames agree in axes, direction and sign?

    The change of L between frames is correlated with the signed events in between, averaged over 4x4 blocks, under
    the eight symmetries of the square and both signs. The declared orientation must correlate best, and by at least
    half of what is predicted: events leave each pixel's level open by C+ and C-, a variance of 2/3 C^2, averaged over
    a block. Where the frames change by less than that between them, the change over the window is taken; where that
    is too little as well, the scene is too quiet to tell.
    """

    name = "event_response.orientation"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> Agreement | None:
        """Correlate in one window."""
        seen, declared = seen_frames(window), window.facts.declared.events
        if declared is None or len(seen) < 2:
            return None
        levels, lit = signal(seen, declared)
        counts = _square_counts(window, seen.times_ns)
        signed = declared.threshold_on * counts[:, 1] - declared.threshold_off * counts[:, 0]
        shape = sensor_shape(window.facts.declared)
        steps = [_moments(levels, lit, i, i + 1, undone(image, shape)).sums for i, image in enumerate(signed)]
        span = _moments(levels, lit, 0, -1, undone(signed.sum(axis=0), shape))
        return Agreement(Moments(np.sum(steps, axis=0)), span)

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
        return Observation(coverage, _state(kinds[best], predicted[best], events))


def _state(kind: Sequence[Moments], predicted: float, events: int) -> tuple[Measured, ...]:
    correlations = _pooled(kind)
    others = _others(correlations)
    rival = int(np.argmax(others))
    advantage = float(others[rival] - correlations[0])
    errors = _errors(kind, rival)
    found = _named(rival) if others[rival] > max(predicted / 2, correlations[0]) else _UNRELATED
    if not events:
        found = _NONE_LEFT
    agreement = Measured(
        name="correlation",
        value=float(correlations[0]),
        unit="1",
        standard_error=errors[0],
        expected=predicted,
        allowance=predicted / 2,
        side="lower",
        # Unrelated events lead from what is due, which may err by the allowance, to nothing.
        matters=1.5 * predicted,
        statement=f"Events and frames correlate by {correlations[0]:.2g}; about {predicted:.2g} is due.",
        code="event_response.orientation.unrelated",
        where=Where(stream="events"),
        suspects=found,
    )
    alternative = Measured(
        name="advantage_of_another_orientation",
        value=advantage,
        unit="1",
        standard_error=errors[1],
        side="upper",
        # So much better would the right orientation be than one that is unrelated, if another were the right one.
        matters=float(np.max(np.abs(correlations))),
        tests=len(others),
        statement=f"Events agree with the frames as {_words(rival)}: correlation {others[rival]:.2g}, "
        f"as they stand {correlations[0]:.2g}.",
        code="event_response.orientation.other",
        where=Where(stream="events"),
        suspects=found,
    )
    return agreement, alternative


def _square_counts(window: Window, times_ns: NDArray[np.int64]) -> NDArray[np.int32]:
    """Count events between frames on a square that also holds what exchanged axes would put outside the sensor."""
    side = max(sensor_shape(window.facts.declared))
    events = all_events(window)
    good = (events.x < side) & (events.y < side) & (events.p <= 1)
    if events.x.dtype.kind == "i" or events.y.dtype.kind == "i":
        good &= (events.x >= 0) & (events.y >= 0)
    if not good.all():
        x, y = events.x[good].astype(np.uint16), events.y[good].astype(np.uint16)
        events = Events(x, y, events.times_ns[good], events.p[good])
    counts = np.zeros((len(times_ns) - 1, 2, side, side), np.int32)
    count_between_frames(events.x, events.y, events.times_ns, events.p, times_ns, counts)
    return counts


def _moments(levels: Float64, lit: NDArray[np.bool_], earlier: int, later: int, events: list[Float64]) -> Moments:
    """Return the moments of the change between two frames, over blocks that are lit in both."""
    usable = lit[earlier] & lit[later]
    whole = block_means(usable.astype(np.float64)) > 1 - 1e-9
    return moments(block_means(np.where(usable, levels[later] - levels[earlier], 0.0)), events, whole)


def _predicted(kind: Sequence[Moments], noise: float) -> float:
    """Return the correlation that is due: signal over signal and noise."""
    signal = Moments(np.sum([one.sums for one in kind], axis=0)).frame_variance()
    return float(np.sqrt(signal / (signal + noise)))


def _pooled(kind: Sequence[Moments]) -> Float64:
    return Moments(np.sum([one.sums for one in kind], axis=0)).correlations()


def _others(correlations: Float64) -> Float64:
    """Return the correlations of the fifteen other orientations: the inverted ones first, then the upright ones."""
    upright = correlations[: len(SYMMETRIES)]
    return np.concatenate([-upright, upright[1:]])


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
    values = np.array([(one[0], _others(one)[rival] - one[0]) for one in left_out])
    spread = np.sqrt((n - 1) * values.var(axis=0))
    return max(float(spread[0]), floor / 3), max(float(spread[1]), floor / 3)


def _undo(rival: int) -> tuple[bool, tuple[bool, bool, bool]]:
    count = len(SYMMETRIES)
    return rival < count, SYMMETRIES[rival if rival < count else rival - count + 1]


def _words(rival: int) -> str:
    inverted, (swap, left, up) = _undo(rival)
    said = (inverted, "of inverted polarity"), (swap, "with exchanged axes"), (left, "mirrored left to right")
    return " and ".join(words for true, words in (*said, (up, "mirrored top to bottom")) if true)


def _named(rival: int) -> tuple[Suspect, ...]:
    inverted, (swap, left, up) = _undo(rival)
    causes = (("polarity_inverted", inverted), ("axes_swapped", swap), ("mirrored", left or up))
    return tuple(Suspect(cause, "events", 0.95) for cause, true in causes if true)


_NONE_LEFT: Final = (Suspect("dropped_samples", "events", 0.95),)

_UNRELATED: Final = (
    Suspect("other_sequence", "events", 0.9),
    Suspect("other_sequence", "rgb", 0.7),
    Suspect("time_offset", "events", 0.6),
    Suspect("time_offset", "rgb", 0.5),
    Suspect("time_unit", "events", 0.4),
)
"""What leaves no correlation in any orientation; ``event_response.timing`` looks for an offset."""

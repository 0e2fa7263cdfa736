"""Change of the light between two frames, from the events of a sensor behind a first-order low-pass.

Events follow the output y of the low-pass, frames its input x = y + tau dy/dt, with tau = 1 / (2 pi f). The derivative
is the central difference over a step h, so that

    x(t) = y(t) + tau / h (y(t + h/2) - y(t - h/2)).

At the angular frequency w the sum has the phase atan(2 tau / h sin(w h / 2)), and x has the phase atan(w tau). With
h = tau they differ by up to 0.05 tau of time for w tau <= 3, and by up to tau without the correction. The error grows
with h^2 (Taylor series), so that the distance to the result with 2 h is about three times the error of that with h.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.events.levels import LevelChanges, level_changes
from fedora_qa.estimators.events.pixels import PixelEvents

STEPS: Final = (1, 2)
"""Steps h of the difference, in time constants: of the result, and of the one that bounds its error."""


def time_constant_ns(bandwidth_hz: float) -> int:
    """Return tau = 1 / (2 pi f) of a low-pass with the cut-off f (Hz), ns; 0 without a low-pass (0 Hz)."""
    return round(NS_PER_S / (2 * np.pi * bandwidth_hz)) if bandwidth_hz > 0 else 0


def changes_of_light(
    events: PixelEvents,
    shape: tuple[int, int],
    frame_times_ns: tuple[int, int],
    thresholds: tuple[float, float],
    constant_ns: int,
    step: int = STEPS[0],
) -> LevelChanges:
    """Return the changes of the light between two frames, before a low-pass.

    Parameters
    ----------
    events, shape, frame_times_ns, thresholds
        As of ``level_changes``, which is the result without a low-pass.
    constant_ns
        Time constant tau of the low-pass, ns; 0 without one.
    step
        Step h of the difference, in time constants.

    Returns
    -------
    LevelChanges
        Known where the level is known at all instants.
    """
    at_frames = level_changes(events, shape, frame_times_ns, thresholds)
    if constant_ns == 0:
        return at_frames
    half = step * constant_ns // 2
    start, stop = frame_times_ns
    later = level_changes(events, shape, (start + half, stop + half), thresholds)
    earlier = level_changes(events, shape, (start - half, stop - half), thresholds)
    return LevelChanges(
        at_frames.mean + (later.mean - earlier.mean) / step,
        at_frames.line + (later.line - earlier.line) / step,
        at_frames.is_known & later.is_known & earlier.is_known,
    )


def level_error_gain(
    event_times_ns: NDArray[np.int64], frame_times_ns: tuple[int, int], constant_ns: int, pixels: int
) -> float:
    """Return the ratio of the variance of ``changes_of_light`` by undetermined levels to that of ``level_changes``.

    The levels at t + h/2 and t - h/2 have independent errors only if the pixel has an event between. Without one both
    lie between the same two references, and their difference is exact to first order. With a share s of pixels that
    have one, the variance is 1 + 2 s.

    Parameters
    ----------
    event_times_ns
        (m,) times of all events, in order, ns.
    frame_times_ns
        Times of both frames, ns.
    constant_ns
        Time constant of the low-pass, ns, which is also the step h.
    pixels
        Pixels with a change by events.

    Returns
    -------
    float
        1 to 3.
    """
    half = constant_ns // 2
    between = sum(
        int(np.diff(np.searchsorted(event_times_ns, (time - half, time + half)))[0]) for time in frame_times_ns
    )
    # A change has errors at two frames.
    return 1.0 + 2.0 * min(1.0, between / (2 * max(pixels, 1)))
